// manus -- a hand with three fingers: joints, fingertips, postures, and a grasp that knows whether it holds something.
//
//     manus EXEC posture wide
//     manus EXEC tripod FMSG 1 0.027          the tips on a circle about the tool's axis
//     manus EXEC grasp                        -> FMSG 3 tip forces [N], or an error that says what was felt
//     manus EXEC release
//
// It makes a cycle of its own for the control task, cycle.NAME, as pino does for the arm. It is itself the step of that cycle: it
// reads the fingers and writes their set-points.
#include <algorithm>
#include <cmath>
#include <deque>
#include <functional>
#include <memory>
#include <optional>

#include <sorma.h>

#include "postures.h"
#include "task.h"

namespace hand {

namespace {

using sorma::Args;
using sorma::Message;
using sorma::Severity;

const sorma::Prototype kSilent{Severity::error, "HAND SILENT", 1, "{}: {} was under way when the hand's other side went away: {}"};
const sorma::Prototype kBusy{Severity::error, "HAND BUSY", 1,
                             "{}: the fingers are moved by EXEC {} for {}; wait, CTRL -stop stops it, or set -whenBusy queue"};
const sorma::Prototype kWord{Severity::error, "HAND WORD", 2, "{}: bad word \"{}\": must be {}"};
const sorma::Prototype kFloats{Severity::error, "HAND FLOATS", 1, "{}: EXEC {} expects {}, got {} floats"};
const sorma::Prototype kValue{Severity::error, "HAND VALUE", 1, "{}: EXEC {}: float {} is {}; {}"};
const sorma::Prototype kPause{Severity::error, "HAND POSTURE", 2, "{}: {}: a pause is 0 .. 3600 s"};
const sorma::Prototype kEmpty{Severity::error, "HAND EMPTY", 1,
                              "{}: nothing is between the fingers: they feel {} N, -leastForce is {} N, and the tips have closed to {} m "
                              "from the axis, where an object of {} m would have stopped them at {} m"};
const sorma::Prototype kUneven{Severity::error, "HAND UNEVEN", 1,
                               "{}: not all fingers hold the object: they feel {} N, -leastForce is {} N; it is not in the middle"};
const sorma::Prototype kStuck{Severity::error, "HAND STUCK", 1,
                              "{}: the fingers are open, and still feel {} N; a free tip feels less than {} N"};
const sorma::Prototype kStopped{Severity::error, "HAND STOPPED", 1, "{}: EXEC {} was stopped, {}"};
const sorma::Prototype kGone{Severity::error, "SERVICE GONE", 1, "{}: the service object has been removed"};
const sorma::Prototype kBlocked{Severity::warning, "HAND BLOCKED", 1,
                                "{}: joint {} (finger {}, {}) is at {} rad instead of {}: something is in its way"};
const sorma::Prototype kOrder{Severity::error, "OPTION VALUE", 2, "{}: {}: {}"};


// For the length of a block no tick uses the hand.
using Held = sorma::BetweenTicks;

template <class... Values> sorma::Error error(const sorma::Prototype& prototype, const Values&... values) {
    return sorma::Error(sorma::makeEntry(prototype, {sorma::MessageArg::of(values)...}));
}

// A request, from EXEC to its answer.
struct Job {
    std::string what;                               // the word of EXEC
    std::function<std::vector<Leg>()> plan;         // when its turn has come; throws to refuse
    std::function<void(Message&)> judge;            // the fingers are there: fill in the answer; throws to fail
    bool reopens = false;                           // when it has failed

