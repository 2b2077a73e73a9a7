#include "http.h"

#include <curl/curl.h>
#include <poll.h>
#include <sys/epoll.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "bus/atEnd.h"
#include "bus/deadline.h"

namespace etcd {

namespace {

constexpr std::size_t kMost = 64 << 20;         // [bytes] of a reply, or of a line of it
constexpr long kConnect = 1500;                 // [ms] for a connection

}  // namespace

struct Http::Request {
    CURL* easy = nullptr;
    curl_slist* headers = nullptr;
    std::string body, in;
    Answered answered;
    Piece piece;
    char why[CURL_ERROR_SIZE] = {};

    ~Request() {
        curl_easy_cleanup(easy);
        curl_slist_free_all(headers);
    }
};

struct Http::Calls {
    static int socket(CURL*, curl_socket_t fd, int what, void* data, void* known) {
        auto& self = *static_cast<Http*>(data);
        epoll_event e{};
        e.events = (what & CURL_POLL_IN ? EPOLLIN : 0u) | (what & CURL_POLL_OUT ? EPOLLOUT : 0u);
        e.data.fd = fd;
        if (what == CURL_POLL_REMOVE) epoll_ctl(self.epoll_.get(), EPOLL_CTL_DEL, fd, nullptr);
        else if (epoll_ctl(self.epoll_.get(), known ? EPOLL_CTL_MOD : EPOLL_CTL_ADD, fd, &e) < 0) epoll_ctl(self.epoll_.get(), EPOLL_CTL_ADD, fd, &e);
        curl_multi_assign(self.multi_, fd, what == CURL_POLL_REMOVE ? nullptr : data);
        return 0;
    }

    static int timer(CURLM*, long milliseconds, void* data) {
        auto& self = *static_cast<Http*>(data);
        self.due_ = milliseconds < 0 ? 0 : sorma::monotonicNow() + std::max(milliseconds, 0L) * 1'000'000;
        self.setTimer();
        return 0;
    }

