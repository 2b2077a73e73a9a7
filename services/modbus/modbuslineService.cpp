// modbusline -- a line to Modbus devices, which several objects of class modbus share.
//
//     modbusline.bus CTRL -to tcp:192.168.0.9:502
//     modbusline.bus EXEC {write 1 holding 100 215} {read 1 holding 100 2}
//
// Each word is a request to a device. One EXEC at a time has the line, from its first word to its last. The others wait in their order, so no
// answer goes to the wrong one. It runs on a thread of its own: line/blockingLine.h.
#include <memory>
#include <utility>

#include <sorma.h>

#include "line.h"
#include "line/blockingLine.h"

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

constexpr std::size_t kMostOperations = 1000;

class ModbusLine final : public line::BlockingLine<modbus::Line, modbus::Failure> {
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
            if (!line_ || line_->where() != to) line_ = std::make_shared<modbus::Line>(modbus::Address::parse(to));
        });
        line_->prepare();
        const double patience = m.floats.empty() ? 1 : m.floats[0];
        onThread(m, [operations = std::move(operations), patience](modbus::Line& line) {
            return [read = line.run(operations, patience)](Message& answer) { answer.ints.assign(read.begin(), read.end()); };
        });
    }

protected:
    sorma::Error errorOf(const modbus::Failure& f) const override {
        auto of = [](const auto& v) { return sorma::MessageArg::of(v); };
        if (f.trouble == Trouble::device) return sorma::Error(sorma::makeEntry(kDevice, {of(name()), of(f.number), of(f.text)}));
        static constexpr const sorma::Prototype* kByTrouble[] = {&kAddress, &kRequest, &kUnreachable, &kLost, &kSilent, &kDevice, &kAnswer, &kLost};
        return sorma::Error(sorma::makeEntry(*kByTrouble[std::size_t(f.trouble)], {of(name()), of(f.text)}));
    }

private:
    template <class F> void guarded(F f) const {
        try {
            f();
        } catch (const modbus::Failure& failure) {
            throw errorOf(failure);
        }
    }

    sorma::Named<sorma::Kind::address> to_;
};

}  // namespace

extern "C" SORMA_EXPORT int Modbusline_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::modbusline", "1.0", {ModbusLine::describe()});
}
