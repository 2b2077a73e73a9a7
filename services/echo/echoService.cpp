// echo -- gives back what it was sent, at once or after a while: for tests of everything that carries messages.
#include <sorma.h>

#include <cerrno>
#include <ctime>

namespace {

const sorma::Prototype kLate{sorma::Severity::error, "ECHO LATE", 1,
    "{}: -delay {} s is longer than the {} s that the caller will wait"};

class Echo : public sorma::Service {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return sorma::Class::of<Echo>("echo", "returns text, floats, ints and any as they came")
            .real("-delay", &Echo::delay_, {.unit = "s", .low = 0, .high = 3600, .help = "wait first"})
            .reads(text, {}, "", "anything").reads(floats, {}, "", "").reads(ints, {}, "", "").reads(any, {}, "", "")
            .writes(text, {}, "", "the same").writes(floats, {}, "", "").writes(ints, {}, "", "").writes(any, {}, "", "")
            .example("echo EXEC TMSG hello FMSG 2 1.5 3");
    }

    void exec(sorma::Message&) override {
        if (delay_ > 0) wait();         // the message stays as it is: that is the echo
    }

private:
    // Blocks the whole process, as a driver of slow hardware would. Nobody is kept waiting beyond his deadline.
    void wait() const {
        sorma::Deadline deadline = sorma::Call::currentDeadline();
        std::int64_t now = sorma::monotonicNow(), end = now + std::int64_t(delay_ * 1e9);
        bool late = !deadline.none() && deadline.when() < end;
        std::int64_t until = late ? deadline.when() : end;
        timespec t{until / 1'000'000'000, until % 1'000'000'000};
        while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, nullptr) == EINTR) {
        }
        if (late) fail(kLate, name(), delay_, double(deadline.when() - now) / 1e9);
    }

    double delay_ = 0;
};

}  // namespace

extern "C" SORMA_EXPORT int Echo_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::echo", "1.0", {Echo::describe()});
}