    // libcurl can not be called from here: so nobody is told yet.
    static std::size_t write(char* bytes, std::size_t, std::size_t size, void* data) {
        auto& request = *static_cast<Request*>(data);
        request.in.append(bytes, size);
        return request.in.size() > kMost ? 0 : size;
    }
};

Http::Http(sorma::Loop& loop, Keys keys) : loop_(loop), keys_(std::move(keys)), epoll_(epoll_create1(EPOLL_CLOEXEC)) {
    curl_global_init(CURL_GLOBAL_DEFAULT);
    multi_ = curl_multi_init();
    curl_multi_setopt(multi_, CURLMOPT_SOCKETFUNCTION, Calls::socket);
    curl_multi_setopt(multi_, CURLMOPT_SOCKETDATA, this);
    curl_multi_setopt(multi_, CURLMOPT_TIMERFUNCTION, Calls::timer);
    curl_multi_setopt(multi_, CURLMOPT_TIMERDATA, this);
    loop_.watch(epoll_.get(), [this] { act(); });
}

Http::~Http() {
    loop_.unwatch(epoll_.get());
    for (auto& [number, request] : requests_) curl_multi_remove_handle(multi_, request->easy);
    requests_.clear();
    curl_multi_cleanup(multi_);
}

Http::Number Http::post(const std::string& url, const std::string& token, std::string body, long milliseconds, Answered answered, Piece piece) {
    auto request = std::make_unique<Request>();
    request->body = std::move(body);
    request->answered = std::move(answered);
    request->piece = std::move(piece);
    request->headers = curl_slist_append(nullptr, "Content-Type: application/json");
    request->headers = curl_slist_append(request->headers, "Expect:");
    if (!token.empty()) request->headers = curl_slist_append(request->headers, ("Authorization: " + token).c_str());
    CURL* easy = request->easy = curl_easy_init();
    curl_easy_setopt(easy, CURLOPT_URL, url.c_str());
    curl_easy_setopt(easy, CURLOPT_POSTFIELDSIZE, long(request->body.size()));
    curl_easy_setopt(easy, CURLOPT_POSTFIELDS, request->body.c_str());
    curl_easy_setopt(easy, CURLOPT_HTTPHEADER, request->headers);
    curl_easy_setopt(easy, CURLOPT_WRITEFUNCTION, Calls::write);
    curl_easy_setopt(easy, CURLOPT_WRITEDATA, request.get());
    curl_easy_setopt(easy, CURLOPT_ERRORBUFFER, request->why);
    curl_easy_setopt(easy, CURLOPT_CONNECTTIMEOUT_MS, milliseconds > 0 ? std::min(milliseconds, kConnect) : kConnect);
    curl_easy_setopt(easy, CURLOPT_TIMEOUT_MS, milliseconds);
    curl_easy_setopt(easy, CURLOPT_NOSIGNAL, 1L);
    curl_easy_setopt(easy, CURLOPT_PROXY, "");
    curl_easy_setopt(easy, CURLOPT_PROTOCOLS_STR, "http,https");
    curl_easy_setopt(easy, CURLOPT_TCP_KEEPALIVE, 1L);
    curl_easy_setopt(easy, CURLOPT_TCP_NODELAY, 1L);
    if (!keys_.authority.empty()) curl_easy_setopt(easy, CURLOPT_CAINFO, keys_.authority.c_str());
    if (!keys_.certificate.empty()) curl_easy_setopt(easy, CURLOPT_SSLCERT, keys_.certificate.c_str());
    if (!keys_.key.empty()) curl_easy_setopt(easy, CURLOPT_SSLKEY, keys_.key.c_str());
    const Number number = ++last_;
    curl_easy_setopt(easy, CURLOPT_PRIVATE, reinterpret_cast<char*>(number));
    curl_multi_add_handle(multi_, easy);
    requests_.emplace(number, std::move(request));
    return number;
}

void Http::end(Number number) {
    const auto found = requests_.find(number);
    if (found == requests_.end()) return;
    curl_multi_remove_handle(multi_, found->second->easy);
    requests_.erase(found);
}

void Http::act() {
    if (std::exchange(acting_, true)) return;
    {
        const sorma::AtEnd leave([this] { acting_ = false; });
        epoll_event events[16];
        int running = 0;
        const int n = epoll_wait(epoll_.get(), events, 16, 0);
        for (int k = 0; k < n; ++k) {
            const int what = (events[k].events & EPOLLIN ? CURL_CSELECT_IN : 0) | (events[k].events & EPOLLOUT ? CURL_CSELECT_OUT : 0) |
                             (events[k].events & (EPOLLERR | EPOLLHUP) ? CURL_CSELECT_ERR : 0);
            curl_multi_socket_action(multi_, events[k].data.fd, what, &running);
        }
        if (due_ != 0 && sorma::monotonicNow() >= due_) {
            due_ = 0;
            curl_multi_socket_action(multi_, CURL_SOCKET_TIMEOUT, 0, &running);
        }
    }
    tellPieces();
    int left = 0;
    std::vector<std::pair<Answered, Answer>> done;
    while (CURLMsg* m = curl_multi_info_read(multi_, &left)) {
        if (m->msg != CURLMSG_DONE) continue;
        const CURLcode result = m->data.result;
        char* mark = nullptr;
        curl_easy_getinfo(m->easy_handle, CURLINFO_PRIVATE, &mark);
        const auto found = requests_.find(reinterpret_cast<Number>(mark));
        auto request = std::move(found->second);
        requests_.erase(found);
        Answer answer;
        if (result == CURLE_OK) curl_easy_getinfo(request->easy, CURLINFO_RESPONSE_CODE, &answer.status), answer.body = std::move(request->in);
        else answer.why = request->why[0] ? request->why : curl_easy_strerror(result);
        curl_multi_remove_handle(multi_, request->easy);
        if (request->answered) done.emplace_back(std::move(request->answered), std::move(answer));
    }
    for (auto& [answered, answer] : done) answered(std::move(answer));
}

void Http::tellPieces() {
    std::vector<std::pair<Number, std::string>> lines;
    for (auto& [number, request] : requests_) {
        if (!request->piece) continue;
        std::size_t at = 0;
        for (std::size_t end; (end = request->in.find('\n', at)) != std::string::npos; at = end + 1) lines.emplace_back(number, request->in.substr(at, end - at));
        request->in.erase(0, at);
    }
    for (auto& [number, line] : lines)
        if (const auto found = requests_.find(number); found != requests_.end()) Piece(found->second->piece)(line);
}

void Http::setTimer() {
    timer_.cancel();
    if (due_ != 0) timer_ = loop_.after(due_, [this] { act(); });
}

void Http::wait(std::int64_t until) {
    const std::int64_t end = due_ != 0 ? std::min(due_, until) : until;
    pollfd p{epoll_.get(), POLLIN, 0};
    poll(&p, 1, int(std::clamp<std::int64_t>((end - sorma::monotonicNow() + 999'999) / 1'000'000, 0, 1000)));
    act();
}

}  // namespace etcd
