#include "subscribers.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <utility>

#include "measure.h"
#include "remote.h"

namespace bench {

namespace {

constexpr int kPatience = 20'000;       // [ms] for all to have a batch

}  // namespace

Subscribers::Subscribers(Kind kind, const std::string& object, int processes, int each, int batch, int cpu) {
    int pipe[2];
    if (pipe2(pipe, O_CLOEXEC) != 0) throw std::runtime_error("no pipe for the subscribers");
    heard_ = pipe[0];
    for (int i = 0; i < processes; ++i) {
        pid_t process = fork();
        if (process == 0) {
            prctl(PR_SET_PDEATHSIG, SIGKILL);
            // Nothing of the parent's: a connection that stayed open here would not end when the parent closes it.
            int mine = dup2(pipe[1], 3);
            close_range(4, ~0u, 0);
            pin(0, cpu);
            listen(mine, kind, object, each, batch);
        }
        if (process > 0) processes_.push_back(process);
    }
    close(pipe[1]);
    try {
        if (processes_.size() != std::size_t(processes)) throw std::runtime_error("no process for a subscriber");
        hear(kReady);
    } catch (...) {
        stop();
        throw;
    }
}

Subscribers::~Subscribers() { stop(); }

void Subscribers::stop() {
    for (pid_t process : processes_) kill(process, SIGKILL);
    for (pid_t process : processes_) waitpid(process, nullptr, 0);
    processes_.clear();
    if (heard_ >= 0) close(std::exchange(heard_, -1));
}

void Subscribers::listen(int tell, Kind kind, const std::string& object, int each, int batch) {
    auto say = [tell](char word) {
        if (write(tell, &word, 1) != 1) _exit(1);
    };
    try {
        Bus bus;
        if (kind == Kind::sharing) bus.comm.settings.sharing = sorma::Sharing::always;
        sorma::Reference publisher = bus.sorm.get(object);
        std::vector<std::unique_ptr<sorma::Listening>> all;
        std::int64_t left = std::int64_t(each) * batch;
        auto take = [&](sorma::Received& event) {
            if (event.lost != 0) say(kLost);
            if (--left > 0) return;
            left = std::int64_t(each) * batch;
            say(kBatch);
        };
        // It keeps more than the latest event: a subscriber that keeps one also gets the last one from before.
        for (int i = 0; i < each; ++i) all.push_back(publisher->listen("tick", std::size_t(std::max(batch, 2)), take));
        say(kReady);
        while (kind == Kind::deaf) pause();
        for (;;) bus.comm.reactor().poll(-1);
    } catch (const std::exception& e) {
        std::fprintf(stderr, "bench: a subscriber: %s\n", e.what());
        say(kFailed);
    }
    _exit(1);
}

void Subscribers::hear(char word) {
    std::int64_t end = now() + std::int64_t(kPatience) * 1'000'000;
    for (std::size_t missing = processes_.size(); missing > 0;) {
        pollfd p{heard_, POLLIN, 0};
        int n = poll(&p, 1, 200);
        checkSignals();
        if (n <= 0) {
            if (now() > end) throw std::runtime_error("events do not arrive at " + std::to_string(missing) + " subscribers");
            continue;
        }
        char words[64];
        ssize_t got = read(heard_, words, std::min(missing, sizeof words));
        if (got <= 0) throw std::runtime_error("the subscribers have ended");
        for (ssize_t i = 0; i < got; ++i) {
            if (words[i] == kLost) throw std::runtime_error("a subscriber has lost events");
            if (words[i] != word) throw std::runtime_error("a subscriber could not listen");
            --missing;
        }
    }
}

}  // namespace bench
