// server.h -- makes this process a daemon: exports the repository of a SORM under a name.
//
// Each call is executed at most once. A client that said HELLO has a session, and numbers the calls of each of its slots.
// The server keeps the last reply of a slot until the next call of that slot. A client whose connection broke sends its call
// again and gets that reply; the call is not executed a second time. (The idea of sessions and slots is that of NFS version
// 4.1, RFC 8881, section 2.10.)
//
// A service may answer later. The call keeps its slot meanwhile, and the reply goes to the connection that the client has
// then.
//
// No peer can delay another. Sockets never block. A peer that floods gets no more of a turn than others ask for. Replies
// that a peer does not read wait in its own queue. A connection is closed when the rest of a request does not follow within
// Settings::requestTime, or when the peer reads nothing for Settings::replyTime.
//
// Threads: belongs to the thread of its SORM. Everything here is guarded by the ServerLock, since the health responder reads
//          it too. The lock is released while a service or Tcl runs.
// Re-entry: a service may run the event loop. Then the server serves other requests on top of it, and the service may even
// stop the
//          server; what is on the stack stays valid until it has returned.
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
        std::string host = "127.0.0.1"; // interface to listen on
        int port = -1;                  // -1: no TCP; 0: a free one
        bool rpcbind = false;           // register with rpcbind; this implies TCP
        bool share = false;             // other users of this host may connect to the socket; see the policy
        std::uint32_t program = 0;      // for rpcbind: offset from 0x20000000; 0: the first free one
        // Descriptors of sockets that listen already (socket activation): a Unix-domain one replaces the socket at `socket`,
        // a TCP one that at `host` and `port`. When the server listens it has copies, and the originals are closed. The file
        // of a Unix-domain one stays at the end, since the program that made it continues to listen.
        std::vector<int> listen = {};
        int connection = -1;            // a connection that is open already (inetd): serve this one, and listen nowhere
    };

    // Begins to listen. sorm, reactor, lock and settings must outlive it. Fails with COMM REFUSED when an address is taken
    // or a descriptor is unusable, COMM DENIED as runtimeFolder(), COMM LIMIT without a free program number; then nothing is
    // left open.
    Server(Sorm& sorm, Reactor& reactor, ServerLock& lock, const Settings& settings, const Wanted& wanted);
    ~Server();                          // as stop("the daemon ends")
    Server(const Server&) = delete;
    Server& operator=(const Server&) = delete;

    // Close listeners and connections, and send the reason to every peer; remove the socket file and the registration. Calls
    // that services answer later are cancelled. A peer whose request is on the stack gets its reply first. May run callbacks
    // of services.
    void stop(const std::string& reason);

    const std::string& name() const { return name_; }
    const std::string& socket() const { return socket_; }       // path; empty: none
    int port() const { return port_; }                          // 0: none
    std::uint32_t program() const { return program_; }          // offset; 0: none
    std::size_t connections() const { return peers_.size(); }
    // Call it when a service enters an event loop while it is executed: that loop then serves the requests that were read
    // with it.
    void handBack();
    bool serving() const { return depth_ > 0; }                 // is one of its requests on the stack?
    std::uint64_t served() const { return served_; }            // requests so far
    // For the health responder's thread, with the lock held, as HealthResponder::Look.
    bool peek(const std::vector<void*>& waiting);
    wire::Health health(bool busy) const;                       // with the lock held; busy: asked by the health responder
    std::string connectionsText() const;                        // for people, a line for each peer
    void listConnections(std::string& out, std::size_t most) const;     // appends elements: see sorm DBX -inventory connections
    std::string statisticsText() const;                         // for people, one line
    static void setLimits(Sorm& sorm, const Settings& settings);    // give the SORM's budget the limits of the settings

