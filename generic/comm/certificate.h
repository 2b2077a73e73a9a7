// certificate.h -- certificates as people read them, and which are revoked. Only the files of tls include it, and what tries and measures them.
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
std::string withoutClock(std::string text);             // without hints: the same text tomorrow
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

// Puts the authorities of keys.h there. Returns the fingerprint of our own; empty: there is none.
std::string trust(X509_STORE* store);

// Which certificates are revoked, by the files of keys.h. A list counts for the authority that has signed it, and for no other.
class Revocations {
public:
    // By the files as they are now. A file that cannot be used leaves what it said before, see trouble(). Fails with TLS KEY when
    // nothing is known from before: crl.pem holds no list, or one that no authority has signed which this host knows.
    static std::shared_ptr<const Revocations> now(const std::string& who);
    bool has(X509* one) const;
    const std::string& trouble() const { return trouble_; }     // what is wrong with the files; empty: nothing

private:
    Revocations(const std::string& who, const Revocations* before, std::string stamp);
    std::string readNames();            // what is wrong; empty: nothing
    std::string readLists();
    struct List {
        std::unique_ptr<X509_CRL, Freed<X509_CRL_free>> list;
        Certificate authority;
    };
    std::string stamp_, trouble_;       // stamp_: keys::stamp()
    std::set<std::string> named_;       // by name, or serial number
    std::shared_ptr<const std::vector<List>> lists_;
};

}  // namespace sorma::tls
