// connectionParts.h -- what both halves of a connection share: connection.cpp, connectionEvents.cpp.
#pragma once

#include "comm/connection.h"

namespace sorma {

inline constexpr std::uint32_t kSlotBits = 16;          // xid = low bits of the sequence, slot
inline constexpr std::uint32_t kControl = (1u << kSlotBits) - 1;        // the slot part of what is no call
inline constexpr std::uint32_t kNoTicket = UINT32_MAX;
inline constexpr std::size_t kReserved = 8;             // slots that CTRL and DBX find free while EXECs wait
inline constexpr std::int64_t kFirstPause = 2'000'000, kLastPause = 100'000'000;    // [ns] between attempts to reconnect

inline constexpr std::int64_t kAbsence = 5'000'000'000;         // [ns] nothing listens where a daemon was: then it is given up

struct Connection::Opening {
    int fd = -1;
    Address address;
    bool greeting = false;              // connected, HELLO is sent
    Buffer in;
    Timer timer;
};

}  // namespace sorma
