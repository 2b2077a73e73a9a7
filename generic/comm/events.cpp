#include "comm/events.h"

#include <algorithm>
#include <utility>

#include "bus/statistics.h"
#include "comm/errors.h"

namespace sorma {

namespace {

// A view compares sizes first.
bool isLast(std::string_view event) { return event == "sorma.gone" || event == "sorma.refused"; }

}  // namespace

class Events::Remote : public Listening {
public:
    Remote(Events& e, wire::Subscription w, std::shared_ptr<Inbox> i, PrincipalPointer by)
        : events(e), keep(e.user_.keep()), wanted(std::move(w)), object(e.link_.fullName(wanted.name)), inbox(std::move(i)), relayFor(std::move(by)) {
        events.subscriptions_.emplace(wanted.id, this);
    }
    ~Remote() override {
        inbox->close();
        events.subscriptions_.erase(wanted.id);
        Buffer bytes;
        wire::writeUnsubscribe(bytes, events.link_.program(), wanted.id);
        events.link_.send(std::move(bytes));
        events.link_.watch();
    }
    // Ask the daemon for it. answered: what it objects to, empty when it agrees.
    void ask(std::function<void(Trail objection, const Message& m)> answered) {
        boot = events.link_.daemon().boot;
        Buffer bytes;
        Link& link = events.link_;
        auto handler = [&link, answered = std::move(answered)](XdrReader& r, const std::string& objection) {
            Message m;
            wire::Times times;
            std::string wrong = objection;
            if (wrong.empty() && (!wire::readReply(r, times, m) || (m.code >= 0 ? m.ints.size() != 3 : m.trail.empty())))
                wrong = "its answer could not be decoded";
            if (!wrong.empty()) {
                m.code = -1;
                m.trail = errors::trailOf(errors::kProtocol, link.who(), link.address(), wrong, "are both of the same version?");
            }
            answered(m.code < 0 ? m.trail : Trail(), m);
        };
        wire::Behalf behalf = wire::behalfOf(relayFor);
        wire::writeSubscribe(bytes, events.control(std::move(handler)), link.program(), wanted, relayFor ? &behalf : nullptr);
        link.send(std::move(bytes));
    }
    // The same for a subscription that may be gone when the answer comes.
    void askLater(void (Remote::*agreed)(const Message& m, bool same), bool same) {
        ask([&events = events, id = wanted.id, agreed, same](Trail objection, const Message& m) {
            auto found = events.subscriptions_.find(id);
            if (found == events.subscriptions_.end()) return;
            if (objection.empty()) (found->second->*agreed)(m, same);
            else found->second->tell("sorma.refused", -1, objection.cause() ? objection.cause()->text : "");
        });
    }
    void begun(const Message& m, bool) { last = std::max(last, std::uint64_t(m.ints[0])); }     // events may have come with the answer
    void goesOn(const Message& m, bool same) {
        auto now = std::uint64_t(m.ints[0]);
        bool counted = same && m.ints[2] == 1 && now >= last;
        std::int64_t missed = counted ? std::int64_t(now - last) : -1;
        last = now;
        tell("sorma.reconnected", missed, "");
    }
    void tell(std::string name, std::int64_t lost, std::string text) {
        Message m;
        m.text = std::move(text);
        inbox->push({object, std::move(name), std::move(m), last, lost, wallNow()});
    }

