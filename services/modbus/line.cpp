#include "line.h"

#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <regex>
#include <thread>
#include <utility>

#include <modbus/modbus.h>

namespace modbus {

namespace {

using Clock = std::chrono::steady_clock;
constexpr int kSlice = 100;                 // [ms] after which somebody who connects looks whether he shall stop
constexpr auto kLongest = std::chrono::seconds(60);     // that somebody waits for a serial line to become quiet
constexpr std::size_t kShown = 100;         // bytes of a text in a message

std::string cut(std::string_view text) { return std::string(text.substr(0, kShown)); }

std::string seconds(double s) {
    char text[32];
    auto end = std::to_chars(text, text + sizeof text, s).ptr;
    return std::string(text, end) + " s";
}

Clock::duration spanOf(double s) { return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(s)); }

int milliseconds(Clock::time_point until) {
    auto left = std::chrono::duration_cast<std::chrono::milliseconds>(until - Clock::now()).count();
    return int(std::clamp<long long>(left, 0, 1'000'000'000));
}

std::string tooManyFiles() { return "this process has more than " + std::to_string(FD_SETSIZE) + " files open, and libmodbus takes no more"; }

// As the specification of the application protocol has them, chapter 7.
const char* meaning(int exception) {
    switch (exception) {
        case 1: return "illegal function: the device has no such kind of request";
        case 2: return "illegal data address: it has no such register";
        case 3: return "illegal data value: it does not take this value, or so many";
        case 4: return "server device failure: it could not do it";
        case 5: return "acknowledge: it has begun, and needs long";
        case 6: return "server device busy: ask again later";
        case 7: return "negative acknowledge: it cannot do it";
        case 8: return "memory parity error";
        case 10: return "gateway path unavailable: the gateway is set wrongly, or has too much to do";
        case 11: return "gateway target device failed to respond: is the unit there, and switched on?";
        default: return "an exception without a name";
    }
}

bool number(std::string_view word, int low, int high, int& out) {
    auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), out);
    return error == std::errc() && end == word.data() + word.size() && out >= low && out <= high;
}

std::vector<std::string_view> split(std::string_view text) {
    std::vector<std::string_view> words;
    for (std::size_t at = 0; (at = text.find_first_not_of(' ', at)) != std::string_view::npos;) {
        const std::size_t end = std::min(text.find(' ', at), text.size());
        words.push_back(text.substr(at, end - at));
        at = end;
    }
    return words;
}

// Speeds that libmodbus knows. Others it would take for 9600.
struct Speed {
    int baud;
    speed_t code;
};
constexpr Speed kSpeeds[] = {{110, B110}, {300, B300}, {600, B600}, {1200, B1200}, {2400, B2400}, {4800, B4800}, {9600, B9600}, {19200, B19200}, {38400, B38400}, {57600, B57600}, {115200, B115200}, {230400, B230400}, {460800, B460800}, {500000, B500000}, {576000, B576000}, {921600, B921600}, {1000000, B1000000}};

const Speed* speedOf(int baud) {
    auto found = std::find_if(std::begin(kSpeeds), std::end(kSpeeds), [&](auto& s) { return s.baud == baud; });
    return found == std::end(kSpeeds) ? nullptr : found;
}

}  // namespace

Address Address::parse(const std::string& text) {
    static const std::regex tcp(R"(tcp:(?:\[([0-9A-Fa-f:.%a-z]+)\]|([^\s:,\[\]]+)):([1-9]\d{0,4}))");
    static const std::regex rtu(R"(rtu:(/[^\s,]+),(\d{1,7}),8([noe])([12]))");
    std::smatch m;
    Address a;
    a.text = text;
    if (text.size() <= 1000 && std::regex_match(text, m, tcp) && std::stoi(m[3]) <= 65535) {
        a.host = m[1].matched ? m[1] : m[2];
        a.port = m[3];
    } else if (text.size() <= 1000 && std::regex_match(text, m, rtu) && speedOf(std::stoi(m[2]))) {
        a.path = m[1];
        a.baud = std::stoi(m[2]);
        a.parity = m[3] == "n" ? 'N' : m[3] == "o" ? 'O'
                                                   : 'E';
        a.stop = std::stoi(m[4]);
    } else {
        throw Failure(Trouble::address, "expected tcp:HOST:PORT, or rtu:PATH,BAUD,8n1 with a usual speed, got \"" + cut(text) + "\"");
    }
    return a;
}

