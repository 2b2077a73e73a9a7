#include "web/webServer.h"

#include <gnutls/gnutls.h>
#include <microhttpd.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <stdexcept>
#include <vector>

namespace sorma::web {

namespace {

constexpr std::int64_t kSecond = 1'000'000'000;
const std::string kPriorities = "SECURE128:-VERS-ALL:+VERS-TLS1.3";

std::int64_t now() {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

int descriptorOf(MHD_Connection* connection) {
    return MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD)->connect_fd;
}

MHD_Result gather(void* pairs, MHD_ValueKind, const char* name, const char* value) noexcept {
    try {
        static_cast<Pairs*>(pairs)->emplace_back(name ? name : "", value ? value : "");
        return MHD_YES;
    } catch (const std::exception&) {
        return MHD_NO;
    }
}

MHD_Response* textResponse(const std::string& body) {
    return MHD_create_response_from_buffer(body.size(), const_cast<char*>(body.data()), MHD_RESPMEM_MUST_COPY);
}

// One that libmicrohttpd has no memory for is not sent: the connection is closed.
MHD_Result refuse(MHD_Connection* connection, unsigned status, const char* why) {
    MHD_Response* response = textResponse(why);
    if (!response) return MHD_NO;
    MHD_add_response_header(response, "Content-Type", "text/plain; charset=utf-8");
    MHD_add_response_header(response, "Connection", "close");
    auto queued = MHD_queue_response(connection, status, response);
    MHD_destroy_response(response);
    return queued;
}

int listenOn(const Place& place) {
    addrinfo wanted{}, *found = nullptr;
    wanted.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV | AI_PASSIVE;
    wanted.ai_socktype = SOCK_STREAM;
    if (int wrong = ::getaddrinfo(place.host.c_str(), std::to_string(place.port).c_str(), &wanted, &found); wrong != 0)
        throw std::runtime_error("\"" + place.host + "\" is no address of this host in digits: " + ::gai_strerror(wrong));
    int fd = ::socket(found->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    int yes = 1;
    if (fd >= 0) ::setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    const bool listens = fd >= 0 && ::bind(fd, found->ai_addr, found->ai_addrlen) == 0 && ::listen(fd, 64) == 0;
    const std::string why = listens ? "" : std::strerror(errno);
    ::freeaddrinfo(found);
    if (listens) return fd;
    if (fd >= 0) ::close(fd);
    throw std::runtime_error("cannot listen on port " + std::to_string(place.port) + " of " + place.host + ": " + why);
}

int portOf(int fd) {
    sockaddr_storage address{};
    socklen_t size = sizeof address;
    ::getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size);
    return ntohs(address.ss_family == AF_INET6 ? reinterpret_cast<sockaddr_in6&>(address).sin6_port : reinterpret_cast<sockaddr_in&>(address).sin_port);
}

std::string addressOf(MHD_Connection* connection) {
    const sockaddr* address = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CLIENT_ADDRESS)->client_addr;
    char text[NI_MAXHOST] = "";
    if (address) ::getnameinfo(address, address->sa_family == AF_INET6 ? sizeof(sockaddr_in6) : sizeof(sockaddr_in), text, sizeof text, nullptr, 0, NI_NUMERICHOST);
    return text;
}

// The first one of those that it has shown.
std::string certificateOf(MHD_Connection* connection) {
    auto* info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_GNUTLS_SESSION);
    unsigned count = 0;
    const gnutls_datum_t* shown = info && info->tls_session ? gnutls_certificate_get_peers(static_cast<gnutls_session_t>(info->tls_session), &count) : nullptr;
    return count > 0 && shown ? std::string(reinterpret_cast<const char*>(shown->data), shown->size) : std::string();
}

}  // namespace

// A request and its answer.
struct Server::Exchange {
    Server* server;
    MHD_Connection* connection;
    std::int64_t number = 0;
    int fd = -1;
    Request request;
    MHD_Response* response = nullptr;           // made, and not yet taken by libmicrohttpd
    unsigned status = 0;
    std::string out;                            // of a stream: what is still to be sent
    std::size_t sent = 0;                       // of it
    std::size_t held = 0;                       // bytes of its answer
    bool told = false, streaming = false, ended = false, suspended = false, hungUp = false, tooBig = false;
};