    Events& events;
    const std::shared_ptr<void> keep;
    wire::Subscription wanted;
    const std::string object;           // its name for listeners
    std::shared_ptr<Inbox> inbox;
    const PrincipalPointer relayFor;
    std::uint64_t last = 0;             // number of the last event that came
    std::uint64_t boot = 0;             // of the daemon that counts them
};

std::uint32_t Events::control(Control handler) {
    std::uint32_t xid = Slots::xidOf(Slots::kControl, ++lastControl_);
    controls_.emplace(xid, std::move(handler));
    return xid;
}

void Events::replied(XdrReader& r, std::uint32_t xid) {
    if (auto found = controls_.extract(xid)) found.mapped()(r, wire::readReplyHeader(r));
}

wire::Health Events::health(Deadline deadline) {
    const std::string patience = durationText(double(deadline.left()));
    calls_.lookIfIdle(monotonicNow());
    calls_.connect(deadline, nullptr, false);
    // Shared with the answer, which may come when nobody is here any more.
    struct Answer {
        wire::Health health;
        std::string wrong;
        bool done = false;
    };
    auto answer = std::make_shared<Answer>();
    Buffer bytes;
    wire::writeHealthRequest(bytes, control([answer](XdrReader& r, const std::string& objection) {
        answer->wrong = objection;
        if (objection.empty() && !wire::readHealth(r, answer->health)) answer->wrong = "its answer could not be decoded";
        answer->done = true;
    }), link_.program());
    link_.send(std::move(bytes));
    while (!answer->done) {
        if (!link_.live()) fail(errors::kRefused, link_.who(), link_.address(), link_.how(), "ask again");
        if (!link_.step(deadline) && !answer->done) fail(errors::kUnanswered, link_.who(), link_.address(), patience, "say how it is");
    }
    calls_.tellLater();
    if (!answer->wrong.empty()) fail(errors::kProtocol, link_.who(), link_.address(), answer->wrong, "are both of the same version?");
    return answer->health;
}

void Events::askHealth(std::function<void(const wire::Health&)> told) {
    if (!link_.live()) return;
    Buffer bytes;
    auto answered = [mailbox = mailbox_, told = std::move(told)](XdrReader& r, const std::string& objection) {
        wire::Health health;
        if (objection.empty() && wire::readHealth(r, health)) mailbox->post([told, health] { told(health); });
    };
    wire::writeHealthRequest(bytes, control(std::move(answered)), link_.program());
    link_.send(std::move(bytes));
    link_.watch();
}

bool Events::askFacts(std::string_view name, const PrincipalPointer& relayFor, std::function<void(Message& answer)> told) {
    if (!calls_.ready()) return false;
    auto answered = [told = std::move(told)](XdrReader& r, const std::string& objection) {
        Message m;
        wire::Times times;
        if (objection.empty() && wire::readReply(r, times, m) && m.code >= 0) told(m);
    };
    Message question;
    question.words = {"-info", "secrets"};
    const wire::Behalf behalf = wire::behalfOf(relayFor);
    Buffer bytes;
    wire::writeCall(bytes, control(std::move(answered)), link_.program(), {.method = Method::dbx, .name = name}, question, wire::kCall, relayFor ? &behalf : nullptr);
    link_.send(std::move(bytes));
    link_.watch();
    return true;
}

std::unique_ptr<Events::Remote> Events::make(std::string name, std::string pattern, std::size_t keep, Listener listener, const PrincipalPointer& relayFor,
                                             bool existing) {
    wire::Subscription wanted{++lastSubscription_, std::move(name), std::move(pattern), static_cast<std::uint32_t>(keep), existing};
    return std::make_unique<Remote>(*this, std::move(wanted), std::make_shared<Inbox>(mailbox_, keep, std::move(listener), spares_), relayFor);
}

std::unique_ptr<Listening> Events::listen(std::string name, std::string pattern, std::size_t keep, Listener listener, Deadline deadline,
                                          const PrincipalPointer& relayFor) {
    const std::string patience = durationText(double(deadline.left()));
    calls_.lookIfIdle(monotonicNow());
    auto remote = make(std::move(name), std::move(pattern), keep, std::move(listener), relayFor, false);
    // Shared with the answer, which may come when nobody is here any more.
    struct Answer {
        Trail objection;
        Message m;
        bool done = false;
    };
    auto answer = std::make_shared<Answer>();
    for (bool asked = false; !answer->done; asked = true) {
        if (!asked || !link_.live()) {
            calls_.connect(deadline);                   // which subscribes again by itself, but tells nobody here
            remote->ask([answer](Trail why, const Message& m) { *answer = {std::move(why), m, true}; });
        }
        if (!link_.step(deadline) && !answer->done)
            fail(errors::kUnanswered, link_.fullName(remote->wanted.name), link_.address(), patience, "subscribe");
    }
    calls_.tellLater();
    if (!answer->objection.empty()) throw Error(std::move(answer->objection));
    remote->begun(answer->m, true);
    link_.watch();
    return remote;
}

std::unique_ptr<Listening> Events::listenLater(std::string name, std::string pattern, std::size_t keep, Listener listener, bool existing,
                                               const PrincipalPointer& relayFor) {
    auto remote = make(std::move(name), std::move(pattern), keep, std::move(listener), relayFor, existing);
    remote->boot = link_.daemon().boot;
    if (link_.live()) remote->askLater(&Remote::begun, true);
    link_.watch();
    return remote;
}

void Events::resume() {
    for (auto& [id, remote] : subscriptions_)
        if (remote->boot != 0) remote->askLater(&Remote::goesOn, remote->boot == link_.daemon().boot);
}

void Events::traced(XdrReader& r) {
    if (!wire::readTraced(r, next_, origin_)) origin_ = {};
}

void Events::event(XdrReader& r) {
    wire::EventHeader header;
    wire::EventBody body;
    Inbox::Item event = spares_->take();
    if (!wire::readEvent(r, header, body, event->message)) return;
    auto found = subscriptions_.find(header.id);
    if (found == subscriptions_.end()) return;          // it has just ended
    Remote& remote = *found->second;
    remote.last = header.number;
    if (isLast(body.name)) remote.boot = 0;             // it has ended: not to be resumed
    event->object = remote.object;
    event->name = std::move(body.name);
    event->number = header.number;
    event->lost = std::int64_t(header.lost);
    event->time = body.time;
    event->request = body.request;
    event->origin = header.id == next_.id && header.number == next_.number ? std::exchange(origin_, {}) : TraceOrigin();
    remote.inbox->push(std::move(event));
}

}  // namespace sorma