Operation Operation::parse(std::string_view text) {
    const auto words = split(text);
    auto bad = [&](const std::string& what) -> Failure { return {Trouble::request, "expected " + what + ", got \"" + cut(text) + "\""}; };
    if (words.size() < 5 || (words[0] != "read" && words[0] != "write" && words[0] != "mask"))
        throw bad("read UNIT TABLE ADDRESS COUNT, write UNIT TABLE ADDRESS VALUE ..., or mask UNIT holding ADDRESS BITS VALUE");
    Operation o;
    o.text = cut(text);
    o.mask = words[0] == "mask";
    o.write = o.mask || words[0] == "write";
    if (!number(words[1], 0, 255, o.unit) || (o.unit > 247 && o.unit < 255)) throw bad("a unit from 0 to 247, or 255");
    static constexpr std::string_view kTables[] = {"coil", "discrete", "input", "holding"};
    const auto table = std::find(std::begin(kTables), std::end(kTables), words[2]);
    if (table == std::end(kTables)) throw bad("coil, discrete, input or holding");
    o.table = Table(table - kTables);
    if (o.write && (o.table == Table::discrete || o.table == Table::input)) throw bad("coil or holding: the others cannot be written");
    if (o.mask && (o.table != Table::holding || words.size() != 6)) throw bad("mask UNIT holding ADDRESS BITS VALUE");
    const bool bits = o.table == Table::coil || o.table == Table::discrete;
    const int most = bits ? (o.write ? MODBUS_MAX_WRITE_BITS : MODBUS_MAX_READ_BITS) : o.write ? MODBUS_MAX_WRITE_REGISTERS
                                                                                               : MODBUS_MAX_READ_REGISTERS;
    if (!number(words[3], 0, 65535, o.address)) throw bad("an address from 0 to 65535");
    if (o.write) {
        if (words.size() - 4 > std::size_t(most)) throw bad("at most " + std::to_string(most) + " values");
        for (std::size_t i = 4; i < words.size(); ++i) {
            int value;
            if (!number(words[i], 0, bits ? 1 : 65535, value)) throw bad(bits ? "values 0 and 1" : "values from 0 to 65535");
            o.values.push_back(std::uint16_t(value));
        }
        o.count = o.mask ? 1 : int(o.values.size());
    } else if (words.size() != 5 || !number(words[4], 1, most, o.count)) {
        throw bad("a count from 1 to " + std::to_string(most));
    }
    if (o.address + o.count > 65536) throw bad("addresses up to 65535");
    return o;
}

void Line::Free::operator()(_modbus* context) const { modbus_free(context); }

Line::~Line() { close(); }

void Line::interrupt() {
    interrupted_ = true;
    std::lock_guard lock(mutex_);
    if (shown_ >= 0) shutdown(shown_, SHUT_RDWR);       // wakes the thread that waits there
}

void Line::adopt(int fd) {
    std::lock_guard lock(mutex_);
    shown_ = fd;
}

void Line::checkInterrupt() const {
    if (interrupted_) throw Failure(Trouble::cancelled, "given up");
}

void Line::close() {
    adopt(-1);
    open_ = false;
    if (context_) {
        modbus_close(context_.get());
        context_.reset();
    }
    if (locked_ >= 0) ::close(std::exchange(locked_, -1));
}

void Line::open(double patience) {
    if (open_ && fresh()) return;
    close();
    if (address_.isSerial()) openSerial();
    else connect(Clock::now() + spanOf(patience));
    modbus_set_error_recovery(context_.get(), MODBUS_ERROR_RECOVERY_NONE);
    // Without a time for each byte, that for the answer holds until its last byte.
    modbus_set_byte_timeout(context_.get(), 0, 0);
    open_ = true;
}

