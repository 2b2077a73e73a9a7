// simlab -- the laboratory as the other side of the buffers of an arm, a hand and a camera, simulated by MuJoCo.
//
//     simlab CTRL -paused 1                the recipe may say so
//     simlab EXEC FMSG 1 0.5               half a second of lab time passes
//     simlab CTRL -move red_3 4 5          a person moves a token
//
// The laboratory has a thread of its own (laboratory.h); a request is carried out between two of its steps.
#include <algorithm>
#include <cmath>
#include <optional>

#include <sorma.h>

#include "laboratory.h"

namespace {

using simlab::Laboratory;
using sorma::Args;
using sorma::Message;
using sorma::Severity;

const sorma::Prototype kScene{Severity::error, "SIMLAB SCENE", 2, "{}: {} {}"};
const sorma::Prototype kBuffer{Severity::error, "SIMLAB BUFFER", 1,
                               "{}: a buffer cannot be written: {}; another laboratory may run: -prefix keeps them apart"};
const sorma::Prototype kOption{Severity::error, "OPTION VALUE", 2, "{}: {} {}: {}"};
const sorma::Prototype kRefused{Severity::error, "SIMLAB REFUSED", 1, "{}: {}: {}"};
const sorma::Prototype kWord{Severity::error, "SIMLAB WORD", 2, "{}: bad word \"{}\": must be camera, step, time, tokens, or view"};
const sorma::Prototype kFloats{Severity::error, "SIMLAB FLOATS", 1, "{}: {} takes {}, got {} floats"};
const sorma::Prototype kValue{Severity::error, "SIMLAB VALUE", 1, "{}: {} takes {}, not {}"};
const sorma::Prototype kPicture{Severity::error, "SIMLAB PICTURE", 1, "{}: there is no picture: {}"};
const sorma::Prototype kEnded{Severity::error, "SERVICE GONE", 1, "{}: the laboratory has ended, or its physics has stopped"};

class Simlab : public sorma::Service {
    template <class Work> auto lab(Work work) {
        if (!lab_) fail(kEnded, name());
        return lab_->between(work);
    }

public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return sorma::Class::of<Simlab>("simlab", "a simulated laboratory: arm, hand, camera, table, board and tokens")
            .named("-scene", &Simlab::scene_, {.help = "8x8, 10x10, tracker (no board), or a MuJoCo file", .fixed = true,
                                               .literals = {"8x8", "10x10", "tracker"}})
            .named("-prefix", &Simlab::prefix_, {.help = "put before the keys of all buffers", .fixed = true})
            .choice("-lockstep", &Simlab::lockstep_, {"", "arm.set"},
                    {.help = "lab time waits for the set-point that is due, at most 2 s of wall time; empty: it does not",
                     .fixed = true})
            .integer("-seed", &Simlab::seed_, {.low = 0, .high = 1e15, .help = "of all noise", .fixed = true})
            .vector("-posture", &Simlab::posture_,
                    {.unit = "rad", .low = -6.3, .high = 6.3, .help = "of the arm at the beginning",
                     .fixed = true, .minLength = 6, .maxLength = 6})
            .integer("-width", &Simlab::width_, {.unit = "pixels", .low = 16, .high = simlab::Pictures::kMostWidth,
                     .help = "of the camera's picture", .fixed = true})
            .integer("-height", &Simlab::height_, {.unit = "pixels", .low = 16, .high = simlab::Pictures::kMostHeight,
                     .help = "of the camera's picture", .fixed = true})
            .integer("-samples", &Simlab::samples_,
                    {.low = 0, .high = 16, .help = "of each pixel, for smooth edges; 0 is three times as fast",
                     .fixed = true})
            .real("-speed", &Simlab::speed_,
                    {.unit = "1", .low = 0, .high = 1000, .help = "lab seconds in a second; 0: as fast as it goes"})
            .flag("-paused", &Simlab::paused_, {.help = "lab time stands, but for what EXEC lets pass"})
            .real("-deceleration", &Simlab::deceleration_, {.unit = "rad/s2", .low = 0.1, .high = 50,
                     .help = "of the fastest joint when the arm stops by itself with power"})
            .real("-tableLimit", &Simlab::tableLimit_, {.unit = "N", .low = 1, .high = 1000,
                     .help = "on the table, beside the tokens' weight: above, the power is cut"})
            .real("-wristLimit", &Simlab::wristLimit_,
                    {.unit = "N", .low = 20, .high = 1000, .help = "at the wrist: above, the power is cut"})
            .real("-wristNoise", &Simlab::wristNoise_,
                    {.unit = "N", .low = 0, .high = 10, .help = "standard deviation of a force at the wrist"})
            .real("-tableNoise", &Simlab::tableNoise_,
                    {.unit = "N", .low = 0, .high = 10, .help = "standard deviation of a leg's force"})
            .real("-tipNoise", &Simlab::tipNoise_,
                    {.unit = "N", .low = 0, .high = 1, .help = "standard deviation of a fingertip's force"})
            .real("-cameraRate", &Simlab::cameraRate_, {.unit = "Hz", .low = 0, .high = 200,
                     .help = "pictures a second while camera.set asks for no rate; 0: on request"})
            .real("-cameraLatency", &Simlab::cameraLatency_, {.unit = "s", .low = 0, .high = 1,
                     .help = "from the end of grabbing until the picture is published"})
            .vector("-cameraClock", &Simlab::cameraClock_, {.low = -1e9, .high = 1e9, .help = "offset [s] and drift [1] of the clock that stamps "
                                                            "the pictures, against lab time", .minLength = 2, .maxLength = 2})
            .real("-imageNoise", &Simlab::imageNoise_,
                    {.unit = "1", .low = 0, .high = 100, .help = "standard deviation, in levels of 255"})
            .real("-light", &Simlab::light_, {.unit = "1", .low = 0, .high = 3, .help = "factor of the usual light"})
            .vector("-lightColour", &Simlab::lightColour_,
                    {.unit = "1", .low = 0, .high = 2, .help = "factors of red, green and blue light",
                     .minLength = 3, .maxLength = 3})
            .vector("-lightDirection", &Simlab::lightDirection_, {.unit = "1", .low = -10, .high = 10,
                     .help = "in which the lamp shines on the board; downwards", .minLength = 3, .maxLength = 3})
            .flag("-shadows", &Simlab::shadows_,
                    {.help = "the lamp casts shadows: pictures take nearly three times as long"})
            .flag("-lamp", &Simlab::lamp_, {.help = "the ball on its stick shines"})
            .real("-friction", &Simlab::friction_,
                    {.unit = "1", .low = 0.01, .high = 10, .help = "factor of the friction of tokens and table"})
            .real("-tipFriction", &Simlab::tipFriction_,
                    {.unit = "1", .low = 0.01, .high = 10, .help = "factor of the friction of the fingertips"})
            .action("-emergencyStop", &Simlab::emergencyStop, "",
                    "cut the arm's power; only -reset gives it back", 0, 0, sorma::Right::call)
            .danger(sorma::Danger::stop)
            .action("-reset", &Simlab::reset, "", "a person has looked: the arm may have power again")
            .danger(sorma::Danger::power)
            .action("-move", &Simlab::move, "token file rank ?underneath?",
                    "put a token on a field, on so many others", 3, 4)
            .action("-steal", &Simlab::steal, "token", "take a token away, to the corner of the table", 1, 1)
            .action("-add", &Simlab::add, "colour file rank ?underneath?",
                    "put a spare token on a field; returns its name", 3, 4)
            .action("-board", &Simlab::board, "dx dy turn", "shift [m] and turn [rad] the board with what lies on it", 3, 3)
            .action("-ball", &Simlab::ball, "still|line|circle|sine|jerk|file value ?value ...?",
                    "move the ball on its stick", 2, 8)
            .action("-secondBall", &Simlab::prop<simlab::Props::secondBall>, "x y z ?seconds?|away",
                    "bring a second bright ball, or move it", 1, 4)
            .action("-occluder", &Simlab::prop<simlab::Props::occluder>, "x y z ?seconds?|away",
                    "bring a dark plate, or move it", 1, 4)
            .action("-person", &Simlab::prop<simlab::Props::person>, "x y z ?seconds?|away",
                    "bring a person's hand, or move it", 1, 4)
            .action("-push", &Simlab::push, "fx fy fz seconds", "push the robot's hand [N], in the world's axes", 4, 4)
            .danger(sorma::Danger::move)
            .inspection({"-tokens", "", "name file rank x y z of each token", 0, 0,
                         [](Service& s, Args, Message& m) {
                             for (auto& t : static_cast<Simlab&>(s).lab([](Laboratory& l) { return l.props.tokens(); })) {
                                 char line[120];
                                 std::snprintf(line, sizeof line, "%s%s %.3f %.3f %.4f %.4f %.4f", m.text.empty() ? "" : "\n", t.name.c_str(),
                                               t.file, t.rank, t.at[0], t.at[1], t.at[2]);
                                 m.text += line;
                             }
                         }})
            .inspection({"-ball", "", "where the ball is: x y z; as a float, lab time", 0, 0,
                         [](Service& s, Args, Message& m) {
                             m.text += static_cast<Simlab&>(s).lab([&](Laboratory& l) {
                                 m.floats.assign(1, l.now());
                                 const simlab::Point p = l.props.ballAt(l.now());
                                 return sorma::numberText(p[0]) + " " + sorma::numberText(p[1]) + " " + sorma::numberText(p[2]);
                             });
                         }})
            .inspection({"-person", "", "where the person's hand goes: x y z, or away", 0, 0,
                         [](Service& s, Args, Message& m) {
                             m.text += static_cast<Simlab&>(s).lab([](Laboratory& l) { return l.props.placeOf(simlab::Props::person); });
                         }})
            .inspection({"-scene", "", "a scene in the box as a MuJoCo file: to start from", 0, 0,
                         [](Service& s, Args, Message& m) {
                             auto text = simlab::Scene::text(static_cast<Simlab&>(s).scene_.get(sorma::Permit::owner()));
                             m.text += text.empty() ? simlab::Scene::text("8x8") : text;
                         }})
            .concurrency(sorma::Concurrency::concurrent)
            .words("?camera|step|time|tokens|view?")
            .reads(floats, sorma::between(0, 6), "", "step, or no word: lab time [s] (1), none: one step; view: azimuth, elevation [degrees], "
                                                     "distance [m], what to look at x y z [m] (6), or none")
            .writes(floats, sorma::atLeast(0), "", "step: lab time [s]; time: lab time, and how much of it was skipped; tokens: file rank x y z [m] of each")
            .writes(text, sorma::atLeast(0), "", "tokens: their names")
            .writes(ints, sorma::between(0, 1), "", "time: how many pictures were published")
            .writes(any, {}, "", "camera, view: the picture, PPM")
            .example("simlab.example CTRL -paused 1");
    }