    sorma::Reply reply;
    sorma::KeptCallPointer call;
    std::string caller, stopped;                    // who asked; why it was stopped
    std::optional<sorma::Error> verdict;            // it has failed already, and the fingers open
};
using JobPointer = std::shared_ptr<Job>;

class Manus final : public sorma::Service {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return sorma::Class::of<Manus>("manus", "a hand with three fingers: joints, fingertips, postures, grasps")
            .flag("-relative", &Manus::relative_, {.help = "angles and tips of EXEC are added to where the fingers have been sent"})
            .real("-jointSpeed", &Manus::jointSpeed_, {.unit = "rad/s", .low = 0.01, .high = 20, .help = "of the fastest joint, at most"})
            .real("-speed", &Manus::speed_, {.unit = "m/s", .low = 0.001, .high = 1, .help = "of the fastest tip, at most, where tips are moved"})
            .text("-postures", &Manus::posturesText_, {.help = "name and angles [rad] of each posture: 9 (spread, base and middle joint of each "
                                                               "finger), or 3 that hold for all fingers"})
            .choice("-whenBusy", &Manus::whenBusy_, {"refuse", "queue"}, {.help = "when another request moves the fingers: fail, or wait for the turn"})
            .real("-objectRadius", &Manus::objectRadius_, {.unit = "m", .low = 0, .high = 0.06, .help = "of what is grasped", .group = "grasp"})
            .real("-squeeze", &Manus::squeeze_, {.unit = "m", .low = 0, .high = 0.02, .help = "how far into the object the tips are sent: that makes the force", .group = "grasp"})
            .real("-opening", &Manus::opening_, {.unit = "m", .low = 0, .high = 0.08, .help = "from the tool's axis to the tips of the open hand", .group = "grasp"})
            .real("-graspSpeed", &Manus::graspSpeed_, {.unit = "m/s", .low = 0.001, .high = 1, .help = "of the tips when they close and open", .group = "grasp"})
            .real("-leastForce", &Manus::leastForce_, {.unit = "N", .low = 0, .high = 20, .help = "that each tip must feel when an object is held", .group = "grasp"})
            .flag("-reopen", &Manus::reopen_, {.help = "open the fingers when a grasp has failed", .group = "grasp"})
            .service("-speaker", &Manus::speaker_, {.help = "is told when the object is not there, or has been lost: its EXEC gets the words below; "
                                                            "none: nobody is told", .group = "voice", .part = false})
            .text("-sayMissing", &Manus::sayMissing_, {.help = "words, a list, when a grasp finds no object; empty: none", .group = "voice"})
            .text("-sayLost", &Manus::sayLost_, {.help = "words, a list, when the object was lost; empty: none", .group = "voice"})
            .real("-interval", &Manus::interval_, {.unit = "s", .low = 0.001, .high = 0.1, .help = "from one tick of the control task to the next", .expert = true})
            .flag("-labTime", &Manus::labTime_, {.help = "ticks are due by the other side's time (its buffer lab.clock), not by the machine's", .fixed = true})
            .integer("-priority", &Manus::priority_, {.low = 0, .high = 99, .help = "of the control task, as of class cycle", .fixed = true, .expert = true})
            .named("-prefix", &Manus::prefix_, {.help = "before the names of all buffers: another hand's", .fixed = true})
            .real("-height", &Manus::height_, {.unit = "m", .low = -0.1, .high = 0.02, .help = "of the tips in the tool's frame when they grasp and open", .expert = true})
            .real("-tipRadius", &Manus::tipRadius_, {.unit = "m", .low = 0, .high = 0.02, .help = "of the sphere at the end of a finger", .expert = true})
            .real("-settle", &Manus::settle_, {.unit = "s", .low = 0, .high = 5, .help = "after closing and opening, before the forces are judged", .expert = true})
            .real("-arrival", &Manus::arrival_, {.unit = "s", .low = 0, .high = 5, .help = "after any other motion, until the fingers have followed", .expert = true})
            .real("-freeForce", &Manus::freeForce_, {.unit = "N", .low = 0, .high = 20, .help = "a tip that feels more still holds the object", .expert = true})
            .real("-lostForce", &Manus::lostForce_, {.unit = "N", .low = 0, .high = 20, .help = "when two tips feel less, the object is lost", .expert = true})
            .real("-lostTime", &Manus::lostTime_, {.unit = "s", .low = 0, .high = 5, .help = "for so long", .expert = true})
            .real("-forceFilter", &Manus::forceFilter_, {.unit = "s", .low = 1e-4, .high = 1, .help = "time constant of the low-pass for tip forces", .expert = true})
            .real("-tolerance", &Manus::tolerance_, {.unit = "rad", .low = 0, .high = 3, .help = "a joint that is farther from its angle is told as blocked", .expert = true})
            .vector("-lower", &Manus::lower_, {.unit = "rad", .low = -3.2, .high = 3.2, .help = "least angles of the joints of a finger: spread, base, middle",
                                               .minLength = 3, .maxLength = 3, .names = {"spread", "base", "middle"}, .expert = true})
            .vector("-upper", &Manus::upper_, {.unit = "rad", .low = -3.2, .high = 3.2, .help = "largest angles, the same",
                                               .minLength = 3, .maxLength = 3, .names = {"spread", "base", "middle"}, .expert = true})
            .vector("-bases", &Manus::bases_, {.unit = "m", .low = -1, .high = 1, .help = "of the fingers' bases: distance from the tool's axis, height in its frame",
                                               .minLength = 2, .maxLength = 2, .names = {"distance", "height"}, .expert = true})
            .vector("-links", &Manus::links_, {.unit = "m", .low = 0.001, .high = 1, .help = "lengths of a finger's links, from its base to the centre of its tip",
                                               .minLength = 3, .maxLength = 3, .expert = true})
            .action({"-stop", "", "stop the fingers where they are", 0, 0,
                     [](Service& s, Args, Message& m) { static_cast<Manus&>(s).stopNow(m); }, sorma::Right::call, true})
            .danger(sorma::Danger::stop)
            .execDanger(sorma::Danger::move, {"finger", "grasp", "joint", "joints", "posture", "release", "sequence", "tip", "tips", "tripod"})
            .action("-teach", &Manus::teach, "name", "keep where the fingers have been sent as a posture", 1, 1)
            .action("-unteach", &Manus::unteach, "name", "remove a posture", 1, 1)
            .words("?finger | grasp | joint | joints | posture name | release | sequence ?name|seconds ...? | status | tip | tips | tripod?")
            .reads(floats, sorma::between(0, 9 * kMostPostures), "rad, m",
                   "joints: 9 angles, spread, base, middle of each finger; finger: its number from 1, and 3 angles; joint: its number from 1, "
                   "and an angle; tips: 9, x y z of each tip in the tool's frame; tip: its number, and x y z; tripod: distance of all tips from "
                   "the tool's axis, and their height, or -height; grasp: -objectRadius, if it is another one; release: -opening, if another "
                   "one; sequence: 9 angles for each posture, instead of names")
            .writes(floats, sorma::between(3, 24), "N, m, rad",
                    "forces that the tips feel (3); without words and status also the tips in the tool's frame (9) and the angles (12: spread, "
                    "base, middle, end of each finger)")
            .writes(ints, sorma::exactly(2), "", "without words and status: whether the fingers move; whether they hold something")
            .writes(text, {}, "", "status: in clear text")
            .concurrency(sorma::Concurrency::concurrent)
            .realtime()
            .example("manus CTRL -speed 0.05");
    }