// libmodbus would look up IPv4 alone, and could not be interrupted.
void Line::connect(Time until) {
    addrinfo hints{}, *found = nullptr;
    hints.ai_socktype = SOCK_STREAM;
    if (int error = getaddrinfo(address_.host.c_str(), address_.port.c_str(), &hints, &found); error != 0)
        throw Failure(Trouble::unreachable, address_.text + " cannot be reached: " + gai_strerror(error));
    std::unique_ptr<addrinfo, decltype(&freeaddrinfo)> list(found, &freeaddrinfo);
    std::string why;
    for (auto* a = list.get(); a; a = a->ai_next) {
        const int fd = socket(a->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
        if (fd < 0) {
            why = std::strerror(errno);
            continue;
        }
        adopt(fd);
        if (!join(fd, a->ai_addr, a->ai_addrlen, until, why)) {
            adopt(-1);
            ::close(fd);
            checkInterrupt();
            continue;
        }
        context_.reset(modbus_new_tcp("127.0.0.1", MODBUS_TCP_DEFAULT_PORT));
        if (!context_) {
            adopt(-1);
            ::close(fd);
            throw std::bad_alloc();
        }
        modbus_set_socket(context_.get(), fd);
        return;
    }
    throw Failure(Trouble::unreachable, address_.text + " cannot be reached: " + why + "; is the device switched on?");
}

bool Line::join(int fd, const void* address, unsigned length, Time until, std::string& why) {
    if (fd >= FD_SETSIZE) {
        why = tooManyFiles();
        return false;
    }
    const int on = 1;
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    if (::connect(fd, static_cast<const sockaddr*>(address), length) == 0) return true;
    int error = errno;
    if (error == EINPROGRESS) {
        pollfd ready{fd, POLLOUT, 0};
        int n = 0;
        while (!interrupted_ && (n = poll(&ready, 1, std::min(kSlice, milliseconds(until)))) <= 0 && milliseconds(until) > 0) {
        }
        socklen_t size = sizeof error;
        if (n <= 0) error = ETIMEDOUT;
        else getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &size);
    }
    why = error == ETIMEDOUT ? "nobody answers in time" : std::strerror(error);
    return error == 0 && !interrupted_;
}