    ~Simlab() override { removing(); }

    void born() override {
        checkLight();
        simlab::Setup setup;
        setup.scene = scene_.use(*this);
        setup.prefix = prefix_.use(*this);
        setup.lockstep = lockstep_;
        setup.program = sorm().daemonName.empty() ? sorma::Caller::self().program : sorm().daemonName;
        setup.seed = std::uint64_t(seed_);
        std::copy_n(posture_.begin(), 6, setup.posture.begin());
        setup.width = int(width_);
        setup.height = int(height_);
        setup.samples = int(samples_);
        auto event = [box = sorm().mailbox(), weak = std::weak_ptr<Simlab*>(alive_)](std::string event, std::string text,
                                                                                                    std::vector<double> values) {
            box->post([weak, event = std::move(event), text = std::move(text), values = std::move(values)] {
                if (auto self = weak.lock()) (*self)->tell(event, text, values);
            });
        };
        sorma::Charge charge(sorm().budget.ofCaller(), sorma::Account::Use::segments);
        charge.need(name(), Laboratory::bufferBytes(setup));
        try {
            lab_ = std::make_unique<Laboratory>(setup, settings(), event);
            charge_ = std::move(charge);
        } catch (const simlab::SceneError& e) {
            fail(kScene, name(), "-scene " + setup.scene + ":", e.what());
        } catch (const shmem::Failure& e) {
            fail(kBuffer, name(), e.what());
        }
        apply();
    }

