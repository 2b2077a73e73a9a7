// track -- position, velocity and acceleration of a target, from measurements at irregular times.
//
//     track.ball CTRL -index 1 -interval 0.07
//     track.ball EXEC FMSG 4 12.340 0.31 -0.02 0.18       seen at 12.340 s
//     track.ball EXEC predict FMSG 1 12.425               where is it by then?
//
// As a unit of a circuit, with -predict, it says where the target is when the tick is due. doc/track.man tells all.
#include "track.h"

#include <cmath>
#include <limits>

namespace track {

namespace {

using sorma::Message;
using sorma::Severity;

const sorma::Prototype kWord{Severity::error, "TRACK WORD", 2, "{}: bad word \"{}\": must be gains, predict, or start"};
const sorma::Prototype kFloats{Severity::error, "TRACK FLOATS", 1, "{}: {} expects {} floats ({}), got {}"};
const sorma::Prototype kValue{Severity::error, "TRACK VALUE", 1, "{}: float {} is {}; it must be {}"};
const sorma::Prototype kNothing{Severity::error, "TRACK NOTHING", 1, "{}: nothing has been measured yet"};
const sorma::Prototype kTick{Severity::error, "TRACK TICK", 1,
                             "{}: -predict says where the target is when a tick is due, so it must run in a cycle or circuit"};

constexpr double kMostIndex = 1e6;

}  // namespace

sorma::Class Track::describe() {
    using enum sorma::Field;
    return sorma::Class::of<Track>("track", "follows a target: position, velocity and acceleration from late and irregular measurements")
        .real("-index", &Track::index_, {.low = 1e-9, .high = kMostIndex,
                                         .help = "manoeuvring index sigma_w T^2 / sigma_v at -interval: higher is faster, and noisier"})
        .real("-interval", &Track::interval_, {.unit = "s", .low = 1e-6, .high = 3600,
                                               .help = "between measurements, for which -index holds; it grows with the square of the time between two"})
        .integer("-axes", &Track::axes_, {.unit = "1", .low = 1, .high = 100, .help = "positions in a measurement"})
        .real("-longest", &Track::longest_, {.unit = "s", .low = 1e-3, .high = 3600,
                                             .help = "after a longer pause, or when the clock is set back by more, it begins again"})
        .real("-gate", &Track::gate_, {.unit = "m", .low = 0, .high = 1e9,
                                       .help = "how far a measurement may be from where the target is expected; 0: any"})
        .integer("-confirm", &Track::confirm_, {.unit = "1", .low = 1, .high = 100,
                                                .help = "so many beyond the gate in a row, near each other: the target has jumped"})
        .real("-instant", &Track::instant_, {.unit = "s", .low = 0, .high = 3600,
                                             .help = "a measurement beyond the gate is used at once when another was used so short a time ago; 0: never"})
        .real("-calmSpeed", &Track::calmSpeed_, {.unit = "m/s", .low = 0, .high = 1e9,
                                                 .help = "velocity and acceleration of slower motions are damped; 0: never"})
        .real("-calmAcceleration", &Track::calmAcceleration_, {.unit = "m/s^2", .low = 0, .high = 1e9,
                                                               .help = "not damped from this acceleration on; 0: whatever it is"})
        .real("-trust", &Track::trust_, {.unit = "s", .low = 0, .high = 3600, .help = "so long after a measurement it is expected to go on as it did"})
        .real("-fade", &Track::fade_, {.unit = "s", .low = 0, .high = 3600,
                                       .help = "beyond -trust, time constant with which the expected speed dies away; 0: never"})
        .real("-expiry", &Track::expiry_, {.unit = "s", .low = 0, .high = 3600, .help = "the target is lost, so long after the last measurement"})
        .real("-decay", &Track::decay_, {.unit = "s", .low = 0, .high = 3600, .help = "time constant with which a lost one comes to rest"})
        .flag("-predict", &Track::predict_, {.help = "answer where the target is when the tick is due, not when it was measured"})
        .action("-reset", &Track::forget, "", "begin again with the next measurement")
        .inspection({"-state", "", "time of the last measurement, what is known of each axis, and how many measurements were used, began anew, "
                                   "were late, or were refused; how often it was lost", 0, 0,
                     [](sorma::Service& s, sorma::Args, Message& m) { static_cast<Track&>(s).tell(m.text); }})
        .words("?gains|predict|start?")
        .reads(floats, {}, "", "time [s], then a position [m] for each axis; gains: an index; predict: a time; start: a time, then x v a of each axis")
        .writes(floats, {}, "", "x v a of each axis; gains: alpha, beta, gamma")
        .writes(text, {}, "", "\"begun\", \"late\" or \"refused\", when a measurement was not just used")
        .realtime()
        .example("track EXEC gains FMSG 1 0.5");
}

Settings Track::settings() const {
    return {index_, interval_, longest_, gate_, confirm_, instant_, calmSpeed_, calmAcceleration_, trust_, fade_, expiry_, decay_};
}

void Track::born() {
    settings_ = settings();
    filter_.resize(std::size_t(axes_));
    room_.reserve(std::size_t(axes_));
}

void Track::changed(std::span<const sorma::Option* const>) { settings_ = settings(); }

// A filter of another width is made beside the one that a tick uses.
sorma::Commit Track::prepare(const sorma::Change& change) {
    if (!change.concerns("-axes")) return nullptr;
    auto axes = std::size_t(change.get<std::int64_t>("-axes"));
    if (axes == filter_.axes()) return nullptr;
    std::vector<Filter::Axis> room;
    room.reserve(axes);
    return [this, next = Filter(axes), room = std::move(room)]() mutable {
        std::swap(filter_, next);
        std::swap(room_, room);
    };
}

void Track::exec(Message& m) {
    if (m.words.empty()) return measure(m);
    const std::string& word = m.words[0];
    if (m.words.size() > 1) fail(kWord, name(), m.words[1]);
    if (word == "predict") return predict(m);
    if (word == "gains") return tellGains(m);
    if (word == "start") return start(m);
    fail(kWord, name(), word);
}

void Track::need(const Message& m, const char* task, std::size_t count, const char* what) const {
    if (m.floats.size() != count) [[unlikely]] fail(kFloats, name(), task, count, what, m.floats.size());
    for (std::size_t i = 0; i < count; ++i)
        if (!std::isfinite(m.floats[i])) [[unlikely]] fail(kValue, name(), i + 1, m.floats[i], "a finite number");
}

void Track::measure(Message& m) {
    const std::size_t n = filter_.axes();
    const auto* tick = sorma::Tick::current();
    if (predict_ && !tick) [[unlikely]] fail(kTick, name());
    if (m.floats.size() == 1 + n && std::isnan(m.floats[0])) return wait(m, tick);
    need(m, "a measurement", 1 + n, "time, then a position for each axis");
    const Taken taken = filter_.update(settings_, m.floats[0], std::span(m.floats).subspan(1));
    ++counts_[std::size_t(taken)];
    if (taken == Taken::used || taken == Taken::begun) missing_ = false;
    watch(tick);
    m.clear();
    if (taken != Taken::used) [[unlikely]] m.text = kTaken[std::size_t(taken)];
    answer(m, predict_ ? double(tick->time) * 1e-9 : filter_.time());
}

// A tick in which nothing has been measured. Before the first measurement nobody knows where the target is: nan.
void Track::wait(Message& m, const sorma::Tick* tick) {
    watch(tick);
    m.clear();
    if (filter_.begun()) return answer(m, predict_ ? double(tick->time) * 1e-9 : filter_.time());
    m.floats.assign(3 * filter_.axes(), std::numeric_limits<double>::quiet_NaN());
}

void Track::watch(const sorma::Tick* tick) {
    if (missing_ || !predict_ || !filter_.begun() || double(tick->time) * 1e-9 - filter_.time() <= settings_.expiry) return;
    missing_ = true;
    ++lost_;
}

void Track::tellIncidents(sorma::Incidents& out) const {
    out.push_back({name(), "measurement refused by the gate", counts_[std::size_t(Taken::refused)]});
    out.push_back({name(), "measurement not later than the last one", counts_[std::size_t(Taken::late)]});
    out.push_back({name(), "target lost", lost_});
}

void Track::answer(Message& m, double time) const {
    m.floats.resize(3 * filter_.axes());
    for (std::size_t i = 0; i < filter_.axes(); ++i) {
        const Filter::Axis s = filter_.at(settings_, i, time);
        m.floats[3 * i] = s.x, m.floats[3 * i + 1] = s.v, m.floats[3 * i + 2] = s.a;
    }
}

void Track::predict(Message& m) const {
    need(m, "predict", 1, "a time");
    if (!filter_.begun()) fail(kNothing, name());
    const double time = m.floats[0];
    m.clear();
    answer(m, time);
}

void Track::tellGains(Message& m) const {
    need(m, "gains", 1, "an index");
    const double index = m.floats[0];
    if (!(index > 0 && index <= kMostIndex)) fail(kValue, name(), 1, index, "above 0, and at most 1e6");
    const Gains g = gains(index);
    m.clear();
    m.floats = {g.alpha, g.beta, g.gamma};
}

void Track::start(Message& m) {
    const std::size_t n = filter_.axes();
    need(m, "start", 1 + 3 * n, "time, then x v a of each axis");
    room_.resize(n);
    for (std::size_t i = 0; i < n; ++i) room_[i] = {m.floats[1 + 3 * i], m.floats[2 + 3 * i], m.floats[3 + 3 * i]};
    sorma::BetweenTicks between(*this);
    filter_.begin(m.floats[0], room_);
    m.clear();
    answer(m, filter_.time());
}

void Track::forget(sorma::Args, Message&) { filter_.reset(); }

std::vector<sorma::Pin> Track::pins(std::string_view, std::size_t) const {
    const std::size_t n = filter_.axes();
    return {{"t", true, 0, 1, "s", "when it was measured"},
            {"z", true, 1, n, "m", "position of each axis"},
            {"out", false, 0, 3 * n, {}, "x v a of each axis"}};
}

void Track::tell(std::string& out) const {
    auto line = [&](const char* word, double value) {
        if (!out.empty()) out += '\n';
        out += word;
        out += ' ';
        sorma::appendNumber(out, value);
    };
    if (filter_.begun()) {
        line("time", filter_.time());
        for (std::size_t i = 0; i < filter_.axes(); ++i) {
            const auto& s = filter_.axis(i);
            line("axis", double(i + 1));
            for (double value : {s.x, s.v, s.a}) {
                out += ' ';
                sorma::appendNumber(out, value);
            }
        }
    }
    for (std::size_t i = 0; i < std::size(kTaken); ++i) line(kTaken[i], double(counts_[i]));
    line("lost", double(lost_));
}

void Track::dumpState(std::string& out) const {
    std::string lines;
    tell(lines);
    for (std::size_t at = 0; at < lines.size();) {
        const std::size_t end = std::min(lines.find('\n', at), lines.size());
        out += "# " + lines.substr(at, end - at) + "\n";
        at = end + 1;
    }
}

}  // namespace track

extern "C" SORMA_EXPORT int Track_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::track", "1.0", {track::Track::describe(), track::Trajectory::describe()});
}
