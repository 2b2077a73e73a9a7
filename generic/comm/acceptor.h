// acceptor.h -- the sockets on which a daemon listens. It takes the connections that come, and hands them over.
//
// When the process has used all descriptors, a spare one lets it take one more connection. Either another one makes room for
// it, or it is told that the daemon is full.
//
// Threads: with the ServerLock held; takeWaiting is for the health responder's thread.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "comm/reactor.h"
#include "comm/serverLock.h"
#include "comm/transport.h"

namespace sorma {

class Acceptor {
public:
    // came: gets each connection. scarce: there is no other free descriptor.
    Acceptor(Reactor& reactor, ServerLock& lock, std::function<void(Line line, bool scarce)> came);
    ~Acceptor();

    void add(ListeningSocket socket);
    void close();                                       // listen no more
    bool at(const Address& address) const;              // does the address lead to one of the sockets?
    // Take connections from sockets of those watchers, as long as room() is true. One without room waits for the SORM's thread.
    // vouched: as Transport has it.
    void takeWaiting(const std::vector<void*>& watchers, const std::function<bool(bool vouched)>& room);

private:
    class Listener;
    void take(Listener& listener);

    Reactor& reactor_;
    ServerLock& lock_;
    const std::function<void(Line line, bool scarce)> came_;
    std::vector<std::unique_ptr<Listener>> listeners_;
    Timer pause_;                       // a listener is not watched until then
    Descriptor spare_;
};

}  // namespace sorma
