// records.cpp -- checks of records in a stream of bytes, without a connection.
//
//     records GROUP      runs one group; tests/record.test has a test for each. See checks.h.
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "comm/record.h"
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

constexpr Group kGroups[] = {
    {"marks", testMarks}, {"reader", testReader}, {"pieces", testPieces}, {"dropping", testDropping}, {"empty", testEmpty},
};

}  // namespace

int main(int argc, char** argv) { return runGroups(kGroups, argc, argv); }
