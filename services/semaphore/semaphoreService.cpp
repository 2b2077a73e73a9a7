// semaphore -- so many may, the others wait: a count that processes share.
//
//     cranes EXEC acquire 2           waits for two of them, in the order of those who ask
//     cranes EXEC release 2           by the process that has them; when it ends they come back by themselves
#include <charconv>

#include "bus/statistics.h"
#include "counted.h"

namespace {

using sorma::Message;
using sorma::Severity;

constexpr std::int64_t kMost = 1'000'000;

const sorma::Prototype kWord{Severity::error, "SEMAPHORE WORD", 2, "{}: bad word \"{}\": must be acquire, held, release, or value"};
const sorma::Prototype kUsage{Severity::error, "SEMAPHORE SYNTAX", 1, "{}: wrong words: should be \"{}\""};
const sorma::Prototype kNumber{Severity::error, "SEMAPHORE NUMBER", 2, "{}: \"{}\" must be a whole number, 1 .. {}"};
const sorma::Prototype kTooMany{Severity::error, "SEMAPHORE TOOMANY", 1,
                                "{}: acquire {} would wait for ever, -count is {}; ask for less, or raise -count"};
const sorma::Prototype kBusy{Severity::error, "SEMAPHORE BUSY", 1,
                             "{}: {} of {} free, {} waiting; without \"now\" acquire waits"};
const sorma::Prototype kNotHeld{Severity::error, "SEMAPHORE NOTHELD", 1, "{}: this client holds {}, it cannot release {}"};

class Semaphore : public counted::Counted {
public:
    static sorma::Class describe() {
        return sorma::Class::of<Semaphore>("semaphore", "a count that processes share, first come, first served")
            .integer("-count", &Semaphore::count_, {.unit = "1", .low = 1, .high = kMost, .help = "how many there are"})
            .concurrency(sorma::Concurrency::concurrent)
            .words("acquire ?n? ?now? | release ?n? | value | held")
            .writes(sorma::Field::ints, sorma::between(0, 1), "1",
                    "value: how many are free, negative when -count was lowered below what is held; held: how many this client holds")
            .repeatable({"value", "held"})
            .example("semaphore EXEC value");
    }

    void exec(Message& m) override {
        std::string word = m.words.empty() ? std::string() : m.words[0];
        if (word == "acquire") {
            auto [n, now] = arguments(m, "acquire ?n? ?now?", true);
            if (n > count_) fail(kTooMany, name(), n, count_);
            if (acquire(n)) return m.clear();
            if (now) fail(kBusy, name(), free(), count_, waiting());
            acquireLater(m, n);
        } else if (word == "release") {
            std::int64_t n = arguments(m, "release ?n?", false).first;
            if (!release(n)) fail(kNotHeld, name(), held(), n);
            m.clear();
        } else if (word == "value" || word == "held") {
            if (m.words.size() > 1) fail(kUsage, name(), word);
            m.clear();
            m.ints.push_back(word == "value" ? free() : held());
        } else {
            fail(kWord, name(), word);
        }
    }

    void changed(std::span<const sorma::Option* const>) override {
        refuseMoreThan(count_, [this](std::int64_t n) {
            return sorma::Error(sorma::makeEntry(kTooMany, {sorma::MessageArg::of(name()), sorma::MessageArg::of(n), sorma::MessageArg::of(count_)}));
        });
        grant();
    }

    void dumpState(std::string& out) const override {
        out += "# free " + std::to_string(free()) + "\n# waiting " + std::to_string(waiting()) + "\n";
        for (auto& [key, h] : holders())
            out += "# holder " + std::to_string(h.count) + " " + h.who() + " since " + sorma::clockText(h.since) + "\n";
    }

private:
    std::int64_t total() const override { return count_; }

    // n and whether "now" follows.
    std::pair<std::int64_t, bool> arguments(const Message& m, const char* usage, bool mayBeNow) const {
        std::size_t words = m.words.size();
        bool now = mayBeNow && words > 1 && m.words.back() == "now";
        if (now) --words;
        if (words > 2) fail(kUsage, name(), usage);
        std::int64_t n = 1;
        if (words == 2) {
            auto& given = m.words[1];
            auto [end, error] = std::from_chars(given.data(), given.data() + given.size(), n);
            if (error != std::errc() || end != given.data() + given.size() || n < 1 || n > kMost) fail(kNumber, name(), given, kMost);
        }
        return {n, now};
    }

    std::int64_t count_ = 1;
};

}  // namespace

extern "C" SORMA_EXPORT int Semaphore_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::semaphore", "1.0", {Semaphore::describe()});
}
