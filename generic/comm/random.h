// random.h -- numbers that nobody can guess, for identities of clients and daemons.
#pragma once

#include <sys/random.h>

#include <cerrno>
#include <cstdint>
#include <system_error>

namespace sorma {

inline std::uint64_t randomNumber() {
    std::uint64_t v = 0;
    while (v == 0)
        if (getrandom(&v, sizeof v, 0) != sizeof v && errno != EINTR)
            throw std::system_error(errno, std::generic_category(), "no random numbers");
    return v;
}

}  // namespace sorma
