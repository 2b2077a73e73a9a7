#include "bus/sorm.h"

#include <algorithm>
#include <mutex>

#include "bus/deadline.h"
#include "bus/glob.h"
#include "bus/requestText.h"

namespace sorma {

Class describeDict();
Class describeSorm();

namespace {

const Prototype kUnknownClass{Severity::error, "NAME UNKNOWN_CLASS", 1,
                              "unknown service class \"{}\" in \"{}\": no package sorma::service::{} was found either"};
const Prototype kDuplicate{Severity::error, "CLASS DUPLICATE", 1, "service class \"{}\" is registered already, from {}:{}"};
const Prototype kClassName{Severity::error, "NAME SYNTAX", 1, "bad class name \"{}\": must be lower-case letters, digits and _"};
const Prototype kCycle{Severity::error, "SERVICE CYCLE", 1, "{}: sub-services form a cycle: {}"};
const Prototype kFailed{Severity::error, "SERVICE FAILED", 1, "{}: the constructor of class {} failed: {}"};
const Prototype kThread{Severity::error, "SERVICE THREAD", 1,
                        "{}: a step of a cycle can make and remove no objects; ask for it by sorm().mailbox()"};
const Prototype kGone{Severity::error, "SERVICE GONE", 1, "{}: there is no such service object"};
const Prototype kExists{Severity::error, "SERVICE EXISTS", 1, "{}: the service object exists already; use CTRL to change it"};
const Prototype kProtected{Severity::error, "SERVICE PROTECTED", 1, "{}: belongs to the SORM and cannot be removed"};
const Prototype kDenied{Severity::error, "COMM DENIED", 1, "{}: this interpreter is safe and may not use the network; "
                        "its parent can grant it: sorma::grant INTERP -network 1"};
const Prototype kNoLoop{Severity::error, "SERVICE FAILED", 0, "this program has no event loop: it was built without COMM"};
const Prototype kNoNetwork{Severity::error, "COMM REFUSED", 1, "{}: this program was built without COMM, only local names work"};

struct Bindings {
    std::mutex mutex;
    std::unordered_map<const void*, Sorm*> sorms;
};
Bindings& bindings() {
    static Bindings b;
    return b;
}

// A thread that steers objects has no business in the repository while it runs a tick.
bool onForeignThread() { return Steering::current() && !Steering::current()->hasLoan(); }

}  // namespace

Sorm::Sorm(Host* host) : host_(host) {
    add(describeDict());
    add(describeSorm());
    mailbox_->owner = this;
    makeLocal("sorm", "sorm", nullptr);
    self_ = find("sorm");
    makeLocal("dict", "dict", nullptr);
}

Sorm::~Sorm() {
    {
        std::lock_guard lock(bindings().mutex);
        for (auto* key : keys_) bindings().sorms.erase(key);
    }
    // Objects may refer to each other and look at the SORM in their destructors: let go of them one by one.
    recent_ = {};
    self_ = nullptr;
    while (!repository_.empty()) {
        Reference r = std::move(repository_.begin()->second);
        repository_.erase(repository_.begin());
        if (!r->gone()) r->left();
    }
    mailbox_->close();
}

Sorm* Sorm::of(const void* key) {
    std::lock_guard lock(bindings().mutex);
    auto found = bindings().sorms.find(key);
    return found == bindings().sorms.end() ? nullptr : found->second;
}

void Sorm::bindTo(const void* key) {
    std::lock_guard lock(bindings().mutex);
    bindings().sorms[key] = this;
    keys_.push_back(key);
}

// ---- classes ----

void Sorm::add(Class type) {
    Name parsed;
    try {
        parsed = Name::parse(type.name());
    } catch (const Error&) {
    }
    if (parsed.service != type.name() || !parsed.flavor.empty() || !parsed.local()) fail(kClassName, type.name());
    if (auto* known = findClass(type.name())) fail(kDuplicate, type.name(), known->file(), known->line());
    std::string name = type.name();
    classes_.emplace(std::move(name), std::make_unique<Class>(std::move(type)));
}

const Class* Sorm::findClass(std::string_view name) const {
    auto found = classes_.find(name);
    return found == classes_.end() ? nullptr : found->second.get();
}

const Class& Sorm::needClass(const std::string& name) {
    const Class* known = findClass(name);
    if (!known && host_ && host_->loadClass(name)) known = findClass(name);
    if (!known) fail(kUnknownClass, name, name, name);
    return *known;
}

std::vector<const Class*> Sorm::classes() const {
    std::vector<const Class*> out;
    for (auto& [name, type] : classes_) out.push_back(type.get());
    return out;
}

void Sorm::forget(std::string_view name) {
    auto found = classes_.find(name);
    if (found == classes_.end()) return;
    forgotten_.push_back(std::move(found->second));
    classes_.erase(found);
}

// ---- repository and plant ----

Reference Sorm::get(std::string_view text) {
    if (auto* known = find(text)) return Reference(known);
    return make(Name::parse(text), nullptr);
}

Reference Sorm::create(std::string_view text, const std::vector<std::string>& words) {
    if (find(text)) fail(kExists, text);
    return make(Name::parse(text), &words);
}

Reference Sorm::make(const Name& name, const std::vector<std::string>* words) {
    if (onForeignThread()) fail(kThread, name.toText());
    if (name.local()) return makeLocal(name.service, name.className, words);
    Address address = resolve(name, dictionary_);
    std::string key = name.toText();
    if (address.kind == Address::Kind::self) {
        Reference here = words ? makeLocal(name.service, name.className, words) : get(name.service);
        if (!here->gone()) keep(key, here);     // the name with its address is a second name
        return here;
    }
    if (!permissions.network) fail(kDenied, key);
    if (!makeProxy) fail(kNoNetwork, key);
    if (auto* known = find(key)) return Reference(known);
    std::vector<std::string> recipe;
    for (auto& w : dictionary_.expand(key)) recipe.push_back(w.text);
    if (words) recipe.insert(recipe.end(), words->begin(), words->end());
    Reference made = adopt(makeProxy(name, address, std::move(recipe)), key, *findClass("proxy"));
    keep(key, made);
    return made;
}

Reference Sorm::adopt(std::unique_ptr<Service> service, const std::string& name, const Class& type) {
    Service* s = service.release();
    Reference reference(s);
    s->name_ = name;
    s->class_ = &type;
    s->sorm_ = this;
    s->checks_ = type.checksRequests();
    return reference;
}

Reference Sorm::makeLocal(const std::string& name, const std::string& className, const std::vector<std::string>* words) {
    if (auto* known = find(name)) {
        if (words) fail(kExists, name);
        return Reference(known);
    }
    if (std::find(births_.begin(), births_.end(), name) != births_.end()) {
        std::string chain;
        for (auto at = std::find(births_.begin(), births_.end(), name); at != births_.end(); ++at) chain += *at + " -> ";
        fail(kCycle, name, chain + name);
    }
    const Class& type = needClass(className);
    births_.push_back(name);
    struct Popper {
        std::vector<std::string>& births;
        ~Popper() { births.pop_back(); }
    } popper{births_};

    std::unique_ptr<Service> fresh;
    try {
        fresh = type.make();
    } catch (const Error&) {
        throw;
    } catch (const std::exception& e) {
        fail(kFailed, name, className, e.what());
    } catch (...) {
        fail(kFailed, name, className, "an exception of unknown type");
    }
    Reference made = adopt(std::move(fresh), name, type);
    type.learnDefaults(*made);
    auto recipe = dictionary_.expand(name);
    if (words)
        for (auto& w : *words) recipe.push_back({w, Origin{{}, 0, {}, Call::currentCaller().toText()}});
    Message reply;
    try {
        if (!recipe.empty()) made->configure(recipe, true, {}, &reply);
        made->born();
    } catch (...) {
        throw Error(trailOfCurrentException(name));
    }
    keep(name, made);
    announce("object.made", name, {className});
    return made;
}

void Sorm::keep(const std::string& key, const Reference& service) {
    drop(key);
    repository_.emplace(key, service);
    ++service->names_;
}

void Sorm::drop(const std::string& key) {
    auto found = repository_.find(key);
    if (found == repository_.end()) return;
    Reference service = std::move(found->second);       // it may end with this function, and look at us then
    recent(key) = {};
    repository_.erase(found);
    --service->names_;
}

void Sorm::remove(std::string_view name) {
    if (onForeignThread()) fail(kThread, name);
    auto found = repository_.find(name);
    if (found == repository_.end()) fail(kGone, name);
    Reference service = found->second;
    if (service->name() == "sorm" || service->name() == "dict") fail(kProtected, name);
    std::string own = service->name();
    std::vector<std::string> leaving;
    if (own == name) {
        service->left();
        if (service->names_ > 1) {
            for (auto& [key, value] : repository_)
                if (value.get() == service.get()) leaving.push_back(key);
        } else {
            leaving.push_back(own);
        }
    } else {
        leaving.emplace_back(name);
    }
    for (auto& key : leaving) drop(key);
    if (host_)
        for (auto& key : leaving) host_->removed(key);
    if (own == name) announce("object.removed", own);
}

void Sorm::alias(std::string_view name, std::string_view target) {
    if (find(name)) fail(kExists, name);
    Name parsed = Name::parse(name);
    Reference service = get(target);
    keep(parsed.toText(), service);
}

std::vector<std::string> Sorm::names(std::string_view pattern) const {
    std::vector<std::string> out;
    for (auto& [name, service] : repository_)
        if (globMatch(pattern, name)) out.push_back(name);
    std::sort(out.begin(), out.end());
    return out;
}

void Sorm::dictionaryChanged(std::string_view word) {
    bool everything = word.empty();
    if (!everything && word[0] != '@' && !(word[0] >= 'A' && word[0] <= 'Z')) return;
    std::vector<std::string> leaving;
    for (auto& [key, service] : repository_) {
        if (key == service->name() && service->location() == "self") continue;
        auto at = key.find('@');
        bool located = at != std::string::npos && key.compare(at, std::string::npos, word) == 0;
        bool byDefault = at == std::string::npos && key.substr(0, key.find('.')) == word;
        // Any alias may lead to another one, so an edited alias may concern every opaque address.
        bool opaque = at != std::string::npos && key.find_first_of(":/", at) == std::string::npos;
        if (everything || located || byDefault || opaque) leaving.push_back(key);
    }
    for (auto& key : leaving) drop(key);
    if (host_)
        for (auto& key : leaving) host_->removed(key);
}

// ---- waiting, and what is told about it all ----

Loop& Sorm::loop() const {
    if (!loop_) fail(kNoLoop);
    return *loop_;
}

void Sorm::turn(Deadline deadline) {
    std::int64_t until = deadline.none() ? monotonicNow() + 3'600'000'000'000 : deadline.when();
    if (host_ && host_->turn(until)) return;
    if (loop_) return loop_->turn(until);
    if (mailbox_->wait(until)) mailbox_->run();
}

void Sorm::announce(std::string_view event, std::string_view text, std::vector<std::string> words) {
    if (!self_ || !self_->stream_) return;
    Message m;
    m.text = text;
    m.words = std::move(words);
    self_->publish(event, m);
}

void Sorm::announce(const Trail& trail) {
    if (onForeignThread()) return mailbox_->post([this, trail] { announce(trail); });
    if (!self_ || !self_->stream_) return;
    for (auto& e : trail.entries())
        if (e.daemon.empty() || e.daemon == daemonName)
            announce(std::string("trail.") + toText(e.severity), e.text, {e.so, "SORMA " + e.symbol, e.request});
}

// ---- dispatch ----

void Sorm::call(std::string_view name, Method method, Message& m) {
    Reference service = get(name);
    service->invoke(method, m);
}

void Sorm::dispatch(std::string_view request, std::string& reply) noexcept {
    if (scratchBusy_) {                     // from inside a service that was called by dispatch
        Message m;
        std::string name;
        return dispatchWith(m, name, request, reply);
    }
    scratchBusy_ = true;
    dispatchWith(scratch_, scratchName_, request, reply);
    scratchBusy_ = false;
}

void Sorm::dispatchWith(Message& m, std::string& name, std::string_view request, std::string& reply) noexcept {
    constexpr std::string_view kBare = " EXEC";
    Method method = Method::exec;
    reply.clear();
    name.clear();
    std::string_view who = request.ends_with(kBare) ? request.substr(0, request.size() - kBare.size()) : std::string_view();
    // "NAME EXEC" of a known object needs no parser: no name holds anything that would be read otherwise.
    Service* known = who.empty() ? nullptr : find(who);
    try {
        if (known) {
            m.clear();
        } else {
            who = {};
            parseRequest(request, name, method, m);
            who = name;
            known = find(who);
        }
        Reference service = known ? Reference(known) : get(who);
        service->invoke(method, m);
    } catch (...) {
        Trail trail = trailOfCurrentException({});
        for (auto& e : trail.entries())
            if (e.request.empty() && e.daemon.empty()) e.request.assign(request.substr(0, 4096));
        m.clear();
        m.code = -1;
        m.trail = std::move(trail);
        if (who.empty()) who = name.empty() ? std::string_view("sorm") : name;
    }
    if (!m.trail.empty() || !lastTrail_.empty()) lastTrail_ = m.trail;
    appendReply(reply, who, m);
}

}  // namespace sorma
