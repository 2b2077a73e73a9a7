#include "device.h"

#include <fcntl.h>
#include <linux/usb/tmc.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <utility>
#include <vector>

namespace usbtmc {

namespace {

constexpr std::size_t kPiece = 1'048'576;   // bytes that are asked for at once
constexpr std::uint32_t kShortest = 100;    // [ms] that the driver takes
constexpr std::uint8_t kEnd = 1;            // in the attributes of a transfer: the message ends with it

std::string seconds(double s) {
    char text[32];
    return std::string(text, std::to_chars(text, text + sizeof text, s).ptr) + " s";
}

}  // namespace

// The driver may take another file than its own for a device, so the first ioctl is the judge.
void Device::open(double patience) {
    if (fd_ < 0) {
        auto bad = [&](const std::string& why) -> Failure {
            close();
            return {Trouble::unreachable, path_ + " cannot be opened: " + why};
        };
        fd_ = ::open(path_.c_str(), O_RDWR | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
        if (fd_ < 0) throw bad(std::strerror(errno) + std::string(errno == ENOENT || errno == ENXIO || errno == ENODEV ? "; is it plugged in?" : ""));
        std::uint32_t has = 0;
        if (ioctl(fd_, USBTMC_IOCTL_GET_TIMEOUT, &has) != 0) throw bad(errno == ENODEV ? "it was unplugged" : "it is no device of the driver usbtmc");
        if (flock(fd_, LOCK_EX | LOCK_NB) != 0) throw bad("another object or program has it");
        fcntl(fd_, F_SETFL, fcntl(fd_, F_GETFL) & ~O_NONBLOCK);
        open_ = true;
    }
    std::uint32_t ms = std::max(kShortest, std::uint32_t(std::min(std::ceil(patience * 1000), 4e9)));
    if (ioctl(fd_, USBTMC_IOCTL_SET_TIMEOUT, &ms) != 0) fail(errno, "setting its time", patience);
}

void Device::close() {
    open_ = false;
    if (fd_ >= 0) ::close(std::exchange(fd_, -1));
}

void Device::fail(int error, const std::string& doing, double patience) {
    if (error == ETIMEDOUT) throw Failure(Trouble::silent, path_ + ": " + doing + " has taken more than " + seconds(patience));
    if (error == ENOTTY || error == EOPNOTSUPP) throw Failure(Trouble::unsupported, path_ + ": " + doing + " is nothing that it can do");
    close();
    throw Failure(Trouble::lost, path_ + ": " + doing + " has failed: " + std::strerror(error) + (error == ENODEV ? "; it was unplugged" : ""));
}

void Device::write(std::string_view message, double patience) {
    open(patience);
    const auto done = ::write(fd_, message.data(), message.size());
    if (done < 0) fail(errno, "sending", patience);
    if (std::size_t(done) != message.size()) fail(EIO, "sending", patience);
}

// A transfer that was not finished must be told to the device, or the next one fails.
void Device::abortRead() { ioctl(fd_, USBTMC_IOCTL_ABORT_BULK_IN); }

std::string Device::read(std::size_t most, double patience) {
    open(patience);
    std::string answer;
    std::vector<char> piece(std::min(kPiece, most + 1));
    for (int empty = 0;;) {
        const auto got = ::read(fd_, piece.data(), piece.size());
        if (got < 0) {
            const int error = errno;
            if (error == ETIMEDOUT) abortRead();
            fail(error, "waiting for an answer", patience);
        }
        answer.append(piece.data(), std::size_t(got));
        if (answer.size() > most) {
            abortRead();
            throw Failure(Trouble::tooBig, std::to_string(answer.size()) + " bytes or more");
        }
        // Drivers before Linux 4.20 do not say whether a message has ended: then a transfer that is not full ends it.
        std::uint8_t attributes = 0;
        if (ioctl(fd_, USBTMC_IOCTL_MSG_IN_ATTR, &attributes) != 0) attributes = std::size_t(got) < piece.size() ? kEnd : 0;
        if (attributes & kEnd) return answer;
        if (got == 0 && ++empty > 1) throw Failure(Trouble::answer, path_ + " answers with nothing, again and again");
    }
}

void Device::clear(double patience) {
    open(patience);
    const int error = ioctl(fd_, USBTMC_IOCTL_CLEAR) == 0 ? 0 : errno;
    if (error != 0) fail(error, "clearing", patience);
    close();
}

int Device::status(double patience) {
    open(patience);
    unsigned char byte = 0;
    if (ioctl(fd_, USBTMC488_IOCTL_READ_STB, &byte) != 0) fail(errno, "reading the status byte", patience);
    return byte;
}

void Device::trigger(double patience) {
    open(patience);
    if (ioctl(fd_, USBTMC488_IOCTL_TRIGGER) != 0) fail(errno, "triggering", patience);
}

}  // namespace usbtmc
