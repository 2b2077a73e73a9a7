// server.h -- a daemon: exports the repository of a SORM under a name.
//
// At most once: a client that said HELLO numbers the calls of each of its slots; the last reply of a slot is kept
// until the next call of that slot, so a client whose connection broke gets the reply instead of a second execution.
// (The idea of sessions and slots is that of NFS version 4.1, RFC 8881, section 2.10.)
//
// A service may answer later: its call keeps its slot, and the reply goes to wherever the client is by then.
//
// No peer can hold up another: sockets never block, a peer that floods gets no more of a turn than others ask for, what a peer does not take waits in its own queue, and a peer that sends half a request or takes
// nothing is let go after Settings::requestTime or replyTime.
#pragma once

#include <cstdint>
#include <memory>
#include <set>
#include <string>
#include <unordered_map>
#include <vector>

#include "bus/client.h"
#include "bus/call.h"
#include "bus/sorm.h"
#include "comm/serverLock.h"
#include "comm/reactor.h"
#include "comm/settings.h"
#include "comm/wire.h"

namespace sorma {

struct Inherited;
class SiblingFile;

class Server {
public:
    struct Wanted {
        std::string name = {};
        std::string socket = {};        // path; empty: NAME.sock in the runtime folder
        std::string host = "127.0.0.1";
        int port = -1;                  // -1: no TCP; 0: a free one
        bool rpcbind = false;
        bool share = false;             // other users of this host may connect to the Unix-domain socket; a policy says what they may
        std::uint32_t program = 0;      // offset from 0x20000000; 0: the first free one
        // Descriptors of sockets that listen already (socket activation), in place of new ones: a Unix-domain one of
        // that at `socket`, a TCP one of that at `host` and `port`. They are closed when it serves; files of Unix-domain
        // ones stay at the end, since whoever made them goes on to listen.
        std::vector<int> listen = {};
        int connection = -1;            // a connection that is open already (inetd): serve this one, and listen nowhere
    };

    // Starts to listen. Fails with COMM REFUSED when the name or an address is taken, or a descriptor is of no use.
    Server(Sorm& sorm, Reactor& reactor, ServerLock& lock, const Settings& settings, const Wanted& wanted);
    ~Server();                          // as stop("the daemon ends")
    Server(const Server&) = delete;
    Server& operator=(const Server&) = delete;

    // Close listeners and connections, telling every peer the reason; remove socket and registration.
    void stop(const std::string& reason);

    const std::string& name() const { return name_; }
    const std::string& socket() const { return socket_; }
    int port() const { return port_; }                          // 0: none
    std::uint32_t program() const { return program_; }          // offset; 0: none
    std::size_t connections() const { return peers_.size(); }
    // A service that is being executed enters an event loop: let that loop serve what has been read already.
    void handBack();
    bool serving() const { return depth_ > 0; }                 // is one of its requests on the stack?
    std::uint64_t served() const { return served_; }
    // The health responder's look: with the lock held, while the SORM's thread is elsewhere. Is a request being executed?
    bool peek(const std::vector<void*>& waiting);
    wire::Health health(bool busy) const;
    std::string connectionsText() const;                        // a line for each peer
    std::string statisticsText() const;
    static void setLimits(Sorm& sorm, const Settings& settings);    // as the settings say now

private:
    class Listener;
    class Peer;
    struct Session;
    struct Slot;
    struct Frame;
    struct Scratch;
    class Subscription;
    // A request that is executed, for health: innermost first.
    struct Activity {
        Activity(Server& server, std::string_view name, Method method, const Caller& caller, std::int64_t since);
        ~Activity() { server.activity_ = outer; }
        Server& server;
        std::string_view name;          // in the request's bytes, or in kept
        std::string kept = {};
        Method method;
        const Caller& caller;
        std::int64_t since;
        Activity* outer;
    };
    // Whose session it is, and the number that its client has chosen. By Unix socket it belongs to the user, by TCP the
    // number is the secret; so neither can be taken over by the other kind.
    struct SessionKey {
        std::int64_t user = kByNumber;
        std::uint64_t number = 0;
        static constexpr std::int64_t kByNumber = -1;
        bool operator==(const SessionKey&) const = default;
    };
    struct SessionHash {
        std::size_t operator()(const SessionKey& k) const {
            return std::hash<std::uint64_t>{}(k.number ^ std::uint64_t(k.user) * 0x9e3779b97f4a7c15u);
        }
    };
    // Whom a reply that comes later is for.
    struct Later {
        Peer* peer;
        std::uint64_t peerNumber;
        SessionKey session;
        std::uint32_t slot, sequence, xid;
        std::size_t size;                       // of the request
        std::int64_t started;
    };

