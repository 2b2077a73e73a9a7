#include "bus/service.h"

#include <algorithm>
#include <cmath>
#include <deque>

#include "bus/deadline.h"
#include "bus/listText.h"
#include "bus/requestText.h"
#include "bus/sorm.h"
#include "bus/statistics.h"

#ifndef SORMA_VERSION
#define SORMA_VERSION "1.0"
#endif

namespace sorma {

namespace {

const Prototype kUnknown{Severity::error, "OPTION UNKNOWN", 2, "{}: unknown word \"{}\": must be {}"};
const Prototype kMissing{Severity::error, "OPTION MISSING", 2, "{}: {} needs {}"};
const Prototype kReadonly{Severity::error, "OPTION READONLY", 2, "{}: {} can only be set by a recipe, when the object is made"};
const Prototype kNoWords{Severity::error, "REQUEST SYNTAX", 1, "{}: {} needs at least one word, try -help"};
const Prototype kRemoved{Severity::error, "SERVICE GONE", 1, "{}: the service object has been removed"};
const Prototype kCode{Severity::error, "SERVICE FAILED", 1, "{}: EXEC returned code {}"};
const Prototype kLater{Severity::error, "SERVICE FAILED", 1, "{}: it answers later, and so cannot be a step that others wait for"};
const Prototype kNothingToUndo{Severity::error, "SERVICE FAILED", 1, "{}: there is no CTRL to undo"};

const Prototype kLockedBy{Severity::error, "SERVICE LOCKED", 1, "{}: locked by {} since {}; it is freed by CTRL -unlock there, or when that client ends"};
const Prototype kNotLocked{Severity::error, "SERVICE LOCKED", 1, "{}: this client holds no lock of it"};

constexpr std::size_t kAuditLength = 100;

}  // namespace

// What only some objects ever need.
struct Service::Record {
    struct Source {                     // why an option has its value
        enum class Kind { initial, recipe, ctrl } kind = Kind::initial;
        Origin origin;                  // recipe
        std::string by, request;        // ctrl
        std::int64_t time = 0;
    };
    struct Undo {
        int option;
        Value value;
        Source source;
    };
    struct Audit {
        std::int64_t time;
        std::string by, request;
        bool done;
    };

    std::vector<Source> sources;        // one for each option
    std::vector<Undo> undo;             // what the last CTRL changed; empty when there is nothing to take back
    std::deque<Audit> audit;
    Histogram times;                    // of EXEC, one call in 64
    std::uint64_t errors = 0, ctrls = 0, dbxs = 0;
    std::int64_t since = monotonicNow();
    Trail trail;                        // of the last request that had one
    std::size_t underWay = 0;           // requests taken over
    std::deque<PendingPointer> waiting; // for them
    struct Lock {
        ClientPointer holder;           // null: this process
        Client::Lease lease = 0;
        std::string by;
        std::int64_t since = 0;
    } lock;                             // while guard_ has kLockedBit
};

// The requests that every class answers.
struct CommonRequests {
    static const std::vector<Action>& actions();
    static const std::vector<Action>& inspections();

