// wire.h -- sorma.x in C++: writes and reads messages with their RPC headers (RFC 5531).
//
// Writing appends a whole record with its mark, ready to be sent. Reading checks lengths, enumerations and UTF-8; a record
// that is wrong is reported by the result, and nothing in it may be used.
//
// The fields are those of sorma.x, which explains them; comments here say only what differs.
//
// Threads: no state; any thread.
// Errors:  readers never throw Error. Writers throw nothing but std::bad_alloc.
// Owner:   std::string_view members point into the record that was read, and are valid as long as it is.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "bus/message.h"
#include "bus/principal.h"
#include "bus/span.h"
#include "comm/record.h"
#include "comm/xdr.h"

namespace sorma::wire {

// kProgram: of every daemon. kProgramBase: rpcbind knows a daemon by this number plus its offset.
inline constexpr std::uint32_t kProgram = 0x20534f52, kProgramBase = 0x20000000, kVersion = 1;
// Procedures. 16 and above: the daemon sends them.
inline constexpr std::uint32_t kNull = 0, kHello = 1, kCall = 2, kCancel = 3, kHealth = 4, kSubscribe = 5, kUnsubscribe = 6, kOneway = 7, kClock = 8,
                               kGoodbye = 16, kEvent = 17, kOutdated = 18, kTraced = 19;
inline constexpr std::uint32_t kNoSlot = 0xffffffff;            // a call outside of a session

// Says for whom a call is made that is part of another one. It stands in the credentials of the RPC header; other calls have
// AUTH_NONE there.
struct Behalf {
    bool relayed = false;           // the caller's own caller chose the name: both need the right
    std::uint64_t request = 0;      // number of the request that it is part of, at the caller
    std::string callers;            // for people: who called the caller, nearest first
    std::string author = {};        // relayed: for whom, as Principal::toText() says it; empty: anyone
    TraceOrigin trace = {};         // of the trace that wants the spans of this call; its cause only of a one-way request
    std::int64_t epoch = 0;         // of the daemon's name, as the directory has told the caller; 0: it has not. comm/ownership.h
};
// relayFor: who has named the object, when it was not the owner of this process. epoch: as above. Without request and callers: of the
// present context.
Behalf behalfOf(const PrincipalPointer& relayFor, std::uint64_t request, std::string callers, std::int64_t epoch);
Behalf behalfOf(const PrincipalPointer& relayFor, std::int64_t epoch = 0);
inline constexpr std::uint32_t kBehalfFlavor = kProgram;        // flavor of these credentials
inline constexpr std::uint32_t kTlsFlavor = 7;                 // AUTH_TLS
inline constexpr std::uint32_t kBadCredentials = 1, kTooWeak = 5;     // AUTH_BADCRED, AUTH_TOOWEAK
inline constexpr const char* kWantsTls = "it wants TLS";       // what readReplyHeader() says of AUTH_TOOWEAK
inline constexpr std::size_t kMostCallers = 248, kMostAuthor = 120;     // [bytes]; RFC 5531 allows 400 for all of it

struct CallHeader {             // RPC header of a call
    std::uint32_t xid = 0, rpcVersion = 2, program = kProgram, version = kVersion, procedure = 0;
    std::string_view behalf = {};   // for readBehalf; empty: there is none
    bool probe = false;             // its credentials are AUTH_TLS (RFC 9289)
};

struct Request {                // sorma_call without the message
    std::uint32_t slot = kNoSlot, sequence = 0, deadline = 0;  // deadline: timeleft in sorma.x, see clock.h
    Method method = Method::exec;
    std::string_view name;
};

struct Times {                  // of a reply [us]
    std::uint32_t waited = 0;   // between arrival and start
    std::uint32_t ran = 0;
    std::uint32_t sub = 0;      // of which in calls to other processes
};

struct Hello {
    std::uint64_t client = 0;
    std::string user, host, program;
    std::int64_t process = 0;
    std::uint32_t maxMessage = 0;
    std::string clock = {};         // as clockSeen(); empty: its deadlines are the time left
    std::int64_t sent = 0;          // [ns] of that clock
    bool clocks = true;             // the record has the two fields above; old clients do not send them
    const char* tooLong = nullptr;  // reading: which of the texts has more than kKeptName bytes; it is left empty
    std::size_t bytes = 0;          // of that text
};

struct Welcome {
    std::uint64_t boot = 0;
    std::string name, user, host, program;
    std::int64_t process = 0, started = 0;
    std::uint32_t maxMessage = 0, slots = 0;
    bool known = false;             // the daemon still has the session of this client
    std::string clock = {}, processes = {};     // as clockSeen(), processesSeen()
    bool clocks = false;            // the record has these two; they are sent only to clients that know them
};

struct Cancel {
    std::uint32_t slot = 0, sequence = 0;
};

struct Health {
    std::string name;
    std::int64_t started = 0;
    bool busy = false;
    std::string what;
    std::uint64_t since = 0;    // [us] for how long it has been busy
    std::uint32_t underway = 0, connections = 0;
};

struct Subscription {
    std::uint32_t id = 0;
    std::string name, pattern;
    std::uint32_t keep = 1;
    bool existing = false;      // do not make the object if there is none
};

struct EventHeader {
    std::uint32_t id = 0;
    std::uint64_t number = 0, lost = 0;
};
struct EventBody {              // the part that is the same for all subscribers, so it is encoded once
    std::int64_t time = 0;      // [us since 1970]
    std::string name;
    std::uint64_t request = 0;  // in which it was published; 0: outside of any
};
struct EncodedEvent {           // as all subscribers get it
    Buffer body;                // by writeEventBody
    TraceOrigin origin;         // when the event is traced
};

// ---- writing: each appends one whole record to out ----

// Change the xid of a record that was written.
inline void setXid(char* record, std::uint32_t xid) { XdrWriter::put(record + record::kMarkSize, xid); }

// xid: chosen by the caller, returned with the answer.   program: kProgram, or the daemon's own number.   lent: as XdrWriter's.
void writeCallHeader(XdrWriter& w, const CallHeader& header, const Behalf* behalf = nullptr);
void writeCall(Buffer& out, std::uint32_t xid, std::uint32_t program, const Request& request, const Message& m,
               std::uint32_t procedure = kCall, const Behalf* behalf = nullptr, record::Lent* lent = nullptr);        // kCall or kOneway
void writeCancel(Buffer& out, std::uint32_t program, const Cancel& cancel);
void writeHealthRequest(Buffer& out, std::uint32_t xid, std::uint32_t program);
void writeHealth(Buffer& out, std::uint32_t xid, const Health& health);
void writeSubscribe(Buffer& out, std::uint32_t xid, std::uint32_t program, const Subscription& subscription,
                    const Behalf* behalf = nullptr);
void writeUnsubscribe(Buffer& out, std::uint32_t program, std::uint32_t id);
void writeEventBody(Buffer& out, const EventBody& body, const Message& content);        // no record, but the end of one
void writeEvent(Buffer& out, const EventHeader& header, const Buffer& body);            // body: from writeEventBody
// The event with this header, which comes next, is part of a trace. A client that does not know it ignores it.
void writeTraced(Buffer& out, const EventHeader& header, const TraceOrigin& origin);
void writeReply(Buffer& out, std::uint32_t xid, const Times& times, const Message& m, const Buffer* spans = nullptr, record::Lent* lent = nullptr);
void writeHello(Buffer& out, std::uint32_t xid, std::uint32_t program, const Hello& hello);
void writeWelcome(Buffer& out, std::uint32_t xid, const Welcome& welcome);
void writeClock(Buffer& out, std::uint32_t program, std::int64_t sent);
void writeNull(Buffer& out, std::uint32_t xid, std::uint32_t program);
void writeEmptyReply(Buffer& out, std::uint32_t xid);
void writeGoodbye(Buffer& out, std::string_view reason);
void writeOutdated(Buffer& out);
enum class Refusal : std::uint32_t { programUnavailable = 1, programMismatch = 2, procedureUnavailable = 3, garbage = 4 };
void writeRefusal(Buffer& out, std::uint32_t xid, Refusal refusal);     // accepted, but not done
void writeAuthError(Buffer& out, std::uint32_t xid, std::uint32_t why);
void writeRpcMismatch(Buffer& out, std::uint32_t xid);                  // not ONC RPC version 2

// ---- reading: from a record without its mark ----
//
// First readEnvelope, then readCallHeader or readReplyHeader, then the function for the procedure. Those that return bool
// return false when the record is wrong.

// First two words. kind: 0 call, 1 reply. Check r.good() after it.
struct Envelope {
    std::uint32_t xid, kind;
};
Envelope readEnvelope(XdrReader& r);
// Is a record a CANCEL? Quick, for code that looks at many; nothing else of the record is checked.
inline bool isCancel(std::string_view record) {
    constexpr std::size_t kProcedure = 20;
    return record.size() > kProcedure && XdrReader(record.substr(kProcedure)).u32() == kCancel && XdrReader(record.substr(4)).u32() == 0;
}
// Is r at the beginning of an EVENT, as writeEvent() begins it? Then moves it to what readEvent() reads. Quick: many may come.
inline bool skipEventHeader(XdrReader& r) {
    static constexpr char kHeader[] = "\0\0\0\0" "\0\0\0\0" "\0\0\0\2" "\x20SOR" "\0\0\0\1" "\0\0\0\x11" "\0\0\0\0\0\0\0\0" "\0\0\0\0\0\0\0";
    static_assert(sizeof kHeader == 40 && kProgram == 0x20534f52 && kVersion == 1 && kEvent == 17);
    return r.skipBytes(kHeader, sizeof kHeader);
}
CallHeader readCallHeader(XdrReader& r, std::uint32_t xid);             // skips credentials other than Behalf; check r.good()
// Empty when the peer accepted and executed the call; else its refusal, for people.
std::string readReplyHeader(XdrReader& r);
bool readBehalf(std::string_view body, Behalf& behalf);                 // body: CallHeader::behalf
bool readRequest(XdrReader& r, Request& request, Message& m);           // m is cleared first
// The size of a request's name and words, since each word costs work. Long texts, many numbers and bytes have fields of
// their own.
struct Extent {
    std::size_t name = 0, words = 0, bytes = 0;         // bytes: of all words, with their counts and padding
    // Memory that the words need beyond the record: one that is longer than a few bytes is a block of its own [bytes].
    std::size_t memory() const { return words * (sizeof(std::string) + 16); }
};
inline constexpr Extent kMost{64 * 1024, 64 * 1024, 1 << 20};           // that a request may have
Extent extentOf(XdrReader r);                           // r: where readRequest would begin; it is a copy
// The first long floats or ints of a call or a reply, see apart.h. Moves r to them. count 0: none are found in what is here.
// r: at the beginning of a record that need not be whole.
struct Numbers {
    bool floats = true;
    std::size_t count = 0;
};
Numbers findNumbers(XdrReader& r);
bool readReply(XdrReader& r, Times& times, Message& m, Span* span = nullptr);     // span: of the call; null: it has no trace
bool readClock(XdrReader& r, std::int64_t& sent);
bool readCancel(XdrReader& r, Cancel& cancel);
bool readHealth(XdrReader& r, Health& health);
bool readSubscription(XdrReader& r, Subscription& subscription);
bool readEvent(XdrReader& r, EventHeader& header, EventBody& body, Message& content);
bool readTraced(XdrReader& r, EventHeader& header, TraceOrigin& origin);
bool readHello(XdrReader& r, Hello& hello);
bool readWelcome(XdrReader& r, Welcome& welcome);

}  // namespace sorma::wire
