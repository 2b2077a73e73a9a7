// sealed.cpp -- a transport for transports.cpp, which needs every function of comm/transport.h: sockets PATH.sealed of the Unix domain.
//
// The bytes travel in frames: kind, size in two bytes, and so many bytes, each changed by the key.
//
//     key     a share of the next key; it is the exclusive or of both ends' shares. Exchanged in upgrade(), twice
//     data    what the other end has written
//     room    the other end has read so many bytes; until that comes, at most kRoom bytes are on their way
//
// So it reads ahead (pending), has to read before it can write, and to write while it reads (wants).
#include <algorithm>
#include <random>

#include "comm/errors.h"
#include "transports.h"

namespace transports {

namespace {

constexpr std::size_t kRoom = 5000, kMost = 700, kHead = 3;     // [bytes] on their way; of a frame; before it
constexpr int kVain = 1000;             // attempts to write without room, at most: a caller that asks wants() does not turn in circles
enum Kind : char { key = 'k', data = 'd', room = 'r' };

struct Seal : Line::Extra {
    bool client;
    unsigned char now = 0;              // the key
    std::optional<unsigned char> ours, theirs;      // shares of the next one
    std::string in, plain, out;         // frames that came; what is in them, and was not read; frames that the socket has not taken
    std::size_t room = kRoom;           // [bytes] that we may write
    std::size_t taken = 0;              // [bytes] that were read, and the other end has not been told
    std::size_t begun = 0;              // [bytes] of the caller's that are in out
    int vain = 0;                       // attempts to write since something has come
    bool ended = false;
    explicit Seal(bool client) : client(client) {}

    void put(Kind kind, std::string_view bytes) {
        out += {kind, char(bytes.size() >> 8), char(bytes.size())};
        for (char c : bytes) out += char(c ^ now);
    }
    void take(Kind kind, std::string bytes) {
        for (char& c : bytes) c = char(c ^ now);
        if (kind == Kind::key) theirs = bytes.at(0);
        else if (kind == Kind::room) room += std::stoul(bytes);
        else plain += bytes;
    }
    // Write what waits. False: the line is broken.
    bool push(Line& line) {
        while (!out.empty()) {
            const ssize_t n = writeSocket(line, out.data(), out.size());
            if (n < 0) return errno == EAGAIN;
            out.erase(0, std::size_t(n));
        }
        return true;
    }
    // Read what has come; for a client perhaps wait for it.
    void pull(Line& line, std::int64_t wait) {
        char bytes[2000];
        const ssize_t n = readSocket(line, bytes, sizeof bytes, wait);
        ended = ended || n == 0 || (n < 0 && errno != EAGAIN);
        if (n > 0) in.append(bytes, std::size_t(n)), vain = 0;
        auto sizeOf = [this] { return std::size_t((unsigned char)in[1] << 8 | (unsigned char)in[2]); };
        while (in.size() >= kHead && in.size() >= kHead + sizeOf()) {
            const std::size_t size = sizeOf();
            take(Kind(in[0]), in.substr(kHead, size));
            in.erase(0, kHead + size);
        }
    }
};

Seal& sealOf(const Line& line) { return static_cast<Seal&>(*line.extra); }

Line seal(Line under, bool client) {
    if (!under.open()) return {};
    Line line(std::move(under), sealedTransport);
    line.extra = std::make_unique<Seal>(client);
    return line;
}

bool mine(const Address& address) { return pathOf(address).ends_with(".sealed"); }
Line begin(const Address& address, const std::string& who) { return seal(unixTransport.begin(address, who), true); }
Line accept(int fd) { return seal(unixTransport.accept(fd), false); }

ListeningSocket listen(const std::string& path, int number, bool share) {
    ListeningSocket socket = unixTransport.listen(path, number, share);
    socket.row = &sealedTransport;
    return socket;
}

bool upgrade(Line& line, Transport::Stage, const std::string& who) {
    Seal& s = sealOf(line);
    if (!s.theirs) s.pull(line, 0);
    if (!s.ours && (s.client || s.theirs)) {
        s.ours = static_cast<unsigned char>(std::random_device()());
        s.put(Kind::key, {reinterpret_cast<char*>(&*s.ours), 1});
    }
    if (!s.push(line) || s.ended) fail(errors::kRefused, who, "a sealed socket", "it was closed", "is it ending?");
    if (!s.ours || !s.theirs || !s.out.empty()) return false;
    s.now = *s.ours ^ *s.theirs;
    s.ours.reset(), s.theirs.reset();
    return true;
}

ssize_t read(Line& line, char* to, std::size_t size, std::int64_t wait) {
    Seal& s = sealOf(line);
    if (!s.push(line)) return -1;
    if (s.plain.empty()) s.pull(line, wait);
    if (s.plain.empty()) return s.ended ? 0 : (errno = EAGAIN, -1);
    size = s.plain.copy(to, size);
    s.plain.erase(0, size);
    s.taken += size;
    if (s.taken > kRoom / 2) s.put(Kind::room, std::to_string(std::exchange(s.taken, 0)));
    s.push(line);
    return ssize_t(size);
}

ssize_t write(Line& line, const char* from, std::size_t size) {
    Seal& s = sealOf(line);
    std::size_t written = 0;
    while (written < size) {
        if (s.begun == 0) {
            if (s.room == 0) s.pull(line, 0);
            if (s.room == 0 && ++s.vain > kVain) return errno = EPROTO, -1;
            if (s.room == 0) break;
            s.begun = std::min({size - written, s.room, kMost});
            s.room -= s.begun;
            s.put(Kind::data, {from + written, s.begun});
        }
        if (!s.push(line)) return -1;
        if (!s.out.empty()) break;
        written += std::exchange(s.begun, 0);
    }
    return written > 0 || size == 0 ? ssize_t(written) : (errno = s.ended ? EPIPE : EAGAIN, -1);
}

bool pending(const Line& line) { return !sealOf(line).plain.empty(); }

std::uint32_t wants(const Line& line, std::uint32_t events) {
    const Seal& s = sealOf(line);
    if ((events & EPOLLOUT) && s.room == 0 && s.begun == 0) events = (events & ~std::uint32_t{EPOLLOUT}) | EPOLLIN;
    return s.out.empty() ? events : events | EPOLLOUT;
}

Transport make() {
    Transport row = unixTransport;
    row.name = "sealed";
    row.mine = mine;
    row.begin = begin;
    row.read = read;
    row.write = write;
    row.peek = nullptr;
    row.listen = listen;
    row.accept = accept;
    row.upgrade = upgrade;
    row.pending = pending;
    row.wants = wants;
    return row;
}

}  // namespace

const Transport sealedTransport = make();

}  // namespace transports
