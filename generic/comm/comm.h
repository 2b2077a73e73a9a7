// comm.h -- COMM is the network part of one SORM: its connections, proxies and servers.
//
//     sorma::Sorm sorm;
//     sorma::Comm comm(sorm);                         // now names with @ work
//     comm.serve({.name = "robot"});                  // and now this process is a daemon
//     for (;;) comm.reactor().poll(-1);
//
// The files of this folder, from the caller to the service. Files in brackets help those before them:
//
//     where a daemon is            resolver directory [runtimeFolder siblings rpcbind]
//     the way of a request         proxy > connection > calls oneways events > slots > link
//     what stands in the bytes     record wire xdr sorma.x [wireSpan lateTrace]
//     how bytes travel             transport: tcp unix inherited shm [ring spinner lookout]
//                                  tls [keys certificate tlsProbe tlsErrors tlsWithout]
//     a daemon's connections       server: acceptor > peer > requests > sessions > subscription
//                                  [shares: whose turn it is] [ownership: objects of the name's owner alone]
//     while a daemon is busy       healthResponder [serverLock]
//     for all of them              comm reactor settings errors clock random
//
// Threads: belongs to the thread of its SORM. While there is a server, a health responder thread runs beside it.
// Owner:   Comm owns its servers. Proxies share the connections and may outlive Comm.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "bus/sorm.h"
#include "comm/connection.h"
#include "comm/directory.h"
#include "comm/ownership.h"
#include "comm/serverLock.h"
#include "comm/proxy.h"
#include "comm/reactor.h"
#include "comm/resolver.h"
#include "comm/server.h"
#include "comm/settings.h"
#include "comm/healthResponder.h"

namespace sorma {

class FolderWatch;

class Comm : public Network {
public:
    explicit Comm(Sorm& sorm);      // the SORM must outlive it
    ~Comm() override;
    Comm(const Comm&) = delete;
    Comm& operator=(const Comm&) = delete;

    Settings& settings;
    Reactor& reactor() { return *reactor_; }
    const std::shared_ptr<Reactor>& sharedReactor() { return reactor_; }

    // Make this process a daemon of that name. Fails with NAME SYNTAX, COMM REFUSED when the name is served already or an
    // address is taken, COMM DENIED without permission. DIRECTORY SILENT: the directory has not granted the name in 5 s. The server stays until unserve() or the end of Comm, which owns it.
    Server& serve(const Server::Wanted& wanted);
    // For a standby daemon: await() once, then serveIfFree() whenever something has happened, and each half second. Null: another
    // daemon has the name, or nobody can say whose it is. Otherwise both fail as serve(); SERVICE GONE: unserve() was called before.
    void await(const Server::Wanted& wanted);
    Server* serveIfFree(const Server::Wanted& wanted);
    // Stop serving the name, as Server::stop(reason), or awaiting it. Fails with SERVICE GONE when it is not served.
    void unserve(std::string name, const std::string& reason);
    Server* findServer(const std::string& name);        // null: there is none
    const std::map<std::string, std::unique_ptr<Server>>& servers() const { return servers_; }
    // Call it when an event loop is entered while a request is executed (as Server::handBack).
    void handBack() {
        for (auto& [name, server] : servers_) server->handBack();
    }

    // Called from the loop with what is wrong with a daemon of this process, and is nobody's request. May be empty.
    std::function<void(const Entry& what)> trouble;

    // At the end of the program: send the one-way requests that wait. Blocks for at most Settings::onewayWait (1 s) for each
    // connection, and writes to stderr what could not be sent.
    void finish();

    // A daemon found in the runtime folder, or in the directory of many hosts.
    struct Found {
        std::string name, socket, state;        // state: "alive", "busy", "dead" (it left its socket), "listed", or what is wrong
        std::string identity;                   // user@host program[process] of a live one
        std::int64_t process = 0;               // its number; 0: it did not answer
        std::string what;                       // what a busy one is doing
    };
    // Asks each of them in the runtime folder, for at most 0.5 s; blocks. Those of the directory are not asked: their state is "listed", and
    // socket is their best address. Removes the socket of a dead one. Fails with COMM DENIED without
    // permission.
    std::vector<Found> daemons();