struct Server::Calls {
    static MHD_Result request(void* self, MHD_Connection* connection, const char* path, const char* method, const char*, const char* piece,
                              size_t* size, void** place) noexcept {
        try {
            auto& server = *static_cast<Server*>(self);
            if (!*place) {
                auto* exchange = new Exchange;
                *place = exchange;
                exchange->server = &server;
                exchange->connection = connection;
                exchange->fd = descriptorOf(connection);
                exchange->request.method = method;
                exchange->request.path = path;
                return MHD_Result(server.begun(*exchange));
            }
            auto& exchange = *static_cast<Exchange*>(*place);
            if (*size == 0) return MHD_Result(server.whole(exchange));
            if (exchange.request.body.size() + *size > server.limits_.body) return MHD_NO;
            exchange.request.body.append(piece, *size);
            *size = 0;
            return MHD_YES;
        } catch (const std::exception&) {
            return MHD_NO;                      // the connection is closed
        }
    }
    static void complete(void*, MHD_Connection*, void** place, MHD_RequestTerminationCode) noexcept {
        if (auto* exchange = static_cast<Exchange*>(*place)) exchange->server->over(*exchange);
        *place = nullptr;
    }
    static void connection(void* self, MHD_Connection* connection, void**, MHD_ConnectionNotificationCode what) noexcept {
        auto& server = *static_cast<Server*>(self);
        try {
            if (what == MHD_CONNECTION_NOTIFY_STARTED) {
                server.makeRoom();
                server.connections_[descriptorOf(connection)] = {now(), false, false, false, 2.0 * server.limits_.rate, now()};
            } else {
                server.connections_.erase(descriptorOf(connection));
            }
        } catch (const std::exception&) {}      // without its entry it has no allowance
    }
    static ssize_t read(void* data, uint64_t, char* buffer, size_t most) noexcept {
        auto& exchange = *static_cast<Exchange*>(data);
        auto& server = *exchange.server;
        if (exchange.hungUp) return MHD_CONTENT_READER_END_WITH_ERROR;
        try {
            if (exchange.sent == exchange.out.size() && !exchange.ended) {
                exchange.out.clear();
                exchange.sent = 0;
                if (!server.stopping_) server.told_(What::drained, exchange.number, nullptr);
            }
            if (exchange.sent == exchange.out.size()) {
                if (exchange.ended) return MHD_CONTENT_READER_END_OF_STREAM;
                server.suspend(exchange);
                return 0;
            }
        } catch (const std::exception&) {
            return MHD_CONTENT_READER_END_WITH_ERROR;
        }
        const size_t n = std::min(most, exchange.out.size() - exchange.sent);
        std::memcpy(buffer, exchange.out.data() + exchange.sent, n);
        exchange.sent += n;
        return ssize_t(n);
    }
    static void quiet(void*, const char*, va_list) {}       // complaints about clients
};

Server::Server(const Place& place, Limits limits, Told told) : limits_(limits), told_(std::move(told)) {
    int fd = listenOn(place);
    port_ = portOf(fd);
    set_ = ::epoll_create1(EPOLL_CLOEXEC);
    auto text = [](const std::string& of) { return const_cast<char*>(of.c_str()); };
    std::vector<MHD_OptionItem> options;
    if (limits.each > 0) options.push_back({MHD_OPTION_PER_IP_CONNECTION_LIMIT, intptr_t(limits.each), nullptr});
    if (!place.keys.empty())
        options.insert(options.end(), {{MHD_OPTION_HTTPS_MEM_KEY, 0, text(place.keys)}, {MHD_OPTION_HTTPS_MEM_CERT, 0, text(place.keys)},
                                       {MHD_OPTION_HTTPS_PRIORITIES, 0, text(kPriorities)}});
    if (!place.authority.empty()) options.push_back({MHD_OPTION_HTTPS_MEM_TRUST, 0, text(place.authority)});
    options.push_back({MHD_OPTION_END, 0, nullptr});
    daemon_ = MHD_start_daemon(MHD_USE_EPOLL | MHD_ALLOW_SUSPEND_RESUME | (place.keys.empty() ? 0 : MHD_USE_TLS), 0, nullptr, nullptr, &Calls::request, this,
                               MHD_OPTION_EXTERNAL_LOGGER, &Calls::quiet, nullptr, MHD_OPTION_LISTEN_SOCKET, fd, MHD_OPTION_CONNECTION_LIMIT, limits_.connections,
                               MHD_OPTION_CONNECTION_MEMORY_LIMIT, limits_.headers, MHD_OPTION_CONNECTION_TIMEOUT, 3 * limits_.patience,
                               MHD_OPTION_NOTIFY_CONNECTION, &Calls::connection, this, MHD_OPTION_NOTIFY_COMPLETED, &Calls::complete, this,
                               MHD_OPTION_ARRAY, options.data(), MHD_OPTION_END);
    epoll_event event{};
    event.events = EPOLLIN;
    event.data.u64 = 0;
    if (!daemon_ || set_ < 0 || ::epoll_ctl(set_, EPOLL_CTL_ADD, MHD_get_daemon_info(daemon_, MHD_DAEMON_INFO_EPOLL_FD)->epoll_fd, &event) != 0) {
        if (daemon_) MHD_stop_daemon(daemon_);
        else ::close(fd);
        if (set_ >= 0) ::close(set_);
        throw std::runtime_error("libmicrohttpd cannot serve port " + std::to_string(port_) + (place.keys.empty() ? "" : ": it has no TLS, or does not take the keys"));
    }
}

