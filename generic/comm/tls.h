// tls.h -- the transport tls: RPC with TLS (RFC 9289) over TCP. No other file calls OpenSSL.
//
//     client: probe (NULL with AUTH_TLS) >                    > handshake > records of ONC RPC, encrypted
//     daemon:                              answer (STARTTLS) >
//
// Both ends show a certificate, TLS is 1.3, ALPN is sunrpc. The daemon's certificate must have the name by which the client calls
// it: the alias, or the host as it is written in the address. A client trusts the authorities of keys.h and no
// others. A daemon that was reached with TLS once is pinned by that name: it is never spoken to in clear again.
//
// A client that wants TLS sends the probe in clear and nothing else. A probe that is not answered as it should be ends the attempt.
//
// Errors, all of them final, since another attempt is of no use:
//
//     TLS EXPIRED, NOTYET, REVOKED, NAME, AUTHORITY    a certificate
//     TLS MISSING       there is none
//     TLS KEY           a file cannot be used
//     TLS REFUSED       the handshake has failed otherwise
//     TLS PLAIN         the daemon speaks in clear alone
//     TLS STRIPPED      so does one that was reached with TLS before
//     TLS PINNED        -tls no for such a one
//
// Without OpenSSL all that wants TLS fails with TLS REFUSED; nothing becomes clear by that.
//
// Threads: as transport.h.
#pragma once

#include <functional>
#include <string>

#include "bus/name.h"
#include "bus/trail.h"
#include "comm/transport.h"

namespace sorma::tls {

// The row for an attempt to reach an address; row when it is to be in clear.   who: as Transport::begin. Fails with TLS PINNED, KEY,
// MISSING, EXPIRED, NOTYET.
const Transport& rowFor(const Transport& row, const Address& address, const std::string& who);

// Is the certificate with this name, organisation and serial number revoked?
using Revoked = std::function<bool(const std::string& name, const std::string& organisation)>;
struct Offer {
    std::string daemon;                 // its name: which certificate it shows
    Revoked revoked;                    // besides keys.h; called in the thread that upgrades the line
};
// Load the keys of a daemon now, so that what is wrong with them is told at once. Fails with TLS KEY, MISSING, EXPIRED, NOTYET.
void check(const std::string& daemon);
// A line by TCP on which the other end may ask for TLS before anything else. offer: must outlive the line.
Line offered(Line line, const Offer& offer);
bool secure(const Line& line);          // is it encrypted?
// Says why the certificate at the other end of a secure line does not hold any more; empty: it does.
using Judge = std::function<std::string(const Line& line)>;
// Looks at the files of keys, once for all lines of a daemon.
Judge judge(const Offer& offer);
// The trouble with the keys of a daemon that runs: new lines have to do without TLS, or a file of revoked certificates holds what it said before. Empty:
// there is none.
std::string trouble(const Offer& offer);
// Warnings of a client whose line is up, each once in a process: TLS KEY.   who: the name that they begin with.
Trail remarks(const Line& line, const std::string& who);

}  // namespace sorma::tls
