// transport.h -- how the bytes of a connection travel: a table of functions, one row a transport.
//
//     tcp         a port of a host, or a program that its rpcbind knows             tcp.cpp
//     unix        a socket in the file system                                       unix.cpp
//     inherited   a socket that another program has opened for us                   inherited.cpp
//     shm         memory that both ends share, agreed on by a socket of unix        shm.cpp
//     tls         a connection of tcp, encrypted                                    tls.cpp
//
// Other code asks the row of its line. A few places name a row:
//
//     server.cpp      takes over sockets that are inherited
//     peer.h          `-tls only` refuses what is still tcp
//     link.cpp        has the daemon taken the memory that was offered? Then the row is shm
//     tls.cpp         a line of tls begins as one of tcp
//     directory.cpp   an entry of the directory may be a path, or a host and a port
//     services/metrics/http.cpp, generic/tcl/processCommands.cpp: who is at the other end of a socket of TCP that is no line
//
// CONTRIBUTING.md lists what a new transport needs. The example tests/embed/sealed.cpp has all functions but brought, rest, explain and
// inClear: shm.cpp and tls.cpp have these.
//
// Callers:   "client" is Link, "server" is Server and its peers. Each function is called with a line by the thread to which
//            the line belongs; where a comment says "any thread", also by others. Two functions are never inside the same
//            line at a time.
// Blocking:  no function blocks, except where its comment says how long.
// Errors:    functions that return a Line or a ListeningSocket throw Error and leave nothing open. read and write return as recv(2)
//            and send(2), with errno, which is never EINTR; they never raise SIGPIPE.
#pragma once

#include <cerrno>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <sys/types.h>
#include <utility>

#include "bus/call.h"
#include "bus/descriptor.h"
#include "bus/name.h"
#include "bus/principal.h"

namespace sorma {

inline constexpr std::size_t kReadSize = 64 * 1024;     // [bytes] that are read from a line at a time

struct Transport;
extern const Transport noTransport;     // the row of a line that is closed: nothing is pending there, and nothing can be peeked

// One end of a connection. Owns its descriptor, which is close-on-exec and, if possible, above 1023.
class Line {
public:
    // State of the row for its line. It is deleted with the line.
    struct Extra {
        virtual ~Extra() = default;
    };

    Line() = default;
    Line(Descriptor fd, const Transport& row, std::unique_ptr<Extra> extra = nullptr) : extra(std::move(extra)), fd_(std::move(fd)), row_(&row) {}
    Line(Line&& o) noexcept { swap(o); }
    Line(Line&& under, const Transport& row) noexcept { swap(under), row_ = &row; }       // for a row that uses another one
    Line& operator=(Line&& o) noexcept {
        Line gone(std::move(*this));
        swap(o);
        return *this;
    }

    bool open() const { return bool(fd_); }
    int descriptor() const { return fd_.get(); }        // -1: not open
    const Transport& row() const { return *row_; }
    // As the functions of the row. The line must be open.
    ssize_t read(char* room, std::size_t size, std::int64_t wait = 0);
    ssize_t write(const char* data, std::size_t size);
    ssize_t peek(char* room, std::size_t size);
    // Write until nothing is left, or the kernel takes nothing further. False: it is broken, errno says why.
    bool writeMost(const char*& data, std::size_t& left);
    bool pending() const;
    std::uint32_t wants(std::uint32_t events) const;
    // Says what may be done (EPOLLIN, EPOLLOUT ...) when the descriptor has these events; 0: bytes were pending.
    std::uint32_t means(std::uint32_t events) const;
    bool brought(bool sleep) const;
    void rest() const;
    void explain(const std::string& who) const;
    // Block until something of events (EPOLLIN, EPOLLOUT) may be done, for so many milliseconds at most. Returns what may be.
    std::uint32_t wait(std::uint32_t events, int milliseconds) const;

