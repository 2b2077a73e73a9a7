// The transport shm: memory that two processes of one user on one host share, agreed on by a Unix-domain socket.
//
// The client makes the memory: a ring each way (ring.h), in a sealed memfd. The first bytes that it sends are an offer, with the
// descriptor. A daemon answers with one byte, yes or no. An offer can be no record, so daemons that know none close the line.
//
// The socket stays. A byte on it is a bell for an end that sleeps; its end is the end of the line.

#include <fcntl.h>
#include <sys/epoll.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstring>
#include <optional>
#include <system_error>

#include "bus/deadline.h"
#include "comm/errors.h"
#include "comm/lookout.h"
#include "comm/ring.h"
#include "comm/spinner.h"
#include "comm/transport.h"

namespace sorma {

namespace {

// As a mark it says a piece of 1.4 GB, not the last one.
constexpr char kOffer[] = {'S', 'h', 'm', '1'};
constexpr char kYes = 'Y', kNo = 'N', kBell = '!';      // the first byte of a record is another one
constexpr std::size_t kBells = 4096;                    // [bytes] that are taken at a time

struct Rings {
    RingMemory toDaemon, toClient;
};

constexpr std::int64_t kForever = INT64_MAX / 2;        // [ns]

constexpr int kSeals = F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL;       // so nobody can take pages away from under the other one

struct Shared : Line::Extra {
    Shared(Rings* at, bool client)
        : rings(at), in(client ? at->toClient : at->toDaemon), out(client ? at->toDaemon : at->toClient) {}
    ~Shared() override { in.leave(); }

