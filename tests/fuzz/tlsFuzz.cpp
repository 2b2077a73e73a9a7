// tlsFuzz.cpp -- the handshake of TLS with both of our ends, and a proxy between them. The proxy carries their bytes, or does not. It cuts them,
// changes them, leaves some out, puts others in. One end reads only what the other one has written. The proxy never sees what a client that wants TLS
// has to say. A certificate with other bytes in it has names of good characters, or none.
//
// The input is a program, as in serverFuzz.cpp. The keys are made anew for each run, and OpenSSL draws random numbers. So an input leads to other bytes
// each time.
#include <netinet/in.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <optional>
#include <string>

#include "bus/trail.h"
#include "comm/certificate.h"
#include "comm/tls.h"
#include "comm/tlsErrors.h"
#include "comm/transport.h"
#include "fuzz.h"

using namespace sorma;

namespace {

constexpr int kOperations = 200;
constexpr const char* kName = "cell";
const std::string kSecret = "NobodyHearsThis.";

// ---- keys: an authority, and a certificate for both ends ----

using Key = std::unique_ptr<EVP_PKEY, tls::Freed<EVP_PKEY_free>>;

void extend(X509* one, X509* issuer, int nid, const char* value) {
    X509V3_CTX context;
    X509V3_set_ctx(&context, issuer, one, nullptr, nullptr, 0);
    X509_EXTENSION* made = X509V3_EXT_conf_nid(nullptr, &context, nid, value);
    demand(made && X509_add_ext(one, made, -1), "no extension");
    X509_EXTENSION_free(made);
}

tls::Certificate certify(const char* name, EVP_PKEY* key, X509* issuer, EVP_PKEY* by) {
    tls::Certificate one(X509_new());
    X509* x = one.get();
    X509_set_version(x, 2);
    ASN1_INTEGER_set(X509_get_serialNumber(x), issuer ? 2 : 1);
    X509_gmtime_adj(X509_getm_notBefore(x), -3600);
    X509_gmtime_adj(X509_getm_notAfter(x), 86400);
    X509_NAME_add_entry_by_txt(X509_get_subject_name(x), "O", MBSTRING_ASC, reinterpret_cast<const unsigned char*>("lab"), -1, -1, 0);
    X509_NAME_add_entry_by_txt(X509_get_subject_name(x), "CN", MBSTRING_ASC, reinterpret_cast<const unsigned char*>(name), -1, -1, 0);
    X509_set_issuer_name(x, X509_get_subject_name(issuer ? issuer : x));
    X509_set_pubkey(x, key);
    extend(x, issuer ? issuer : x, NID_basic_constraints, issuer ? "critical,CA:FALSE" : "critical,CA:TRUE");
    if (issuer) extend(x, issuer, NID_subject_alt_name, (std::string("DNS:") + name).c_str());
    demand(X509_sign(x, by, EVP_sha256()) > 0, "no signature");
    return one;
}

// The folder of keys: made at first, removed at the end.
struct Folder {
    std::string path;
    std::string certificate;            // DER

    Folder() {
        char name[] = "/tmp/sorma-fuzz-XXXXXX";
        demand(mkdtemp(name) != nullptr, "no folder");
        path = name;
        setenv("SORMA_KEYS", name, 1);
        const Key root(EVP_EC_gen("P-256")), own(EVP_EC_gen("P-256"));
        const auto authority = certify("authority", root.get(), nullptr, root.get()), one = certify(kName, own.get(), authority.get(), root.get());
        write("authority.pem", authority.get(), nullptr);
        write("cell.pem", one.get(), own.get());
        FILE* out = fopen((path + "/own").c_str(), "w");
        fputs(kName, out), fclose(out);
        unsigned char* der = nullptr;
        const int size = i2d_X509(one.get(), &der);
        certificate.assign(reinterpret_cast<char*>(der), std::size_t(size));
        OPENSSL_free(der);
    }
    ~Folder() { std::filesystem::remove_all(path); }
    void write(const char* name, X509* one, EVP_PKEY* key) const {
        FILE* out = fopen((path + "/" + name).c_str(), "w");
        demand(out != nullptr, "no file");
        fchmod(fileno(out), 0600);
        if (key) PEM_write_PrivateKey(out, key, nullptr, nullptr, 0, nullptr, nullptr);
        PEM_write_X509(out, one);
        fclose(out);
    }
};

// ---- a certificate with other bytes ----

void certificates(Input& in, const Folder& folder) {
    std::string der = folder.certificate;
    for (int n = in.below(8); n >= 0; --n) {
        const unsigned at = in.byte() * 256 + in.byte();
        der[at % der.size()] = char(in.byte());
    }
    auto* bytes = reinterpret_cast<const unsigned char*>(der.data());
    const tls::Certificate one(d2i_X509(nullptr, &bytes, long(der.size())));
    if (!one) return;
    const std::string name = tls::nameOf(one.get());
    for (unsigned char c : name) demand(std::isalnum(c) || c == '_' || c == '-' || c == '.', "a name has a byte that none may have", c);
    (void)tls::subjectOf(one.get()), (void)tls::serialOf(one.get()), (void)tls::fingerprint(one.get()), (void)tls::tooEarly(one.get());
    (void)tls::Revocations::now("fuzz")->has(one.get());
    for (auto fault : {tls::Fault::expired, tls::Fault::notYet, tls::Fault::revoked, tls::Fault::name, tls::Fault::authority})
        for (unsigned char c : tls::complaint(fault, one.get(), true, name, "detail")) demand(c >= ' ' && c < 127, "a message has a byte that is not shown", c);
}

// ---- two ends, and what is between ----

const tls::Offer& offer() {
    static const tls::Offer made{kName, {}};
    return made;
}

struct End {
    Line line;
    int other = -1;                     // the end of its socket that is between
    bool wantsTls = false;              // it is a client
    bool up = false;                    // it may read and write
    std::string waits, said, heard;     // between, and not carried on; written to the line; read from it

