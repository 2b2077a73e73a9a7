// comm.h -- COMM of one SORM: its connections, proxies and servers.
//
//     sorma::Sorm sorm;
//     sorma::Comm comm(sorm);                         // now names with @ work
//     comm.serve({.name = "robot"});                  // and now this process is a daemon
//     for (;;) comm.reactor().poll(-1);
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "bus/sorm.h"
#include "comm/connection.h"
#include "comm/serverLock.h"
#include "comm/proxy.h"
#include "comm/reactor.h"
#include "comm/resolver.h"
#include "comm/server.h"
#include "comm/settings.h"
#include "comm/healthResponder.h"

namespace sorma {

class FolderWatch;

class Comm {
public:
    explicit Comm(Sorm& sorm);      // the SORM must outlive it
    ~Comm();
    Comm(const Comm&) = delete;
    Comm& operator=(const Comm&) = delete;

    Settings& settings;
    Reactor& reactor() { return *reactor_; }

    // Fails with COMM REFUSED when the name is served already, COMM DENIED without permission.
    Server& serve(const Server::Wanted& wanted);
    void unserve(std::string name, const std::string& reason);       // fails with SERVICE GONE
    Server* findServer(const std::string& name);
    const std::map<std::string, std::unique_ptr<Server>>& servers() const { return servers_; }
    // To be called when an event loop is entered while a request is executed (as Server::handBack).
    void handBack() {
        for (auto& [name, server] : servers_) server->handBack();
    }

    // The program ends: send the one-way requests that wait, for a second (Settings::onewayWait), and say what could not be sent.
    void finish();

    // A daemon found in the runtime folder.
    struct Found {
        std::string name, socket, state;        // state: "alive", "busy", "dead" (its socket is left over), or what is wrong
        std::string identity;                   // user@host program[process] of a live one
        std::string what;                       // in which a busy one is busy
    };
    std::vector<Found> daemons();

    // Where a name leads; never waits.
    Resolver& resolver() { return resolver_; }
    // A line of its own to one daemon, for those who look on: it is shared with no proxy, and never waits for a moment
    // (Connection::inBackground). where: what stands after @.
    std::shared_ptr<Connection> privateLine(const std::string& where);

private:
    Comm(Sorm& sorm, std::shared_ptr<Settings> settings);
    std::unique_ptr<Service> makeProxy(const Name& name, std::vector<std::string> recipe, const PrincipalPointer& relayFor);
    std::shared_ptr<Connection> lineTo(const Name& name);       // as the dictionary says now; null when it says here
    std::string facts(std::string_view what);
    bool servesAt(const Address& address) const;

    Sorm& sorm_;
    const std::shared_ptr<Settings> shared_;    // with connections and proxies, which may outlive us
    std::shared_ptr<Reactor> reactor_;          // shared with connections, which their proxies keep
    ServerLock lock_;                     // to servers_ and ended_, and all that they have
    std::map<std::string, std::unique_ptr<Server>> servers_;
    std::vector<std::unique_ptr<Server>> ended_;        // unserved while one of their own requests was on the stack
    std::map<std::string, std::weak_ptr<Connection>> connections_;      // by "RULE ADDRESS", see resolve
    Resolver resolver_;
    std::unique_ptr<FolderWatch> folder_;                       // of those who listen to TCP, while there is one
    std::unique_ptr<HealthResponder> healthResponder_;                        // while there is a server
    std::shared_ptr<Comm*> self_ = std::make_shared<Comm*>(this);       // for proxies, likewise
};

}  // namespace sorma
