#include "buffers.h"

#include <algorithm>

namespace simlab {

namespace {
constexpr int kLook = 25;                       // calls of take() between two looks for a writer
constexpr std::int64_t kNap = 1'000'000;        // [ns] between two looks while nobody writes
}

void Input::attach() {
    try {
        reader_.emplace(key_);
        if (reader_->shape().floats == floats_) {
            record_.resize(floats_);
            problem_.clear();
            return;
        }
        problem_ = "records of buffer " + key_ + ", written by " + reader_->segment()->writing().program + ", have " +
                   std::to_string(reader_->shape().floats) + " floats; " + std::to_string(floats_) + " are expected";
    } catch (const shmem::Failure& f) {
        problem_ = f.reason == shmem::Reason::absent ? std::string() : f.what();
    }
    reader_.reset();
}

bool Input::take() {
    if (reader_ && reader_->retired()) [[unlikely]] reader_.reset(), naps_ = 0;
    if (!reader_) {
        if (naps_-- > 0) return false;
        naps_ = kLook;
        attach();
        if (!reader_) return false;
        seen_ = 0;
    }
    if (reader_->count() == seen_) return false;
    shmem::Stamp stamp;
    if (reader_->latest(record_.data(), nullptr, stamp) != shmem::Outcome::read) return false;
    seen_ = stamp.counter;
    return stamp.monotonic >= born_;
}

void Input::wait(std::int64_t until) const {
    if (reader_ && !reader_->retired()) {
        const std::uint32_t bell = reader_->bell();
        if (reader_->count() == seen_) reader_->sleep(seen_, bell, until);
        return;
    }
    const std::int64_t left = std::min(until - shmem::nanoseconds(), kNap);
    if (left <= 0) return;
    const timespec nap{0, long(left)};
    nanosleep(&nap, nullptr);
}

}  // namespace simlab
