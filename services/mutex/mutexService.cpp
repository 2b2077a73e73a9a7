// mutex -- one at a time: a process has it, the others wait in the order in which they came.
//
// It belongs to a process, not to a coroutine: when a process that has it locks it again, that waits like any other
// request, until the process unlocks. When the process ends, the next one has it.
#include "bus/statistics.h"
#include "../semaphore/counted.h"

namespace {

using sorma::Message;
using sorma::Severity;

const sorma::Prototype kWord{Severity::error, "MUTEX WORD", 2, "{}: bad word \"{}\": must be holder, lock, or unlock"};
const sorma::Prototype kUsage{Severity::error, "MUTEX SYNTAX", 1, "{}: wrong words: should be \"{}\""};
const sorma::Prototype kBusy{Severity::error, "MUTEX BUSY", 1, "{}: held by {}; without \"now\" lock waits for it"};
const sorma::Prototype kNotHeld{Severity::error, "MUTEX NOTHELD", 1, "{}: not held by this client, {}"};

class Mutex : public counted::Counted {
public:
    static sorma::Class describe() {
        return sorma::Class::of<Mutex>("mutex", "lets one process at a time, first come, first served")
            .concurrency(sorma::Concurrency::concurrent)
            .words("lock ?now? | unlock | holder")
            .writes(sorma::Field::text, {}, "", "holder: who has it, and since when; empty when nobody has")
            .repeatable({"holder"})
            .example("mutex EXEC holder");
    }

    void exec(Message& m) override {
        std::string word = m.words.empty() ? std::string() : m.words[0];
        if (word == "lock") {
            bool now = m.words.size() == 2 && m.words[1] == "now";
            if (m.words.size() > (now ? 2u : 1u)) fail(kUsage, name(), "lock ?now?");
            if (acquire(1)) return m.clear();
            if (now) fail(kBusy, name(), holder());
            acquireLater(m, 1);
        } else if (word == "unlock") {
            if (m.words.size() > 1) fail(kUsage, name(), "unlock");
            if (!release(1)) fail(kNotHeld, name(), holders().empty() ? "nor by any other" : "but by " + holder());
            m.clear();
        } else if (word == "holder") {
            if (m.words.size() > 1) fail(kUsage, name(), "holder");
            m.clear();
            if (!holders().empty()) m.text = holder();
        } else {
            fail(kWord, name(), word);
        }
    }

    void dumpState(std::string& out) const override {
        out += "# waiting " + std::to_string(waiting()) + "\n";
        if (!holders().empty()) out += "# holder " + holder() + "\n";
    }

private:
    std::int64_t total() const override { return 1; }

    // "me@host tclsh[4711] since 2026-03-01 10:31:02.123", while somebody has it
    std::string holder() const {
        auto& h = holders().begin()->second;
        return h.who() + " since " + sorma::clockText(h.since);
    }
};

}  // namespace

extern "C" SORMA_EXPORT int Mutex_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::mutex", "1.0", {Mutex::describe()});
}
