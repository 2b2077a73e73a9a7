// fresh -- the newest record of a buffer while it is renewed, else zeros.
//
//     fresh.force.out[1:3] -> matrix.force.in
#include <algorithm>
#include <cmath>

#include "fresh.h"

namespace robot {

using sorma::Message;

namespace {

constexpr std::int64_t kLook = 50'000'000;  // [ns] between two looks for the buffer

const sorma::Prototype kKey{sorma::Severity::error, "OPTION MISSING", 2, "{}: {} is empty and the name has no flavor: one of them must name the buffer"};

}  // namespace

sorma::Class Fresh::describe() {
    using enum sorma::Field;
    return sorma::Class::of<Fresh>("fresh", "the newest record of a buffer while it is renewed, else zeros")
        .named("-key", &Fresh::key_, {.help = "of the buffer; empty: the flavor", .fixed = true})
        .integer("-floats", &Fresh::floats_, {.unit = "1", .low = 1, .high = 1000, .help = "of a record", .fixed = true})
        .real("-expiry", &Fresh::expiry_, {.unit = "s", .low = 0.001, .high = 3600, .help = "a record that is older counts as zeros; in a cycle, by its clock"})
        .reads(floats, sorma::exactly(0), "", "nothing")
        .writes(floats, {}, "", "the record, or zeros")
        .concurrency(sorma::Concurrency::concurrent)
        .flavors(sorma::Flavors::any)
        .realtime()
        .example("fresh.mouse.state CTRL -expiry 0.1");
}

// A key that the flavor gives is chosen by whoever has made the object.
Fresh::Key Fresh::key() const {
    const auto dot = name().find('.');
    return key_.empty() && dot != std::string::npos ? Key(name().substr(dot + 1), maker()) : key_;
}

void Fresh::born() {
    (void)key().permit(*this);
    tap_.expect(std::size_t(floats_));
    record_.resize(std::size_t(floats_));
    watch();
}

void Fresh::watch() {
    if (sorm().hasLoop()) timer_ = sorm().loop().after(sorma::monotonicNow() + kLook, [this] { watch(); });
    if (tap_.attached() || key().empty()) return;
    auto found = tap_.look(key().use(*this));
    sorma::BetweenTicks between(*this);
    tap_.use(std::move(found));
    counter_ = 0;
}

// In a cycle its own time counts: while lab time stands still nothing grows old. The first record may have any age.
bool Fresh::old(const shmem::Stamp& stamp) {
    const std::int64_t age = shmem::nanoseconds() - stamp.monotonic;
    const auto* tick = sorma::Tick::current();
    if (!tick) return double(age) * 1e-9 > expiry_;
    if (stamp.counter != counter_) since_ = tick->time - (counter_ == 0 ? age : 0), counter_ = stamp.counter;
    return double(tick->time - since_) * 1e-9 > expiry_;
}

void Fresh::exec(Message& m) {
    if (!sorma::Tick::current()) {
        if (key().empty()) fail(kKey, name(), "-key");
        watch();
    }
    m.floats.assign(record_.size(), 0);
    const State now = read();
    if (now == renewed) std::copy(record_.begin(), record_.end(), m.floats.begin());
    // Before somebody has written for the first time nothing has expired.
    if (now == expired && state_ != expired && state_ != none) ++expiries_;
    if (now == damaged && state_ != damaged) ++damages_;
    if (now != expired || state_ != none) state_ = now;
    ++ticks_[now];
}

Fresh::State Fresh::read() {
    auto* reader = tap_.reader();
    shmem::Stamp stamp;
    if (!reader) return expired;
    const auto outcome = reader->latest(record_.data(), nullptr, stamp);
    if (outcome == shmem::Outcome::damaged) return damaged;
    if (outcome != shmem::Outcome::read || old(stamp)) return expired;
    return std::all_of(record_.begin(), record_.end(), [](double x) { return std::isfinite(x); }) ? renewed : damaged;
}

void Fresh::tellIncidents(sorma::Incidents& out) const {
    out.push_back({name(), "record expired", expiries_});
    out.push_back({name(), "record damaged", damages_});
    tap_.tellIncidents(name(), key().get(sorma::Permit::owner()), out);
}

std::vector<sorma::Pin> Fresh::pins(std::string_view, std::size_t) const {
    return {{"out", false, 0, std::size_t(floats_), "", "the record, or zeros"}};
}

void Fresh::dumpState(std::string& out) const {
    out += "# renewed " + std::to_string(ticks_[renewed]) + "\n# expired " + std::to_string(ticks_[expired]) + "\n# damaged " +
           std::to_string(ticks_[damaged]) + "\n";
    if (const auto why = tap_.missing(); !why.empty()) out += "# missing " + why + "\n";
}

}  // namespace robot
