// peer.h -- the daemon's side of one connection: bytes in and out, and when its requests have their turn. See requests.h for
// their meaning. Only the files of the server include it.
//
//             upgraded              HELLO, WELCOME           upgraded
//     opening ---------> greeting -----------------> joining ---------> live
//
// From each of them it is closed (Server::closePeer). A peer whose request is being executed gets its reply first
// (closeAfterReply). In opening, a peer by Unix-domain socket may offer memory (comm/shm.cpp). A peer by TCP may ask for TLS there, when the
// daemon has keys (comm/tls.cpp). Others pass it at once. None of our rows has anything to do in joining.
//
// Threads:  everything here is used with the ServerLock held, by the SORM's thread; Peer::peek by the health responder's.
// Re-entry: while a request is executed the lock is released, and the service may run the event loop. Afterwards the peer may
//           be closed: check open(). It is deleted when no turn is on the stack any more.
// Owner:    the server.
#pragma once

#include <sys/epoll.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "bus/budget.h"
#include "comm/apart.h"
#include "comm/requests.h"
#include "comm/server.h"
#include "comm/transport.h"

namespace sorma {

// [bytes]
inline constexpr std::size_t kEventWindow = 64 * 1024;  // of events that are written to a peer's queue at a time
inline constexpr std::size_t kKeepSpare = 4 << 20;      // the shared buffer may stay this large, for the next long message

// Buffers for one turn; turns that are nested on the stack have one each.
struct Server::Scratch {
    char in[kReadSize];
    Buffer out;
    record::Lent lent;          // numbers of the message that belong into out: it is sent before the message is used again
    Message message;
};

// One peer's turn, on the stack. When a service runs the event loop, the turns below move the requests that they have not
// served to their peers' buffers (spill). So the inner loop can serve them, in order.
struct Server::Frame {
    Peer* peer;
    const char* at;             // requests that are not served yet: from here
    const char* end;            // to here
    const char* scanned;        // CANCELs were looked for up to here
    bool inPeer;                // at and end point into the peer's own buffer
    bool spilled = false;       // the rest is in the peer's buffer now: do not use at and end
    Frame* outer;
    std::int64_t since = 0;     // [ns] up to which the peer has paid for its time
    std::int64_t ran = 0;       // [ns] when its last request had been executed, and only a short reply was written since. 0: it was not so
    Buffer bytes = {};          // when it was inPeer and is spilled: the peer's buffer as it was, for the request under way
    Charge charge = {};         // for them
    ClientPointer client = {};  // of the request under way: stays while a service runs, whatever becomes of the peer
    SpanPointer span = {};      // of the request under way, when it is traced
};

// It serves requests in order: several in one turn when they came together.
class Server::Peer : public Reactor::Watcher {
public:
    // user: SessionKey::user.
    Peer(Server& server, Line line, ClientPointer who, std::int64_t user);
    ~Peer() override { closeSocket(); }

    bool brought(bool sleep) override { return open() && reading() && line_.brought(sleep); }
    void rest() override { line_.rest(); }
    void ready(std::uint32_t events) override;          // one turn: sends, reads and serves. May run services and the event loop
    void push(const char* data, std::size_t size);      // send now, or queue what the socket does not take. May close the peer
    void flush(Scratch& scratch);       // send the answers of this turn
    void closeSocket();                 // close the socket; Server::closePeer does the rest
    bool onStack() const;               // is one of its requests being executed?
    void closeAfterReply(const std::string& reason) { closing_ = reason, interest(); }    // close it after the reply to that request
    bool open() const { return line_.open(); }
    bool secure() const { return tls::secure(line_); }
    bool tooWeak() const { return server_.tls_ == Wanted::Tls::only && &line_.row() == &tcpTransport; }     // it has to speak TLS, and does not
    std::string distrusted(const tls::Judge& judge) const { return judge(line_); }
    bool mayBeTold() const { return open() && (!upgrading() || line_.row().inClear) && queued() == 0; }      // may a GOODBYE be sent?
    std::size_t queued() const { return out_.size() - sent_; }      // [bytes] that the socket has not taken
    void spill(Frame& frame);           // see Frame
    void schedule(Subscription& subscription);          // it has events for this peer
    void unschedule(Subscription& subscription) { std::erase(events_, &subscription); }     // it has none any more
    void unscheduleAll() { events_.clear(); }
    // For the health responder's thread, while the SORM's thread is elsewhere: answers what needs no service. It looks at
    // the bytes in the socket and leaves them there.
    void peek();
    bool unserved() const;              // are requests here that were read and not served?

