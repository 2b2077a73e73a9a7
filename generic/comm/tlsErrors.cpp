#include "comm/tlsErrors.h"

#include <openssl/ssl.h>

#include "comm/certificate.h"
#include "comm/keys.h"

namespace sorma::tls {

std::string complaint(Fault fault, const X509* one, bool client, const std::string& wanted, const std::string& detail) {
    const std::string subject = one ? subjectOf(one) : "?", name = one ? nameOf(one) : "";
    const std::string issuer = one ? std::string(" of serial number ") + serialOf(one) : "";
    const std::string there = client ? "the daemon's certificate (" + subject + issuer + ")" : "the client's certificate (" + subject + issuer + ")";
    switch (fault) {
        case Fault::expired:
            return there + " has expired on " + timeText(one ? X509_get0_notAfter(one) : nullptr) + clockHint() + "; where the authority is: sorma-keys new " + name;
        case Fault::notYet:
            return there + " holds from " + timeText(one ? X509_get0_notBefore(one) : nullptr) + clockHint() + "; set the clock that is wrong";
        case Fault::revoked:
            return there + " is revoked (a line revoke of the policy, or " + keys::file("revoked") + ", crl.pem); where the authority is: sorma-keys new " + name;
        case Fault::name:
            return there + " is not made for the name \"" + wanted + "\"; is the address right? A daemon is called by the name in its certificate: write @" +
                       (name.empty() ? "NAME" : name) + " and its address into the dictionary";
        default:
            return there + " is signed by no authority that this host knows (" + detail + "), " + keys::file("authority.pem") +
                       "; keys of one authority are given by: sorma-keys give NAME FILE";
    }
}

void failFault(Fault fault, const std::string& who, const std::string& text) {
    switch (fault) {
        case Fault::expired: fail(kExpired, who, text);
        case Fault::notYet: fail(kNotYet, who, text);
        case Fault::revoked: fail(kRevoked, who, text);
        case Fault::name: fail(kName, who, text);
        default: fail(kAuthority, who, text);
    }
}

void failAlert(const Shown& own, int alert, const std::string& who) {
    X509* one = own.certificate;
    const std::string other = own.client ? "the daemon" : "the client", ours = "our certificate " + own.file + " (" + subjectOf(one) + ")";
    const std::string again = "; where the authority is: sorma-keys new " + nameOf(one);
    switch (alert) {
        case SSL_AD_CERTIFICATE_EXPIRED:
            failFault(Fault::expired, who, other + " says that " + ours + ", which holds until " + timeText(X509_get0_notAfter(one)) + ", has expired: is its clock right?" + clockHint() + again);
        case SSL_AD_CERTIFICATE_REVOKED: failFault(Fault::revoked, who, other + " says that " + ours + " is revoked" + again);
        case SSL_AD_UNKNOWN_CA: failFault(Fault::authority, who, other + " does not know the authority of " + ours + "; both ends need keys of one authority: sorma-keys give NAME FILE, there: sorma-keys take FILE");
        case SSL_AD_CERTIFICATE_REQUIRED: fail(kMissing, who, other + " wants a certificate, and was shown none");
        case SSL_AD_BAD_CERTIFICATE:
            if (own.client) failFault(Fault::notYet, who, other + " does not take " + ours + ", which holds from " + timeText(X509_get0_notBefore(one)) + ": is its clock right?" + clockHint());
            failFault(Fault::name, who, other + " does not take " + ours + ": it calls this daemon by another name, or its clock is wrong");
        default: fail(kRefused, who, other, std::string(SSL_alert_desc_string_long(alert)) + ", it says");
    }
}

std::string unpinned(const std::string& why) {
    return why.empty() ? why : "that the daemon speaks TLS cannot be written down (" + why + "); so nobody would notice when somebody between takes TLS away; make the file writable";
}

}  // namespace sorma::tls
