#include "comm/wire.h"

#include <algorithm>

#include "bus/call.h"
#include "bus/kept.h"
#include "bus/requestText.h"
#include "comm/wireSpan.h"

namespace sorma::wire {

namespace {

constexpr std::size_t kMostCallersRead = 256;      // those who do not name an author may write so much
constexpr std::string_view kTooLong = "too many authors";       // as Principal::toText() says it

constexpr std::uint32_t kCallKind = 0, kReplyKind = 1;
constexpr std::uint32_t kMaxCredential = 400;       // RFC 5531, section 8.2

// Writes a whole record.
class Record : public XdrWriter {
public:
    explicit Record(Buffer& out, record::Lent* lent = nullptr) : XdrWriter(out, lent), out_(out), start_(record::open(out)) {}
    ~Record() { record::close(out_, start_, lent_ ? lent_->size() : 0); }
    Record(const Record&) = delete;
    Record& operator=(const Record&) = delete;

private:
    Buffer& out_;
    const std::size_t start_;
};

void writeMessage(XdrWriter& w, const Message& m) {
    if (m.text.empty() && m.floats.empty() && m.ints.empty() && m.any.empty()) {
        w.words(0, 0, 0, 0);
    } else {
        w.text(m.text);
        w.array64(m.floats);
        w.array64(m.ints);
        w.bytes(m.any.data(), m.any.size());
    }
    w.texts(m.words);
}

bool readMessage(XdrReader& r, Message& m) {
    if (r.skipZeros(16)) {              // none of the four
        m.text.clear();
        m.floats.clear();
        m.ints.clear();
        m.any.clear();
    } else {
        r.text(m.text);
        r.array64(m.floats);
        r.array64(m.ints);
        r.bytes(m.any);
    }
    r.texts(m.words);
    if (!m.text.empty() && !isUtf8(m.text)) r.spoil();
    for (auto& word : m.words)
        if (!isUtf8(word)) r.spoil();
    return r.good();
}

void writeTrail(XdrWriter& w, const Trail& trail) {
    w.words(trail.dropped(), trail.entries().size());
    for (auto& e : trail.entries()) {
        w.u32(static_cast<std::uint32_t>(e.severity));
        w.text(e.symbol);
        w.texts(e.details);
        w.text(e.text);
        w.text(e.so);
        w.text(e.daemon);
        w.text(e.file);
        w.i32(e.line);
        w.i64(e.time);
        w.text(e.request);
    }
}

// Text of a trail is shown to people and becomes Tcl's. Bytes that are not UTF-8 are replaced, not refused, since an error
// message that cannot be delivered helps nobody.
std::string clean(std::string_view text) {
    std::string out(text);
    if (!isUtf8(out))
        for (char& c : out)
            if (static_cast<unsigned char>(c) >= 0x80) c = '?';
    return out;
}

// A claim stands within a line of the audit, and must not begin another one.
std::string oneLine(std::string_view text) {
    std::string out = clean(text);
    for (char& c : out)
        if (static_cast<unsigned char>(c) < ' ' || c == 0x7f) c = '?';
    return out;
}

bool readTrail(XdrReader& r, Trail& trail) {
    std::size_t dropped = r.u32();
    std::size_t n = r.count(48);
    if (n == 0 && dropped == 0) [[likely]] return r.good();
    // Trimmed once for as many entries as it may hold, so that a peer's trail of a million costs only the reading of it.
    Trail read;
    auto flush = [&] {
        trail.append(read);
        read.clear();
    };
    for (std::size_t i = 0; i < n && r.good(); ++i) {
        Entry e;
        std::uint32_t severity = r.u32();
        if (severity > 2) r.spoil();
        e.severity = static_cast<Severity>(severity);
        e.symbol = clean(r.text());
        r.texts(e.details);
        for (auto& d : e.details) d = clean(d);
        e.text = clean(r.text());
        e.so = clean(r.text());
        e.daemon = clean(r.text());
        e.file = clean(r.text());
        e.line = r.i32();
        e.time = r.i64();
        e.request = clean(r.text());
        if (!r.good()) break;
        read.add(std::move(e));
        if (read.entries().size() >= Trail::limit()) flush();
    }
    flush();
    trail.setDropped(trail.dropped() + dropped);
    return r.good();
}

void writeAccepted(XdrWriter& w, std::uint32_t xid, std::uint32_t status) {
    w.words(xid, kReplyKind, 0, 0, 0, status);                      // accepted, no verifier
}

}  // namespace

Behalf behalfOf(const PrincipalPointer& relayFor, std::uint64_t request, std::string callers, std::int64_t epoch) {
    return {relayFor != nullptr, request, std::move(callers), relayFor ? relayFor->toText() : std::string(), {}, epoch};
}

Behalf behalfOf(const PrincipalPointer& relayFor, std::int64_t epoch) {
    Behalf behalf = behalfOf(relayFor, CallContext::currentRequest(), CallContext::currentCallers(), epoch);
    if (CallContext* context = CallContext::current(); context && context->span && context->span->elsewhere) behalf.trace.number = context->span->share->number;
    return behalf;
}

// The length tells what stands behind the author: trace; trace, cause; epoch; or all of them.
constexpr std::size_t kTraceBytes = 16, kCauseBytes = 8, kEpochBytes = 8;

void writeCallHeader(XdrWriter& w, const CallHeader& h, const Behalf* behalf) {
    w.words(h.xid, kCallKind, h.rpcVersion, h.program, h.version, h.procedure);
    if (behalf) [[unlikely]] {
        const bool traced(behalf->trace.number), dated = behalf->epoch != 0, caused = behalf->trace || (traced && dated);
        const std::size_t more = (traced ? kTraceBytes : 0) + (caused ? kCauseBytes : 0) + (dated ? kEpochBytes : 0);
        std::string_view callers = std::string_view(behalf->callers).substr(0, kMostCallers - (traced ? kTraceBytes : 0) - (dated ? kEpochBytes : 0));
        while (!callers.empty() && !isUtf8(callers)) callers.remove_suffix(1);
        w.u32(kBehalfFlavor);
        std::string_view author = behalf->author.size() <= kMostAuthor ? std::string_view(behalf->author) : kTooLong;
        const bool named = more > 0 || (behalf->relayed && !author.empty());
        w.u32(static_cast<std::uint32_t>(16 + XdrWriter::padded(callers.size()) + (named ? 4 + XdrWriter::padded(author.size()) : 0) + more));
        w.u32(behalf->relayed);
        w.u64(behalf->request);
        w.text(callers);
        if (named) w.text(author);
        if (traced) w.u64(behalf->trace.number.high), w.u64(behalf->trace.number.low);
        if (caused) w.u64(behalf->trace.cause);
        if (dated) w.u64(std::uint64_t(behalf->epoch));
        w.words(0, 0);
    } else {
        w.words(0, 0, 0, 0);
    }
}

bool readBehalf(std::string_view body, Behalf& behalf) {
    XdrReader r(body);
    behalf.relayed = r.u32() != 0;
    behalf.request = r.u64();
    auto callers = r.text();
    if (!r.good() || callers.size() > kMostCallersRead || !isUtf8(callers)) return false;
    behalf.callers = oneLine(callers);
    if (r.left() == 0) return true;
    auto author = r.text();
    if (behalf.relayed) {
        if (!r.good() || author.size() > kMostAuthor || !isUtf8(author)) return false;
        behalf.author = author;
    }
    const std::size_t more = r.left();
    const bool dated = more == kEpochBytes || more == kTraceBytes + kCauseBytes + kEpochBytes, caused = more >= kTraceBytes + kCauseBytes;
    if (!r.good() || (more != kTraceBytes && more != kTraceBytes + kCauseBytes && !dated)) return true;
    if (more >= kTraceBytes) behalf.trace.number = {r.u64(), r.u64()};
    if (caused) behalf.trace.cause = r.u64();
    if (dated) behalf.epoch = std::max<std::int64_t>(std::int64_t(r.u64()), 0);
    return true;
}

void writeCall(Buffer& out, std::uint32_t xid, std::uint32_t program, const Request& request, const Message& m,
               std::uint32_t procedure, const Behalf* behalf, record::Lent* lent) {
    Record w(out, lent);
    writeCallHeader(w, {xid, 2, program, kVersion, procedure}, behalf);
    w.words(request.slot, request.sequence, request.deadline, request.method);
    w.text(request.name);
    writeMessage(w, m);
}

void writeReply(Buffer& out, std::uint32_t xid, const Times& times, const Message& m, const Buffer* spans, record::Lent* lent) {
    Record w(out, lent);
    writeAccepted(w, xid, 0);
    w.words(m.code, times.waited, times.ran, times.sub);
    writeMessage(w, m);
    writeTrail(w, m.trail);
    if (spans) w.bytes(spans->data(), spans->size());
}

void writeCancel(Buffer& out, std::uint32_t program, const Cancel& c) {
    Record w(out);
    writeCallHeader(w, {0, 2, program, kVersion, kCancel});
    w.words(c.slot, c.sequence);
}

void writeHealthRequest(Buffer& out, std::uint32_t xid, std::uint32_t program) {
    Record w(out);
    writeCallHeader(w, {xid, 2, program, kVersion, kHealth});
}

void writeHealth(Buffer& out, std::uint32_t xid, const Health& h) {
    Record w(out);
    writeAccepted(w, xid, 0);
    w.text(h.name);
    w.i64(h.started);
    w.u32(h.busy);
    w.text(h.what);
    w.u64(h.since);
    w.words(h.underway, h.connections);
}

constexpr std::uint32_t kExisting = 0x80000000;        // in keep: see sorma.x

void writeSubscribe(Buffer& out, std::uint32_t xid, std::uint32_t program, const Subscription& s, const Behalf* behalf) {
    Record w(out);
    writeCallHeader(w, {xid, 2, program, kVersion, kSubscribe}, behalf);
    w.u32(s.id);
    w.text(s.name);
    w.text(s.pattern);
    w.u32(s.keep | (s.existing ? kExisting : 0));
}

void writeUnsubscribe(Buffer& out, std::uint32_t program, std::uint32_t id) {
    Record w(out);
    writeCallHeader(w, {0, 2, program, kVersion, kUnsubscribe});
    w.u32(id);
}

void writeEventBody(Buffer& out, const EventBody& body, const Message& content) {
    XdrWriter w(out);
    w.i64(body.time);
    w.text(body.name);
    writeMessage(w, content);
    w.u64(body.request);
}

void writeEvent(Buffer& out, const EventHeader& h, const Buffer& body) {
    Record w(out);
    const auto high = [](std::uint64_t v) { return static_cast<std::uint32_t>(v >> 32); };
    w.words(0, kCallKind, 2, kProgram, kVersion, kEvent, 0, 0, 0, 0, h.id, high(h.number), h.number, high(h.lost), h.lost);
    out.append(body.data(), body.size());
}

void writeTraced(Buffer& out, const EventHeader& h, const TraceOrigin& origin) {
    Record w(out);
    writeCallHeader(w, {0, 2, kProgram, kVersion, kTraced});
    w.u32(h.id);
    w.u64(h.number);
    w.u64(origin.number.high);
    w.u64(origin.number.low);
    w.u64(origin.cause);
}

void writeHello(Buffer& out, std::uint32_t xid, std::uint32_t program, const Hello& h) {
    Record w(out);
    writeCallHeader(w, {xid, 2, program, kVersion, kHello});
    w.u64(h.client);
    w.text(cutText(h.user, kKeptName));
    w.text(cutText(h.host, kKeptName));
    w.i64(h.process);
    w.text(cutText(h.program, kKeptName));
    w.u32(h.maxMessage);
    w.text(h.clock);
    w.i64(h.sent);
}

void writeWelcome(Buffer& out, std::uint32_t xid, const Welcome& v) {
    Record w(out);
    writeAccepted(w, xid, 0);
    w.u64(v.boot);
    w.text(v.name);
    w.text(v.user);
    w.text(v.host);
    w.i64(v.process);
    w.text(v.program);
    w.words(v.maxMessage, v.slots);
    w.i64(v.started);
    w.u32(v.known);
    if (v.clocks) {
        w.text(v.clock);
        w.text(v.processes);
    }
}

void writeClock(Buffer& out, std::uint32_t program, std::int64_t sent) {
    Record w(out);
    writeCallHeader(w, {0, 2, program, kVersion, kClock});
    w.i64(sent);
}

void writeNull(Buffer& out, std::uint32_t xid, std::uint32_t program) {
    Record w(out);
    writeCallHeader(w, {xid, 2, program, kVersion, kNull});
}

void writeEmptyReply(Buffer& out, std::uint32_t xid) {
    Record w(out);
    writeAccepted(w, xid, 0);
}

void writeGoodbye(Buffer& out, std::string_view reason) {
    Record w(out);
    writeCallHeader(w, {0, 2, kProgram, kVersion, kGoodbye});
    w.text(reason);
}

void writeOutdated(Buffer& out) {
    Record w(out);
    writeCallHeader(w, {0, 2, kProgram, kVersion, kOutdated});
}

void writeRefusal(Buffer& out, std::uint32_t xid, Refusal refusal) {
    Record w(out);
    writeAccepted(w, xid, static_cast<std::uint32_t>(refusal));
    if (refusal == Refusal::programMismatch) w.words(kVersion, kVersion);       // lowest and highest version served
}

void writeRpcMismatch(Buffer& out, std::uint32_t xid) {
    Record w(out);
    w.words(xid, kReplyKind, 1, 0, 2, 2);       // denied, RPC_MISMATCH, 2 .. 2
}

void writeAuthError(Buffer& out, std::uint32_t xid, std::uint32_t why) {
    Record w(out);
    w.words(xid, kReplyKind, 1, 1, why);        // denied, AUTH_ERROR
}

Envelope readEnvelope(XdrReader& r) {
    std::uint32_t xid, kind;
    r.words(xid, kind);
    if (kind > kReplyKind) r.spoil();
    return {xid, kind};
}

CallHeader readCallHeader(XdrReader& r, std::uint32_t xid) {
    CallHeader h;
    h.xid = xid;
    r.words(h.rpcVersion, h.program, h.version, h.procedure);
    // Credentials and verifier: the session says who calls, not these. Ours say on whose behalf.
    if (r.skipZeros(16)) [[likely]] return h;           // AUTH_NONE
    const std::uint32_t flavor = r.u32();
    auto credentials = r.text();
    r.u32();
    if (credentials.size() > kMaxCredential || r.text().size() > kMaxCredential) r.spoil();
    if (flavor == kBehalfFlavor) [[unlikely]] h.behalf = credentials;
    h.probe = flavor == kTlsFlavor;
    return h;
}

std::string readReplyHeader(XdrReader& r) {
    if (r.skipZeros(16)) [[likely]] return {};          // accepted, no verifier, successful
    std::uint32_t denied = r.u32();
    if (!r.good() || denied > 1) return "a malformed reply";
    if (denied == 1) {
        std::uint32_t why = r.u32(), low = r.u32(), high = r.u32();
        if (why == 0) return "it serves ONC RPC version " + std::to_string(low) + " to " + std::to_string(high) + ", not 2";
        return why == 1 && low == kTooWeak ? kWantsTls : "it wants authentication";
    }
    r.u32();
    if (r.text().size() > kMaxCredential) r.spoil();
    std::uint32_t status = r.u32();
    if (!r.good()) return "a malformed reply";
    switch (status) {
        case 0: return {};
        case 1: return "it does not serve the program SORMA";
        case 2: {
            std::uint32_t low = r.u32(), high = r.u32();
            return "it serves versions " + std::to_string(low) + " to " + std::to_string(high) + " of the program, not " +
                   std::to_string(kVersion);
        }
        case 3: return "it does not know the procedure";
        case 4: return "it could not decode the request";
        default: return "a system error at the daemon";
    }
}

bool readRequest(XdrReader& r, Request& request, Message& m) {
    m.code = 0;
    m.trail.clear();
    std::uint32_t method;
    r.words(request.slot, request.sequence, request.deadline, method);
    if (method > 2) r.spoil();
    request.method = static_cast<Method>(method);
    request.name = r.text();
    return readMessage(r, m) && r.atEnd();
}

Extent extentOf(XdrReader r) {
    r.skip(16);
    Extent extent;
    extent.name = r.text().size();
    r.text();
    r.skip64();                                                     // floats
    r.skip64();                                                     // ints
    if (!r.good()) return {};
    r.text();
    extent.words = r.count(4);
    extent.bytes = r.left();
    return extent;
}

Numbers findNumbers(XdrReader& r) {
    const Envelope envelope = readEnvelope(r);
    if (!r.good()) return {};
    if (envelope.kind == kCallKind) {
        const CallHeader header = readCallHeader(r, envelope.xid);
        if (header.procedure != kCall && header.procedure != kOneway) return {};
        r.skip(16);
        r.text();                                                   // the name
    } else {
        if (!r.skipZeros(16)) return {};
        r.skip(16);
    }
    r.text();
    for (const bool floats : {true, false}) {
        const std::size_t n = r.u32();
        if (!r.good() || 8 * n >= record::kLong) return {floats, r.good() ? n : 0};
        r.skip(8 * n);
    }
    return {};
}

bool readReply(XdrReader& r, Times& times, Message& m, Span* span) {
    std::uint32_t code;
    r.words(code, times.waited, times.ran, times.sub);
    m.code = static_cast<std::int32_t>(code);
    m.trail.clear();
    if (!readMessage(r, m) || !readTrail(r, m.trail)) return false;
    if (!span || r.atEnd()) return r.good() && r.atEnd();
    const auto spans = r.text();
    if (!r.good() || !r.atEnd()) return false;
    readSpans(spans, *span);            // if they cannot be read, the reply is as good
    return true;
}

bool readClock(XdrReader& r, std::int64_t& sent) {
    sent = r.i64();
    return r.good() && r.atEnd();
}

bool readCancel(XdrReader& r, Cancel& c) {
    c.slot = r.u32();
    c.sequence = r.u32();
    return r.good() && r.atEnd();
}

bool readHealth(XdrReader& r, Health& h) {
    h.name = clean(r.text());
    h.started = r.i64();
    h.busy = r.u32() != 0;
    h.what = clean(r.text());
    h.since = r.u64();
    h.underway = r.u32();
    h.connections = r.u32();
    return r.good() && r.atEnd();
}

bool readSubscription(XdrReader& r, Subscription& s) {
    s.id = r.u32();
    s.name = clean(r.text());
    s.pattern = clean(r.text());
    s.keep = r.u32();
    s.existing = s.keep & kExisting;
    s.keep &= ~kExisting;
    return r.good() && r.atEnd();
}

bool readEvent(XdrReader& r, EventHeader& h, EventBody& body, Message& content) {
    h.id = r.u32();
    h.number = r.u64();
    h.lost = r.u64();
    body.time = r.i64();
    body.name = clean(r.text());
    content.code = 0;
    content.trail.clear();
    if (!readMessage(r, content)) return false;
    body.request = r.atEnd() ? 0 : r.u64();
    return r.good() && r.atEnd();
}

bool readTraced(XdrReader& r, EventHeader& h, TraceOrigin& origin) {
    h.id = r.u32();
    h.number = r.u64();
    origin.number = {r.u64(), r.u64()};
    origin.cause = r.u64();
    return r.good() && r.atEnd() && origin.number && origin;
}

bool readHello(XdrReader& r, Hello& h) {
    auto text = [&](const char* what) {
        std::string_view given = r.text();
        if (given.size() <= kKeptName) return oneLine(given);
        h.tooLong = what;
        h.bytes = given.size();
        return std::string();
    };
    h.client = r.u64();
    h.user = text("user");
    h.host = text("host");
    h.process = r.i64();
    h.program = text("program");
    h.maxMessage = r.u32();
    h.clock.clear();
    h.clocks = !r.atEnd();
    if (h.clocks) {
        h.clock = text("clock");
        h.sent = r.i64();
    }
    return r.good() && r.atEnd();
}

bool readWelcome(XdrReader& r, Welcome& v) {
    v.boot = r.u64();
    auto text = [&] { return oneLine(cutText(r.text(), kKeptName)); };
    v.name = text();
    v.user = text();
    v.host = text();
    v.process = r.i64();
    v.program = text();
    v.maxMessage = r.u32();
    v.slots = r.u32();
    v.started = r.i64();
    v.known = r.u32() != 0;
    v.clock.clear();
    v.processes.clear();
    v.clocks = !r.atEnd();
    if (v.clocks) {
        v.clock = clean(r.text());
        v.processes = clean(r.text());
    }
    return r.good() && r.atEnd();
}

}  // namespace sorma::wire
