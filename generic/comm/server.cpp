#include "comm/server.h"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <arpa/inet.h>
#include <pwd.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "bus/requestText.h"
#include "bus/statistics.h"
#include "comm/endpoint.h"
#include "comm/errors.h"
#include "comm/random.h"

namespace sorma {

namespace {

constexpr std::size_t kReadSize = 64 * 1024;
constexpr int kBatch = 64;                              // requests of one peer in one turn
constexpr std::size_t kQueueLimit = 1 << 20;            // of replies not taken, before we stop reading a peer
constexpr std::size_t kKeepBuffer = 4096;               // a peer's own buffers may stay this large when empty
constexpr std::size_t kKeepSpare = 4 << 20;             // buffers that all peers share, kept for the next long message
constexpr std::int64_t kQuick = 20'000;                 // [ns] a call this short does not hold up replies before it
constexpr std::int64_t kSweep = 250'000'000;            // [ns]
constexpr std::size_t kOrphans = 1000;                  // sessions without a connection that are remembered
constexpr std::int64_t kOrphanAge = 600'000'000'000;    // [ns]

const Prototype kHelloFirst{Severity::error, "COMM PROTOCOL", 0, "a call with a slot needs a session: say HELLO first"};
const Prototype kSlots{Severity::error, "COMM LIMIT", 0,
    "slot {} is beyond the {} calls in flight that this daemon takes from one client; raise it there: sorma::configure -inflight N"};

std::string userName(uid_t uid) {
    passwd entry, *found = nullptr;
    char space[1024];
    if (getpwuid_r(uid, &entry, space, sizeof space, &found) == 0 && found) return found->pw_name;
    return std::to_string(uid);
}

std::uint32_t microseconds(std::int64_t nanoseconds) {
    std::int64_t us = nanoseconds / 1000;
    return us > UINT32_MAX ? UINT32_MAX : static_cast<std::uint32_t>(us);
}

}  // namespace

// Buffers of one depth of serving.
struct Server::Scratch {
    char in[kReadSize];
    Buffer out;
    Message message;
};

// One peer's turn, on the stack. When a service runs the event loop, the turns below hand what they have not served
// yet to their peers (spill), so that the inner loop can go on with them in order.
struct Server::Frame {
    Peer* peer;
    const char* at;
    const char* end;
    bool inPeer;                // at and end point into the peer's own buffer
    bool spilled = false;
    Frame* outer;
    int served = 0;             // calls executed in this turn
};

struct Server::Slot {
    enum class State : std::uint8_t { empty, running, done, tooLarge };
    std::uint32_t sequence = 0;
    State state = State::empty;
    bool asked = false;         // the client asks again while the call runs: send the reply where it is now
    std::uint32_t askedXid = 0;
    std::size_t size = 0;
    Buffer reply;               // the record as it was sent
};

struct Server::Session {
    std::uint64_t client = 0;
    std::string user;
    Peer* peer = nullptr;       // null: the connection is gone, the client may come back
    std::int64_t lastSeen = 0;
    std::vector<Slot> slots;
};

class Server::Listener : public Reactor::Watcher {
public:
    Listener(Server& server, int fd, bool tcp) : server_(server), fd_(fd), tcp_(tcp) {
        server_.reactor_.add(fd_, EPOLLIN, this);
    }
    ~Listener() override {
        server_.reactor_.remove(fd_, this);
        close(fd_);
    }
    void ready(std::uint32_t) override { server_.accept(fd_, tcp_); }
    int descriptor() const { return fd_; }

private:
    Server& server_;
    int fd_;
    bool tcp_;
};

class Server::Peer : public Reactor::Watcher {
public:
    Peer(Server& server, int fd, Caller who) : server_(server), fd_(fd), caller(std::move(who)), since(monotonicNow()) {
        server_.reactor_.add(fd_, EPOLLIN, this);
    }
    ~Peer() override { shut(); }

