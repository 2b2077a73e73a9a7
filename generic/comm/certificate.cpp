#include "comm/certificate.h"

#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>

#include <algorithm>
#include <ctime>

#include "bus/catalogue.h"
#include "bus/kept.h"
#include "comm/keys.h"

namespace sorma::tls {

namespace {

constexpr time_t kSkew = 300;                           // [s] by which clocks may differ when a certificate is new

const Prototype kExpired{Severity::error, "TLS EXPIRED", 1, "{}: {}"};
const Prototype kNotYet{Severity::error, "TLS NOTYET", 1, "{}: {}"};
const Prototype kRevoked{Severity::error, "TLS REVOKED", 1, "{}: {}"};
const Prototype kList{Severity::error, "TLS KEY", 1,
    "{}: {} cannot be used: {}; nobody can say now who is revoked; put a list of your authority there, or remove the file"};
const Prototype kName{Severity::error, "TLS NAME", 1, "{}: {}"};
const Prototype kAuthority{Severity::error, "TLS AUTHORITY", 1, "{}: {}"};

using Stream = std::unique_ptr<BIO, Freed<BIO_free>>;

std::string nowText() {
    const time_t now = time(nullptr);
    struct tm parts;
    char text[32];
    strftime(text, sizeof text, "%Y-%m-%d %H:%M UTC", gmtime_r(&now, &parts));
    return text;
}

bool goodName(std::string_view name) {
    return !name.empty() && name.size() <= kKeptName && std::all_of(name.begin(), name.end(), [](unsigned char c) {
        return (c < 128 && std::isalnum(c)) || c == '_' || c == '-' || c == '.';
    });
}

}  // namespace

std::string timeText(const ASN1_TIME* time) {
    struct tm parts {};
    char text[32] = "?";
    if (time && ASN1_TIME_to_tm(time, &parts)) strftime(text, sizeof text, "%Y-%m-%d %H:%M UTC", &parts);
    return text;
}

// The last one of this kind.
std::string part(const X509* of, int nid) {
    const X509_NAME* subject = X509_get_subject_name(of);
    int at = -1;
    for (int next; (next = X509_NAME_get_index_by_NID(const_cast<X509_NAME*>(subject), nid, at)) >= 0;) at = next;
    if (at < 0) return {};
    unsigned char* text = nullptr;
    const int size = ASN1_STRING_to_UTF8(&text, X509_NAME_ENTRY_get_data(X509_NAME_get_entry(subject, at)));
    std::string out = size > 0 ? std::string(reinterpret_cast<char*>(text), std::size_t(std::min(size, 200))) : std::string();
    OPENSSL_free(text);
    for (char& c : out)
        if (!goodName({&c, 1})) c = '?';
    return out;
}

std::string nameOf(const X509* of) {
    std::string name;
    auto* all = static_cast<GENERAL_NAMES*>(X509_get_ext_d2i(of, NID_subject_alt_name, nullptr, nullptr));
    for (int i = 0; all && name.empty() && i < sk_GENERAL_NAME_num(all); ++i) {
        const GENERAL_NAME* one = sk_GENERAL_NAME_value(all, i);
        if (one->type != GEN_DNS) continue;
        const ASN1_STRING* text = one->d.dNSName;
        name.assign(reinterpret_cast<const char*>(ASN1_STRING_get0_data(text)), std::size_t(ASN1_STRING_length(text)));
    }
    GENERAL_NAMES_free(all);
    if (name.empty()) name = part(of, NID_commonName);
    return goodName(name) ? name : std::string();
}

std::string subjectOf(const X509* of) {
    std::string name = nameOf(of), organisation = part(of, NID_organizationName);
    if (name.empty()) name = part(of, NID_commonName);
    return (name.empty() ? "?" : name) + (organisation.empty() ? "" : "@" + organisation);
}

std::string serialOf(const X509* of) {
    BIGNUM* number = ASN1_INTEGER_to_BN(X509_get0_serialNumber(of), nullptr);
    char* text = number ? BN_bn2hex(number) : nullptr;
    std::string out = text ? text : "";
    OPENSSL_free(text);
    BN_free(number);
    return out;
}

std::string fingerprint(X509* of) {
    unsigned char digest[EVP_MAX_MD_SIZE];
    unsigned size = 0;
    if (!X509_pubkey_digest(of, EVP_sha256(), digest, &size)) return {};
    std::string out;
    for (unsigned i = 0; i < size; ++i) {
        constexpr char kDigits[] = "0123456789abcdef";
        out += kDigits[digest[i] >> 4];
        out += kDigits[digest[i] & 15];
    }
    return out;
}

std::string clockHint() { return " (the clock here says " + nowText() + ": is it right?)"; }

std::vector<Certificate> readCertificates(const std::string& path) {
    std::vector<Certificate> all;
    Stream in(BIO_new_file(path.c_str(), "r"));
    while (X509* one = in ? PEM_read_bio_X509(in.get(), nullptr, nullptr, nullptr) : nullptr) all.emplace_back(one);
    ERR_clear_error();
    return all;
}

bool tooEarly(const X509* one) {
    time_t latest = time(nullptr) + kSkew;
    return X509_cmp_time(X509_get0_notBefore(one), &latest) > 0;
}

// What is wrong with our own certificate by our own clock.
void checkDates(const X509* one, const std::string& file, const std::string& who) {
    const std::string name = nameOf(one);
    if (X509_cmp_current_time(X509_get0_notAfter(one)) < 0)
        fail(kExpired, who, "our own certificate " + file + " (" + subjectOf(one) + ") has expired on " + timeText(X509_get0_notAfter(one)) + clockHint() +
                                "; where the authority is: sorma-keys new " + name);
    if (tooEarly(one))
        fail(kNotYet, who, "our own certificate " + file + " (" + subjectOf(one) + ") holds from " + timeText(X509_get0_notBefore(one)) + clockHint() +
                               "; set the clock, or where the authority is: sorma-keys new " + name);
}

Revocations::Revocations(const std::string& who) : named_(keys::revoked()) {
    const std::string file = keys::file("crl.pem");
    Stream in(BIO_new_file(file.c_str(), "r"));
    while (X509_CRL* one = in ? PEM_read_bio_X509_CRL(in.get(), nullptr, nullptr, nullptr) : nullptr) {
        List list{{one, {}}, {}};
        for (auto& known : {"authority.pem", "trusted.pem"})
            for (auto& authority : readCertificates(keys::file(known)))
                if (X509_NAME_cmp(X509_CRL_get_issuer(one), X509_get_subject_name(authority.get())) == 0 && X509_CRL_verify(one, X509_get0_pubkey(authority.get())) == 1)
                    list.authority = std::move(authority);
        ERR_clear_error();
        if (!list.authority) fail(kList, who, file, "list " + std::to_string(lists_.size() + 1) + " in it is signed by no authority that this host knows");
        lists_.push_back(std::move(list));
    }
    ERR_clear_error();
    if (in && lists_.empty()) fail(kList, who, file, "there is no list in it that can be read");
}

bool Revocations::has(X509* one) const {
    if (named_.contains(nameOf(one)) || named_.contains(serialOf(one))) return true;
    const bool listed = std::any_of(lists_.begin(), lists_.end(), [&](auto& of) {
        X509_REVOKED* entry = nullptr;
        return X509_NAME_cmp(X509_CRL_get_issuer(of.list.get()), X509_get_issuer_name(one)) == 0 && X509_CRL_get0_by_cert(of.list.get(), &entry, one) == 1 &&
               X509_verify(one, X509_get0_pubkey(of.authority.get())) == 1;
    });
    ERR_clear_error();
    return listed;
}

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

}  // namespace sorma::tls
