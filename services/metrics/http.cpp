#include "http.h"

#include <fcntl.h>
#include <microhttpd.h>
#include <sys/socket.h>

#include <algorithm>
#include <stdexcept>

#include <sorma.h>

#include "comm/transport.h"

namespace metrics {

namespace {

constexpr unsigned kConnections = 16;
constexpr std::int64_t kPatience = 5'000'000'000, kLook = 1'000'000'000;        // [ns]

int descriptorOf(MHD_Connection* connection) {
    return MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD)->connect_fd;
}

// Null is the owner, which nobody is by TCP: who cannot be named is anyone.
sorma::PrincipalPointer whoAsks(MHD_Connection* connection) {
    sorma::Descriptor copy(fcntl(descriptorOf(connection), F_DUPFD_CLOEXEC, 0));
    if (!copy) return sorma::Principal::nobody();
    const sorma::Line line(std::move(copy), sorma::tcpTransport);
    auto who = sorma::tcpTransport.identify(line).principal;
    return who ? who : sorma::Principal::nobody();
}

// A page of another site in a browser of this host may reach the port by a name of its own. The browser tells that name.
bool isOurs(const char* host) {
    if (!host) return true;
    std::string name(host);
    if (auto colon = name.rfind(':'); colon != std::string::npos) name.erase(colon);
    return name == "127.0.0.1" || name == "localhost";
}

MHD_Result send(MHD_Connection* connection, const Answer& answer) {
    auto* text = const_cast<char*>(answer.text.data());
    MHD_Response* response = MHD_create_response_from_buffer(answer.text.size(), text, MHD_RESPMEM_MUST_COPY);
    if (!response) return MHD_NO;
    MHD_add_response_header(response, "Content-Type", answer.code == 200 ? "text/plain; version=0.0.4; charset=utf-8" : "text/plain; charset=utf-8");
    MHD_add_response_header(response, "Connection", "close");
    if (answer.code == MHD_HTTP_METHOD_NOT_ALLOWED) MHD_add_response_header(response, "Allow", "GET");
    auto sent = MHD_queue_response(connection, answer.code, response);
    MHD_destroy_response(response);
    return sent;
}

}  // namespace

struct Http::Calls {
    static MHD_Result request(void* self, MHD_Connection* connection, const char* path, const char* method, const char*, const char*, size_t*, void**) noexcept {
        try {
            if (std::string_view(method) != "GET") return send(connection, {MHD_HTTP_METHOD_NOT_ALLOWED, "only GET is answered\n"});
            const char* host = MHD_lookup_connection_value(connection, MHD_HEADER_KIND, "Host");
            if (!isOurs(host)) return send(connection, {MHD_HTTP_FORBIDDEN, "ask for 127.0.0.1 or localhost: this is not the host that the request names\n"});
            return send(connection, static_cast<Http*>(self)->answer_(path, whoAsks(connection)));
        } catch (const std::exception&) {
            return MHD_NO;              // the connection is closed
        }
    }
    static void connection(void* self, MHD_Connection* connection, void**, MHD_ConnectionNotificationCode what) {
        auto& since = static_cast<Http*>(self)->since_;
        if (what == MHD_CONNECTION_NOTIFY_STARTED) since[descriptorOf(connection)] = sorma::monotonicNow();
        else since.erase(descriptorOf(connection));
    }
    static void quiet(void*, const char*, va_list) {}       // complaints about clients
};

Http::Http(sorma::Loop& loop, int port, Asked answer) : loop_(loop), answer_(std::move(answer)) {
    sorma::ListeningSocket socket = sorma::tcpTransport.listen("127.0.0.1", port, false);
    port_ = socket.port;
    daemon_ = MHD_start_daemon(MHD_USE_EPOLL, 0, nullptr, nullptr, &Calls::request, this, MHD_OPTION_EXTERNAL_LOGGER, &Calls::quiet, nullptr,
                               MHD_OPTION_LISTEN_SOCKET, socket.fd.get(), MHD_OPTION_CONNECTION_LIMIT, kConnections,
                               MHD_OPTION_CONNECTION_MEMORY_LIMIT, size_t{8192}, MHD_OPTION_NOTIFY_CONNECTION, &Calls::connection, this,
                               MHD_OPTION_END);
    if (!daemon_) throw std::runtime_error("libmicrohttpd cannot listen on port " + std::to_string(port_));
    (void)socket.fd.release();          // it is the daemon's now
    epoll_ = MHD_get_daemon_info(daemon_, MHD_DAEMON_INFO_EPOLL_FD)->epoll_fd;
    loop_.watch(epoll_, [this] { turn(); });
}

Http::~Http() {
    loop_.unwatch(epoll_);
    MHD_stop_daemon(daemon_);
}

// At its limit libmicrohttpd stops listening. It listens again when it runs after the end of a connection.
void Http::turn() {
    for (std::size_t before = SIZE_MAX; since_.size() < before;) {
        before = since_.size();
        MHD_run(daemon_);
    }
    MHD_UNSIGNED_LONG_LONG wait = 0;
    const bool more = MHD_get_timeout(daemon_, &wait) == MHD_YES && wait == 0;
    if (!more && since_.empty()) return timer_.cancel();
    timer_ = loop_.after(sorma::monotonicNow() + (more ? 0 : kLook), [this] { endOld(), turn(); });
}

// One that has not got its answer in time, or does not read it.
void Http::endOld() {
    const std::int64_t now = sorma::monotonicNow();
    for (auto& [fd, since] : since_)
        if (now - since > kPatience) ::shutdown(fd, SHUT_RDWR);
}

}  // namespace metrics
