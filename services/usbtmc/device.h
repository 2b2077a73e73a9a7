// device.h -- an instrument at a USB port, by the kernel's driver usbtmc: a file such as /dev/usbtmc0. Nothing of the bus.
//
// The driver's calls block, so they belong on a thread of their own. Nobody can interrupt one: it ends at the latest when its time is over.
//
// Source:  USB Test and Measurement Class 1.0 and its subclass USB488; <linux/usb/tmc.h> has the driver's ioctls.
// Threads: one at a time, but for isOpen().
#pragma once

#include <atomic>
#include <cstdint>
#include <exception>
#include <string>
#include <string_view>

namespace usbtmc {

// Why something did not work. The names are the symbols of error codes.
enum class Trouble : std::uint8_t { unreachable,
                                    lost,
                                    silent,
                                    answer,
                                    tooBig,
                                    unsupported };

struct Failure : std::exception {
    Trouble trouble;
    std::string text;
    Failure(Trouble t, std::string what) : trouble(t), text(std::move(what)) {}
    const char* what() const noexcept override { return text.c_str(); }
};

class Device {
public:
    explicit Device(std::string path) : path_(std::move(path)) {}
    ~Device() { close(); }
    Device(const Device&) = delete;
    Device& operator=(const Device&) = delete;

    const std::string& where() const { return path_; }
    // All but close() open the file when it is closed.   patience [s]: so long each transfer may take; the driver takes 0.1 s at least.
    void open(double patience);
    void write(std::string_view message, double patience);      // with its end
    std::string read(std::size_t most, double patience);        // an answer, up to its end
    // Drop what waits in the device, in both directions, and close.
    void clear(double patience);
    int status(double patience);            // its status byte
    void trigger(double patience);          // IEEE 488: Group Execute Trigger
    bool isOpen() const { return open_; }
    void close();

private:
    [[noreturn]] void fail(int error, const std::string& doing, double patience);
    void abortRead();

    const std::string path_;
    int fd_ = -1;
    std::atomic<bool> open_{false};
};

}  // namespace usbtmc
