// alarms.h -- functions that are to be called at a time: by the loop, or by whoever waits without it.
//
// Threads: the SORM's.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <map>
#include <utility>

#include "bus/deadline.h"
#include "bus/loop.h"

namespace etcd {

class Alarms {
public:
    using Number = std::uint64_t;                       // 0: none

    explicit Alarms(sorma::Loop& loop) : loop_(loop) {}
    // In so many nanoseconds. number: of the one that this replaces; becomes its own.
    void set(Number& number, std::int64_t nanoseconds, std::function<void()> call) {
        cancel(number);
        number = ++last_;
        alarms_.emplace(std::pair(sorma::monotonicNow() + nanoseconds, number), std::move(call));
        arm();
    }
    void cancel(Number& number) {
        if (number != 0) std::erase_if(alarms_, [&](auto& alarm) { return alarm.first.second == number; });
        number = 0;
    }
    // Call those that are due. They may set others, which wait for the next time.
    void run() {
        const auto limit = std::pair(sorma::monotonicNow(), last_);
        while (!alarms_.empty() && alarms_.begin()->first <= limit) {
            const auto call = std::move(alarms_.extract(alarms_.begin()).mapped());
            call();
        }
        arm();
    }
    // When the first one is due [ns]; otherwise: there is none before.
    std::int64_t first(std::int64_t otherwise) const { return alarms_.empty() ? otherwise : std::min(otherwise, alarms_.begin()->first.first); }

private:
    void arm() {
        timer_.cancel();
        if (!alarms_.empty()) timer_ = loop_.after(alarms_.begin()->first.first, [this] { run(); });
    }

    sorma::Loop& loop_;
    sorma::Timer timer_;
    std::map<std::pair<std::int64_t, Number>, std::function<void()>> alarms_;
    Number last_ = 0;
};

}  // namespace etcd
