#include "comm/proxy.h"

#include "bus/deadline.h"
#include "bus/requestText.h"

namespace sorma {

Proxy::Proxy(std::string target, std::shared_ptr<Connection> connection, const Settings& settings)
    : target_(std::move(target)), connection_(std::move(connection)), settings_(settings) {}

Proxy::~Proxy() {
    if (restart_ != 0) connection_->cancelRestart(restart_);
}

void Proxy::forward(Method method, Message& m) {
    if (!recipe_.empty()) {
        Message recipe;
        recipe.words = std::exchange(recipe_, {});
        forward(Method::ctrl, recipe);
    }
    Deadline deadline = Deadline::in(settings_.timeout);
    Call* outer = Call::current();
    if (!outer) return connection_->call(target_, method, m, deadline);
    std::int64_t start = monotonicNow();
    struct Count {
        Call* outer;
        std::int64_t start;
        ~Count() { outer->subTime += monotonicNow() - start; }
    } count{outer, start};
    connection_->call(target_, method, m, deadline.earlier(outer->deadline));
}

void Proxy::carry(const PendingPointer& pending, Method method) {
    if (!recipe_.empty()) {
        Message m;
        m.words = std::exchange(recipe_, {});
        async(Method::ctrl, std::move(m));
    }
    connection_->begin(pending, target_, method);
}
void Proxy::oneway(Method method, Message request) { connection_->oneway(target_, method, request); }

std::unique_ptr<Listening> Proxy::listen(std::string pattern, std::size_t keep, Listener listener) {
    Deadline deadline = Deadline::in(settings_.timeout).earlier(Call::currentDeadline());
    return connection_->listen(target_, std::move(pattern), keep, std::move(listener), deadline);
}

void Proxy::exec(Message& m) { forward(Method::exec, m); }
void Proxy::ctrl(Message& m) { forward(Method::ctrl, m); }

void Proxy::dbx(Message& m) {
    if (m.words.size() == 1 && m.words[0] == "-connection") {
        m.text = "proxy " + name() + " of " + target_ + "\n" + connection_->facts();
        return;
    }
    forward(Method::dbx, m);
}

std::vector<Pin> Proxy::pins(std::string_view pin, std::size_t length) const {
    Message m;
    m.words = {"-pins"};
    if (!pin.empty()) m.words.insert(m.words.end(), {std::string(pin), std::to_string(length)});
    const_cast<Proxy*>(this)->forward(Method::dbx, m);
    return Pin::fromText(m.text);
}

void Proxy::setRecipe(std::vector<std::string> words, bool later) {
    // The daemon executes in order: what is called next finds the recipe applied.
    auto send = [this, words] {
        Message m;
        m.words = words;
        if (connection_->inEvents()) async(Method::ctrl, std::move(m));
        else forward(Method::ctrl, m);
    };
    if (later) recipe_ = words;
    else send();
    if (restart_ != 0) connection_->cancelRestart(restart_);
    restart_ = connection_->onRestart(send);
}

Class Proxy::describe() {
    return Class("proxy", "stands for a service object of another process", nullptr);
}

}  // namespace sorma
