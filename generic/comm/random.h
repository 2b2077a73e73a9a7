// random.h -- numbers that nobody can guess. Clients and daemons identify themselves by them.
#pragma once

#include <sys/random.h>

#include <cerrno>
#include <cstdint>
#include <system_error>

namespace sorma {

// From the kernel; never 0. Any thread. Throws std::system_error when the kernel gives none.
inline std::uint64_t randomNumber() {
    std::uint64_t v = 0;
    while (v == 0)
        if (getrandom(&v, sizeof v, 0) != sizeof v && errno != EINTR)
            throw std::system_error(errno, std::generic_category(), "no random numbers");
    return v;
}

}  // namespace sorma