    void ready(std::uint32_t events) override;
    void push(const char* data, std::size_t size);      // send now, or queue what the socket does not take
    void shut() {
        if (fd_ < 0) return;
        server_.reactor_.remove(fd_, this);
        close(fd_);
        fd_ = -1;
    }
    bool open() const { return fd_ >= 0; }
    std::size_t queued() const { return out_.size() - sent_; }
    void spill(Frame& frame);

    // Why this peer has been slow for too long; empty when it has not.
    std::string tooSlow(std::int64_t now) const;
    bool slow() const { return halfSince_ != 0 || queued() > 0; }

private:
    void receive();
    void serve(Frame& frame, Scratch& scratch);
    bool oversized(Frame& frame, Scratch& scratch, std::size_t length);
    void handle(std::string_view record, Scratch& scratch, Frame& frame);
    void call(XdrReader& r, const wire::CallHeader& header, std::string_view record, Scratch& scratch, Frame& frame);
    void execute(const wire::Request& request, std::string_view record, Message& m, wire::Times& times, Scratch& scratch,
                 Frame& frame);
    void reply(std::uint32_t xid, const wire::Times& times, Message& m, Slot* slot, Scratch& scratch);
    void flush(Scratch& scratch);
    void drain();
    void interest();
    void refuse(std::uint32_t xid, Scratch& scratch, const Error& error);

