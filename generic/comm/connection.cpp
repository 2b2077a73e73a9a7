#include "comm/connection.h"

#include <utility>

#include "bus/listText.h"
#include "bus/statistics.h"

namespace sorma {

Connection::Connection(std::string who, std::function<Address()> locate, std::shared_ptr<const Settings> settings, std::shared_ptr<Reactor> reactor,
                       std::shared_ptr<Mailbox> mailbox)
    : locate_(std::move(locate)), settings_(std::move(settings)), mailbox_(std::move(mailbox)), reactor_(reactor), link_(*this, std::move(who), *settings_, reactor),
      calls_(link_, *this, *settings_, reactor, mailbox_, [this] { update(); }, [this](bool fresh) { resumed(fresh); }),
      oneways_(link_, calls_, *settings_), events_(link_, calls_, *this, mailbox_) {}

void Connection::oneway(const std::string& name, Method method, const Message& m, const PrincipalPointer& relayFor) {
    auto keep = weak_from_this().lock();
    oneways_.send(name, method, m, relayFor, !inEvents());
    update();
}

std::string Connection::finish(Deadline deadline) {
    auto keep = shared_from_this();
    std::string left = oneways_.finish(deadline);
    update();
    return left;
}

// The SORM ends: no caller and no listener is told anything.
void Connection::end() {
    auto keep = shared_from_this();
    close("the program ends its use of it");
    link_.close(link_.how());
    calls_.end();
    oneways_.forget();
    whenDropped = nullptr;
    keep_.reset();
}

void Connection::ping(Deadline deadline) {
    Message m;
    m.words = {"-info", "name"};
    call("sorm", Method::dbx, m, deadline);
}

void Connection::close(const std::string& reason) {
    if (!link_.live()) return;
    link_.close(reason);
    calls_.unanswered({"it was closed on this side", "ask there what became of it", false});
    calls_.tellLater();
}

std::uint64_t Connection::onRestart(std::function<void()> callback) {
    restarted_.emplace(nextRestart_, std::move(callback));
    return nextRestart_++;
}

// Where calls follow each other quickly the line is made again, by memory: once, when nothing else is under way. Subscribers would hear
// of it, and are left alone.
void Connection::hurry() {
    const std::int64_t now = monotonicNow();
    quick_ = 0;
    if (now - std::exchange(quickSince_, now) > kWithin || !link_.mayShare() || inEvents() || wanted() || calls_.taken() > 0) return;
    link_.share();
}

void Connection::heedOwner() {
    if (!connected() || std::exchange(owner_, link_.epoch()) == link_.epoch()) return;
    askHealth([weak = weak_from_this()](const wire::Health&) {
        if (const auto self = weak.lock()) self->owed_.cancel();
    });
    owed_ = reactor_->after(monotonicNow() + kOwed, [this] {
        const auto keep = weak_from_this().lock();
        owed_.cancel();
        link_.lose("the directory names another owner, and this one does not answer");
        calls_.tellLater();
    });
}

// ---- what the link tells ----

void Connection::welcomed(bool other) {
    owner_ = link_.epoch();
    calls_.connected(other);
    tellChange();
    if (other && boots() > 1)
        for (auto& [number, callback] : std::map(restarted_)) {
            try {
                callback();
            } catch (const std::exception&) {           // the others are called all the same
            }
        }
    calls_.proceed();
}

void Connection::resumed(bool fresh) {
    oneways_.resume();
    if (fresh) events_.resume();
}

void Connection::wrote(Link::Tag tag) {
    if (tag < Slots::kControl) calls_.wrote(tag);
    update();
}

void Connection::ended() {
    ++doubts_;
    owed_.cancel();
    calls_.ended();
    events_.ended();
    tellChange();
    update();
}

void Connection::failed(const Error& why, bool final) {
    oneways_.failed(why, final);
    calls_.failed(why, final);
    update();
}

void Connection::update() {
    const bool busy = calls_.underway() || oneways_.waiting() || link_.queued();
    if (busy == (keep_ != nullptr)) return;
    if (busy) keep_ = weak_from_this().lock();
    else mailbox_->post([keep = std::move(keep_)] {});
}

void Connection::tellChange() {
    if (!changed) return;
    mailbox_->post([weak = weak_from_this()] {
        if (auto self = weak.lock(); self && self->changed) self->changed();
    });
}

// ---- for people and programs ----

std::string Connection::row() const {
    std::string seconds = connected() ? std::to_string((monotonicNow() - link_.since()) / 1'000'000'000) : std::string();
    return listOf({"to", who(), link_.address(), seconds, std::to_string(calls_.count()), std::to_string(calls_.inFlight())});
}

std::string Connection::facts() const {
    auto& d = daemon();
    std::string out = "daemon " + d.name + " at " + link_.address();
    out += connected() ? ", connected for " + link_.age() : ", not connected" + (link_.how().empty() ? std::string() : ": " + link_.how());
    if (connected()) out += "\ntransport " + std::string(link_.transport());
    out += "\nserved by " + d.user + "@" + d.host + " " + d.program + "[" + std::to_string(d.process) + "] since " + clockText(d.started);
    out += "\ncalls " + std::to_string(calls_.count()) + ", in flight " + std::to_string(calls_.inFlight()) + ", connections lost " +
           std::to_string(link_.losses()) + ", daemons seen " + std::to_string(boots());
    if (oneways_.dropped() > 0) out += "\none-way requests never sent " + std::to_string(oneways_.dropped());
    auto& t = lastTimes();
    out += "\nlast reply: waited " + std::to_string(t.waited) + " us, ran " + std::to_string(t.ran) + " us, of which sub-calls " + std::to_string(t.sub) + " us";
    return out;
}

}  // namespace sorma
