#include "comm/tlsKeys.h"

#include <openssl/err.h>

#include <map>
#include <mutex>

#include "bus/catalogue.h"
#include "comm/keys.h"
#include "comm/tlsErrors.h"

namespace sorma::tls {

namespace {

constexpr std::size_t kMostCertificates = 16 * 1024;    // [bytes] of the other end's chain

std::string stampOf(const std::string& own) { return keys::stamp({"authority.pem", "trusted.pem", own + ".pem"}); }

int noPassword(char*, int, int, void*) { return -1; }

KeysPointer load(const std::string& own, const std::string& who, void (*prepare)(SSL_CTX*)) {
    auto keys = std::make_shared<Keys>();
    keys->own = own;
    keys->stamp = stampOf(own);
    if (own.empty())
        fail(kMissing, who, "TLS needs a certificate, and there is none in " + keys::folder() + "; where the authority is: sorma-keys give NAME FILE; here: sorma-keys take FILE");
    const std::string file = keys->file();
    auto chain = readCertificates(file);
    if (chain.empty()) fail(kMissing, who, "there is no certificate in " + file + "; where the authority is: sorma-keys give " + own + " FILE; here: sorma-keys take FILE");
    if (auto why = keys::exposed(file); !why.empty()) fail(kKey, who, file, why);
    checkDates(chain[0].get(), file, who);
    keys->context.reset(SSL_CTX_new(TLS_method()));
    SSL_CTX* c = keys->context.get();
    if (!c) fail(kKey, who, file, errorText());
    SSL_CTX_set_min_proto_version(c, TLS1_3_VERSION), SSL_CTX_set_max_proto_version(c, TLS1_3_VERSION);
    SSL_CTX_set_ciphersuites(c, "TLS_AES_128_GCM_SHA256:TLS_AES_256_GCM_SHA384:TLS_CHACHA20_POLY1305_SHA256");
    SSL_CTX_set1_groups_list(c, "X25519:P-256");
    SSL_CTX_set_mode(c, SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER | SSL_MODE_RELEASE_BUFFERS | SSL_MODE_NO_AUTO_CHAIN);
    SSL_CTX_set_verify_depth(c, 3), SSL_CTX_set_max_cert_list(c, kMostCertificates);
    SSL_CTX_set_default_passwd_cb(c, noPassword);
    prepare(c);
    ERR_clear_error();
    if (SSL_CTX_use_certificate_chain_file(c, file.c_str()) != 1) fail(kKey, who, file, errorText());
    if (SSL_CTX_use_PrivateKey_file(c, file.c_str(), SSL_FILETYPE_PEM) != 1 || SSL_CTX_check_private_key(c) != 1)
        fail(kKey, who, file, errorText() + "; it must be the key of the first certificate there");
    keys->authority = trust(SSL_CTX_get_cert_store(c));     // an empty list trusts nobody
    // The chain that we show is built once, not for each handshake. The other end knows the root.
    SSL_CTX_build_cert_chain(c, SSL_BUILD_CHAIN_FLAG_NO_ROOT | SSL_BUILD_CHAIN_FLAG_IGNORE_ERROR | SSL_BUILD_CHAIN_FLAG_CLEAR_ERROR);
    ERR_clear_error();
    keys->certificate = std::move(chain[0]);
    return keys;
}

}  // namespace

std::string Keys::file() const { return keys::file(own + ".pem"); }

std::string errorText() {
    const unsigned long code = ERR_peek_error();
    const char* text = code ? ERR_reason_error_string(code) : nullptr;
    return text ? text : "no reason is known";
}

KeysPointer keysOf(const std::string& daemon, const std::string& who, void (*prepare)(SSL_CTX*)) {
    static std::mutex mutex;
    static auto& known = *new std::map<std::string, KeysPointer>;
    const std::string own = keys::ownName(daemon);
    std::lock_guard lock(mutex);
    KeysPointer& mine = known[own];
    if (!mine || mine->stamp != stampOf(own)) mine = load(own, who, prepare);
    return mine;
}

}  // namespace sorma::tls
