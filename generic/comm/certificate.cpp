#include "comm/certificate.h"

#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>

#include <algorithm>
#include <ctime>
#include <map>
#include <mutex>

#include "bus/catalogue.h"
#include "bus/kept.h"
#include "comm/keys.h"
#include "comm/tlsErrors.h"

namespace sorma::tls {

namespace {

constexpr char kClock[] = " (the clock here says ";
constexpr time_t kSkew = 300;                           // [s] by which clocks may differ when a certificate is new

const Prototype kList{Severity::error, "TLS KEY", 1,
    "{}: {} cannot be used: {}; nobody can say now who is revoked; {}"};

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

std::string clockHint() { return kClock + nowText() + ": is it right?)"; }

std::string withoutClock(std::string text) {
    for (std::size_t at; (at = text.find(kClock)) != std::string::npos;) text.erase(at, text.find(')', at) + 1 - at);
    return text;
}

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

std::string trust(X509_STORE* store) {
    std::string own;
    for (auto& one : readCertificates(keys::file("authority.pem"))) {
        if (own.empty()) own = fingerprint(one.get());
        X509_STORE_add_cert(store, one.get());
    }
    for (auto& one : readCertificates(keys::file("trusted.pem"))) X509_STORE_add_cert(store, one.get());
    return own;
}

std::shared_ptr<const Revocations> Revocations::now(const std::string& who) {
    static std::mutex mutex;
    static auto& known = *new std::map<std::string, std::shared_ptr<const Revocations>>;   // by folder
    std::lock_guard lock(mutex);
    auto& mine = known[keys::folder()];
    std::string stamp = keys::stamp({"revoked", "crl.pem", "authority.pem", "trusted.pem"});
    if (!mine || mine->stamp_ != stamp) mine.reset(new Revocations(who, mine.get(), std::move(stamp)));
    return mine;
}

Revocations::Revocations(const std::string& who, const Revocations* before, std::string stamp)
    : stamp_(std::move(stamp)), lists_(std::make_shared<std::vector<List>>()) {
    const auto keep = [&](const char* name, const char* mend, const std::string& wrong, auto member) {
        if (wrong.empty()) return;
        if (!before) fail(kList, who, keys::file(name), wrong, mend);
        this->*member = before->*member;
        trouble_ += (trouble_.empty() ? "" : "; ") + keys::file(name) + " cannot be used: " + wrong + "; what it said before holds until then: " + mend;
    };
    keep("revoked", "make the file readable, or remove it", readNames(), &Revocations::named_);
    keep("crl.pem", "put a list of your authority there, or remove the file", readLists(), &Revocations::lists_);
}

std::string Revocations::readNames() {
    named_ = keys::revoked();
    return keys::unreadable("revoked");
}

std::string Revocations::readLists() {
    if (auto why = keys::unreadable("crl.pem"); !why.empty()) return why;
    std::vector<List> lists;
    Stream in(BIO_new_file(keys::file("crl.pem").c_str(), "r"));
    while (X509_CRL* one = in ? PEM_read_bio_X509_CRL(in.get(), nullptr, nullptr, nullptr) : nullptr) {
        List list{{one, {}}, {}};
        for (auto& known : {"authority.pem", "trusted.pem"})
            for (auto& authority : readCertificates(keys::file(known)))
                if (X509_NAME_cmp(X509_CRL_get_issuer(one), X509_get_subject_name(authority.get())) == 0 && X509_CRL_verify(one, X509_get0_pubkey(authority.get())) == 1)
                    list.authority = std::move(authority);
        ERR_clear_error();
        if (!list.authority) return "list " + std::to_string(lists.size() + 1) + " in it is signed by no authority that this host knows";
        lists.push_back(std::move(list));
    }
    ERR_clear_error();
    if (in && lists.empty()) return "there is no list in it that can be read";
    lists_ = std::make_shared<const std::vector<List>>(std::move(lists));
    return {};
}

bool Revocations::has(X509* one) const {
    if (named_.contains(nameOf(one)) || named_.contains(serialOf(one))) return true;
    const bool listed = std::any_of(lists_->begin(), lists_->end(), [&](auto& of) {
        X509_REVOKED* entry = nullptr;
        return X509_NAME_cmp(X509_CRL_get_issuer(of.list.get()), X509_get_issuer_name(one)) == 0 && X509_CRL_get0_by_cert(of.list.get(), &entry, one) == 1 &&
               X509_verify(one, X509_get0_pubkey(of.authority.get())) == 1;
    });
    ERR_clear_error();
    return listed;
}

}  // namespace sorma::tls
