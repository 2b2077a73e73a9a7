// resolver.h -- says where a name leads, and never waits.
//
// The dictionary, the runtime folder and numeric addresses are read at once. The name of a host, or the rpcbind of another
// host, is looked up by a thread; until it has answered, the state is asking. Answers are kept for 60 s, failures for 10 s.
//
// Threads: belongs to the thread of its SORM. There are at most 16 look-up threads at a time. They share their answers with
//          the resolver, and may outlive it.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "bus/loop.h"
#include "bus/name.h"

namespace sorma {

class ChosenDirectory;
class Dictionary;

struct Resolution {
    enum class State { here, known, asking, unresolved };       // here: in this process
    State state = State::unresolved;
    std::string service;            // name of the object, as its process knows it
    std::string where;              // what stands after @; without @, what the entry of its class says
    Address address;                // as the dictionary says
    Address target;                 // when known: a path, or a numeric host and a port
    std::string why;                // when asking or unresolved: the reason, for people
};

class Resolver {
public:
    // dictionary: must outlive this.   serves: does this process serve that socket, or that port of its own host?
    // mailbox: look-up threads post to it.
    // directory: must outlive this.
    Resolver(const Dictionary& dictionary, ChosenDirectory& directory, std::function<bool(const Address& target)> serves, std::shared_ptr<Mailbox> mailbox);
    ~Resolver();

    // name: of an object, or @WHERE alone. Fails with NAME SYNTAX; every other failure is a state.
    Resolution find(std::string_view name);
    // Called from the loop when a look-up is done: call find() again. May be empty.
    std::function<void()> changed;

private:
    struct Shared;                  // answers, shared with the threads
    Resolution followed(const Address& address);

    const Dictionary& dictionary_;
    ChosenDirectory& directory_;
    std::function<bool(const Address&)> serves_;
    std::shared_ptr<Shared> shared_;
};

}  // namespace sorma
