// spacemouse -- what a hand moves in six directions: a hand controller by its daemon, spacenavd.
//
//     spacemouse.hand CTRL -socket /var/run/spnav.sock
//     spacemouse.hand EXEC                                    x y z, turns about x y z
//
// libspnav speaks with the daemon. It has one connection in a process, reads whole records of 32 bytes alone, and takes the socket's
// name from the environment.
#include <fcntl.h>
#include <sys/ioctl.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>
#ifdef HAVE_SPNAV
#include <spnav.h>
#endif

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

#include <sorma.h>

#include "bus/incident.h"

namespace {

using sorma::Message;
using sorma::Severity;

const sorma::Prototype kFloats{Severity::error, "SPACEMOUSE FLOATS", 1, "{}: EXEC expects six floats (x y z, turns about x y z) or none, got {}"};
const sorma::Prototype kValue{Severity::error, "SPACEMOUSE VALUE", 1, "{}: float {} is {}; it must be a finite number"};
const sorma::Prototype kPath{Severity::error, "OPTION VALUE", 2, "{}: -socket has {} characters; a socket's name has at most {}"};

#ifdef HAVE_SPNAV
constexpr std::int64_t kAgain = 500'000'000;    // [ns] between two looks for the daemon
constexpr std::int64_t kRefused = 10'000'000'000;       // [ns] ... after it was there and did not answer: each time libspnav loses 80 bytes
constexpr std::int64_t kRest = 10'000'000;      // [ns] for the rest of a record
constexpr int kRecord = 32;                     // bytes
#endif
constexpr std::size_t kWays = 6;

class Spacemouse final : public sorma::Service, public sorma::HasIncidents {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return sorma::Class::of<Spacemouse>("spacemouse", "what a hand moves in six directions: a hand controller, by the socket of its daemon")
            .named("-socket", &Spacemouse::path_, {.help = "of the controller's daemon, as /var/run/spnav.sock; empty: none, EXEC alone says what the hand does"})
            .real("-renew", &Spacemouse::renew_, {.unit = "s", .low = 0.001, .high = 60, .help = "a record that was not renewed for so long counts as zeros"})
            .reads(floats, sorma::between(0, kWays), "", "none; or x y z and turns about x y z, as if the hand did that: a stand-in")
            .writes(floats, sorma::exactly(kWays), "", "x y z and turns about x y z, as the controller counts; zeros when they are not renewed")
            .writes(ints, {}, "", "out of a cycle: the buttons that are pressed")
            .concurrency(sorma::Concurrency::concurrent)
            .realtime()
            .example("spacemouse.hand CTRL -renew 0.2");
    }

    ~Spacemouse() override { close(); }

    void born() override { changed({}); }
    void changed(std::span<const sorma::Option* const>) override {
        constexpr std::size_t most = sizeof(sockaddr_un::sun_path) - 1;
        const std::string& path = path_.use(*this);
        if (path.size() > most) fail(kPath, name(), path.size(), most);
        if (path != open_) close();
        look();
    }

    void exec(Message& m) override {
        const bool ticks = sorma::Tick::current();
        if (m.floats.size() == kWays && !ticks) {
            for (std::size_t i = 0; i < kWays; ++i)
                if (!std::isfinite(m.floats[i])) ++refused_, fail(kValue, name(), i + 1, m.floats[i]);
            std::array<double, kWays> ways;
            std::copy(m.floats.begin(), m.floats.end(), ways.begin());
            moved(ways);
        } else if (!m.floats.empty()) {
            fail(kFloats, name(), m.floats.size());
        }
        m.floats.assign(kWays, 0);
        if (fresh()) std::copy(ways_.begin(), ways_.end(), m.floats.begin());
        if (ticks) return;
        m.words.clear();
        m.ints.assign(pressed_.begin(), pressed_.end());
    }

    std::vector<sorma::Pin> pins(std::string_view, std::size_t) const override {
        return {{"move", false, 0, 3, "", "x y z"}, {"turn", false, 3, 3, "", "about x y z"}};
    }

    void dumpState(std::string& out) const override {
        out += fd_ >= 0 ? "# connected\n" : path_.empty() ? "# no -socket\n" : "# not connected: " + problem_ + "\n";
    }

    void tellIncidents(sorma::Incidents& out) const override {
        out.push_back({name(), "motion not renewed", silences_});
        out.push_back({name(), "motion refused", refused_});
    }

private:
    bool fresh() const { return double(sorma::monotonicNow() - at_) * 1e-9 <= renew_; }

    // ---- the daemon: it may come late, and go ----