    void changed(std::span<const sorma::Option* const> options) override {
        checkLight();
        const bool paced = std::any_of(options.begin(), options.end(), [](auto* o) { return o->name == "-speed"; });
        const bool rubbed = std::any_of(options.begin(), options.end(), [](auto* o) { return o->name.ends_with("riction"); });
        apply(paced, rubbed);
    }

    void removing() override {
        lab_.reset();
        charge_.clear();
    }
    void processEnds() override { Laboratory::endAll(); }

    void exec(Message& m) override {
        const std::string word = m.words.empty() ? "step" : m.words[0];
        if (m.words.size() > 1) fail(kWord, name(), m.words[1]);
        if (word == "step") return pass(m);
        if (word == "time") return tell(m);
        if (word == "tokens") return tellTokens(m);
        if (word == "camera" || word == "view") return show(m, word == "view");
        fail(kWord, name(), word);
    }

    void dumpState(std::string& out) const override {
        if (lab_) out += lab_->between([](Laboratory& l) { return l.figures(); });
    }

    std::string selftest() override {
        const std::string problem = lab_->pictures.problem();
        return problem.empty() ? "ok" : "ok, but there are no pictures: " + problem;
    }

private:
    // A person's action; the laboratory explains a refusal.
    template <class Work> auto act(const char* what, Work work) {
        try {
            return lab(work);
        } catch (const std::invalid_argument& e) {
            fail(kRefused, name(), what, e.what());
        }
    }

