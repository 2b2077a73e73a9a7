// records.cpp -- checks of records in a stream of bytes, without a connection.
//
//     records GROUP      runs one group; tests/record.test has a test for each. See checks.h.
#include <algorithm>
#include <bit>
#include <cstring>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "comm/apart.h"
#include "comm/record.h"
#include "comm/wire.h"
#include "checks.h"
#include "divided.h"

using namespace sorma;

namespace {

// A piece with its mark.
std::string piece(std::string_view text, bool last) {
    const auto length = std::uint32_t(text.size());
    std::string out{char((last ? 0x80 : 0) | (length >> 24)), char(length >> 16), char(length >> 8), char(length)};
    return out.append(text);
}
Buffer bufferOf(std::string_view bytes) {
    Buffer out;
    out.append(bytes.data(), bytes.size());
    return out;
}
record::Piece front(const std::string& bytes) { return record::front(bytes.data(), bytes.data() + bytes.size()); }

// ---- written and read ----

void testMarks() {
    Buffer out;
    for (std::string_view text : {"one", "", "three"}) {
        const std::size_t start = record::open(out);
        out.append(text.data(), text.size());
        record::close(out, start);
    }
    CHECK(std::string_view(out.data(), out.size()) == piece("one", true) + piece("", true) + piece("three", true));
    CHECK(record::count(out) == 3 && record::count(Buffer()) == 0);
    const std::string some = piece("abc", false), whole = piece("abc", true);
    CHECK(!front("").known && !front(some.substr(0, 3)).known && front(some.substr(0, 4)).known && !front(some.substr(0, 6)).whole);
    CHECK(front(some).whole && !front(some).last && front(whole).last && front(whole + "d").text() == "abc" && front(whole).size() == 7);
    CHECK(front(piece("", true)).whole && front(piece("", true)).length == 0);
    CHECK(front("\xff\xff\xff\xff").length == 0x7fffffff);
}

void testReader() {
    const std::string bytes = piece("one", true) + piece("three", true);
    std::string_view text;
    record::Reader all(bytes.data(), bytes.size(), 5);
    CHECK(all.next(text) && text == "one" && all.next(text) && text == "three" && !all.next(text) && !all.wrong() && all.at() == bytes.data() + bytes.size());
    record::Reader small(bytes.data(), bytes.size(), 4);
    CHECK(small.next(text) && !small.wrong() && !small.next(text) && small.wrong() && small.at() == bytes.data() + 7);
    record::Reader cut(bytes.data(), bytes.size() - 1, 5);
    CHECK(cut.next(text) && !cut.next(text) && !cut.wrong());
    const std::string parts = piece("one", false);
    record::Reader several(parts.data(), parts.size(), 5);
    CHECK(!several.next(text) && several.wrong());
    // Records of which nothing is beyond so many bytes.
    const Buffer buffer = bufferOf(bytes + "\x80");
    CHECK(record::count(buffer) == 2);
    const std::size_t wanted[] = {0, 0, 0, 0, 0, 0, 0, 7, 7, 7, 7, 7, 7, 7, 7, 7, 16, 16, 16};
    for (std::size_t size = 0; size < std::size(wanted); ++size) note(record::wholeBefore(buffer, size) == wanted[size], __LINE__, std::to_string(size));
}

// ---- of several pieces ----

void testPieces() {
    const std::string stream = piece("one", true) + piece("tw", false) + piece("", false) + piece("o", true) + piece("", true) + piece("long, and refused", true) +
                               piece("th", false) + piece("ree", false) + piece("", true) + piece("four", true) + piece("fi", false);
    const std::vector<std::string> wanted = {"one", "two", "", "refused 17", "three", "four"};
    for (std::size_t part = 1; part <= stream.size(); ++part) {
        record::Assembler pieces;
        Buffer rest;
        note(divided(stream, part, 10, pieces, rest) == wanted, __LINE__, "in parts of " + std::to_string(part));
        CHECK(pieces.size() == 2 && pieces.inside() && pieces.dropping() == 0 && !pieces.tooEmpty());
    }
}

void testDropping() {
    record::Assembler pieces;
    CHECK(!pieces.inside() && pieces.dropping() == 0);
    pieces.refuse(5);
    CHECK(pieces.inside() && pieces.dropping() == 5);
    const char bytes[] = "abcdefgh", *at = bytes;
    pieces.drop(at, bytes + 3);
    CHECK(at == bytes + 3 && pieces.dropping() == 2);
    pieces.drop(at, bytes + 8);
    CHECK(at == bytes + 5 && pieces.dropping() == 0 && !pieces.inside());
    pieces.drop(at, bytes + 8);
    CHECK(at == bytes + 5);
}

void testEmpty() {
    Buffer own;
    std::string_view record;
    const std::string nothing = piece("", false), end = piece("", true), some = piece("a", false);
    record::Assembler pieces;
    auto add = [&](const std::string& bytes) { return pieces.add(front(bytes), own, record); };
    for (int i = 0; i < record::kMostEmpty; ++i) CHECK(!add(nothing) && !pieces.tooEmpty());
    CHECK(!add(some) && !pieces.tooEmpty() && !add(nothing) && pieces.tooEmpty());
    // Each record may have so many.
    CHECK(add(end) && record == "a" && !pieces.tooEmpty() && !pieces.inside() && pieces.size() == 0);
    for (int i = 0; i < record::kMostEmpty; ++i) CHECK(!add(nothing) && !pieces.tooEmpty());
    CHECK(!add(nothing) && pieces.tooEmpty());
    // They are counted in each record anew, also when a record has no other piece before its last one.
    record::Assembler others;
    for (int i = 0; i <= record::kMostEmpty; ++i) CHECK(!others.add(front(nothing), own, record) && !others.tooEmpty() && others.add(front(piece("a", true)), own, record) && record == "a");
}

// ---- numbers that are moved apart ----

void testSwap() {
    std::string bytes;
    for (int i = 0; i < 1100; ++i) bytes += char(i * 7 + i / 256);
    for (std::size_t words = 0; words < 130; ++words)
        for (std::size_t from = 0; from < 9; ++from) {
            std::string wanted = bytes;
            for (std::size_t i = 0; std::endian::native != std::endian::big && i < words; ++i)
                for (std::size_t k = 0; k < 8; ++k) wanted[from + 8 * i + k] = bytes[from + 8 * i + 7 - k];
            std::string there(bytes.size(), ' '), same = bytes;
            swapWords(there.data() + 3, bytes.data() + from, words);
            swapWords(same.data() + from, same.data() + from, words);
            CHECK(there.substr(3, 8 * words) == wanted.substr(from, 8 * words) && there.substr(3 + 8 * words) == std::string(there.size() - 3 - 8 * words, ' '));
            CHECK(same == wanted);
        }
}

Message longMessage(std::size_t floats, std::size_t ints) {
    Message m;
    m.text = "some";
    m.words = {"word", "another"};
    m.any = {1, 2, 3};
    for (std::size_t i = 0; i < floats; ++i) m.floats.push_back(double(i) + 1 / 3.0);
    for (std::size_t i = 0; i < ints; ++i) m.ints.push_back(std::int64_t(i) << 33 | 5);
    return m;
}

// The first record of a stream that comes in parts, as it was read; the others are not looked at.
struct Read {
    bool apart = false, good = false;
    std::size_t size = 0;           // [bytes] of it on the wire
    Message message;
    std::string rest;               // the bytes behind it
};
Read readInParts(std::string_view stream, std::size_t part, bool reply) {
    Read read;
    Buffer in;
    record::Apart apart;
    while (!stream.empty()) {
        std::size_t size = std::min(part, stream.size());
        char* room = apart.filling() ? apart.room(size) : in.extend(size);
        std::memcpy(room, stream.data(), size);
        stream.remove_prefix(size);
        if (apart.filling()) apart.came(size);
        else if (apart.size() == 0 && apart.begin(in, 0)) read.apart = true;
    }
    const record::Piece whole = record::front(in.data(), in.data() + in.size());
    if (!whole.whole || apart.filling()) return read;
    XdrReader r = read.apart ? XdrReader(whole.text(), apart) : XdrReader(whole.text());
    read.size = whole.size() + apart.size();
    read.rest.assign(in.data() + whole.size(), in.size() - whole.size());
    const auto envelope = wire::readEnvelope(r);
    if (reply) {
        wire::Times times;
        read.good = wire::readReplyHeader(r).empty() && wire::readReply(r, times, read.message);
    } else {
        wire::Request request;
        wire::readCallHeader(r, envelope.xid);
        const XdrReader before = r;
        const wire::Extent extent = wire::extentOf(before);
        read.good = extent.words == 2 && extent.name == 4 && wire::readRequest(r, request, read.message) && request.name == "echo";
    }
    return read;
}

// What is lent is the same on the wire, wherever the line stops taking, and comes back the same, wherever it is cut.
void testApart() {
    constexpr std::size_t kMany = 20'000, kFew = 100;
    for (const bool reply : {false, true})
        for (const auto& [floats, ints] : {std::pair(kMany, kFew), std::pair(kFew, kMany), std::pair(kMany, kMany), std::pair(kFew, kFew)}) {
            const Message m = longMessage(floats, ints);
            Buffer whole, bytes;
            record::Lent lent;
            const wire::Request request{1, 2, 3, Method::exec, "echo"};
            if (reply) wire::writeReply(whole, 7, {}, m), wire::writeReply(bytes, 7, {}, m, nullptr, &lent);
            else wire::writeCall(whole, 7, wire::kProgram, request, m), wire::writeCall(bytes, 7, wire::kProgram, request, m, wire::kCall, nullptr, &lent);
            CHECK((lent.data != nullptr) == (floats == kMany || ints == kMany));
            CHECK(!lent.data || bytes.size() < whole.size() - 8 * kMany + 8);
            std::string stream;
            std::size_t take = 1;
            for (record::Source source(bytes, lent); source.left() > 0; take = take * 5 % 9973) {
                CHECK(source.left() == whole.size() - stream.size());
                const auto next = source.next().substr(0, take);
                CHECK(next == source.next().substr(0, take));
                stream += next;
                source.took(next.size());
            }
            CHECK(stream == std::string_view(whole.data(), whole.size()));
            Buffer all;
            record::Source(bytes, lent).appendTo(all);
            CHECK(std::string_view(all.data(), all.size()) == stream);
            const std::string more = stream + piece("next", true);
            for (const std::size_t part : {std::size_t(61), std::size_t(4099), std::size_t(16384), std::size_t(65536), stream.size() - 1, more.size()}) {
                const Read read = readInParts(more, part, reply);
                note(read.good && read.message == m && read.size == whole.size(), __LINE__, "in parts of " + std::to_string(part));
                CHECK(read.apart == (lent.data && part < 8 * kMany) && read.rest == piece("next", true));
            }
        }
}

// Numbers that are said to come and do not, or would not fit into their record, cost nothing.
void testClaims() {
    const Message m = longMessage(20'000, 0);
    Buffer whole;
    wire::writeReply(whole, 7, {}, m);
    record::Apart apart;
    auto begins = [&](std::size_t size, std::uint32_t mark) {
        Buffer in = bufferOf({whole.data(), size});
        XdrWriter::put(in.data(), mark);
        const bool begun = apart.begin(in, 0);
        apart.end();
        return begun;
    };
    const auto length = std::uint32_t(whole.size() - record::kMarkSize);
    const std::size_t before = 4 + 24 + 16 + 8 + 4;        // mark, header, code and times, text, count
    CHECK(begins(before, record::kLast | length) && begins(before + 999, record::kLast | length) && !begins(before - 1, record::kLast | length));
    CHECK(!begins(before, length) && !begins(whole.size(), record::kLast | length));
    CHECK(begins(before, record::kLast | std::uint32_t(before - 4 + 160'000)) && !begins(before, record::kLast | std::uint32_t(before - 5 + 160'000)));
    XdrWriter::put(whole.data() + before - 4, std::uint32_t(100'000'000));
    apart = {};
    CHECK(begins(before, record::kLast | 900'000'000) && apart.capacity() <= 64 * 1024);
}

constexpr Group kGroups[] = {
    {"marks", testMarks}, {"reader", testReader}, {"pieces", testPieces}, {"dropping", testDropping}, {"empty", testEmpty},
    {"swap", testSwap}, {"apart", testApart}, {"claims", testClaims},
};

}  // namespace

int main(int argc, char** argv) { return runGroups(kGroups, argc, argv); }
