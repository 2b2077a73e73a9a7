#include "comm/proxy.h"

#include "bus/call.h"
#include "bus/requestText.h"

namespace sorma {

Proxy::Proxy(std::string target, std::shared_ptr<Connection> connection, const Settings& settings, Line line, PrincipalPointer relayFor)
    : target_(std::move(target)), connection_(std::move(connection)), settings_(settings), line_(std::move(line)), seen_(line_.changes),
      relayFor_(std::move(relayFor)) {}

Proxy::~Proxy() {
    if (restart_ != 0) connection_->cancelRestart(restart_);
}

void Proxy::follow() {
    seen_ = line_.changes;
    std::shared_ptr<Connection> now;
    try {
        now = line_.find();
    } catch (const Error&) {            // its name leads nowhere any more; what it has works as long as it lasts
    }
    if (!now || now == connection_) return;
    if (restart_ != 0) connection_->cancelRestart(std::exchange(restart_, 0));
    connection_ = std::move(now);
    if (!wish_.empty()) setRecipe(wish_, true);
}

void Proxy::forward(Method method, Message& m) {
    Connection& connection = line();
    if (!recipe_.empty()) {
        Message recipe;
        recipe.words = std::exchange(recipe_, {});
        forward(Method::ctrl, recipe);
    }
    const std::int64_t start = monotonicNow();
    Deadline deadline = settings_.timeout > 0 ? Deadline::at(start + settings_.timeout * 1'000'000) : Deadline();
    CallContext* outer = CallContext::current();
    if (!outer) return connection.call(target_, method, m, deadline, relayFor_ != nullptr, start);
    struct Count {
        CallContext* outer;
        std::int64_t start;
        ~Count() { outer->subTime += std::uint32_t((monotonicNow() - start) / 1000); }
    } count{outer, start};
    connection.call(target_, method, m, deadline.earlier(outer->deadline), relayFor_ != nullptr, start);
}

bool Proxy::answers(Method method, Message& m) {
    if (method != Method::dbx || m.words.size() != 1 || m.words[0] != "-connection") return false;
    line();
    m.text = "proxy " + name() + " of " + target_ + "\n" + connection_->facts();
    m.words.clear();
    return true;
}

void Proxy::carry(const PendingPointer& pending, Method method) {
    if (answers(method, pending->message)) return pending->answer();
    Connection& connection = line();
    if (!recipe_.empty()) {
        Message m;
        m.words = std::exchange(recipe_, {});
        async(Method::ctrl, std::move(m));
    }
    pending->relayed = relayFor_ != nullptr;
    connection.begin(pending, target_, method);
}
void Proxy::oneway(Method method, Message request) { line().oneway(target_, method, request, relayFor_ != nullptr); }

std::unique_ptr<Listening> Proxy::listen(std::string pattern, std::size_t keep, Listener listener) {
    Deadline deadline = Deadline::in(settings_.timeout).earlier(CallContext::currentDeadline());
    return line().listen(target_, std::move(pattern), keep, std::move(listener), deadline, relayFor_ != nullptr);
}

void Proxy::exec(Message& m) { forward(Method::exec, m); }
void Proxy::ctrl(Message& m) { forward(Method::ctrl, m); }

void Proxy::dbx(Message& m) {
    if (!answers(Method::dbx, m)) forward(Method::dbx, m);
}

std::vector<Pin> Proxy::pins(std::string_view pin, std::size_t length) const {
    Message m;
    m.words = {"-pins"};
    if (!pin.empty()) m.words.insert(m.words.end(), {std::string(pin), std::to_string(length)});
    const_cast<Proxy*>(this)->forward(Method::dbx, m);
    return Pin::fromText(m.text);
}

void Proxy::setRecipe(std::vector<std::string> words, bool later) {
    wish_ = std::move(words);
    // The daemon executes in order: what is called next finds the recipe applied.
    auto send = [this] {
        Message m;
        m.words = wish_;
        if (connection_->inEvents()) async(Method::ctrl, std::move(m));
        else forward(Method::ctrl, m);
    };
    if (later) recipe_ = wish_;
    else send();
    if (restart_ != 0) connection_->cancelRestart(restart_);
    restart_ = connection_->onRestart(send);
}

Class Proxy::describe() {
    return Class("proxy", "stands for a service object of another process", nullptr);
}

}  // namespace sorma
