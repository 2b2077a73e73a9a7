// tlsFlood.cpp PORT KEYS COUNT ?LINES? -- a client by TLS that changes its keys again and again, as RFC 8446 lets it, and says nothing else. Then it sends
// NULL, and waits for the answer. It prints how many changes the daemon has read, and exits with 1 when the line has ended before.
//
// KEYS: a file with a key and its certificate. LINES: so many lines do this, one after the other.
#include <arpa/inet.h>
#include <openssl/ssl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "comm/record.h"
#include "comm/wire.h"

namespace {

[[noreturn]] void end(const char* why, int done) {
    std::printf("%d\n", done);
    std::fprintf(stderr, "tlsFlood: %s\n", why);
    std::exit(1);
}

void talk(char** argv) {
    sockaddr_in a{};
    a.sin_family = AF_INET;
    a.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    a.sin_port = htons(std::uint16_t(std::atoi(argv[1])));
    const int fd = socket(AF_INET, SOCK_STREAM, 0);
    if (connect(fd, reinterpret_cast<sockaddr*>(&a), sizeof a) != 0) end("no connection", 0);
    // The probe is NULL with another flavor.
    sorma::Buffer probe;
    sorma::wire::writeNull(probe, 1, sorma::wire::kProgram);
    probe.data()[31] = char(sorma::wire::kTlsFlavor);
    char answer[36];
    if (send(fd, probe.data(), probe.size(), 0) != ssize_t(probe.size()) || recv(fd, answer, sizeof answer, MSG_WAITALL) != ssize_t(sizeof answer)) end("no answer to the probe", 0);
    SSL_CTX* c = SSL_CTX_new(TLS_method());
    SSL_CTX_set_min_proto_version(c, TLS1_3_VERSION);
    SSL_CTX_use_certificate_file(c, argv[2], SSL_FILETYPE_PEM), SSL_CTX_use_PrivateKey_file(c, argv[2], SSL_FILETYPE_PEM);
    SSL* s = SSL_new(c);
    SSL_set_fd(s, fd);
    SSL_set_alpn_protos(s, reinterpret_cast<const unsigned char*>("\6sunrpc"), 7);
    if (SSL_connect(s) != 1) end("no handshake", 0);
    const int count = std::atoi(argv[3]);
    int done = 0;
    while (done < count && SSL_key_update(s, SSL_KEY_UPDATE_NOT_REQUESTED) == 1 && SSL_do_handshake(s) == 1) ++done;
    sorma::Buffer null;
    sorma::wire::writeNull(null, 2, sorma::wire::kProgram);
    if (SSL_write(s, null.data(), int(null.size())) != int(null.size()) || SSL_read(s, answer, 28) != 28) end("the daemon has ended the line", done);
    std::printf("%d\n", done);
    SSL_free(s), SSL_CTX_free(c), close(fd);
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 4 && argc != 5) return 2;
    std::signal(SIGPIPE, SIG_IGN);
    for (int n = argc == 5 ? std::atoi(argv[4]) : 1; n > 0; --n) talk(argv);
    return 0;
}