    simlab::Settings settings() const {
        simlab::Settings s;
        s.paused = paused_;
        s.tableLimit = tableLimit_;
        s.wristLimit = wristLimit_;
        s.rate = cameraRate_;
        s.latency = cameraLatency_;
        s.imageNoise = imageNoise_;
        s.clockOffset = cameraClock_[0];
        s.clockDrift = cameraClock_[1];
        s.look.light = light_;
        std::copy_n(lightColour_.begin(), 3, s.look.colour.begin());
        std::copy_n(lightDirection_.begin(), 3, s.look.direction.begin());
        s.look.shadows = shadows_;
        s.look.lamp = lamp_;
        return s;
    }

    void checkLight() const {
        if (lightDirection_[2] > -0.1)
            fail(kOption, name(), "-lightDirection", lightDirection_[2], "its z must be -0.1 or less: the lamp hangs above");
    }

    void apply(bool paced = true, bool rubbed = true) {
        lab([&](Laboratory& l) {
            l.apply(settings());
            l.drive.deceleration = deceleration_;
            l.sensors.wristNoise = wristNoise_;
            l.sensors.tableNoise = tableNoise_;
            l.sensors.tipNoise = tipNoise_;
            if (paced) l.pace.setFactor(speed_);
            if (rubbed) l.props.setFriction(friction_, tipFriction_);
        });
    }

    // ---- EXEC ----

