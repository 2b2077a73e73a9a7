// trouble -- a step for the tests of the cycle: does what a step should not, when it is told to.
#include <pthread.h>
#include <sched.h>
#include <time.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <thread>

#include <sorma.h>

namespace {

const sorma::Prototype kFailed{sorma::Severity::error, "TROUBLE MADE", 1, "{}: failed as it was told to, call {}"};

std::atomic<int> actions{0};                // of all objects: EXECs with an int, which say that the safe action was taken
std::atomic<bool> asleep{false};            // an EXEC sleeps

class Trouble : public sorma::Service {
public:
    static sorma::Class describe() {
        return sorma::Class::of<Trouble>("trouble", "does what a step should not, when it is told to")
            .integer("-failAt", &Trouble::failAt_, {.help = "call that fails; 0: none"})
            .integer("-sleepAt", &Trouble::sleepAt_, {.help = "call that sleeps; 0: none"})
            .real("-sleep", &Trouble::sleep_, {.unit = "s", .low = 0, .help = "how long"})
            .integer("-removeAt", &Trouble::removeAt_, {.help = "call that removes the object itself; 0: none"})
            .integer("-allocateAt", &Trouble::allocateAt_, {.help = "call that takes memory; 0: none"})
            .integer("-lockAt", &Trouble::lockAt_, {.help = "call that locks a mutex; 0: none"})
            .integer("-calls", &Trouble::calls_, {.help = "so far: each EXEC counts, and tells nobody"})
            .integer("-value", &Trouble::value_, {.help = "any"})
            .real("-slowChange", &Trouble::slowChange_, {.unit = "s", .low = 0, .help = "a change takes so long"})
            .real("-rival", &Trouble::rivalFor_, {.unit = "s", .low = 0, .help = "another thread can take the processor for so long, once"})
            .flag("-heldUp", &Trouble::heldUp_, {.help = "a change is quick, but the rival takes the processor"})
            .real("-slowPrepare", &Trouble::slowPrepare_, {.unit = "s", .low = 0, .help = "its preparation takes so long"})
            .action("-thread", &Trouble::thread, "", "name of the thread that executes this")
            .action("-wait", &Trouble::wait, "s", "take so long", 1, 1)
            .action("-ctrl", &Trouble::ctrlOf, "object word", "in the midst of this request, CTRL of another object", 2, 2)
            .action("-lose", &Trouble::lose, "", "be quick, but lose the processor to the rival")
            .action("-actions", &Trouble::actions, "", "safe actions taken so far, by all objects of the class")
            .action("-asleep", &Trouble::isAsleep, "", "does any of them sleep?")
            .action("-clear", &Trouble::clear, "", "no safe action has been taken")
            .realtime();
    }

    void exec(sorma::Message& m) override {
        ++calls_;
        if (!m.ints.empty()) ++::actions;
        floats_ = m.floats.size();
        if (const auto* tick = sorma::Tick::current()) period_ = tick->period, time_ = tick->time;
        if (calls_ == sleepAt_) doze(sleep_);
        if (calls_ == removeAt_) sorm().remove(name(), sorma::Permit::owner());
        if (calls_ == allocateAt_) allocated_ = std::make_unique<char[]>(100);
        if (calls_ == lockAt_) std::lock_guard lock(mutex_);
        if (calls_ == failAt_) fail(kFailed, name(), calls_);
        m.floats.assign(1, double(calls_));
    }

    sorma::Commit prepare(const sorma::Change& change) override {
        doze(change.get<double>("-slowPrepare"));
        if (double seconds = change.get<double>("-rival"); seconds > 0) rival_ = std::make_unique<Rival>(seconds);
        return nullptr;
    }
    void changed(std::span<const sorma::Option* const>) override {
        doze(slowChange_);
        if (heldUp_) rival_->takeProcessor();
    }

    void dumpState(std::string& out) const override {
        out += "# calls " + std::to_string(calls_) + "\n# floats " + std::to_string(floats_) + "\n# period " +
               std::to_string(period_) + "\n# time " + std::to_string(time_) + "\n";
    }

private:
    // A thread that takes the processor from the one which asks for it, for so long. It comes before that one also when a tick,
    // which waits for it, has lent it its priority.
    // Both are on one processor from the beginning, and it waits when this has been made. A move to another processor, or a thread
    // that does not run yet, would make that one wait as a slow one does.
    class Rival {
    public:
        explicit Rival(double seconds) {
            cpu_set_t here;
            CPU_ZERO(&here);
            CPU_SET(sched_getcpu(), &here);
            sched_getaffinity(0, sizeof all_, &all_);
            sched_setaffinity(0, sizeof here, &here);
            thread_ = std::thread([this, seconds] {
                sched_param first{};
                first.sched_priority = sched_get_priority_max(SCHED_FIFO);
                pthread_setschedparam(pthread_self(), SCHED_FIFO, &first);
                state_ = kReady;
                state_.wait(kReady);
                auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
                while (std::chrono::steady_clock::now() < end) {}
                state_ = kDone;
            });
            while (state_ == kStarting) sched_yield();
        }
        ~Rival() {
            state_ = kGo;
            state_.notify_one();
            thread_.join();
            sched_setaffinity(0, sizeof all_, &all_);
        }
        void takeProcessor() {
            if (state_ != kReady) return;
            state_ = kGo;
            state_.notify_one();
            while (state_ != kDone) sched_yield();
        }
    private:
        enum { kStarting, kReady, kGo, kDone };
        std::atomic<int> state_ = kStarting;
        cpu_set_t all_;
        std::thread thread_;
    };

    static void doze(double seconds) {
        if (seconds == 0) return;
        asleep = true;
        timespec t{time_t(seconds), long((seconds - double(time_t(seconds))) * 1e9)};
        nanosleep(&t, nullptr);
        asleep = false;
    }
    void thread(sorma::Args, sorma::Message& m) {
        char name[32] = "";
        pthread_getname_np(pthread_self(), name, sizeof name);
        m.text = name;
    }
    void wait(sorma::Args args, sorma::Message&) { doze(std::stod(args[0])); }
    void ctrlOf(sorma::Args args, sorma::Message& m) {
        sorma::Message request;
        request.words = {std::string(args[1])};
        sorm().get(args[0])->invoke(sorma::Method::ctrl, request);
        m.text = "done in the midst";
    }
    void lose(sorma::Args, sorma::Message&) { rival_->takeProcessor(); }
    void actions(sorma::Args, sorma::Message& m) { m.text = std::to_string(::actions); }
    void isAsleep(sorma::Args, sorma::Message& m) { m.text = std::to_string(int(asleep)); }
    void clear(sorma::Args, sorma::Message&) { ::actions = 0; }

    std::int64_t failAt_ = 0, sleepAt_ = 0, removeAt_ = 0, allocateAt_ = 0, lockAt_ = 0, value_ = 0, calls_ = 0, time_ = 0;
    double sleep_ = 0, period_ = 0, slowChange_ = 0, slowPrepare_ = 0, rivalFor_ = 0;
    bool heldUp_ = false;
    std::unique_ptr<Rival> rival_;
    std::size_t floats_ = 0;
    std::unique_ptr<char[]> allocated_;
    std::mutex mutex_;
};

}  // namespace

extern "C" SORMA_EXPORT int Trouble_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::trouble", "1.0", {Trouble::describe()});
}
