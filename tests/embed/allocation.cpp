// allocation.cpp ?ADDRESS? -- counts what a warmed-up call by reference takes from the heap, and its locks.
//
// With an address it also calls that daemon's echo. Prints a line for each kind of call.
#include <dlfcn.h>
#include <pthread.h>

#include <cstdio>
#include <cstdlib>

#include "comm/comm.h"
#include "sorma.h"

// Everything that comes from the heap passes here: C++'s new and all of malloc's family.
extern "C" void* __libc_malloc(std::size_t);
extern "C" void* __libc_calloc(std::size_t, std::size_t);
extern "C" void* __libc_realloc(void*, std::size_t);

namespace {
bool counting = false;
long allocations = 0, locks = 0;
}  // namespace

extern "C" void* malloc(std::size_t n) {
    allocations += counting;
    return __libc_malloc(n);
}
extern "C" void* calloc(std::size_t n, std::size_t size) {
    allocations += counting;
    return __libc_calloc(n, size);
}
extern "C" void* realloc(void* p, std::size_t n) {
    allocations += counting;
    return __libc_realloc(p, n);
}
extern "C" int pthread_mutex_lock(pthread_mutex_t* m) noexcept {
    using Lock = int (*)(pthread_mutex_t*);
    static const Lock real = reinterpret_cast<Lock>(dlsym(RTLD_NEXT, "pthread_mutex_lock"));
    locks += counting;
    return real(m);
}

namespace {

class Nothing : public sorma::Service {
public:
    void exec(sorma::Message&) override {}
};

class Adder : public sorma::Service {
public:
    void exec(sorma::Message& m) override {
        for (double& x : m.floats) x += 1;
    }
};

template <class Call> void count(const char* what, Call call) {
    for (int i = 0; i < 200; ++i) call();       // warms up; one call in 64 is timed, and that needs a record once
    allocations = locks = 0;
    counting = true;
    for (int i = 0; i < 1000; ++i) call();
    counting = false;
    std::printf("%s: %ld allocations, %ld locks in 1000 calls\n", what, allocations, locks);
}

}  // namespace

int main(int argc, char** argv) {
    sorma::Sorm sorm;
    sorma::Comm comm(sorm);
    sorm.add(sorma::Class::of<Nothing>("nothing", "does nothing"));
    sorm.add(sorma::Class::of<Adder>("adder", "adds 1").reads(sorma::Field::floats, sorma::exactly(10), "1", "numbers"));
    sorma::Message m;
    auto nothing = sorm.get("nothing");
    count("by reference, empty", [&] { nothing.exec(m); });
    auto adder = sorm.get("adder");
    m.floats.assign(10, 0.5);
    count("by reference, 10 floats", [&] { adder.exec(m); });
    std::string reply, request = "adder EXEC FMSG 10 0.5 1 2 3 4 5 6 7 8 9";
    count("by text, 10 floats", [&] { sorm.dispatch(request, reply); });
    if (argc > 1) {
        try {
            auto echo = sorm.get(std::string("echo@") + argv[1]);
            m.text = "sixteen letters!";
            count("to a daemon, text and 10 floats", [&] { echo.exec(m); });
        } catch (const sorma::Error& e) {
            std::fprintf(stderr, "%s\n", e.what());
            return 1;
        }
    }
    return 0;
}
