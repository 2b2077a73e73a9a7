// line.h -- a line to Modbus devices, and what is read and written on it. Nothing of the bus.
//
// libmodbus has the protocol, and it blocks. So run() belongs on a thread of its own. The line opens when it is needed. It is closed when
// an answer is missing or wrong, because the rest may still come. A device that refuses a request keeps the line open.
//
// Threads: one at a time may be in run() or close(). Any other may call the rest meanwhile.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <exception>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

struct _modbus;

namespace modbus {

// Why something did not work. The names are the symbols of error codes, but for cancelled, which nobody waits for.
enum class Trouble : std::uint8_t { address,
                                    request,
                                    unreachable,
                                    lost,
                                    silent,
                                    device,
                                    answer,
                                    cancelled };

struct Failure : std::exception {
    Trouble trouble;
    std::string text;
    int number;                             // of the device's exception; else 0
    Failure(Trouble t, std::string what, int n = 0) : trouble(t), text(std::move(what)), number(n) {}
    const char* what() const noexcept override { return text.c_str(); }
};

// Where the devices are.
struct Address {
    std::string text;                       // as it was written: tcp:HOST:PORT, or rtu:PATH,BAUD,8n1
    std::string host, port;
    std::string path;                       // of a serial line (RTU); empty: it is TCP
    int baud = 0, stop = 0;
    char parity = 'N';                      // as libmodbus has it: N O E
    bool isSerial() const { return !path.empty(); }
    static Address parse(const std::string& text);      // fails with Trouble::address
};

enum class Table : std::uint8_t { coil,
                                  discrete,
                                  input,
                                  holding };

// One request to a device.
struct Operation {
    std::string text;                       // as it was written: "read UNIT TABLE ADDRESS COUNT", "write UNIT TABLE ADDRESS VALUE ...", "mask UNIT holding ADDRESS BITS VALUE"
    bool write = false;
    bool mask = false;                      // write those bits of a register that are 1 in values[0]: as in values[1]
    int unit = 0, address = 0, count = 0;
    Table table = Table::holding;
    std::vector<std::uint16_t> values;      // to write
    // UNIT is 0 to 247, or 255. TABLE is coil, discrete, input or holding. ADDRESS is as in the message, from 0. One request takes 125
    // registers or 2000 bits to read, 123 or 1968 to write. Fails with Trouble::request.
    static Operation parse(std::string_view text);
};

class Line {
public:
    explicit Line(Address address) : address_(std::move(address)) {}
    ~Line();
    Line(const Line&) = delete;
    Line& operator=(const Line&) = delete;

    const std::string& where() const { return address_.text; }
    // Do them in their order, and return what was read, in the same order. It stops at the first that does not work, and throws a
    // Failure.   patience [s]: so long the opening of the line may take, and each answer.
    std::vector<std::uint16_t> run(const std::vector<Operation>& operations, double patience);
    void prepare() { interrupted_ = false; }            // call it before the thread of run() starts
    void interrupt();                                   // run() ends as soon as it can, with Trouble::cancelled
    bool isOpen() const { return open_; }
    void close();

private:
    using Time = std::chrono::steady_clock::time_point;
    void open(double patience);
    void connect(Time until);
    void openSerial();
    void settle(const Operation& o);        // a serial line: wait until it is quiet
    bool join(int fd, const void* address, unsigned length, Time until, std::string& why);      // false: why not
    void adopt(int fd);                     // interrupt() knows this descriptor from now on; -1: none
    bool fresh();                           // drop bytes that nobody has asked for; false: the other side has closed the line
    void perform(const Operation& o, std::vector<std::uint16_t>& read);
    int mask(const Operation& o);
    [[noreturn]] void fail(const Operation& o, int error, double patience);
    void checkInterrupt() const;

    struct Free {
        void operator()(_modbus* context) const;
    };
    const Address address_;
    std::unique_ptr<_modbus, Free> context_;
    int locked_ = -1;                       // a serial line: a descriptor that keeps others out
    // Messages of a serial line have no number, and a missing answer of this unit may still come. So nobody asks the unit before the line was
    // silent for as long as an answer may take.
    int lateUnit_ = -1;
    std::chrono::steady_clock::duration silence_{};
    Time lateUntil_{};
    std::atomic<bool> interrupted_{false}, open_{false};
    std::mutex mutex_;
    int shown_ = -1;                        // the descriptor that interrupt() may shut down; under the mutex
};

}  // namespace modbus