    ~Manus() override { task_.halt(); }

    void born() override { check(); }

    void changed(std::span<const sorma::Option* const> options) override {
        check();
        if (!task_.control()) return;
        control().settings = settings();
        for (auto* o : options)
            if (o->name == "-interval") task_.configure({"-period", sorma::numberText(interval_)});
    }

    void removing() override {
        task_.halt();
        failAll(error(kGone, name()));
    }

    void exec(Message& m) override {
        if (m.words.empty()) {
            if (auto* tick = sorma::Tick::current()) [[likely]] {
                if (auto* control = task_.control()) control->tick(tick->time, tick->period);
                return m.clear();
            }
            return status(m);
        }
        const std::string word = m.words[0];
        const bool more = word == "posture" || word == "sequence";
        if (!more && m.words.size() > 1) fail(kWord, name(), m.words[1], "nothing after \"" + word + "\"");
        for (std::size_t i = 0; i < m.floats.size(); ++i)
            if (!std::isfinite(m.floats[i])) fail(kValue, name(), word, i + 1, m.floats[i], "all must be finite numbers");
        auto expect = [&](bool right, const char* what) {
            if (!right) fail(kFloats, name(), word, what, m.floats.size());
        };
        const auto f = m.floats;
        const std::size_t n = f.size();
        if (word == "status") return status(m);
        if (word == "joints" || word == "tips") {
            expect(n == 9, word == "tips" ? "9: x y z of each tip" : "9: spread, base and middle joint of each finger");
            Targets given;
            std::copy_n(f.begin(), 9, given.begin());
            return move(m, word, [this, given, tips = word == "tips"] { return one(given, tips, relative_); });
        }
        if (word == "finger" || word == "tip") {
            expect(n == 4, word == "tip" ? "4: the number of the finger, and x y z of its tip" : "4: the number of the finger, and 3 angles");
            const std::size_t finger = count(word, f[0], kFingers);
            return move(m, word, [this, f, finger, tips = word == "tip"] { return some(3 * finger, {f.begin() + 1, f.end()}, tips); });
        }
        if (word == "joint") {
            expect(n == 2, "2: the number of the joint, and its angle");
            const std::size_t joint = count(word, f[0], kJoints);
            return move(m, word, [this, joint, angle = f[1]] { return some(joint, {angle}, false); });
        }
        if (word == "tripod") {
            expect(n == 1 || n == 2, "1 or 2: the distance of the tips from the tool's axis, and their height");
            return move(m, word, [this, radius = f[0], height = n == 2 ? f[1] : height_] { return one(ring(radius, height), true, false); });
        }
        if (word == "posture") {
            expect(n == 0, "none");
            if (m.words.size() != 2) fail(kWord, name(), sorma::joinWords(m.words), "posture and one name: " + postures_.names());
            return move(m, word, [this, to = postures_.get(name(), m.words[1])] { return one(to, false, false); });
        }
        if (word == "sequence") return sequence(m, f);
        if (word == "grasp") {
            expect(n < 2, "none, or the radius of the object");
            return grasp(m, n ? f[0] : objectRadius_);
        }
        if (word == "release") {
            expect(n < 2, "none, or the distance of the open tips from the tool's axis");
            return release(m, n ? f[0] : opening_);
        }
        fail(kWord, name(), word, "finger, grasp, joint, joints, posture, release, sequence, status, tip, tips, or tripod");
    }