Server::~Server() {
    stopping_ = true;
    for (auto& [number, exchange] : exchanges_) {
        exchange->ended = exchange->hungUp = true;
        if (exchange->suspended) MHD_resume_connection(exchange->connection);
    }
    MHD_stop_daemon(daemon_);
    ::close(set_);
}

// ---- a request ----

// Its headers are there. libmicrohttpd takes an answer now, or when the body is whole, and not between.
int Server::begun(Exchange& exchange) {
    auto& connection = connections_[exchange.fd];
    const std::int64_t time = now();
    connection.allowance = std::min(2.0 * limits_.rate, connection.allowance + double(time - connection.counted) / double(kSecond) * limits_.rate);
    connection.counted = time;
    if (connection.allowance < 1) return refuse(exchange.connection, MHD_HTTP_TOO_MANY_REQUESTS, "too many requests: wait a second, and send fewer\n");
    connection.allowance -= 1;
    const char* length = MHD_lookup_connection_value(exchange.connection, MHD_HEADER_KIND, "Content-Length");
    if (length && (std::strlen(length) > 18 || std::strtoll(length, nullptr, 10) > std::int64_t(limits_.body)))
        return refuse(exchange.connection, MHD_HTTP_CONTENT_TOO_LARGE, "the body is too large\n");
    return MHD_YES;
}

// Called when the body is there; and again after a resume.
int Server::whole(Exchange& exchange) {
    if (exchange.hungUp) return MHD_NO;
    if (!exchange.told) {
        exchange.told = true;
        connections_[exchange.fd].busy = connections_[exchange.fd].working = true;
        MHD_get_connection_values(exchange.connection, MHD_GET_ARGUMENT_KIND, &gather, &exchange.request.query);
        MHD_get_connection_values(exchange.connection, MHD_HEADER_KIND, &gather, &exchange.request.headers);
        for (auto& header : exchange.request.headers)
            for (char& c : header.first)
                if (c >= 'A' && c <= 'Z') c = char(c + 32);
        exchange.request.from = addressOf(exchange.connection);
        exchange.request.certificate = certificateOf(exchange.connection);
        exchange.number = ++last_;
        exchanges_[exchange.number] = &exchange;
        told_(What::request, exchange.number, &exchange.request);
        exchange.request = {};
    }
    if (!exchange.response) return suspend(exchange), MHD_YES;
    auto queued = MHD_queue_response(exchange.connection, exchange.status, exchange.response);
    MHD_destroy_response(exchange.response);
    exchange.response = nullptr;
    if (!exchange.streaming) {
        exchanges_.erase(exchange.number);
        connections_[exchange.fd].working = false;
    }
    return queued;
}

// Nobody reads a connection that is suspended. This set sees when its client hangs up.
void Server::suspend(Exchange& exchange) {
    epoll_event event{};
    event.events = EPOLLRDHUP;
    event.data.u64 = std::uint64_t(exchange.number);
    if (::epoll_ctl(set_, EPOLL_CTL_ADD, exchange.fd, &event) != 0) throw std::runtime_error("no memory to watch a connection");
    exchange.suspended = true;
    MHD_suspend_connection(exchange.connection);
}

void Server::resume(Exchange& exchange) {
    if (!exchange.suspended) return;
    exchange.suspended = false;
    resumed_ = true;
    ::epoll_ctl(set_, EPOLL_CTL_DEL, exchange.fd, nullptr);
    MHD_resume_connection(exchange.connection);
}