    Server& server_;
    int fd_;
    Buffer in_;                         // the beginning of a request
    Buffer fragments_;                  // fragments of a record that came before its last one
    Buffer out_;                        // replies that the socket has not taken
    std::size_t sent_ = 0;              // of out_
    std::size_t skip_ = 0;              // bytes of an oversized record still to come
    std::int64_t halfSince_ = 0, stuckSince_ = 0, arrived_ = 0;
    std::uint32_t interest_ = EPOLLIN;
    std::uint32_t maxReply_ = UINT32_MAX;

public:
    Caller caller;
    Session* session = nullptr;
    std::int64_t since;
    std::uint64_t calls = 0;
};

// ---- a peer's turn ----

void Server::Peer::ready(std::uint32_t events) {
    if (events & EPOLLOUT) drain();
    if (open() && (events & (EPOLLIN | EPOLLHUP | EPOLLERR) || events == 0)) receive();
}

void Server::Peer::spill(Frame& frame) {
    if (frame.spilled) return;
    frame.spilled = true;
    std::size_t left = static_cast<std::size_t>(frame.end - frame.at);
    if (frame.inPeer) in_.drop(in_.size() - left);
    else in_.append(frame.at, left);
    if (left > 0) server_.reactor_.again(this);
}

void Server::Peer::receive() {
    if (server_.depth_ == 0) server_.retired_.clear();
    else server_.handBack();
    if (server_.scratch_.size() <= server_.depth_) server_.scratch_.push_back(std::make_unique<Scratch>());
    Scratch& scratch = *server_.scratch_[server_.depth_];

    // Requests that a turn before left here are served before more is read.
    bool inPeer = !in_.empty();
    char* room = scratch.in;
    std::size_t before = in_.size(), size = kReadSize;
    if (inPeer) {
        size = std::max(kReadSize, std::min(before, std::size_t{8} << 20));     // grows with what really came
        if (in_.capacity() < before + size && server_.spare_.capacity() >= before + size) {
            server_.spare_.clear();
            server_.spare_.append(in_.data(), before);
            std::swap(in_, server_.spare_);
        }
        room = in_.extend(size);
    }
    ssize_t n = recv(fd_, room, size, MSG_DONTWAIT);
    if (inPeer) in_.resize(before + (n > 0 ? static_cast<std::size_t>(n) : 0));
    if (n < 0 && errno != EAGAIN && errno != EINTR) return server_.retire(this, {}, false);
    bool ended = n == 0;
    if (n <= 0 && !inPeer) {
        if (ended) server_.retire(this, {}, false);
        return;
    }
    arrived_ = monotonicNow();
    server_.reactor_.seen(arrived_);
    Frame frame{this, inPeer ? in_.data() : scratch.in, nullptr, inPeer, false, server_.frames_};
    frame.end = frame.at + (inPeer ? in_.size() : static_cast<std::size_t>(n));
    server_.frames_ = &frame;
    ++server_.depth_;
    struct Leave {
        Server& server;
        Frame& frame;
        ~Leave() {
            server.frames_ = frame.outer;
            if (--server.depth_ == 0) server.retired_.clear();
        }
    } leave{server_, frame};
    serve(frame, scratch);
    if (ended && open()) server_.retire(this, {}, false);
}

void Server::Peer::serve(Frame& frame, Scratch& scratch) {
    int served = 0;
    bool more = false;
    while (open() && !frame.spilled) {
        std::size_t left = static_cast<std::size_t>(frame.end - frame.at);
        if (skip_ > 0) {
            std::size_t n = std::min(skip_, left);
            skip_ -= n;
            frame.at += n;
            left -= n;
        }
        if (left < wire::kMarkSize) break;
        XdrReader marks(frame.at, wire::kMarkSize);
        std::uint32_t mark = marks.u32();
        std::size_t length = mark & ~wire::kLastFragment;
        bool last = mark & wire::kLastFragment;
        if (length + fragments_.size() > static_cast<std::size_t>(server_.settings_.maxMessage)) {
            if (!oversized(frame, scratch, length)) break;
            continue;
        }
        if (left < wire::kMarkSize + length) break;
        if (served == kBatch || queued() > kQueueLimit) {
            more = queued() <= kQueueLimit;
            break;
        }
        std::string_view record(frame.at + wire::kMarkSize, length);
        frame.at += wire::kMarkSize + length;
        if (!last || !fragments_.empty()) {
            fragments_.append(record.data(), record.size());
            if (!last) continue;
            Buffer whole;
            std::swap(whole, fragments_);
            handle({whole.data(), whole.size()}, scratch, frame);
        } else {
            handle(record, scratch, frame);
        }
        ++served;
    }
    flush(scratch);
    if (!open() || frame.spilled) return;
    std::size_t left = static_cast<std::size_t>(frame.end - frame.at);
    if (frame.inPeer) in_.drop(in_.size() - left);
    else in_.append(frame.at, left);
    if (in_.empty() && in_.capacity() > kKeepBuffer) server_.giveBack(in_);
    if (more) server_.reactor_.again(this);
    bool half = !more && (left > 0 || skip_ > 0 || fragments_.size() > 0) && queued() <= kQueueLimit;
    if (!half) halfSince_ = 0;
    else if (halfSince_ == 0 || served > 0) halfSince_ = arrived_;
    if (slow()) server_.watchSlow(this);
    interest();
}

// A record that is too long. Its beginning says whether to refuse the call and skip it, or to end the connection.
// False: wait for more of it.
bool Server::Peer::oversized(Frame& frame, Scratch& scratch, std::size_t length) {
    constexpr std::size_t kNeeded = wire::kMarkSize + 24;           // up to the procedure
    if (static_cast<std::size_t>(frame.end - frame.at) < kNeeded) return false;
    XdrReader r(frame.at + wire::kMarkSize, kNeeded - wire::kMarkSize);
    auto envelope = wire::readEnvelope(r);
    std::uint32_t rpcVersion = r.u32();
    bool call = fragments_.empty() && r.good() && envelope.kind == 0 && rpcVersion == 2;
    if (!call) {
        flush(scratch);
        server_.retire(this, "what came is not a record of ONC RPC, or it is longer than -maxmessage " +
                                 std::to_string(server_.settings_.maxMessage) + " bytes", true);
        return false;
    }
    refuse(envelope.xid, scratch, Error(makeEntry(errors::kTooBig,
        {MessageArg::of(server_.name_), MessageArg::of("request"), MessageArg::of(length), MessageArg::of("daemon " + server_.name_),
         MessageArg::of(server_.settings_.maxMessage)})));
    frame.at += wire::kMarkSize;
    skip_ = length;
    return true;
}

void Server::Peer::handle(std::string_view record, Scratch& scratch, Frame& frame) {
    XdrReader r(record);
    auto envelope = wire::readEnvelope(r);
    if (!r.good()) return server_.retire(this, "what came is not a message of ONC RPC", true);
    if (envelope.kind != 0) return;                 // a reply: we have asked nothing
    auto header = wire::readCallHeader(r, envelope.xid);
    if (!r.good()) return wire::writeRefusal(scratch.out, envelope.xid, wire::Refusal::garbage);
    if (header.rpcVersion != 2) return wire::writeRpcMismatch(scratch.out, header.xid);
    bool ours = header.program == wire::kProgram ||
                (server_.program_ != 0 && header.program == wire::kProgramBase + server_.program_);
    if (!ours) return wire::writeRefusal(scratch.out, header.xid, wire::Refusal::programUnavailable);
    if (header.version != wire::kVersion) return wire::writeRefusal(scratch.out, header.xid, wire::Refusal::programMismatch);
    switch (header.procedure) {
        case wire::kNull: return wire::writeEmptyReply(scratch.out, header.xid);
        case wire::kCall: return call(r, header, record, scratch, frame);
        case wire::kHello: {
            wire::Hello hello;
            if (!wire::readHello(r, hello)) return wire::writeRefusal(scratch.out, header.xid, wire::Refusal::garbage);
            bool known = false;
            session = &server_.session(*this, hello, known);
            maxReply_ = hello.maxMessage > 0 ? hello.maxMessage : UINT32_MAX;
            auto& self = Caller::self();
            wire::Welcome w{server_.boot_, server_.name_, self.user, self.host, self.program, self.process, server_.started_,
                            static_cast<std::uint32_t>(server_.settings_.maxMessage),
                            static_cast<std::uint32_t>(server_.settings_.inFlight), known};
            return wire::writeWelcome(scratch.out, header.xid, w);
        }
        default: return wire::writeRefusal(scratch.out, header.xid, wire::Refusal::procedureUnavailable);
    }
}

void Server::Peer::refuse(std::uint32_t xid, Scratch& scratch, const Error& error) {
    Message m;
    m.code = -1;
    m.trail = error.trail;
    for (auto& e : m.trail.entries()) e.daemon = server_.name_;
    wire::writeReply(scratch.out, xid, {}, m);
}

void Server::Peer::call(XdrReader& r, const wire::CallHeader& header, std::string_view record, Scratch& scratch,
                        Frame& frame) {
    wire::Request request;
    Message& m = scratch.message;
    if (!wire::readRequest(r, request, m)) return wire::writeRefusal(scratch.out, header.xid, wire::Refusal::garbage);
    Slot* slot = nullptr;
    Session* mine = session;
    if (request.slot != wire::kNoSlot) {
        if (!mine) return refuse(header.xid, scratch, Error(makeEntry(kHelloFirst, {})));
        if (request.slot >= static_cast<std::uint64_t>(server_.settings_.inFlight))
            return refuse(header.xid, scratch,
                          Error(makeEntry(kSlots, {MessageArg::of(request.slot), MessageArg::of(server_.settings_.inFlight)})));
        if (mine->slots.size() <= request.slot) mine->slots.resize(request.slot + 1);
        slot = &mine->slots[request.slot];
        if (slot->state != Slot::State::empty && request.sequence == slot->sequence) {      // it asks again
            if (slot->state == Slot::State::running) {
                slot->asked = true;
                slot->askedXid = header.xid;
            } else if (slot->state == Slot::State::tooLarge) {
                refuse(header.xid, scratch, Error(makeEntry(errors::kReplyGone, {MessageArg::of(request.name),
                       MessageArg::of(slot->size), MessageArg::of("daemon " + server_.name_)})));
            } else {
                char* at = scratch.out.extend(slot->reply.size());
                std::memcpy(at, slot->reply.data(), slot->reply.size());
                XdrWriter::put(at + wire::kMarkSize, header.xid);
            }
            return;
        }
        if (slot->state == Slot::State::running || (slot->state != Slot::State::empty && request.sequence != slot->sequence + 1))
            return refuse(header.xid, scratch, Error(makeEntry(errors::kSequence, {MessageArg::of(request.name),
                          MessageArg::of(request.sequence), MessageArg::of(request.slot), MessageArg::of(slot->sequence)})));
        slot->sequence = request.sequence;
        slot->state = Slot::State::running;
        slot->asked = false;
    }
    ++calls;
    ++server_.served_;
    wire::Times times;
    std::uint64_t client = mine ? mine->client : 0;
    std::uint32_t slotNumber = request.slot;
    execute(request, record, m, times, scratch, frame);
    // A service may have run the event loop: the session may have moved to another connection, or be gone.
    if (slot) {
        auto found = server_.sessions_.find(client);
        slot = found == server_.sessions_.end() ? nullptr : &found->second->slots[slotNumber];
    }
    reply(header.xid, times, m, slot, scratch);
    if (slot && slot->asked) {
        slot->asked = false;
        Session& now = *server_.sessions_.find(client)->second;
        if (now.peer && now.peer != this && slot->state == Slot::State::done) {
            XdrWriter::put(slot->reply.data() + wire::kMarkSize, slot->askedXid);
            now.peer->push(slot->reply.data(), slot->reply.size());
        }
    }
}

void Server::Peer::execute(const wire::Request& request, std::string_view record, Message& m, wire::Times& times,
                           Scratch& scratch, Frame& frame) {
    // Of requests that came together only the first starts when they came.
    std::int64_t start = frame.served++ == 0 ? arrived_ : monotonicNow();
    std::int64_t waited = start - arrived_;
    times.waited = microseconds(waited);
    Deadline deadline;
    if (request.timeleft > 0) deadline = Deadline::at(arrived_ + std::int64_t{request.timeleft} * 1'000'000);
    Call context(caller, deadline);
    Method method = request.method;
    try {
        if (request.timeleft > 0 && start >= deadline.when()) fail(errors::kTimeoutLate, request.name);
        // Only objects of this process are served: whoever may call us may not call others in our name.
        bool elsewhere = request.name.find('@') != std::string_view::npos || (!request.name.empty() && request.name[0] >= 'A' && request.name[0] <= 'Z');
        if (elsewhere) [[unlikely]] fail(errors::kRelay, request.name);
        Service* known = server_.sorm_.find(request.name);
        // Replies to the requests before this one must not wait for it, unless it is known to be quick.
        if (!scratch.out.empty() && (!known || known->lastRun > kQuick)) flush(scratch);
        Reference service = known ? Reference(known) : server_.sorm_.get(request.name);
        service->invoke(method, m);
        std::int64_t ran = monotonicNow() - start;
        service->lastRun = ran;
        times.ran = microseconds(ran);
    } catch (...) {
        Trail trail = trailOfCurrentException({});
        // The request is shown from its bytes, since EXEC may have changed the message; they are gone when the rest
        // of the peer's buffer has been handed back meanwhile.
        std::string text;
        Message again;
        wire::Request as;
        XdrReader r(record);
        if (!(frame.inPeer && frame.spilled)) {
            auto envelope = wire::readEnvelope(r);
            wire::readCallHeader(r, envelope.xid);
            if (record.size() <= 4096 && wire::readRequest(r, as, again)) appendRequest(text, as.name, as.method, again);
        }
        for (auto& e : trail.entries()) {
            if (!e.daemon.empty()) continue;
            e.daemon = server_.name_;
            if (e.request.empty()) e.request = text;
        }
        m.clear();
        m.code = -1;
        m.trail = std::move(trail);
        times.ran = microseconds(monotonicNow() - start);
        server_.sorm_.setLastTrail(m.trail);
    }
    times.sub = microseconds(context.subTime);
    if (!m.trail.empty())
        for (auto& e : m.trail.entries())
            if (e.daemon.empty()) e.daemon = server_.name_;
}

void Server::Peer::reply(std::uint32_t xid, const wire::Times& times, Message& m, Slot* slot, Scratch& scratch) {
    std::size_t start = scratch.out.size();
    wire::writeReply(scratch.out, xid, times, m);
    std::size_t size = scratch.out.size() - start;
    if (size > maxReply_) {
        scratch.out.resize(start);
        refuse(xid, scratch, Error(makeEntry(errors::kTooBig, {MessageArg::of(server_.name_), MessageArg::of("reply"),
               MessageArg::of(size), MessageArg::of("the client"), MessageArg::of(maxReply_)})));
        size = scratch.out.size() - start;
    }
    if (!slot) return;
    if (size > static_cast<std::size_t>(server_.settings_.keepReply)) {
        slot->state = Slot::State::tooLarge;
        slot->size = size;
        slot->reply.release();
    } else {
        slot->state = Slot::State::done;
        slot->reply.resize(size);
        std::memcpy(slot->reply.data(), scratch.out.data() + start, size);
    }
}

void Server::Peer::flush(Scratch& scratch) {
    if (!scratch.out.empty() && open()) push(scratch.out.data(), scratch.out.size());
    scratch.out.clear();
    if (scratch.out.capacity() > kKeepSpare) scratch.out.release();
}

void Server::Peer::push(const char* data, std::size_t size) {
    if (queued() == 0) {
        while (size > 0) {
            ssize_t n = send(fd_, data, size, MSG_DONTWAIT | MSG_NOSIGNAL);
            if (n < 0 && errno == EINTR) continue;
            if (n < 0 && errno != EAGAIN) return server_.retire(this, {}, false);
            if (n < 0) break;
            data += n;
            size -= static_cast<std::size_t>(n);
        }
        if (size == 0) return;
        stuckSince_ = monotonicNow();
        if (server_.spare_.capacity() >= size) {
            std::swap(out_, server_.spare_);
            out_.clear();
        }
    }
    out_.append(data, size);
    server_.watchSlow(this);
    interest();
}

void Server::Peer::drain() {
    bool moved = false;
    while (queued() > 0) {
        ssize_t n = send(fd_, out_.data() + sent_, queued(), MSG_DONTWAIT | MSG_NOSIGNAL);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0 && errno == EAGAIN) break;
        if (n < 0) return server_.retire(this, {}, false);
        sent_ += static_cast<std::size_t>(n);
        moved = true;
    }
    if (moved) {
        stuckSince_ = monotonicNow();
        server_.reactor_.seen(stuckSince_);
    }
    if (queued() == 0) {
        out_.clear();
        if (out_.capacity() > kKeepBuffer) server_.giveBack(out_);
        sent_ = 0;
        stuckSince_ = 0;
    } else if (sent_ > kQueueLimit) {
        out_.drop(sent_);
        sent_ = 0;
    }
    if (queued() <= kQueueLimit && !in_.empty()) server_.reactor_.again(this);
    interest();
}

