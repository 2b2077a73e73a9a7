// transports.h -- what the cases of the client and those of the daemon share: see transports.cpp.
#pragma once

#include <poll.h>
#include <sys/epoll.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <functional>
#include <map>
#include <stdexcept>
#include <string>

#include "comm/comm.h"
#include "comm/transport.h"
#include "comm/wire.h"

namespace transports {

using namespace sorma;

constexpr std::size_t kLimit = 1 << 20;                 // [bytes] of a message, in all cases

inline void check(bool good, const std::string& what) {
    if (!good) throw std::runtime_error(what);
}

inline void expect(const std::string& said, const std::string& wanted) { check(said.find(wanted) != std::string::npos, "\"" + said + "\", not " + wanted); }

// A row: how to listen. `rows` in transports.cpp has one line for each. own: a daemon cannot inherit such a socket, and opens it itself.
struct Row {
    const Transport& transport;
    std::function<ListeningSocket()> listen;
    bool own = false;
};
extern const Transport sealedTransport;
using Cases = std::map<std::string, void (*)(const Row&)>;
extern const Cases clientCases;

inline Address addressOf(const ListeningSocket& socket) {
    return Address::parse(socket.port > 0 ? "127.0.0.1:" + std::to_string(socket.port) : socket.path);
}

// One end of a line, which waits for what it wants.
class End {
public:
    explicit End(Line line) : line(std::move(line)) {}
    bool wait(std::uint32_t events) { return line.wait(events, 60'000) != 0; }
    bool upgraded(Transport::Stage stage) { return !line.row().upgrade || line.row().upgrade(line, stage, "test"); }
    // False: the other end has closed.
    bool upgrade(Transport::Stage stage) {
        try {
            while (!upgraded(stage)) check(wait(EPOLLIN), "it does not upgrade");
            return true;
        } catch (const Error&) {
            return false;
        }
    }
    // False: the other end has closed.
    bool more() {
        check(wait(EPOLLIN), "nothing comes");
        char room[65536];
        ssize_t n = line.read(room, sizeof room);
        if (n > 0) in.append(room, std::size_t(n));
        return n > 0 || (n < 0 && errno == EAGAIN);
    }
    // The next record; empty: the other end has closed.
    std::string record() {
        for (;;) {
            record::Reader records(in, kLimit);
            if (std::string_view found; records.next(found)) {
                std::string record(found);
                in.drop(std::size_t(records.at() - in.data()));
                return record;
            }
            check(!records.wrong(), "what comes is no record");
            if (!more()) return {};
        }
    }
    // False: the other end has closed.
    bool say(const Buffer& bytes, std::size_t size = SIZE_MAX) {
        size = std::min(size, bytes.size());
        for (std::size_t at = 0; at < size;) {
            ssize_t n = line.write(bytes.data() + at, size - at);
            if (n < 0 && errno != EAGAIN) return false;
            if (n < 0) check(wait(EPOLLOUT), "it takes nothing");
            else at += std::size_t(n);
        }
        return true;
    }
    wire::CallHeader call() {                           // the header of the next call; it has procedure 99 when there is none
        last = record();
        XdrReader r(last);
        auto envelope = wire::readEnvelope(r);
        auto header = wire::readCallHeader(r, envelope.xid);
        if (!r.good()) header.procedure = 99;
        return header;
    }
    Line line;
    Buffer in;
    std::string last;
};

}  // namespace transports