    void dumpState(std::string& out) const override {
        out += std::string("# controlTask ") + (task_.control() ? "runs" : "ended") + "\n";
        if (job_) out += "# moved by EXEC " + job_->what + " for " + job_->caller + "\n";
        out += "# waiting " + std::to_string(queue_.size()) + "\n";
        if (task_.control()) out += std::string("# holds ") + (control().holds() ? "1" : "0") + "\n# forces " + text(control().felt()) + "\n";
    }

    std::string selftest() override {
        const Geometry g = settings().geometry;
        Angles angles{0, 0.1, 0.2};
        if (!reach(g, 0, anglesOf(ring(opening_, height_), 0), angles))
            fail(kOrder, name(), "-opening", "no finger reaches " + number(opening_) + " m from the axis at the -height of " + number(height_) + " m");
        return "ok: the tips reach -opening";
    }

private:
    static constexpr std::size_t kMostPostures = 100;       // of a sequence

    // ---- options ----

    Settings settings() const {
        Settings s;
        s.geometry = {bases_[0], bases_[1], links_[0], links_[1], links_[2], {lower_[0], lower_[1], lower_[2]}, {upper_[0], upper_[1], upper_[2]}};
        s.forceFilter = forceFilter_, s.lost = lostForce_, s.lostTime = lostTime_;
        return s;
    }

    Planner planner() const { return {name(), settings().geometry, jointSpeed_}; }

    void check() {
        for (std::size_t i = 0; i < 3; ++i)
            if (lower_[i] > upper_[i])
                fail(kOrder, name(), "-lower", number(lower_[i]) + " of the " + kJointNames[i] + " joint is above its -upper " + number(upper_[i]));
        Postures postures(planner(), posturesText_);
        for (auto& [option, words] : {std::pair<const char*, const std::string&>{"-sayMissing", sayMissing_}, {"-sayLost", sayLost_}}) {
            try {
                sorma::splitWords(words);
            } catch (const sorma::Error& e) {
                fail(kOrder, name(), option, std::string("is no list of words: ") + e.what());
            }
        }
        postures_ = std::move(postures);
    }

    // As CTRL of this object, so that what it says of the value's origin is true.
    void setPostures(const Postures& postures, const Message& asked) {
        Message change;
        change.words = {"-postures", postures.toText()};
        change.author = asked.author;
        invoke(sorma::Method::ctrl, change);
    }

    void teach(Args args, Message& m) {
        needHardware();
        auto postures = postures_;
        {
            Held held(*this);
            postures.keep(args[0], control().targets());
        }
        setPostures(postures, m);
        m.text += args[0] + " " + text(postures.get(name(), args[0]));
    }

    void unteach(Args args, Message& m) {
        auto postures = postures_;
        postures.remove(name(), args[0]);
        setPostures(postures, m);
    }

