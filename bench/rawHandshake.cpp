#include "rawHandshake.h"

#include <openssl/ssl.h>

#include <stdexcept>
#include <utility>

#include "comm/certificate.h"

namespace bench {

namespace {

using sorma::tls::Freed;
using Context = std::unique_ptr<SSL_CTX, Freed<SSL_CTX_free>>;
using Handle = std::unique_ptr<SSL, Freed<SSL_free>>;
using Session = std::unique_ptr<SSL_SESSION, Freed<SSL_SESSION_free>>;

void demand(bool good, const char* what) {
    if (!good) throw std::runtime_error(what);
}

Context makeContext(const std::string& own, const std::string& authority) {
    Context made(SSL_CTX_new(TLS_method()));
    SSL_CTX* c = made.get();
    SSL_CTX_set_min_proto_version(c, TLS1_3_VERSION);
    SSL_CTX_set_ciphersuites(c, "TLS_AES_128_GCM_SHA256");
    SSL_CTX_set1_groups_list(c, "X25519");
    SSL_CTX_set_mode(c, SSL_MODE_NO_AUTO_CHAIN);
    SSL_CTX_set_verify(c, SSL_VERIFY_PEER | SSL_VERIFY_FAIL_IF_NO_PEER_CERT, nullptr);
    SSL_CTX_set_session_id_context(c, reinterpret_cast<const unsigned char*>("raw"), 3);
    SSL_CTX_set_num_tickets(c, 1);
    demand(SSL_CTX_use_certificate_chain_file(c, own.c_str()) == 1 && SSL_CTX_use_PrivateKey_file(c, own.c_str(), SSL_FILETYPE_PEM) == 1, "no key");
    demand(SSL_CTX_load_verify_file(c, authority.c_str()) == 1, "no authority");
    return made;
}

}  // namespace

struct RawHandshake::Ends {
    Context client, server;
    Session ticket;

    void connect(SSL_SESSION* with) {
        Handle near(SSL_new(client.get())), far(SSL_new(server.get()));
        BIO *one = nullptr, *other = nullptr;
        demand(BIO_new_bio_pair(&one, 0, &other, 0) == 1, "no memory");
        SSL_set_bio(near.get(), one, one), SSL_set_bio(far.get(), other, other);
        SSL_set_connect_state(near.get()), SSL_set_accept_state(far.get());
        SSL_set_app_data(near.get(), this);
        if (with) SSL_set_session(near.get(), with);
        int left = 1, right = 1;
        for (int n = 0; n < 10 && (n == 0 || left != 1 || right != 1); ++n) left = SSL_do_handshake(near.get()), right = SSL_do_handshake(far.get());
        demand(left == 1 && right == 1, "a handshake of OpenSSL alone has failed");
        demand(!with || SSL_session_reused(near.get()), "OpenSSL alone has not resumed");
        char none;
        (void)SSL_read(near.get(), &none, 1);           // takes the ticket
        SSL_set_shutdown(near.get(), SSL_SENT_SHUTDOWN), SSL_set_shutdown(far.get(), SSL_SENT_SHUTDOWN);
    }
};

RawHandshake::RawHandshake(const std::string& own, const std::string& authority) : ends_(std::make_unique<Ends>()) {
    ends_->client = makeContext(own, authority), ends_->server = makeContext(own, authority);
    SSL_CTX_set_session_cache_mode(ends_->client.get(), SSL_SESS_CACHE_CLIENT | SSL_SESS_CACHE_NO_INTERNAL_STORE);
    SSL_CTX_set_options(ends_->server.get(), SSL_OP_NO_TICKET);         // its sessions stay with it, as in comm/tls.cpp
    SSL_CTX_set_session_cache_mode(ends_->server.get(), SSL_SESS_CACHE_SERVER), SSL_CTX_sess_set_cache_size(ends_->server.get(), 256);
    SSL_CTX_sess_set_new_cb(ends_->client.get(), [](SSL* ssl, SSL_SESSION* session) {
        static_cast<Ends*>(SSL_get_app_data(ssl))->ticket.reset(session);
        return 1;
    });
}

RawHandshake::~RawHandshake() = default;

void RawHandshake::full() { ends_->connect(nullptr); }

void RawHandshake::resumed() {
    if (!ends_->ticket) full();
    const Session last = std::move(ends_->ticket);
    ends_->connect(last.get());
}

}  // namespace bench
