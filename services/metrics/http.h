// http.h -- a small web server that only answers GET. It is GNU libmicrohttpd, without a thread of its own: the loop of the
// SORM watches its epoll descriptor. A parser of HTTP is not written again here, since it reads what strangers send.
//
// Limits: 16 connections, 8 kB and 5 s for each, one request on each.
// Threads: the SORM's. The callback runs in the loop's turn.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include "bus/loop.h"
#include "bus/principal.h"

struct MHD_Daemon;

namespace metrics {

struct Answer {
    unsigned code;              // as HTTP has it
    std::string text;
};

class Http {
public:
    // Listens on 127.0.0.1. port: 0 picks a free one. Fails with COMM REFUSED when it is taken.
    // answer: gets the path, and who asks.
    using Asked = std::function<Answer(const std::string& path, const sorma::PrincipalPointer& author)>;
    Http(sorma::Loop& loop, int port, Asked answer);
    ~Http();
    Http(const Http&) = delete;
    Http& operator=(const Http&) = delete;
    int port() const { return port_; }

private:
    struct Calls;               // what libmicrohttpd calls
    void turn();
    void endOld();

    sorma::Loop& loop_;
    const Asked answer_;
    int port_ = 0, epoll_ = -1;
    MHD_Daemon* daemon_ = nullptr;
    std::map<int, std::int64_t> since_;         // connections, by descriptor: when they came [ns]
    sorma::Timer timer_;
};

}  // namespace metrics
