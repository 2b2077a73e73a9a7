#include "comm/link.h"

#include <sys/epoll.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <utility>

#include "bus/atEnd.h"
#include "bus/call.h"
#include "bus/statistics.h"
#include "comm/clock.h"
#include "comm/errors.h"
#include "comm/random.h"
#include "comm/tls.h"

namespace sorma {

namespace {

constexpr std::size_t kMostGrowth = 8 << 20;
constexpr std::size_t kKeepBuffer = 4 << 20;            // a longer message's memory is given back
constexpr std::int64_t kOpenTime = 5'000'000'000;       // [ns] for an address to be connected and the daemon to greet
constexpr std::int64_t kFirstPause = 2'000'000, kLastPause = 100'000'000;      // [ns] between attempts; each is twice the one before
constexpr std::int64_t kAbsence = 5'000'000'000;        // [ns] nothing listens there: what was sent gets no reply
constexpr std::int64_t kLook = 20'000'000;              // [ns] a request that waits for another looks whether it was cancelled

const Prototype kNotGreeted{Severity::error, "COMM TIMEOUT", 1, "{}: {} is connected, but does not answer; never sent"};

const Prototype kClear{Severity::error, "TLS MISSING", 1,
    "{}: {} speaks TLS alone, and this line is in clear; there: sorma-keys give NAME; here: sorma-keys take FILE, and no -tls no after its address"};

std::string printable(const char* bytes, std::size_t size) {
    std::string out;
    for (char c : std::string_view(bytes, std::min<std::size_t>(size, 40))) out += c >= 0x20 && c < 0x7f ? c : '.';
    return out;
}

// Another attempt would be of no use.
bool isTls(const Error& e) { return e.trail.cause() && e.trail.cause()->symbol.starts_with("TLS "); }

int milliseconds(std::int64_t nanoseconds, int most) { return int(std::min<std::int64_t>(nanoseconds / 1'000'000 + 1, most)); }

}  // namespace

Link::Link(User& user, std::string who, const Settings& settings, std::shared_ptr<Reactor> reactor)
    : user_(user), who_(std::move(who)), settings_(settings), reactor_(std::move(reactor)), client_(randomNumber()) {}

Link::~Link() { unwatch(); }

std::string Link::age() const { return durationText(double(monotonicNow() - since_)); }

// ---- what moves it ----

void Link::begin() {
    if (state_ == State::lost && !timer_) start();
}

bool Link::step(Deadline deadline, std::int64_t left) {
    bool went = true;
    if (live()) {
        if (!queue_.empty()) drain();
        if (live() && queue_.empty()) went = left > 0 && (receive(CallContext::current() ? std::min(left, kLook) : left) || !deadline.passed());
        else if (live()) went = waitToWrite(deadline);
    } else if (state_ == State::lost) {
        left = std::min(left, retryAt_ - monotonicNow());
        timespec t{left / 1'000'000'000, left % 1'000'000'000};
        if (left > 0) nanosleep(&t, nullptr);
        if (deadline.passed()) return false;
        timer_.cancel();
        start();
    } else {
        left = std::min(left, until_.left());
        if (CallContext::current()) left = std::min(left, kLook);
        if (line_.wait(state_ == State::connecting ? EPOLLOUT : EPOLLIN, milliseconds(left, 60'000))) advance();
        else if (until_.passed()) disconnect(), retryAt_ = 0;      // perhaps another attempt gets an answer
        else went = !deadline.passed();
    }
    if (watched_) watch();
    user_.turned(true);
    return went;
}

void Link::ready(std::uint32_t events) {
    auto keep = user_.keep();
    const AtEnd leave([this, outer = std::exchange(inEvents_, true)] { inEvents_ = outer; });
    if (live()) {
        events = line_.means(events);
        if (events & EPOLLOUT) drain();
        if (live() && (events & (EPOLLIN | EPOLLHUP | EPOLLERR))) receive(0);
    } else if (state_ != State::lost) {
        advance();
    }
    user_.turned(false);
    watch();
}

void Link::watch() {
    if (!line_.open() || (live() && !watched_ && !user_.wanted() && queue_.empty())) return;    // blocking calls need nobody to watch
    const bool reads = state_ != State::connecting;
    const std::uint32_t events = line_.wants((reads ? EPOLLIN : 0u) | (reads && queue_.empty() ? 0u : std::uint32_t{EPOLLOUT}));
    if (line_.pending()) reactor_->again(this);
    if (!watched_) reactor_->add(line_.descriptor(), events, this);
    else if (events != interest_) reactor_->change(line_.descriptor(), events, this);
    watched_ = true;
    interest_ = events;
    if (line_.row().brought) reactor_->stay(this);
}

void Link::unwatch() {
    if (std::exchange(watched_, false)) reactor_->remove(line_.descriptor(), this);
}

// ---- lost > connecting > opening > greeting > joining > live ----

void Link::start() {
    auto keep = user_.keep();
    failure_.reset();
    hungUp_ = false;
    try {
        const Address address = user_.locate();
        program_ = programOf(address) != 0 ? wire::kProgramBase + programOf(address) : wire::kProgram;
        address_ = describe(address);
        wait_ = address.wait;
        const std::string who = user_.whom();
        const Transport& row = tls::rowFor(transportOf(address), address, who);
        shares_ = !declined_ && (shares_ || settings_.sharing == Sharing::always) && &sharing(row) != &row;
        line_ = (shares_ ? sharing(row) : row).begin(address, who);
        state_ = State::connecting;
        until_ = Deadline::at(monotonicNow() + kOpenTime);
        timer_ = reactor_->after(until_.when(), [this] { fail(errors::errorOf(kNotGreeted, who_, address_)); });
        watch();
    } catch (const Error& e) {
        fail(e);
    }
}

void Link::advance() {
    try {
        if (state_ == State::connecting) {
            unwatch();                                      // finish() may close it
            if (line_.row().finish(line_, user_.whom())) state_ = State::opening;
        }
        if (state_ == State::opening && upgrade(Transport::Stage::connected)) sayHello();
        if (state_ == State::greeting && readWelcome()) state_ = State::joining;
        if (state_ == State::joining && upgrade(Transport::Stage::greeted)) welcome();
        if (live() && !user_.wanted() && queue_.empty()) unwatch();
        else watch();
    } catch (const Error& e) {
        fail(e);
    }
}

bool Link::upgrade(Transport::Stage stage) {
    absentSince_ = 0;
    if (!line_.row().upgrade) return true;
    hungUp_ = true;                                     // in case that it throws
    const bool done = line_.row().upgrade(line_, stage, user_.whom());
    hungUp_ = false;
    if (done && stage == Transport::Stage::connected) remarks.append(tls::remarks(line_, user_.whom()));
    declined_ = declined_ || (shares_ && done && &line_.row() != &memoryTransport);
    return done;
}

void Link::sayHello() {
    state_ = State::greeting;
    auto& self = Caller::self();
    Buffer out;
    wire::writeHello(out, 0, program_, {client_, self.user, self.host, self.program, self.process, static_cast<std::uint32_t>(settings_.maxMessage),
                                        clockSeen(), monotonicNow()});
    const ssize_t n = line_.write(out.data(), out.size());
    // A daemon that has hung up has perhaps said why: the reader of its welcome finds that.
    if (n < 0 && (errno == EPIPE || errno == ECONNRESET)) return;
    hungUp_ = n != static_cast<ssize_t>(out.size());
    if (hungUp_) sorma::fail(errors::kRefused, user_.whom(), address_, std::strerror(errno), "it may be ending, or full");
}

// Why the line has failed, live.
std::string Link::whyBroken(int error) {
    try {
        line_.explain(user_.whom());
    } catch (const Error& e) {
        return e.what();
    }
    return std::strerror(error);
}

// True: it has come.
bool Link::readWelcome() {
    ssize_t n = read(0);
    const int error = n < 0 ? errno : 0;
    if (error == EAGAIN) return false;
    if (n < 0) line_.explain(user_.whom());
    const std::string said = "\"" + printable(in_.data(), in_.size()) + "\"";
    hungUp_ = n == 0 || error == ECONNRESET || error == EPIPE;  // also in the middle of its welcome
    if (hungUp_)
        sorma::fail(errors::kRefused, user_.whom(), address_,
                    in_.empty() ? "it closed the connection without a word" : "it closed the connection after " + said, "it may be ending, or full");
    if (n < 0) sorma::fail(errors::kProtocol, user_.whom(), address_, std::strerror(error), "is the address right?");
    record::Reader records(in_, record::kMostWelcome);
    std::string_view first;
    if (!records.next(first)) {
        if (!records.wrong()) return false;
        sorma::fail(errors::kProtocol, user_.whom(), address_, "it said " + said, "is the address right?");
    }
    inAt_ = static_cast<std::size_t>(records.at() - in_.data());
    unread_.clear();
    lastWords_.clear();
    XdrReader r(first);
    auto envelope = wire::readEnvelope(r);
    if (r.good() && envelope.kind == 0) {               // the daemon speaks first when it will not serve us
        auto header = wire::readCallHeader(r, envelope.xid);
        std::string reason(r.text());
        if (header.procedure == wire::kGoodbye && r.good()) sorma::fail(errors::kDaemonLimit, user_.whom(), address_, reason);
    }
    std::string objection = r.good() ? wire::readReplyHeader(r) : "its answer is not a message of ONC RPC";
    if (objection.empty() && !wire::readWelcome(r, offered_)) objection = "its welcome could not be decoded";
    if (objection == wire::kWantsTls) sorma::fail(kClear, user_.whom(), address_);
    if (!objection.empty()) sorma::fail(errors::kProtocol, user_.whom(), address_, objection, "is the address right?");
    return true;
}

// The daemon's answer to HELLO says which daemon this is, and so what happens to calls without a reply.
void Link::welcome() {
    const bool first = daemon_.boot == 0, other = offered_.boot != daemon_.boot;
    if (other && !first) declined_ = false;
    if (!first && other)
        user_.unanswered({"the daemon has ended", "another one answers there now: " + offered_.program + "[" + std::to_string(offered_.process) + "]"});
    else if (!first && !offered_.known)
        user_.unanswered({"the daemon does not know this client any more", "ask there what became of it"});
    daemon_ = std::move(offered_);
    otherClock_ = daemon_.clock != clockSeen();
    since_ = lastHeard_ = monotonicNow();
    if (other) ++boots_;
    pause_ = retryAt_ = 0;
    timer_.cancel();
    state_ = State::live;
    user_.welcomed(other);
}

bool Link::mayShare() const {
    return live() && settings_.sharing == Sharing::automatic && !declined_ && queue_.empty() && &sharing(line_.row()) != &line_.row();
}

void Link::share() {
    auto keep = user_.keep();
    disconnect();
    shares_ = true;
    start();
}

// ---- > lost ----

void Link::disconnect() {
    unwatch();
    line_ = {};
    timer_.cancel();
    in_.clear();
    apart_.end();
    inAt_ = 0;
    shares_ = false;
    const bool was = std::exchange(state_, State::lost) == State::live;
    auto queue = std::exchange(queue_, {});
    std::size_t taken = std::exchange(written_, 0);
    for (auto& item : queue) user_.unsent(item.tag, item.bytes, std::exchange(taken, 0));
    if (was) user_.ended();
}

// An attempt has failed.
void Link::fail(const Error& e) {
    auto keep = user_.keep();
    // A daemon of before, or a program that hands it the bytes, does not know the offer.
    if (shares_ && state_ >= State::opening) {
        declined_ = true;
        disconnect();
        return start();
    }
    disconnect();
    failure_ = e;
    conclude(e);
    final_ = !mayCome(e);
    retry();
    if (final_) retryAt_ = 0;
    user_.failed(e, final_);
    if (!user_.wanted()) timer_.cancel();
}

// Calls that were sent keep their slots until we know which daemon answers next.
void Link::lose(const std::string& how) {
    // Replies and a GOODBYE may still be in the socket: read them, so that fewer calls have an unknown result.
    while (live() && read(0) > 0) takeRecords();
    reject(how);
}

void Link::reject(const std::string& how) {
    how_ = lastWords_.empty() ? how : "the daemon said: " + lastWords_;
    if (!unread_.empty()) how_ += " (\"" + unread_ + "\")";
    ++losses_;
    failure_.reset();
    disconnect();
    if (user_.wanted()) retry();
}

void Link::close(const std::string& how) {
    how_ = how;
    disconnect();
}

void Link::retry() {
    if (state_ != State::lost) return;
    pause_ = pause_ == 0 ? kFirstPause : std::min(pause_ * 2, kLastPause);
    retryAt_ = monotonicNow() + pause_;
    timer_ = reactor_->after(retryAt_, [this] {
        timer_.cancel();
        if (state_ == State::lost && user_.wanted()) start();
    });
}

// Does nothing listen there?
bool Link::absent(const Error& e) const { return (e.is("COMM REFUSED") || e.is("ADDRESS UNRESOLVED")) && !hungUp_; }

// A daemon that was there before may come back, unless it has said GOODBYE. One that was never there is reported at once,
// unless the address says -wait.
bool Link::mayCome(const Error& e) const {
    if (isTls(e)) return false;
    if (e.is("DIRECTORY ASKED")) return true;
    if (absent(e)) return wait_ || (daemon_.boot != 0 && lastWords_.empty());
    return daemon_.boot != 0 && (hungUp_ || e.is("COMM LIMIT") || e.is("COMM TIMEOUT"));
}

// The connection cannot be made again: what becomes of calls that were sent? If nothing listens for a moment, the daemon may
// still be there, behind a tunnel for instance. It has certainly ended when it said GOODBYE, or when its process has ended.
void Link::conclude(const Error& e) {
    if (isTls(e)) return user_.unanswered({"TLS with it cannot be made again", e.what(), false});
    if (e.is("COMM PROTOCOL")) return user_.unanswered({"something else answers there now", e.what(), false});
    if (!absent(e)) return;
    std::int64_t now = monotonicNow();
    if (absentSince_ == 0) absentSince_ = now;
    if (!lastWords_.empty() || hasEnded(daemon_.process, daemon_.processes))
        user_.unanswered({"the daemon has ended", "nothing listens there now: is it started again?"});
    else if (now - absentSince_ > kAbsence)
        user_.unanswered({"nothing has listened there for " + durationText(double(now - absentSince_)), "ask there what became of it", false});
}

Error Link::unconnected(const std::string& whom) const {
    if (state_ == State::lost && failure_) return *failure_;
    return errors::errorOf(errors::kConnectTimeout, whom, address_ + (state_ > State::connecting ? " (it is connected, but does not answer)" : ""));
}

// ---- live: reading ----

bool Link::receive(std::int64_t wait) {
    ssize_t n = read(wait);
    if (watched_ && line_.row().brought) reactor_->stay(this);  // those who are told may run the event loop
    if (n > 0) takeRecords();
    else if (n == 0) lose("the daemon closed it");
    else if (errno == EAGAIN) return false;
    else lose(whyBroken(errno));
    return true;
}

ssize_t Link::read(std::int64_t wait) {
    if (apart_.filling()) [[unlikely]] return readApart(wait);
    std::size_t half = in_.size();
    std::size_t size = std::max(kReadSize, std::min(half, kMostGrowth));
    char* room = in_.extend(size);
    ssize_t n = line_.read(room, size, wait);
    in_.resize(half + (n > 0 ? static_cast<std::size_t>(n) : 0));
    return n;
}

ssize_t Link::readApart(std::int64_t wait) {
    std::size_t size = kReadSize;
    char* room = apart_.room(size);
    const ssize_t n = line_.read(room, size, wait);
    if (n > 0) apart_.came(static_cast<std::size_t>(n));
    return n;
}

inline void Link::take(XdrReader r) {
    if (wire::skipEventHeader(r)) return user_.event(r);
    auto envelope = wire::readEnvelope(r);
    if (!r.good() || envelope.kind != 0) return user_.replied(r, envelope.xid);
    auto header = wire::readCallHeader(r, envelope.xid);
    if (header.procedure == wire::kGoodbye) lastWords_ = std::string(r.text());
    if (header.procedure == wire::kEvent) user_.event(r);           // written by another implementation
    if (header.procedure == wire::kOutdated) user_.outdated();
    if (header.procedure == wire::kTraced) user_.traced(r);
}

// Have the whole ones taken. False: they are no records, or the line was lost.
bool Link::takeRecords() {
    lastHeard_ = callTime != 0 ? callTime : monotonicNow();
    for (std::string_view record;;) {
        if (apart_.filling()) return true;
        record::Reader next(in_.data() + inAt_, in_.size() - inAt_, static_cast<std::size_t>(settings_.maxMessage));
        if (!next.next(record)) {
            if (!next.wrong()) break;
            unread_ = printable(next.at(), in_.size() - inAt_);
            reject("what came is not a record of ONC RPC, or it is longer than -maxmessage");
            return false;
        }
        inAt_ = static_cast<std::size_t>(next.at() - in_.data());
        if (apart_.size() == 0) [[likely]] take(XdrReader(record));
        else takeLong(record);
        if (!live()) return false;
    }
    in_.drop(inAt_);
    inAt_ = 0;
    if (in_.empty() && in_.capacity() > kKeepBuffer) in_.release();
    else if (in_.size() > 0 && apart_.size() == 0) apart_.begin(in_, 0);
    return true;
}

// Those who take it may begin to read another one.
void Link::takeLong(std::string_view record) {
    record::Apart numbers = std::exchange(apart_, {});
    take(XdrReader(record, numbers));
    numbers.end();
    if (apart_.size() == 0 && numbers.capacity() <= kKeepBuffer) apart_ = std::move(numbers);
}

void Link::look() {
    while (live() && receive(0)) {}                     // a GOODBYE, most likely
}

// ---- live: writing ----

void Link::push(Item item) {
    if (!live()) return user_.unsent(item.tag, item.bytes, 0);
    if (!queue_.empty()) return queue_.push_back(std::move(item));
    const Buffer& bytes = item.all();
    ssize_t n = line_.write(bytes.data(), bytes.size());
    if (n == static_cast<ssize_t>(bytes.size())) return user_.wrote(item.tag);
    const int error = errno;
    written_ = static_cast<std::size_t>(std::max(n, ssize_t{0}));
    queue_.push_back(std::move(item));
    if (n < 0 && error != EAGAIN) lose(std::strerror(error));
}

void Link::drain() {
    while (!queue_.empty()) {
        const Buffer& bytes = queue_.front().all();
        const char* at = bytes.data() + written_;
        std::size_t left = bytes.size() - written_;
        if (!line_.writeMost(at, left)) return lose(std::strerror(errno));
        written_ = bytes.size() - left;
        if (left > 0) return;
        const Tag tag = queue_.front().tag;
        queue_.pop_front();
        written_ = 0;
        user_.wrote(tag);
    }
}

// The daemon may wait until we take its replies: read while we wait to write. False: the deadline has passed.
bool Link::waitToWrite(Deadline deadline) {
    if (deadline.passed()) return false;
    if (line_.wait(EPOLLIN | EPOLLOUT, milliseconds(deadline.left(), 1'000)) & EPOLLIN) receive(0);
    return true;
}

bool Link::drainAll(Deadline deadline) {
    drainUntil(deadline, [&] { return queue_.empty(); });
    if (live() && !queue_.empty()) lose("the daemon did not read in time what was sent");
    return live();
}

bool Link::write(const char* data, std::size_t size, Deadline deadline, std::size_t* taken) {
    const std::size_t all = size;
    while (live()) {
        const bool whole = line_.writeMost(data, size);
        if (taken) *taken = all - size;
        if (size == 0) return true;
        if (!whole) lose(std::strerror(errno));
        // Half a record stands on the wire: nothing else can follow it.
        else if (!waitToWrite(deadline)) lose("the daemon did not read the request in time");
    }
    return false;
}

bool Link::writeLong(const Buffer& record, const record::Lent& lent, Deadline deadline, std::size_t& taken) {
    record::Source source(record, lent);
    while (source.left() > 0) {
        const std::string_view piece = source.next();
        std::size_t some = 0;
        const bool whole = write(piece.data(), piece.size(), deadline, &some);
        source.took(some);
        taken += some;
        if (!whole) return false;
    }
    return true;
}

bool Link::append(Tag tag, const Buffer& bytes) {
    if (queue_.empty() || queue_.back().tag != tag) return false;
    queue_.back().bytes.append(bytes.data(), bytes.size());
    return true;
}

bool Link::forget(Tag tag) {
    if (begun(tag)) return false;
    std::erase_if(queue_, [tag](auto& item) { return item.tag == tag; });
    return true;
}

std::size_t Link::backlog() const {
    std::size_t bytes = 0;
    for (auto& item : queue_) bytes += item.bytes.size();
    return queue_.empty() || queue_.front().lent ? bytes : bytes - written_;
}

}  // namespace sorma
