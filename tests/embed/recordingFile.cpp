// recordingFile.cpp -- checks of the file of a recording: written and read again, cut and spoiled at every byte, as a black box.
//
//     recordingFile GROUP FOLDER      runs one group, with its files in a folder; tests/recording.test has a test for each. See checks.h.
#include <sys/resource.h>
#include <sys/stat.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include "bus/service.h"
#include "bus/sorm.h"
#include "recording/crc32c.h"
#include "recording/reader.h"
#include "recording/recorder.h"
#include "recording/writer.h"
#include "checks.h"

using namespace sorma;
using namespace sorma::recording;

namespace {

using sorma::recording::Kind;          // not that of bus/named.h
using sorma::recording::Record;
std::string folder = "/tmp";
std::string fileOf(const char* name) { return folder + "/" + name; }

std::string contents(const std::string& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}
// As a new file: some file systems write one to the disk that is emptied and written again.
void replace(const std::string& file, const std::string& bytes) {
    unlink(file.c_str());
    std::ofstream(file, std::ios::binary | std::ios::trunc).write(bytes.data(), std::streamsize(bytes.size()));
}

// The value of RFC 3720, appendix B.4; with the processor's instruction and without it, for all lengths and places.
void testSums() {
    const std::string digits = "123456789";
    CHECK(crc32c(digits.data(), digits.size()) == 0xe3069283);
    CHECK(~sorma::detail::crcByTables(reinterpret_cast<const unsigned char*>(digits.data()), digits.size(), ~0u) == 0xe3069283);
    std::string bytes;
    for (int i = 0; i < 300; ++i) bytes += char(i * i * 7 + i);
    int different = 0;
    for (std::size_t at = 0; at < 16; ++at)
        for (std::size_t n = 0; at + n <= bytes.size(); ++n)
            different += crc32c(bytes.data() + at, n, 0x12345678) != ~sorma::detail::crcByTables(reinterpret_cast<const unsigned char*>(bytes.data()) + at, n, ~0x12345678u);
    CHECK(different == 0);
}

Message full(int i) {
    Message m;
    m.text = "t\xc3\xa4xt " + std::to_string(i);
    m.floats = {1.5, -2};
    m.ints = {i, std::int64_t{1} << 40};
    m.any = {0, 255, 7};
    m.words = {"-a", "", "bcd"};
    m.code = -i;
    Entry e{Severity::warning, "AREA SYMBOL", {"one", ""}, "text", "so", "daemon", "file.cpp", i, 1234567890123, "so EXEC"};
    m.trail.add(e);
    m.trail.setDropped(3);
    return m;
}

// So many blocks of so many records, whose numbers count up from 1; their time is 1 s for each number.
void write(const std::string& file, int blocks, int records, WriterOptions options = {}, bool close = true, std::size_t text = 0) {
    Writer writer(file, options);
    Block block;
    std::uint64_t number = 0;
    for (int b = 0; b < blocks; ++b) {
        for (int r = 0; r < records; ++r) {
            ++number;
            Message m = full(int(number));
            if (text > 0) m.text.assign(text, char('a' + number % 26));
            const std::string object = "foo." + std::to_string(number % 3);
            block.add({Kind::request, Method::exec, "robot", object, "anna@lab", m.code, std::int64_t(number) * 1'000'000'000, number, 5}, &m);
        }
        writer.write(block);
    }
    if (close) writer.close();
}

// The numbers of the records that can be read, "1-7,9"; and each record must be as it was written.
std::string numbers(Reader& reader, bool textToo = true) {
    std::string out;
    std::uint64_t from = 0, last = 0;
    auto tell = [&] {
        if (from > 0) out += (out.empty() ? "" : ",") + std::to_string(from) + (last > from ? "-" + std::to_string(last) : "");
    };
    Message m;
    for (Record r; reader.next(r);) {
        if (from == 0 || r.number != last + 1) tell(), from = r.number;
        last = r.number;
        Message wanted = full(int(r.number));
        const bool good = r.read(m);
        if (!textToo) wanted.text = m.text;
        if (!good || !(m == wanted) || r.kind != Kind::request || r.method != Method::exec || r.source != "robot" || r.object != "foo." + std::to_string(r.number % 3) ||
            r.word != "anna@lab" || r.time != std::int64_t(r.number) * 1'000'000'000 || r.span != 5)
            out += "!";
    }
    tell();
    return out;
}
std::string read(const std::string& file) {
    Reader reader(file);
    return numbers(reader);
}
std::string refusal(auto f) {
    try {
        f();
    } catch (const FileError& e) {
        return e.what();
    }
    return "none";
}

// ---- groups ----

void testRecords() {
    const std::string file = fileOf("records");
    for (const bool compress : {false, canCompress()}) {
        write(file, 3, 5, {.compress = compress});
        Reader reader(file);
        CHECK(reader.closed() && reader.damages().empty());
        EQUAL(numbers(reader), "1-15");
        CHECK(reader.damages().empty() && reader.sections().size() == 1);
        const Section& s = reader.sections().at(0);
        CHECK(s.blocks == 3 && s.records == 15 && s.first == 1'000'000'000 && s.last == 15'000'000'000 && s.named);
        std::string names;
        for (auto n : s.names) names += reader.names().at(n) + " ";
        EQUAL(names, "robot foo.1 anna@lab foo.2 foo.0 ");
    }
    // Kinds without method, names and parts; a block that holds nothing is not written.
    {
        Writer writer(file);
        Block block;
        writer.write(block);
        block.add({.kind = Kind::loss, .source = "", .time = -7, .number = 12});
        writer.write(block);
        writer.close();
    }
    Reader reader(file);
    Record r;
    Message m;
    CHECK(reader.next(r) && r.kind == Kind::loss && !r.method && r.source.empty() && r.time == -7 && r.number == 12 && r.read(m) && m == Message());
    CHECK(!reader.next(r) && !reader.next(r));
    // None is too large but those beyond the limit.
    Block block;
    m.text.assign(kMostRecord, 'x');
    CHECK(!block.add({}, &m) && block.empty());
    m.text.resize(kMostRecord - 100);
    CHECK(block.add({}, &m) && block.full());
}

// However a file is cut, its beginning is read, up to the last whole record; and that it was cut is known.
void cutEvery(bool compress) {
    const std::string file = fileOf("cut"), whole = fileOf("whole");
    write(whole, 3, 4, {.compress = compress});
    const std::string all = contents(whole);
    // Where the records end, counted with a reader of blocks of its own.
    std::vector<std::size_t> ends;
    BlockHead head;
    std::size_t index = 0;
    for (std::size_t at = sizeof(FileHead); index == 0; at += sizeof head + head.stored) {
        std::memcpy(&head, all.data() + at, sizeof head);
        if (head.flags & BlockHead::index) index = at;
        else if (compress) ends.insert(ends.end(), head.records, at + sizeof head + head.stored);
        else {
            BlockReader block(all.substr(at + sizeof head, head.stored), head.id, head.number);
            for (Record r; block.next(r);) ends.push_back(at + sizeof head + block.at());
        }
    }
    CHECK(ends.size() == 12);
    int wrong = 0;
    for (std::size_t n = 0; n < all.size(); ++n) {
        replace(file, all.substr(0, n));
        const auto count = std::count_if(ends.begin(), ends.end(), [&](auto end) { return end <= n; });
        if (n < sizeof(FileHead)) {
            if (refusal([&] { Reader reader(file); }) == "none") ++wrong;
            continue;
        }
        Reader reader(file);
        const std::string wanted = count == 0 ? "" : count == 1 ? "1"
                                                                : "1-" + std::to_string(count);
        if (numbers(reader) != wanted || reader.closed()) ++wrong, std::printf("cut at %zu\n", n);
    }
    EQUAL(std::to_string(wrong), "0");
}
void testCuts() {
    cutEvery(false);
    if (canCompress()) cutEvery(true);
}

// Each bit is turned once: only its own block has lost anything, and it is said.
void flipEvery(bool compress) {
    const std::string file = fileOf("flip"), whole = fileOf("whole");
    write(whole, 3, 4, {.compress = compress});
    const std::string all = contents(whole);
    std::vector<std::size_t> begins;
    BlockHead head;
    for (std::size_t at = sizeof(FileHead); begins.empty() || !(head.flags & BlockHead::index); at += sizeof head + head.stored) {
        begins.push_back(at);
        std::memcpy(&head, all.data() + at, sizeof head);
    }
    int wrong = 0;
    for (std::size_t n = 0; n < all.size(); ++n) {
        std::string spoiled = all;
        spoiled[n] = char(spoiled[n] ^ (1 << n % 8));
        replace(file, spoiled);
        Reader reader(file);
        const std::string left = numbers(reader);
        const auto block = n < begins[0] ? 3 : std::upper_bound(begins.begin(), begins.end(), n) - begins.begin() - 1;
        // A few bits of what zstd makes mean nothing: then nothing is lost, which the records' own sums prove.
        bool good = (!reader.damages().empty() || (compress && left == "1-12")) && left.find('!') == left.npos;
        std::vector<bool> has(13);
        std::istringstream ranges(left);
        for (std::string range; std::getline(ranges, range, ',');) {
            const std::size_t dash = range.find('-');
            for (int i = std::stoi(range); i <= std::stoi(dash == range.npos ? range : range.substr(dash + 1)); ++i) has.at(std::size_t(i)) = true;
        }
        for (int i = 1; i <= 12; ++i)
            if (!has[std::size_t(i)] && (i - 1) / 4 != block) good = false;
        if (!good) ++wrong, std::printf("byte %zu: %s\n", n, left.c_str());
    }
    EQUAL(std::to_string(wrong), "0");
}
void testFlips() {
    flipEvery(false);
    if (canCompress()) flipEvery(true);
}

// Without an index the same is read, and the sections are the same but for their names.
void testRebuilt() {
    const std::string file = fileOf("rebuilt"), with = fileOf("indexed");
    write(file, 40, 10, {}, false, 3000);
    write(with, 40, 10, {}, true, 3000);
    Reader a(file), b(with);
    CHECK(!a.closed() && b.closed() && a.damages().empty());
    CHECK(a.sections().size() > 2 && a.sections().size() == b.sections().size());
    for (std::size_t i = 0; i < a.sections().size(); ++i) {
        auto &x = a.sections()[i], &y = b.sections()[i];
        CHECK(x.at == y.at && x.bytes == y.bytes && x.number == y.number && x.blocks == y.blocks && x.records == y.records && x.first == y.first && x.last == y.last && !x.named && y.named);
    }
    EQUAL(numbers(a, false), "1-400");
    EQUAL(numbers(b, false), "1-400");
    // One section alone.
    Record r;
    b.seek(1);
    CHECK(b.next(r) && b.section() == 1 && r.time == b.sections()[1].first);
    b.seek(b.sections().size());
    CHECK(!b.next(r));
}

// The newest records are there, in order, and the file is no larger than was said.
void testBlackBox() {
    const std::string file = fileOf("box");
    constexpr std::uint64_t kMost = 2'000'000;
    for (const bool close : {false, true})
        for (const int blocks : {10, 70, 200, 333}) {
            write(file, blocks, 10, {.most = kMost}, close, 3000);
            Reader reader(file);
            const std::string left = numbers(reader, false);
            const auto all = std::to_string(blocks * 10);
            CHECK(left.find(',') == left.npos && left.find('!') == left.npos && left.ends_with("-" + all));
            const int first = std::stoi(left);
            CHECK(blocks * 10 - first >= std::min(blocks * 10 - 1, 400));
            CHECK(reader.closed() == close && reader.damages().empty() && reader.bytes() < kMost + (close ? 10'000 : 0));
        }
    // By time: older records may be there, younger ones are; room is used again.
    write(file, 400, 10, {.keep = 300'000'000'000}, false, 3000);
    Reader reader(file);
    const std::string left = numbers(reader, false);
    CHECK(left.ends_with("-4000") && left.find('!') == left.npos && reader.damages().empty());
    const std::size_t comma = left.rfind(',');
    CHECK(std::stoi(comma == left.npos ? left : left.substr(comma + 1)) <= 3700);
    CHECK(reader.bytes() < 4'000'000);
    CHECK(refusal([&] { Writer w(file, {.most = 1000}); }).find("too small") != std::string::npos);
}

void testRefusals() {
    const std::string file = fileOf("refused");
    {
        replace(file, "old");
        chmod(file.c_str(), 0644);
        Writer writer(file);
        struct stat status{};
        CHECK(stat(file.c_str(), &status) == 0 && (status.st_mode & 0777) == 0600);
        CHECK(refusal([&] { Writer second(file); }).find("another recorder") != std::string::npos);
        writer.close();
    }
    EQUAL(read(file), "");
    CHECK(refusal([&] { Writer w(folder); }).find("cannot write") == 0);
    CHECK(refusal([&] { Writer w(folder + "/none/x"); }).find("No such file") != std::string::npos);
    CHECK(refusal([&] { Reader r(folder + "/none"); }).find("cannot read") == 0);
    CHECK(refusal([&] { Reader r("/dev/zero"); }).find("no file") != std::string::npos);
    replace(file, std::string(5000, 'x'));
    CHECK(refusal([&] { Reader r(file); }).find("is no recording") != std::string::npos);
    FileHead head;
    head.magic[16] = '4';
    head.check = crc32c(&head, offsetof(FileHead, check));
    replace(file, {reinterpret_cast<char*>(&head), sizeof head});
    CHECK(refusal([&] { Reader r(file); }).find("newer") != std::string::npos);
    head = {};
    head.order = 0x0807060504030201;
    head.check = crc32c(&head, offsetof(FileHead, check));
    replace(file, {reinterpret_cast<char*>(&head), sizeof head});
    CHECK(refusal([&] { Reader r(file); }).find("byte order") != std::string::npos);
    // Those of the recorder's buffers, whose head is shorter: magic, check, order, and two times.
    std::string old("sorma-recording 2\n\0\0abcd\x08\7\6\5\4\3\2\1", 32);
    replace(file, old + std::string(100, 'x'));
    CHECK(refusal([&] { Reader r(file); }).find("class recorder") != std::string::npos);
}

// No room on the disk: what was written is read, and when there is room again it goes on.
void testNoRoom() {
    signal(SIGXFSZ, SIG_IGN);
    const std::string file = fileOf("full");
    {
        Writer writer(file);
        Block block;
        Message m = full(1);
        auto add = [&](std::uint64_t number) {
            m = full(int(number));
            block.add({Kind::request, Method::exec, "robot", "foo." + std::to_string(number % 3), "anna@lab", m.code, std::int64_t(number) * 1'000'000'000, number, 5}, &m);
        };
        add(1);
        writer.write(block);
        rlimit limit{}, small{};
        getrlimit(RLIMIT_FSIZE, &limit);
        small = limit;
        small.rlim_cur = rlim_t(writer.bytes() + 150);
        setrlimit(RLIMIT_FSIZE, &small);
        add(2);
        CHECK(refusal([&] { writer.write(block); }).find("cannot go on writing") == 0);
        EQUAL(read(file), "1");
        setrlimit(RLIMIT_FSIZE, &limit);
        writer.write(block);
        writer.close();
    }
    Reader reader(file);
    CHECK(reader.closed());
    EQUAL(numbers(reader), "1-2");
    CHECK(reader.damages().empty());
}

class Callee : public sorma::Service {
public:
    void exec(Message&) override {}
};

// A sink refuses now and then, or is slow. The records that it has taken and those that are lost are all records.
void testLosses() {
    Sorm sorm;
    sorm.add(Class::of<Callee>("callee", "does nothing"));
    for (const bool slow : {false, true}) {
        std::uint64_t taken = 0, told = 0;
        int blocks = 0;
        Message m;
        m.text.assign(slow ? 30'000 : 3'000, 'x');
        constexpr std::uint64_t kRequests = 2000;
        Recorder recorder(sorm, {.requests = "*", .events = {}, .source = "here", .without = {}, .author = nullptr}, [&](Block& block, std::int64_t) {
            if (block.empty()) return;
            if (slow) usleep(2000);
            if (++blocks % 3 == 0) throw FileError("no room");
            BlockReader reader(block.finish(1, 2), 1, 2);
            for (Record r; reader.next(r);) r.kind == Kind::loss ? told += r.number : taken += r.kind != Kind::state;
            block.clear();
        });
        auto callee = sorm.get("callee");
        for (std::uint64_t i = 0; i < kRequests; ++i) {
            Message request = m;
            callee.exec(request);
        }
        recorder.stop();
        const auto figures = recorder.figures();
        EQUAL(std::to_string(taken + figures.lost), std::to_string(2 * kRequests));
        EQUAL(std::to_string(figures.records), std::to_string(taken));
        CHECK(figures.lost > 0 && told <= figures.lost && taken > 0);
        // The last block that was refused may be told of only after the end.
        if (blocks % 3 != 0) EQUAL(std::to_string(told), std::to_string(figures.lost));
        EQUAL(figures.error, "no room");
    }
}

constexpr Group kGroups[] = {{"sums", testSums}, {"records", testRecords}, {"cuts", testCuts}, {"flips", testFlips}, {"rebuilt", testRebuilt}, {"blackBox", testBlackBox}, {"refusals", testRefusals}, {"noRoom", testNoRoom}, {"losses", testLosses}};

}  // namespace

int main(int argc, char** argv) {
    if (argc > 2) folder = argv[2];
    return runGroups(kGroups, argc, argv);
}
