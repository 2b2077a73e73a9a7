#include "comm/subscription.h"

#include <algorithm>

#include "bus/monitor.h"
#include "comm/errors.h"
#include "comm/peer.h"

namespace sorma {

namespace {

std::shared_ptr<const wire::EncodedEvent> encode(const wire::EventBody& event, const Message& content, const TraceOrigin& origin = {}) {
    auto encoded = std::make_shared<wire::EncodedEvent>();
    encoded->origin = origin;
    wire::writeEventBody(encoded->body, event, content);
    return encoded;
}

}  // namespace

Server::Subscription::Subscription(Server& server, Session& session, const wire::Subscription& wanted, const PrincipalPointer& author)
    : id(wanted.id), server_(server), session_(session),
      waiting_(wanted.name, session.peer->requests.account, Account::Use::subscriptions, {{}, 1024 + wanted.name.size() + wanted.pattern.size(), 0}),
      author_(author), pattern_(wanted.pattern),
      keep_(std::clamp<std::size_t>(wanted.keep, 1, static_cast<std::size_t>(server.settings_.maxQueue))) {
    ServerLock::Released released(server_.lock_);               // the object may have to be made
    Sorm& sorm = server_.sorm_;
    sorm.access.need(author, Right::inspect, sorm.canonical(wanted.name), wanted.name);
    if (wanted.existing && !sorm.find(wanted.name)) fail(errors::kNoObject, wanted.name);
    object_ = sorm.get(wanted.name, author);
    object_->subscribe(this, wanted.pattern, object_->need(author, Right::inspect));
}

Server::Subscription::~Subscription() {
    if (object_) object_->unsubscribe(this);
    if (scheduled && session_.peer) session_.peer->unschedule(*this);
}

void Server::Subscription::event(const Event& event) {
    ServerLock::Held held(server_.lock_);
    if (author_ && epoch_ != server_.sorm_.access.epoch() && !mayListen()) [[unlikely]] return;
    if (author_ && concealed(event, server_.sorm_, author_)) [[unlikely]] {
        Message bare;
        bare.words = bareWords(event);
        return push(encode({event.time, std::string(event.name), event.request}, bare, event.origin));
    }
    if (server_.encoded_ != event.serial) {             // the first of this server's listeners
        server_.encodedEvent_ = encode({event.time, std::string(event.name), event.request}, event.message, event.origin);
        server_.encoded_ = event.serial;
    }
    push(server_.encodedEvent_);
}

std::string Server::Subscription::who() const { return session_.client->caller.toText(); }

void Server::Subscription::replay() {
    if (keep_ == 1 && object_ && mayListen()) object_->replay(this, pattern_, object_->need(author_, Right::inspect));
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
    push(encode({wallNow(), event, 0}, m));
}

void Server::Subscription::judge() {
    if (author_ && object_) mayListen();
}

// Another policy may hold than when it subscribed.
bool Server::Subscription::mayListen() {
    epoch_ = server_.sorm_.access.epoch();
    try {
        object_->need(author_, Right::inspect);
        return true;
    } catch (const Error& e) {
        object_->unsubscribe(this);
        end("sorma.refused", e.what());
        return false;
    }
}

void Server::Subscription::push(Item item) {
    ++number_;
    if (!session_.peer) {
        ++lost_, ++server_.eventsLost_;
        return;
    }
    const std::size_t size = sizeOf(item);
    waiting_.edit([&](Waiting& w) {
        if (w.items.size() >= keep_) dropOldest(w);
        bool room = fits(size);
        for (; !room && !w.items.empty(); room = fits(size)) dropOldest(w);
        if (room) {
            w.items.push_back(std::move(item));
            w.bytes += size;
        } else {
            ++lost_, ++server_.eventsLost_;
        }
    });
    if (!scheduled && waiting()) session_.peer->schedule(*this);
}

bool Server::Subscription::fits(std::size_t more) const {
    const std::size_t now = Waiting::charged(waiting_->bytes), then = Waiting::charged(waiting_->bytes + more);
    return then <= now || waiting_.account()->fits(then - now);
}

void Server::Subscription::dropOldest(Waiting& w) {
    ++lost_, ++server_.eventsLost_;
    w.bytes -= sizeOf(w.items.front());
    w.items.pop_front();
}

bool Server::Subscription::pump(Buffer& out) {
    waiting_.edit([&](Waiting& w) {
        while (!w.items.empty() && out.size() < kEventWindow) {
            const auto& event = *w.items.front();
            const wire::EventHeader header{id, number_ - w.items.size() + 1, std::exchange(lost_, 0)};
            if (event.origin) [[unlikely]] wire::writeTraced(out, header, event.origin);
            wire::writeEvent(out, header, event.body);
            w.bytes -= sizeOf(w.items.front());
            w.items.pop_front();
        }
    });
    return waiting();
}

void Server::Subscription::stopKeeping() {
    waiting_.edit([&](Waiting& w) {
        lost_ += w.items.size(), server_.eventsLost_ += w.items.size();
        w.items.clear();
        w.bytes = 0;
    });
    scheduled = false;
}

}  // namespace sorma
