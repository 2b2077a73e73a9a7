// snapshotThreads.cpp FOLDER -- a cycle steps writer and reader of a snapshot buffer while both are asked all there is to ask.
//
// FOLDER has the modules cycle and shmem. Data of a step and data of those who wait for the next record must be
// kept apart: they run on two threads. Built with ThreadSanitizer this is what CI runs. Prints "ok", or what went wrong.
#include <dlfcn.h>
#include <unistd.h>

#include <cstdio>
#include <string>
#include <vector>

#include "comm/comm.h"
#include "sorma.h"

using namespace sorma;

namespace {

int failures = 0;

void check(bool right, const std::string& what) {
    if (right) return;
    ++failures;
    std::printf("%s\n", what.c_str());
}

void load(const std::string& path, const char* init, void* key) {
    void* module = dlopen(path.c_str(), RTLD_NOW);
    auto* call = module ? reinterpret_cast<int (*)(void*)>(dlsym(module, init)) : nullptr;
    check(call && call(key) == 0, "cannot load " + path);
}

std::string must(Sorm& sorm, const std::string& request) {
    std::string reply;
    sorm.dispatch(request, reply);
    check(reply.find(" RET 0") != std::string::npos, request + ": " + reply);
    return reply;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 2) return std::fprintf(stderr, "usage: snapshotThreads FOLDER\n"), 2;
    int key = 0;
    Sorm sorm;
    sorm.bindTo(&key);
    Comm comm(sorm);
    load(std::string(argv[1]) + "/cycle.so", "Cycle_Init", &key);
    load(std::string(argv[1]) + "/shmem.so", "Shmem_Init", &key);
    if (failures) return 1;

    const std::string k = "threads" + std::to_string(getpid()), w = "shmem_w." + k, r = "shmem_r." + k, c = "cycle." + k;
    const std::string record = w + " EXEC FMSG 3 4 5 6 AMSG eHk=", steps = " -steps '\"" + record + "\" " + r + "'";
    must(sorm, "sorm CTRL -create " + w + " -floats 3 -any 2 -blocks 8");
    must(sorm, record);
    must(sorm, c + " CTRL -period 0.0005 -lockMemory 0" + steps);
    for (int round = 0; round < 4; ++round) {
        must(sorm, c + " CTRL -start");
        std::vector<Future> futures;
        int answers = 0;
        for (int i = 0; i < 100; ++i) {
            for (auto* request : {" EXEC", " EXEC since", " EXEC history 3", " EXEC nearestTo 0", " CTRL -dump", " DBX -timing"})
                must(sorm, r + request);
            must(sorm, w + " DBX -timing");
            // One waits, one begins to; some have little patience, some are given up.
            must(sorm, r + " EXEC next 20");
            Message m;
            m.words = {"next", i % 3 == 0 ? "0.0003" : "20"};
            futures.push_back(sorm.get(r)->async(Method::exec, m));
            futures.back().then([&answers](Future) { ++answers; });
            if (i % 5 == 0) futures[std::size_t(i / 2)].cancel();
            sorm.turn(Deadline::in(1));
        }
        // Requests that still wait are told that it has gone, while it is a step.
        if (round % 2 == 1) must(sorm, "sorm CTRL -remove " + r);
        must(sorm, c + " CTRL -stop");
        for (Deadline enough = Deadline::in(60'000); answers < 100 && !enough.passed();) {
            must(sorm, record);
            sorm.turn(Deadline::in(1));
        }
        check(answers == 100, std::to_string(answers) + " answers instead of 100");
        if (round % 2 == 1) must(sorm, c + " CTRL" + steps);
    }
    std::printf("%s\n", failures == 0 ? "ok" : "failed");
    return failures > 0;
}
