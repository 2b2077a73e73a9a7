// settings.h -- limits and times of COMM; each can be set by `sorma::configure`.
#pragma once

#include <cstddef>
#include <cstdint>

namespace sorma {

struct Settings {
    std::int64_t timeout = 25'000;              // [ms] deadline of a call, 0 = none
    std::int64_t maxMessage = 64 << 20;         // [bytes] longest record taken, and sent
    std::int64_t maxConnections = 10'000;       // a daemon's
    std::int64_t inFlight = 1024;               // calls of one client that a daemon takes at a time
    std::int64_t grace = 1'000;                 // [ms] a client that lost its connection has to come back, before what
                                                // it holds is given back and what it waits for is cancelled
    std::int64_t budget = 0;                    // [bytes] that each client host or user may make a daemon keep; 0: 2 maxMessage
    std::int64_t totalBudget = 0;               // [bytes] all of them together; 0: 8 maxMessage
    std::int64_t maxQueue = 10'000;             // events that a daemon keeps for one subscriber, at most
    std::int64_t requestTime = 10'000;          // [ms] for a peer to send a request that it has begun
    std::int64_t replyTime = 30'000;            // [ms] for a peer to take a byte of what waits for it
    std::int64_t keepReply = 1 << 20;           // [bytes] longest reply kept for a client that lost its connection
    std::int64_t onewayQueue = 1 << 20;         // [bytes] one-way requests that wait on a connection to be sent
    std::int64_t onewayWait = 1'000;            // [ms] a one-way request waits for room there, 0: it fails at once; also at exit
    std::int64_t linger = 1'000;                // [us] a daemon waits for the next request before the event loop goes on
};

}  // namespace sorma
