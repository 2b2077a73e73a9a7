#include "comm/tlsProbe.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>

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

const Prototype kPins{Severity::error, "TLS KEY", 1,
    "{}: {} cannot be read: {}; so nobody knows here who has spoken TLS; nothing was sent in clear; mend the file, or remove it"};

constexpr char kToken[] = "STARTTLS";
constexpr std::size_t kMostAnswer = 1024;      // [bytes]
constexpr std::uint32_t kXid = 0x544c5331;

}  // namespace

std::string pinnedSince(const std::string& name, const std::string& who) {
    // A folder that may not even be looked into is another user's, as HOME is under setpriv: then there are no pins of this one.
    struct stat there;
    if (auto why = keys::unreadable("pins"); !why.empty() && lstat(keys::file("pins").c_str(), &there) == 0) fail(kPins, who, keys::file("pins"), why);
    return keys::pinned(name);
}

bool wanted(const Address& address, const std::string& who) {
    const bool never = address.tls == Address::Tls::no;
    if (address.tls == Address::Tls::yes || (!never && keys::present())) return true;
    const std::string since = pinnedSince(address.as, who);
    if (never && !since.empty()) fail(kPinned, who, address.as, since, address.as);
    return !since.empty();
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