// Read while the peer takes its replies; ask to write while it has any to take.
void Server::Peer::interest() {
    if (!open()) return;
    std::uint32_t wanted = (queued() <= kQueueLimit ? std::uint32_t{EPOLLIN} : 0u) | (queued() > 0 ? std::uint32_t{EPOLLOUT} : 0u);
    if (wanted == interest_) return;
    interest_ = wanted;
    server_.reactor_.change(fd_, wanted, this);
}

std::string Server::Peer::tooSlow(std::int64_t now) const {
    auto& s = server_.settings_;
    if (halfSince_ != 0 && now - halfSince_ > s.requestTime * 1'000'000)
        return "half a request had come and the rest did not follow in " + std::to_string(s.requestTime) + " ms (-requesttime)";
    if (queued() > 0 && stuckSince_ != 0 && now - stuckSince_ > s.replyTime * 1'000'000)
        return std::to_string(queued()) + " bytes of replies were not taken in " + std::to_string(s.replyTime) + " ms (-replytime)";
    return {};
}

// ---- the server ----

// A long message's buffer, for the next one: a page that is had anew costs more than what is written into it.
void Server::giveBack(Buffer& buffer) {
    if (buffer.capacity() > spare_.capacity() && buffer.capacity() <= kKeepSpare) std::swap(buffer, spare_);
    buffer.release();
}

