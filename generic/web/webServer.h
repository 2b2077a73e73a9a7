// webServer.h -- an HTTP server for programs in Tcl: GNU libmicrohttpd, without a thread of its own. Nothing of HTTP is read here.
//
// Its owner's event loop watches descriptor() and calls turn(). A request is told once its body is whole. It is answered then or later;
// an answer that goes on and on (a stream) is written piece by piece, when the client has taken what came before.
//
// Limits: connections, bytes of headers, body and answers, requests per second on one connection, seconds for a request to become whole. The
// server itself refuses a request beyond them (413, 429), or closes the connection; its owner hears nothing of it. When three quarters of
// the connections are taken, each new one ends the one that has waited longest for a whole request.
//
// Threads: that of the loop. The callback may answer, write and end; it may not destroy the server.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

struct MHD_Connection;
struct MHD_Daemon;
struct MHD_Response;

namespace sorma::web {

using Pairs = std::vector<std::pair<std::string, std::string>>;

struct Place {
    std::string host = "127.0.0.1";         // an address of this host, as digits
    int port = 0;                           // 0 picks a free one
    std::string keys, authority;            // with TLS 1.3: a private key with its certificate, and who signs those of clients (PEM). Empty: in clear
};

struct Limits {
    unsigned connections = 64;
    unsigned each = 0;                      // of them, from one address; 0: all
    std::size_t headers = 16384;            // bytes of a request's line and headers
    std::size_t body = 1 << 20;             // bytes
    std::size_t held = 256 << 20;           // bytes of answers that clients have not taken; another one becomes 503
    unsigned rate = 100;                    // requests per second on a connection; twice as many at once
    unsigned patience = 10;                 // [s] for a request to become whole, and between two of them
};

// A request of a client. All of it is bytes of a stranger.
struct Request {
    std::string method, path, body;         // path: with %XX already read
    std::string from;                       // its address
    std::string certificate;                // with TLS: what the client has shown, and proved to have the key of (DER). Nobody has judged it. Empty: none
    Pairs query, headers;                   // names of headers in lower case
};

class Server {
public:
    enum class What { request, drained, ended };
    // request: answer it, by its number.   drained: the client has taken all of the stream.   ended: the client has gone before the
    // answer was complete; the number is not known any more.
    using Told = std::function<void(What what, std::int64_t number, const Request* request)>;

    // Fails with std::runtime_error when the port is taken, or the keys cannot be used.
    Server(const Place& place, Limits limits, Told told);
    ~Server();
    Server(const Server&) = delete;
    Server& operator=(const Server&) = delete;

    int port() const { return port_; }
    int descriptor() const { return set_; }     // readable: call turn()
    int turn();                                 // work that is due. Returns [ms] until it wants to be called again; -1: when readable

    // Each returns false when the number is not known any more. Call turn() afterwards, unless this is within one.
    bool answer(std::int64_t number, unsigned status, const Pairs& headers, const std::string& body);
    bool stream(std::int64_t number, unsigned status, const Pairs& headers);    // from now on write() and end()
    bool write(std::int64_t number, const std::string& bytes);
    bool end(std::int64_t number);
    std::size_t waiting(std::int64_t number) const;     // bytes of a stream that the client has not taken

private:
    struct Exchange;
    struct Calls;
    struct Connection {                         // by descriptor
        std::int64_t since = 0;                 // [ns] when it began to wait for a request
        bool busy = false;                      // a request is under way, or its answer
        bool working = false;                   // its owner works at it, or writes a stream
        bool ended = false;                     // by makeRoom(), and libmicrohttpd has not seen it yet
        double allowance = 0;                   // requests that it may still send
        std::int64_t counted = 0;               // [ns] when that was computed
    };
    Exchange* find(std::int64_t number) const;
    int begun(Exchange& exchange);
    int whole(Exchange& exchange);
    void give(Exchange& exchange, MHD_Response* response, unsigned status, const Pairs& headers);
    void suspend(Exchange& exchange);
    void resume(Exchange& exchange);
    void over(Exchange& exchange);
    void look();
    void makeRoom();

    const Limits limits_;
    const Told told_;
    int port_ = 0, set_ = -1;                   // set_: libmicrohttpd's own set, and the connections that it has suspended
    MHD_Daemon* daemon_ = nullptr;
    std::int64_t last_ = 0;
    std::size_t held_ = 0;                      // bytes, see Limits
    std::map<std::int64_t, Exchange*> exchanges_;
    std::map<int, Connection> connections_;
    std::int64_t looked_ = 0;
    bool stopping_ = false, resumed_ = false;
};

}  // namespace sorma::web
