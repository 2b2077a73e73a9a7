// driver.cpp -- plays the kernel's driver usbtmc, for tests/usbtmc.test: LD_PRELOAD puts it before the C library.
//
// USBTMC_FILE names the device. Class instrument plays it: a file of that name with .port behind it has its port of this host. Without that file
// nothing is plugged in. When the instrument hangs up, the device was unplugged. The driver behaves as drivers/usb/class/usbtmc.c does: calls block
// until their time is over, and transfers have at most 64 KiB. With USBTMC_OLD it has no ioctl for the end of a message, as before Linux
// 4.20: then a call reads on until the message ends. With USBTMC_BARE the device has no trigger, and answers with nothing.
#include <dlfcn.h>
#include <fcntl.h>
#include <linux/ioctl.h>
#include <linux/usb/tmc.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>
#include <string>

namespace {

constexpr std::size_t kTransfer = 65536;

struct Device {
    std::string input;                      // of answers
    std::size_t rest = 0;                   // bytes of the answer that has begun
    bool ended = false;                     // with the last transfer
    std::uint32_t ms = 5000;
};
std::mutex mutex;
int locked = -1;                            // the descriptor that has the lock of the file; under the mutex
// By descriptor; the mutex is not for what is in one. Threads read and write while the process ends: so it is never destroyed.
auto& devices = *new std::map<int, Device>;

template <class F> F real(const char* name) { return reinterpret_cast<F>(dlsym(RTLD_NEXT, name)); }
using Io = ssize_t (*)(int, void*, size_t);
using Out = ssize_t (*)(int, const void*, size_t);

Device* find(int fd) {
    std::lock_guard lock(mutex);
    auto at = devices.find(fd);
    return at == devices.end() ? nullptr : &at->second;
}

bool isDevice(const char* path) {
    const char* file = getenv("USBTMC_FILE");
    return file && path && std::strcmp(file, path) == 0;
}

// A connection to the instrument; -1 and errno.
int plug() {
    int port = 0;
    std::FILE* file = std::fopen((std::string(getenv("USBTMC_FILE")) + ".port").c_str(), "r");
    if (!file || std::fscanf(file, "%d", &port) != 1) errno = ENOENT, port = 0;
    if (file) std::fclose(file);
    if (port == 0) return -1;
    const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(std::uint16_t(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0) return fd;
    real<int (*)(int)>("close")(fd);
    errno = ENODEV;
    return -1;
}

int openDevice() {
    const int fd = plug();
    if (fd < 0) return -1;
    std::lock_guard lock(mutex);
    devices[fd] = Device();
    return fd;
}

ssize_t failed(int error) {
    errno = error;
    return -1;
}

// The bytes of the first answer that is there; 0: its end is not known yet. A block says how many it has.
std::size_t whole(const std::string& input) {
    if (input.size() >= 2 && input[0] == '#' && input[1] >= '1' && input[1] <= '9') {
        const std::size_t digits = std::size_t(input[1] - '0');
        return input.size() < 2 + digits ? 0 : 2 + digits + std::stoul(input.substr(2, digits)) + 1;
    }
    const auto end = input.find('\n');
    return end == std::string::npos ? 0 : end + 1;
}

// More of what the instrument says; 0 or an error.
int receive(int fd, Device& d) {
    pollfd ready{fd, POLLIN, 0};
    if (poll(&ready, 1, int(d.ms)) <= 0) return ETIMEDOUT;
    char bytes[kTransfer];
    const auto n = recv(fd, bytes, sizeof bytes, 0);
    if (n <= 0) return ENODEV;
    d.input.append(bytes, std::size_t(n));
    return 0;
}

ssize_t readDevice(int fd, Device& d, char* to, std::size_t most) {
    d.ended = false;
    if (getenv("USBTMC_BARE")) return 0;
    std::size_t n = 0;
    do {
        while (d.rest == 0 && (d.rest = whole(d.input)) == 0)
            if (int error = receive(fd, d)) return failed(error);
        while (d.input.empty())
            if (int error = receive(fd, d)) return failed(error);
        const std::size_t more = std::min({most - n, kTransfer, d.rest, d.input.size()});
        std::memcpy(to + n, d.input.data(), more);
        d.input.erase(0, more);
        d.rest -= more;
        d.ended = d.rest == 0;
        n += more;
    } while (getenv("USBTMC_OLD") && !d.ended && n < most);
    return ssize_t(n);
}

int say(int fd, const char* text) { return send(fd, text, std::strlen(text), MSG_NOSIGNAL) < 0 ? int(failed(ENODEV)) : 0; }

int control(int fd, Device& d, unsigned long request, void* at) {
    switch (request) {
        case USBTMC_IOCTL_GET_TIMEOUT:
            *static_cast<std::uint32_t*>(at) = d.ms;
            return 0;
        case USBTMC_IOCTL_SET_TIMEOUT:
            if (*static_cast<std::uint32_t*>(at) < 100) return int(failed(EINVAL));
            d.ms = *static_cast<std::uint32_t*>(at);
            return 0;
        case USBTMC_IOCTL_MSG_IN_ATTR:
            if (getenv("USBTMC_OLD")) return int(failed(ENOTTY));
            *static_cast<std::uint8_t*>(at) = d.ended;
            return 0;
        case USBTMC_IOCTL_ABORT_BULK_IN: return 0;
        case USBTMC_IOCTL_CLEAR: {
            const int fresh = plug();
            if (fresh < 0) return int(failed(ENODEV));
            dup3(fresh, fd, O_CLOEXEC);
            real<int (*)(int)>("close")(fresh);
            d.input.clear();
            d.rest = 0;
            return 0;
        }
        case USBTMC488_IOCTL_READ_STB: {
            char line[64] = {};
            if (say(fd, "*STB?\n") != 0) return -1;
            if (readDevice(fd, d, line, sizeof line - 1) < 0) return -1;
            *static_cast<unsigned char*>(at) = static_cast<unsigned char>(std::atoi(line));
            return 0;
        }
        case USBTMC488_IOCTL_TRIGGER:
            if (getenv("USBTMC_BARE")) return int(failed(ENOTTY));
            return say(fd, "*TRG\n");
    }
    return int(failed(ENOTTY));
}

}  // namespace

extern "C" {

int open(const char* path, int flags, ...) {
    va_list more;
    va_start(more, flags);
    const mode_t mode = va_arg(more, mode_t);
    va_end(more);
    return isDevice(path) ? openDevice() : real<int (*)(const char*, int, ...)>("open")(path, flags, mode);
}
int open64(const char* path, int flags, ...) {
    va_list more;
    va_start(more, flags);
    const mode_t mode = va_arg(more, mode_t);
    va_end(more);
    return isDevice(path) ? openDevice() : real<int (*)(const char*, int, ...)>("open64")(path, flags, mode);
}
int ioctl(int fd, unsigned long request, ...) {
    va_list more;
    va_start(more, request);
    void* at = va_arg(more, void*);
    va_end(more);
    if (Device* d = find(fd)) return control(fd, *d, request, at);
    return real<int (*)(int, unsigned long, ...)>("ioctl")(fd, request, at);
}
ssize_t read(int fd, void* to, size_t most) {
    if (Device* d = find(fd)) return readDevice(fd, *d, static_cast<char*>(to), most);
    return real<Io>("read")(fd, to, most);
}
ssize_t write(int fd, const void* bytes, size_t size) {
    if (!find(fd)) return real<Out>("write")(fd, bytes, size);
    const auto n = send(fd, bytes, size, MSG_NOSIGNAL);
    return n < 0 ? failed(ENODEV) : n;
}
int flock(int fd, int operation) {
    if (!find(fd)) return real<int (*)(int, int)>("flock")(fd, operation);
    std::lock_guard lock(mutex);
    if (locked >= 0 && locked != fd) return int(failed(EWOULDBLOCK));
    locked = fd;
    return 0;
}
int close(int fd) {
    {
        std::lock_guard lock(mutex);
        devices.erase(fd);
        if (locked == fd) locked = -1;
    }
    return real<int (*)(int)>("close")(fd);
}

}  // extern "C"