    std::size_t count(const std::string& word, double given, std::size_t most) const {
        if (given != std::floor(given) || given < 1 || given > double(most))
            fail(kValue, name(), word, 1, given, "it must be a number from 1 to " + std::to_string(most));
        return std::size_t(given) - 1;
    }

    // ---- plans ----

    std::vector<Leg> one(Targets to, bool tips, bool relative) const {
        Targets at = present();
        if (relative) {
            const Targets from = tips ? tipsOf(settings().geometry, at) : at;
            for (std::size_t i = 0; i < kJoints; ++i) to[i] += from[i];
        }
        return {planner().leg(at, to, tips, speed_, arrival_)};
    }

    // One finger, or one joint; the others stay.
    std::vector<Leg> some(std::size_t first, const std::vector<double>& values, bool tips) const {
        Targets to = present();
        if (tips) to = tipsOf(settings().geometry, to);
        for (std::size_t i = 0; i < values.size(); ++i) to[first + i] = values[i] + (relative_ ? to[first + i] : 0);
        return one(to, tips, false);
    }

    Targets present() const { return control().targets(); }

    void sequence(Message& m, const std::vector<double>& floats) {
        struct Part { Targets to{}; double pause = 0; };
        std::vector<Part> parts;
        double before = 0;              // a pause at the begin
        for (std::size_t i = 1; i < m.words.size(); ++i) {
            if (double seconds; sorma::parseNumber(m.words[i], seconds)) {
                if (!(seconds >= 0 && seconds <= 3600)) fail(kPause, name(), m.words[i]);
                (parts.empty() ? before : parts.back().pause) += seconds;
            } else {
                parts.push_back({postures_.get(name(), m.words[i]), 0});
            }
        }
        if (floats.size() % kJoints != 0 || (parts.empty() == floats.empty()) || (before > 0 && parts.empty()))
            fail(kFloats, name(), "sequence", "names of postures and pauses [s], or 9 angles for each posture", floats.size());
        for (std::size_t i = 0; i < floats.size(); i += kJoints) {
            parts.emplace_back();
            std::copy_n(floats.begin() + std::ptrdiff_t(i), kJoints, parts.back().to.begin());
        }
        move(m, "sequence", [this, parts, before] {
            Targets at = present();
            std::vector<Leg> legs;
            if (before > 0) legs.push_back(planner().leg(at, at, false, speed_, before));
            for (auto& p : parts) legs.push_back(planner().leg(at, p.to, false, speed_, p.pause));
            legs.back().pause = std::max(legs.back().pause, arrival_);
            return legs;
        });
    }

    std::vector<Leg> toRing(double radius) const {
        Targets at = present();
        return {planner().leg(at, ring(radius, height_), true, graspSpeed_, settle_)};
    }

    // ---- motions ----

    void move(Message& m, const std::string& what, std::function<std::vector<Leg>()> plan) {
        auto job = std::make_shared<Job>();
        job->what = what;
        job->plan = [this, plan = std::move(plan)] {
            control().hold(false);
            return plan();
        };
        job->judge = [this](Message& reply) {
            reply.floats.assign(control().felt().begin(), control().felt().end());
            const Targets at = control().state().angles(), wanted = control().targets();
            for (std::size_t i = 0; i < kJoints; ++i)
                if (std::fabs(at[i] - wanted[i]) > tolerance_)
                    reply.warn(kBlocked, name(), i + 1, i / 3 + 1, kJointNames[i % 3], number(at[i]), number(wanted[i]));
        };
        submit(m, std::move(job));
    }

    void grasp(Message& m, double object) {
        if (!(object >= 0 && object <= 0.06)) fail(kValue, name(), "grasp", 1, object, "the radius of an object is 0 .. 0.06 m");
        auto job = std::make_shared<Job>();
        job->what = "grasp";
        job->reopens = reopen_;
        job->plan = [this, object] {
            control().hold(false);
            return toRing(std::max(0.0, object + tipRadius_ - squeeze_));
        };
        job->judge = [this, object](Message& reply) {
            const Point felt = control().felt();
            const auto touching = std::count_if(felt.begin(), felt.end(), [this](double f) { return f >= leastForce_; });
            if (touching < 3) {
                const Targets tips = tipsOf(control().settings.geometry, control().state().angles());
                double radius = 0;
                for (std::size_t f = 0; f < kFingers; ++f) radius += radiusOf(anglesOf(tips, f)) / kFingers;
                const bool missing = std::all_of(felt.begin(), felt.end(), [this](double f) { return f < leastForce_; });
                tell("missing", felt);
                say(sayMissing_);
                if (missing) fail(kEmpty, name(), text(felt), number(leastForce_), number(radius), number(object), number(object + tipRadius_));
                fail(kUneven, name(), text(felt), number(leastForce_));
            }
            control().hold(true);
            tell("holds", felt);
            reply.floats.assign(felt.begin(), felt.end());
        };
        submit(m, std::move(job));
    }

