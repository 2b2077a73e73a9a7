// http.h -- requests to a web server by libcurl, in the loop of the SORM. The loop watches an epoll set in which libcurl's sockets are.
//
// No proxy is used and no redirection followed. Only http and https are spoken.
//
// Threads:   the SORM's.
// Callbacks: run in the loop's turn, or in turn(). They may begin and end requests.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "bus/descriptor.h"
#include "bus/loop.h"

namespace etcd {

// Files in PEM; empty: none, or what the system has.
struct Keys {
    std::string authority, certificate, key;
};

class Http {
public:
    struct Answer {
        long status = 0;                    // 0: none has come, and why says why
        std::string body, why;
    };
    using Answered = std::function<void(Answer answer)>;
    using Piece = std::function<void(std::string_view line)>;
    using Number = std::uint64_t;

    Http(sorma::Loop& loop, Keys keys);
    ~Http();
    Http(const Http&) = delete;
    Http& operator=(const Http&) = delete;

    // POST a body of JSON. answered: called once, unless it is ended before.   token: for the header Authorization; may be empty.
    // milliseconds: for all of it; 0: no limit. piece: gets each line of a reply that goes on; then the answer has no body.
    Number post(const std::string& url, const std::string& token, std::string body, long milliseconds, Answered answered, Piece piece = nullptr);
    void end(Number number);                // forget it; 0: does nothing
    // Do what can be done now.
    void turn() { act(); }
    // Wait until something can be done, or until a time on the monotonic clock [ns], and do it.
    void wait(std::int64_t until);

private:
    struct Calls;
    struct Request;
    void act();
    void tellPieces();
    void setTimer();

    sorma::Loop& loop_;
    const Keys keys_;
    sorma::Descriptor epoll_;
    void* multi_ = nullptr;
    std::int64_t due_ = 0;                  // [ns] when libcurl wants to act; 0: never
    sorma::Timer timer_;
    std::map<Number, std::unique_ptr<Request>> requests_;
    Number last_ = 0;
    bool acting_ = false;
};

}  // namespace etcd
