// process.h -- the other processes of a measurement: daemons, and the servers of the floors.
//
// A process that is started here ends with its object, and with the benchmark itself should that be killed.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>
#include <vector>

namespace bench {

// A folder of our own, which is the runtime folder (SORMA_RUNTIME_DIR) of all that is started meanwhile. Its folder of keys
// (SORMA_KEYS) is empty: this user's own would encrypt rows that are in clear.
class Folder {
public:
    Folder();
    ~Folder();                          // removes it with all that is in it
    Folder(const Folder&) = delete;
    Folder& operator=(const Folder&) = delete;

    std::string path(const std::string& name) const { return path_ + "/" + name; }
    // A file in it with this text; returns its path.
    std::string file(const std::string& name, const std::string& text) const;

private:
    std::string path_;
};

// A daemon as users start it: sormad -name NAME -port 0 ...
class Daemon {
public:
    Daemon(const std::string& name, int cpu, const std::vector<std::string>& words = {});
    ~Daemon() { stop(); }               // SIGTERM, and waits
    Daemon(const Daemon&) = delete;
    Daemon& operator=(const Daemon&) = delete;

    const std::string& name() const { return name_; }
    std::string unixAddress() const { return socket_; }                             // what stands after @
    std::string tcpAddress() const { return "127.0.0.1:" + std::to_string(port_); }
    pid_t process() const { return process_; }
    double residentBytes() const;       // VmRSS

private:
    void stop();

    std::string name_, socket_;
    int port_ = 0;
    pid_t process_ = -1;
};

enum class Kind { unixSocket, tcp };

// A connected pair of stream sockets with a forked server at the other end.
class RawServer {
public:
    // Answers each request of so many bytes with so many bytes, as many at a time as have come.
    RawServer(Kind kind, int cpu, std::size_t requestSize, std::size_t replySize);
    // Takes so many doubles in network byte order, and sends them back the same way.
    RawServer(Kind kind, int cpu, std::size_t doubles);
    ~RawServer();
    RawServer(const RawServer&) = delete;
    RawServer& operator=(const RawServer&) = delete;

    pid_t process() const { return process_; }

    // One request and its reply. The bytes mean nothing.
    void call();
    // So many in flight: write a window, and for all replies that come as many new requests, until count are done.
    void pipeline(std::int64_t count, std::size_t window);
    // Numbers there and back, in place.
    void echo(std::vector<double>& values);

private:
    template <class Serve> void start(Kind kind, int cpu, Serve serve);

    int fd_ = -1;
    pid_t process_ = -1;
    std::size_t requestSize_ = 0, replySize_ = 0;
    std::vector<char> out_, in_;
};

}  // namespace bench
