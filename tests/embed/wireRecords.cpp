// wireRecords.cpp -- checks of what stands in a record: written and read again, cut, too long, or not UTF-8. No connection.
//
//     wireRecords GROUP      runs one group; tests/wire.test has a test for each. See checks.h.
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "bus/kept.h"
#include "bus/sorm.h"
#include "comm/wire.h"
#include "comm/wireSpan.h"
#include "checks.h"

using namespace sorma;
using namespace sorma::wire;

namespace {

// A record without its mark.
template <class Write> std::string written(Write write) {
    Buffer out;
    write(out);
    return {out.data() + record::kMarkSize, out.size() - record::kMarkSize};
}
// Is a record a call of this procedure, or a reply, that READ can read?
template <class Read> bool isCall(std::string_view record, std::uint32_t procedure, Read read) {
    XdrReader r(record);
    const Envelope envelope = readEnvelope(r);
    if (!r.good() || envelope.kind != 0) return false;
    const CallHeader h = readCallHeader(r, envelope.xid);
    return r.good() && h.rpcVersion == 2 && h.version == kVersion && h.procedure == procedure && read(r, h);
}
template <class Read> bool isReply(std::string_view record, Read read) {
    XdrReader r(record);
    return readEnvelope(r).kind == 1 && readReplyHeader(r).empty() && r.good() && read(r);
}
// The sizes of a record's beginnings that CHECK accepts, less the size of all of it; a word more may follow.
template <class Check> std::string accepted(const std::string& record, Check check) {
    std::string out;
    for (std::size_t n = 0; n <= record.size() + 4; ++n)
        if (check((record + std::string(4, '\0')).substr(0, n))) out += (out.empty() ? "" : " ") + std::to_string(int(n) - int(record.size()));
    return out;
}

Message full() {
    Message m;
    m.text = "t\xc3\xa4xt";
    m.floats = {1.5, -2};
    m.ints = {-3, std::int64_t{1} << 40};
    m.any = {0, 255, 7};
    m.words = {"-a", "", "bcd\xe2\x82\xac"};
    return m;
}
bool alike(const Message& a, const Message& b) { return a.text == b.text && a.floats == b.floats && a.ints == b.ints && a.any == b.any && a.words == b.words; }

// ---- each kind ----

void testCalls() {
    for (const bool empty : {false, true}) {
        const Message sent = empty ? Message() : full();
        const std::string record = written([&](Buffer& out) { writeCall(out, 5, kProgram, {3, 4, 6, Method::dbx, "nop.a"}, sent); });
        auto read = [&](std::string_view bytes) {
            return isCall(bytes, kCall, [&](XdrReader& r, const CallHeader& h) {
                Request q;
                Message m = full();
                m.code = 9;
                m.trail.setDropped(1);
                return readRequest(r, q, m) && h.xid == 5 && h.program == kProgram && h.behalf.empty() && q.slot == 3 && q.sequence == 4 && q.deadline == 6 &&
                       q.method == Method::dbx && q.name == "nop.a" && alike(m, sent) && m.code == 0 && m.trail.empty();
            });
        };
        EQUAL(accepted(record, read), "0");
    }
    const std::string bad = written([&](Buffer& out) { writeCall(out, 5, kProgram, {3, 4, 6, static_cast<Method>(3), "nop.a"}, Message()); });
    CHECK(!isCall(bad, kCall, [](XdrReader& r, auto&) {
        Request q;
        Message m;
        return readRequest(r, q, m);
    }));
}

Entry entry(int number) {
    Entry e{Severity::warning, "AREA SYMBOL", {"one", ""}, "text", "so", "daemon", "file.cpp", number, 1234567890123, "so EXEC"};
    return e;
}

void testReplies() {
    Message sent = full();
    sent.code = -7;
    sent.trail.add(entry(1));
    sent.trail.add(entry(2));
    sent.trail.setDropped(3);
    for (const bool withTrail : {true, false}) {
        if (!withTrail) sent.trail.clear();
        const std::string record = written([&](Buffer& out) { writeReply(out, 8, {10, 20, 30}, sent); });
        auto read = [&](std::string_view bytes) {
            return isReply(bytes, [&](XdrReader& r) {
                Times times;
                Message m;
                m.trail.add(entry(3));
                return readReply(r, times, m) && times.waited == 10 && times.ran == 20 && times.sub == 30 && m.code == -7 && alike(m, sent) && m.trail == sent.trail;
            });
        };
        EQUAL(accepted(record, read), "0");
    }
    // A trail that has dropped all that it had.
    sent.trail.setDropped(2);
    const std::string record = written([&](Buffer& out) { writeReply(out, 8, {}, sent); });
    CHECK(isReply(record, [](XdrReader& r) {
        Times times;
        Message m;
        return readReply(r, times, m) && m.trail.dropped() == 2 && m.trail.entries().empty();
    }));
}

void testTrails() {
    auto read = [](const Entry& e, std::size_t times, Message& m) {
        Message sent;
        Trail::setLimit(1000);
        for (std::size_t i = 0; i < times; ++i) sent.trail.add(e);
        const std::string record = written([&](Buffer& out) { writeReply(out, 8, {}, sent); });
        Trail::setLimit(Trail::kDefaultLimit);
        return isReply(record, [&](XdrReader& r) {
            Times none;
            return readReply(r, none, m);
        });
    };
    Message m;
    Entry e = entry(1);
    e.severity = static_cast<Severity>(3);
    CHECK(!read(e, 1, m));
    e = {Severity::error, "A\xff", {"B\xff"}, "C\xff\xc3\xa4", "D\xff", "E\xff", "F\xff", 1, 2, "G\xff"};
    CHECK(read(e, 1, m) && m.trail.entries().size() == 1);
    const Entry& is = m.trail.entries().at(0);
    EQUAL(is.symbol + is.details.at(0) + is.text + is.so + is.daemon + is.file + is.request, "A?B?C???D?E?F?G?");
    CHECK(read(entry(1), 900, m) && m.trail.entries().size() == Trail::kDefaultLimit && m.trail.dropped() == 900 - Trail::kDefaultLimit);
}

void testGreetings() {
    Hello hello{~std::uint64_t{0} - 1, "user", "host", "program", 1234, 5678, "clock", 42};
    const std::string record = written([&](Buffer& out) { writeHello(out, 2, kProgram, hello); });
    // One that ends before the clock is an old client's: 12 + 8 bytes less.
    auto read = [&](std::string_view bytes) {
        return isCall(bytes, kHello, [&](XdrReader& r, auto&) {
            Hello h;
            h.clock = "left over";
            return readHello(r, h) && h.client == hello.client && h.user == "user" && h.host == "host" && h.program == "program" && h.process == 1234 &&
                   h.maxMessage == 5678 && (h.clocks ? h.clock == "clock" && h.sent == 42 : h.clock.empty()) && !h.tooLong;
        });
    };
    EQUAL(accepted(record, read), "-20 0");
    for (const bool clocks : {true, false}) {
        const Welcome welcome{~std::uint64_t{0} - 2, "name", "user", "host", "program", 1234, 99, 5678, 64, true, "clock", "processes", clocks};
        const std::string answer = written([&](Buffer& out) { writeWelcome(out, 3, welcome); });
        auto readAnswer = [&](std::string_view bytes) {
            return isReply(bytes, [&](XdrReader& r) {
                Welcome v;
                v.clock = v.processes = "left over";
                return readWelcome(r, v) && v.boot == welcome.boot && v.name == "name" && v.user == "user" && v.host == "host" && v.program == "program" &&
                       v.process == 1234 && v.started == 99 && v.maxMessage == 5678 && v.slots == 64 && v.known &&
                       (v.clocks ? v.clock == "clock" && v.processes == "processes" : v.clock.empty() && v.processes.empty());
            });
        };
        EQUAL(accepted(answer, readAnswer), clocks ? "-28 0" : "0");
    }
}

// A claim is a line for people: it is not longer than is kept, and begins no other line.
void testClaims() {
    auto read = [](Hello sent, Hello& h) {
        // As a peer would write it, who keeps no rule.
        const std::string record = written([&](Buffer& out) {
            const std::size_t start = record::open(out);
            XdrWriter w(out);
            writeCallHeader(w, {2, 2, kProgram, kVersion, kHello});
            w.u64(1);
            for (auto* text : {&sent.user, &sent.host}) w.text(*text);
            w.i64(0);
            w.text(sent.program);
            w.u32(0);
            w.text(sent.clock);
            w.i64(0);
            record::close(out, start);
        });
        return isCall(record, kHello, [&](XdrReader& r, auto&) { return readHello(r, h); });
    };
    const std::string most(kKeptName, 'x'), more(kKeptName + 1, 'x');
    Hello h;
    CHECK(read({1, "a\nb\x7f\x1f ", "\xff", most, 0, 0, most}, h) && !h.tooLong && h.user == "a?b?? " && h.host == "?" && h.program == most && h.clock == most);
    for (const std::string_view which : {"user", "host", "program", "clock"}) {
        Hello sent;
        (which == "user" ? sent.user : which == "host" ? sent.host : which == "program" ? sent.program : sent.clock) = more;
        Hello got;
        CHECK(read(sent, got) && got.tooLong == which && got.bytes == more.size());
    }
    // A daemon's are cut, since it is the client who has asked.
    const std::string answer = written([&](Buffer& out) { writeWelcome(out, 3, {1, more, "a\nb", more, "\xff", 0, 0, 0, 0, false, "\xff", "\xff", true}); });
    CHECK(isReply(answer, [](XdrReader& r) {
        Welcome v;
        return readWelcome(r, v) && v.name.size() <= kKeptName && v.user == "a?b" && v.host.size() <= kKeptName && v.program == "?" && v.clock == "?" &&
               v.processes == "?" && !v.known;
    }));
}

void testOthers() {
    const std::string cancel = written([](Buffer& out) { writeCancel(out, kProgram, {6, 7}); });
    EQUAL(accepted(cancel, [](std::string_view bytes) {
        return isCall(bytes, kCancel, [](XdrReader& r, auto&) {
            Cancel c;
            return readCancel(r, c) && c.slot == 6 && c.sequence == 7;
        });
    }), "0");
    CHECK(isCancel(cancel) && !isCancel(written([](Buffer& out) { writeClock(out, kProgram, 6); })));
    EQUAL(accepted(written([](Buffer& out) { writeClock(out, kProgram, -6); }), [](std::string_view bytes) {
        return isCall(bytes, kClock, [](XdrReader& r, auto&) {
            std::int64_t sent = 0;
            return readClock(r, sent) && sent == -6;
        });
    }), "0");
    EQUAL(accepted(written([](Buffer& out) { writeHealth(out, 1, {"name", 5, true, "what\xff", 6, 7, 8}); }), [](std::string_view bytes) {
        return isReply(bytes, [](XdrReader& r) {
            Health h;
            return readHealth(r, h) && h.name == "name" && h.started == 5 && h.busy && h.what == "what?" && h.since == 6 && h.underway == 7 && h.connections == 8;
        });
    }), "0");
    for (const bool existing : {false, true})
        EQUAL(accepted(written([&](Buffer& out) { writeSubscribe(out, 1, kProgram, {3, "name", "pattern", 5, existing}); }), [&](std::string_view bytes) {
            return isCall(bytes, kSubscribe, [&](XdrReader& r, auto&) {
                Subscription s;
                return readSubscription(r, s) && s.id == 3 && s.name == "name" && s.pattern == "pattern" && s.keep == 5 && s.existing == existing;
            });
        }), "0");
    Buffer body;
    writeEventBody(body, {9, "name", 11}, full());
    Buffer event, traced;
    writeEvent(event, {3, 4, 5}, body);
    writeTraced(traced, {3, 4, 0}, {});
    XdrReader quick(event.data() + record::kMarkSize, event.size() - record::kMarkSize), other(traced.data() + record::kMarkSize, traced.size() - record::kMarkSize);
    EventHeader header;
    EventBody read;
    Message content;
    CHECK(skipEventHeader(quick) && readEvent(quick, header, read, content) && header.id == 3 && read.name == "name" && content == full());
    CHECK(!skipEventHeader(other) && other.left() == traced.size() - record::kMarkSize);
    // One that ends before the number of its request is an old daemon's.
    EQUAL(accepted(written([&](Buffer& out) { writeEvent(out, {3, std::uint64_t{1} << 33, (std::uint64_t{1} << 34) + 1}, body); }), [](std::string_view bytes) {
        return isCall(bytes, kEvent, [](XdrReader& r, auto&) {
            EventHeader h;
            EventBody b;
            Message m;
            m.code = 4;
            m.trail.setDropped(1);
            return readEvent(r, h, b, m) && h.id == 3 && h.number == std::uint64_t{1} << 33 && h.lost == (std::uint64_t{1} << 34) + 1 && b.time == 9 &&
                   b.name == "name" && (b.request == 11 || b.request == 0) && alike(m, full()) && m.code == 0 && m.trail.empty();
        });
    }), "-8 0");
}

// ---- what must not be ----

void testUtf8() {
    for (const bool word : {false, true}) {
        Message m = full();
        (word ? m.words.back() : m.text) = "a\xff";
        const std::string record = written([&](Buffer& out) { writeReply(out, 8, {}, m); });
        CHECK(!isReply(record, [](XdrReader& r) {
            Times times;
            Message got;
            return readReply(r, times, got);
        }));
    }
}

void testBehalf() {
    // Whether a call for CALLERS and AUTHOR is understood, and as which.
    auto read = [](bool relayed, const std::string& callers, const std::string& author, Behalf& got) {
        const Behalf sent{relayed, 77, callers, author};
        const std::string record = written([&](Buffer& out) { writeCall(out, 5, kProgram, {}, Message(), kCall, &sent); });
        return isCall(record, kCall, [&](XdrReader& r, const CallHeader& h) {
            Request q;
            Message m;
            return readBehalf(h.behalf, got) && readRequest(r, q, m);
        });
    };
    Behalf b;
    CHECK(read(true, "callers", "author", b) && b.relayed && b.request == 77 && b.callers == "callers" && b.author == "author");
    Behalf anyone, own;
    CHECK(read(true, "a\nb", "", anyone) && anyone.relayed && anyone.callers == "a?b" && anyone.author.empty());
    CHECK(read(false, "", "author", own) && !own.relayed && own.author.empty());
    const std::string most(kMostCallers, 'x');
    CHECK(read(true, most + "y", std::string(kMostAuthor, 'a'), b) && b.callers == most && b.author == std::string(kMostAuthor, 'a'));
    CHECK(read(true, most.substr(1) + "\xc3\xa4", "", b) && b.callers == most.substr(1));
    CHECK(read(true, "", std::string(kMostAuthor + 1, 'a'), b) && b.author == "too many authors");
}

// An epoch goes with and without a trace, and calls of neither are as before.
void testEpoch() {
    for (const bool traced : {false, true})
        for (const std::uint64_t cause : {std::uint64_t{0}, std::uint64_t{9}})
            for (const std::int64_t epoch : {std::int64_t{0}, std::int64_t{1} << 40}) {
                if (cause != 0 && !traced) continue;
                Behalf sent{true, 7, std::string(300, 'x'), std::string(kMostAuthor, 'a'), {{traced ? 3u : 0u, traced ? 4u : 0u}, cause}, epoch};
                const std::string record = written([&](Buffer& out) { writeCall(out, 5, kProgram, {}, Message(), kCall, &sent); });
                CHECK(isCall(record, kCall, [&](XdrReader& r, const CallHeader& h) {
                    Request q;
                    Message m;
                    Behalf got;
                    return h.behalf.size() <= 400 && readBehalf(h.behalf, got) && readRequest(r, q, m) && got.epoch == epoch && bool(got.trace.number) == traced &&
                           got.trace.cause == cause && got.author == sent.author;
                }));
            }
}

// As a peer would write it, who keeps no rule.
std::string credentials(bool relayed, std::string_view callers, std::string_view author) {
    Buffer out;
    XdrWriter w(out);
    w.u32(relayed);
    w.u64(77);
    w.text(callers);
    w.text(author);
    return {out.data(), out.size()};
}
void testCredentials() {
    auto read = [](const std::string& body) {
        Behalf b;
        return readBehalf(body, b);
    };
    CHECK(read(credentials(true, std::string(256, 'x'), std::string(kMostAuthor, 'a'))) && !read(credentials(true, std::string(257, 'x'), "a")));
    CHECK(!read(credentials(true, "x", std::string(kMostAuthor + 1, 'a'))) && !read(credentials(true, "\xff", "a")) && !read(credentials(true, "x", "\xff")));
    const std::string whole = credentials(true, "abcd", "efgh");
    EQUAL(accepted(whole, read), "-8 0 1 2 3 4");             // without an author; more at the end is left alone
    // Those of other kinds are skipped, up to what RFC 5531 allows.
    auto header = [](std::uint32_t flavor, std::size_t size, std::size_t verifier, std::string_view& behalf) {
        static Buffer out;
        out.clear();
        XdrWriter w(out);
        w.words(2, kProgram, kVersion, kNull, flavor);
        w.text(std::string(size, 'x'));
        w.u32(1);
        w.text(std::string(verifier, 'x'));
        XdrReader r(out.data(), out.size());
        behalf = readCallHeader(r, 1).behalf;
        return r.good() && r.atEnd();
    };
    std::string_view behalf;
    CHECK(header(1, 400, 400, behalf) && behalf.empty() && !header(1, 401, 0, behalf) && !header(1, 0, 401, behalf));
    CHECK(header(kBehalfFlavor, 12, 4, behalf) && behalf.size() == 12);
}

void testSpans() {
    Sorm sorm;
    auto root = [&] { return Span::root({1, 2}, sorm, "a", Method::exec, monotonicNow()); };
    const SpanPointer sent = root();
    sent->call("b", Method::ctrl)->call("c", Method::exec)->finish();
    sent->call("hidden", Method::exec)->call("d", Method::exec);
    const Buffer bytes = spansOf(*sent, [](const std::string& name) { return name != "hidden"; }, true);
    const std::string whole(bytes.data(), bytes.size());
    const SpanPointer got = root();
    CHECK(readSpans(whole, *got) && got->calls.size() == 2 && got->calls[0]->name == "b" && got->calls[0]->calls[0]->name == "c");
    CHECK(got->calls[0]->underway && !got->calls[0]->calls[0]->underway && got->calls[1]->name.empty() && got->calls[1]->calls[0]->name.empty());
    // Spans that cannot be read change nothing.
    for (std::size_t i = 0; i < whole.size(); ++i) {
        std::string wrong = whole;
        wrong[i] = char(0xff);
        const SpanPointer one = root(), other = root();
        CHECK(readSpans(wrong, *one) || (one->calls.empty() && one->share->spans == 0 && !one->answered));
        CHECK(readSpans(whole.substr(0, i), *other) || other->calls.empty());
    }
    const SpanPointer full = root();
    for (int i = 0; i < 300; ++i) CHECK(readSpans(whole, *full));
    CHECK(full->share->spans == TraceShare::kMostSpans && full->lost > 0);
}

// Spans that come with no reply.
void testLateSpans() {
    Sorm sorm;
    auto shown = [](const std::string&) { return true; };
    const SpanPointer sent = Span::root({1, 2}, sorm, "a", Method::exec, monotonicNow());
    const SpanPointer left = sent->leave(Span::Kind::oneway, "b@d", Method::exec), event = sent->leave(Span::Kind::event, "c", Method::exec);
    event->event = "told";
    event->heard = 2;
    const Buffer bytes = spansOf(*sent, shown, true);
    const SpanPointer got = Span::root({1, 2}, sorm, "a", Method::exec, monotonicNow());
    CHECK(readSpans({bytes.data(), bytes.size()}, *got) && got->calls.size() == 2);
    Span &one = *got->calls[0], &two = *got->calls[1];
    CHECK(one.kind == Span::Kind::oneway && one.cause == left->cause && one.heard == 1 && two.event == "told" && two.heard == 2 && two.cause == event->cause);

    LateSpans& late = sorm.lateSpans();
    const SpanPointer there = late.begin(left->origin(), "b", Method::exec, monotonicNow());
    there->call("e", Method::ctrl)->finish();
    CHECK(late.begin({{1, 2}, left->cause + 1}, "another", Method::exec, monotonicNow()) && late.begin({{3, 4}, left->cause}, "another", Method::exec, 0));
    auto find = [&](std::uint64_t cause) { return cause == one.cause ? &one : cause == two.cause ? &two : nullptr; };
    auto read = [&](std::set<std::uint64_t>& seen, bool all) {
        const Buffer all2 = lateSpansOf(late, {1, 2}, shown, true);
        return readLateSpans({all2.data(), all2.size()}, find, seen, all);
    };
    std::set<std::uint64_t> seen;
    CHECK(read(seen, false) && one.told == 0);                          // it is under way
    there->finish();
    CHECK(read(seen, false) && one.told == 1 && one.calls.size() == 1 && one.calls[0]->name == "b" && one.calls[0]->calls[0]->name == "e");
    CHECK(read(seen, true) && one.calls.size() == 1 && seen.size() == 1);       // once
    // No more than could have heard of it, whoever claims to.
    for (int i = 0; i < 5; ++i) late.begin(event->origin(), "f", Method::exec, monotonicNow())->finish();
    CHECK(read(seen, true) && two.told == 2 && two.calls.size() == 2);
    // Bounded, by traces and in all.
    for (std::uint64_t i = 1; i < 3000; ++i) late.begin({{i % 100 + 1, 7}, 1}, "g", Method::exec, monotonicNow());
    CHECK(late.kept().size() <= LateSpans::kMostKept);
    std::set<std::uint64_t> traces;
    for (auto& k : late.kept()) traces.insert(k.span->share->number.high);
    CHECK(traces.size() <= LateSpans::kMostTraces);
}

// A service in C++: the number for calls by other means, and a span for a part of its work.
void testOwnSpans() {
    Sorm sorm;
    CHECK(traceparent().empty());
    auto kept = std::make_shared<KeptCall>(nullptr, Deadline(), 1, std::string());
    kept->span = Span::root({1, 2}, sorm, "a", Method::exec, monotonicNow());
    const CallContext context(kept);
    CHECK(TraceNumber::parse(traceparent()) == (TraceNumber{1, 2}));
    { const SpanScope part("a.part", Method::exec, false); }
    CHECK(kept->span->calls.size() == 1 && kept->span->calls[0]->name == "a.part" && kept->span->calls[0]->finished && CallContext::current()->span == kept->span);
}

void testTraced() {
    const std::string record = written([&](Buffer& out) { writeTraced(out, {5, 6, 0}, {{1, 2}, 3}); });
    XdrReader r(record);
    CHECK(readCallHeader(r, readEnvelope(r).xid).procedure == kTraced);
    EventHeader h;
    TraceOrigin origin;
    CHECK(readTraced(r, h, origin) && h.id == 5 && h.number == 6 && origin.number == (TraceNumber{1, 2}) && origin.cause == 3);
}

void testTraceNumbers() {
    for (std::uint64_t cause : {0, 9}) {
        const Behalf sent{true, 7, std::string(300, 'x'), std::string(kMostAuthor, 'a'), {{3, 4}, cause}};
        const std::string record = written([&](Buffer& out) { writeCall(out, 5, kProgram, {}, Message(), kCall, &sent); });
        CHECK(isCall(record, kCall, [&](XdrReader& r, const CallHeader& h) {
            Behalf got;
            Request q;
            Message m;
            return readBehalf(h.behalf, got) && got.trace.number == sent.trace.number && got.trace.cause == cause && got.author == sent.author && h.behalf.size() <= 400 && readRequest(r, q, m);
        }));
    }
}

void testRefusals() {
    auto answer = [](const std::string& record) {
        XdrReader r(record);
        readEnvelope(r);
        return readReplyHeader(r);
    };
    auto words = [&](std::vector<std::uint32_t> list) {
        return answer(written([&](Buffer& out) {
            XdrWriter w(out);
            w.words(0, 1, 1);                   // a mark, xid, reply
            for (auto word : list) w.u32(word);
        }));
    };
    auto refused = [&](Refusal refusal) { return answer(written([&](Buffer& out) { writeRefusal(out, 1, refusal); })); };
    EQUAL(answer(written([](Buffer& out) { writeEmptyReply(out, 1); })), "");
    EQUAL(refused(Refusal::programUnavailable), "it does not serve the program SORMA");
    EQUAL(refused(Refusal::programMismatch), "it serves versions 1 to 1 of the program, not 1");
    EQUAL(refused(Refusal::procedureUnavailable), "it does not know the procedure");
    EQUAL(refused(Refusal::garbage), "it could not decode the request");
    EQUAL(answer(written([](Buffer& out) { writeRpcMismatch(out, 1); })), "it serves ONC RPC version 2 to 2, not 2");
    EQUAL(words({1, 1, 1}), "it wants authentication");
    EQUAL(words({1, 1, 5}), "it wants TLS");
    EQUAL(words({0, 0, 0, 5}), "a system error at the daemon");
    EQUAL(words({0, 1, 4, 0, 0}), "");          // a verifier, which is skipped
    EQUAL(words({0, 1, 4, 0, 3}), "it does not know the procedure");
    for (auto& list : {std::vector<std::uint32_t>{}, {2}, {2, 0, 0, 0}, {0}, {0, 1, 4, 0}}) EQUAL(words(list), "a malformed reply");
    const std::string neither = written([](Buffer& out) { XdrWriter(out).words(0, 1, 2); });
    XdrReader r(neither);
    readEnvelope(r);
    CHECK(!r.good());
}

void testExtent() {
    const std::string record = written([](Buffer& out) { writeCall(out, 5, kProgram, {0, 0, 0, Method::exec, "nop.a"}, full()); });
    XdrReader r(record);
    readEnvelope(r);
    readCallHeader(r, 5);
    const Extent extent = extentOf(r);
    CHECK(extent.name == 5 && extent.words == 3 && extent.bytes == (4 + 4) + 4 + (4 + 8));
    // Counts that the record cannot hold are nothing.
    for (int which : {0, 1}) {
        const std::string huge = written([&](Buffer& out) {
            XdrWriter w(out);
            w.words(0, 0, 0, 0, 0, 0, 0);       // a mark, the four words of a request, no name, no text
            if (which == 1) w.u32(0);
            w.words(3, 0, 0, 0, 0, 0);
        });
        const Extent none = extentOf(XdrReader(huge));
        CHECK(none.name == 0 && none.words == 0 && none.bytes == 0);
    }
}

constexpr Group kGroups[] = {
    {"calls", testCalls}, {"replies", testReplies}, {"trails", testTrails}, {"greetings", testGreetings}, {"claims", testClaims}, {"others", testOthers},
    {"utf8", testUtf8}, {"behalf", testBehalf}, {"epoch", testEpoch}, {"credentials", testCredentials}, {"refusals", testRefusals}, {"extent", testExtent}, {"spans", testSpans}, {"late", testLateSpans}, {"traced", testTraced}, {"own", testOwnSpans}, {"numbers", testTraceNumbers},
};

}  // namespace

int main(int argc, char** argv) { return runGroups(kGroups, argc, argv); }