    void release(Message& m, double opening) {
        if (!(opening >= 0 && opening <= 0.08)) fail(kValue, name(), "release", 1, opening, "the tips open to 0 .. 0.08 m");
        auto job = std::make_shared<Job>();
        job->what = "release";
        job->plan = [this, opening] {
            control().hold(false);
            return toRing(opening);
        };
        job->judge = [this](Message& reply) {
            const Point felt = control().felt();
            if (*std::max_element(felt.begin(), felt.end()) > freeForce_) fail(kStuck, name(), text(felt), number(freeForce_));
            tell("free", felt);
            reply.floats.assign(felt.begin(), felt.end());
        };
        submit(m, std::move(job));
    }

    void submit(Message& m, JobPointer job) {
        needHardware();
        if (job_ && whenBusy_ == "refuse") fail(kBusy, name(), job_->what, job_->caller);
        std::vector<Leg> legs;
        if (!job_) {
            Held held(*this);
            legs = job->plan();
        }
        job->caller = sorma::CallContext::currentCallers();
        job->call = sorma::CallContext::keep();
        job->reply = later(m);
        job->reply.message().clear();
        job->reply.onCancel([this, weak = std::weak_ptr(job)] {
            auto j = weak.lock();
            if (!j) return;
            if (j == job_) return stopMotion("because its caller has cancelled it, or its deadline has passed");
            if (std::erase(queue_, j)) j->reply.complete();
        });
        if (job_) return queue_.push_back(std::move(job));
        begin(std::move(job), std::move(legs));
    }

    void begin(JobPointer job, std::vector<Leg> legs) {
        job_ = std::move(job);
        Held held(*this);
        control().begin(std::move(legs));
    }

    void stopMotion(const std::string& why) {
        if (!job_) return;
        if (job_->stopped.empty()) job_->stopped = why;
        control().requestStop();
    }

    void stopNow(Message& m) {
        m.text += job_ ? "stopping" : "nothing moves";
        stopMotion("by CTRL -stop of " + name() + " from " + sorma::CallContext::currentCallers());
    }

    // The bell has rung: the control task has something to tell.
    void ended() {
        control().quiet();
        Outcome outcome;
        bool over, lost;
        Point felt;
        {
            Held held(*this);
            over = control().takeEnding(outcome);
            lost = control().takeLoss();
            felt = control().felt();
        }
        if (lost) {
            tell("lost", felt);
            say(sayLost_);
        }
        if (!over || !job_) return;
        auto job = std::exchange(job_, nullptr);
        answerJob(job, outcome);
        if (!job_) nextJob();
    }

    void answerJob(const JobPointer& job, Outcome outcome) {
        sorma::CallContext context(job->call);
        try {
            if (job->verdict) throw sorma::Error(*job->verdict);
            if (outcome == Outcome::stopped) throw error(kStopped, name(), job->what, job->stopped.empty() ? "by somebody" : job->stopped);
            {
                Held held(*this);
                job->judge(job->reply.message());
            }
            job->reply.complete();
        } catch (const sorma::Error& e) {
            if (outcome == Outcome::stopped || job->verdict || !job->reopens) return job->reply.fail(e);
            job->verdict = e;
            std::vector<Leg> legs;
            try {
                Held held(*this);
                legs = toRing(opening_);
            } catch (const sorma::Error&) {         // it stays closed
                return job->reply.fail(e);
            }
            begin(job, std::move(legs));
        }
    }

    void nextJob() {
        while (!job_ && !queue_.empty()) {
            auto job = std::move(queue_.front());
            queue_.pop_front();
            try {
                std::vector<Leg> legs;
                {
                    Held held(*this);
                    legs = job->plan();
                }
                begin(job, std::move(legs));
            } catch (const std::exception& e) {
                job->reply.fail(e);
            }
        }
    }

