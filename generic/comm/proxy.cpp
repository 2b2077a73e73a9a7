#include "comm/proxy.h"

#include "bus/call.h"
#include "bus/requestText.h"

namespace sorma {

namespace {

using Words = std::vector<std::string>;

const Prototype kForgotten{Severity::warning, "COMM RESTARTED", 1, "{}: {}"};
const Prototype kBoolean{Severity::error, "OPTION SYNTAX", 2, "{}: {} needs 0 or 1, not \"{}\""};

bool parseBoolean(const std::string& name, const Words& words) {
    if (words[1] != "0" && words[1] != "1") fail(kBoolean, name, words[0], words[1]);
    return words[1] == "1";
}

}  // namespace

Proxy::Proxy(std::string target, std::shared_ptr<Connection> connection, std::shared_ptr<const Settings> settings, Line line, PrincipalPointer relayFor)
    : target_(std::move(target)), connection_(std::move(connection)), shared_(std::move(settings)), line_(std::move(line)), seen_(line_.changes),
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
    if (!recipe_.empty()) setRecipe(recipe_, true);
}

void Proxy::forward(Method method, Message& m) {
    Connection& connection = line();
    if (!unsentRecipe_.empty()) {
        Message recipe;
        recipe.words = std::exchange(unsentRecipe_, {});
        forward(Method::ctrl, recipe);
    }
    const std::int64_t start = monotonicNow();
    Deadline deadline = settings_.timeout > 0 ? Deadline::at(start + settings_.timeout * 1'000'000) : Deadline();
    if (CallContext* outer = CallContext::current()) {
        struct Count {
            CallContext* outer;
            std::int64_t start;
            ~Count() { outer->subTime += std::uint32_t((monotonicNow() - start) / 1000); }
        } count{outer, start};
        connection.call(target_, method, m, deadline.earlier(CallContext::deadlineForCalls(start)), relayFor_ != nullptr, start);
    } else {
        connection.call(target_, method, m, deadline, relayFor_ != nullptr, start);
    }
    if (!notice_.empty()) [[unlikely]] sayNotice(m);
}

void Proxy::sayNotice(Message& m) {
    m.trail.add(makeEntry(kForgotten, {MessageArg::of(name()), MessageArg::of(std::exchange(notice_, {}))}));
}

bool Proxy::answers(Method method, Message& m) {
    if (method == Method::ctrl && m.words.size() == 2 && m.words[0] == "-restore") {
        restore_ = parseBoolean(name(), m.words);
        m.text = std::string("-restore ") + (restore_ ? "1" : "0");
        m.words.clear();
        return true;
    }
    if (method != Method::dbx || m.words.size() != 1 || m.words[0] != "-connection") return false;
    line();
    m.text = "proxy " + name() + " of " + target_ + "\n" + connection_->facts();
    m.text += "\nCTRL here " + std::to_string(set_.size()) + " times since the daemon began, -restore " + (restore_ ? "1" : "0");
    m.words.clear();
    return true;
}

void Proxy::carry(const PendingPointer& pending, Method method) {
    if (answers(method, pending->message)) return pending->answer();
    count();
    Connection& connection = line();
    if (!unsentRecipe_.empty()) {
        Message m;
        m.words = std::exchange(unsentRecipe_, {});
        async(Method::ctrl, std::move(m));
    }
    pending->relayed = relayFor_ != nullptr;
    pending->whenAnswered([self = Reference(this), this, p = pending.get(), words = method == Method::ctrl ? pending->message.words : Words()] {
        if (p->failed()) return;
        if (!words.empty()) remember(words);
        if (!notice_.empty()) sayNotice(p->message), review(p->message);
    });
    connection.begin(pending, target_, method);
}
void Proxy::oneway(Method method, Message request) { count(), line().oneway(target_, method, request, relayFor_ != nullptr); }