void Server::handBack() {
    for (Frame* f = frames_; f; f = f->outer) f->peer->spill(*f);
}

Server::Server(Sorm& sorm, Reactor& reactor, const Settings& settings, const Wanted& wanted)
    : sorm_(sorm), reactor_(reactor), settings_(settings), name_(wanted.name), boot_(randomNumber()), started_(wallNow()) {
    try {
        socket_ = wanted.socket.empty() ? runtimeSocket(name_) : wanted.socket;
        std::string path = socket_;
        socket_.clear();                                // not ours until we listen
        listeners_.push_back(std::make_unique<Listener>(*this, listenUnix(path), false));
        socket_ = path;
        int port = wanted.port;
        if (port < 0 && wanted.rpcbind) port = 0;       // rpcbind registers a TCP port
        if (port >= 0) listeners_.push_back(std::make_unique<Listener>(*this, listenTcp(wanted.host, port, port_), true));
        if (wanted.rpcbind) program_ = rpcbindRegister(wanted.program, wanted.host, port_);
    } catch (...) {
        stop({});
        throw;
    }
}

Server::~Server() { stop("the daemon ends"); }

void Server::stop(const std::string& reason) {
    listeners_.clear();
    if (!socket_.empty()) unlink(socket_.c_str());
    socket_.clear();
    if (program_ != 0) rpcbindUnregister(program_);
    program_ = 0;
    while (!peers_.empty()) retire(peers_.begin()->first, reason, true);
    if (sweepTimer_ != 0) reactor_.cancel(sweepTimer_);
    sweepTimer_ = 0;
    if (depth_ == 0) retired_.clear();
}

