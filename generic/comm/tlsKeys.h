// tlsKeys.h -- keys that are loaded: a context of OpenSSL with our certificate, and the tickets of its lines. Only tls.cpp includes it.
//
// Threads: any.
#pragma once

#include <openssl/ssl.h>

#include <memory>
#include <string>

#include "comm/certificate.h"
#include "comm/tlsTickets.h"

namespace sorma::tls {

// Connections keep theirs when the files change.
struct Keys {
    std::unique_ptr<SSL_CTX, Freed<SSL_CTX_free>> context;
    std::string own, stamp, authority;  // the name, keys::stamp(), fingerprint of our own authority
    Certificate certificate;
    Tickets tickets;

    std::string file() const;
};
using KeysPointer = std::shared_ptr<Keys>;

// Those of the files as they are now. Fails with TLS MISSING, KEY, EXPIRED, NOTYET.
// daemon: whose; empty: a client's.   prepare: completes a context before our certificate is put there.
KeysPointer keysOf(const std::string& daemon, const std::string& who, void (*prepare)(SSL_CTX*));

std::string errorText();                // why the last function of OpenSSL has failed

}  // namespace sorma::tls
