// descriptor.h -- owns a descriptor. Header only: the snapshot library stands alone.
#pragma once

#include <unistd.h>

#include <utility>

namespace sorma {

// Closed at the end. May be moved, not copied.
class Descriptor {
public:
    explicit Descriptor(int fd = -1) : fd_(fd) {}           // -1: none
    Descriptor(Descriptor&& o) noexcept : fd_(o.release()) {}
    Descriptor& operator=(Descriptor&& o) noexcept {
        Descriptor gone(release());
        fd_ = o.release();
        return *this;
    }
    ~Descriptor() { close(); }

    int get() const { return fd_; }
    explicit operator bool() const { return fd_ >= 0; }
    int release() { return std::exchange(fd_, -1); }        // gives up what it owns
    bool close() {                                          // false: as close(2), with errno
        const int fd = release();
        return fd < 0 || ::close(fd) == 0;
    }

private:
    int fd_;
};

}  // namespace sorma
