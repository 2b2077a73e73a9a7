// wire.h -- sorma.x in C++: messages to bytes and back, with the RPC headers around them (RFC 5531).
//
// Everything is written behind a record mark, ready to be sent. Reading checks lengths, enumerations and UTF-8; what
// is wrong is reported, never acted upon.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "bus/message.h"
#include "comm/xdr.h"

namespace sorma::wire {

inline constexpr std::uint32_t kProgram = 0x20534f52, kProgramBase = 0x20000000, kVersion = 1;
inline constexpr std::uint32_t kNull = 0, kHello = 1, kCall = 2, kCancel = 3, kHealth = 4, kSubscribe = 5, kUnsubscribe = 6, kOneway = 7, kClock = 8,
                               kGoodbye = 16, kEvent = 17;
inline constexpr std::uint32_t kNoSlot = 0xffffffff;
inline constexpr std::uint32_t kLastFragment = 0x80000000;
inline constexpr std::size_t kMarkSize = 4;

// On whose behalf a call is made that is part of another one; in the credentials of its RPC header, where a call that
// stands for itself has AUTH_NONE.
struct Behalf {
    bool relayed = false;           // its name was chosen by the caller's own caller: the caller does not vouch for it
    std::uint64_t request = 0;      // number of the request that it is part of, at the caller
    std::string callers;            // for whom, as text, nearest first
};
inline constexpr std::uint32_t kBehalfFlavor = kProgram;        // of the credentials
inline constexpr std::size_t kMostCallers = 256;                // [bytes]; RFC 5531 allows 400 for all of it

struct CallHeader {             // RPC header of a call
    std::uint32_t xid = 0, rpcVersion = 2, program = kProgram, version = kVersion, procedure = 0;
    std::string_view behalf = {};   // its body, when there is one
};

struct Request {                // sorma_call without the message
    std::uint32_t slot = kNoSlot, sequence = 0, deadline = 0;  // deadline: see sorma.x
    Method method = Method::exec;
    std::string_view name;      // views into the record
};

struct Times {                  // microseconds
    std::uint32_t waited = 0, ran = 0, sub = 0;
};

struct Hello {
    std::uint64_t client = 0;
    std::string user, host, program;
    std::int64_t process = 0;
    std::uint32_t maxMessage = 0;
    std::string clock = {};         // as clockSeen(); empty: deadlines are said as time left
    std::int64_t sent = 0;          // [ns] of that clock
    bool clocks = true;             // it knows of clocks: the record does not end before them
};

struct Welcome {
    std::uint64_t boot = 0;
    std::string name, user, host, program;
    std::int64_t process = 0, started = 0;
    std::uint32_t maxMessage = 0, slots = 0;
    bool known = false;
    std::string clock = {}, processes = {};     // as clockSeen(), processesSeen()
    bool clocks = false;            // they are in the record
};

struct Cancel {
    std::uint32_t slot = 0, sequence = 0;
};

struct Health {
    std::string name;
    std::int64_t started = 0;
    bool busy = false;
    std::string what;
    std::uint64_t since = 0;    // microseconds
    std::uint32_t underway = 0, connections = 0;
};

struct Subscription {
    std::uint32_t id = 0;
    std::string name, pattern;
    std::uint32_t keep = 1;
    bool existing = false;      // for those who look on: no object is made for it
};

struct EventHeader {
    std::uint32_t id = 0;
    std::uint64_t number = 0, lost = 0;
};
struct EventBody {              // the same for all subscribers
    std::int64_t time = 0;
    std::string name;
    std::uint64_t request = 0;
};

// ---- writing: each appends one whole record to out ----

// Start a record; closeRecord fills in its mark. Returns where it started.
inline std::size_t openRecord(Buffer& out) {
    std::size_t start = out.size();
    out.extend(kMarkSize);
    return start;
}
inline void closeRecord(Buffer& out, std::size_t start) {
    XdrWriter::put(out.data() + start, kLastFragment | static_cast<std::uint32_t>(out.size() - start - kMarkSize));
}

void writeCallHeader(XdrWriter& w, const CallHeader& header, const Behalf* behalf = nullptr);
void writeCall(Buffer& out, std::uint32_t xid, std::uint32_t program, const Request& request, const Message& m,
               std::uint32_t procedure = kCall, const Behalf* behalf = nullptr);        // kCall or kOneway
void writeCancel(Buffer& out, std::uint32_t program, const Cancel& cancel);
void writeHealthRequest(Buffer& out, std::uint32_t xid, std::uint32_t program);
void writeHealth(Buffer& out, std::uint32_t xid, const Health& health);
void writeSubscribe(Buffer& out, std::uint32_t xid, std::uint32_t program, const Subscription& subscription,
                    const Behalf* behalf = nullptr);
void writeUnsubscribe(Buffer& out, std::uint32_t program, std::uint32_t id);
void writeEventBody(Buffer& out, const EventBody& body, const Message& content);        // no record: the end of one
void writeEvent(Buffer& out, const EventHeader& header, const Buffer& body);
void writeReply(Buffer& out, std::uint32_t xid, const Times& times, const Message& m);
void writeHello(Buffer& out, std::uint32_t xid, std::uint32_t program, const Hello& hello);
void writeWelcome(Buffer& out, std::uint32_t xid, const Welcome& welcome);
void writeClock(Buffer& out, std::uint32_t program, std::int64_t sent);
void writeNull(Buffer& out, std::uint32_t xid, std::uint32_t program);
void writeEmptyReply(Buffer& out, std::uint32_t xid);
void writeGoodbye(Buffer& out, std::string_view reason);
enum class Refusal : std::uint32_t { programUnavailable = 1, programMismatch = 2, procedureUnavailable = 3, garbage = 4 };
void writeRefusal(Buffer& out, std::uint32_t xid, Refusal refusal);     // accepted, but not done
void writeRpcMismatch(Buffer& out, std::uint32_t xid);                  // not ONC RPC version 2

// ---- reading: from the record without its mark ----

// First two words. kind: 0 call, 1 reply.
struct Envelope {
    std::uint32_t xid, kind;
};
Envelope readEnvelope(XdrReader& r);
// Is a record a CANCEL? A look at its words, for those who look at many.
inline bool isCancel(std::string_view record) {
    constexpr std::size_t kProcedure = 20;
    return record.size() > kProcedure && XdrReader(record.substr(kProcedure)).u32() == kCancel && XdrReader(record.substr(4)).u32() == 0;
}
CallHeader readCallHeader(XdrReader& r, std::uint32_t xid);             // after the envelope; skips credentials
// After the envelope of a reply: empty when it was accepted and done, else what the peer objects to, in words.
std::string readReplyHeader(XdrReader& r);
bool readBehalf(std::string_view body, Behalf& behalf);
bool readRequest(XdrReader& r, Request& request, Message& m);           // m is cleared first
// Memory that the words of a request take beyond its bytes. r: where readRequest would begin.
std::size_t wordsSize(XdrReader r);
bool readReply(XdrReader& r, Times& times, Message& m);
bool readClock(XdrReader& r, std::int64_t& sent);
bool readCancel(XdrReader& r, Cancel& cancel);
bool readHealth(XdrReader& r, Health& health);
bool readSubscription(XdrReader& r, Subscription& subscription);
bool readEvent(XdrReader& r, EventHeader& header, EventBody& body, Message& content);
bool readHello(XdrReader& r, Hello& hello);
bool readWelcome(XdrReader& r, Welcome& welcome);

}  // namespace sorma::wire
