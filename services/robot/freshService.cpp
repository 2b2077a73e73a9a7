// fresh -- the newest record of a buffer, as long as somebody renews it; else zeros.
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
    return sorma::Class::of<Fresh>("fresh", "the newest record of a buffer, as long as somebody renews it; else zeros")
        .text("-key", &Fresh::key_, {.help = "of the buffer; empty: the flavor", .fixed = true})
        .integer("-floats", &Fresh::floats_, {.unit = "1", .low = 1, .high = 1000, .help = "of a record", .fixed = true})
        .real("-expiry", &Fresh::expiry_, {.unit = "s", .low = 0.001, .high = 3600, .help = "a record that is older counts as zeros"})
        .reads(floats, sorma::exactly(0), "", "nothing")
        .writes(floats, {}, "", "the record, or zeros")
        .conduct(sorma::Conduct::concurrent)
        .realtime()
        .example("fresh.mouse.state CTRL -expiry 0.1");
}

std::string Fresh::key() const {
    const auto dot = name().find('.');
    if (key_.empty() && dot == std::string::npos) fail(kKey, name(), "-key");
    return key_.empty() ? name().substr(dot + 1) : key_;
}

void Fresh::born() {
    tap_ = Tap(std::size_t(floats_), std::size_t(floats_));
    record_.resize(std::size_t(floats_));
    watch();
}

void Fresh::watch() {
    if (sorm().hasLoop()) timer_ = sorm().loop().after(sorma::monotonicNow() + kLook, [this] { watch(); });
    if (tap_.attached() || (key_.empty() && name().find('.') == std::string::npos)) return;
    auto found = tap_.look(key(), problem_);
    sorma::BetweenTicks between(*this);
    tap_.use(std::move(found));
}

void Fresh::exec(Message& m) {
    if (!sorma::Tick::current()) (void)key(), watch();
    m.floats.assign(record_.size(), 0);
    auto* reader = tap_.reader();
    shmem::Stamp stamp;
    if (!reader || reader->latest(record_.data(), nullptr, stamp) != shmem::Outcome::read ||
        double(shmem::nanoseconds() - stamp.monotonic) * 1e-9 > expiry_)
        ++expired_;
    else if (!std::all_of(record_.begin(), record_.end(), [](double x) { return std::isfinite(x); }))
        ++damaged_;
    else
        ++renewed_, std::copy(record_.begin(), record_.end(), m.floats.begin());
}

std::vector<sorma::Pin> Fresh::pins(std::string_view, std::size_t) const {
    return {{"out", false, 0, std::size_t(floats_), "", "the record, or zeros"}};
}

void Fresh::dumpState(std::string& out) const {
    out += "# renewed " + std::to_string(renewed_) + "\n# expired " + std::to_string(expired_) + "\n# damaged " + std::to_string(damaged_) + "\n";
    if (!problem_.empty()) out += "# missing " + problem_ + "\n";
}

}  // namespace robot
