// connectionParts.h -- what connection.cpp and connectionEvents.cpp share. No other file includes it.
#pragma once

#include "comm/connection.h"

namespace sorma {

// The xid of a record: the low bits of the call's sequence number, then the slot.
inline constexpr std::uint32_t kSlotBits = 16;
inline constexpr std::uint32_t kControl = (1u << kSlotBits) - 1;        // in place of the slot, for records that are no calls
inline constexpr std::uint32_t kNoTicket = UINT32_MAX;                  // Pending::ticket of a call that has no slot yet
inline constexpr std::size_t kReserved = 8;             // slots kept free for CTRL and DBX while EXECs wait
// Pause between attempts to reconnect: it doubles from the first to the last. [ns]
inline constexpr std::int64_t kFirstPause = 2'000'000, kLastPause = 100'000'000;
// When nothing has listened at the address for so long, calls that were sent fail. [ns]
inline constexpr std::int64_t kAbsence = 5'000'000'000;

struct Connection::Opening {
    int fd = -1;                        // -1: it has become the connection's
    Address address;
    bool greeting = false;              // connected, HELLO is sent
    Buffer in;                          // of the daemon's welcome
    Timer timer;                        // ends the attempt
};

}  // namespace sorma