    ~End() {
        if (other >= 0) close(other);
    }
    bool open() const { return line.open(); }
    void end() { line = {}, up = false; }
    void upgrade() {
        if (!open() || up) return;
        try {
            up = line.row().upgrade(line, Transport::Stage::connected, "fuzz");
        } catch (const Error&) {
            end();
        }
    }
    void write(std::size_t size) {
        if (!up) return;
        std::string text;
        while (text.size() < size) text += kSecret;
        const ssize_t n = line.write(text.data(), text.size());
        if (n > 0) said.append(text, 0, std::size_t(n));
    }
    void read() {
        char bytes[4096];
        for (ssize_t n; up && (n = line.read(bytes, sizeof bytes)) > 0;) heard.append(bytes, std::size_t(n));
    }
    void peek() {
        char bytes[64];
        if (up) (void)line.peek(bytes, sizeof bytes);
    }
    // Take what it has sent.
    void listen() {
        char bytes[4096];
        for (ssize_t n; other >= 0 && (n = recv(other, bytes, sizeof bytes, MSG_DONTWAIT)) > 0;) waits.append(bytes, std::size_t(n));
        demand(!wantsTls || waits.find(kSecret) == std::string::npos, "a client that wants TLS speaks in clear");
    }
    void send(const std::string& bytes) const {
        if (other >= 0) (void)!::send(other, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    }
    void hangUp() {
        if (other >= 0) close(other);
        other = -1;
    }
};

// Listens for all inputs.
struct Between {
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    int port = 0;

    Between() {
        sockaddr_in a{};
        a.sin_family = AF_INET;
        a.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        socklen_t size = sizeof a;
        demand(bind(fd, reinterpret_cast<sockaddr*>(&a), sizeof a) == 0 && listen(fd, 64) == 0, "cannot listen", errno);
        getsockname(fd, reinterpret_cast<sockaddr*>(&a), &size);
        port = ntohs(a.sin_port);
    }
    void connect(End& client) const {
        Address address = addressOf("127.0.0.1", port);
        address.as = kName;
        address.tls = Address::Tls::yes;
        client.line = tls::rowFor(tcpTransport, address, "fuzz").begin(address, "fuzz");
        while (!client.line.row().finish(client.line, "fuzz")) (void)client.line.wait(EPOLLOUT, 1000);
        client.wantsTls = true;
        client.other = accept4(fd, nullptr, nullptr, SOCK_CLOEXEC);
        demand(client.other >= 0, "nobody has come", errno);
        linger now{1, 0};
        setsockopt(client.other, SOL_SOCKET, SO_LINGER, &now, sizeof now);      // no TIME_WAIT: there are many
    }
};

void listenAt(End& daemon) {
    int ends[2];
    demand(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, ends) == 0, "no sockets", errno);
    daemon.line = tls::offered(Line(Descriptor(ends[0]), tcpTransport), offer());
    daemon.other = ends[1];
}

// Carry so many bytes of one end to the other.
void carry(End& from, End& to, std::size_t most) {
    from.listen();
    to.send(from.waits.substr(0, most));
    from.waits.erase(0, most);
}

void handshakes(Input& in, const Between& between) {
    End client, daemon;
    between.connect(client);
    listenAt(daemon);
    for (int i = 0; i < kOperations && !in.done(); ++i) {
        const int what = in.below(12);
        const unsigned how = in.byte();
        End &one = how & 1 ? client : daemon, &other = how & 1 ? daemon : client;
        switch (what) {
            case 0: case 1: one.upgrade(); break;
            case 2: carry(one, other, how); break;
            case 3: carry(one, other, SIZE_MAX); break;
            case 4:
                one.listen();
                if (!one.waits.empty()) one.waits[in.byte() * 7 % one.waits.size()] ^= char(1 << in.below(8));
                break;
            case 5: {
                std::string bytes;
                for (int n = in.below(60); n >= 0; --n) bytes += char(in.byte());
                one.waits.insert(0, bytes);
                break;
            }
            case 6: one.listen(), one.waits.erase(0, 1 + how / 8); break;
            case 7:
                if (how < 32) one.hangUp();
                else one.peek();
                break;
            case 8: one.write(how * 8); break;
            case 9: one.read(); break;
            default:                    // as if nobody was there
                for (int n = 1 + how / 64; n > 0; --n) client.upgrade(), carry(client, daemon, SIZE_MAX), daemon.upgrade(), carry(daemon, client, SIZE_MAX);
        }
        client.listen();
        demand(!client.up || tls::secure(client.line), "a client that wants TLS is up without");
    }
    client.read(), daemon.read();
    if (client.up && tls::secure(daemon.line)) {
        demand(daemon.said.compare(0, client.heard.size(), client.heard) == 0, "the client reads what nobody wrote");
        demand(client.said.compare(0, daemon.heard.size(), daemon.heard) == 0, "the daemon reads what nobody wrote");
    }
    if (tls::secure(daemon.line)) (void)tls::judge(offer())(daemon.line);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const Folder folder;
    static const Between between;
    Input in(data, size);
    if (in.byte() % 4 == 0) certificates(in, folder);
    else handshakes(in, between);
    return 0;
}
