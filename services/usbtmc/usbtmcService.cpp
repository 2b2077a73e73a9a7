// usbtmc -- an instrument at a USB port, by the kernel's driver: messages out, answers in, its status byte. Class scpi speaks SCPI by it.
//
//     usbtmc.a CTRL -to /dev/usbtmc0
//     usbtmc.a EXEC write AMSG ...            then EXEC read
//
// One EXEC at a time has the device. It runs on a thread of its own, so nobody else in the daemon waits.
#include <algorithm>
#include <memory>
#include <system_error>
#include <thread>
#include <utility>

#include <sorma.h>

#include "bus/signalsBlocked.h"
#include "device.h"

namespace {

using sorma::Message;
using sorma::Severity;
using usbtmc::Trouble;

const sorma::Prototype kAddress{Severity::error, "USBTMC ADDRESS", 1, "{}: {}"};
const sorma::Prototype kRequest{Severity::error, "USBTMC REQUEST", 1, "{}: {}"};
const sorma::Prototype kUnreachable{Severity::error, "USBTMC UNREACHABLE", 1, "{}: {}"};
const sorma::Prototype kLost{Severity::error, "USBTMC LOST", 1, "{}: {}"};
const sorma::Prototype kSilent{Severity::error, "USBTMC SILENT", 1, "{}: {}"};
const sorma::Prototype kAnswer{Severity::error, "USBTMC ANSWER", 1, "{}: {}"};
const sorma::Prototype kTooBig{Severity::error, "USBTMC TOO_BIG", 1, "{}: {}"};
const sorma::Prototype kUnsupported{Severity::error, "USBTMC UNSUPPORTED", 1, "{}: {}"};
const sorma::Prototype kGone{Severity::error, "SERVICE GONE", 1, "{}: the service object has been removed"};

sorma::Error errorOf(const std::string& name, const usbtmc::Failure& f) {
    static constexpr const sorma::Prototype* kByTrouble[] = {&kUnreachable, &kLost, &kSilent, &kAnswer, &kTooBig, &kUnsupported};
    return sorma::Error(sorma::makeEntry(*kByTrouble[std::size_t(f.trouble)], {sorma::MessageArg::of(name), sorma::MessageArg::of(f.text)}));
}

class Usbtmc final : public sorma::Service {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return sorma::Class::of<Usbtmc>("usbtmc", "messages to an instrument at a USB port, and its answers")
            .named("-to", &Usbtmc::to_, {.help = "the file of the kernel's driver, such as /dev/usbtmc0"})
            .action("-close", &Usbtmc::closeAction, "", "close the file when it is free; the next request opens it again")
            .inspection({"-line", "", "is the file open", 0, 0, [](Service& s, sorma::Args, Message& m) { m.text += static_cast<Usbtmc&>(s).state(); }})
            .reads(floats, sorma::between(0, 1), "s", "how long each transfer may take, 0.1 s at least; without: 5", 0.001, 3600)
            .reads(ints, sorma::between(0, 1), "B", "read: the longest answer that is taken; without: 67108864", 1, 2147483647)
            .reads(any, {}, "", "write: the message")
            .words("open | write | read | status | trigger | clear")
            .writes(any, {}, "", "read: the answer")
            .writes(ints, {}, "", "status: the status byte")
            .execDanger(sorma::Danger::power, {"write", "trigger", "clear"})
            .example("usbtmc.a CTRL -to /dev/usbtmc0");
    }

    ~Usbtmc() override { removing(); }

    void exec(Message& m) override {
        if (to_.empty()) sorma::fail(kAddress, name(), "names no device: say \"" + name() + " CTRL -to /dev/usbtmc0\"");
        static constexpr std::string_view kVerbs[] = {"open", "write", "read", "status", "trigger", "clear"};
        const auto verb = m.words.empty() ? std::end(kVerbs) : std::find(std::begin(kVerbs), std::end(kVerbs), m.words[0]);
        if (verb == std::end(kVerbs) || m.words.size() != 1)
            sorma::fail(kRequest, name(), "expected open, write, read, status, trigger or clear, got \"" + (m.words.empty() ? std::string() : m.words[0].substr(0, 100)) + "\"");
        if (*verb == "write" && m.any.empty()) sorma::fail(kRequest, name(), "write expects a message in the any part");
        const std::string& to = to_.use(*this);
        if (!device_ || device_->path() != to) device_ = std::make_shared<usbtmc::Device>(to);
        sorma::Charge charge(sorm().budget.ofCaller(), sorma::Account::Use::threads);
        charge.need(name(), sorma::Account::kThread);
        start(m, *verb, std::move(charge));
    }

