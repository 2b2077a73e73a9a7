#include "comm/tlsProbe.h"

#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "bus/catalogue.h"
#include "comm/errors.h"
#include "comm/keys.h"
#include "comm/wire.h"

namespace sorma::tls {

namespace {

const Prototype kPinned{Severity::error, "TLS PINNED", 1,
    "{}: {} has spoken TLS since {}, and the dictionary says -tls no; nothing was sent in clear; remove -tls no there, or: sorma-keys forget {}"};

constexpr char kToken[] = "STARTTLS";
constexpr std::size_t kMostAnswer = 1024;      // [bytes]
constexpr std::uint32_t kXid = 0x544c5331;

}  // namespace

bool wanted(const Address& address, const std::string& who) {
    const std::string since = keys::pinned(address.as);
    if (!since.empty() && address.tls == Address::Tls::no) fail(kPinned, who, address.as, since, address.as);
    if (address.tls == Address::Tls::yes || !since.empty()) return true;
    return address.tls != Address::Tls::no && keys::present();
}

namespace probe {

std::string ask() {
    Buffer out;
    const std::size_t start = record::open(out);
    XdrWriter(out).words(kXid, 0u, 2u, wire::kProgram, wire::kVersion, wire::kNull, wire::kTlsFlavor, 0u, 0u, 0u);
    record::close(out, start);
    return {out.data(), out.size()};
}

std::string answer(std::uint32_t xid) {
    Buffer out;
    const std::size_t start = record::open(out);
    XdrWriter w(out);
    w.words(xid, 1u, 0u, 0u);
    w.text(kToken);
    w.words(0u);
    record::close(out, start);
    return {out.data(), out.size()};
}

bool isLike(const char* bytes, std::size_t size, std::uint32_t& xid) {
    Buffer all;
    all.append(bytes, size);
    const std::size_t have = size;
    all.resize(kSize);
    std::fill(all.data() + have, all.data() + kSize, '\0');
    XdrReader r(all.data(), kSize);
    std::uint32_t word[11];
    for (auto& w : word) w = r.u32();
    xid = word[1];
    const std::uint32_t wanted[11] = {record::kLast | std::uint32_t(kSize - 4), word[1], 0, 2, word[4], word[5], wire::kNull, wire::kTlsFlavor, 0, 0, 0};
    Buffer as;
    XdrWriter w(as);
    for (auto one : wanted) w.u32(one);
    return std::memcmp(as.data(), bytes, size) == 0;
}

void wakeAt(const Line& line, std::size_t bytes) {
    const int least = int(bytes);
    setsockopt(line.descriptor(), SOL_SOCKET, SO_RCVLOWAT, &least, sizeof least);
}

bool closing(const Line& line) {
    pollfd state{line.descriptor(), POLLRDHUP, 0};
    return poll(&state, 1, 0) > 0;
}

Answer read(Line& line, const std::string& where, const std::string& who) {
    char bytes[kMostAnswer];
    const bool last = closing(line);
    const ssize_t n = peekSocket(line, bytes, sizeof bytes);
    if (n < 0 && errno == EAGAIN) return Answer::notYet;
    const record::Piece piece = record::front(bytes, bytes + std::max(n, ssize_t{0}));
    const bool wrong = piece.known && (!piece.last || piece.size() > sizeof bytes), half = !wrong && !piece.whole;
    if (n <= 0 || (half && last)) fail(errors::kRefused, who, where, n >= 0 ? "it closed the connection after the probe" : std::strerror(errno), "it may be ending, or full");
    wakeAt(line, half ? piece.size() : 1);
    if (half) return Answer::notYet;
    XdrReader r(wrong ? std::string_view() : piece.text());
    const auto envelope = wire::readEnvelope(r);
    if (r.good() && envelope.kind == 0) {
        const auto header = wire::readCallHeader(r, envelope.xid);
        const std::string reason(r.text());
        if (header.procedure == wire::kGoodbye && r.good()) fail(errors::kDaemonLimit, who, where, reason);
    }
    if (!r.good() || envelope.xid != kXid || envelope.kind != 1) fail(errors::kProtocol, who, where, "it does not answer the probe of TLS as ONC RPC does", "is the address right?");
    (void)recv(line.descriptor(), bytes, piece.size(), 0);
    const std::uint32_t denied = r.u32(), flavor = denied == 0 ? r.u32() : 1;
    const bool starts = flavor == 0 && r.text() == kToken && r.u32() == 0 && r.good();
    return starts ? Answer::start : Answer::plain;
}

}  // namespace probe

}  // namespace sorma::tls