    // The names of the daemons with which this process has a connection, and of those in the runtime folder. Asks nobody.
    std::vector<std::string> known() const;

    // The directory of names, as the dictionary says.
    ChosenDirectory& directory() { return directory_; }
    // Says where a name leads; never waits.
    Resolver& resolver() { return resolver_; }
    // A connection to one daemon for observers. It is shared with no proxy, and begin() on it never blocks
    // (Connection::inBackground). where: what stands after @.
    std::shared_ptr<Connection> privateLine(const std::string& where);

private:
    Comm(Sorm& sorm, std::shared_ptr<Settings> settings);
    const Class& proxyClass() const override { return *proxyClass_; }
    std::unique_ptr<Service> makeProxy(const Name& name, std::vector<std::string> recipe, const PrincipalPointer& relayFor, Probe probe) override;
    void outdated() override;
    std::vector<std::string> served() const override;
    std::string connectionLines() const override;
    std::string statisticsLines() const override;
    Figures figures() const override;
    std::string daemonLines() override;
    std::string connectionRows() const override;
    std::vector<std::string> directoryNames() override;
    std::string whereLines(const std::string& name) override;
    std::string siblingRows() const override;
    std::vector<unsigned char> lateSpans(TraceNumber number, const PrincipalPointer& author) const override;
    std::shared_ptr<Directory> heardDirectory(std::int64_t milliseconds);
    void claim(Server& server, const Server::Wanted& wanted);
    // From now on the objects that it declares owned obey the owner of its name alone, until the name is served anew. Returns Fence::serial.
    std::uint64_t fence(const Server::Wanted& wanted, const Directory::Entry& self);
    bool taken(const std::string& name);        // by another daemon, or nobody knows
    void checkServable(const std::string& name);
    void directoryChanged();
    // The address of an alias, as the directory says. Fails with DIRECTORY ASKED while it has not answered, ADDRESS UNRESOLVED.
    Address placed(const Address& address);
    void heedEpochs();
    std::shared_ptr<std::int64_t> epochOf(const Address& address);       // shared by the connections to an alias
    // The connection for a name, as the dictionary says now; null when the object is in this process.
    std::shared_ptr<Connection> lineTo(const Name& name);
    bool servesAt(const Address& address) const;            // is that address one of our servers?

    Sorm& sorm_;
    const std::shared_ptr<Class> proxyClass_;
    const std::shared_ptr<Settings> shared_;    // shared with connections and proxies, which may outlive us
    std::shared_ptr<Reactor> reactor_;          // shared with connections
    ServerLock lock_;                     // guards servers_ and stopped_, and all that they own
    std::map<std::string, std::unique_ptr<Server>> servers_;
    std::vector<std::unique_ptr<Server>> stopped_;        // unserved while one of their own requests was on the stack
    std::size_t sweepAt_ = 64;              // connections_ has so many: forget those that are no more
    std::map<std::string, std::weak_ptr<Connection>> connections_;      // by "RULE ADDRESS", see resolve in bus/name.h
    ChosenDirectory directory_;
    std::map<std::string, std::shared_ptr<Directory>> claims_;  // by name: where our daemons own theirs
    std::map<std::string, std::unique_ptr<Ownership>> ownerships_;  // by name: also of names that are not served any more
    struct Standby {
        std::int64_t next = 0;              // [ns] when to try again, after it was in vain
        std::string why = {};               // it was in vain
        bool told = false;                  // that reason
    };
    std::map<std::string, Standby> standbys_;                   // by name
    std::map<std::string, std::weak_ptr<std::int64_t>> epochs_; // by alias: of its owner, as the directory has told it
    bool tells_ = false;                                        // that the directory has changed, in the next turn
    Resolver resolver_;
    std::unique_ptr<FolderWatch> folder_;                       // of .tcp files, once a server listens to TCP
    std::unique_ptr<HealthResponder> healthResponder_;                        // since there is a server
    std::shared_ptr<Comm*> self_ = std::make_shared<Comm*>(this);       // proxies have weak ones: we may be deleted first
};

}  // namespace sorma