    // Why this peer has been slow for too long; empty when it has not.
    std::string tooSlow(std::int64_t now) const;
    // Does it owe nothing and get nothing? Then it may be closed to make room.
    bool idle() const { return in_.empty() && begun() == 0 && queued() == 0 && requests.idle(); }
    std::int64_t lastHeard() const { return arrived_ != 0 ? arrived_ : since; }     // [ns]
    bool slow() const { return halfSince_ != 0 || queued() > 0; }       // to be watched: see tooSlow

    // ---- for its requests ----

    std::int64_t arrived() const { return arrived_; }   // [ns] when something last came; 0: not yet
    bool ended() const { return ended_; }
    void greeted() { state_ = line_.row().upgrade ? State::joining : State::live; }     // the WELCOME is written
    void took(std::int64_t nanoseconds);                // a request has taken so long
    void executed();                                    // a request has been: its bytes make room for the reply

    const std::int64_t since;           // [ns] when it connected
    const std::uint64_t number;         // unique, while the address of a deleted peer may be used again
    Requests requests;

private:
    enum class State : std::uint8_t { greeting, live, opening, joining };       // those that upgrade come last
    bool upgrading() const { return state_ >= State::opening; }
    bool upgrade();                     // false: its transport has not done it yet
    bool upgradeInClear();
    void identify();                    // it has shown who it is
    void later(void (*what)(Peer&));
    bool reading() const;               // are its requests read?
    void receive();                     // read once, and serve what is complete
    std::size_t appetite() const;       // [bytes] to read now
    record::Piece front() const { return record::front(in_.data() + taken_, in_.data() + in_.size()); }     // the first that is not served
    std::size_t unread() const { return in_.size() - taken_; }      // [bytes] of in_ that are not served
    bool complete() const { return front().whole && unread() > record::kMarkSize && !(apart_ && apart_->filling()); }
    std::size_t begun() const { return pieces_.size() + (apart_ ? apart_->size() : 0); }        // [bytes] of a record that are not in in_
    bool receiveApart();
    void beginApart();
    void handleLong(std::string_view record, Scratch& scratch, Frame& frame);       // the numbers of the record are in apart_
    void push(record::Source& source);
    void serve(Frame& frame, Scratch& scratch);         // the complete requests of a turn
    bool mayKeep(std::size_t size, std::size_t kept, Scratch& scratch);
    void leave(Frame& frame, std::size_t coming, bool more, bool served);
    bool skip(Frame& frame, Scratch& scratch, std::size_t length, const Error& why);
    void end(Scratch& scratch, const std::string& reason);
    void wait();
    void pay(Frame& frame);
    void lookAhead(Frame& frame);
    void hold(Scratch& scratch);        // keep answers for the next turn, which comes soon
    void drain();                       // send what is queued, as far as the socket takes it
    void pump();                        // write events while the queue is empty
    void interest();                    // tell the reactor what to wait for
    void queue(const char* data, std::size_t size);
    Buffer& roomToQueue(std::size_t size);
    void watchQueue();                  // closes the peer when it may not have so much

    Server& server_;
    Line line_;
    State state_ = State::greeting;
    Charge request_, queue_;            // for the bytes of a request that have come, and for out_
    std::optional<std::string> closing_;    // reason to close it after the reply to the request that is being executed
    Buffer in_;                         // requests that have come and are not served, the last one perhaps in part
    std::size_t taken_ = 0;             // [bytes] of in_ that were served. They are removed when more is read, not in each turn
    record::Assembler pieces_;          // of a record whose last one has not come, or that is refused
    std::unique_ptr<record::Apart> apart_;      // numbers of the record with which what is unread begins; null: none
    Buffer out_;                        // replies that the socket has not taken
    std::size_t sent_ = 0;              // [bytes] of out_ that were sent
    Buffer held_;                       // replies that are sent with those of its next turn
    std::size_t scanned_ = 0;           // [bytes] of in_, beyond taken_, in which CANCELs were looked for
    bool ended_ = false;                // the other end has closed it; requests that it sent before may still be here
    Shares::Share share_;
    bool fed_ = false;                  // its socket may have more than what was read
    bool dwelt_ = false;                // the last request took long: look ahead for CANCELs
    std::int64_t looked_ = 0;           // [ns] when we last did
    // [ns] since when a part of a request is here, since when the socket takes nothing, when something last came; 0: not so
    std::int64_t halfSince_ = 0, stuckSince_ = 0, arrived_ = 0;
    std::uint32_t interest_ = EPOLLIN | EPOLLRDHUP;     // what the reactor waits for
    std::vector<Subscription*> events_; // subscriptions with events for this peer, in turn. An empty deque takes 600 bytes
};

}  // namespace sorma
