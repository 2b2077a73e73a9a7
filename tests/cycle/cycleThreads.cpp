// cycleThreads.cpp FOLDER -- a cycle that ticks while its objects are asked, retuned, removed and handed over.
//
// FOLDER has the modules cycle and trouble. Two cycles run in the threads of one SORM, whose own thread sends requests to
// their objects without pause. Built with ThreadSanitizer this is what CI runs: whatever two threads touch without
// handing it over would show. Prints "ok", or what went wrong.
#include <dlfcn.h>
#include <pthread.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <string>

#include "comm/comm.h"
#include "sorma.h"

using namespace sorma;

namespace {

std::atomic<int> threadsLeft{-1};       // so many threads may be started; then the next one is refused, once. < 0: any number

}  // namespace

// Every thread of the program is started by this.
extern "C" int pthread_create(pthread_t* thread, const pthread_attr_t* settings, void* (*run)(void*), void* argument) noexcept {
    static auto* create = reinterpret_cast<decltype(&pthread_create)>(dlsym(RTLD_NEXT, "pthread_create"));
    if (threadsLeft >= 0 && threadsLeft-- == 0) return EAGAIN;
    return create(thread, settings, run, argument);
}

namespace {

int failures = 0;

void check(bool right, const std::string& what) {
    if (right) return;
    ++failures;
    std::printf("%s\n", what.c_str());
}

void load(const std::string& folder, const std::string& name, void* key) {
    std::string path = folder + "/" + name + ".so";
    void* module = dlopen(path.c_str(), RTLD_NOW);
    if (!module) {
        check(false, dlerror());
        return;
    }
    std::string init = name + "_Init";
    init[0] = char(init[0] - 'a' + 'A');
    auto* call = reinterpret_cast<int (*)(void*)>(dlsym(module, init.c_str()));
    check(call && call(key) == 0, "cannot load " + path);
}

std::string ask(Sorm& sorm, const std::string& request) {
    std::string reply;
    sorm.dispatch(request, reply);
    return reply;
}

void must(Sorm& sorm, const std::string& request) {
    std::string reply = ask(sorm, request);
    check(reply.find(" RET 0") != std::string::npos || reply.find(" RET 1") != std::string::npos, request + ": " + reply);
}

// A change that takes too long for a tick is undone and told: that is right, too, and happens under a sanitizer on a busy machine.
void tune(Sorm& sorm, const std::string& request) {
    std::string reply = ask(sorm, request);
    check(reply.find(" RET 0") != std::string::npos || reply.find("CYCLE LATE") != std::string::npos, request + ": " + reply);
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 2) return std::fprintf(stderr, "usage: cycleThreads FOLDER\n"), 2;
    int key = 0;
    Sorm sorm;
    sorm.bindTo(&key);
    Comm comm(sorm);
    load(argv[1], "cycle", &key);
    load(argv[1], "trouble", &key);
    if (failures) return 1;

    must(sorm, "cycle.a CTRL -period 0.001 -steps 'trouble.a trouble.b' -onfault 'trouble.safe EXEC IMSG 1 1' -afterFault continue -lockMemory 0");
    must(sorm, "cycle.b CTRL -period 0.0007 -overrun catchUp -steps trouble.c -lockMemory 0");

    // Without a thread it does not start, and its objects are as before.
    for (int threads : {0, 1}) {
        threadsLeft = threads;
        std::string reply = ask(sorm, "cycle.a CTRL -start");
        check(reply.find("CYCLE THREAD") != std::string::npos && threadsLeft == -1, "it started without a thread: " + reply);
        must(sorm, "trouble.a CTRL -value 1");
        must(sorm, "cycle.a CTRL -dump");
    }

    std::size_t events = 0;
    auto listening = sorm.get("cycle.a")->listen("*", 1000, [&](Received&) { ++events; });
    for (int round = 0; round < 5; ++round) {
        must(sorm, "cycle.a CTRL -start");
        must(sorm, "cycle.b CTRL -start");
        for (int i = 0; i < 100; ++i) {
            tune(sorm, "trouble.a CTRL -value " + std::to_string(i));
            must(sorm, "trouble.c EXEC FMSG 2 1 2");
            must(sorm, "trouble.b CTRL -dump");
            ask(sorm, "trouble.b CTRL -nosuch 1");
            must(sorm, "cycle.a CTRL -dump");
            if (i % 10 == 0) must(sorm, "cycle.a DBX -stats");
            if (i % 25 == 0) tune(sorm, "cycle.a CTRL -period 0.001 -steps '" + std::string(i % 50 ? "trouble.a trouble.b" : "trouble.b trouble.d") + "'");
            if (i % 30 == 0) {
                // A step that fails: the thread takes the safe action, and tells of it.
                std::string dump = ask(sorm, "trouble.b CTRL -dump");
                long calls = std::stol(dump.substr(dump.find("# calls ") + 8));
                tune(sorm, "trouble.b CTRL -failAt " + std::to_string(calls + 3));
            }
            sorm.turn(Deadline::in(1));
        }
        must(sorm, "cycle.b CTRL -stop");
        if (round % 2) must(sorm, "cycle.a CTRL -stop");
        else must(sorm, "sorm CTRL -remove cycle.a");
        if (round % 2 == 0) {
            must(sorm, "cycle.a CTRL -period 0.001 -steps 'trouble.a trouble.b' -afterFault continue -lockMemory 0");
            events = 1;
        }
    }
    must(sorm, "cycle.b CTRL -start");      // ... and the SORM ends while it runs
    check(events > 0, "the faults were not told");
    listening.reset();
    std::printf("%s\n", failures == 0 ? "ok" : "failed");
    return failures == 0 ? 0 : 1;
}
