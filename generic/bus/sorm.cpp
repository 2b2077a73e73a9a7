#include "bus/sorm.h"

#include <algorithm>
#include <mutex>

#include "bus/bookkeeping.h"
#include "bus/call.h"
#include "bus/glob.h"
#include "bus/lateSpans.h"
#include "bus/monitor.h"
#include "bus/nearest.h"
#include "bus/remembered.h"
#include "bus/requestText.h"

namespace sorma {

Class describeDict();
Class describeSorm();

namespace {

const Prototype kUnknownFlavor{Severity::error, "NAME UNKNOWN_FLAVOR", 1,
                               "unknown flavor in \"{0}\"{1}: {2}, and the dictionary has no entry {0}; "
                               "{3} {0} makes it all the same"};
const Prototype kCycle{Severity::error, "SERVICE CYCLE", 1, "{}: sub-services form a cycle: {}"};
const Prototype kFailed{Severity::error, "SERVICE FAILED", 1, "{}: the constructor of class {} failed: {}"};
const Prototype kUntested{Severity::error, "SERVICE SELFTEST", 1, "{}: is not made, since it does not pass its self-test"};
const Prototype kThread{Severity::error, "SERVICE THREAD", 1,
                        "{}: a step of a cycle cannot make or remove objects; post that to sorm().mailbox()"};
const Prototype kGone{Severity::error, "SERVICE GONE", 1, "{}: there is no such service object"};
const Prototype kExists{Severity::error, "SERVICE EXISTS", 1, "{}: the service object exists already; use CTRL to change it"};
const Prototype kProtected{Severity::error, "SERVICE PROTECTED", 1, "{}: belongs to the SORM and cannot be removed"};
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

constexpr std::size_t kObjectSize = 4096;       // that an object is charged with
constexpr std::size_t kMostRelays = 64;

// A thread that executes ticks has no business in the repository.
bool onForeignThread() { return RealtimeOwner::current() != nullptr; }

}  // namespace

Sorm::Sorm(Host* host) : host_(host), statistics_(makeStatistics()), audit_(makeAudit(*this)), remembered_(std::make_unique<Remembered>(*this)),
      lateSpans_(std::make_unique<LateSpans>(*this)) {
    observers.add(statistics_.get());
    observers.add(audit_.get());
    add(describeDict());
    add(describeSorm());
    mailbox_->owner = this;
    access.watch(this, [this] {
        for (auto& [key, place] : repository_) place->service->judgeParts();
        if (network) network->outdated();
    });
    access.budget = &budget;
    makeLocal(Name::parse("sorm"), nullptr, nullptr);
    self_ = find("sorm");
    makeLocal(Name::parse("dict"), nullptr, nullptr);
}

Sorm::~Sorm() {
    {
        std::lock_guard lock(bindings().mutex);
        for (auto* key : keys_) bindings().sorms.erase(key);
    }
    // Objects may have references to each other and use the SORM in their destructors: remove them one by one.
    recent_ = {};
    self_ = nullptr;
    // Proxies are removed last: objects that use them may have to stop something in the other process.
    for (bool elsewhere : {false, true}) {
        std::vector<std::string> leaving;
        do {                                            // objects may make others while they go
            leaving.clear();
            for (auto& [key, place] : repository_)
                if (elsewhere || !place->service->isElsewhere()) leaving.push_back(key);
            for (auto& key : leaving) {
                auto found = repository_.find(key);
                if (found == repository_.end()) continue;
                Reference r = found->second.release().service;
                recent(key) = {};                       // an object that is deleted may look for others in the repository
                repository_.erase(found);
                if (!r->gone()) r->left();
            }
        } while (!leaving.empty());
    }
    relays_.clear();
    mailbox_->close();
}

void Sorm::processEnds() {
    for (auto& [key, place] : repository_) place->service->processEnds();
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

// ---- repository and plant ----

std::size_t Sorm::Relay::heap() const { return kObjectSize + heapOf(name) + heapOf(place); }

Reference Sorm::get(std::string_view text, Service* known, const PrincipalPointer& author, Probe probe) {
    if (known && (!author || !known->isElsewhere())) return Reference(known);
    for (auto& relay : relays_) {
        if (relay->author != author || relay->name != text) continue;
        Reference proxy = relay->proxy;
        access.need(author, Right::reach, relay->place, text);
        return proxy;
    }
    return make(Name::parse(text), nullptr, author, probe);
}

Reference Sorm::create(std::string_view text, const std::vector<std::string>& words, const PrincipalPointer& author) {
    if (find(text)) fail(kExists, text);
    access.need(author, Right::make, canonical(text), text);
    return make(Name::parse(text), &words, author);
}

Reference Sorm::make(const Name& name, const std::vector<std::string>* words, const PrincipalPointer& author, Probe probe) {
    if (onForeignThread()) fail(kThread, name.toText());
    if (!births_.empty()) probe = std::max(probe, births_.back().probe);
    if (name.local()) return makeLocal(name, words, author, probe);
    Address address = resolve(name, dictionary_);
    std::string key = name.toText();
    if (address.kind == Address::Kind::self) {
        Reference here = makeHere(name, words, author, probe);
        if (!here->gone()) keep(key, here, budget.ofCaller(author));    // the name with its address is a second name
        return here;
    }
    const std::string place = placeOf(name, address);
    access.need(author, Right::reach, place, key);
    if (!network) fail(kNoNetwork, key);
    auto proxyOf = [&](std::vector<std::string> recipe) {
        return adopt(network->makeProxy(name, std::move(recipe), author, probe), key, network->proxyClass());
    };
    if (author) {
        Reference made = proxyOf(words ? *words : std::vector<std::string>());
        if (words) return made;
        while (relays_.size() >= kMostRelays) relays_.pop_front();
        relays_.emplace_back(key, budget.ofCaller(author), Account::Use::objects, Relay{key, place, author, made});
        return made;
    }
    if (auto* known = find(key)) return Reference(known);
    std::vector<std::string> recipe;
    for (auto& w : recipeOf(name)) {
        access.need(w.origin.author, Right::reach, place, key);     // it goes there as ours
        recipe.push_back(w.text);
    }
    if (words) recipe.insert(recipe.end(), words->begin(), words->end());
    Reference made = proxyOf(std::move(recipe));
    keep(key, made, budget.ofCaller());
    return made;
}

// A mistyped flavor makes no second object where its class, or the whole program, is strict.
void Sorm::needFlavor(const Name& name, const Class& type, const PrincipalPointer& author) const {
    bool wanted = type.flavors() == Flavors::dictionary || (strict && type.flavors() == Flavors::unsaid);
    if (!wanted || name.flavor.empty() || dictionary_.has(name.service)) return;
    std::vector<std::string> known;
    for (auto& word : dictionary_.words(name.className + ".*"))
        if (access.rights(author, word) & Rights(Right::call)) known.push_back(word);
    fail(kUnknownFlavor, name.service, didYouMean(name.service, known),
         strict && type.flavors() == Flavors::unsaid ? "names are strict here" : "class " + name.className + " takes only flavors of the dictionary",
         CallContext::currentClient() && !daemonName.empty() ? "sorm@" + daemonName + " CTRL -create" : "sorma::create");
}

std::string Sorm::placeOf(const Name& name, const Address& address) const { return name.where.empty() ? address.toText() : name.where; }

Sorm::Use Sorm::useOf(const std::string& text) const {
    Service* known = find(text);
    if (known && !known->isElsewhere()) return {Right::call, known->name(), known->isDangerous()};
    Name name = Name::parse(text);
    if (!name.local())
        if (Address address = resolve(name, dictionary_); address.kind != Address::Kind::self) return {Right::reach, placeOf(name, address), false};
    const Class* type = findClass(name.className);
    return {Right::call, name.service, type && type->isDangerous()};
}

bool Sorm::mayUse(const PrincipalPointer& author, const std::string& name) const {
    if (!author && !access.restricted()) return true;
    auto use = useOf(name);
    const Rights rights = access.rights(author, use.subject);
    return (rights & Rights(use.right)) && (!use.operate || (rights & Rights(Right::operate)));
}

void Sorm::needUse(const PrincipalPointer& author, const std::string& name, const std::string& user) {
    if (!author && !access.restricted()) return;
    auto use = useOf(name);
    access.need(author, use.right, use.subject, user);
    if (use.operate) access.need(author, Right::operate, use.subject, user);
}

std::vector<DictionaryWord> Sorm::recipeOf(const Name& name) const {
    std::string key = name.recipeKey();
    return key.empty() ? std::vector<DictionaryWord>() : dictionary_.expand(key);
}

// A recipe that a daemon elsewhere would get from us as CTRL is used for an object of this process, too.
Reference Sorm::makeHere(const Name& name, const std::vector<std::string>* words, const PrincipalPointer& author, Probe probe) {
    auto wish = recipeOf(name);
    Service* known = find(name.service);
    if (!known) {
        Name here = name;
        here.where.clear();
        here.byDefault = false;
        return makeLocal(here, words, author, probe, wish);
    }
    if (words) fail(kExists, name.service);
    Reference here(known);
    if (!wish.empty()) {
        Message m;
        for (auto& w : wish) {
            m.words.push_back(std::move(w.text));
            m.author = Principal::both(m.author, w.origin.author);
        }
        here->invoke(Method::ctrl, m);
    }
    return here;
}

Reference Sorm::adopt(std::unique_ptr<Service> service, const std::string& name, const Class& type) {
    Service* s = service.release();
    Reference reference(s);
    s->name_ = name;
    s->class_ = type.shared_from_this();
    s->sorm_ = this;
    s->checks_ = type.checks();
    if (access.restricted()) s->setGuard(Service::kAskBit, true);
    if (fences.cover(name)) s->setGuard(Service::kFencedBit, true);
    markObserved(*s);
    return reference;
}

Charge Sorm::chargeObject(const std::string& name, const PrincipalPointer& author) {
    Charge charge(budget.ofCaller(author), Account::Use::objects);
    charge.need(name, kObjectSize + name.size());
    return charge;
}

Reference Sorm::construct(const std::string& name, const Class& type) {
    std::unique_ptr<Service> fresh;
    try {
        fresh = type.make();
    } catch (const Error&) {
        throw;
    } catch (const std::exception& e) {
        fail(kFailed, name, type.name(), e.what());
    } catch (...) {
        fail(kFailed, name, type.name(), "an exception of unknown type");
    }
    return adopt(std::move(fresh), name, type);
}

Reference Sorm::makeLocal(const Name& which, const std::vector<std::string>* words, const PrincipalPointer& author, Probe probe,
                          const std::vector<DictionaryWord>& wish) {
    const std::string &name = which.service, &className = which.className;
    if (auto* known = find(name)) {
        if (words) fail(kExists, name);
        return Reference(known);
    }
    access.need(author, Right::call, name, name);
    fences.need(name, author);
    auto birth = std::find_if(births_.begin(), births_.end(), [&](auto& b) { return b.name == name; });
    if (birth != births_.end()) {
        std::string chain;
        for (; birth != births_.end(); ++birth) chain += birth->name + " -> ";
        fail(kCycle, name, chain + name);
    }
    Charge charge = chargeObject(name, author);
    const std::shared_ptr<const Class> kept = needClass(className).shared_from_this();     // a recipe may remove it
    const Class& type = *kept;
    if (!words && wish.empty()) needFlavor(which, type, author);
    births_.push_back({name, probe});
    struct Popper {
        std::vector<Birth>& births;
        ~Popper() { births.pop_back(); }
    } popper{births_};

    Reference made = construct(name, type);
    made->charge_ = std::move(charge);
    type.learnDefaults(*made);
    made->maker_ = dictionary_.has(which.recipeKey()) ? dictionary_.authorOf(which.recipeKey()) : author;
    auto recipe = recipeOf(which);
    recipe.insert(recipe.end(), wish.begin(), wish.end());
    if (words)
        for (auto& w : *words) recipe.push_back({w, Origin{{}, 0, {}, CallContext::currentCallers(), author}});
    Message reply;
    try {
        if (!recipe.empty()) made->configure(recipe, true, &reply);
        made->recall(words);
        made->born();
        testAtBirth(*made);
    } catch (...) {
        throw Error(trailOfCurrentException(name));
    }
    keep(name, made, nullptr);              // charged with the object
    announce("object.made", name, {className});
    return made;
}

void Sorm::testAtBirth(Service& made) {
    const double seconds = made.type().testedAtBirth();
    if (seconds <= 0) return;
    Message test;
    test.words = {"-selftest"};
    try {
        made.async(Method::ctrl, std::move(test), Deadline::in(std::int64_t(1000 * seconds))).wait();
    } catch (const Error& e) {
        Trail trail = e.trail;
        trail.add(makeEntry(kUntested, {MessageArg::of(made.name())}));
        throw Error(std::move(trail));
    }
}

void Sorm::keep(const std::string& key, const Reference& service, AccountPointer account) {
    Charged<Registration> registration(key, std::move(account), Account::Use::objects, {service, key.size()});
    drop(key);
    repository_.emplace(key, std::move(registration));
    ++service->names_;
}

void Sorm::drop(const std::string& key) {
    auto found = repository_.find(key);
    if (found == repository_.end()) return;
    Reference service = found->second.release().service;    // it may end with this function, and look at us then
    recent(key) = {};
    repository_.erase(found);
    --service->names_;
}

std::map<std::string, Figures> Sorm::figures() const {
    auto out = departed_;
    const Class* type = nullptr;                        // of the last object: many are of the same class
    Figures* sum = nullptr;
    for (auto& [key, value] : repository_) {
        const Service& service = *value->service;
        if (service.names_ > 1 && key != service.name()) continue;         // the same object by a second name
        if (&service.type() != type) {
            if (service.isElsewhere()) continue;
            type = &service.type();
            sum = &out[type->name()];
        }
        ++sum->objects;
        sum->underWay += service.underWay();
        addFigures(*sum, service);
    }
    return out;
}

void Sorm::remove(std::string_view name, const Permit& permit) {
    if (onForeignThread()) fail(kThread, name);
    auto found = repository_.find(name);
    if (found == repository_.end()) fail(kGone, name);
    permit.check(Right::make, canonical(name));
    Reference service = found->second->service;
    if (service->name() == "sorm" || service->name() == "dict") fail(kProtected, name);
    if (service->gone()) return;                        // it is being removed, and its own code removes it again
    std::string own = service->name();
    std::vector<std::string> leaving;
    if (own == name) {
        service->left();
        if (!service->isElsewhere()) addFigures(departed_[service->type().name()], *service);
        if (service->names_ > 1) {
            for (auto& [key, value] : repository_)
                if (value->service.get() == service.get()) leaving.push_back(key);
        } else {
            leaving.push_back(own);
        }
    } else {
        leaving.emplace_back(name);
    }
    for (auto& key : leaving) drop(key);
    if (host_)
        for (auto& key : leaving) host_->removed(key);
    // The next object of that name is of another class, perhaps.
    if (network && !service->isElsewhere() && findClass(service->type().name()) != &service->type()) network->outdated();
    if (own == name) announce("object.removed", own);
}

void Sorm::alias(std::string_view name, std::string_view target, const PrincipalPointer& author) {
    if (find(name)) fail(kExists, name);
    Name parsed = Name::parse(name);
    // Requests that are meant for that place come here.
    if (!parsed.where.empty()) access.need(author, Right::reach, parsed.where, name);
    else if (parsed.byDefault && (author || access.restricted()))
        if (Address address = resolve(parsed, dictionary_); address.kind != Address::Kind::self)
            access.need(author, Right::reach, placeOf(parsed, address), name);
    access.need(author, Right::make, canonical(name), name);
    access.need(author, Right::make, canonical(target), target);
    Reference service = get(target, author);
    keep(parsed.toText(), service, budget.ofCaller(author));
    if (network) network->outdated();
}

std::string Sorm::canonical(std::string_view text) const {
    auto here = [this](std::string_view name) {
        Service* known = find(name);
        return known && !known->isElsewhere() ? known->name() : std::string(name);
    };
    if (Service* known = find(text); known && !known->isElsewhere()) return known->name();
    Name name = Name::parse(text);
    if (name.local()) return here(name.service);
    try {
        if (resolve(name, dictionary_).kind == Address::Kind::self) return here(name.service);
    } catch (const Error&) {            // no such place: the name itself
    }
    return name.toText();
}

std::vector<std::string> Sorm::names(std::string_view pattern) const {
    std::vector<std::string> out;
    for (auto& [name, service] : repository_)
        if (globMatch(pattern, name)) out.push_back(name);
    std::sort(out.begin(), out.end());
    return out;
}

void Sorm::dictionaryChanged(std::string_view word) {
    announce("dictionary.changed", word);
    bool everything = word.empty();
    if (!everything && !Name::isLocation(word)) return;
    ++locationChanges_;
    relays_.clear();
    std::vector<std::string> leaving;
    for (auto& [key, service] : repository_) {
        if (!Name::isElsewhere(key)) continue;
        // Any location may lead to another one, so an edited one may concern every name that is not an address itself.
        Name name = Name::parse(key);
        if (everything || name.byDefault || Address::parse(name.where).kind == Address::Kind::alias) leaving.push_back(key);
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

void Sorm::announceLater(std::string_view event, std::string text, std::vector<std::string> words) {
    if (!announces()) return;
    mailbox_->post([this, event = std::string(event), text = std::move(text), words = std::move(words)] { announce(event, text, words); });
}

void Sorm::announce(const Trail& trail) {
    if (onForeignThread()) return mailbox_->post([this, trail] { announce(trail); });
    if (!self_ || !self_->stream_) return;
    for (auto& e : trail.entries())
        if (e.daemon.empty() || e.daemon == daemonName)
            announce(std::string("trail.") + toText(e.severity), e.text, {e.so, "SORMA " + e.symbol, e.request});
}

// From the last: one that follows may remove others, or itself. A tick has no time for it.
void Sorm::tellDependents(Service& changed) {
    if (RealtimeOwner::current()) return;
    for (std::size_t i = dependents.size(); i > 0; i = std::min(i - 1, dependents.size())) dependents[i - 1]->follow(changed);
}

void Sorm::announceChange(const Service& service, std::span<const Option* const> options) {
    std::vector<std::string> words{service.name()};
    for (auto* o : options)
        words.insert(words.end(), {o->name, o->spec.secret ? std::string(kMask) : toText(o->value(service, Permit::owner()))});
    words.push_back(CallContext::currentCallers());
    if (!onForeignThread()) return announce("object.changed", service.name(), std::move(words));
    mailbox_->post([this, name = service.name(), words] { announce("object.changed", name, words); });
}

void Sorm::listenersChanged(const Service& of) {
    if (&of != self_ || monitored() == (monitor_ != nullptr)) return;
    if (monitor_) {
        observers.remove(monitor_.get());
        monitor_.reset();
    } else {
        monitor_ = makeMonitor(*this);
        observers.add(monitor_.get());
    }
}

void Sorm::markFenced() {
    for (auto& [key, place] : repository_) place->service->setGuard(Service::kFencedBit, fences.cover(place->service->name()));
}

void Sorm::markObserved() {
    for (auto& [key, place] : repository_) markObserved(*place->service);
}

void Sorm::markObserved(Service& s) {
    if (observers.any()) s.setGuard(Service::kObservedBit, true);
    if (observers.any(Observer::events) && !s.stream_ && !s.isElsewhere()) s.stream_ = std::make_unique<Stream>();
}

void Sorm::monitor(std::string_view event, const Message& m) {
    if (monitored() && !onForeignThread()) self_->stream_->publish(*self_, event, m, true);
}

// ---- dispatch ----

void Sorm::call(std::string_view name, Method method, Message& m) {
    Reference service = get(name);
    service->invoke(method, m);
}

void Sorm::dispatch(std::string_view request, std::string& reply, const PrincipalPointer& author) noexcept {
    if (scratchBusy_) [[unlikely]] return dispatchInside(request, reply, author);
    scratchBusy_ = true;
    dispatchWith(scratch_, scratchName_, request, reply, author);
    scratchBusy_ = false;
}

// From inside a service that was called by dispatch.
void Sorm::dispatchInside(std::string_view request, std::string& reply, const PrincipalPointer& author) noexcept {
    Message m;
    std::string name;
    dispatchWith(m, name, request, reply, author);
}

void Sorm::dispatchWith(Message& m, std::string& name, std::string_view request, std::string& reply, const PrincipalPointer& author) noexcept {
    constexpr std::string_view kBare = " EXEC";
    Method method = Method::exec;
    reply.clear();
    name.clear();
    std::string_view who = request.ends_with(kBare) ? request.substr(0, request.size() - kBare.size()) : std::string_view();
    // "NAME EXEC" of a known object needs no parser: no name holds anything that would be read otherwise.
    Service* known = who.empty() ? nullptr : find(who);
    bool reached = false;
    try {
        if (known) {
            m.reset();
        } else {
            who = {};
            parseRequest(request, name, method, m);
            who = name;
            known = find(who);
        }
        Reference service = known && !author ? Reference(known) : get(who, known, author, Probe::now);
        if (author) [[unlikely]] m.author = author;
        reached = true;
        service->invoke(method, m);
    } catch (...) {
        Trail trail = trailOfCurrentException({});
        for (auto& e : trail.entries())
            if (e.request.empty() && e.daemon.empty()) e.request = masked(cutText(request, kQuotedText));
        if (!reached) observers.refused(who.empty() ? std::string_view(name) : who, method, m, trail);
        m.reset();
        m.code = -1;
        m.trail = std::move(trail);
        if (who.empty()) who = name.empty() ? std::string_view("sorm") : name;
    }
    if (m.author) [[unlikely]] m.forget();
    setLastTrail(m.trail);
    appendReply(reply, who, m, name.empty());       // a name that was not parsed has no quotes
}

}  // namespace sorma
