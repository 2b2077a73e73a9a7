// visitor.h -- the name in the certificate of a client, for a line with TLS that another library holds. sorma-web has such lines.
//
// The library does the handshake, which proves that the other end has the key of its certificate. Here that certificate is judged, by the
// files of keys.h as they are now. Only the authority of our own keys counts: one that is merely trusted gives names that may be those of ours.
//
// Without OpenSSL it fails with TLS REFUSED.
//
// Threads: any.
#pragma once

#include <string>

namespace sorma::tls {

// The name in a certificate (DER) of a client.   who: begins the error.   Fails with TLS EXPIRED, NOTYET, REVOKED, NAME, AUTHORITY; KEY.
std::string visitor(const std::string& certificate, const std::string& who);

}  // namespace sorma::tls
