#include "comm/visitor.h"

#include <openssl/err.h>
#include <openssl/x509_vfy.h>

#include <new>

#include "comm/certificate.h"
#include "comm/keys.h"
#include "comm/tlsErrors.h"

namespace sorma::tls {

namespace {

using Store = std::unique_ptr<X509_STORE, Freed<X509_STORE_free>>;
using Chain = std::unique_ptr<X509_STORE_CTX, Freed<X509_STORE_CTX_free>>;

// Clocks differ: a certificate that holds from a moment in the future is taken, and the rest of the chain is still looked at.
int verified(int good, X509_STORE_CTX* chain) {
    if (good || X509_STORE_CTX_get_error(chain) != X509_V_ERR_CERT_NOT_YET_VALID || tooEarly(X509_STORE_CTX_get_current_cert(chain))) return good;
    X509_STORE_CTX_set_error(chain, X509_V_OK);
    return 1;
}

// The error of OpenSSL for a certificate and its chain, or X509_V_OK.
int chainError(X509* one) {
    Store store(X509_STORE_new());
    Chain chain(X509_STORE_CTX_new());
    if (!store || !chain) throw std::bad_alloc();
    for (auto& authority : readCertificates(keys::file("authority.pem"))) X509_STORE_add_cert(store.get(), authority.get());
    if (X509_STORE_CTX_init(chain.get(), store.get(), one, nullptr) != 1) throw std::bad_alloc();
    X509_STORE_CTX_set_default(chain.get(), "ssl_client");
    X509_STORE_CTX_set_verify_cb(chain.get(), verified);
    const bool good = X509_verify_cert(chain.get()) == 1;
    ERR_clear_error();
    const int error = X509_STORE_CTX_get_error(chain.get());
    return good ? X509_V_OK : error == X509_V_OK ? X509_V_ERR_UNSPECIFIED : error;
}

}  // namespace

std::string visitor(const std::string& certificate, const std::string& who) {
    auto* bytes = reinterpret_cast<const unsigned char*>(certificate.data());
    Certificate one(d2i_X509(nullptr, &bytes, long(certificate.size())));
    ERR_clear_error();
    auto wrong = [&](Fault fault, const std::string& detail = {}) { failFault(fault, who, complaint(fault, one.get(), false, "", detail)); };
    if (!one) wrong(Fault::authority, "it is no certificate");
    const int error = chainError(one.get());
    if (error == X509_V_ERR_CERT_HAS_EXPIRED) wrong(Fault::expired);
    if (error == X509_V_ERR_CERT_NOT_YET_VALID) wrong(Fault::notYet);
    if (error != X509_V_OK) wrong(Fault::authority, X509_verify_cert_error_string(error));
    if (Revocations::now(who)->has(one.get())) wrong(Fault::revoked);
    std::string name = nameOf(one.get());
    if (name.empty()) wrong(Fault::name);
    return name;
}

}  // namespace sorma::tls