    static void why(Service& s, Args args, Message& reply);
    static void diff(Service& s, Args args, Message& reply);
    static void stats(Service& s, Args args, Message& reply);
    static void info(Service& s, Args args, Message& reply);
    static void verbosity(Service& s, Args args, Message& reply);
    static void undo(Service& s, Args args, Message& reply);
    static void lock(Service& s, Args args, Message& reply);
    static void unlock(Service& s, Args args, Message& reply);
    static void freeLock(Service& s);
    static std::string optionsList(Service& s, std::string_view only);
    static std::string trailText(const Trail& trail);
    static std::string describe(const Service::Record::Source& source);
    static int needOption(Service& s, const std::string& name);
};

namespace {

void addLine(Message& reply, std::string_view line) {
    if (!reply.text.empty()) reply.text += '\n';
    reply.text += line;
}

const Action* findIn(const std::vector<Action>& actions, std::string_view name) {
    for (auto& a : actions)
        if (a.name == name) return &a;
    return nullptr;
}

// "-a, -b, or -c"
std::string oneOf(std::vector<std::string> words) {
    std::sort(words.begin(), words.end());
    std::string out;
    for (std::size_t i = 0; i < words.size(); ++i) {
        if (i > 0) out += words.size() > 2 ? ", " : " ";
        if (i > 0 && i + 1 == words.size()) out += "or ";
        out += words[i];
    }
    return out;
}

[[noreturn]] void failUnknown(const Service& s, std::string_view word, bool ctrl) {
    std::vector<std::string> known;
    if (ctrl)
        for (auto& o : s.type().options()) known.push_back(o.name);
    for (auto& a : ctrl ? s.type().actions() : s.type().inspections()) known.push_back(a.name);
    for (auto& a : ctrl ? CommonRequests::actions() : CommonRequests::inspections()) known.push_back(a.name);
    fail(kUnknown, s.name(), word, oneOf(std::move(known)));
}

// Takes the arguments of an action: the least it needs, then more while they are no words of the table.
template <class IsKnown>
Args takeArguments(const Service& s, const Action& action, const std::vector<std::string>& words, std::size_t at,
                   IsKnown isKnown) {
    std::size_t rest = words.size() - at, least = std::size_t(action.minArgs);
    if (rest < least) fail(kMissing, s.name(), action.name, "arguments: " + action.usage);
    std::size_t n = least;
    if (action.maxArgs == Action::kRest) n = rest;
    else
        while (n < std::size_t(action.maxArgs) && n < rest && !isKnown(words[at + n])) ++n;
    return Args(words).subspan(at, n);
}

}  // namespace

Service::Service() = default;
Service::~Service() = default;

std::vector<Pin> Service::pins(std::string_view, std::size_t) const {
    std::vector<Pin> out;
    auto add = [&](const std::vector<Part>& parts, bool input) {
        for (auto& p : parts)
            if (p.field == Field::floats)
                out.push_back({input ? "in" : "out", input, 0, p.count.low == p.count.high ? p.count.low : Pin::kOpen, p.unit, p.help});
    };
    add(class_->reads(), true);
    add(class_->writes(), false);
    return out;
}

std::vector<Reference> Service::parts() const {
    std::vector<Reference> out;
    for (auto& o : class_->options()) {
        if (o.type != Type::service) continue;
        if (Service* s = sorm_->find(std::get<std::string>(o.get(*this)))) out.emplace_back(s);
    }
    return out;
}

void Service::steer(Steering* steering) {
    steering_ = steering;
    setGuard(kSteeredBit, steering != nullptr);
}

// The steering thread does it on this one's behalf, and finds the caller of the request where it always is.
void Service::startLent(Method method, Message& m) {
    Error failure{Trail()};
    bool failed = false;
    Call* outer = Call::current();
    steering_->lend(*this, [&] {
        Call::Lent call(outer);
        try {
            start(method, m);
        } catch (...) {
            failure = Error(trailOfCurrentException(name_));
            failed = true;
        }
    });
    if (failed) throw failure;
}

// A step that cannot be taken as it is.
void Service::unusable(Message& m) {
    if (!m.later) fail(kCode, name_, m.code);
    if (!steering_) return awaitLater(m);
    std::exchange(m.later, nullptr)->cancel(Trail());
    fail(kLater, name_);
}

Service::Record& Service::record() {
    if (!record_) {
        record_ = std::make_unique<Record>();
        record_->sources.resize(class_->options().size());
    }
    return *record_;
}

void Service::failGone() const { fail(kRemoved, name_); }

bool Service::start(Method method, Message& m) {
    if (guard()) [[unlikely]] {
        if (gone()) failGone();
        if (steering_ && Steering::current() != steering_) return startLent(method, m), m.later != nullptr;
        if (method == Method::exec && (guard() & kLockedBit)) checkLock();
        if (method == Method::exec && (guard() & kBusyBit)) return enqueue(m), true;
    }
    try {
        enter(method, m);
    } catch (...) {
        if (m.later) std::exchange(m.later, nullptr)->finish();     // taken over, and then refused
        Trail trail = trailOfCurrentException(name_);
        noteFailure(trail);
        throw Error(std::move(trail));
    }
    if (m.later) [[unlikely]] return true;
    if (!m.trail.empty()) [[unlikely]] review(m);
    return false;
}

void Service::invoke(Method method, Message& m) {
    if (start(method, m)) [[unlikely]] awaitLater(m);
}

void Service::awaitLater(Message& m) {
    Future future(std::exchange(m.later, nullptr));
    std::swap(m, future.wait());
}

// ---- requests that take their time ----

Reply Service::later(Message& m) {
    auto pending = std::make_shared<Pending>(*sorm_, Call::currentDeadline(), Call::currentClient());
    pending->who = name_;
    pending->service = Reference(this);
    std::swap(pending->message, m);
    m.later = pending;
    ++record().underWay;
    if (class_->conduct() != Conduct::concurrent) setGuard(kBusyBit, true);
    return Reply(std::move(pending));
}

void Service::enqueue(Message& m) {
    auto pending = std::make_shared<Pending>(*sorm_, Call::currentDeadline(), Call::currentClient());
    pending->who = name_;
    std::swap(pending->message, m);
    m.later = pending;
    record().waiting.push_back(std::move(pending));
}

void Service::released() {
    auto& r = record();
    if (--r.underWay > 0 || class_->conduct() == Conduct::concurrent) return;
    setGuard(kBusyBit, false);
    Reference keep(this);
    while (!(guard() & (kBusyBit | kGoneBit)) && !r.waiting.empty()) {
        auto next = std::move(r.waiting.front());
        r.waiting.pop_front();
        perform(next, Method::exec);
    }
}

// A request that stands for itself, with nobody on the stack who waits for it.
void Service::perform(const PendingPointer& pending, Method method) {
    if (pending->answered()) return;
    Call call(pending->client ? pending->client->caller : Caller::self(), pending->deadline, pending->client);
    Message m;
    std::swap(m, pending->message);
    try {
        if (!start(method, m)) {
            std::swap(pending->message, m);
            return pending->answer();
        }
        auto inner = std::exchange(m.later, nullptr);
        pending->onCancel([inner] { Future(inner).cancel(); });
        inner->whenAnswered([pending, from = inner.get()] {
            if (from->failed()) return pending->answer(from->failure);
            std::swap(pending->message, from->message);
            pending->answer();
        });
    } catch (...) {
        pending->answer(trailOfCurrentException(name_));
    }
}

Future Service::async(Method method, Message request, Deadline deadline) {
    auto pending = std::make_shared<Pending>(*sorm_, (deadline.none() ? patience() : deadline).earlier(Call::currentDeadline()),
                                             Call::currentClient());
    pending->who = name_;
    pending->message = std::move(request);
    try {
        carry(pending, method);
    } catch (...) {
        pending->answer(trailOfCurrentException(name_));
    }
    return Future(std::move(pending));
}

void Service::carry(const PendingPointer& pending, Method method) {
    pending->mailbox->post([pending, method, self = Reference(this)] { self->perform(pending, method); });
    if (pending->deadline.none() || pending->deadline.when() == INT64_MAX || !sorm_->hasLoop()) return;
    Loop& loop = sorm_->loop();
    std::uint64_t timer = loop.after(pending->deadline.when(), [weak = std::weak_ptr(pending)] {
        if (auto p = weak.lock()) p->expire();
    });
    pending->whenAnswered([sorm = sorm_, box = pending->mailbox, timer] {
        if (box->owner && sorm->hasLoop()) sorm->loop().cancel(timer);
    });
}

void Service::oneway(Method method, Message request) { async(method, std::move(request)); }

void Service::left() {
    setGuard(kGoneBit, true);
    Reference keep(this);
    if (steering_ && Steering::current() != steering_) {
        try {
            return steering_->lend(*this, [this] { leave(); });
        } catch (const Error&) {        // it hangs in a step; what is under way there cannot be ended
        }
    }
    leave();
}

void Service::leave() {
    if (guard() & kLockedBit) {
        auto& lock = record().lock;
        if (lock.holder) lock.holder->release(lock.lease);
        setGuard(kLockedBit, false);
    }
    if (record_) {
        for (auto& pending : std::exchange(record_->waiting, {})) {
            Trail trail;
            trail.add(makeEntry(kRemoved, {MessageArg::of(name_)}));
            pending->answer(std::move(trail));
        }
    }
    try {
        leaving();
    } catch (...) {                     // nobody is left to hear it
    }
    stream_.reset();
}

std::size_t Service::underWay() const { return record_ ? record_->underWay + record_->waiting.size() : 0; }

void Service::subscribe(Subscriber* subscriber, std::string pattern) {
    if (gone()) failGone();
    if (!stream_) stream_ = std::make_unique<Stream>();
    stream_->add(subscriber, std::move(pattern));
}

void Service::unsubscribe(Subscriber* subscriber) {
    if (stream_) stream_->remove(subscriber);
}

namespace {

class LocalListening : public Listening, public Subscriber {
public:
    LocalListening(Reference object, std::string pattern, std::shared_ptr<Inbox> inbox)
        : object_(std::move(object)), inbox_(std::move(inbox)) {
        object_->subscribe(this, std::move(pattern));
    }
    ~LocalListening() override {
        inbox_->close();
        if (object_) object_->unsubscribe(this);
    }
    void event(const Event& e) override {
        inbox_->push({std::string(e.object), std::string(e.name), e.message, ++number_, 0, e.time});
    }
    void gone() override {
        Reference was = std::exchange(object_, Reference());
        inbox_->push({was->name(), "sorma.gone", {}, ++number_, 0, wallNow()});
    }

private:
    Reference object_;
    std::shared_ptr<Inbox> inbox_;
    std::uint64_t number_ = 0;
};

}  // namespace

std::unique_ptr<Listening> Service::listen(std::string pattern, std::size_t keep, Listener listener) {
    return std::make_unique<LocalListening>(Reference(this), std::move(pattern),
                                            std::make_shared<Inbox>(sorm_->mailbox(), keep, std::move(listener)));
}

// ---- locks: a client keeps others from EXEC and from setting options; what stops or inspects stays open to all ----

void Service::checkLock() const {
    auto& lock = record_->lock;
    if (lock.holder != Call::currentClient()) fail(kLockedBy, name_, lock.by, clockText(lock.since));
}

void CommonRequests::lock(Service& s, Args, Message& reply) {
    if (s.guard() & Service::kLockedBit) {
        s.checkLock();
    } else {
        auto& lock = s.record().lock;
        lock.holder = Call::currentClient();
        lock.by = Call::currentCaller().toText();
        lock.since = wallNow();
        s.setGuard(Service::kLockedBit, true);
        if (lock.holder)
            lock.lease = lock.holder->hold([self = Reference(&s)] {
                if (self->guard() & Service::kLockedBit) CommonRequests::freeLock(*self);
            });
    }
    addLine(reply, "locked by " + s.record().lock.by);
}

void CommonRequests::freeLock(Service& s) {
    s.setGuard(Service::kLockedBit, false);
    s.record().lock = {};
}

void CommonRequests::unlock(Service& s, Args, Message&) {
    if (!(s.guard() & Service::kLockedBit)) fail(kNotLocked, s.name());
    s.checkLock();
    auto holder = s.record().lock.holder;
    auto lease = s.record().lock.lease;
    freeLock(s);
    if (holder) holder->release(lease);
}

void Service::enter(Method method, Message& m) {
    if (method == Method::exec) [[likely]] {
        if (checks_) class_->checkRequest(name_, m);
        count();
        if ((calls() & 63) == 1) [[unlikely]] timed(method, m);
        else exec(m);
        if (m.later) [[unlikely]] return;
        if (!m.words.empty()) m.words.clear();      // words go in, never out
        if (m.code < 0) [[unlikely]] fail(kCode, name_, m.code);
        return;
    }
    if (m.words.empty()) fail(kNoWords, name_, toText(method));
    if (method == Method::ctrl) {
        ++record().ctrls;
        ctrl(m);
    } else {
        ++record().dbxs;
        dbx(m);
    }
    m.words.clear();
}

// The clock costs as much as the call, so only one call in 64 pays for it.
void Service::timed(Method, Message& m) {
    std::int64_t start = monotonicNow();
    exec(m);
    record().times.add(monotonicNow() - start);
}

void Service::noteFailure(const Trail& trail) {
    Record& r = record();
    ++r.errors;
    r.trail = trail;
    sorm_->announce(trail);
}

void Service::review(Message& m) {
    if (m.trail.empty()) return;
    auto& entries = m.trail.entries();
    for (auto& e : entries)
        if (e.so.empty()) e.so = name_;
    auto tooQuiet = [&](const Entry& e) {
        return (e.severity == Severity::verbose && verbosity_ < 2) || (e.severity == Severity::warning && verbosity_ < 1);
    };
    std::erase_if(entries, tooQuiet);
    if (!entries.empty()) {
        record().trail = m.trail;
        sorm_->announce(m.trail);
        if (m.code == 0 && std::any_of(entries.begin(), entries.end(), [](auto& e) { return e.severity != Severity::verbose; }))
            m.code = 1;
    }
}

// Apply words of CTRL, all or nothing. Options are parsed and checked first, then set together, then actions run.
void Service::configure(const std::vector<DictionaryWord>& recipe, bool birth, const std::string& request, Message* reply) {
    struct Setting {
        int option;
        Value value;
        const Origin* origin;
    };
    struct Step {
        const Action* action;
        Args args;
    };
    std::vector<Setting> settings;
    std::vector<Step> steps;
    std::vector<std::string> words;
    words.reserve(recipe.size());
    for (auto& w : recipe) words.push_back(w.text);

    auto known = [&](const std::string& word) {
        return class_->findOption(word) >= 0 || class_->findAction(word) || findIn(CommonRequests::actions(), word);
    };
    for (std::size_t i = 0; i < words.size();) {
        const std::string& word = words[i];
        const Origin* origin = &recipe[i].origin;
        ++i;
        if (int index = class_->findOption(word); index >= 0) {
            const Option& o = class_->options()[index];
            if (o.spec.fixed && !birth) fail(kReadonly, name_, o.name);
            if (o.type == Type::flag) {
                bool given = i < words.size() && !words[i].starts_with('-');     // a flag alone is set
                settings.push_back({index, o.parse(name_, given ? std::string_view(words[i++]) : "1"), origin});
                continue;
            }
            if (i == words.size()) {
                std::string what = std::string("a value: ") + toText(o.type);
                if (!o.spec.unit.empty()) what += " [" + o.spec.unit + "]";
                if (auto r = o.range(); !r.empty()) what += ", " + r;
                fail(kMissing, name_, o.name, what);
            }
            settings.push_back({index, o.parse(name_, words[i++]), origin});
            continue;
        }
        const Action* action = class_->findAction(word);
        if (!action) action = findIn(CommonRequests::actions(), word);
        if (!action) failUnknown(*this, word, true);
        Args args = takeArguments(*this, *action, words, i, known);
        i += args.size();
        steps.push_back({action, args});
    }

    std::vector<Record::Undo> before;
    if (!birth && !settings.empty() && (guard() & kLockedBit)) checkLock();
    if (!settings.empty()) {
        Record& r = record();
        std::vector<const Option*> changedOptions;
        auto putBack = [&] {
            for (auto u = before.rbegin(); u != before.rend(); ++u) class_->options()[u->option].set(*this, u->value);
        };
        try {
            for (auto& s : settings) {
                const Option& o = class_->options()[s.option];
                before.push_back({s.option, o.get(*this), r.sources[s.option]});
                o.set(*this, s.value);
                if (std::find(changedOptions.begin(), changedOptions.end(), &o) == changedOptions.end())
                    changedOptions.push_back(&o);
            }
            if (!birth) changed(changedOptions);
        } catch (...) {
            putBack();
            throw;
        }
        std::string by = birth ? std::string() : Call::currentCaller().toText();
        for (auto& s : settings) {
            auto& source = r.sources[s.option];
            source.kind = birth ? Record::Source::Kind::recipe : Record::Source::Kind::ctrl;
            source.origin = birth ? *s.origin : Origin{};
            source.by = by;
            source.request = request;
            source.time = wallNow();
        }
        if (!birth) r.undo = std::move(before);
    }
    for (auto& step : steps) {
        Message none;
        step.action->body(*this, step.args, reply ? *reply : none);
    }
}

void Service::ctrl(Message& m) {
    std::vector<DictionaryWord> words;
    words.reserve(m.words.size());
    for (auto& w : m.words) words.push_back({w, {}});
    std::string request = joinWords(m.words);
    m.text.clear();
    bool done = false;
    auto note = [&] {
        auto& audit = record().audit;
        if (audit.size() == kAuditLength) audit.pop_front();
        audit.push_back({wallNow(), Call::currentCaller().toText(), request, done});
    };
    try {
        configure(words, false, request, &m);
        done = true;
    } catch (...) {
        note();
        throw;
    }
    note();
}

void Service::dbx(Message& m) {
    std::vector<std::string> words;
    words.swap(m.words);
    m.text.clear();
    struct Step {
        const Action* action;
        Args args;
    };
    std::vector<Step> steps;
    auto find = [&](std::string_view word) {
        const Action* a = class_->findInspection(word);
        return a ? a : findIn(CommonRequests::inspections(), word);
    };
    for (std::size_t i = 0; i < words.size();) {
        const Action* action = find(words[i]);
        if (!action) failUnknown(*this, words[i], false);
        Args args = takeArguments(*this, *action, words, i + 1, find);
        i += 1 + args.size();
        steps.push_back({action, args});
    }
    for (auto& step : steps) step.action->body(*this, step.args, m);
}

std::string Service::dump() const {
    std::string out;
    for (auto& o : class_->options()) {
        if (!out.empty()) out += '\n';
        out += o.name;
        appendWord(out, toText(o.get(*this)));
    }
    std::string state;
    dumpState(state);
    if (!state.empty()) {
        if (state.back() == '\n') state.pop_back();
        out += (out.empty() ? "" : "\n") + state;
    }
    return out;
}

std::string Service::recipe() const {
    std::string out;
    for (std::size_t i = 0; i < class_->options().size(); ++i) {
        auto& o = class_->options()[i];
        Value now = o.get(*this);
        if (i < class_->defaults().size() && now == class_->defaults()[i]) continue;
        appendWord(out, o.name);
        appendWord(out, toText(now));
    }
    return out;
}

Reference subService(Service& user, const std::string& name) {
    return name.empty() ? Reference() : user.sorm().get(name);
}

// ---- what every class answers ----

int CommonRequests::needOption(Service& s, const std::string& name) {
    int index = s.type().findOption(name);
    if (index < 0) {
        std::vector<std::string> known;
        for (auto& o : s.type().options()) known.push_back(o.name);
        fail(kUnknown, s.name(), name, known.empty() ? "(this class has no options)" : oneOf(std::move(known)));
    }
    return index;
}

std::string CommonRequests::describe(const Service::Record::Source& source) {
    using Kind = Service::Record::Source::Kind;
    switch (source.kind) {
        case Kind::initial: return "default";
        case Kind::recipe: return "recipe " + source.origin.toText();
        case Kind::ctrl: return "CTRL " + source.request + ", by " + source.by + " at " + clockText(source.time);
    }
    return {};
}

void CommonRequests::why(Service& s, Args args, Message& reply) {
    int index = needOption(s, args[0]);
    Service::Record::Source none;
    auto& source = s.record_ ? s.record_->sources[index] : none;
    std::string line = args[0];
    appendWord(line, toText(s.type().options()[index].get(s)));
    addLine(reply, line + ": " + describe(source));
}

void CommonRequests::diff(Service& s, Args, Message& reply) {
    // What the recipe gives today, the last word for each option.
    std::vector<std::pair<int, std::string>> recipe;
    auto words = s.sorm().dictionary().expand(s.name());
    for (std::size_t i = 0; i < words.size(); ++i) {
        int index = s.type().findOption(words[i].text);
        if (index < 0) continue;
        std::string value = "1";
        bool flag = s.type().options()[index].type == Type::flag;
        if (i + 1 < words.size() && (!flag || !words[i + 1].text.starts_with('-'))) value = words[++i].text;
        std::erase_if(recipe, [&](auto& p) { return p.first == index; });
        recipe.emplace_back(index, value);
    }
    bool any = false;
    for (std::size_t i = 0; i < s.type().options().size(); ++i) {
        auto& o = s.type().options()[i];
        std::string wanted = i < s.type().defaults().size() ? toText(s.type().defaults()[i]) : std::string();
        const char* source = "default";
        for (auto& [index, value] : recipe)
            if (index == int(i)) {
                source = "recipe";
                try {
                    wanted = toText(o.parse(s.name(), value));
                } catch (const Error&) {
                    wanted = value;     // the recipe has become wrong: show it as it stands
                }
            }
        std::string now = toText(o.get(s));
        if (now == wanted) continue;
        std::string line = o.name;
        line += std::string(": ") + source;
        appendWord(line, wanted);
        line += ", now";
        appendWord(line, now);
        addLine(reply, line);
        any = true;
    }
    if (!any) addLine(reply, "as its recipe says");
}

void CommonRequests::stats(Service& s, Args, Message& reply) {
    auto& r = s.record();
    double seconds = double(monotonicNow() - r.since) / 1e9;
    addLine(reply, "EXEC " + std::to_string(s.calls()) + " CTRL " + std::to_string(r.ctrls) + " DBX " +
                       std::to_string(r.dbxs) + " errors " + std::to_string(r.errors));
    char rate[64];
    std::snprintf(rate, sizeof rate, "EXEC per second %.3g (since statistics began, %.3g s)",
                  seconds > 0 ? double(s.calls()) / seconds : 0.0, seconds);
    addLine(reply, rate);
    if (r.times.count() > 0) {
        addLine(reply, "time of EXEC, one call in 64: p50 <= " + durationText(double(r.times.quantile(0.5))) + ", p99 <= " +
                           durationText(double(r.times.quantile(0.99))));
        addLine(reply, r.times.toText());
    }
}

void CommonRequests::verbosity(Service& s, Args args, Message& reply) {
    static const Prototype kVerbosity{Severity::error, "OPTION RANGE", 2, "{}: {} {} is outside 0 .. 2"};
    if (!args.empty()) {
        std::int64_t level = 0;
        if (!parseNumber(args[0], level) || level < 0 || level > 2) fail(kVerbosity, s.name(), "-verbosity", args[0]);
        s.verbosity_ = std::uint8_t(level);
    }
    addLine(reply, "-verbosity " + std::to_string(int(s.verbosity_)));
}

void CommonRequests::undo(Service& s, Args, Message& reply) {
    auto& r = s.record();
    if (s.guard() & Service::kLockedBit) s.checkLock();
    if (r.undo.empty()) fail(kNothingToUndo, s.name());
    std::vector<Service::Record::Undo> now;
    std::vector<const Option*> changed;
    std::string line;
    try {
        for (auto u = r.undo.rbegin(); u != r.undo.rend(); ++u) {
            auto& o = s.type().options()[u->option];
            now.push_back({u->option, o.get(s), r.sources[u->option]});
            o.set(s, u->value);
            r.sources[u->option] = u->source;
            changed.push_back(&o);
        }
        s.changed(changed);
    } catch (...) {
        for (auto n = now.rbegin(); n != now.rend(); ++n) {
            s.type().options()[n->option].set(s, n->value);
            r.sources[n->option] = n->source;
        }
        throw;
    }
    r.undo.clear();
    for (auto* o : changed) {
        appendWord(line, o->name);
        appendWord(line, toText(o->get(s)));
    }
    addLine(reply, line);
}

std::string CommonRequests::optionsList(Service& s, std::string_view only) {
    std::string list;
    for (std::size_t i = 0; i < s.type().options().size(); ++i) {
        auto& o = s.type().options()[i];
        if (!only.empty() && o.name != only) continue;
        std::string item;
        for (auto& field : {o.name, std::string(toText(o.type)), o.spec.unit, o.range(),
                            i < s.type().defaults().size() ? toText(s.type().defaults()[i]) : std::string(),
                            toText(o.get(s)), o.spec.help})
            appendListElement(item, field);
        appendListElement(list, item);
    }
    return list;
}

// A list of dicts, as `sorma::trail` gives it.
std::string CommonRequests::trailText(const Trail& trail) {
    std::string list;
    for (auto& e : trail.entries()) {
        std::string item, code = "SORMA " + e.symbol;
        for (auto& d : e.details) appendListElement(code, d);
        auto put = [&](std::string_view key, std::string_view value) {
            appendListElement(item, key);
            appendListElement(item, value);
        };
        put("severity", toText(e.severity));
        put("code", code);
        put("text", e.text);
        put("so", e.so);
        put("daemon", e.daemon);
        put("file", e.file);
        put("line", std::to_string(e.line));
        put("time", std::to_string(e.time));
        if (!e.request.empty()) put("request", e.request);
        appendListElement(list, item);
    }
    return list;
}

// Plain values for `NAME info ...`, as Tcl lists where there is more than one.
void CommonRequests::info(Service& s, Args args, Message& reply) {
    static const Prototype kInfo{Severity::error, "REQUEST SYNTAX", 2, "{}: bad info \"{}\": must be actions, class, dump, "
                                 "example, help, inspections, location, methods, name, options, purpose, signature, trail, or version"};
    const std::string& what = args[0];
    auto actionList = [&](const std::vector<Action>& own, const std::vector<Action>& common) {
        std::string list;
        for (auto* set : {&own, &common})
            for (auto& a : *set) {
                std::string item;
                for (auto& field : {a.name, a.usage, a.help}) appendListElement(item, field);
                appendListElement(list, item);
            }
        return list;
    };
    std::string out;
    if (what == "options") out = optionsList(s, args.size() > 1 ? std::string_view(args[1]) : std::string_view());
    else if (what == "class") out = s.type().name();
    else if (what == "purpose") out = s.type().purpose();
    else if (what == "name") out = s.name();
    else if (what == "location") out = s.location();
    else if (what == "version") out = s.type().version();
    else if (what == "methods") out = "EXEC CTRL DBX";
    else if (what == "signature") out = s.type().signatureText();
    else if (what == "example") out = s.type().example();
    else if (what == "help") out = s.type().helpText(s.name());
    else if (what == "dump") out = s.dump();
    else if (what == "trail") out = trailText(s.record().trail);
    else if (what == "actions") out = actionList(s.type().actions(), actions());
    else if (what == "inspections") out = actionList(s.type().inspections(), inspections());
    else fail(kInfo, s.name(), what);
    reply.text += out;
}

const std::vector<Action>& CommonRequests::actions() {
    static const std::vector<Action> list = {
        {"-help", "", "purpose, options, signature, example", 0, 0,
         [](Service& s, Args, Message& m) { addLine(m, s.type().helpText(s.name())); }},
        {"-dump", "", "all state inside, as CTRL would read it again", 0, 0,
         [](Service& s, Args, Message& m) { addLine(m, s.dump()); }},
        {"-save", "", "write the options as this name's recipe into the dictionary", 0, 0,
         [](Service& s, Args, Message& m) {
             s.sorm().dictionary().add(s.name(), splitWords(s.recipe()), Call::currentCaller().toText());
             std::string line;
             appendWord(line, s.name());
             addLine(m, line + " " + s.recipe());
         }},
        {"-selftest", "", "check itself", 0, 0,
         [](Service& s, Args, Message& m) { addLine(m, s.selftest()); }},
        {"-undo", "", "take back the last CTRL that set options", 0, 0, undo},
    };
    return list;
}

const std::vector<Action>& CommonRequests::inspections() {
    static const std::vector<Action> list = {
        {"-why", "option", "where the value of an option comes from", 1, 1, why},
        {"-diff", "", "state against recipe", 0, 0, diff},
        {"-version", "", "build and revision", 0, 0,
         [](Service& s, Args, Message& m) {
             addLine(m, s.type().name() + " " + s.type().version() + ", SORMA " SORMA_VERSION ", compiled by " __VERSION__);
         }},
        {"-class", "", "facts of the class", 0, 0,
         [](Service& s, Args, Message& m) {
             auto& c = s.type();
             addLine(m, c.name() + ": " + c.purpose());
             addLine(m, "declared at " + c.file() + ":" + std::to_string(c.line()) + ", version " + c.version());
             if (auto t = c.signatureText(); !t.empty()) addLine(m, t);
             if (c.isRealtime()) addLine(m, "real-time: its EXEC may be a step of a cycle");
             if (!c.hasFeedthrough()) addLine(m, "without feedthrough: it may close a loop of a circuit");
         }},
        {"-audit", "", "who sent which CTRL, and when", 0, 0,
         [](Service& s, Args, Message& m) {
             for (auto& a : s.record().audit)
                 addLine(m, clockText(a.time) + " " + a.by + (a.done ? ": CTRL " : " (refused): CTRL ") + a.request);
         }},
        {"-verbosity", "?0..2?", "messages that are kept: 0 errors, 1 and warnings, 2 and verbose", 0, 1, verbosity},
        {"-stats", "", "call counts, rates, histogram of times", 0, 0, stats},
        {"-pins", "?pin length?", "where wires of a circuit end: name, in or out, at, length, unit, help", 0, 2,
         [](Service& s, Args args, Message& m) {
             std::int64_t n = 0;
             if (args.size() == 1 || (args.size() == 2 && (!parseNumber(args[1], n) || n < 0)))
                 fail(kMissing, s.name(), "-pins", "a pin, and its length");
             for (auto& pin : args.empty() ? s.pins() : s.pins(args[0], std::size_t(n))) addLine(m, pin.toText());
         }},
        {"-trail", "", "messages of the last request that had any", 0, 0,
         [](Service& s, Args, Message& m) { addLine(m, s.record().trail.toText()); }},
        {"-info", "what ?option?", "plain values for programs", 1, 2, CommonRequests::info},
        {"-get", "option", "value of one option", 1, 1,
         [](Service& s, Args args, Message& m) {
             m.text += toText(s.type().options()[CommonRequests::needOption(s, args[0])].get(s));
         }},
    };
    return list;
}

Class& Class::conduct(Conduct conduct) {
    if (conduct == Conduct::exclusive && !findAction("-lock")) {
        action({"-lock", "", "keep other clients from EXEC and from setting options, until -unlock or this client's end", 0, 0,
                CommonRequests::lock});
        action({"-unlock", "", "free the lock", 0, 0, CommonRequests::unlock});
    }
    conduct_ = conduct;
    return *this;
}

}  // namespace sorma
