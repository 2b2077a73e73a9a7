// clock -- what time it is, here and elsewhere: the difference of two clocks, and records of the other one as of mine.
//
//     clock.arm EXEC                          the time here
//     clock.arm CTRL -other clock@argus       compared from now on, once in a -period
//     clock.arm EXEC FMSG 1 812.25            when was it here, as it was 812.25 there?
//
// As a unit of a circuit it converts the time stamps of records. doc/clock.man tells all.
#include <cmath>
#include <memory>
#include <stdexcept>
#include <utility>

#include <sorma.h>

#include "cycle/clock.h"
#include "difference.h"

namespace {

using sorma::Message;
using sorma::Severity;

const sorma::Prototype kWord{Severity::error, "CLOCK WORD", 2, "{}: bad word \"{}\": must be sample or theirs"};
const sorma::Prototype kFloats{Severity::error, "CLOCK FLOATS", 1, "{}: sample expects 4 floats (sent, received, answered, back), got {}"};
const sorma::Prototype kValue{Severity::error, "CLOCK VALUE", 1, "{}: float {} is {}; it must be a finite number"};
const sorma::Prototype kOrder{Severity::error, "CLOCK ORDER", 1, "{}: the answer took {} s, but the other side took {} s of it by its own clock; that is impossible"};
const sorma::Prototype kUnknown{Severity::error, "CLOCK UNKNOWN", 1, "{}: the difference is not known yet: {}"};
const sorma::Prototype kSource{Severity::error, "CLOCK SOURCE", 2, "{}: -clock {}: {}"};
const sorma::Prototype kAnswer{Severity::error, "CLOCK ANSWER", 1, "{}: {} answered {} floats; a clock answers one, its time"};
const sorma::Prototype kSet{Severity::warning, "CLOCK SET", 1, "{}: the difference to {} has changed by {} s: one of the two clocks was set"};
const sorma::Prototype kSilent{Severity::warning, "CLOCK SILENT", 1, "{}: {} does not tell its time; {}"};

class ClockService final : public sorma::Service {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return sorma::Class::of<ClockService>("clock", "tells the time, and how far another clock is ahead of it")
            .named("-clock", &ClockService::key_, {.help = "snapshot buffer whose float 0 is the time [s]; empty: the machine's monotonic clock"})
            .service("-other", &ClockService::other_, {.help = "clock elsewhere that this one is compared with; empty: none", .part = false})
            .real("-period", &ClockService::period_, {.unit = "s", .low = 0.01, .high = 3600, .help = "between two comparisons; the first ones come faster"})
            .real("-offset", &ClockService::offset_, {.unit = "s", .low = -1e9, .high = 1e9, .help = "for tests: added to the time"})
            .real("-drift", &ClockService::rate_, {.unit = "1", .low = -0.001, .high = 0.001, .help = "for tests: part by which the time runs faster"})
            .action("-compareAgain", &ClockService::compareAgain, "", "drop all comparisons and start again")
            .inspection({"-difference", "", "offset, bound of its error, drift, number of comparisons, and how long ago the last one was", 0, 0,
                         [](sorma::Service& s, sorma::Args, Message& m) { static_cast<ClockService&>(s).tell(m.text); }})
            .words("?sample|theirs?")
            .reads(floats, {}, "s", "times of the other clock; theirs: of this one; sample: sent, received, answered, back; none: the time now")
            .writes(floats, {}, "s", "the same times by this clock; theirs: by the other one; sample: offset, delay; of none: the time")
            .realtime()
            .repeatable()
            .example("clock.here EXEC");
    }

    void born() override {
        source_ = sourceOf(key_);
        begin();
    }

    sorma::Commit prepare(const sorma::Change& change) override {
        if (!change.concerns("-clock")) return nullptr;
        return [this, next = sourceOf(change.named<sorma::Kind::segment>("-clock"))]() mutable {
            std::swap(source_, next);
            difference_.forget();
        };
    }
    void changed(std::span<const sorma::Option* const> options) override {
        for (auto* option : options)
            if (option->name != "-period") difference_.forget();
        begin();
    }

    void exec(Message& m) override {
        if (!m.words.empty()) return execWord(m);
        if (m.floats.empty()) {
            auto* tick = sorma::Tick::current();        // then that of the tick: the clock is read by the SORM's thread alone
            return (void)m.floats.assign(1, tick ? shown(double(tick->time) * 1e-9) : now());
        }
        if (!difference_.known()) [[unlikely]] failUnknown();
        for (double& t : m.floats) t = difference_.toMine(t);
    }

    std::vector<sorma::Pin> pins(std::string_view, std::size_t width) const override {
        return {{"theirs", true, 0, width, "s", "times of the other clock"}, {"mine", false, 0, width, "s", "by this one"}};
    }

    void dumpState(std::string& out) const override {
        if (!difference_.known()) return;
        out += "# offset ";
        sorma::appendNumber(out, difference_.offset(now()));
        out += "\n# bound ";
        sorma::appendNumber(out, difference_.bound(now()));
        out += '\n';
    }

private:
    static constexpr double kFirst = 0.05;          // [s] between the first comparisons
    static constexpr std::size_t kFirsts = 8;

    std::shared_ptr<cycle::Clock> sourceOf(const sorma::Named<sorma::Kind::segment>& named) const {
        if (named.empty()) return cycle::machineClock();
        const std::string& key = named.use(*this);
        try {
            return cycle::snapshotClock(key);
        } catch (const std::runtime_error& e) {
            fail(kSource, name(), key, e.what());
        }
    }