    void pass(Message& m) {
        if (m.floats.size() > 1) fail(kFloats, name(), "step", "one time [s], or none for one step", m.floats.size());
        const double seconds = m.floats.empty() ? 0.002 : m.floats[0];
        if (!(seconds > 0 && seconds <= 1e6)) fail(kValue, name(), "step", "a time above 0 and at most 1e6 s", seconds);
        if (!lab_) fail(kEnded, name());
        sorma::Reply reply = later(m);
        const auto ticket = lab_->between([&](Laboratory& l) {
            return l.after(seconds, [this, &l, reply](bool ends) {
                if (ends) return reply.fail(sorma::Error(sorma::makeEntry(kEnded, {sorma::MessageArg::of(name())})));
                reply.message().clear();
                reply.message().floats.assign(1, l.now());
                reply.complete();
            });
        });
        reply.onCancel([this, ticket] {
            if (lab_) lab_->between([ticket](Laboratory& l) { l.forget(ticket); });
        });
    }

    void tell(Message& m) {
        if (!m.floats.empty()) fail(kFloats, name(), "time", "none", m.floats.size());
        m.clear();
        lab([&](Laboratory& l) {
            m.floats = {l.now(), l.pace.skipped()};
            m.ints = {std::int32_t(l.published())};
        });
    }

    void tellTokens(Message& m) {
        if (!m.floats.empty()) fail(kFloats, name(), "tokens", "none", m.floats.size());
        m.clear();
        lab([&](Laboratory& l) {
            for (auto& t : l.props.tokens()) {
                m.text += (m.text.empty() ? "" : " ") + t.name;
                m.floats.insert(m.floats.end(), {t.file, t.rank, t.at[0], t.at[1], t.at[2]});
            }
        });
    }

    void show(Message& m, bool free) {
        const std::size_t n = m.floats.size();
        if (free ? n != 0 && n != 6 : n != 0)
            fail(kFloats, name(), m.words[0], free ? "azimuth, elevation, distance, x, y, z, or none" : "none", n);
        simlab::Shot shot = lab([](Laboratory& l) { return l.shot(); });
        shot.free = free;
        if (free) shot.width = 640, shot.height = 480;
        if (n == 6) {
            for (double x : m.floats)
                if (!std::isfinite(x)) fail(kValue, name(), "view", "finite numbers", x);
            if (m.floats[2] < 0.05 || m.floats[2] > 20) fail(kValue, name(), "view", "a distance of 0.05 .. 20 m", m.floats[2]);
            shot.view = {m.floats[0], m.floats[1], m.floats[2], {m.floats[3], m.floats[4], m.floats[5]}};
        }
        sorma::Reply reply = later(m);
        lab_->pictures.take(std::move(shot), [reply, name = name()](simlab::Image image) {
            if (!image.problem.empty())
                return reply.fail(sorma::Error(
                    sorma::makeEntry(kPicture, {sorma::MessageArg::of(name), sorma::MessageArg::of(image.problem)})));
            const std::string head = "P6\n" + std::to_string(image.width) + " " + std::to_string(image.height) + "\n255\n";
            Message& m = reply.message();
            m.clear();
            m.any.assign(head.begin(), head.end());
            m.any.insert(m.any.end(), image.rgb.begin(), image.rgb.end());
            reply.complete();
        });
    }

    // ---- what people do ----

