// certificate.h -- certificates as people read them, and what may be wrong with one. Only tls.cpp includes it.
//
// Threads: any.
#pragma once

#include <openssl/x509.h>

#include <cstdint>
#include <memory>
#include <set>
#include <string>
#include <vector>

namespace sorma::tls {

template <auto Free> struct Freed {
    template <class T> void operator()(T* t) const { Free(t); }
};
using Certificate = std::unique_ptr<X509, Freed<X509_free>>;

std::vector<Certificate> readCertificates(const std::string& path);     // empty: there are none, or there is no file
std::string timeText(const ASN1_TIME* time);
std::string clockHint();                                // what the clock says here
// The organisation, or another part of the subject; what is no letter, digit, _ - or . is shown as ?
std::string part(const X509* of, int nid);
// The name for which it was made: the first DNS name, else the common name. Empty: it has none that we take.
std::string nameOf(const X509* of);
std::string subjectOf(const X509* of);                  // NAME@ORGANISATION
std::string serialOf(const X509* of);                   // hexadecimal
// Names a public key: so an authority is known again whose certificate was made anew.
std::string fingerprint(X509* of);
bool tooEarly(const X509* one);                         // does it hold from a time that is further ahead than clocks may differ?
// Fails with TLS EXPIRED, NOTYET for our own certificate.
void checkDates(const X509* one, const std::string& file, const std::string& who);

// Which certificates are revoked, by the files of keys.h as they were when this was made. A list counts for the authority that has
// signed it, and for no other.
class Revocations {
public:
    // Fails with TLS KEY when crl.pem holds no list, or one that no authority has signed which this host knows.
    explicit Revocations(const std::string& who);
    bool has(X509* one) const;

private:
    struct List {
        std::unique_ptr<X509_CRL, Freed<X509_CRL_free>> list;
        Certificate authority;
    };
    std::set<std::string> named_;       // by name, or serial number
    std::vector<List> lists_;
};

enum class Fault : std::uint8_t { none, expired, notYet, revoked, name, authority };
// Says what is wrong with the certificate at the other end.   client: we are the client; wanted: then the name of the daemon.   detail: of
// an authority, what OpenSSL says.
std::string complaint(Fault fault, const X509* one, bool client, const std::string& wanted, const std::string& detail);
// With the code of the fault.
[[noreturn]] void failFault(Fault fault, const std::string& who, const std::string& text);

}  // namespace sorma::tls
