#include "comm/tls.h"

#include <openssl/err.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>
#include <sys/epoll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cstring>
#include <mutex>
#include <optional>
#include <set>
#include <vector>

#include "bus/catalogue.h"
#include "comm/certificate.h"
#include "comm/errors.h"
#include "comm/keys.h"
#include "comm/tlsErrors.h"
#include "comm/tlsKeys.h"
#include "comm/tlsProbe.h"

namespace sorma::tls {

namespace {

// A line may just end: its ticket stays good. OpenSSL would forget it for want of a last word; RFC 8446 asks for none.
inline void end(SSL* ssl) { SSL_set_shutdown(ssl, SSL_SENT_SHUTDOWN), SSL_free(ssl); }
using Handle = std::unique_ptr<SSL, Freed<end>>;

constexpr unsigned char kAlpn[] = {6, 's', 'u', 'n', 'r', 'p', 'c'};
constexpr long kResumeTime = 3600;                      // [s] in which a client may resume
constexpr std::size_t kPushSize = 64 * 1024;            // [bytes] of records that are written at once

// ---- contexts ----

using RevocationsPointer = std::shared_ptr<const Revocations>;

int verified(int good, X509_STORE_CTX* chain);
int chooseAlpn(SSL*, const unsigned char** out, unsigned char* size, const unsigned char* in, unsigned length, void*) {
    return SSL_select_next_proto(const_cast<unsigned char**>(out), size, kAlpn, sizeof kAlpn, in, length) == OPENSSL_NPN_NEGOTIATED ? SSL_TLSEXT_ERR_OK
                                                                                                                       : SSL_TLSEXT_ERR_ALERT_FATAL;
}
int keepSession(SSL* ssl, SSL_SESSION* session);
SSL_SESSION* giveSession(SSL* ssl, const unsigned char* ticket, int size, int* shared);
int writeTicket(SSL* ssl, void*);

void prepare(SSL_CTX* c) {
    SSL_CTX_set_read_ahead(c, 1), SSL_CTX_set_default_read_buffer_len(c, kReadSize);
    SSL_CTX_set_verify(c, SSL_VERIFY_PEER | SSL_VERIFY_FAIL_IF_NO_PEER_CERT, verified);
    SSL_CTX_set_alpn_protos(c, kAlpn, sizeof kAlpn);
    SSL_CTX_set_alpn_select_cb(c, chooseAlpn, nullptr);
    SSL_CTX_set_session_cache_mode(c, SSL_SESS_CACHE_BOTH | SSL_SESS_CACHE_NO_INTERNAL);
    SSL_CTX_sess_set_new_cb(c, keepSession), SSL_CTX_sess_set_get_cb(c, giveSession);
    SSL_CTX_set_session_id_context(c, kAlpn, sizeof kAlpn);
    SSL_CTX_set_session_ticket_cb(c, writeTicket, nullptr, nullptr);
    SSL_CTX_set_timeout(c, kResumeTime), SSL_CTX_set_num_tickets(c, 1);
}

KeysPointer keysOf(const std::string& daemon, const std::string& who) { return tls::keysOf(daemon, who, prepare); }

// ---- a line ----

struct Secure : Line::Extra {
    enum class Phase : std::uint8_t { asking, answer, handshake, done } phase = Phase::asking;
    bool client = false, tries = false; // tries: it may be in clear
    std::string name;                   // a client's: of the daemon
    std::string where;                  // a client's: the address, for messages and for resuming
    std::string other() const { return client ? where : "the client"; }      // in messages
    const Offer* offer = nullptr;       // a daemon's
    Identity before;                    // a daemon's: who has connected, as TCP knows it
    std::unique_ptr<Extra> under;       // of TCP, while it connects
    std::string out;                    // for the socket, and not yet taken: the probe in clear, then records
    std::size_t begun = 0;              // [bytes] that write() was given and that are in out
    bool gathers = false;               // records go to out
    KeysPointer keys;
    RevocationsPointer revoked;
    std::string unpinned;               // a warning: the name could not be written to the pins
    Handle ssl;
    // The files of keys as they are now.
    void take(const std::string& daemon, const std::string& who) { keys = keysOf(daemon, who), revoked = Revocations::now(who); }
    // For the function that runs now:
    Line* line = nullptr;
    std::int64_t wait = 0;              // [ns]
    bool dry = false;                   // the socket has no more
    bool more = false;                  // perhaps bytes are here for which the socket has no event
    bool stuck = false;                 // it has something to write, and the socket does not take it
    bool closed = false;                // the other end has closed
    Fault fault = Fault::none;          // what is wrong with the certificate at the other end
    std::string faulty;                 // that certificate, and what we found
    std::optional<Error> broken;        // why the line is of no use any more
    std::string who;                    // in messages
    std::string authority;              // fingerprint of the one that has signed the other end's certificate
};

Secure& secureOf(const Line& line) { return static_cast<Secure&>(*line.extra); }
// Before OpenSSL is called. wait [ns]: its first read of the socket may block for so long.
Secure& ready(Line& line, std::int64_t wait = 0) {
    Secure& s = secureOf(line);
    s.line = &line, s.wait = wait, s.dry = false;
    ERR_clear_error();
    return s;
}
Secure& secureOf(const SSL* ssl) { return *static_cast<Secure*>(SSL_get_app_data(ssl)); }

// Write what is in out. False: not all is taken (errno).
bool push(Line& line, Secure& s) {
    std::size_t taken = 0;
    ssize_t n = 0;
    while (taken < s.out.size() && (n = writeSocket(line, s.out.data() + taken, s.out.size() - taken)) >= 0) taken += std::size_t(n);
    const int error = errno;
    s.out.erase(0, taken);
    s.stuck = n < 0 && error == EAGAIN;
    errno = error;
    return s.out.empty();
}

// Our BIO: the socket, so that nothing raises SIGPIPE, and a client may wait in it.
int bioWrite(BIO* bio, const char* data, int size) {
    Secure& s = *static_cast<Secure*>(BIO_get_data(bio));
    BIO_clear_retry_flags(bio);
    if (s.gathers || !s.out.empty()) {
        s.out.append(data, std::size_t(size));
        return size;
    }
    const ssize_t n = writeSocket(*s.line, data, std::size_t(size));
    s.stuck = n < 0 && errno == EAGAIN;
    if (s.stuck) BIO_set_retry_write(bio);
    return int(n);
}

int bioRead(BIO* bio, char* room, int size) {
    Secure& s = *static_cast<Secure*>(BIO_get_data(bio));
    BIO_clear_retry_flags(bio);
    const ssize_t n = s.dry ? (errno = EAGAIN, -1) : readSocket(*s.line, room, std::size_t(size), std::exchange(s.wait, 0));
    if (n < size) s.dry = true;
    if (n == 0) s.closed = true;
    if (n < 0 && errno == EAGAIN) BIO_set_retry_read(bio);
    return int(n);
}

long bioControl(BIO*, int command, long, void*) { return command == BIO_CTRL_FLUSH ? 1 : 0; }

BIO_METHOD* bioMethod() {
    static BIO_METHOD* const method = [] {
        BIO_METHOD* m = BIO_meth_new(BIO_get_new_index() | BIO_TYPE_SOURCE_SINK, "sorma");
        BIO_meth_set_write(m, bioWrite);
        BIO_meth_set_read(m, bioRead);
        BIO_meth_set_ctrl(m, bioControl);
        return m;
    }();
    return method;
}

void startHandshake(Secure& s) {
    s.ssl.reset(SSL_new(s.keys->context.get()));
    if (!s.ssl) throw std::bad_alloc();
    BIO* bio = BIO_new(bioMethod());
    if (!bio) throw std::bad_alloc();
    BIO_set_data(bio, &s);
    BIO_set_init(bio, 1);
    SSL_set_bio(s.ssl.get(), bio, bio);
    SSL_set_app_data(s.ssl.get(), &s);
    if (s.client) {
        SSL_set_connect_state(s.ssl.get());
        if (const Session last = s.keys->tickets.take(s.name + ' ' + s.where)) SSL_set_session(s.ssl.get(), last.get());
    } else {
        SSL_set_options(s.ssl.get(), SSL_OP_NO_TICKET);
        SSL_set_accept_state(s.ssl.get());
    }
    s.phase = Secure::Phase::handshake;
}

// ---- is the certificate at the other end good? ----

Fault judge(Secure& s, X509* one) {
    const std::string name = nameOf(one);
    if (X509_cmp_current_time(X509_get0_notAfter(one)) < 0) return Fault::expired;
    if (s.revoked->has(one)) return Fault::revoked;
    if (s.offer && s.offer->revoked && s.offer->revoked(name, part(one, NID_organizationName))) return Fault::revoked;
    if (name.empty()) return Fault::name;
    if (s.client && (s.name.empty() || X509_check_host(one, s.name.data(), s.name.size(), X509_CHECK_FLAG_NO_WILDCARDS, nullptr) != 1)) return Fault::name;
    return Fault::none;
}

void note(Secure& s, Fault fault, const X509* one, const std::string& detail = {}) {
    if (s.fault != Fault::none) return;
    s.fault = fault;
    s.faulty = complaint(fault, one, s.client, s.name, detail);
}

int verified(int good, X509_STORE_CTX* chain) {
    Secure& s = secureOf(static_cast<SSL*>(X509_STORE_CTX_get_ex_data(chain, SSL_get_ex_data_X509_STORE_CTX_idx())));
    X509* one = X509_STORE_CTX_get_current_cert(chain);
    if (!good) {
        const int error = X509_STORE_CTX_get_error(chain);
        if (error == X509_V_ERR_CERT_NOT_YET_VALID && !tooEarly(one)) {
            X509_STORE_CTX_set_error(chain, X509_V_OK);
            return 1;
        }
        note(s, error == X509_V_ERR_CERT_HAS_EXPIRED ? Fault::expired : error == X509_V_ERR_CERT_NOT_YET_VALID ? Fault::notYet : Fault::authority, one,
             X509_verify_cert_error_string(error));
        return 0;
    }
    if (X509_STORE_CTX_get_error_depth(chain) > 0) return 1;
    const Fault fault = judge(s, one);
    if (fault != Fault::none) {
        note(s, fault, one);
        X509_STORE_CTX_set_error(chain, fault == Fault::revoked ? X509_V_ERR_CERT_REVOKED : fault == Fault::expired ? X509_V_ERR_CERT_HAS_EXPIRED : X509_V_ERR_HOSTNAME_MISMATCH);
        return 0;
    }
    auto* all = X509_STORE_CTX_get0_chain(chain);
    s.authority = fingerprint(sk_X509_value(all, sk_X509_num(all) - 1));
    return 1;
}

// ---- resuming ----

int keepSession(SSL* ssl, SSL_SESSION* session) {
    Secure& s = secureOf(ssl);
    unsigned size = 0;
    const unsigned char* number = SSL_SESSION_get_id(session, &size);
    if (s.client) s.keys->tickets.keep(s.name + ' ' + s.where, Session(session));
    else s.keys->tickets.give({reinterpret_cast<const char*>(number), size}, Session(session));
    return 1;
}

// A daemon's session, by the ticket of a client. When it does not hold, a full handshake says why.
SSL_SESSION* giveSession(SSL* ssl, const unsigned char* number, int size, int* shared) {
    Secure& s = secureOf(ssl);
    *shared = 0;                        // it is OpenSSL's now
    Session session = s.keys->tickets.use({reinterpret_cast<const char*>(number), std::size_t(size)});
    X509* one = session ? SSL_SESSION_get0_peer(session.get()) : nullptr;
    void* data = nullptr;
    std::size_t length = 0;
    if (!one || judge(s, one) != Fault::none || SSL_SESSION_get0_ticket_appdata(session.get(), &data, &length) != 1 || length == 0) return nullptr;
    s.authority.assign(static_cast<const char*>(data), length);
    return session.release();
}

// A session says by which authority its client is known: the chain is not in it.
int writeTicket(SSL* ssl, void*) {
    const std::string& authority = secureOf(ssl).authority;
    return SSL_SESSION_set1_ticket_appdata(SSL_get_session(ssl), authority.data(), authority.size());
}

// ---- what has failed ----

constexpr int kAlert = 1000;                            // in OpenSSL's reasons: an alert of the other end

// The last function of OpenSSL has failed. Throws for what it has found.
void explain(Secure& s, const std::string& who) {
    const unsigned long code = ERR_peek_error();
    const int reason = code && ERR_GET_LIB(code) == ERR_LIB_SSL ? ERR_GET_REASON(code) : 0;
    const std::string text = errorText();
    ERR_clear_error();
    if (s.fault != Fault::none) failFault(s.fault, who, s.faulty + (s.client ? "; nothing was sent" : ""));
    if (reason > kAlert) failAlert({s.client, s.keys->certificate.get(), s.keys->file()}, reason - kAlert, who);
    if (reason == SSL_R_PEER_DID_NOT_RETURN_A_CERTIFICATE) fail(kMissing, who, "the client showed no certificate; there: sorma-keys take FILE");
    if (s.closed || code == 0 || reason == SSL_R_UNEXPECTED_EOF_WHILE_READING)
        fail(errors::kRefused, who, s.other(), "it closed the connection in the handshake of TLS", "it may be ending, or full");
    fail(kRefused, who, s.other(), text);
}

// ---- the probe, in clear ----

// Write what waits in clear. False: not all is taken.
bool pushClear(Line& line, Secure& s, const std::string& who) {
    if (push(line, s)) return true;
    if (!s.stuck) fail(errors::kRefused, who, s.other(), std::strerror(errno), "it may be ending, or full");
    return false;
}

// ---- rows ----

ssize_t read(Line& line, char* room, std::size_t size, std::int64_t wait) {
    Secure& s = ready(line, wait);
    s.more = false;
    std::size_t have = 0;
    while (have < size) {
        std::size_t n = 0;
        ERR_clear_error();
        if (SSL_read_ex(s.ssl.get(), room + have, size - have, &n) == 1) {
            have += n;
            s.wait = 0;
            continue;
        }
        const int error = SSL_get_error(s.ssl.get(), 0);
        if (error == SSL_ERROR_WANT_READ || error == SSL_ERROR_WANT_WRITE) break;
        if (have > 0) {                                 // the next read says it again
            s.more = true;
            break;
        }
        if (error == SSL_ERROR_ZERO_RETURN || s.closed) return 0;
        if (!s.broken) try {
            explain(s, s.who);
        } catch (const Error& e) {
            s.broken = e;
        }
        return errno = EPROTO, -1;
    }
    if (have == size && SSL_has_pending(s.ssl.get())) s.more = true;
    return have > 0 || size == 0 ? ssize_t(have) : (errno = EAGAIN, -1);
}

// Records of the next bytes go to out, as many as belong into one push. Returns how many bytes are in them.
std::size_t seal(Secure& s, const char* data, std::size_t size) {
    std::size_t done = 0, n = 0;
    s.gathers = size > SSL3_RT_MAX_PLAIN_LENGTH;
    while (done < size && s.out.size() < kPushSize && SSL_write_ex(s.ssl.get(), data + done, size - done, &n) == 1) {
        done += n;
        if (!s.gathers) break;
    }
    s.gathers = false;
    return done;
}

ssize_t write(Line& line, const char* data, std::size_t size) {
    Secure& s = ready(line);
    if (!push(line, s)) return -1;
    std::size_t written = std::exchange(s.begun, 0);
    while (written < size) {
        const std::size_t n = seal(s, data + written, size - written);
        if (n == 0) {
            const int error = SSL_get_error(s.ssl.get(), 0);
            ERR_clear_error();
            if (written > 0 || error == SSL_ERROR_WANT_WRITE || error == SSL_ERROR_WANT_READ) break;
            return errno = EPIPE, -1;
        }
        if (!push(line, s)) {
            s.begun = n;
            break;
        }
        written += n;
    }
    if (s.out.empty()) s.out.shrink_to_fit();
    return written > 0 || size == 0 ? ssize_t(written) : (errno = EAGAIN, -1);
}

// Takes bytes from the socket, but none from what read() will give.
ssize_t peek(Line& line, char* room, std::size_t size) {
    Secure& s = ready(line);
    std::size_t n = 0;
    const bool some = SSL_peek_ex(s.ssl.get(), room, size, &n) == 1;
    ERR_clear_error();
    s.more = true;
    return some ? ssize_t(n) : (errno = EAGAIN, -1);
}

bool pending(const Line& line) { return line.extra && secureOf(line).more; }

std::uint32_t wants(const Line& line, std::uint32_t events) { return line.extra && secureOf(line).stuck ? events | EPOLLOUT : events; }

// Before the other end has shown a certificate. That is asked for once: it needs the kernel, and the files of users.
Identity identifyBefore(const Line& line) { return secureOf(line).before = tcpTransport.identify(line); }

Identity identify(const Line& line) {
    const Secure& s = secureOf(line);
    Identity out = s.before;
    X509* one = s.ssl ? SSL_get0_peer_certificate(s.ssl.get()) : nullptr;
    if (!one || s.phase != Secure::Phase::done) return out;
    const std::string name = nameOf(one), organisation = part(one, NID_organizationName);
    Principal::Address from{};
    if (out.principal) from = out.principal->address();
    out.principal = Principal::cert(name, organisation, s.authority, !s.authority.empty() && s.authority == s.keys->authority, from);
    out.caller.user = out.principal->toText();
    out.caller.known.clear();
    return out;
}

extern const Transport clientRow, daemonRow, row;

// False: it waits for the socket.
bool shakeHands(Line& line, Secure& s, const std::string& who) {
    ready(line);
    const int result = SSL_do_handshake(s.ssl.get());
    if (result != 1) {
        const int error = SSL_get_error(s.ssl.get(), result);
        if (error == SSL_ERROR_WANT_READ || error == SSL_ERROR_WANT_WRITE) return false;
        explain(s, who);
    }
    X509* one = SSL_get0_peer_certificate(s.ssl.get());
    const unsigned char* protocol = nullptr;
    unsigned size = 0;
    SSL_get0_alpn_selected(s.ssl.get(), &protocol, &size);
    if (size != sizeof kAlpn - 1 || std::memcmp(protocol, kAlpn + 1, size) != 0) fail(kRefused, who, s.other(), "it does not speak sunrpc (ALPN)");
    if (!one || SSL_get_verify_result(s.ssl.get()) != X509_V_OK) fail(kMissing, who, s.other() + " has shown no certificate");
    if (const Fault fault = judge(s, one); fault != Fault::none) {      // also of a session that was resumed
        note(s, fault, one);
        failFault(s.fault, who, s.faulty + (s.client ? "; nothing was sent" : ""));
    }
    if (!s.client && s.authority.empty()) fail(kRefused, who, s.other(), "its authority is not known");
    s.phase = Secure::Phase::done;
    s.who = who;
    s.more = SSL_has_pending(s.ssl.get());
    if (s.client) s.unpinned = unpinned(keys::pin(s.name));
    line = Line(std::move(line), row);
    return true;
}

bool speakClear(Line& line) {
    line.extra.reset();
    line = Line(std::move(line), tcpTransport);
    return true;
}

bool upgradeClient(Line& line, Transport::Stage, const std::string& who) {
    Secure& s = secureOf(line);
    if (s.phase == Secure::Phase::asking) {
        s.out = probe::ask();
        s.phase = Secure::Phase::answer;
    }
    if (!pushClear(line, s, who)) return false;
    if (s.phase == Secure::Phase::answer) {
        const auto answer = probe::read(line, s.where, who);
        if (answer == probe::Answer::notYet) return false;
        if (answer == probe::Answer::plain) {
            if (const std::string since = pinnedSince(s.name, who); !since.empty()) fail(kStripped, who, s.where, since, s.name);
            if (!s.tries) fail(kPlain, who, s.where);
            return speakClear(line);
        }
        startHandshake(s);
    }
    return shakeHands(line, s, who);
}

bool upgradeDaemon(Line& line, Transport::Stage, const std::string& who) {
    Secure& s = secureOf(line);
    if (s.phase == Secure::Phase::asking) {
        char first[probe::kSize];
        std::uint32_t xid = 0;
        const bool last = probe::closing(line);
        const ssize_t n = peekSocket(line, first, sizeof first);
        if (n < 0 && errno == EAGAIN) return false;
        const bool half = n > 0 && n < ssize_t(sizeof first) && probe::isLike(first, std::size_t(n), xid) && !last;
        probe::wakeAt(line, half ? sizeof first : 1);
        if (half) return false;
        if (n < ssize_t(sizeof first) || !probe::isLike(first, std::size_t(n), xid)) return speakClear(line);
        s.take(s.offer->daemon, who);
        (void)recv(line.descriptor(), first, sizeof first, 0);
        s.out = probe::answer(xid);
        s.phase = Secure::Phase::answer;
    }
    if (!pushClear(line, s, who)) return false;
    if (s.phase == Secure::Phase::answer) startHandshake(s);
    return shakeHands(line, s, who);
}

Line begin(const Address& address, const std::string& who) {
    auto s = std::make_unique<Secure>();
    s->client = true;
    s->tries = address.tls == Address::Tls::tries;
    s->name = address.as;
    s->where = describe(address);
    s->take({}, who);
    Line line(tcpTransport.begin(address, who), clientRow);
    s->under = std::move(line.extra);
    line.extra = std::move(s);
    return line;
}

bool finish(Line& line, const std::string& who) {
    auto mine = std::move(line.extra);
    Secure& s = static_cast<Secure&>(*mine);
    line.extra = std::move(s.under);
    const bool connected = tcpTransport.finish(line, who);
    s.under = std::move(line.extra);
    line.extra = std::move(mine);
    return connected;
}

void explainLine(const Line& line, const std::string&) {
    if (line.extra && secureOf(line).broken) throw *secureOf(line).broken;
}

Transport makeRow() {
    Transport made = tcpTransport;
    made.name = "tls";
    made.begin = begin;
    made.finish = finish;
    made.read = read;
    made.write = write;
    made.peek = peek;
    made.identify = identify;
    made.pending = pending;
    made.wants = wants;
    made.explain = explainLine;
    return made;
}

Transport makeClient() {
    Transport made = makeRow();
    made.upgrade = upgradeClient;
    return made;
}

Transport makeDaemon() {
    Transport made = makeRow();
    made.upgrade = upgradeDaemon;
    made.peek = nullptr;                // before the handshake is over nothing is answered
    made.identify = identifyBefore;
    return made;
}

const Transport clientRow = makeClient(), daemonRow = makeDaemon(), row = makeRow();

}  // namespace

const Transport& rowFor(const Transport& under, const Address& address, const std::string& who) {
    return &under == &tcpTransport && wanted(address, who) ? clientRow : under;
}

void check(const std::string& daemon) { (void)keysOf(daemon, daemon), (void)Revocations::now(daemon); }

Line offered(Line line, const Offer& offer) {
    if (!line.open() || &line.row() != &tcpTransport) return line;
    auto s = std::make_unique<Secure>();
    s->offer = &offer;
    Line out(std::move(line), daemonRow);
    out.extra = std::move(s);
    return out;
}

bool secure(const Line& line) { return &line.row() == &row; }

Judge judge(const Offer& offer) {
    RevocationsPointer now;
    try {
        now = Revocations::now(offer.daemon);
    } catch (const Error&) {}           // with those of before
    return [now, &offer](const Line& line) -> std::string {
        const Secure& s = secureOf(line);
        X509* one = SSL_get0_peer_certificate(s.ssl.get());
        const bool holds = one && !(now ? now : s.revoked)->has(one) && !(offer.revoked && offer.revoked(nameOf(one), part(one, NID_organizationName)));
        return holds ? "" : "the certificate is revoked";
    };
}

std::string trouble(const Offer& offer) {
    try {
        const KeysPointer keys = keysOf(offer.daemon, offer.daemon);
        checkDates(keys->certificate.get(), keys->file(), offer.daemon);        // it has been good when it was loaded
        return Revocations::now(offer.daemon)->trouble();
    } catch (const Error& e) {
        return withoutClock(e.what());
    }
}

Trail remarks(const Line& line, const std::string& who) {
    static std::mutex mutex;
    static auto& said = *new std::set<std::string>;
    Trail out;
    if (!secure(line)) return out;
    const Secure& s = secureOf(line);
    std::lock_guard lock(mutex);
    for (auto& text : {s.unpinned, s.revoked->trouble()})
        if (!text.empty() && said.insert(text).second) out.add(makeEntry(kFiles, {MessageArg::of(who), MessageArg::of(text)}));
    return out;
}

}  // namespace sorma::tls
