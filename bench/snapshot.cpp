// snapshot.cpp -- records through shared memory: written, read, and a reader woken.
#include "rows.h"

#include <linux/futex.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <climits>
#include <cstring>

#include "../services/shmem/ring.h"
#include "interpreter.h"

namespace bench {

namespace {

const std::vector<Case> kCases = {
    {"M_w", "EXEC of shmem_w by reference, 10 floats", "memcpy and clock_gettime", 1.25},
    {"M_w100", "100 floats", "memcpy and clock_gettime", 1.25},
    {"M_w100k", "100 000 floats", "memcpy to as many blocks, and clock_gettime", 1.2},
    {.row = "M_r", .what = "EXEC of shmem_r by reference, latest, 10 floats", .floor = "memcpy", .mostMore = 15},
    {.row = "M_r100", .what = "100 floats", .floor = "memcpy", .mostMore = 15},
    {"M_r100k", "100 000 floats", "memcpy", 1.2},
    {"M_view", "latest in place, with its check, C++ alone, any size"},
    {.row = "M_wake", .what = "from the write to the reader that slept, 2 CPUs", .floor = "a bare futex", .most = 1.1,
     .batch = 200'000, .batches = 20},
};

constexpr std::size_t kSizes[] = {10, 100, 100'000};
constexpr std::uint64_t kBlocks = 4;

std::string ownKey(std::size_t floats) { return "bench" + std::to_string(getpid()) + "x" + std::to_string(floats); }

// The floors copy to and from this memory; it is of the same kind as a segment's.
class Pages {
public:
    explicit Pages(std::size_t bytes) : bytes_(bytes) {
        void* p = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS | MAP_POPULATE, -1, 0);
        if (p == MAP_FAILED) throw std::runtime_error("no memory");
        at_ = static_cast<char*>(p);
    }
    ~Pages() { munmap(at_, bytes_); }
    Pages(const Pages&) = delete;
    Pages& operator=(const Pages&) = delete;
    char* at() const { return at_; }

private:
    std::size_t bytes_;
    char* at_;
};

void copies(Table& table, Interpreter& interpreter, std::size_t floats, const Case& write, const Case& read) {
    if (!table.wants(write.row) && !table.wants(read.row)) return;
    const std::string key = ownKey(floats);
    auto writer = interpreter.sorm().create("shmem_w." + key, {"-blocks", std::to_string(kBlocks), "-floats", std::to_string(floats)}, nullptr);
    auto reader = interpreter.sorm().create("shmem_r." + key, {}, nullptr);
    const std::size_t bytes = floats * sizeof(double);
    sorma::Message in, out;
    in.floats.assign(floats, 1.5);
    writer.exec(in);
    // Large records are written to one block after another, which are more than fit into a cache near by; so is the floor.
    const std::size_t stride = (bytes + 4095) / 4096 * 4096;
    const std::size_t blocks = floats > 1000 ? kBlocks : 1;
    Pages pages(blocks * stride);
    std::size_t next = 0;
    timespec t;
    table.measure(write,
                  repeat([&] {
                      writer.exec(in);
                      keep(in);
                  }),
                  repeat([&] {
                      clock_gettime(CLOCK_MONOTONIC, &t);
                      keep(t);
                      char* to = pages.at() + next * stride;
                      std::memcpy(to, in.floats.data(), bytes);
                      if (++next == blocks) next = 0;
                      keep(*to);
                  }));
    out.floats.assign(floats, 0);
    reader.exec(out);
    table.measure(read,
                  repeat([&] {
                      reader.exec(out);
                      keep(out);
                  }),
                  repeat([&] {
                      std::memcpy(out.floats.data(), pages.at(), bytes);
                      keep(out);
                  }));
    interpreter.sorm().remove(reader->name(), sorma::Permit::owner());
    interpreter.sorm().remove(writer->name(), sorma::Permit::owner());
}

void inPlace(Table& table, const Case& of) {
    if (!table.wants(of.row)) return;
    shmem::Writer writer(ownKey(1000), {kBlocks, 1000, 0}, "bench");
    std::vector<double> record(1000, 1.5);
    writer.write(record.data(), nullptr);
    shmem::Reader reader(ownKey(1000));
    double sum = 0;
    table.measure(of, repeat([&] {
        auto view = reader.view(reader.count());
        double first = view.floats[0];
        if (view.valid()) sum += first;
        keep(sum);
    }));
}

// A reader process on the other CPU, which sleeps until something comes and tells how late it was.
class Sleeper {
public:
    struct Shared {
        std::atomic<std::int64_t> sent, latency;
        std::atomic<std::uint32_t> word, seen;
    };
    // receive() returns when the next one has come, and gives the time at which it was sent.
    template <class Receive> explicit Sleeper(Receive receive) {
        void* p = mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
        if (p == MAP_FAILED) throw std::runtime_error("no memory");
        shared_ = new (p) Shared{};
        process_ = fork();
        if (process_ < 0) throw std::runtime_error("cannot fork");
        if (process_ > 0) return;
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        pin(0, cpus().second);
        for (;;) {
            std::int64_t sent = receive(*shared_);
            shared_->latency.store(now() - sent);
            shared_->seen.fetch_add(1);
        }
    }
    ~Sleeper() {
        kill(process_, SIGKILL);
        waitpid(process_, nullptr, 0);
        munmap(shared_, sizeof(Shared));
    }
    Sleeper(const Sleeper&) = delete;
    Sleeper& operator=(const Sleeper&) = delete;

    // The body of a row: what matters is how late they arrive, not how long that takes us.
    template <class Send> Body body(Send send) {
        return [this, send](std::int64_t count) {
            std::int64_t sum = 0;
            for (; count > 0; --count) {
                std::uint32_t seen = shared_->seen.load();
                for (std::int64_t end = now() + kGap; now() < end;) {}      // it is surely asleep again
                send(*shared_);
                for (std::int64_t end = now() + kPatience; shared_->seen.load() == seen;)
                    if (now() > end) throw std::runtime_error("the reader does not wake");
                sum += shared_->latency.load();
            }
            return sum;
        };
    }

private:
    static constexpr std::int64_t kGap = 200'000, kPatience = 2'000'000'000;    // [ns]
    Shared* shared_;
    pid_t process_;
};

void wake(Table& table, Interpreter& interpreter, const Case& of) {
    if (!table.wants(of.row)) return;
    const std::string key = ownKey(1);
    auto writer = interpreter.sorm().create("shmem_w." + key, {"-floats", "1"}, nullptr);
    sorma::Message m;
    m.floats.assign(1, 0);
    Sleeper ours([reader = shmem::Reader(key), last = std::uint64_t{0}](Sleeper::Shared&) mutable {
        while (reader.count() == last) reader.sleep(last, reader.bell(), INT64_MAX);
        last = reader.count();
        double value;
        shmem::Stamp stamp;
        reader.latest(&value, nullptr, stamp);
        return std::int64_t(value);
    });
    Sleeper bare([last = std::uint32_t{0}](Sleeper::Shared& s) mutable {
        while (s.word.load() == last) syscall(SYS_futex, reinterpret_cast<std::uint32_t*>(&s.word), FUTEX_WAIT, last, nullptr, nullptr, 0);
        last = s.word.load();
        return s.sent.load();
    });
    table.measure(of,
                  ours.body([&](Sleeper::Shared&) {
                      m.floats[0] = double(now());
                      writer.exec(m);
                  }),
                  bare.body([](Sleeper::Shared& s) {
                      s.sent.store(now());
                      s.word.fetch_add(1);
                      syscall(SYS_futex, reinterpret_cast<std::uint32_t*>(&s.word), FUTEX_WAKE, INT_MAX, nullptr, nullptr, 0);
                  }));
    interpreter.sorm().remove(writer->name(), sorma::Permit::owner());
}

}  // namespace

void snapshot(Table& table) {
    if (!table.wantsAny(kCases)) return;
    Interpreter interpreter;
    for (int i = 0; i < 3; ++i) copies(table, interpreter, kSizes[i], kCases[i], kCases[3 + i]);
    inPlace(table, kCases[6]);
    wake(table, interpreter, kCases[7]);
}

}  // namespace bench
