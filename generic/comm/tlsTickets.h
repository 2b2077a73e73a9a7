// tlsTickets.h -- sessions of TLS that may be resumed. Only tlsKeys.h includes it.
//
// A client keeps the ticket of a daemon until its next line there. A daemon keeps the session, and its ticket is a number. If the ticket held all of
// the session, it would hold the client's certificate. OpenSSL needs as long to read that as for all the rest of such a handshake. And one key would
// open the tickets of all clients. Each ticket is used once.
//
// Both keep kMost of them. The eldest session of a daemon goes first. Without a ticket a client makes a full handshake.
//
// Threads: any.
#pragma once

#include <openssl/ssl.h>

#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "comm/certificate.h"

namespace sorma::tls {

using Session = std::unique_ptr<SSL_SESSION, Freed<SSL_SESSION_free>>;

class Tickets {
public:
    // A client's, by the name and address of the daemon. take: empty when there is none.
    void keep(const std::string& daemon, Session session) {
        std::lock_guard lock(mutex_);
        if (ours_.size() >= kMost) ours_.clear();
        ours_[daemon] = std::move(session);
    }
    Session take(const std::string& daemon) {
        std::lock_guard lock(mutex_);
        auto found = ours_.extract(daemon);
        return found ? std::move(found.mapped()) : Session();
    }

    // A daemon's, by the number. use: empty when there is none.
    void give(const std::string& number, Session session) {
        std::lock_guard lock(mutex_);
        for (; order_.size() >= kMost; order_.pop_front()) given_.erase(order_.front());
        order_.push_back(number);
        given_[number] = std::move(session);
    }
    Session use(const std::string& number) {
        std::lock_guard lock(mutex_);
        auto found = given_.extract(number);
        return found ? std::move(found.mapped()) : Session();
    }

private:
    static constexpr std::size_t kMost = 256;

    std::mutex mutex_;
    std::map<std::string, Session> ours_, given_;
    std::deque<std::string> order_;     // numbers of given_, the eldest first, and of some that are used
};

}  // namespace sorma::tls
