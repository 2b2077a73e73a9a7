// torture.cpp -- a snapshot buffer under the worst that can be done to it: is any record ever torn?
//
//     torture processes SECONDS KILLS     a writer at full speed, four reader processes; then a writer that is killed in
//                                         the middle, KILLS times, while they go on reading
//     torture threads SECONDS             the same by threads of one process, a follower beside: for ThreadSanitizer
//     torture quiet                       nobody sleeps: neither write nor read calls the system
//
// Every number of a record follows from its counter, and its bytes end in a sum over all that stands before them. Prints
// "ok" and some figures, or what was wrong.
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "../../services/shmem/follower.h"
#include "../../services/shmem/ring.h"

namespace {

using namespace shmem;

constexpr Shape kShape{4, 60, 21};          // few blocks, so that readers are overtaken; bytes that are no whole words
constexpr int kReaders = 4;

struct Record {
    std::vector<double> floats = std::vector<double>(kShape.floats);
    std::vector<unsigned char> any = std::vector<unsigned char>(kShape.any);

    std::uint64_t sum() const {
        std::uint64_t h = 1469598103934665603u;
        auto add = [&](const void* p, std::size_t n) {
            for (std::size_t i = 0; i < n; ++i) h = (h ^ static_cast<const unsigned char*>(p)[i]) * 1099511628211u;
        };
        add(floats.data(), floats.size() * sizeof(double));
        add(any.data(), any.size() - 8);
        return h;
    }
    void make(std::uint64_t n) {
        for (std::size_t i = 0; i < floats.size(); ++i) floats[i] = double(n * 1000 + i);
        for (std::size_t i = 0; i < any.size(); ++i) any[i] = static_cast<unsigned char>(n + i);
        std::uint64_t h = sum();
        std::memcpy(&any[any.size() - 8], &h, 8);
    }
    bool isOf(std::uint64_t n) const {
        std::uint64_t h = sum();
        return floats[0] == double(n * 1000) && std::memcmp(&any[any.size() - 8], &h, 8) == 0;
    }
};

// Memory by which the processes tell each other their counts.
struct Tally {
    std::atomic<std::uint64_t> read, overwritten, torn, backward, early, woken;
    std::atomic<bool> enough;
};

// inPlace: every second record is made while its block is open, so that a writer which is killed often leaves one.
void write(Writer& writer, const std::atomic<bool>& enough, bool inPlace) {
    Record r;
    while (!enough.load(std::memory_order_relaxed)) {
        std::uint64_t n = writer.count() + 1;
        if (inPlace && n % 2 == 0) {
            Block& b = writer.begin();
            r.make(n);
            std::memcpy(b.floats(), r.floats.data(), kShape.floats * sizeof(double));
            std::memcpy(b.any(kShape.floats), r.any.data(), kShape.any);
            writer.end(b);
        } else {
            r.make(n);
            writer.write(r.floats.data(), r.any.data());
        }
    }
}

// Reads in all ways there are, in turns.
void read(const Reader& reader, Tally& tally) {
    Record r;
    std::uint64_t newest = 0, n = 0, reads = 0, overwritten = 0;
    auto check = [&](const Stamp& s) {
        if (!r.isOf(s.counter)) tally.torn.fetch_add(1);
        if (s.counter == 0 || s.monotonic > nanoseconds()) tally.early.fetch_add(1);
        ++reads;
    };
    while (!tally.enough.load(std::memory_order_relaxed)) {
        Stamp s;
        switch (n++ % 4) {
            case 0:
                if (reader.latest(r.floats.data(), r.any.data(), s) != Outcome::read) {
                    ++overwritten;
                    break;
                }
                if (s.counter < newest) tally.backward.fetch_add(1);
                newest = s.counter;
                check(s);
                break;
            case 1: {
                std::uint64_t oldest = reader.oldest();
                if (reader.read(oldest, r.floats.data(), r.any.data(), s)) check(s);
                else ++overwritten;
                break;
            }
            case 2:
                if (reader.nearestTo(nanoseconds() - 500, false, r.floats.data(), r.any.data(), s) == Outcome::read) check(s);
                else ++overwritten;
                break;
#if !SHMEM_BY_THE_LETTER                    // in place is for those who know what they do
            case 3: {
                auto view = reader.view(reader.count());
                if (!view) break;
                std::memcpy(r.floats.data(), view.floats, kShape.floats * sizeof(double));
                std::memcpy(r.any.data(), view.any, kShape.any);
                if (view.valid()) check(view.stamp);
                else ++overwritten;
                break;
            }
#endif
        }
    }
    tally.read.fetch_add(reads);
    tally.overwritten.fetch_add(overwritten);
}

// Sleeps for each record, and counts how often it was woken by one.
void follow(const Reader& reader, Tally& tally) {
    std::uint64_t seen = 0, woken = 0;
    while (!tally.enough.load(std::memory_order_relaxed)) {
        std::uint32_t bell = reader.bell();
        reader.sleep(seen, bell, nanoseconds() + 20'000'000);
        std::uint64_t now = reader.count();
        woken += now > seen;
        seen = now;
    }
    tally.woken.fetch_add(woken);
}

int verdict(const Tally& t, const std::string& more) {
    bool good = t.torn == 0 && t.backward == 0 && t.early == 0 && t.read > 0 && t.woken > 0;
    std::printf("%s: %llu read, %llu overwritten, %llu torn, %llu backward, %llu early, %llu woken%s\n", good ? "ok" : "WRONG",
                (unsigned long long)t.read, (unsigned long long)t.overwritten, (unsigned long long)t.torn,
                (unsigned long long)t.backward, (unsigned long long)t.early, (unsigned long long)t.woken, more.c_str());
    return good ? 0 : 1;
}

void pause(double seconds) {
    timespec t{time_t(seconds), long((seconds - double(time_t(seconds))) * 1e9)};
    while (nanosleep(&t, &t) != 0) {}
}

template <class Body> pid_t inProcess(Body body) {
    std::fflush(stdout);
    pid_t pid = fork();
    if (pid != 0) return pid;
    int code = 1;
    try {
        body();
        code = 0;
    } catch (const std::exception& e) {
        std::fprintf(stderr, "%s\n", e.what());
    }
    _exit(code);
}

int processes(const std::string& key, double seconds, int kills) {
    auto* tally = new (mmap(nullptr, sizeof(Tally), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0)) Tally{};
    std::uint64_t written = 0, inTheMiddle = 0;
    auto startWriter = [&](std::uint64_t after) {
        pid_t pid = inProcess([&] {
            Writer writer(key, kShape, "torture");
            if (writer.count() < after) throw std::runtime_error("counters went back");
            write(writer, tally->enough, true);
        });
        return pid;
    };
    pid_t writer = startWriter(0);
    std::optional<Reader> reader;
    while (!reader) {
        try {
            reader.emplace(key);
        } catch (const Failure& f) {
            if (f.reason != Reason::absent) throw;
            pause(0.001);
        }
    }
    while (reader->count() == 0) pause(0.001);
    std::vector<pid_t> readers;
    for (int i = 0; i < kReaders; ++i) readers.push_back(inProcess([&] { read(Reader(key), *tally); }));
    readers.push_back(inProcess([&] { follow(Reader(key), *tally); }));
    pause(seconds);
    std::srand(4711);
    for (int i = 0; i < kills; ++i) {
        kill(writer, SIGKILL);
        waitpid(writer, nullptr, 0);
        std::uint64_t n = reader->count();
        inTheMiddle += reader->segment()->block(n + 1).sequence.load() == 2 * n + 1;
        writer = startWriter(n);
        while (reader->count() == n && waitpid(writer, nullptr, WNOHANG) == 0) pause(0.0001);
        if (reader->count() == n) return std::printf("WRONG: after %d kills no writer took over\n", i + 1), 1;
        pause(std::rand() % 3000 * 1e-6);
    }
    tally->enough = true;
    int wrong = 0;
    readers.push_back(writer);
    for (pid_t pid : readers) {
        int status = 0;
        waitpid(pid, &status, 0);
        wrong += status != 0;
    }
    written = reader->count();
    if (reader->retired()) ++wrong;
    if (wrong) std::printf("WRONG: %d processes ended badly\n", wrong);
    return verdict(*tally, ", " + std::to_string(written) + " written, " + std::to_string(kills) + " writers killed, " +
                               std::to_string(inTheMiddle) + " in the middle of a record") + wrong;
}

int threads(const std::string& key, double seconds) {
    Tally tally{};
    Writer writer(key, kShape, "torture");
    // All by the writer's mapping: ThreadSanitizer takes another address for other memory.
    std::vector<std::thread> all;
    all.emplace_back([&] { write(writer, tally.enough, false); });
    for (int i = 0; i < kReaders; ++i) all.emplace_back([&] { read(writer.reader(), tally); });
    all.emplace_back([&] { follow(writer.reader(), tally); });
    // A follower that is told something else all the time.
    std::atomic<int> news{0};
    {
        Follower follower([&] { news.fetch_add(1); });
        Reader reader = writer.reader();
        std::int64_t end = nanoseconds() + std::int64_t(seconds * 1e9);
        for (int i = 0; nanoseconds() < end; ++i) {
            std::uint64_t far = reader.count() + (i % 3 == 0 ? 1'000'000'000 : i % 7);
            follower.watch(i % 11 == 0 ? std::optional<Reader>() : reader, far, nanoseconds() + i % 5 * 200'000);
            if (i % 17 == 0) follower.rest();
            pause(i % 4 * 1e-4);
        }
    }
    tally.enough = true;
    for (auto& t : all) t.join();
    return verdict(tally, ", " + std::to_string(writer.count()) + " written") + (news == 0);
}

// In a process that the kernel kills at its first system call but exit. Returns how it ended.
enum class End { well, killed, impossible };
template <class Body> End withoutTheSystem(Body body) {
    pid_t pid = inProcess([&] {
        // SECCOMP_MODE_STRICT would take the clock away as well.
        sock_filter rules[] = {BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
                               BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_exit, 0, 1), BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
                               BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_KILL_PROCESS)};
        sock_fprog program{4, rules};
        if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0 || prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) != 0)
            _exit(1);
        body();
        syscall(SYS_exit, 0);
    });
    int status = 0;
    waitpid(pid, &status, 0);
    return !WIFEXITED(status) ? End::killed : WEXITSTATUS(status) == 0 ? End::well : End::impossible;
}