    void failAll(const sorma::Error& why) {
        auto queue = std::exchange(queue_, {});
        if (job_) queue.push_front(std::exchange(job_, nullptr));
        for (auto& job : queue) job->reply.fail(why);
    }

    // ---- the control task ----

    Control& control() const { return *task_.control(); }

    void needHardware() {
        if (task_.control()) task_.needOtherSide();
        else task_.start({prefix_.use(*this), interval_, priority_, labTime_, settings()});
    }

    // From time to time: is the other side still there, does the control task run?
    void watched(bool there) {
        const bool runs = realtimeOwner() != nullptr;
        if (runs && (there || !job_)) return;
        // A task that takes its time from the other side ends with it: then that is the reason.
        if (auto job = there ? nullptr : std::exchange(job_, nullptr)) job->reply.fail(error(kSilent, name(), "EXEC " + job->what, task_.problem()));
        failAll(task_.whyEnded(there));
        task_.halt();                           // the next request begins again
    }

    // ---- what others see ----

    void status(Message& m) {
        const bool inWords = !m.words.empty();
        needHardware();
        Held held(*this);
        if (!job_) control().sense();
        m.clear();
        const State& s = control().state();
        m.floats.assign(control().felt().begin(), control().felt().end());
        const Targets tips = tipsOf(control().settings.geometry, s.angles());
        m.floats.insert(m.floats.end(), tips.begin(), tips.end());
        m.floats.insert(m.floats.end(), s.joints.begin(), s.joints.end());
        m.ints = {job_ != nullptr, control().holds()};
        if (!inWords) return;
        m.text = job_ ? "moved by EXEC " + job_->what + " for " + job_->caller : control().holds() ? "holds something" : "free";
        m.text += "\nforces " + text(control().felt()) + " N";
        for (std::size_t f = 0; f < kFingers; ++f)
            m.text += "\nfinger " + std::to_string(f + 1) + " " + text(anglesOf(s.angles(), f)) + " rad, its tip at " + text(anglesOf(tips, f)) + " m";
        if (!queue_.empty()) m.text += "\nwaiting " + std::to_string(queue_.size());
    }

    void tell(std::string_view event, const Point& felt) {
        Message m;
        m.floats.assign(felt.begin(), felt.end());
        publish(event, m);
    }

    void say(const std::string& words) {
        if (!speaker_ || words.empty()) return;
        Message m;
        m.words = sorma::splitWords(words);
        speaker_->oneway(sorma::Method::exec, std::move(m));
    }

    // options
    bool relative_ = false, labTime_ = false, reopen_ = true;
    double jointSpeed_ = 3, speed_ = 0.05, graspSpeed_ = 0.075;
    double objectRadius_ = 0.015, squeeze_ = 0.005, opening_ = 0.027, leastForce_ = 0.5, freeForce_ = 0.2;
    double interval_ = 0.015, height_ = 0, tipRadius_ = 0.005, settle_ = 0.15, arrival_ = 0.08;
    double lostForce_ = 0.1, lostTime_ = 0.05, forceFilter_ = 0.02, tolerance_ = 0.1;
    std::int64_t priority_ = 40;
    sorma::Named<sorma::Kind::segment> prefix_;
    std::string whenBusy_ = "refuse", sayMissing_ = "{I cannot find the object}", sayLost_ = "{I have lost the object}";
    std::string posturesText_ = "rest {0 -0.263 0.486} wide {0 -0.45 0.45} straight {0 0 0} fist {0 0.6 1.4} point {0 0 0 0 0.6 1.4 0 0.6 1.4}";
    std::vector<double> lower_{-0.262, -0.6, 0}, upper_{0.262, 1.4, 1.4}, bases_{0.040, -0.110}, links_{0.055, 0.035, 0.030};
    sorma::Reference speaker_;

    Postures postures_;
    Task task_{*this, [this] { ended(); }, [this](bool there) { watched(there); }};
    JobPointer job_;                        // under way
    std::deque<JobPointer> queue_;
};

}  // namespace

}  // namespace hand

extern "C" SORMA_EXPORT int Hand_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::hand", "1.0", {hand::Manus::describe()});
}
