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
// No peer can delay another. Sockets never block. The peers that want much get the same time: see comm/shares.h. Replies
// that a peer does not read wait in its own queue. A connection is closed when the rest of a request does not follow within
// Settings::requestTime, or when the peer reads nothing for Settings::replyTime.
//
// Threads: belongs to the thread of its SORM. Everything here is guarded by the ServerLock, since the health responder reads
//          it too. The lock is released while a service or Tcl runs.
// Re-entry: a service may run the event loop. Then the server serves other requests on top of it. The service may stop the
//          server; objects on the stack stay valid until it has returned.
//
// Its parts, each in files of its own that no other code includes:
//
//     Acceptor      the sockets that listen
//     Peer          one connection: its bytes, and its turns
//     Requests      what came on it, and the answers
//     Sessions      clients that said HELLO, with the last reply of each slot
//     Subscription  one subscription of a session, and the events that wait
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
#include "comm/shares.h"
#include "comm/tls.h"
#include "comm/wire.h"

namespace sorma {

class Acceptor;
struct Address;
class Line;
struct ListeningSocket;
class SiblingFile;

class Server {
public:
    struct Wanted {
        std::string name = {};
        std::string socket = {};        // path; empty: NAME.sock in the runtime folder
        std::string host = "127.0.0.1"; // interface to listen on
        int port = -1;                  // -1: no TCP; 0: a free one
        bool rpcbind = false;           // register with rpcbind; this implies TCP
        // By TCP: offer TLS if there are keys (unsaid); offer none; offer it, and have keys; take nothing else.
        enum class Tls : std::uint8_t { unsaid, no, yes, only } tls = Tls::unsaid;
        bool directory = false;         // own the name in the directory, which the dictionary chooses: comm/directory.h
        std::vector<std::string> owned = {};    // patterns of objects that obey the owner of the name alone: comm/ownership.h
        bool share = false;             // other users of this host may connect to the socket; see the policy
        std::uint32_t program = 0;      // for rpcbind: offset from 0x20000000; 0: the first free one
        // Descriptors of sockets that listen already (socket activation): a Unix-domain one replaces the socket at `socket`,
        // a TCP one that at `host` and `port`. When the server listens it has copies, and the originals are closed. The file
        // of a Unix-domain one stays at the end, since the program that made it continues to listen.
        std::vector<int> listen = {};
        int connection = -1;            // a connection that is open already (inetd): serve this one, and listen nowhere
    };

    // Begins to listen. sorm, reactor, lock and settings must outlive it. Fails with COMM REFUSED when an address is taken
    // or a descriptor is unusable, COMM DENIED as runtimeFolder(), COMM LIMIT without a free program number. Then nothing is
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
    bool listensAt(const Address& address) const;               // does the address lead to one of its sockets?
    std::size_t connections() const { return peers_.size(); }
    // Call it when a service enters an event loop while it is executed: that loop then serves the requests that were read
    // with it.
    void handBack();
    void outdated();                                            // tell clients who check requests ahead: bus/ahead.h
    bool serving() const { return depth_ > 0; }                 // is one of its requests on the stack?
    std::uint64_t served() const { return served_; }            // requests so far
    // For the health responder's thread, with the lock held, as HealthResponder::Look.
    bool peek(const std::vector<void*>& waiting);
    std::string connectionsText() const;                        // for people, a line for each peer
    void listConnections(std::string& out, std::size_t most) const;     // appends elements: see sorm DBX -inventory connections
    std::string statisticsText() const;                         // for people, one line
    void addFigures(Network::Figures& sum) const;
    static void setLimits(Sorm& sorm, const Settings& settings);    // give the SORM's budget the limits of the settings
    void setFence(std::uint64_t serial) { fence_ = serial; }    // its clients may have heard of epochs for this one: bus/fence.h
    std::function<void(const Entry& what)> trouble;             // as Comm::trouble

private:
    class Peer;
    class Requests;
    class Sessions;
    struct Session;
    struct SessionKey;
    struct ReplySlot;
    struct Later;
    struct Frame;
    struct Scratch;
    class Subscription;
    // With the lock held. Others than this user get nothing of other clients' requests.   busy: asked by the health responder.
    wire::Health health(bool busy, const Requests& asker);
    // A request that is being executed, for health(). On the stack, the innermost first.
    struct Activity {
        Activity(Server& server, std::string_view name, Method method, const Caller& caller, std::int64_t since);
        ~Activity() { server.activity_ = outer; }
        Server& server;
        std::string_view name;          // points into the request's bytes
        Method method;
        const Caller& caller;
        std::int64_t since;
        Activity* outer;
    };
    // Connections. scarce: there is no other free descriptor.
    void listen(const Wanted& wanted);
    void adopt(Line line, bool scarce);
    void add(ListeningSocket listening);
    std::size_t places() const;
    bool makeRoom(const Account& newcomer);
    void sayFull(Line line);
    std::int64_t userOf(const Line& line, const PrincipalPointer& principal);     // SessionKey::user
    void refuseLine(const Error& why);          // TLS with somebody has failed: tell it
    void judgeLines();                          // close those whose certificate does not hold any more
    void lookAtKeys();                          // tell what is wrong with their files
    // Close the connection and send the reason before, if tell. The session stays. The peer is deleted later, since it may
    // be on the stack.
    void closePeer(Peer* peer, const std::string& reason, bool tell);
    void watchSlow(Peer* peer);                 // watch it until it is no longer slow
    void sweep();
    void giveBack(Buffer& buffer);

