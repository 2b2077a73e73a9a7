#include "comm/proxy.h"

#include "bus/ahead.h"
#include "bus/atEnd.h"
#include "bus/call.h"
#include "bus/requestText.h"
#include "bus/sorm.h"

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
    connection_->cancelRestart(restart_);
    connection_->cancelRestore(this);
    if (secrets_ > Secrets::some) sorm().endAwait(name());
}

void Proxy::setSecrets(Secrets secrets) {
    secrets_ = secrets;
}

void Proxy::learnSecrets() {
    secrets_ = Secrets::untold;
    auto pending = std::make_shared<Pending>(sorm(), patience(), nullptr, nullptr);
    pending->who = name();
    pending->message.words = {"-info", "secrets"};
    pending->relayFor = relayFor_;
    pending->whenAnswered([self = Reference(this), this, p = pending.get(), line = connection_.get(), doubts = connection_->doubts()] {
        if (p->failed() || self->gone()) return;    // perhaps it may not be told to us
        secrets_ = sorm().learnSecrets(p->message.text) ? Secrets::some : Secrets::none;
        sorm().endAwait(name());
        setFacts(std::move(p->message.ints), line == connection_.get() ? doubts : kUnasked);
    });
    connection_->begin(pending, target_, Method::dbx);
}

// ---- requests that are refused here ----

void Proxy::setFacts(std::vector<std::int64_t> facts, std::uint64_t doubts) {
    facts_ = facts.empty() ? nullptr : std::make_shared<Facts>(Facts{std::move(facts), doubts});
    known_ = nullptr;
    classes_ = 0;
}

// What is sent next does not wait for the answer.
void Proxy::askFacts() {
    facts_ = std::make_shared<Facts>(Facts{{}, kUnasked});
    known_ = nullptr;
    classes_ = 0;
    if (connection_->askFacts(target_, relayFor_, [facts = facts_](Message& answer) { facts->numbers = std::move(answer.ints); }))
        facts_->doubts = connection_->doubts();
}

void Proxy::checkByFacts(Method method, const Message& m) {
    if (!certain()) return askFacts();
    if (facts_->numbers.empty()) return;
    if (!known_ && classes_ != sorm().classChanges()) {
        classes_ = sorm().classChanges();
        if (auto* type = sorm().findClass(target_.substr(0, target_.find('.'))); type && ahead::fit(facts_->numbers, *type, target_)) known_ = type->shared_from_this();
    }
    if (!known_) return;
    try {
        ahead::check(*known_, target_, method, m, ahead::rightsIn(facts_->numbers));
    } catch (const Error&) {
        connection_->look();
        if (!certain()) return;
        Trail trail = trailOfCurrentException(target_);
        mark(trail, method, m);
        throw Error(std::move(trail));
    }
}

// As the daemon would.
void Proxy::mark(Trail& trail, Method method, const Message& m) const {
    constexpr std::size_t kLongest = 4096;
    std::size_t size = m.text.size() + 8 * (m.floats.size() + m.ints.size()) + m.any.size();
    for (auto& word : m.words) size += word.size();
    std::string request;
    if (size <= kLongest) appendRequest(request, target_, method, m);
    for (auto& e : trail.entries()) {
        e.daemon = connection_->daemon().name;
        e.request = sorm().masked(request);
    }
}

void Proxy::follow() {
    seen_ = line_.changes;
    std::shared_ptr<Connection> now;
    try {
        now = line_.find();
    } catch (const Error&) {            // its name leads nowhere any more; what it has works as long as it lasts
    }
    if (!now || now == connection_) return;
    connection_->cancelRestart(std::exchange(restart_, 0));
    connection_->cancelRestore(this);
    connection_ = std::move(now);
    if (facts_) facts_->doubts = kUnasked;
    if (recipe_.empty() && set_.empty()) return;
    untold_ = true;
    listenForRestart();
}

void Proxy::forward(Method method, Message& m) {
    Connection& connection = line();
    check(method, m);
    const std::int64_t start = monotonicNow();
    Deadline deadline = settings_.timeout > 0 ? Deadline::at(start + settings_.timeout * 1'000'000) : Deadline();
    if (CallContext* outer = CallContext::current()) {
        const AtEnd count([outer, start] { outer->subTime += std::uint32_t((monotonicNow() - start) / 1000); });
        connection.call(target_, method, m, deadline.earlier(CallContext::deadlineForCalls(start)), relayFor_, start);
    } else {
        connection.call(target_, method, m, deadline, relayFor_, start);
    }
    if (noticed()) [[unlikely]] sayNotice(m);
}

void Proxy::sayNotice(Message& m) {
    if (!notice_.empty()) m.trail.add(makeEntry(kForgotten, {MessageArg::of(name()), MessageArg::of(std::exchange(notice_, {}))}));
    m.trail.append(std::exchange(connection_->remarks(), {}));
}