void Server::accept(int listener, bool tcp) {
    reactor_.seen(monotonicNow());
    for (int i = 0; i < kBatch; ++i) {
        sockaddr_storage from{};
        socklen_t size = sizeof from;
        int fd = accept4(listener, reinterpret_cast<sockaddr*>(&from), &size, SOCK_CLOEXEC | SOCK_NONBLOCK);
        if (fd < 0) {
            // Without descriptors the newcomers wait in the backlog; look again later instead of spinning.
            if (errno == EMFILE || errno == ENFILE) {
                Listener* waiting = nullptr;
                for (auto& l : listeners_)
                    if (l->descriptor() == listener) waiting = l.get();
                reactor_.change(listener, 0, waiting);
                reactor_.after(monotonicNow() + kSweep, [this, listener, waiting] {
                    for (auto& l : listeners_)
                        if (l.get() == waiting) reactor_.change(listener, EPOLLIN, waiting);
                });
            }
            return;
        }
        if (peers_.size() >= static_cast<std::size_t>(settings_.maxConnections)) {
            ++refused_;
            Buffer out;
            wire::writeGoodbye(out, "daemon " + name_ + " is full: it serves " + std::to_string(peers_.size()) +
                                        " connections; raise it there: sorma::configure -maxconnections N");
            ssize_t ignored = send(fd, out.data(), out.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
            (void)ignored;
            shutdown(fd, SHUT_WR);
            close(fd);
            continue;
        }
        fd = raiseDescriptor(fd);
        Caller who;
        if (tcp) {
            int on = 1;
            setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
            setsockopt(fd, SOL_SOCKET, SO_KEEPALIVE, &on, sizeof on);
            char text[INET6_ADDRSTRLEN] = "";
            bool six = from.ss_family == AF_INET6;
            auto* v6 = reinterpret_cast<sockaddr_in6*>(&from);
            auto* v4 = reinterpret_cast<sockaddr_in*>(&from);
            inet_ntop(from.ss_family, six ? static_cast<void*>(&v6->sin6_addr) : &v4->sin_addr, text, sizeof text);
            who.address = std::string(text) + ":" + std::to_string(ntohs(six ? v6->sin6_port : v4->sin_port));
            who.host = text;
        } else {
            ucred credentials{};
            socklen_t length = sizeof credentials;
            getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &credentials, &length);
            who.address = "unix";
            who.user = userName(credentials.uid);
            who.process = credentials.pid;
            who.host = Caller::self().host;
        }
        auto peer = std::make_unique<Peer>(*this, fd, std::move(who));
        peers_.emplace(peer.get(), std::move(peer));
    }
}