    // The thread ends by itself: it knows the device and the mailbox, and nothing of the object.
    void removing() override {
        if (auto job = std::exchange(job_, nullptr)) job->reply.fail(sorma::Error(sorma::makeEntry(kGone, {sorma::MessageArg::of(name())})));
    }

    void dumpState(std::string& out) const override { out += "# line " + state() + "\n"; }

private:
    struct Job {
        sorma::Reply reply;
        sorma::Charge charge;               // for its thread
    };
    struct Result {
        std::string bytes;
        int status = -1;
        std::unique_ptr<usbtmc::Failure> failure;
    };

    static void run(usbtmc::Device& device, std::string_view verb, const std::string& message, std::size_t most, double patience, Result& result) {
        try {
            if (verb == "open") device.open(patience);
            else if (verb == "write") device.write(message, patience);
            else if (verb == "read") result.bytes = device.read(most, patience);
            else if (verb == "status") result.status = device.status(patience);
            else if (verb == "trigger") device.trigger(patience);
            else device.clear(patience);
        } catch (const usbtmc::Failure& f) {
            result.failure = std::make_unique<usbtmc::Failure>(f);
        } catch (const std::exception& e) {
            result.failure = std::make_unique<usbtmc::Failure>(Trouble::lost, e.what());
        }
    }

    void start(Message& m, std::string_view verb, sorma::Charge charge) {
        const double patience = m.floats.empty() ? 5 : m.floats[0];
        const std::size_t most = m.ints.empty() ? 67'108'864 : std::size_t(m.ints[0]);
        std::string message(m.any.begin(), m.any.end());
        auto job = std::make_shared<Job>();
        job->charge = std::move(charge);
        job->reply = later(m);
        job->reply.message().clear();
        auto work = [this, box = sorm().mailbox(), weak = std::weak_ptr(job), device = device_, verb, message = std::move(message), most, patience] {
            auto result = std::make_shared<Result>();
            run(*device, verb, message, most, patience, *result);
            // The job is ours while the object lives; it goes before the object does.
            box->post([this, weak, result] {
                if (weak.lock()) ended(*result);
            });
        };
        job_ = job;
        try {
            sorma::SignalsBlocked blocked;
            std::thread(std::move(work)).detach();
        } catch (const std::system_error& e) {
            job_ = nullptr;
            job->reply.fail(e);
        }
    }

    void ended(Result& result) {
        auto job = std::exchange(job_, nullptr);
        job->charge.clear();
        if (std::exchange(closes_, false)) device_->close();
        if (job->reply.cancelled()) return job->reply.complete();       // nobody waits for it
        if (result.failure) return job->reply.fail(errorOf(name(), *result.failure));
        job->reply.message().any.assign(result.bytes.begin(), result.bytes.end());
        if (result.status >= 0) job->reply.message().ints.push_back(result.status);
        job->reply.complete();
    }

    void closeAction(sorma::Args, Message&) {
        if (job_) closes_ = true;
        else if (device_) device_->close();
    }
    std::string state() const { return device_ && device_->isOpen() ? "open to " + device_->path() : "closed"; }

    sorma::Named<sorma::Kind::file> to_;
    std::shared_ptr<usbtmc::Device> device_;    // null: nobody has needed it yet
    std::shared_ptr<Job> job_;                  // the request under way
    bool closes_ = false;                       // when that has ended
};

}  // namespace

extern "C" SORMA_EXPORT int Usbtmc_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::usbtmc", "1.0", {Usbtmc::describe()});
}
