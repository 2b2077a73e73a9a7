#include "process.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "measure.h"

namespace bench {

namespace {

constexpr int kStartTime = 60'000;      // [ms] for a daemon to say that it is ready
constexpr int kStopTime = 10'000;       // [ms] for it to end

void must(bool ok, const std::string& what) {
    if (!ok) throw std::runtime_error(what + ": " + std::strerror(errno));
}

// Connected: [0] ours, [1] the server's.
void makePair(Kind kind, int (&fd)[2]) {
    if (kind == Kind::unixSocket) return must(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, fd) == 0, "socketpair");
    sockaddr_in address{};
    socklen_t size = sizeof address;
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    auto* any = reinterpret_cast<sockaddr*>(&address);
    int listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    must(bind(listener, any, sizeof address) == 0 && listen(listener, 1) == 0, "listen");
    getsockname(listener, any, &size);
    fd[0] = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    must(connect(fd[0], any, sizeof address) == 0, "connect");
    fd[1] = accept4(listener, nullptr, nullptr, SOCK_CLOEXEC);
    must(fd[1] >= 0, "accept");
    close(listener);
    int on = 1;
    for (int end : fd) setsockopt(end, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
}

bool writeAll(int fd, const char* data, std::size_t size) {
    while (size > 0) {
        ssize_t n = send(fd, data, size, MSG_NOSIGNAL);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) return false;
        data += n;
        size -= std::size_t(n);
    }
    return true;
}

ssize_t readSome(int fd, char* data, std::size_t room) {
    for (;;) {
        ssize_t n = recv(fd, data, room, 0);
        if (n >= 0 || errno != EINTR) return n;
    }
}

bool readAll(int fd, char* data, std::size_t size) {
    while (size > 0) {
        ssize_t n = readSome(fd, data, size);
        if (n <= 0) return false;
        data += n;
        size -= std::size_t(n);
    }
    return true;
}

// To network byte order and back: into the other one's memory, as a record is made and read.
void swapInto(std::vector<char>& out, const std::vector<double>& in) {
    for (std::size_t i = 0; i < in.size(); ++i) {
        std::uint64_t w;
        std::memcpy(&w, &in[i], 8);
        w = __builtin_bswap64(w);
        std::memcpy(&out[8 * i], &w, 8);
    }
}

void swapInto(std::vector<double>& out, const std::vector<char>& in) {
    for (std::size_t i = 0; i < out.size(); ++i) {
        std::uint64_t w;
        std::memcpy(&w, &in[8 * i], 8);
        w = __builtin_bswap64(w);
        std::memcpy(&out[i], &w, 8);
    }
}

void serveEcho(int fd, std::size_t requestSize, std::size_t replySize) {
    constexpr std::size_t kRoom = 64 * 1024;
    std::vector<char> in(kRoom), out((kRoom / requestSize + 1) * replySize);
    for (std::size_t partial = 0;;) {
        ssize_t n = readSome(fd, in.data(), in.size());
        if (n <= 0) return;
        partial += std::size_t(n);
        std::size_t whole = partial / requestSize;
        partial %= requestSize;
        if (whole > 0 && !writeAll(fd, out.data(), whole * replySize)) return;
    }
}

void serveDoubles(int fd, std::size_t count) {
    std::vector<double> values(count);
    std::vector<char> bytes(8 * count);
    while (readAll(fd, bytes.data(), bytes.size())) {
        swapInto(values, bytes);
        swapInto(bytes, values);
        if (!writeAll(fd, bytes.data(), bytes.size())) return;
    }
}

// The first line that comes, or what there is when the other end closes or the time is over.
std::string readLine(int fd, int milliseconds) {
    std::string line;
    std::int64_t end = now() + std::int64_t(milliseconds) * 1'000'000;
    for (;;) {
        pollfd p{fd, POLLIN, 0};
        int left = int(std::max<std::int64_t>(0, (end - now()) / 1'000'000));
        int n = poll(&p, 1, std::min(left, 200));
        checkSignals();
        if (n <= 0 && left > 0) continue;
        char c;
        if (n <= 0 || read(fd, &c, 1) <= 0 || c == '\n') return line;
        line += c;
    }
}

}  // namespace

// ---- Folder ----

Folder::Folder() {
    const char* base = std::getenv("TMPDIR");
    std::string name = std::string(base && *base ? base : "/tmp") + "/sorma-bench-XXXXXX";
    must(mkdtemp(name.data()) != nullptr, name);
    path_ = name;
    setenv("SORMA_RUNTIME_DIR", path_.c_str(), 1);
    setenv("SORMA_KEYS", path("keys").c_str(), 1);
}

Folder::~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
}

std::string Folder::file(const std::string& name, const std::string& text) const {
    std::ofstream out(path(name));
    out << text;
    out.close();
    must(out.good(), path(name));
    return path(name);
}