private:
    class Listener;
    class Peer;
    struct Session;
    struct Slot;
    struct Frame;
    struct Scratch;
    class Subscription;
    // A request that is being executed, for health(). On the stack, the innermost first.
    struct Activity {
        Activity(Server& server, std::string_view name, Method method, const Caller& caller, std::int64_t since);
        ~Activity() { server.activity_ = outer; }
        Server& server;
        std::string_view name;          // points into the request's bytes, or to kept
        std::string kept = {};          // the name, when the bytes were freed
        Method method;
        const Caller& caller;
        std::int64_t since;
        Activity* outer;
    };
    // Identifies a session: its user and the number that the client has chosen. By Unix socket the user counts; by TCP the
    // number is a secret. So a client of one kind cannot take over a session of the other kind.
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
    // Says who gets a reply that comes later.
    struct Later {
        Peer* peer;                             // perhaps deleted: see findPeer
        std::uint64_t peerNumber;
        SessionKey session;
        std::uint32_t slot, sequence, xid;
        std::size_t size;                       // of the request [bytes]
        std::int64_t started;                   // [ns]
    };

    // Connections. adopt owns the descriptor that it gets; scarce: there is no other free one.
    void listen(const Wanted& wanted);
    void accept(int listener, bool tcp);
    void adopt(const Inherited& connection);
    void adopt(int fd, bool tcp, bool scarce = false);
    std::size_t places() const;
    bool makeRoom(const Account& newcomer);
    void sayFull(int fd);
    // Close the connection and send the reason before, if tell. The session stays. The peer is deleted later, since it may
    // be on the stack.
    void closePeer(Peer* peer, const std::string& reason, bool tell);
    void watchSlow(Peer* peer);                 // watch it until it is no longer slow
    void sweep();
    void giveBack(Buffer& buffer);

    // Sessions.
    Session& session(Peer& peer, const wire::Hello& hello, bool& known);
    bool newcomer(const Peer& peer, XdrReader hello) const;
    void link(Session& session, Peer* peer);
    void suspend(Session& session);               // its connection is closed: it has Settings::grace to come back
    void removeClient(const SessionKey& key);        // it has not come back: cancel its calls, release what it holds
    void removeOldSessions();

    // Replies.
    Slot* findSlot(const Later& later);
    Peer* findPeer(const Later& later);
    void replyLater(Later later, wire::Times times, PendingPointer pending);
    void answer(const Later& later, wire::Times times, Pending& pending);
    void keepReply(Slot& slot, const char* record, std::size_t size);
    void freeReply(Slot& slot);
    void replyAgain(const Later& later, Slot& slot, Peer* answered);
    void mark(Trail& trail, const std::string& request) const;
    void passOn(Trail& trail, std::string_view name, const wire::Times& times) const;

    // Fairness: how many requests of this peer may be served in this turn; how many were.
    int share(const Peer* peer) const;
    void took(Peer* peer, int served, bool more);

    Sorm& sorm_;
    Reactor& reactor_;
    ServerLock& lock_;
    const Settings& settings_;
    std::string name_, socket_;
    std::unique_ptr<SiblingFile> sibling_;                      // when it listens on TCP
    bool ownSocket_ = false;                                    // we made the socket file, and remove it at the end
    int port_ = 0;
    std::uint32_t program_ = 0;
    std::uint64_t boot_;                                        // random: identifies this start of the daemon
    std::int64_t started_;                                      // [us since 1970]
    std::uint64_t served_ = 0, refused_ = 0, dropped_ = 0;      // requests; connections; one-way requests
    std::vector<std::unique_ptr<Listener>> listeners_;
    std::unordered_map<Peer*, std::unique_ptr<Peer>> peers_;
    std::vector<std::unique_ptr<Peer>> closedPeers_;                // closed, but perhaps still on the stack
    std::unordered_map<SessionKey, std::unique_ptr<Session>, SessionHash> sessions_;
    std::set<Peer*> slow_;                                      // sent half a request, or did not read all replies
    Timer sweepTimer_, acceptTimer_;
    Frame* frames_ = nullptr;                                   // turns of peers on the stack, the innermost first
    std::vector<std::unique_ptr<Scratch>> scratch_;             // one for each depth
    std::size_t depth_ = 0;                                     // of turns on the stack
    Buffer spare_;                                              // for the next peer with a long message
    Buffer events_, peeked_;                                    // scratch of Peer::pump, of Peer::peek
    Activity* activity_ = nullptr;                              // the innermost request; null: none
    std::uint64_t peersSeen_ = 0;
    int spareDescriptor_ = -1;                                  // closed to accept one more when there are no descriptors left
    bool stopping_ = false;
    bool watched_ = false;                                      // the health responder's thread is inside, not the SORM's
    std::shared_ptr<Server*> self_ = std::make_shared<Server*>(this);   // callbacks that may outlive us have weak ones
    // The body of the event that is being sent, shared by all subscriptions, and the event's serial number.
    std::uint64_t encoded_ = 0;
    std::shared_ptr<const Buffer> encodedBody_;
    // Fairness: what the peers asked for in one turn of the reactor.
    struct Turn {
        std::uint64_t number = 0;
        int peers = 0, most = 0, second = 0;    // peers with requests; requests of the two that had most
        const Peer* busiest = nullptr;      // only compared, perhaps deleted
        std::int64_t began = 0;             // [ns]
    } turn_;
    int share_ = 0;                                             // requests of one peer in a turn, 0: no limit yet
    std::int64_t crowded_ = 0;                                  // [ns] when two peers last had requests at the same time
    std::uint64_t crowdedTurn_ = 0;                             // in which turn that was
};

}  // namespace sorma
