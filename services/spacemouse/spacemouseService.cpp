// spacemouse -- what a hand moves in six directions: a hand controller by the socket of its daemon (spacenavd).
//
//     spacemouse.hand CTRL -socket /var/run/spnav.sock
//     spacemouse.hand EXEC                                    x y z, turns about x y z
//
// The daemon sends records of eight integers: kind 0 with three ways, three turns and a time, kind 1 and 2 with a button that
// was pressed or let go. They are read here without libspnav, which is no more than that and knows one socket alone.
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include <sorma.h>

namespace {

using sorma::Message;
using sorma::Severity;

const sorma::Prototype kFloats{Severity::error, "SPACEMOUSE FLOATS", 1, "{}: EXEC expects six floats (x y z, turns about x y z) or none, got {}"};
const sorma::Prototype kValue{Severity::error, "SPACEMOUSE VALUE", 1, "{}: float {} is {}; it must be a finite number"};
const sorma::Prototype kPath{Severity::error, "OPTION VALUE", 2, "{}: -socket has {} characters; a socket's name has at most {}"};

constexpr std::int64_t kAgain = 500'000'000;    // [ns] between two looks for the daemon
constexpr std::size_t kWays = 6;

class Spacemouse final : public sorma::Service {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return sorma::Class::of<Spacemouse>("spacemouse", "what a hand moves in six directions: a hand controller, by the socket of its daemon")
            .text("-socket", &Spacemouse::path_, {.help = "of the controller's daemon, as /var/run/spnav.sock; empty: none, EXEC alone says what the hand does"})
            .real("-renew", &Spacemouse::renew_, {.unit = "s", .low = 0.001, .high = 60, .help = "what is not renewed within that counts as zero"})
            .reads(floats, sorma::between(0, kWays), "", "none; or x y z and turns about x y z, as if the hand did that: a stand-in")
            .writes(floats, sorma::exactly(kWays), "", "x y z and turns about x y z, as the controller counts; zeros when they are not renewed")
            .writes(ints, {}, "", "out of a cycle: the buttons that are pressed")
            .conduct(sorma::Conduct::concurrent)
            .realtime()
            .example("spacemouse.hand CTRL -renew 0.2");
    }

    ~Spacemouse() override { close(); }

    void born() override { changed({}); }
    void changed(std::span<const sorma::Option* const>) override {
        constexpr std::size_t most = sizeof(sockaddr_un::sun_path) - 1;
        if (path_.size() > most) fail(kPath, name(), path_.size(), most);
        if (!path_.empty()) sorm().access.need(author("-socket"), sorma::Right::files, path_, name());
        if (path_ != open_) close();
        look();
    }

    void exec(Message& m) override {
        const bool ticks = sorma::Tick::current();
        if (m.floats.size() == kWays && !ticks) {
            for (std::size_t i = 0; i < kWays; ++i)
                if (!std::isfinite(m.floats[i])) fail(kValue, name(), i + 1, m.floats[i]);
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

private:
    bool fresh() const { return double(sorma::monotonicNow() - at_) * 1e-9 <= renew_; }

    // ---- the daemon's socket: it may come late, and go ----

    void look() {
        again_.cancel();
        if (path_.empty() || fd_ >= 0 || !sorm().hasLoop()) return;
        again_ = sorm().loop().after(sorma::monotonicNow() + kAgain, [this] { look(); });
        const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
        sockaddr_un address{};
        address.sun_family = AF_UNIX;
        std::memcpy(address.sun_path, path_.data(), path_.size());
        if (fd < 0 || ::connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) {
            problem_ = std::strerror(errno);
            if (fd >= 0) ::close(fd);
            return;
        }
        again_.cancel();
        fd_ = fd, open_ = path_, have_ = 0;
        sorm().loop().watch(fd_, [this] { read(); });
    }

    void close() {
        if (fd_ < 0) return;
        if (sorm().hasLoop()) sorm().loop().unwatch(fd_);
        ::close(fd_);
        fd_ = -1;
        pressed_.clear();
    }

    void read() {
        for (;;) {
            const ssize_t n = ::recv(fd_, reinterpret_cast<char*>(record_.data()) + have_, sizeof record_ - have_, 0);
            if (n < 0 && (errno == EAGAIN || errno == EINTR)) return;
            if (n <= 0) {
                problem_ = n == 0 ? "it has ended" : std::strerror(errno);
                close();
                return look();
            }
            have_ += std::size_t(n);
            if (have_ < sizeof record_) continue;
            have_ = 0;
            take();
        }
    }

    void take() {
        if (record_[0] == 0) {
            std::array<double, kWays> ways;
            std::copy_n(record_.begin() + 1, kWays, ways.begin());
            return moved(ways);
        }
        if (record_[0] != 1 && record_[0] != 2) return;         // of a daemon that knows more
        const bool down = record_[0] == 1;
        std::erase(pressed_, std::int64_t(record_[1]));
        if (down) pressed_.push_back(record_[1]);
        Message m;
        m.ints = {record_[1], down};
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
            Message silent;
            silent.floats.assign(ways_.begin(), ways_.end());
            publish("silent", silent);
        });
    }

    std::string path_, open_, problem_ = "nobody has looked yet";
    double renew_ = 0.1;
    int fd_ = -1;
    std::array<std::int32_t, 8> record_{};
    std::size_t have_ = 0;                      // bytes of the record
    std::array<double, kWays> ways_{};
    std::int64_t at_ = 0;                       // [ns] when they came
    std::vector<std::int64_t> pressed_;
    sorma::Timer again_, silence_;
};

}  // namespace

extern "C" SORMA_EXPORT int Spacemouse_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::spacemouse", "1.0", {Spacemouse::describe()});
}