bool Proxy::answers(Method method, Message& m) {
    if (method == Method::ctrl && m.words.size() == 2 && m.words[0] == "-restore") {
        restore_ = parseBoolean(name(), m.words);
        m.text = std::string("-restore ") + (restore_ ? "1" : "0");
        m.words.clear();
        return true;
    }
    if (method != Method::dbx || m.words.size() != 1 || m.words[0] != "-connection") return false;
    if (line_.changes != seen_) follow();
    m.text = "proxy " + name() + " of " + target_ + "\n" + connection_->facts();
    m.text += "\nCTRL here " + std::to_string(set_.size()) + " times since the daemon began, -restore " + (restore_ ? "1" : "0");
    m.words.clear();
    return true;
}

void Proxy::carry(const PendingPointer& pending, Method method) {
    if (answers(method, pending->message)) return pending->answer();
    count();
    Connection& connection = line();
    check(method, pending->message);
    pending->relayFor = relayFor_;
    pending->whenAnswered([self = Reference(this), this, p = pending.get(), words = method == Method::ctrl ? pending->message.words : Words()] {
        if (p->failed()) return;
        if (!words.empty()) remember(words);
        if (noticed()) sayNotice(p->message), review(p->message);
    });
    connection.begin(pending, target_, method);
}

void Proxy::oneway(Method method, Message request) {
    count();
    Connection& connection = line();
    check(method, request);
    connection.oneway(target_, method, request, relayFor_);
    if (method == Method::ctrl) remember(std::move(request.words));
}

std::unique_ptr<Listening> Proxy::listen(std::string pattern, std::size_t keep, Listener listener) {
    Deadline deadline = Deadline::in(settings_.timeout).earlier(CallContext::currentDeadline());
    return line().listen(target_, std::move(pattern), keep, std::move(listener), deadline, relayFor_);
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

void Proxy::setRecipe(std::vector<std::string> words, Probe probe) {
    if (words.size() >= 2 && words[0] == "-restore") {
        restore_ = parseBoolean(name(), words);
        words.erase(words.begin(), words.begin() + 2);
    }
    recipe_ = std::move(words);
    if (recipe_.empty()) return;
    untold_ = probe == Probe::later || connection_->inEvents();
    if (!untold_) {
        Message m;
        m.words = recipe_;
        forward(Method::ctrl, m);
    }
    listenForRestart();
}

// ---- what this daemon has been told, and the next one does not know ----

void Proxy::listenForRestart() {
    if (restart_ == 0) restart_ = connection_->onRestart([this] { restore(true); });
}

void Proxy::remember(Words words) {
    constexpr std::size_t kMost = 100;
    if (words.size() < 2) return;                   // it has set nothing
    std::erase(set_, words);
    set_.push_back(std::move(words));
    if (set_.size() > kMost) set_.pop_front();
    listenForRestart();
}

void Proxy::notice(const std::string& text) {
    if (!notice_.empty()) notice_ += "; ";
    notice_ += text;
}

void Proxy::send(Method method, Words words, std::string what, std::function<void(const Message&)> then) {
    connection_->restore(this, target_, method, std::move(words), relayFor_,
                         [this, what = std::move(what), then = std::move(then)](const Message& reply, const Trail& failure) {
                             if (!failure.empty()) notice(what + " could not be set again: " + (failure.cause() ? failure.cause()->text : std::string()));
                             else if (then) then(reply);
                         });
}

void Proxy::restore(bool here) {
    untold_ = false;
    if (!recipe_.empty()) send(Method::ctrl, recipe_, "its recipe");
    if (!set_.empty() && (here || restore_))
        send(Method::dbx, {"-info", "options"}, "what CTRL had set", [this](const Message& reply) { restoreValues(reply.text); });
}

// The last value of each option that CTRL has set here. Words that are no options are actions: those are not repeated.
void Proxy::restoreValues(const std::string& options) {
    std::deque<Words> values;
    for (auto& words : set_)
        for (std::size_t i = 0; i + 1 < words.size() && options.find('{' + words[i] + ' ') != options.npos; i += 2) {
            std::erase_if(values, [&](auto& v) { return v[0] == words[i]; });
            values.push_back({words[i], words[i + 1]});
        }
    // Kept until the daemon has them: it may end before.
    set_ = restore_ ? values : std::deque<Words>();
    if (values.empty()) return;
    Words all;
    std::string text;
    for (auto& value : values)
        for (auto& word : sorm().masked(value)) text += ' ', appendWord(text, word);
    for (auto& value : values) all.insert(all.end(), value.begin(), value.end());
    if (restore_) restoreValue(values.size(), std::move(all));
    else notice("another daemon has answered since, and the options that CTRL had set here are lost:" + text);
}

// All at once, since some options fit only together. When the daemon refuses that, each alone.
void Proxy::restoreValue(std::size_t count, Words words) {
    connection_->restore(this, target_, Method::ctrl, words, relayFor_, [this, count, words](const Message&, const Trail& failure) {
        if (failure.empty()) return;
        if (count > 1) {
            for (std::size_t i = 0; i + 1 < words.size(); i += 2) restoreValue(1, {words[i], words[i + 1]});
            return;
        }
        std::erase(set_, words);
        notice("what CTRL had set could not be set again: " + (failure.cause() ? failure.cause()->text : words[0]));
    });
}

Class Proxy::describe() {
    return Class("proxy", "stands for a service object of another process", nullptr);
}

}  // namespace sorma
