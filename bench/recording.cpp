// recording.cpp -- records written to the file of a recording, and read again.
#include "rows.h"

#include <sys/mman.h>
#include <unistd.h>

#include "interpreter.h"
#include "recording/reader.h"
#include "recording/recorder.h"
#include "recording/writer.h"

namespace bench {

namespace {

constexpr int kRecords = 3000;          // of a block, so that each batch writes some

const std::vector<Case> kCases = {
    {.row = "RECORD", .what = "a small record to a file in memory, with its check sum", .mostNs = 500, .per = kRecords, .batch = 1'000'000},
    {.row = "RECORD_read", .what = "the same read again, and checked", .mostNs = 500},
    {.row = "RECORD_request", .what = "EXEC by reference, 1 float, while it is recorded to a file in memory", .floor = "the same, not recorded", .mostMore = 200},
    {.row = "RECORD_zstd", .what = "the same written, and compressed", .mostNs = 500, .per = kRecords, .batch = 1'000'000},
};

// A file in memory, which is emptied by each writer.
class MemoryFile {
public:
    MemoryFile() : fd_(memfd_create("recording", MFD_CLOEXEC)) {
        if (fd_ < 0) throw std::runtime_error("no file in memory");
    }
    ~MemoryFile() { close(fd_); }
    MemoryFile(const MemoryFile&) = delete;
    MemoryFile& operator=(const MemoryFile&) = delete;
    std::string name() const { return "/proc/self/fd/" + std::to_string(fd_); }

private:
    int fd_;
};

using namespace sorma::recording;

// Adds records to blocks and writes these, over and over in 64 MB.
class Tape {
public:
    explicit Tape(const std::string& file, bool compress = false) : writer_(file, {.most = 64 << 20, .compress = compress}) { m_.floats = {1.5}; }
    void add() {
        ++number_;
        m_.floats[0] = double(number_);
        block_.add({Kind::request, sorma::Method::exec, "robot", number_ & 1 ? "carry.slow" : "carry.fast", "anna@lab", 0, std::int64_t(number_) * 1000, number_}, &m_);
    }
    void write() { writer_.write(block_); }
    void close() { writer_.close(); }

private:
    Writer writer_;
    Block block_;
    sorma::Message m_;
    std::uint64_t number_ = 0;
};

// The same object in two SORMs, one of which is recorded.
void requests(Table& table, const std::string& file) {
    Interpreter seen, other;
    Writer writer(file, {.most = 64 << 20});
    Recorder recorder(seen.sorm(), {.requests = "*", .events = {}, .source = "robot", .without = {}, .author = nullptr}, [&](Block& block, std::int64_t) { writer.write(block); });
    auto body = [](sorma::Reference nop) {
        return repeat([nop, m = sorma::Message()]() mutable {
            m.floats.assign(1, 1.5);
            nop.exec(m);
            keep(m);
        });
    };
    table.measure(kCases[2], body(seen.sorm().get("nop")), body(other.sorm().get("nop")));
    recorder.stop();
    if (recorder.figures().lost > 0) throw std::runtime_error("the recorder has lost " + std::to_string(recorder.figures().lost) + " records");
}

}  // namespace

void recording(Table& table) {
    if (!table.wantsAny(kCases)) return;
    MemoryFile file;
    for (const bool compress : {false, true}) {
        if (compress && !canCompress()) break;
        Tape tape(file.name(), compress);
        table.measure(kCases[compress ? 3 : 0], repeat([&] {
                          for (int i = 0; i < kRecords; ++i) tape.add();
                          tape.write();
                      }));
    }
    {
        Tape tape(file.name());
        for (int i = 0; i < 30 * kRecords; ++i) {
            tape.add();
            if (i % kRecords == 0) tape.write();
        }
        tape.write();
        tape.close();
    }
    Reader reader(file.name());
    Record record;
    sorma::Message m;
    table.measure(kCases[1], repeat([&] {
                      if (!reader.next(record)) reader.seek(0);
                      record.read(m);
                      keep(m);
                  }));
    requests(table, file.name());
}

}  // namespace bench