    struct Unmap {
        void operator()(Rings* at) const { munmap(at, sizeof *at); }
    };
    const std::unique_ptr<Rings, Unmap> rings;          // the first: whatever looks into it has ended then
    RingReader in;
    RingWriter out;
    bool ended = false;                 // the other end has closed the socket
    Spinner spinner;                    // a client's, where it waits in read() for an answer
    Spinner within, room;               // for the rest of what is long, and for room for it: the other end is at work
    bool isLong = false;                // what came last was a whole piece
    std::optional<Dozer> dozer;
};

Shared& sharedOf(const Line& line) { return static_cast<Shared&>(*line.extra); }

Rings* map(int fd) {
    void* at = mmap(nullptr, sizeof(Rings), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    return at == MAP_FAILED ? nullptr : static_cast<Rings*>(at);
}

Descriptor makeMemory() {
    Descriptor fd(memfd_create("sorma", MFD_CLOEXEC | MFD_ALLOW_SEALING));
    if (fd && (ftruncate(fd.get(), sizeof(Rings)) < 0 || fcntl(fd.get(), F_ADD_SEALS, kSeals) < 0)) fd.close();
    return fd;
}

// False: nobody is there to hear it.
bool ring(Line& line) { return send(line.descriptor(), &kBell, 1, MSG_NOSIGNAL | MSG_DONTWAIT) == 1 || errno == EAGAIN; }      // full: there are bells enough

// Take the bells. wait [ns]: block for one.
void hear(Line& line, std::int64_t wait = 0) {
    char bells[kBells];
    const ssize_t n = readSocket(line, bells, sizeof bells, wait);
    if (n == 0 || (n < 0 && errno != EAGAIN)) sharedOf(line).ended = true;
}

// Wait for a bell, where there can be no lookout.
void sleep(Line& line, std::int64_t most) {
    Shared& s = sharedOf(line);
    if (s.in.sleeps()) hear(line, most);
    s.in.awake();
}

// Wait until something comes, for so many nanoseconds at most.
void wait(Line& line, std::int64_t most) {
    Shared& s = sharedOf(line);
    if ((s.isLong ? s.within : s.spinner).wait([&] { return s.in.look() != 0; }, most)) return;
    s.out.rest();
    try {
        if (!s.dozer) s.dozer.emplace(line.descriptor(), s.in.mark());
    } catch (const std::system_error&) {
        return sleep(line, most);
    }
    s.dozer->begin(most < kForever ? monotonicNow() + most : kForever);
    s.in.doze([&] { return s.dozer->called(); });
    s.dozer->end();
}

// ---- the offer ----

void sendOffer(int socket, int memory) {
    iovec bytes{const_cast<char*>(kOffer), sizeof kOffer};
    alignas(cmsghdr) char room[CMSG_SPACE(sizeof memory)] = {};
    msghdr message{};
    message.msg_iov = &bytes;
    message.msg_iovlen = 1;
    message.msg_control = room;
    message.msg_controllen = sizeof room;
    cmsghdr* head = CMSG_FIRSTHDR(&message);
    *head = {CMSG_LEN(sizeof memory), SOL_SOCKET, SCM_RIGHTS};
    std::memcpy(CMSG_DATA(head), &memory, sizeof memory);
    (void)sendmsg(socket, &message, MSG_NOSIGNAL);      // when it fails the line has ended: what is read next says so
}

// The memory that was offered, if it is as it has to be.
Descriptor takeOffer(int socket) {
    char said[sizeof kOffer];
    iovec bytes{said, sizeof said};
    alignas(cmsghdr) char room[CMSG_SPACE(sizeof(int))] = {};
    msghdr message{};
    message.msg_iov = &bytes;
    message.msg_iovlen = 1;
    message.msg_control = room;
    message.msg_controllen = sizeof room;
    if (recvmsg(socket, &message, MSG_DONTWAIT | MSG_CMSG_CLOEXEC) < 0) return Descriptor();
    int fd = -1;
    for (cmsghdr* head = CMSG_FIRSTHDR(&message); head; head = CMSG_NXTHDR(&message, head))
        if (head->cmsg_level == SOL_SOCKET && head->cmsg_type == SCM_RIGHTS && head->cmsg_len >= CMSG_LEN(sizeof fd))
            std::memcpy(&fd, CMSG_DATA(head), sizeof fd);
    Descriptor memory(fd);
    struct stat found;
    const bool good = memory && (fcntl(fd, F_GET_SEALS) & kSeals) == kSeals && fstat(fd, &found) == 0 && found.st_size == sizeof(Rings);
    if (!good) memory.close();
    return memory;
}

// The daemon's end of a Unix-domain socket, before its first byte: is it an offer?
bool answerOffer(Line& line, Transport::Stage, const std::string&) {
    char first[sizeof kOffer];
    const ssize_t n = peekSocket(line, first, sizeof first);
    if (n < 0 && errno == EAGAIN) return false;
    if (n <= 0 || std::memcmp(first, kOffer, std::size_t(n)) != 0) {
        line = Line(std::move(line), unixTransport);
        return true;
    }
    if (n < ssize_t(sizeof kOffer)) return false;
    Descriptor memory = takeOffer(line.descriptor());
    Rings* rings = memory && !unixTransport.identify(line).principal ? map(memory.get()) : nullptr;     // of this user alone
    const char answer = rings ? kYes : kNo;
    (void)send(line.descriptor(), &answer, 1, MSG_NOSIGNAL | MSG_DONTWAIT);
    line = Line(std::move(line), rings ? memoryTransport : unixTransport);
    if (rings) line.extra = std::make_unique<Shared>(rings, false);
    return true;
}

// Offer, and hear the answer. A daemon that says something else speaks to us in clear.
bool offer(Line& line, Transport::Stage stage, const std::string& who) {
    if (stage != Transport::Stage::connected) return true;
    if (!line.extra) {
        const Descriptor memory = makeMemory();
        Rings* rings = memory ? map(memory.get()) : nullptr;
        if (!rings) fail(errors::kRefused, who, "shared memory", std::strerror(errno), "choose sorma::configure -transport unix");
        line.extra = std::make_unique<Shared>(rings, true);
        sendOffer(line.descriptor(), memory.get());
    }
    char answer;
    const ssize_t n = peekSocket(line, &answer, 1);
    if (n < 0 && errno == EAGAIN) return false;
    if (n == 1 && (answer == kYes || answer == kNo)) (void)recv(line.descriptor(), &answer, 1, 0);
    const bool agreed = n == 1 && answer == kYes;
    if (!agreed) line.extra.reset();
    line = Line(std::move(line), agreed ? memoryTransport : unixTransport);
    return true;
}

// ---- bytes ----

ssize_t read(Line& line, char* room, std::size_t size, std::int64_t most) {
    Shared& s = sharedOf(line);
    for (bool waited = false;; waited = true) {
        const std::ptrdiff_t n = s.in.take(room, size);
        if (n > 0 && s.in.wakes()) ring(line);
        if (n > 0) return s.isLong = std::size_t(n) == RingMemory::kPiece, n;
        if (n < 0) return errno = EPROTO, -1;
        if (s.ended) return 0;
        if (waited) return errno = EAGAIN, -1;
        if (most > 0) wait(line, most);
        if (most == 0 || s.in.look() == 0) hear(line);
    }
}

ssize_t write(Line& line, const char* data, std::size_t size) {
    Shared& s = sharedOf(line);
    if (s.ended) return errno = EPIPE, -1;
    std::size_t done = 0;
    for (std::ptrdiff_t n = 1; n > 0 && done < size; done += std::size_t(n)) {
        n = s.out.put(data + done, size - done);
        if (n == 0 && s.room.wait([&] { return s.out.room(); })) n = s.out.put(data + done, size - done);
        if (n == 0 && done == 0 && !s.out.waits()) n = s.out.put(data, size);
        if (n < 0) return errno = EPROTO, -1;
        if (n > 0 && s.out.wakes() && !ring(line)) {
            s.ended = true;
            done += std::size_t(n);
            done -= std::min(s.out.left(), done);       // of these bytes nobody will take any more
            return done > 0 ? ssize_t(done) : (errno = EPIPE, -1);
        }
    }
    if (done > 0 || size == 0) return ssize_t(done);
    hear(line);                         // perhaps nobody reads now. wants() and brought() look again
    return errno = s.ended ? EPIPE : EAGAIN, -1;
}

ssize_t peek(Line& line, char* room, std::size_t size) {
    const std::ptrdiff_t n = sharedOf(line).in.take(room, size, true);
    return n > 0 ? n : (errno = n < 0 ? EPROTO : EAGAIN, -1);
}

bool brought(const Line& line, bool sleep) {
    Shared& s = sharedOf(line);
    return sleep ? !s.in.sleeps() : s.in.look() != 0;
}

void rest(const Line& line) { sharedOf(line).out.rest(); }

// There is no room: a bell says when there is. The last one may have been taken for another reason.
std::uint32_t wants(const Line& line, std::uint32_t events) {
    if ((events & EPOLLOUT) && sharedOf(line).out.full() && sharedOf(line).out.waits()) events = (events & ~std::uint32_t{EPOLLOUT}) | EPOLLIN;
    return events;
}

Line begin(const Address& address, const std::string& who) { return {unixTransport.begin(address, who), offeringTransport}; }

Transport makeOffering() {
    Transport row = unixTransport;
    row.begin = begin;
    row.upgrade = offer;
    return row;
}

Transport makeOffered() {
    Transport row = unixTransport;
    row.upgrade = answerOffer;
    row.inClear = true;
    return row;
}

Transport makeRow() {
    Transport row = unixTransport;
    row.name = "shm";
    row.read = read;
    row.write = write;
    row.peek = peek;
    row.wants = wants;
    row.brought = brought;
    row.rest = rest;
    return row;
}

}  // namespace

const Transport memoryTransport = makeRow(), offeringTransport = makeOffering(), offeredTransport = makeOffered();

}  // namespace sorma
