// server.h -- a daemon: exports the repository of a SORM under a name.
//
// At most once: a client that said HELLO numbers the calls of each of its slots; the last reply of a slot is kept
// until the next call of that slot, so a client whose connection broke gets the reply instead of a second execution.
// (The idea of sessions and slots is that of NFS version 4.1, RFC 8881, section 2.10.)
//
// No peer can hold up another: sockets never block, at most kBatch requests of one peer are served before the next
// has its turn, what a peer does not take waits in its own queue, and a peer that sends half a request or takes
// nothing is let go after Settings::requestTime or replyTime.
#pragma once

#include <cstdint>
#include <memory>
#include <set>
#include <string>
#include <unordered_map>
#include <vector>

#include "bus/deadline.h"
#include "bus/sorm.h"
#include "comm/reactor.h"
#include "comm/settings.h"
#include "comm/wire.h"

namespace sorma {

class Server {
public:
    struct Wanted {
        std::string name;
        std::string socket;             // path; empty: NAME.sock in the runtime folder
        std::string host = "127.0.0.1";
        int port = -1;                  // -1: no TCP; 0: a free one
        bool rpcbind = false;
        std::uint32_t program = 0;      // offset from 0x20000000; 0: the first free one
    };

    // Starts to listen. Fails with COMM REFUSED when the name or an address is taken.
    Server(Sorm& sorm, Reactor& reactor, const Settings& settings, const Wanted& wanted);
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
    std::string connectionsText() const;                        // a line for each peer
    std::string statisticsText() const;

private:
    class Listener;
    class Peer;
    struct Session;
    struct Slot;
    struct Frame;
    struct Scratch;

    void accept(int listener, bool tcp);
    void sweep();
    void watchSlow(Peer* peer);
    void retire(Peer* peer, const std::string& reason, bool tell);
    Session& session(Peer& peer, const wire::Hello& hello, bool& known);
    void forgetOldSessions();
    void giveBack(Buffer& buffer);

    Sorm& sorm_;
    Reactor& reactor_;
    const Settings& settings_;
    std::string name_, socket_;
    int port_ = 0;
    std::uint32_t program_ = 0;
    std::uint64_t boot_;
    std::int64_t started_;
    std::uint64_t served_ = 0, refused_ = 0;
    std::vector<std::unique_ptr<Listener>> listeners_;
    std::unordered_map<Peer*, std::unique_ptr<Peer>> peers_;
    std::vector<std::unique_ptr<Peer>> retired_;                // closed, but perhaps still on the stack
    std::unordered_map<std::uint64_t, std::unique_ptr<Session>> sessions_;
    std::set<Peer*> slow_;                                      // with half a request, or with replies not taken
    std::uint64_t sweepTimer_ = 0;
    Frame* frames_ = nullptr;                                   // what is being served, innermost first
    std::vector<std::unique_ptr<Scratch>> scratch_;             // one for each depth
    std::size_t depth_ = 0;
    Buffer spare_;                                              // for the next peer with a long message
};

}  // namespace sorma