Server::Session& Server::session(Peer& peer, const wire::Hello& hello, bool& known) {
    bool local = peer.caller.address == "unix";
    if (!local) {
        peer.caller.user = hello.user;
        peer.caller.host = hello.host;
        peer.caller.process = hello.process;
    }
    peer.caller.program = hello.program;
    auto& entry = sessions_[hello.client];
    if (entry && local && entry->user != peer.caller.user) entry.reset();      // a number belongs to the user who chose it
    known = entry != nullptr;
    if (!entry) {
        entry = std::make_unique<Session>();
        entry->client = hello.client;
        entry->user = peer.caller.user;
    }
    Session& s = *entry;
    if (s.peer && s.peer != &peer) {
        Peer* old = s.peer;
        old->session = nullptr;
        retire(old, "the same client has come by another connection", false);
    }
    s.peer = &peer;
    s.lastSeen = monotonicNow();
    forgetOldSessions();
    return s;
}

void Server::forgetOldSessions() {
    if (sessions_.size() <= peers_.size() + kOrphans) return;
    std::int64_t now = monotonicNow();
    auto running = [](const Session& s) {
        return std::any_of(s.slots.begin(), s.slots.end(), [](auto& slot) { return slot.state == Slot::State::running; });
    };
    auto oldest = sessions_.end();
    for (auto at = sessions_.begin(); at != sessions_.end();) {
        Session& s = *at->second;
        if (s.peer || running(s)) {
            ++at;
        } else if (now - s.lastSeen > kOrphanAge) {
            at = sessions_.erase(at);
        } else {
            if (oldest == sessions_.end() || s.lastSeen < oldest->second->lastSeen) oldest = at;
            ++at;
        }
    }
    if (oldest != sessions_.end() && sessions_.size() > peers_.size() + kOrphans) sessions_.erase(oldest);
}