// ---- Daemon ----

Daemon::Daemon(const std::string& name, int cpu, const std::vector<std::string>& words) : name_(name) {
    std::vector<std::string> all{"sormad", "-name", name, "-port", "0"};
    all.insert(all.end(), words.begin(), words.end());
    std::vector<char*> argv;
    for (auto& w : all) argv.push_back(w.data());
    argv.push_back(nullptr);
    int out[2];
    must(pipe2(out, O_CLOEXEC) == 0, "pipe");
    process_ = fork();
    must(process_ >= 0, "fork");
    if (process_ == 0) {
        prctl(PR_SET_PDEATHSIG, SIGTERM);
        pin(0, cpu);
        dup2(out[1], STDOUT_FILENO);
        execvp(argv[0], argv.data());
        _exit(127);
    }
    close(out[1]);
    std::string line;
    try {
        line = readLine(out[0], kStartTime);
    } catch (...) {
        close(out[0]);
        stop();
        throw;
    }
    close(out[0]);
    std::istringstream in(line);
    std::string word;
    in >> word;
    bool ready = word == "ready";
    while (in >> word) {
        if (word.starts_with("tcp=")) port_ = std::atoi(word.c_str() + 4);
        if (word.starts_with("unix=")) socket_ = word.substr(5);
    }
    if (!ready || socket_.empty() || port_ == 0) {
        stop();
        throw std::runtime_error("sormad did not start (is this run through build/env?): \"" + line + "\"");
    }
}

void Daemon::stop() {
    if (process_ < 0) return;
    kill(process_, SIGTERM);
    int status;
    for (int waited = 0; waitpid(process_, &status, WNOHANG) == 0; waited += 2) {
        if (waited == kStopTime) kill(process_, SIGKILL);
        usleep(2000);
    }
    process_ = -1;
}

double Daemon::residentBytes() const {
    std::ifstream in("/proc/" + std::to_string(process_) + "/status");
    for (std::string line; std::getline(in, line);)
        if (line.starts_with("VmRSS:")) return std::atof(line.c_str() + 6) * 1024;
    throw std::runtime_error("no VmRSS of the daemon");
}

// ---- RawServer ----

template <class Serve> void RawServer::start(Kind kind, int cpu, Serve serve) {
    int fd[2];
    makePair(kind, fd);
    process_ = fork();
    must(process_ >= 0, "fork");
    if (process_ == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        // Nothing of the parent's: a connection that stayed open here would not end when the parent closes it.
        int mine = dup2(fd[1], 3);
        close_range(4, ~0u, 0);
        pin(0, cpu);
        serve(mine);
        _exit(0);
    }
    close(fd[1]);
    fd_ = fd[0];
}

RawServer::RawServer(Kind kind, int cpu, std::size_t requestSize, std::size_t replySize)
    : requestSize_(requestSize), replySize_(replySize), out_(requestSize), in_(std::max<std::size_t>(replySize, 64 * 1024)) {
    start(kind, cpu, [=](int fd) { serveEcho(fd, requestSize, replySize); });
}

RawServer::RawServer(Kind kind, int cpu, std::size_t doubles) : out_(8 * doubles) {
    start(kind, cpu, [=](int fd) { serveDoubles(fd, doubles); });
}

RawServer::~RawServer() {
    if (fd_ >= 0) close(fd_);
    if (process_ < 0) return;
    kill(process_, SIGKILL);
    waitpid(process_, nullptr, 0);
}

void RawServer::call() {
    if (!writeAll(fd_, out_.data(), requestSize_) || !readAll(fd_, in_.data(), replySize_))
        throw std::runtime_error("the raw server has gone");
}

void RawServer::pipeline(std::int64_t count, std::size_t window) {
    out_.resize(window * requestSize_);
    std::int64_t toSend = count, toCome = count;
    std::size_t partial = 0;
    auto send = [&](std::size_t n) {
        n = std::min<std::size_t>(n, std::size_t(toSend));
        toSend -= std::int64_t(n);
        if (n > 0 && !writeAll(fd_, out_.data(), n * requestSize_)) throw std::runtime_error("the raw server has gone");
    };
    send(window);
    while (toCome > 0) {
        ssize_t n = readSome(fd_, in_.data(), in_.size());
        if (n <= 0) throw std::runtime_error("the raw server has gone");
        partial += std::size_t(n);
        std::size_t whole = partial / replySize_;
        partial %= replySize_;
        toCome -= std::int64_t(whole);
        send(whole);
    }
}

void RawServer::echo(std::vector<double>& values) {
    swapInto(out_, values);
    if (!writeAll(fd_, out_.data(), out_.size()) || !readAll(fd_, out_.data(), out_.size()))
        throw std::runtime_error("the raw server has gone");
    swapInto(values, out_);
}

}  // namespace bench