    std::unique_ptr<Extra> extra;
    std::int64_t patience = 0;                          // [ns] for the row: how long its socket blocks in read; 0: not set

private:
    void swap(Line& o) noexcept {
        std::swap(extra, o.extra);
        std::swap(patience, o.patience);
        std::swap(fd_, o.fd_);
        std::swap(row_, o.row_);
    }
    Descriptor fd_;
    const Transport* row_ = &noTransport;
};

// A listening socket, which does not block.
struct ListeningSocket {
    Descriptor fd;
    const Transport* row = nullptr;     // of the connections that come
    std::string path;                   // Unix-domain: where it is; "@name" in the abstract namespace
    int port = 0;                       // of TCP: where it is, also when the system has chosen it; 0: it is not of TCP
};

// The other end of a connection.
struct Identity {
    Caller caller;                      // for people: messages, lists, statistics
    PrincipalPointer principal;         // for the policy; null: the owner, which is this user or root by Unix socket
    bool gone = false;                  // the connection has ended, and nobody knows any more whose it was: what it sent is not read
};

struct Transport {
    std::string_view name;              // of the row
    // The kernel says which user is at the other end. So the user counts when a client comes back; otherwise its number is a
    // secret. It also means that the peer is on this host.
    bool vouched;

    // ---- addresses; any thread ----

    // Does the address lead to this row? The rows of rows() are asked in their order, and the first that says yes has it. null: for a row
    // that does not stand there.
    bool (*mine)(const Address& address);

    // Where an address leads.
    struct Found {
        enum class State { known, asks, absent } state = State::known;      // asks: lookUp has to say it
        Address target = {};            // known: a path, or a numeric host and a port. absent: perhaps where it would be
        std::string why = {};           // absent: the reason
        std::int64_t epoch = 0;         // known: of the owner of the name, as a directory tells it; 0: it does not
    };
    // Says what can be said at once. Never throws.
    Found (*place)(const Address& address);
    // The same for an address that asks. Blocks for as long as it takes: the resolver calls it in a thread of its own. Fails
    // with ADDRESS UNRESOLVED.
    Address (*lookUp)(const Address& address);
    // The address for messages: "127.0.0.1:7014", "/run/user/1000/sorma/robot.sock". Fails with COMM DENIED as runtimeFolder().
    std::string (*describe)(const Address& address);
    // Does a connection to this address come to that socket of this process?
    bool (*leadsTo)(const Address& address, const ListeningSocket& socket);

    // ---- the client; null: the row makes no connections ----

    // Begin to connect. Blocks while the name of a host is looked up. The line becomes writable when finish() can say more.
    // Fails with COMM REFUSED, ADDRESS UNRESOLVED.   who: the name that messages begin with.
    Line (*begin)(const Address& address, const std::string& who);
    // After begin, when the line was writable. True: it is connected. False: it tries the next address of the host; then the
    // descriptor is another one, and the one before is closed. Fails with COMM REFUSED; the line is then of no use.
    bool (*finish)(Line& line, const std::string& who);

    // ---- both ----

    // Read what has come, at most size bytes. Result 0: the other end has closed.   wait [ns]: block until something comes, and
    // fail with EAGAIN after about that time; 0: do not block. Only a client may wait.
    ssize_t (*read)(Line& line, char* room, std::size_t size, std::int64_t wait);
    // Write as much as the line takes. The caller keeps the rest, and begins with it when the line is writable.
    ssize_t (*write)(Line& line, const char* data, std::size_t size);
    // As read, and leave the bytes where they are. null: the row cannot; then a busy daemon answers nothing by this line. The health
    // responder's thread calls it, too.
    ssize_t (*peek)(Line& line, char* room, std::size_t size);
    // Says who is at the other end. Never fails: when the kernel does not say, the principal is anyone. null: inherited.
    Identity (*identify)(const Line& line);

    // ---- the server ----

    // Listen. at, number: tcp: interface and port (0: a free one); unix: path; inherited: the descriptor, of which the result
    // is a copy.   share: other users of this host may connect. unix blocks for 3 s at most, while another daemon starts in the
    // same folder. Fails with COMM REFUSED; the message names who has the address, where that is known.
    ListeningSocket (*listen)(const std::string& at, int number, bool share);
    // Take a connection that has come. Not open: there is none, errno says why.   fd: the listening socket; inherited: a
    // connection, of which the result is a copy, or COMM REFUSED. The line does not block.
    Line (*accept)(int fd);

    // ---- both, for a row whose bytes are not those of its socket; null: nothing to do ----