    void look() {
        again_.cancel();
        if (path_.empty() || fd_ >= 0 || !sorm().hasLoop()) return;
#ifdef HAVE_SPNAV
        if (holder_) return wait("libspnav has one connection in a process, and " + holder_->name() + " has it", kAgain);
        struct stat file;
        const std::string& path = path_.use(*this);
        if (::stat(path.c_str(), &file) != 0) return wait(std::strerror(errno), kAgain);
        if (!S_ISSOCK(file.st_mode)) return wait("it is no socket", kAgain);
        // libspnav waits with select().
        const int next = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
        if (next >= 0) ::close(next);
        if (next < 0 || next >= FD_SETSIZE) return wait("the process has too many open files for libspnav", kAgain);
        if (!connect()) return wait("it does not answer", kRefused);
        fd_ = spnav_fd(), open_ = path, holder_ = this;
        ::fcntl(fd_, F_SETFD, FD_CLOEXEC);
        watch();
#else
        problem_ = "this build has no libspnav";
#endif
    }

#ifdef HAVE_SPNAV
    static inline Spacemouse* holder_ = nullptr;        // of libspnav's connection

    bool connect() const {
        constexpr const char* kVariable = "SPNAV_SOCKET";
        const char* before = std::getenv(kVariable);
        const std::optional<std::string> kept = before ? std::optional<std::string>(before) : std::nullopt;
        ::setenv(kVariable, path_.use(*this).c_str(), 1);
        const bool done = spnav_open() == 0;
        kept ? ::setenv(kVariable, kept->c_str(), 1) : ::unsetenv(kVariable);
        return done;
    }

    void wait(std::string problem, std::int64_t pause) {
        problem_ = std::move(problem);
        again_ = sorm().loop().after(sorma::monotonicNow() + pause, [this] { look(); });
    }

    void watch() {
        sorm().loop().watch(fd_, [this] { read(); });
    }

    void close() {
        if (fd_ < 0) return;
        again_.cancel();
        if (sorm().hasLoop()) sorm().loop().unwatch(fd_);
        spnav_close();
        fd_ = -1;
        holder_ = nullptr;
        pressed_.clear();
    }

    void read() {
        for (;;) {
            int bytes = 0;
            char any;
            if (::ioctl(fd_, FIONREAD, &bytes) != 0 || bytes == 0) {
                const ssize_t n = ::recv(fd_, &any, 1, MSG_PEEK | MSG_DONTWAIT);
                if (n > 0 || (n < 0 && (errno == EAGAIN || errno == EINTR))) return;
                const std::string problem = n == 0 ? "it has ended" : std::strerror(errno);
                close();
                return wait(problem, kAgain);
            }
            if (bytes < kRecord) {
                sorm().loop().unwatch(fd_);
                again_ = sorm().loop().after(sorma::monotonicNow() + kRest, [this] { watch(); });
                return;
            }
            spnav_event event;
            switch (spnav_poll_event(&event)) {
                case SPNAV_EVENT_MOTION: {
                    const auto& e = event.motion;
                    moved({double(e.x), double(e.y), double(e.z), double(e.rx), double(e.ry), double(e.rz)});
                    break;
                }
                case SPNAV_EVENT_BUTTON: button(event.button.bnum, event.button.press); break;
                default: break;         // of a daemon that knows more
            }
        }
    }
#else
    void close() {}
#endif

    void button(std::int64_t number, bool down) {
        std::erase(pressed_, number);
        if (down) pressed_.push_back(number);
        Message m;
        m.ints = {number, down};
        publish("button", m);
    }

    // ---- what the hand does ----

    void moved(const std::array<double, kWays>& ways) {
        {
            sorma::BetweenTicks between(*this);
            ways_ = ways;
            at_ = sorma::monotonicNow();
        }
        Message m;
        m.floats.assign(ways.begin(), ways.end());
        publish("motion", m);
        silence_.cancel();
        const bool rests = std::all_of(ways.begin(), ways.end(), [](double x) { return x == 0; });
        if (rests || !sorm().hasLoop()) return;
        silence_ = sorm().loop().after(at_ + std::int64_t(renew_ * 1e9), [this] {
            ++silences_;
            Message silent;
            silent.floats.assign(ways_.begin(), ways_.end());
            publish("silent", silent);
        });
    }

    sorma::Named<sorma::Kind::file> path_;
    std::string open_, problem_ = "nobody has looked yet";
    double renew_ = 0.1;
    int fd_ = -1;
    std::array<double, kWays> ways_{};
    std::int64_t at_ = 0;                       // [ns] when they came
    std::vector<std::int64_t> pressed_;
    sorma::Timer again_, silence_;
    sorma::Tally silences_, refused_;
};

}  // namespace

extern "C" SORMA_EXPORT int Spacemouse_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::spacemouse", "1.0", {Spacemouse::describe()});
}
