// modbusline -- a line to Modbus devices, which several objects of class modbus share.
//
//     modbusline.bus CTRL -to tcp:192.168.0.9:502
//     modbusline.bus EXEC {write 1 holding 100 215} {read 1 holding 100 2}
//
// Each word is a request to a device. One EXEC at a time has the line, from its first word to its last. The others wait in their order, so no
// answer goes to the wrong one. It runs on a thread of its own, so nobody else in the daemon waits.
#include <memory>
#include <system_error>
#include <thread>
#include <utility>

#include <sorma.h>

#include "bus/signalsBlocked.h"
#include "line.h"

namespace {

using modbus::Trouble;
using sorma::Message;
using sorma::Severity;

const sorma::Prototype kAddress{Severity::error, "MODBUS ADDRESS", 1, "{}: -to {}"};
const sorma::Prototype kRequest{Severity::error, "MODBUS REQUEST", 1, "{}: {}"};
const sorma::Prototype kUnreachable{Severity::error, "MODBUS UNREACHABLE", 1, "{}: {}"};
const sorma::Prototype kLost{Severity::error, "MODBUS LOST", 1, "{}: {}"};
const sorma::Prototype kSilent{Severity::error, "MODBUS SILENT", 1, "{}: {}"};
const sorma::Prototype kDevice{Severity::error, "MODBUS DEVICE", 2, "{0}: {2}"};
const sorma::Prototype kAnswer{Severity::error, "MODBUS ANSWER", 1, "{}: {}"};
const sorma::Prototype kGone{Severity::error, "SERVICE GONE", 1, "{}: the service object has been removed"};

constexpr std::size_t kMostOperations = 1000;

sorma::Error errorOf(const std::string& name, const modbus::Failure& f) {
    auto of = [](const auto& v) { return sorma::MessageArg::of(v); };
    if (f.trouble == Trouble::device) return sorma::Error(sorma::makeEntry(kDevice, {of(name), of(f.number), of(f.text)}));
    static constexpr const sorma::Prototype* kByTrouble[] = {&kAddress, &kRequest, &kUnreachable, &kLost, &kSilent, &kDevice, &kAnswer, &kLost};
    return sorma::Error(sorma::makeEntry(*kByTrouble[std::size_t(f.trouble)], {of(name), of(f.text)}));
}

class ModbusLine final : public sorma::Service {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return sorma::Class::of<ModbusLine>("modbusline", "a line to Modbus devices, for one request at a time")
            .named("-to", &ModbusLine::to_, {.help = "where they are: tcp:HOST:PORT, or rtu:PATH,BAUD,8n1 for a serial line"})
            .action("-close", &ModbusLine::closeAction, "", "close the line when it is free; the next request opens it again")
            .inspection({"-line", "", "is the line open, and to what", 0, 0, [](Service& s, sorma::Args, Message& m) { m.text += static_cast<ModbusLine&>(s).state(); }})
            .reads(floats, sorma::between(0, 1), "s", "how long the line may need to open, and each answer to come; without: 1", 0.001, 60)
            .words("{read UNIT TABLE ADDRESS COUNT} | {write UNIT TABLE ADDRESS VALUE ?VALUE ...?} | {mask UNIT holding ADDRESS BITS VALUE} ...")
            .writes(ints, {}, "", "what was read, in the same order")
            .execDanger(sorma::Danger::power)
            .example("modbusline.bus CTRL -to tcp:192.168.0.9:502");
    }

    ~ModbusLine() override { removing(); }

    void born() override { changed({}); }

    void changed(std::span<const sorma::Option* const>) override {
        const std::string& to = to_.get(sorma::Permit::owner());
        if (!to.empty()) guarded([&] { modbus::Address::parse(to); });
    }

    void exec(Message& m) override {
        if (to_.empty()) sorma::fail(kAddress, name(), "names no device: say \"" + name() + " CTRL -to tcp:HOST:PORT\"");
        if (m.words.empty() || m.words.size() > kMostOperations)
            sorma::fail(kRequest, name(), "expected 1 to " + std::to_string(kMostOperations) + " words, such as {read 1 holding 0 2}, got " + std::to_string(m.words.size()));
        std::vector<modbus::Operation> operations;
        guarded([&] {
            for (auto& word : m.words) operations.push_back(modbus::Operation::parse(word));
            const std::string& to = to_.use(*this);
            if (!line_ || line_->address().text != to) line_ = std::make_shared<modbus::Line>(modbus::Address::parse(to));
        });
        sorma::Charge charge(sorm().budget.ofCaller(), sorma::Account::Use::threads);
        charge.need(name(), sorma::Account::kThread);
        start(m, std::move(operations), std::move(charge));
    }

    // The thread ends by itself: it knows the line and the mailbox, and nothing of the object.
    void removing() override {
        if (line_) line_->interrupt();
        if (auto job = std::exchange(job_, nullptr)) job->reply.fail(sorma::Error(sorma::makeEntry(kGone, {sorma::MessageArg::of(name())})));
    }

    void dumpState(std::string& out) const override { out += "# line " + state() + "\n"; }

private:
    struct Job {
        sorma::Reply reply;
        sorma::Charge charge;               // for its thread
    };
    struct Result {
        std::vector<std::uint16_t> read;
        std::unique_ptr<modbus::Failure> failure;
    };

    template <class F> void guarded(F f) const {
        try {
            f();
        } catch (const modbus::Failure& failure) {
            throw errorOf(name(), failure);
        }
    }

    void start(Message& m, std::vector<modbus::Operation> operations, sorma::Charge charge) {
        const double patience = m.floats.empty() ? 1 : m.floats[0];
        auto job = std::make_shared<Job>();
        job->charge = std::move(charge);
        job->reply = later(m);
        job->reply.message().clear();
        job->reply.onCancel([line = line_] { line->interrupt(); });
        line_->prepare();
        auto work = [this, box = sorm().mailbox(), weak = std::weak_ptr(job), line = line_, operations = std::move(operations), patience] {
            auto result = std::make_shared<Result>();
            try {
                result->read = line->run(operations, patience);
            } catch (const modbus::Failure& f) {
                result->failure = std::make_unique<modbus::Failure>(f);
            } catch (const std::exception& e) {
                result->failure = std::make_unique<modbus::Failure>(Trouble::lost, e.what());
            }
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

    void ended(const Result& result) {
        auto job = std::exchange(job_, nullptr);
        job->charge.clear();
        if (std::exchange(closes_, false)) line_->close();
        if (job->reply.cancelled()) return job->reply.complete();       // nobody waits for it
        if (result.failure) return job->reply.fail(errorOf(name(), *result.failure));
        job->reply.message().ints.assign(result.read.begin(), result.read.end());
        job->reply.complete();
    }

    void closeAction(sorma::Args, Message&) {
        if (job_) closes_ = true;
        else if (line_) line_->close();
    }
    std::string state() const { return line_ && line_->isOpen() ? "open to " + line_->address().text : "closed"; }

    sorma::Named<sorma::Kind::address> to_;
    std::shared_ptr<modbus::Line> line_;    // null: nobody has needed it yet
    std::shared_ptr<Job> job_;              // the request under way
    bool closes_ = false;                   // when that has ended
};

}  // namespace

extern "C" SORMA_EXPORT int Modbusline_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::modbusline", "1.0", {ModbusLine::describe()});
}