    void listen(const Wanted& wanted);
    void accept(int listener, bool tcp);
    void adopt(const Inherited& connection);
    void adopt(int fd, bool tcp, bool scarce = false);
    std::size_t places() const;
    bool makeRoom(const Account& newcomer);
    void sayFull(int fd);
    bool newcomer(const Peer& peer, XdrReader hello) const;
    void link(Session& session, Peer* peer);
    Slot* findSlot(const Later& later);
    Peer* findPeer(const Later& later);
    void replyLater(Later later, wire::Times times, PendingPointer pending);
    void answer(const Later& later, wire::Times times, Pending& pending);
    void keepReply(Slot& slot, const char* record, std::size_t size);
    void dropReply(Slot& slot);
    void replyAgain(const Later& later, Slot& slot, Peer* answered);
    void mark(Trail& trail, const std::string& request) const;
    void passOn(Trail& trail, std::string_view name, const wire::Times& times) const;
    void leave(Session& session);
    void abandon(const SessionKey& key);
    int share(const Peer* peer) const;
    void took(Peer* peer, int served, bool more);
    void sweep();
    void watchSlow(Peer* peer);
    void retire(Peer* peer, const std::string& reason, bool tell);
    Session& session(Peer& peer, const wire::Hello& hello, bool& known);
    void forgetOldSessions();
    void giveBack(Buffer& buffer);

    Sorm& sorm_;
    Reactor& reactor_;
    ServerLock& lock_;
    const Settings& settings_;
    std::string name_, socket_;
    std::unique_ptr<SiblingFile> sibling_;                      // when it listens to TCP
    bool ownSocket_ = false;                                    // its file is removed at the end
    int port_ = 0;
    std::uint32_t program_ = 0;
    std::uint64_t boot_;
    std::int64_t started_;
    std::uint64_t served_ = 0, refused_ = 0, dropped_ = 0;
    std::vector<std::unique_ptr<Listener>> listeners_;
    std::unordered_map<Peer*, std::unique_ptr<Peer>> peers_;
    std::vector<std::unique_ptr<Peer>> retired_;                // closed, but perhaps still on the stack
    std::unordered_map<SessionKey, std::unique_ptr<Session>, SessionHash> sessions_;
    std::set<Peer*> slow_;                                      // with half a request, or with replies not taken
    Timer sweepTimer_, acceptTimer_;
    Frame* frames_ = nullptr;                                   // what is being served, innermost first
    std::vector<std::unique_ptr<Scratch>> scratch_;             // one for each depth
    std::size_t depth_ = 0;
    Buffer spare_;                                              // for the next peer with a long message
    Buffer events_, peeked_;                                    // written by pump, read by the health responder
    Activity* activity_ = nullptr;
    std::uint64_t peersSeen_ = 0;
    int spareDescriptor_ = -1;
    bool stopping_ = false;
    bool watched_ = false;                                      // it is the health responder who is inside
    std::shared_ptr<Server*> self_ = std::make_shared<Server*>(this);   // for callbacks that may outlive us
    // The body of the event that is being handed out, shared by all who get it.
    std::uint64_t encoded_ = 0;
    std::shared_ptr<const Buffer> encodedBody_;
    // Fairness: what peers asked for in one turn of the reactor.
    struct Turn {
        std::uint64_t number = 0;
        int peers = 0, most = 0, second = 0;
        const Peer* busiest = nullptr;      // to compare with only
        std::int64_t began = 0;             // [ns]
    } turn_;
    int share_ = 0;
    std::int64_t crowded_ = 0;                                  // when two peers last had requests at a time
    std::uint64_t crowdedTurn_ = 0;                             // and in which turn
};

}  // namespace sorma
