// usbtmc -- an instrument at a USB port, by the kernel's driver: messages out, answers in, its status byte. Class scpi speaks SCPI by it.
//
//     usbtmc.a CTRL -to /dev/usbtmc0
//     usbtmc.a EXEC write AMSG ...            then EXEC read
//
// line/blockingLine.h has the line: one EXEC at a time, on a thread of its own.
#include <algorithm>
#include <functional>
#include <memory>
#include <utility>

#include <sorma.h>

#include "device.h"
#include "line/blockingLine.h"

namespace {

using sorma::Message;
using sorma::Severity;

const sorma::Prototype kAddress{Severity::error, "USBTMC ADDRESS", 1, "{}: {}"};
const sorma::Prototype kRequest{Severity::error, "USBTMC REQUEST", 1, "{}: {}"};
const sorma::Prototype kUnreachable{Severity::error, "USBTMC UNREACHABLE", 1, "{}: {}"};
const sorma::Prototype kLost{Severity::error, "USBTMC LOST", 1, "{}: {}"};
const sorma::Prototype kSilent{Severity::error, "USBTMC SILENT", 1, "{}: {}"};
const sorma::Prototype kAnswer{Severity::error, "USBTMC ANSWER", 1, "{}: {}"};
const sorma::Prototype kTooBig{Severity::error, "USBTMC TOO_BIG", 1, "{}: {}"};
const sorma::Prototype kUnsupported{Severity::error, "USBTMC UNSUPPORTED", 1, "{}: {}"};

class Usbtmc final : public line::BlockingLine<usbtmc::Device, usbtmc::Failure> {
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

    void exec(Message& m) override {
        if (to_.empty()) sorma::fail(kAddress, name(), "names no device: say \"" + name() + " CTRL -to /dev/usbtmc0\"");
        static constexpr std::string_view kVerbs[] = {"open", "write", "read", "status", "trigger", "clear"};
        const auto verb = m.words.empty() ? std::end(kVerbs) : std::find(std::begin(kVerbs), std::end(kVerbs), m.words[0]);
        if (verb == std::end(kVerbs) || m.words.size() != 1)
            sorma::fail(kRequest, name(), "expected open, write, read, status, trigger or clear, got \"" + (m.words.empty() ? std::string() : m.words[0].substr(0, 100)) + "\"");
        if (*verb == "write" && m.any.empty()) sorma::fail(kRequest, name(), "write expects a message in the any part");
        const std::string& to = to_.use(*this);
        if (!line_ || line_->where() != to) line_ = std::make_shared<usbtmc::Device>(to);
        const double patience = m.floats.empty() ? 5 : m.floats[0];
        const std::size_t most = m.ints.empty() ? 67'108'864 : std::size_t(m.ints[0]);
        onThread(m, [verb = *verb, message = std::string(m.any.begin(), m.any.end()), most, patience](usbtmc::Device& device) {
            return run(device, verb, message, most, patience);
        });
    }

protected:
    sorma::Error errorOf(const usbtmc::Failure& f) const override {
        static constexpr const sorma::Prototype* kByTrouble[] = {&kUnreachable, &kLost, &kSilent, &kAnswer, &kTooBig, &kUnsupported};
        return sorma::Error(sorma::makeEntry(*kByTrouble[std::size_t(f.trouble)], {sorma::MessageArg::of(name()), sorma::MessageArg::of(f.text)}));
    }

private:
    using Fill = std::function<void(Message&)>;
    static Fill run(usbtmc::Device& device, std::string_view verb, const std::string& message, std::size_t most, double patience) {
        std::string bytes;
        int status = -1;
        if (verb == "open") device.open(patience);
        else if (verb == "write") device.write(message, patience);
        else if (verb == "read") bytes = device.read(most, patience);
        else if (verb == "status") status = device.status(patience);
        else if (verb == "trigger") device.trigger(patience);
        else device.clear(patience);
        return [bytes = std::move(bytes), status](Message& m) {
            m.any.assign(bytes.begin(), bytes.end());
            if (status >= 0) m.ints.push_back(status);
        };
    }

    sorma::Named<sorma::Kind::file> to_;
};

}  // namespace

extern "C" SORMA_EXPORT int Usbtmc_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::usbtmc", "1.0", {Usbtmc::describe()});
}