void Server::over(Exchange& exchange) {
    if (exchange.response) MHD_destroy_response(exchange.response);
    held_ -= exchange.held;
    if (auto at = connections_.find(exchange.fd); at != connections_.end()) {
        at->second.busy = at->second.working = false;
        at->second.since = now();
    }
    const bool known = exchanges_.erase(exchange.number) > 0, early = known && !exchange.ended;
    const std::int64_t number = exchange.number;
    delete &exchange;
    if (early && !stopping_) told_(What::ended, number, nullptr);
}

// ---- answers ----

Server::Exchange* Server::find(std::int64_t number) const {
    auto at = exchanges_.find(number);
    return at == exchanges_.end() || at->second->hungUp ? nullptr : at->second;
}

void Server::give(Exchange& exchange, MHD_Response* response, unsigned status, const Pairs& headers) {
    if (!response) throw std::runtime_error("no memory for an answer");
    for (auto& [name, value] : headers) MHD_add_response_header(response, name.c_str(), value.c_str());
    exchange.response = response;
    exchange.status = status;
    resume(exchange);
}

bool Server::answer(std::int64_t number, unsigned status, const Pairs& headers, const std::string& body) {
    auto* exchange = find(number);
    if (!exchange || exchange->status) return false;
    static const std::string kTooMuch = "too much waits to be read: try later\n";
    const bool room = held_ + body.size() <= limits_.held;
    exchange->held = room ? body.size() : 0;
    held_ += exchange->held;
    if (room) give(*exchange, textResponse(body), status, headers);
    else give(*exchange, textResponse(kTooMuch), MHD_HTTP_SERVICE_UNAVAILABLE, {{"Content-Type", "text/plain; charset=utf-8"}});
    return true;
}

bool Server::stream(std::int64_t number, unsigned status, const Pairs& headers) {
    auto* exchange = find(number);
    if (!exchange || exchange->status) return false;
    exchange->streaming = true;
    give(*exchange, MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, 16384, &Calls::read, exchange, nullptr), status, headers);
    return true;
}

bool Server::write(std::int64_t number, const std::string& bytes) {
    auto* exchange = find(number);
    if (!exchange || !exchange->streaming || exchange->ended) return false;
    exchange->out += bytes;
    if (!exchange->response) resume(*exchange);
    return true;
}

bool Server::end(std::int64_t number) {
    auto* exchange = find(number);
    if (!exchange || !exchange->streaming) return false;
    exchange->ended = true;
    if (!exchange->response) resume(*exchange);
    return true;
}

std::size_t Server::waiting(std::int64_t number) const {
    auto* exchange = find(number);
    return exchange ? exchange->out.size() - exchange->sent : 0;
}

// ---- the loop ----

int Server::turn() {
    epoll_event events[64];
    const int n = ::epoll_wait(set_, events, 64, 0);
    for (int k = 0; k < n; ++k) {
        auto* exchange = events[k].data.u64 ? find(std::int64_t(events[k].data.u64)) : nullptr;
        if (!exchange) continue;
        exchange->hungUp = true;
        resume(*exchange);
    }
    // At its limit libmicrohttpd stops listening. It listens again when it runs after the end of a connection.
    for (std::size_t before = SIZE_MAX; connections_.size() < before || resumed_;) {
        before = connections_.size();
        resumed_ = false;
        MHD_run(daemon_);
    }
    look();
    MHD_UNSIGNED_LONG_LONG wait = 0;
    const bool waits = MHD_get_timeout(daemon_, &wait) == MHD_YES;
    if (connections_.empty()) return waits ? int(std::min<MHD_UNSIGNED_LONG_LONG>(wait, 1000)) : -1;
    return waits ? int(std::min<MHD_UNSIGNED_LONG_LONG>(wait, 1000)) : 1000;
}

// Strangers who only keep connections would else keep everybody out, until look() ends them. A stream, or a request under way, is not touched.
void Server::makeRoom() {
    if (connections_.size() < limits_.connections - limits_.connections / 4) return;
    auto oldest = connections_.end();
    for (auto at = connections_.begin(); at != connections_.end(); ++at)
        if (!at->second.working && !at->second.ended && (oldest == connections_.end() || at->second.since < oldest->second.since)) oldest = at;
    if (oldest == connections_.end()) return;
    oldest->second.ended = true;
    ::shutdown(oldest->first, SHUT_RDWR);
}

// Once a second: end those that do not send a whole request, however slowly they send it.
void Server::look() {
    const std::int64_t time = now();
    if (time - looked_ < kSecond) return;
    looked_ = time;
    for (auto& [fd, connection] : connections_)
        if (!connection.busy && time - connection.since > limits_.patience * kSecond) ::shutdown(fd, SHUT_RDWR);
}

}  // namespace sorma::web