void Server::retire(Peer* peer, const std::string& reason, bool tell) {
    auto found = peers_.find(peer);
    if (found == peers_.end()) return;
    if (tell && !reason.empty() && peer->open()) {
        Buffer out;
        wire::writeGoodbye(out, reason);
        if (peer->queued() == 0) peer->push(out.data(), out.size());
        found = peers_.find(peer);                      // push may have found the peer gone
        if (found == peers_.end()) return;
    }
    if (peer->session) {
        peer->session->peer = nullptr;
        peer->session->lastSeen = monotonicNow();
        peer->session = nullptr;
    }
    slow_.erase(peer);
    peer->shut();
    auto owned = std::move(found->second);
    peers_.erase(found);
    retired_.push_back(std::move(owned));               // it may be on the stack
}

void Server::watchSlow(Peer* peer) {
    slow_.insert(peer);
    if (sweepTimer_ == 0) sweepTimer_ = reactor_.after(monotonicNow() + kSweep, [this] { sweep(); });
}

void Server::sweep() {
    sweepTimer_ = 0;
    std::int64_t now = monotonicNow();
    std::vector<std::pair<Peer*, std::string>> leaving;
    for (auto at = slow_.begin(); at != slow_.end();) {
        Peer* peer = *at;
        std::string why = peer->tooSlow(now);
        if (!why.empty()) leaving.emplace_back(peer, why);
        if (!peer->slow()) at = slow_.erase(at);
        else ++at;
    }
    for (auto& [peer, why] : leaving) retire(peer, why, true);
    if (!slow_.empty()) sweepTimer_ = reactor_.after(now + kSweep, [this] { sweep(); });
}

std::string Server::connectionsText() const {
    std::string out;
    std::int64_t now = monotonicNow();
    for (auto& [peer, owned] : peers_) {
        if (!out.empty()) out += '\n';
        out += "from " + peer->caller.address + " " + peer->caller.toText() + ", " + durationText(double(now - peer->since)) +
               " old, " + std::to_string(peer->calls) + " calls, " + std::to_string(peer->queued()) + " bytes queued";
    }
    return out;
}

std::string Server::statisticsText() const {
    return "daemon " + name_ + ": " + std::to_string(peers_.size()) + " connections, " + std::to_string(sessions_.size()) +
           " sessions, " + std::to_string(served_) + " calls served, " + std::to_string(refused_) + " connections refused, since " +
           clockText(started_);
}

}  // namespace sorma