    enum class Stage {
        connected,      // before the first byte: a probe and its answer, then encryption; an offer of memory
        greeted         // after the daemon's WELCOME. The client's row speaks first
    };
    // Become what the stage promises. Called again each time the line is ready, until it is true; nothing else is read or written
    // before. Fails with COMM REFUSED, COMM PROTOCOL; the line is then of no use.   who: as for begin.
    bool (*upgrade)(Line& line, Stage stage, const std::string& who) = nullptr;
    // Would read() bring something, although the descriptor has no event? Then the caller reads before it waits.
    bool (*pending)(const Line& line) = nullptr;
    // Returns the events of the descriptor for which the caller has to wait.   events: what it wants to do: read (EPOLLIN), write (EPOLLOUT),
    // both, or nothing. The result may differ, since a row may have to write before it can read. Ask again after each read and write.
    // In a row with this function, write() may fail with EAGAIN and have begun with the bytes. Then the next write() must have the same ones.
    std::uint32_t (*wants)(const Line& line, std::uint32_t events) = nullptr;
    // For a row whose bytes come without an event of the descriptor: are some there?   sleep: the caller is about to wait for the
    // descriptor, which has to have an event when bytes come. Is asked often, and must be quick.
    bool (*brought)(const Line& line, bool sleep) = nullptr;
    // The line has been silent for a moment: give back what it keeps for traffic. Must be quick.
    void (*rest)(const Line& line) = nullptr;
    // After read or write has failed: throws the row's own error, when it knows more than errno says.   who: as for begin. null: it never does.
    void (*explain)(const Line& line, const std::string& who) = nullptr;
    // A daemon may write before the stage `connected`: clients understand it.
    bool inClear = false;
};

extern const Transport tcpTransport, unixTransport, inheritedTransport, memoryTransport;
// The ends of a Unix-domain socket before they agree: the client's that offers memory, and the daemon's. They become unix, or shm.
extern const Transport offeringTransport, offeredTransport;

// The row for an address; it must not be of this process (isHere).
const Transport& transportOf(const Address& address);
// The row that offers shared memory in place of another one, where there is such a row; else the same.
const Transport& sharing(const Transport& row);
void addTransport(const Transport& row);                // before the first address is used; it goes before the others
bool isHere(const Address& address);

std::string describe(const Address& address);           // as Transport::describe; "self" for this process
// The parts of an address, where it has them: a path; a host; a port (0: none); the number of its program at rpcbind.
std::string pathOf(const Address& address);
std::string hostOf(const Address& address);
int portOf(const Address& address);
std::uint32_t programOf(const Address& address);
Address addressOf(const std::string& path);             // of a Unix-domain socket
Address addressOf(const std::string& host, int port);

// ---- for the rows ----

[[noreturn]] void failConnect(const std::string& who, const std::string& where, int error);
[[noreturn]] void failListen(const std::string& where, const std::string& why);
[[noreturn]] void failTaken(const std::string& where, const std::string& by);
void makeBlocking(int fd, bool blocking);
Descriptor newSocket(int family);                       // a stream, close-on-exec, non-blocking; as socket(2)
int pendingError(int fd);                               // SO_ERROR
// For sockets of TCP. Bytes are sent at once. A line on which nothing comes from the other host for 60 s is broken (ETIMEDOUT), also when
// nothing is sent: so a daemon gives back what a host holds that is gone.   accepted: a daemon's. Its line breaks after the
// same time when the other host confirms nothing that was sent. A client's may wait there for longer: it has a deadline.
void tuneTcp(int fd, bool accepted);
uid_t overflowUser();                                   // as whom the kernel shows users that a namespace does not know
// For sockets of the kernel whose bytes are as they are.
ssize_t readSocket(Line& line, char* room, std::size_t size, std::int64_t wait);
ssize_t writeSocket(Line& line, const char* data, std::size_t size);
ssize_t peekSocket(Line& line, char* room, std::size_t size);

inline ssize_t Line::read(char* room, std::size_t size, std::int64_t wait) { return row_->read(*this, room, size, wait); }
inline ssize_t Line::write(const char* data, std::size_t size) { return row_->write(*this, data, size); }
inline bool Line::writeMost(const char*& data, std::size_t& left) {
    while (left > 0) {
        const ssize_t n = write(data, left);
        if (n < 0) return errno == EAGAIN;
        data += n;
        left -= static_cast<std::size_t>(n);
    }
    return true;
}
inline bool Line::brought(bool sleep) const { return row_->brought && row_->brought(*this, sleep); }
inline void Line::rest() const {
    if (row_->rest) row_->rest(*this);
}
inline void Line::explain(const std::string& who) const {
    if (row_->explain) row_->explain(*this, who);
}
inline bool Line::pending() const { return row_->pending && row_->pending(*this); }
inline std::uint32_t Line::wants(std::uint32_t events) const { return row_->wants ? row_->wants(*this, events) : events; }

}  // namespace sorma