    double shown(double t) const { return t + t * rate_ + offset_; }
    double now() const { return shown(double(source_->now()) * 1e-9); }

    [[noreturn]] void failUnknown() const {
        fail(kUnknown, name(), other_ ? "no answer has come from " + std::string(other_->name()) : "-other names no clock");
    }

    void execWord(Message& m) {
        const std::string& word = m.words[0];
        if (m.words.size() > 1 || (word != "sample" && word != "theirs")) fail(kWord, name(), m.words[m.words.size() > 1 ? 1 : 0]);
        for (std::size_t i = 0; i < m.floats.size(); ++i)
            if (!std::isfinite(m.floats[i])) fail(kValue, name(), i + 1, m.floats[i]);
        if (word == "theirs") {
            if (!difference_.known()) failUnknown();
            m.words.clear();
            for (double& t : m.floats) t = difference_.toOther(t);
            return;
        }
        if (m.floats.size() != 4) fail(kFloats, name(), m.floats.size());
        const timing::Sample s = take({m.floats[0], m.floats[1], m.floats[2], m.floats[3]});
        m.clear();
        m.floats = {s.offset, s.delay};
    }

    timing::Sample take(const timing::Exchange& exchange) {
        if (exchange.answered < exchange.received || exchange.back - exchange.sent < exchange.answered - exchange.received)
            fail(kOrder, name(), exchange.back - exchange.sent, exchange.answered - exchange.received);
        const timing::Sample s = timing::sampleOf(exchange);
        const double before = difference_.known() ? difference_.offset(s.at) : s.offset;
        bool fits;
        {
            sorma::BetweenTicks between(*this);
            fits = difference_.add(s);
        }
        if (!fits) sorm().announce(trailOf(sorma::makeEntry(kSet, {sorma::MessageArg::of(name()), sorma::MessageArg::of(otherName()),
                                                                   sorma::MessageArg::of(s.offset - before)})));
        Message m;
        m.floats = {difference_.offset(s.at), difference_.bound(s.at), difference_.drift()};
        publish("difference", m);
        return s;
    }

    // ---- comparing ----

    void begin() {
        timer_.cancel();
        ++round_;                           // an answer that is under way belongs to other settings
        if (other_ && sorm().hasLoop()) ask();
    }

    void ask() {
        const double sent = now();
        auto answer = other_->async(sorma::Method::exec, Message());
        answer.then([self = sorma::Reference(this), sent, round = round_](sorma::Future f) {
            auto& clock = static_cast<ClockService&>(*self);
            if (clock.round_ == round && clock.other_) clock.answered(sent, f);
        });
    }

    void answered(double sent, const sorma::Future& answer) {
        const double back = now();
        try {
            const Message& m = answer.result();
            if (m.floats.size() != 1 || !std::isfinite(m.floats[0])) fail(kAnswer, name(), other_->name(), m.floats.size());
            take({sent, m.floats[0], m.floats[0], back});
            silent_ = false;
        } catch (const std::exception& e) {
            if (!std::exchange(silent_, true)) missing(e);
        }
        const double wait = difference_.samples() < kFirsts && !silent_ ? std::min(kFirst, period_) : period_;
        timer_ = sorm().loop().after(sorma::monotonicNow() + std::int64_t(wait * 1e9), [this] { ask(); });
    }

    // Said once, until it answers again.
    void missing(const std::exception& e) {
        sorma::Trail trail;
        if (auto* error = dynamic_cast<const sorma::Error*>(&e)) trail = error->trail;
        trail.add(sorma::makeEntry(kSilent, {sorma::MessageArg::of(name()), sorma::MessageArg::of(otherName()),
                                             sorma::MessageArg::of(stillKnown())}));
        sorm().announce(trail);
    }

    std::string stillKnown() const {
        if (!difference_.known()) return "nothing is known of it yet";
        std::string age;
        sorma::appendNumber(age, now() - last());
        return "what was found " + age + " s ago still counts";
    }

    static sorma::Trail trailOf(sorma::Entry entry) {
        sorma::Trail trail;
        trail.add(std::move(entry));
        return trail;
    }
    std::string otherName() const { return other_ ? std::string(other_->name()) : "the other clock"; }
    double last() const { return difference_.newest(); }
    void compareAgain(sorma::Args, Message&) {
        difference_.forget();
        begin();
    }

    void tell(std::string& out) const {
        if (!difference_.known()) failUnknown();
        const double t = now();
        auto line = [&](const char* word, double value) {
            if (!out.empty()) out += '\n';
            out += word;
            out += ' ';
            sorma::appendNumber(out, value);
        };
        line("offset", difference_.offset(t));
        line("bound", difference_.bound(t));
        line("drift", difference_.drift());
        line("comparisons", double(difference_.samples()));
        line("age", t - last());
    }

    sorma::Named<sorma::Kind::segment> key_;
    sorma::Reference other_;
    double period_ = 1, offset_ = 0, rate_ = 0;
    std::shared_ptr<cycle::Clock> source_;
    timing::Difference difference_;
    sorma::Timer timer_;
    std::uint64_t round_ = 0;
    bool silent_ = false;
};

}  // namespace

extern "C" SORMA_EXPORT int Clock_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::clock", "1.0", {ClockService::describe()});
}
