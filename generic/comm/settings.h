// settings.h -- limits and times of COMM. `sorma::configure` sets them; they are read when they are needed, so a change
// concerns the next call, connection or reply.
#pragma once

#include <cstddef>
#include <cstdint>

namespace sorma {

// How to reach a daemon of this host by its Unix-domain socket.
enum class Sharing : std::uint8_t {
    automatic,      // by memory as soon as calls follow each other quickly
    always,         // by memory, where the daemon agrees
    never           // by the socket
};

struct Settings {
    Sharing sharing = Sharing::automatic;
    std::int64_t timeout = 25'000;              // [ms] time for a call, 0: no limit
    std::int64_t maxMessage = 64 << 20;         // [bytes] longest record that is received or sent
    std::int64_t maxConnections = 10'000;       // of a daemon
    std::int64_t inFlight = 1024;               // calls of one client that a daemon takes at a time
    std::int64_t grace = 800;                   // [ms] in which a client whose connection broke can come back; then what it
                                                // holds is released and its calls are cancelled
    std::int64_t budget = 0;                    // [bytes] that a daemon keeps for each client host or user; 0: 2 maxMessage
    std::int64_t totalBudget = 0;               // [bytes] for all of them together; 0: 8 maxMessage
    std::int64_t maxQueue = 10'000;             // events that a daemon keeps for one subscriber, at most
    std::int64_t requestTime = 10'000;          // [ms] in which a peer has to send the rest of a request
    std::int64_t replyTime = 30'000;            // [ms] in which a peer has to read something of the replies that wait for it
    std::int64_t keepReply = 1 << 20;           // [bytes] longest reply that is kept for a client whose connection broke
    std::int64_t onewayQueue = 1 << 20;         // [bytes] of one-way requests that may wait on a connection to be sent
    std::int64_t onewayWait = 1'000;            // [ms] a one-way request waits for room there, 0: it fails at once; also at exit
    std::int64_t linger = 1'000;                // [us] a daemon waits for the next request before it returns to the event loop
};

}  // namespace sorma
