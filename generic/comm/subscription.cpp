// The subscriptions of a client, in the daemon.
#include "bus/monitor.h"
#include "comm/errors.h"
#include "comm/serverParts.h"

namespace sorma {

namespace {

constexpr std::size_t kUncharged = 1024;        // of events that wait

}  // namespace

Server::Subscription::Subscription(Server& server, Session& session, const wire::Subscription& wanted, const PrincipalPointer& author)
    : id(wanted.id), server_(server), session_(session),
      own_(1024 + wanted.name.size() + wanted.pattern.size()), charge_(session.peer->account_, Account::Use::subscriptions),
      author_(author), pattern_(wanted.pattern),
      keep_(std::clamp<std::size_t>(wanted.keep, 1, static_cast<std::size_t>(server.settings_.maxQueue))) {
    charge_.need(wanted.name, own_);
    ServerLock::Released released(server_.lock_);               // the object may have to be made
    Sorm& sorm = server_.sorm_;
    sorm.access.need(author, Right::inspect, wanted.name, wanted.name);
    if (wanted.existing && !sorm.find(wanted.name)) fail(errors::kNoObject, wanted.name);
    object_ = sorm.get(wanted.name, author);
    object_->subscribe(this, wanted.pattern);
}

Server::Subscription::~Subscription() {
    if (object_) object_->unsubscribe(this);
    if (scheduled && session_.peer) session_.peer->unschedule(*this);
}

void Server::Subscription::event(const Event& event) {
    ServerLock::Held held(server_.lock_);
    if (author_ && epoch_ != server_.sorm_.access.epoch() && !mayListen()) [[unlikely]] return;
    if (concealed(event, server_.sorm_.access, author_)) [[unlikely]] {
        Message bare;
        bare.words = event.message.words;
        auto body = std::make_shared<Buffer>();
        wire::writeEventBody(*body, {event.time, std::string(event.name), event.request}, bare);
        return push(std::move(body));
    }
    if (server_.encoded_ != event.serial) {             // the first of this server's listeners
        auto body = std::make_shared<Buffer>();
        wire::writeEventBody(*body, {event.time, std::string(event.name), event.request}, event.message);
        server_.encodedBody_ = std::move(body);
        server_.encoded_ = event.serial;
    }
    push(server_.encodedBody_);
}

std::string Server::Subscription::who() const { return session_.client->caller.toText(); }

void Server::Subscription::replay() {
    if (keep_ == 1 && object_) object_->replay(this, pattern_);
}

void Server::Subscription::gone() {
    ServerLock::Held held(server_.lock_);
    end("sorma.gone", {});
}

// The last that it hears.
void Server::Subscription::end(const char* event, std::string why) {
    object_ = Reference();
    Message m;
    m.text = std::move(why);
    auto body = std::make_shared<Buffer>();
    wire::writeEventBody(*body, {wallNow(), event, 0}, m);
    push(std::move(body));
}

// Another policy may hold than when it subscribed.
bool Server::Subscription::mayListen() {
    epoch_ = server_.sorm_.access.epoch();
    try {
        server_.sorm_.access.need(author_, Right::inspect, object_->name(), object_->name());
        return true;
    } catch (const Error& e) {
        object_->unsubscribe(this);
        end("sorma.refused", e.what());
        return false;
    }
}

void Server::Subscription::push(std::shared_ptr<const Buffer> body) {
    ++number_;
    if (!session_.peer) {
        ++lost_;
        return;
    }
    if (items_.size() >= keep_) dropOldest();
    items_.push_back({std::move(body), number_, std::exchange(lost_, 0)});
    waits_ += sizeOf(items_.back());
    while (waits_ > kUncharged && !charge()) {
        dropOldest();
        if (items_.empty()) return;
    }
    if (!scheduled) session_.peer->schedule(*this);
}

// One or two small ones are on their way in a moment.
bool Server::Subscription::charge() { return charge_.set(own_ + (waits_ > kUncharged ? waits_ : 0)); }

// The next event says how many were lost before it.
void Server::Subscription::dropOldest() {
    lost_ += 1 + items_.front().lost;
    waits_ -= sizeOf(items_.front());
    items_.pop_front();
    if (!items_.empty()) items_.front().lost += std::exchange(lost_, 0);
}

bool Server::Subscription::pump(Peer&, Buffer& out) {
    while (!items_.empty() && out.size() < kEventWindow) {
        auto& item = items_.front();
        wire::writeEvent(out, {id, item.number, item.lost}, *item.body);
        waits_ -= sizeOf(item);
        items_.pop_front();
    }
    if (charge_.bytes() != own_) charge();
    return !items_.empty();
}

void Server::Subscription::stopKeeping() {
    for (auto& item : items_) lost_ += 1 + item.lost;
    items_.clear();
    waits_ = 0;
    charge();
    scheduled = false;
}

}  // namespace sorma