    void emergencyStop(Args, Message& m) {
        const std::string who = m.author ? m.author->toText() : "the owner";
        lab([&](Laboratory& l) { l.emergencyStop(who); });
    }
    void reset(Args, Message&) {
        lab([](Laboratory& l) { l.reset(); });
    }
    static double underneath(Args args) { return args.size() > 3 ? simlab::toNumber(args[3], "tokens underneath") : 0; }
    void move(Args args, Message&) {
        act("-move", [&](Laboratory& l) {
            l.props.moveToken(args[0], simlab::toNumber(args[1], "file"), simlab::toNumber(args[2], "rank"),
                              underneath(args));
        });
    }
    void steal(Args args, Message&) {
        act("-steal", [&](Laboratory& l) { l.props.stealToken(args[0]); });
    }
    void add(Args args, Message& m) {
        m.text += act("-add", [&](Laboratory& l) {
            return l.props.addToken(args[0], simlab::toNumber(args[1], "file"), simlab::toNumber(args[2], "rank"),
                                    underneath(args));
        });
    }
    void board(Args args, Message&) {
        act("-board", [&](Laboratory& l) {
            l.props.moveBoard(simlab::toNumber(args[0], "dx"), simlab::toNumber(args[1], "dy"),
                              simlab::toNumber(args[2], "turn"));
        });
    }
    void ball(Args args, Message& m) {
        const bool file = args[0] == "file" && args.size() == 2;
        const sorma::Named<sorma::Kind::file> name(file ? args[1] : std::string(), m.author);
        const std::string& path = name.use(*this);
        act("-ball", [&](Laboratory& l) {
            l.props.setBall(file ? simlab::Trajectory::ofFile(path) : simlab::Trajectory::parse({args.begin(), args.end()}), l.now());
        });
    }
    template <simlab::Props::Prop which> void prop(Args args, Message&) {
        act(which == simlab::Props::secondBall ? "-secondBall"
            : which == simlab::Props::occluder ? "-occluder"
                                               : "-person",
            [&](Laboratory& l) {
                if (args.size() == 1 && args[0] == "away") return l.props.hide(which);
                if (args.size() < 3) throw std::invalid_argument("should be x y z ?seconds?, or away");
                simlab::Point p;
                for (std::size_t i = 0; i < 3; ++i) p[i] = simlab::toNumber(args[i], "x y z [m]");
                const double seconds = args.size() > 3 ? simlab::toNumber(args[3], "seconds") : 0;
                l.props.move(which, p, std::clamp(seconds, 0.0, 1000.0), l.now());
            });
    }
    void push(Args args, Message&) {
        act("-push", [&](Laboratory& l) {
            simlab::Point f;
            for (std::size_t i = 0; i < 3; ++i) f[i] = simlab::toNumber(args[i], "a force [N]");
            const double seconds = simlab::toNumber(args[3], "seconds");
            if (std::hypot(f[0], f[1], f[2]) > 500 || !(seconds > 0 && seconds <= 60))
                throw std::invalid_argument("at most 500 N, for at most 60 s");
            l.props.push(f, seconds, l.now());
        });
    }

    void tell(const std::string& event, const std::string& text, std::vector<double> values) {
        Message m;
        m.text = text;
        m.floats = std::move(values);
        publishState(event, m);
        sorm().announce(event, text, {name()});
    }

    sorma::Named<sorma::Kind::segment> prefix_;
    sorma::Named<sorma::Kind::file> scene_ = "8x8";
    std::string lockstep_;
    std::int64_t seed_ = 1, width_ = 500, height_ = 500, samples_ = 4;
    std::vector<double> posture_ = {0.304798, 1.452067, -3.149117, 0, -1.444543, -2.836795};  // above the board, tool down
    double speed_ = 1;
    bool paused_ = false, shadows_ = false, lamp_ = true;
    double deceleration_ = 4, tableLimit_ = 40, wristLimit_ = 150;
    double wristNoise_ = 0.05, tableNoise_ = 0.1, tipNoise_ = 0.01;
    double cameraRate_ = 0, cameraLatency_ = 0.02, imageNoise_ = 1;
    double light_ = 1, friction_ = 1, tipFriction_ = 1;
    std::vector<double> cameraClock_ = {0, 0};
    std::vector<double> lightColour_ = {1, 1, 1}, lightDirection_ = {0.1, 0.3, -1};

    std::shared_ptr<Simlab*> alive_ = std::make_shared<Simlab*>(this);      // work in the mailbox asks
    sorma::Charge charge_;                  // on the account of the first caller that needed it
    std::unique_ptr<Laboratory> lab_;       // last: its thread tells of what is above
};

}  // namespace

extern "C" SORMA_EXPORT int Simlab_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::simlab", "1.0", {Simlab::describe()});
}