// The driver of a line may take other settings than it was told. Then answers would be garbage now and then, so they are read again.
void Line::openSerial() {
    auto bad = [&](const std::string& why) -> Failure {
        const std::string text = address_.text + " cannot be opened: " + why;
        close();
        return {Trouble::unreachable, text};
    };
    locked_ = ::open(address_.path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (locked_ < 0) throw bad(std::strerror(errno) + std::string(errno == ENOENT || errno == ENXIO ? "; is it plugged in?" : ""));
    if (!isatty(locked_)) throw bad("it is no serial line");
    if (flock(locked_, LOCK_EX | LOCK_NB) != 0) throw bad("another object or program has it");
    context_.reset(modbus_new_rtu(address_.path.c_str(), address_.baud, address_.parity, 8, address_.stop));
    if (!context_) throw std::bad_alloc();
    if (modbus_connect(context_.get()) != 0) throw bad(modbus_strerror(errno));
    const int fd = modbus_get_socket(context_.get());
    if (fd >= FD_SETSIZE) throw bad(tooManyFiles());
    termios has{};
    const bool same = tcgetattr(fd, &has) == 0 && cfgetospeed(&has) == speedOf(address_.baud)->code &&
                      bool(has.c_cflag & PARENB) == (address_.parity != 'N') && bool(has.c_cflag & PARODD) == (address_.parity == 'O') &&
                      (has.c_cflag & CSIZE) == CS8 && bool(has.c_cflag & CSTOPB) == (address_.stop == 2);
    if (!same) throw bad("the line does not take these settings");
    fcntl(fd, F_SETFD, FD_CLOEXEC);
}

// Between two messages are 3.5 characters of 11 bits at least, and 1.75 ms: Modbus over Serial Line, 2.5.1.1.
void Line::settle(const Operation& o) {
    std::this_thread::sleep_for(spanOf(std::max(0.00175, 38.5 / address_.baud)));
    pollfd line{modbus_get_socket(context_.get()), POLLIN, 0};
    for (const auto end = Clock::now() + kLongest; o.unit == lateUnit_ && milliseconds(lateUntil_) > 0 && Clock::now() < end;) {
        checkInterrupt();
        if (poll(&line, 1, std::min(kSlice, milliseconds(lateUntil_))) <= 0) continue;
        if (line.revents & (POLLHUP | POLLERR)) break;          // the request says so
        tcflush(line.fd, TCIFLUSH);
        lateUntil_ = Clock::now() + silence_;
    }
    if (o.unit == lateUnit_) lateUnit_ = -1;
    tcflush(line.fd, TCIFLUSH);
}

bool Line::fresh() {
    if (address_.isSerial()) {
        pollfd line{modbus_get_socket(context_.get()), 0, 0};
        return poll(&line, 1, 0) == 0;      // else it was unplugged
    }
    char bytes[4096];
    for (;;) {
        const auto n = recv(modbus_get_socket(context_.get()), bytes, sizeof bytes, MSG_DONTWAIT);
        if (n < 0) return errno == EAGAIN || errno == EWOULDBLOCK;
        if (n == 0 || n == sizeof bytes) return false;          // a device that says so much is none
    }
}

std::vector<std::uint16_t> Line::run(const std::vector<Operation>& operations, double patience) {
    std::vector<std::uint16_t> read;
    for (auto& o : operations) {
        checkInterrupt();
        open(patience);
        const auto whole = std::uint32_t(patience);
        modbus_set_response_timeout(context_.get(), whole, std::uint32_t(std::clamp((patience - whole) * 1e6, whole ? 0.0 : 1.0, 999'999.0)));
        if ((address_.isSerial() && (o.unit == 0 || o.unit > 247)) || modbus_set_slave(context_.get(), o.unit) < 0)
            throw Failure(Trouble::request, "a serial line has units 1 to 247, got \"" + o.text + "\"");
        if (address_.isSerial()) settle(o);
        errno = 0;
        try {
            perform(o, read);
        } catch (int error) {
            fail(o, error, patience);
        }
    }
    return read;
}

// A device without this function has its register read and written: nobody else has the line between the two. Its own program may lose a change then.
int Line::mask(const Operation& o) {
    _modbus* c = context_.get();
    const std::uint16_t bits = o.values[0], value = o.values[1] & bits;
    if (modbus_mask_write_register(c, o.address, std::uint16_t(~bits), value) == 1) return 1;
    if (errno != EMBXILFUN) return -1;
    if (address_.isSerial()) settle(o);
    std::uint16_t now;
    if (modbus_read_registers(c, o.address, 1, &now) != 1) return -1;
    if (address_.isSerial()) settle(o);
    return modbus_write_register(c, o.address, std::uint16_t((now & ~bits) | value));
}

// Throws an error number of libmodbus.
void Line::perform(const Operation& o, std::vector<std::uint16_t>& read) {
    _modbus* c = context_.get();
    int done;
    if (o.table == Table::holding || o.table == Table::input) {
        std::uint16_t values[MODBUS_MAX_READ_REGISTERS];
        if (!o.write) done = (o.table == Table::input ? modbus_read_input_registers : modbus_read_registers)(c, o.address, o.count, values);
        else if (o.mask) done = mask(o);
        else if (o.count == 1) done = modbus_write_register(c, o.address, o.values[0]);
        else done = modbus_write_registers(c, o.address, o.count, o.values.data());
        if (done == o.count && !o.write) read.insert(read.end(), values, values + o.count);
    } else {
        std::uint8_t bits[MODBUS_MAX_READ_BITS];
        if (o.write) std::copy(o.values.begin(), o.values.end(), bits);
        if (!o.write) done = (o.table == Table::discrete ? modbus_read_input_bits : modbus_read_bits)(c, o.address, o.count, bits);
        else if (o.count == 1) done = modbus_write_bit(c, o.address, bits[0]);
        else done = modbus_write_bits(c, o.address, o.count, bits);
        if (done == o.count && !o.write) read.insert(read.end(), bits, bits + o.count);
    }
    if (done != o.count) throw done < 0 && errno != 0 ? errno : EMBBADDATA;
}

void Line::fail(const Operation& o, int error, double patience) {
    const std::string to = " to \"" + o.text + "\"";
    if (error > MODBUS_ENOBASE && error < MODBUS_ENOBASE + MODBUS_EXCEPTION_MAX) {
        const int n = error - MODBUS_ENOBASE;
        throw Failure(Trouble::device, "the device says " + std::to_string(n) + ", " + meaning(n) + "," + to, n);
    }
    // The rest of this answer may still come, as long as an answer may take.
    lateUnit_ = o.unit;
    silence_ = spanOf(patience);
    lateUntil_ = Clock::now() + silence_;
    close();
    checkInterrupt();
    switch (error) {
        case ETIMEDOUT:
            throw Failure(Trouble::silent, "no whole answer" + to + " within " + seconds(patience) + (o.write ? "; the device may have done it" : ""));
        case EMBBADCRC: throw Failure(Trouble::answer, "an answer" + to + " with a wrong check sum");
        case EMBBADSLAVE: throw Failure(Trouble::answer, "another unit has answered" + to);
        case EMBBADEXC:
        case EMBUNKEXC: throw Failure(Trouble::answer, "an exception" + to + " that Modbus does not know");
        case EMBBADDATA:
        case EMBMDATA: throw Failure(Trouble::answer, "an answer that does not fit" + to + ": of another request, or another length");
        default:
            throw Failure(Trouble::lost, "the line to " + address_.text + " broke in \"" + o.text + "\": " + modbus_strerror(error) +
                                             (o.write ? "; the device may have done it" : ""));
    }
}

}  // namespace modbus