std::unique_ptr<Listening> Proxy::listen(std::string pattern, std::size_t keep, Listener listener) {
    Deadline deadline = Deadline::in(settings_.timeout).earlier(CallContext::currentDeadline());
    return line().listen(target_, std::move(pattern), keep, std::move(listener), deadline, relayFor_ != nullptr);
}

void Proxy::exec(Message& m) { forward(Method::exec, m); }
void Proxy::ctrl(Message& m) {
    if (answers(Method::ctrl, m)) return;
    Words words = m.words;
    forward(Method::ctrl, m);
    remember(std::move(words));
}

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
    if (words.size() >= 2 && words[0] == "-restore") {
        restore_ = parseBoolean(name(), words);
        words.erase(words.begin(), words.begin() + 2);
    }
    recipe_ = std::move(words);
    if (recipe_.empty()) return;
    // The daemon executes in order: what is called next finds the recipe applied.
    if (later) unsentRecipe_ = recipe_;
    else if (connection_->inEvents()) send(Method::ctrl, recipe_, nullptr, "its recipe");
    else forwardWords(Method::ctrl, recipe_);
    listenForRestart();
}

// ---- what this daemon has been told, and the next one does not know ----

void Proxy::listenForRestart() {
    if (restart_ == 0) restart_ = connection_->onRestart([this] { restarted(); });
}

void Proxy::remember(Words words) {
    constexpr std::size_t kMost = 100;
    if (words.size() < 2) return;                   // it has set nothing
    std::erase(set_, words);
    set_.push_back(std::move(words));
    if (set_.size() > kMost) set_.pop_front();
    listenForRestart();
}

std::string Proxy::forwardWords(Method method, Words words) {
    Message m;
    m.words = std::move(words);
    forward(method, m);
    return std::move(m.text);
}

// Now, or where nothing may block as soon as it can be. What fails is said with the next answer.
void Proxy::send(Method method, Words words, std::function<void(const std::string& text)> then, const char* why) {
    auto failed = [this, why](const std::string& what) { notice_ = std::string(why) + " could not be set again: " + what; };
    if (!connection_->inEvents()) {
        try {
            std::string text = forwardWords(method, std::move(words));
            if (then) then(text);
        } catch (const Error& e) {
            failed(e.what());
        }
        return;
    }
    Message m;
    m.words = std::move(words);
    auto pending = async(method, std::move(m)).pending();
    pending->whenAnswered([self = Reference(this), p = pending.get(), then = std::move(then), failed] {
        if (p->failed()) failed(p->failure.cause() ? p->failure.cause()->text : std::string());
        else if (then) then(p->message.text);
    });
}

void Proxy::restarted() {
    if (!recipe_.empty()) send(Method::ctrl, recipe_, nullptr, "its recipe");
    if (!set_.empty()) send(Method::dbx, {"-info", "options"}, [this](const std::string& text) { restore(text); }, "what CTRL had set");
}

// The last value of each option that CTRL has set here. Words that are no options are actions: those are not repeated.
void Proxy::restore(const std::string& options) {
    std::vector<std::pair<std::string, std::string>> values;
    for (auto& words : std::exchange(set_, {}))
        for (std::size_t i = 0; i + 1 < words.size() && options.find('{' + words[i] + ' ') != options.npos; i += 2) {
            std::erase_if(values, [&](auto& v) { return v.first == words[i]; });
            values.emplace_back(words[i], words[i + 1]);
        }
    if (values.empty()) return;
    Words all;
    std::string text;
    for (auto& [option, value] : values) {
        all.insert(all.end(), {option, value});
        for (auto& word : {option, value}) text += ' ', appendWord(text, word);
    }
    if (!restore_) {
        notice_ = "another daemon has answered since, and the options that CTRL had set here are lost:" + text;
        return;
    }
    send(Method::ctrl, all, [this, all](const std::string&) { remember(all); }, "what CTRL had set");
}

Class Proxy::describe() {
    return Class("proxy", "stands for a service object of another process", nullptr);
}

}  // namespace sorma
