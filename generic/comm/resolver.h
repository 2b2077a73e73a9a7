// resolver.h -- where a name leads, without ever waiting for anybody.
//
// What needs no one else is answered at once: the dictionary, the runtime folder, numbers. A host's name, or another host's
// rpcbind, is looked up by a thread, and the answer kept for a while; until it is there, the state is asking.
//
// Threads: belongs to the thread of its SORM. The threads that look up have their own share of what is known, and may end later.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "bus/loop.h"
#include "bus/name.h"

namespace sorma {

class Dictionary;

struct Place {
    enum class State { here, known, asking, unresolved };
    State state = State::unresolved;
    std::string service, where;     // the name as its process knows it; what stands after @, or what its class's entry says
    Address address;                // as the dictionary says
    Address target;                 // known: a path, or a number and a port
    std::string why;                // not known: why not
};

class Resolver {
public:
    // serves: does this process serve that socket, or that port of its own host? changed: called, by the loop, when a look-up is done.
    Resolver(const Dictionary& dictionary, std::function<bool(const Address& target)> serves, std::shared_ptr<Mailbox> mailbox);
    ~Resolver();

    // name: of an object, or @WHERE alone. Fails with NAME SYNTAX.
    Place find(std::string_view name);
    std::function<void()> changed;

private:
    struct Shared;
    Place followed(const Address& address);

    const Dictionary& dictionary_;
    std::function<bool(const Address&)> serves_;
    std::shared_ptr<Shared> shared_;
};

}  // namespace sorma