    // Replies.
    Peer* findPeer(const Later& later);
    void replyLater(Later later, wire::Times times, PendingPointer pending);
    void answer(const Later& later, wire::Times times, Pending& pending);
    void mark(Trail& trail, const std::string& request) const;
    void passOn(Trail& trail, std::string_view name, const wire::Times& times) const;

    Sorm& sorm_;
    Reactor& reactor_;
    ServerLock& lock_;
    const Settings& settings_;
    std::string name_, socket_;
    std::unique_ptr<SiblingFile> sibling_;                      // when it listens on TCP
    bool ownSocket_ = false;                                    // we made the socket file, and remove it at the end
    int port_ = 0;
    std::uint32_t program_ = 0;
    std::uint64_t fence_ = 0;                                   // Fence::serial; 0: there is none
    std::uint64_t boot_;                                        // random: identifies this start of the daemon
    std::int64_t started_;                                      // [us since 1970]
    std::uint64_t served_ = 0, refused_ = 0, dropped_ = 0, eventsLost_ = 0;     // requests; connections; one-way requests
    std::unique_ptr<Acceptor> acceptor_;
    std::unordered_map<Peer*, std::unique_ptr<Peer>> peers_;
    std::vector<std::unique_ptr<Peer>> closedPeers_;                // closed, but perhaps still on the stack
    std::unique_ptr<Sessions> sessions_;
    std::set<Peer*> slow_;                                      // sent half a request, or did not read all replies
    Timer sweepTimer_, judgeTimer_;
    Frame* frames_ = nullptr;                                   // turns of peers on the stack, the innermost first
    std::vector<std::unique_ptr<Scratch>> scratch_;             // one for each depth
    std::size_t depth_ = 0;                                     // of turns on the stack
    Buffer spare_;                                              // for the next peer with a long message
    std::unique_ptr<record::Apart> spareApart_;                 // likewise
    Buffer events_, peeked_;                                    // scratch of Peer::pump, of Peer::peek
    Activity* activity_ = nullptr;                              // the innermost request; null: none
    std::uint64_t peersSeen_ = 0;
    bool stopping_ = false;
    bool watched_ = false;                                      // the health responder's thread is inside, not the SORM's
    std::shared_ptr<Server*> self_ = std::make_shared<Server*>(this);   // callbacks that may outlive us have weak ones
    // The event that is being sent, shared by all subscriptions, and its serial number.
    std::uint64_t encoded_ = 0;
    std::shared_ptr<const wire::EncodedEvent> encodedEvent_;
    Shares shares_;                                             // of the time for requests
    tls::Offer offer_;
    std::string keyTrouble_;                                    // tls::trouble() at the last look
    Wanted::Tls tls_;
};

}  // namespace sorma
