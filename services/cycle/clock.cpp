#include "clock.h"

#include <cmath>
#include <optional>
#include <stdexcept>
#include <vector>

#include <shmem/ring.h>

#include "futex.h"

namespace cycle {

namespace {

class MachineClock final : public Clock {
public:
    std::int64_t now() noexcept override { return nanoseconds(); }
    std::uint32_t bell() const noexcept override { return bell_.load(); }
    void sleep(std::uint32_t bell, std::int64_t due, std::int64_t until) noexcept override { bell_.wait(bell, std::min(due, until)); }
    void ring() noexcept override { bell_.increase(); }
    bool monotonic() const override { return true; }
    std::uint64_t record() const noexcept override { return 0; }

private:
    Futex bell_;
};

constexpr std::int64_t kNap = 10'000'000;       // [ns] after which it looks for ring(), and for a new segment
constexpr double kMost = 9e9;                   // [s] that fit

class SnapshotClock final : public Clock {
public:
    explicit SnapshotClock(const std::string& key) : key_(key) {
        attach();
        if (!read()) throw std::runtime_error("snapshot buffer " + key + " has no record with a time in float 0 yet");
    }
    std::int64_t now() noexcept override {
        if (reader_->retired()) [[unlikely]] {
            try {
                attach();
            } catch (const std::exception&) {   // its writer has ended; another one may come
            }
        }
        read();
        return now_;
    }
    std::uint32_t bell() const noexcept override { return bell_.load(); }
    void sleep(std::uint32_t bell, std::int64_t, std::int64_t until) noexcept override {
        until = std::min(until, nanoseconds() + kNap);
        if (reader_->retired()) return bell_.wait(bell, until);
        if (bell_.load() == bell) reader_->sleep(seen_, reader_->bell(), until);
    }
    void ring() noexcept override { bell_.increase(); }
    bool monotonic() const override { return false; }
    std::uint64_t record() const noexcept override { return seen_; }

private:
    void attach() {
        reader_.emplace(key_);
        if (reader_->shape().floats == 0) throw std::runtime_error("records of snapshot buffer " + key_ + " have no floats");
        floats_.resize(reader_->shape().floats);
    }
    bool read() noexcept {
        shmem::Stamp stamp;
        if (reader_->latest(floats_.data(), nullptr, stamp) != shmem::Outcome::read) return false;
        seen_ = stamp.counter;
        if (!(std::fabs(floats_[0]) < kMost)) return false;
        now_ = std::llround(floats_[0] * 1e9);
        return true;
    }

    const std::string key_;
    std::optional<shmem::Reader> reader_;
    std::vector<double> floats_;
    std::uint64_t seen_ = 0;                // the latest record
    std::int64_t now_ = 0;
    Futex bell_;
};

}  // namespace

std::unique_ptr<Clock> machineClock() { return std::make_unique<MachineClock>(); }
std::unique_ptr<Clock> snapshotClock(const std::string& key) { return std::make_unique<SnapshotClock>(key); }

}  // namespace cycle