int quiet(const std::string& key) {
    if (withoutTheSystem([] { nanoseconds(), nanoseconds(CLOCK_REALTIME); }) != End::well)
        return std::puts("ok: this machine has no seccomp, or no clock without a system call"), 0;
    Writer writer(key, kShape, "torture");
    Reader reader = writer.reader();
    Record r;
    End end = withoutTheSystem([&] {
        // Longer than a second: the wall clock is looked at anew.
        for (std::int64_t late = nanoseconds() + 1'100'000'000; nanoseconds() < late;) {
            writer.write(r.floats.data(), r.any.data());
            Stamp s;
            reader.latest(r.floats.data(), r.any.data(), s);
        }
    });
    bool good = end == End::well && reader.count() > 1000;
    std::puts(good ? "ok" : "WRONG: the system was called");
    return good ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
    std::string how = argc > 2 ? argv[1] : "";
    std::string key = "torture" + std::to_string(getpid());
    try {
        if (how == "processes" && argc == 4) return processes(key, std::atof(argv[2]), std::atoi(argv[3]));
        if (argc == 2 && std::string(argv[1]) == "quiet") return quiet(key);
        if (how == "threads" && argc == 3) return threads(key, std::atof(argv[2]));
    } catch (const std::exception& e) {
        std::fprintf(stderr, "torture: %s\n", e.what());
        return 1;
    }
    std::fprintf(stderr, "usage: torture processes SECONDS KILLS | torture threads SECONDS | torture quiet\n");
    return 2;
}
