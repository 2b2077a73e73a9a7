// network.h -- what a SORM asks of COMM, which reaches other processes. A program may have none.
//
// Threads: the SORM's.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "bus/principal.h"
#include "bus/span.h"

namespace sorma {

class Class;
class Service;
struct Name;

// When is the daemon asked whether it has the object of a name? now: when the object gets its proxy, which blocks. later: by
// the first request.
enum class Probe { now, later };

class Network {
public:
    // Counts of all daemons of this process: connections and sessions now, the others so far.
    struct Figures {
        std::uint64_t connections = 0, sessions = 0;
        std::uint64_t served = 0, refused = 0, dropped = 0, eventsLost = 0;     // requests; connections; one-way requests
    };
    virtual ~Network() = default;
    virtual const Class& proxyClass() const = 0;
    // Make the proxy of a remote object.   recipe: this client's recipe for the object; the proxy sends it to the daemon as
    // CTRL.   relayFor: who named the object, when it was not the owner.
    virtual std::unique_ptr<Service> makeProxy(const Name& name, std::vector<std::string> recipe, const PrincipalPointer& relayFor, Probe probe) = 0;

    // Rights, classes or names are others than before: tell those who check requests ahead (bus/ahead.h).
    virtual void outdated() {}

    // For DBX of the object `sorm`.
    virtual std::vector<std::string> served() const = 0;                // names of the daemons that this process is
    virtual std::string connectionLines() const = 0;                    // for people: its connections,
    virtual std::string statisticsLines() const = 0;                    // the daemons that it is,
    virtual Figures figures() const = 0;
    virtual std::string daemonLines() = 0;                              // and those of this user, which takes a while
    virtual std::string connectionRows() const = 0;                     // for programs: lists, each of words
    // The spans of a trace that no reply brings, as that author may see them: for comm/lateTrace.h.
    virtual std::vector<unsigned char> lateSpans(TraceNumber number, const PrincipalPointer& author) const = 0;
    virtual std::vector<std::string> directoryNames() = 0;             // names in the directory of many hosts, as far as it has told them
    virtual std::string whereLines(const std::string& name) = 0;        // for people: how a name is resolved; waits for 2 s at most
    virtual std::string siblingRows() const = 0;                        // daemons of this user that listen to TCP: {name host port} ...
};

}  // namespace sorma
