// laser -- the pointer in the robot's hand: on, off, blinking, and pointed at a place.
//
//     laser EXEC blink
//     laser EXEC point FMSG 3 0.55 0.1 0          the arm moves: the beam lies on the tool's axis
//     laser EXEC off
#include <cmath>
#include <cstdio>
#include <optional>

#include <shmem/ring.h>
#include <sorma.h>

namespace {

using sorma::Message;
using sorma::Severity;

const sorma::Prototype kWord{Severity::error, "LASER WORD", 2, "{}: bad word \"{}\": must be blink, off, on, point, or status"};
const sorma::Prototype kFloats{Severity::error, "LASER FLOATS", 1, "{}: EXEC {} expects {}, got {} floats"};
const sorma::Prototype kBuffer{Severity::error, "LASER BUFFER", 1, "{}: the pointer cannot be switched: {}"};
const sorma::Prototype kMover{Severity::error, "LASER MOVER", 1,
                              "{}: the beam lies on the tool's axis, so pointing is a motion of the arm: set -mover to an mvpos with -as pose"};
const sorma::Prototype kUnit{Severity::error, "OPTION VALUE", 2, "{}: {}: the quaternion has the length {} instead of 1"};

class Laser final : public sorma::Service {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return sorma::Class::of<Laser>("laser", "the pointer in the robot's hand")
            .named("-prefix", &Laser::prefix_, {.help = "before the names of all buffers: another hand's", .fixed = true})
            .real("-rate", &Laser::rate_, {.unit = "Hz", .low = 0.1, .high = 20, .help = "of blinking"})
            .real("-seconds", &Laser::seconds_, {.unit = "s", .low = 0, .high = 86400, .help = "after which it goes off by itself; 0: never"})
            .service("-mover", &Laser::mover_, {.help = "moves the tool to point: of class mvpos, with -as pose; its guards hold"})
            .real("-distance", &Laser::distance_, {.unit = "m", .low = 0.01, .high = 2, .help = "from the tool to the place that it points at"})
            .vector("-orientation", &Laser::orientation_, {.unit = "1", .low = -1, .high = 1, .help = "of the tool when it points, quaternion w x y z in the world; as it stands: straight down",
                                                           .minLength = 4, .maxLength = 4})
            .flag("-blinks", &Laser::blinks_, {.help = "when it points it blinks; else it is on"})
            .execDanger(sorma::Danger::fire, {"blink", "on"})
            .execDanger(sorma::Danger::move, {"point"})
            .execDanger(sorma::Danger::stop, {"off"})
            .words("blink | off | on | point | status")
            .reads(floats, sorma::between(0, 3), "m, Hz", "point: x y z in the world; blink: its rate, if it is another one than -rate")
            .writes(floats, sorma::between(2, 7), "m, 1", "point: where the tool has been sent, position and quaternion; others: on (1 or 0), rate of blinking [Hz]")
            .writes(text, {}, "", "point: the object that has moved the arm; status: as text")
            .concurrency(sorma::Concurrency::concurrent)
            .example("laser CTRL -rate 4");
    }

    ~Laser() override { removing(); }
    void removing() override {
        if (on_) set(false, 0);
        writer_.reset();
    }

    void born() override { changed({}); }
    void changed(std::span<const sorma::Option* const>) override {
        double length = 0;
        for (double q : orientation_) length += q * q;
        if (std::fabs(std::sqrt(length) - 1) > 1e-3) fail(kUnit, name(), "-orientation", sorma::numberText(std::sqrt(length)));
    }

    void exec(Message& m) override {
        const std::string word = m.words.empty() ? "" : m.words[0];
        if (m.words.size() != 1) fail(kWord, name(), sorma::joinWords(m.words));
        auto expect = [&](bool right, const char* what) {
            if (!right) fail(kFloats, name(), word, what, m.floats.size());
        };
        const std::size_t n = m.floats.size();
        if (word == "point") {
            expect(n == 3 && std::isfinite(m.floats[0] + m.floats[1] + m.floats[2]), "3 finite ones: x y z in the world");
            return point(m);
        }
        if (word == "blink") {
            expect(n == 0 || (n == 1 && m.floats[0] >= 0.1 && m.floats[0] <= 20), "none, or a rate of 0.1 .. 20 Hz");
            set(true, n ? m.floats[0] : rate_);
        } else {
            if (word != "on" && word != "off" && word != "status") fail(kWord, name(), word);
            expect(n == 0, "none");
            if (word != "status") set(word == "on", 0);
        }
        m.clear();
        m.floats = {on_ ? 1.0 : 0.0, now_};
        if (word == "status") m.text = !on_ ? "off" : now_ > 0 ? "blinks with " + sorma::numberText(now_) + " Hz" : "on";
    }

    void dumpState(std::string& out) const override { out += std::string("# on ") + (on_ ? "1" : "0") + "\n"; }

private:
    // [s] of the laboratory's clock, if there is one.
    double time() {
        try {
            shmem::Reader clock(prefix_.use(*this) + "lab.clock");
            std::vector<double> f(clock.shape().floats);
            shmem::Stamp stamp;
            if (!f.empty() && clock.latest(f.data(), nullptr, stamp) == shmem::Outcome::read) return f[0];
        } catch (const shmem::Failure&) {
        }
        return double(sorma::monotonicNow()) * 1e-9;
    }

    void set(bool on, double rate) {
        try {
            if (!writer_)
                writer_.emplace(prefix_.use(*this) + "laser.set", shmem::Shape{.blocks = 16, .floats = 3},
                                sorm().daemonName.empty() ? sorma::Caller::self().program : sorm().daemonName);
        } catch (const shmem::Failure& f) {
            fail(kBuffer, name(), f.what());
        }
        const double record[] = {time(), on ? 1.0 : 0.0, rate};
        writer_->write(record, nullptr);
        on_ = on;
        now_ = on ? rate : 0;
        timer_.cancel();
        if (on && seconds_ > 0)
            timer_ = sorm().loop().after(sorma::monotonicNow() + std::int64_t(seconds_ * 1e9), [this] { set(false, 0); });
        Message told;
        told.floats = {on ? 1.0 : 0.0, rate};
        publishState("switched", told);
    }

    void point(Message& m) {
        if (!mover_) fail(kMover, name());
        // The beam leaves along the tool's z.
        const double w = orientation_[0], x = orientation_[1], y = orientation_[2], z = orientation_[3];
        const double along[] = {2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)};
        Message motion;
        for (std::size_t i = 0; i < 3; ++i) motion.floats.push_back(m.floats[i] - distance_ * along[i]);
        motion.floats.insert(motion.floats.end(), orientation_.begin(), orientation_.end());
        sorma::Reply reply = later(m);
        reply.ask(mover_, motion, [this, self = sorma::Reference(this), reply, to = motion.floats](Message&) {
            set(true, blinks_ ? rate_ : 0);
            Message& answer = reply.message();
            answer.clear();
            answer.floats = to;
            answer.text = mover_->name() + " has moved the arm to point";
            reply.complete();
        });
    }

    sorma::Named<sorma::Kind::segment> prefix_;
    double rate_ = 2, seconds_ = 0, distance_ = 0.15;
    std::vector<double> orientation_{0, 1, 0, 0};
    bool blinks_ = true;
    sorma::Reference mover_;

    std::optional<shmem::Writer> writer_;
    bool on_ = false;
    double now_ = 0;                        // [Hz] that it blinks with
    sorma::Timer timer_;
};

}  // namespace

extern "C" SORMA_EXPORT int Laser_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::laser", "1.0", {Laser::describe()});
}
