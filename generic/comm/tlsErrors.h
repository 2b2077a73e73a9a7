// tlsErrors.h -- what is said when TLS with somebody fails: see the codes in tls.h. Only the files of tls include it.
//
// Threads: any.
#pragma once

#include <openssl/x509.h>

#include <cstdint>
#include <string>

#include "bus/catalogue.h"

namespace sorma::tls {

inline const Prototype kRefused{Severity::error, "TLS REFUSED", 1, "{}: no TLS with {}: {}; nothing was sent in clear"};
inline const Prototype kMissing{Severity::error, "TLS MISSING", 1, "{}: {}"};
inline const Prototype kFiles{Severity::warning, "TLS KEY", 1, "{}: {}"};
inline const Prototype kKey{Severity::error, "TLS KEY", 1, "{}: the key file {} cannot be used: {}"};
inline const Prototype kPlain{Severity::error, "TLS PLAIN", 1,
    "{}: {} speaks in clear alone; nothing was sent to it; let it have keys (sorma-keys give), or write -tls no after its address in the dictionary"};
inline const Prototype kStripped{Severity::error, "TLS STRIPPED", 1,
    "{}: {} has spoken TLS since {}, and now its answer says that it cannot: somebody between may have changed it; nothing was sent in clear; if it is "
    "meant: sorma-keys forget {}"};
inline const Prototype kExpired{Severity::error, "TLS EXPIRED", 1, "{}: {}"};
inline const Prototype kNotYet{Severity::error, "TLS NOTYET", 1, "{}: {}"};
inline const Prototype kRevoked{Severity::error, "TLS REVOKED", 1, "{}: {}"};
inline const Prototype kName{Severity::error, "TLS NAME", 1, "{}: {}"};
inline const Prototype kAuthority{Severity::error, "TLS AUTHORITY", 1, "{}: {}"};

enum class Fault : std::uint8_t { none, expired, notYet, revoked, name, authority };
// Says what is wrong with the certificate at the other end.   client: we are the client; wanted: then the name of the daemon.   detail: of
// an authority, what OpenSSL says.
std::string complaint(Fault fault, const X509* one, bool client, const std::string& wanted, const std::string& detail);
// With the code of the fault.
[[noreturn]] void failFault(Fault fault, const std::string& who, const std::string& text);

// The certificate that the other end has seen.
struct Shown {
    bool client;                        // are we the client?
    X509* certificate;
    std::string file;
};
// The other end has sent this alert.
[[noreturn]] void failAlert(const Shown& own, int alert, const std::string& who);
// A client's warning that a daemon could not be pinned.   why: as keys::pin(); empty: it was, and so is the result.
std::string unpinned(const std::string& why);

}  // namespace sorma::tls
