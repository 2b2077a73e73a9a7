// sorm.h -- the service object request manager (SORM): repository, plant, dispatch.
//
// There is one for each interpreter, or for a thread of an embedding program. A name is enough to use an object. get() finds it
// in the repository. Else the plant makes it, configures it with its recipe in the dictionary, and adds it to the repository.
//
// Threads:  all functions belong to the thread that made the SORM. Other threads may only post to mailbox(), which they have
//           to keep by a shared pointer.
// Re-entry: functions that make, call or remove objects run the code of classes, which may call any function of the SORM.
// Owner:    the SORM owns classes, dictionary and repository. References may keep an object alive after the SORM; its calls
//           fail then.
#pragma once

#include <array>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "bus/access.h"
#include "bus/budget.h"
#include "bus/dictionary.h"
#include "bus/fence.h"
#include "bus/loop.h"
#include "bus/message.h"
#include "bus/name.h"
#include "bus/network.h"
#include "bus/request.h"
#include "bus/service.h"
#include "bus/statistics.h"

namespace sorma {

class LateSpans;        // bus/lateSpans.h
class Remembered;       // bus/remembered.h

// The surroundings of a SORM: an interpreter, or an embedding program, which need not override anything. Called on the
// SORM's thread.
class Host {
public:
    virtual ~Host() = default;
    // Find the class and add() it. False: there is no such class. May throw Error.
    virtual bool loadClass(const std::string&) { return false; }
    // For the message when there is none: classes that loadClass might have found, and where it has looked, for people.
    virtual std::vector<std::string> classNames() { return {}; }
    virtual std::string classPlaces() { return {}; }
    virtual void removed(const std::string&) {}                     // a name was removed from the repository
    virtual void providePackage(const char*, const char*) {}        // the package of that name and version is loaded
    virtual void report(const std::string&) {}                      // the message when provide() fails
    // Run one turn of the surrounding event loop, until something was done or a time [ns]. False: there is no event loop.
    virtual bool turn(std::int64_t) { return false; }
};

// One that must fit other objects, as a circuit must fit the pins of its units.
class Dependent {
public:
    // Another object has new options, or was wired anew. Throw to refuse: all is undone, and this is called again. Must be short when
    // the object has a real-time owner, since no tick begins meanwhile.
    virtual void follow(Service& other) = 0;
protected:
    ~Dependent() = default;
};

class Sorm {
public:
    explicit Sorm(Host* host = nullptr);                            // the host must outlive it
    ~Sorm();
    Sorm(const Sorm&) = delete;
    Sorm& operator=(const Sorm&) = delete;
    void processEnds();                                             // tell all objects

    // ---- classes ----
    void add(Class type);                                           // fails with CLASS DUPLICATE, NAME SYNTAX
    const Class* findClass(std::string_view name) const;            // null: it is not loaded
    const Class& needClass(const std::string& name);                // loads it when need be; fails with NAME UNKNOWN_CLASS
    std::vector<const Class*> classes() const;
    // Remove a class; it may be added again. Objects that it has keep using it.
    void forget(std::string_view name);
    std::uint64_t classChanges() const { return classChanges_; }    // counts those that were added and removed

    // ---- secret options (Spec::secret) ----
    bool isSecret(std::string_view word) const { return secrets_.contains(word); }      // an option of that name is, in some class
    bool hasSecrets() const { return !secrets_.empty() || !untold_.empty(); }
    // Words or a request, with kMask instead of what follows the name of a secret option.
    std::vector<std::string> masked(std::vector<std::string> words) const;
    std::string masked(std::string request) const;
    // May messages to and from this object hold secrets? Monitors do not show them.
    bool holdsSecrets(const Service& service) const;
    // Another process has told its secret options; this one does not show them from now on. text: their names, as words.
    // Returns whether there is one.
    bool learnSecrets(std::string_view text);
    // The process of this object has not told them yet: until it has, what a CTRL of the object says is not shown at all.
    void awaitSecrets(const std::string& name) { untold_.insert(name); }
    void endAwait(const std::string& name) { untold_.erase(name); }
    bool awaitsSecrets(const std::string& name) const { return untold_.contains(name); }

    // ---- repository ----
    Service* find(std::string_view name) const {                    // null when there is none; never makes one
        Recent& last = recent(name);
        if (last.name && *last.name == name) return last.service;
        auto found = repository_.find(name);
        if (found == repository_.end()) return nullptr;
        last = {&found->first, found->second->service.get()};
        return last.service;
    }
    // The object of that name, made when need be. For a remote object that blocks until the daemon has answered, unless
    // probe is later; what an object names while it is made is probed like it. Fails with NAME SYNTAX, NAME UNKNOWN_CLASS,
    // OPTION ..., SERVICE CYCLE, SERVICE FAILED (its constructor threw), ADDRESS UNRESOLVED, COMM ...
    // author: who wrote the name; null: the owner. Others need the right to call the object when it has to be made, and the
    // right to reach its place when it is elsewhere. Then they get a proxy of their own, and the other daemon gives its
    // requests only the rights of anyone.
    Reference get(std::string_view name, Probe probe = Probe::now) {
        if (auto* known = find(name)) return Reference(known);
        return make(Name::parse(name), nullptr, nullptr, probe);
    }
    Reference get(std::string_view name, const PrincipalPointer& author, Probe probe = Probe::now) { return get(name, find(name), author, probe); }
    // Make an object with words of CTRL beyond its recipe. Fails with SERVICE EXISTS when the name is taken, or as get.
    // author: as in get; others need the right to make it.
    Reference create(std::string_view name, const std::vector<std::string>& words, const PrincipalPointer& author);
    // Remove the object with all its names; or a second name alone. Fails with SERVICE GONE when there is none. References
    // stay valid, and calls by them fail with SERVICE GONE.   permit: to make that object (canonical(name)).
    void remove(std::string_view name, const Permit& permit);
    void alias(std::string_view name, std::string_view target, const PrincipalPointer& author);     // a second name
    // The name for checks of rights, after spelling and second names. For an object here it is its name, or the name that it
    // would get; for one elsewhere it is the whole name. Fails with NAME SYNTAX.
    std::string canonical(std::string_view name) const;
    // Make an object that is not in the repository. It has its defaults, and then the words of CTRL; born() was called. label: its
    // name in messages. The reference owns it; dismiss() it at its end. Without a service, the class makes it. Fails as create, and
    // with COMM LIMIT when the caller has too many objects.
    Reference makeAnonymous(std::unique_ptr<Service> service, const std::string& label, const std::string& className,
                            const std::vector<std::string>& words = {});
    void dismiss(const Reference& anonymous);                       // as remove: no more requests
    std::vector<std::string> names(std::string_view pattern = "*") const;
    std::size_t size() const { return repository_.size(); }
    // Counts of all objects of this process, by class.
    std::map<std::string, Figures> figures() const;

    // ---- dispatch ----
    // Execute a request that is text; reply becomes its reply as text, also when it fails. Never throws. Blocks until the
    // answer.
    void dispatch(std::string_view request, std::string& reply, const PrincipalPointer& author = nullptr) noexcept;
    // The same with a message, which becomes the reply. Throws Error.
    void call(std::string_view name, Method method, Message& m);

    Dictionary& dictionary() { return dictionary_; }
    Remembered& remembered() { return *remembered_; }
    LateSpans& lateSpans() { return *lateSpans_; }
    const Dictionary& dictionary() const { return dictionary_; }
    void dictionaryChanged(std::string_view word);                  // call it after each change of the dictionary
    // Counts the changes of locations in the dictionary. When it changes, addresses that were resolved before may be wrong.
    const std::uint64_t& locationChanges() const { return locationChanges_; }

    const Trail& lastTrail() const { return lastTrail_; }           // of the last request
    void setLastTrail(const Trail& trail) {
        if (!trail.empty() || !lastTrail_.empty()) lastTrail_ = CallContext::currentClient() ? cutTrail(trail) : trail;
    }

    // ---- waiting ----
    // Work for this SORM's thread, from any thread: sorm.mailbox()->post(...).
    const std::shared_ptr<Mailbox>& mailbox() const { return mailbox_; }
    // Timers and descriptors for services; set by COMM. Fails with SERVICE FAILED in a program without a loop.
    Loop& loop() const;
    bool hasLoop() const { return loop_ != nullptr; }
    void setLoop(Loop* loop) { loop_ = loop; }
    // Run one turn of the event loop, for code that blocks until an object of this process answers.
    void turn(Deadline deadline);

    // Publish an event of the object `sorm`:
    //     object.made          object.removed          object.changed    dictionary.changed
    //     connection.opened    connection.closed       subscription.opened    subscription.closed
    //     trail.error          trail.warning           trail.verbose, for each entry of a trail
    void announce(std::string_view event, std::string_view text, std::vector<std::string> words = {});
    void announceLater(std::string_view event, std::string text, std::vector<std::string> words);    // when the loop has its turn
    void announce(const Trail& trail);
    bool announces() const { return self_ && self_->stream_; }      // does anybody listen, or has listened?
    // Publish object.changed: its text is the name; its words: name -opt value ... by
    void announceChange(const Service& service, std::span<const Option* const> options);
    // Does anybody monitor requests (bus/monitor.h)? monitor() publishes to those who do.
    bool monitored() const { return self_ && self_->isMonitored(); }
    void listenersChanged(const Service& of);       // an object has other subscribers now
    Observers observers{*this};                     // of requests: bus/request.h
    void monitor(std::string_view event, const Message& m);

    Host* host() const { return host_; }                            // null: none
    Access access;                                                  // the policy
    std::vector<Dependent*> dependents;                             // each removes itself before it is deleted
    void tellDependents(Service& changed);                          // throws when one refuses
    Fences fences{*this};                                           // objects that may not obey others now
    // May the author use the object of that name through another object: call it, or reach its place when it is elsewhere?
    bool mayUse(const PrincipalPointer& author, const std::string& name) const;
    // Fails with COMM DENIED if not.   user: the object that was to use it, for the message.
    void needUse(const PrincipalPointer& author, const std::string& name, const std::string& user);
    Budget budget;                                                  // memory that this process keeps for others
    std::string daemonName;                                         // as served; empty: this is no daemon

    std::int64_t streamTime = 600;                                  // [s] after which a stream ends that nobody reads: bus/pieces.h

    // Names are strict: a name makes an object only if its flavor has an entry in the dictionary. Classes with Flavors::any
    // take any flavor all the same.
    bool strict = false;

    Network* network = nullptr;                                     // set by COMM; null: names elsewhere do not work

    // The SORM of an interpreter, for packages that know only the pointer to it. Any pointer serves as key. Null: there is
    // none.
    static Sorm* of(const void* key);
    void bindTo(const void* key);                                   // until the SORM is deleted

private:
    struct Hash {
        using is_transparent = void;
        std::size_t operator()(std::string_view s) const { return std::hash<std::string_view>{}(s); }
    };
    // The object of a name.
    struct Registration {
        Reference service;
        std::size_t key = 0;                // size of the name, which the repository keeps
        std::size_t heap() const { return key; }
    };
    using Repository = std::unordered_map<std::string, Charged<Registration>, Hash, std::equal_to<>>;
    // A proxy for the requests of one author who is not the owner.
    struct Relay {
        std::string name, place;            // place: subject of the right to reach it
        PrincipalPointer author;
        Reference proxy;
        std::size_t heap() const;
    };

    void dispatchWith(Message& m, std::string& name, std::string_view request, std::string& reply, const PrincipalPointer& author) noexcept;
    void dispatchInside(std::string_view request, std::string& reply, const PrincipalPointer& author) noexcept;
    // The last names that find() found. A name that is used again needs no look-up in repository_.
    // Invariant: name points to a key of repository_, service to the object there.
    struct Recent {
        const std::string* name = nullptr;
        Service* service = nullptr;
    };
    Recent& recent(std::string_view name) const {
        auto at = [&](std::size_t i) { return static_cast<unsigned char>(name[i]); };
        std::size_t n = name.size();
        return recent_[n == 0 ? 0 : (n + 7 * at(n / 2) + 5 * at(n - 1)) % recent_.size()];
    }

    // known: what find() says to that name.
    Reference get(std::string_view name, Service* known, const PrincipalPointer& author, Probe probe);
    Reference make(const Name& name, const std::vector<std::string>* words, const PrincipalPointer& author, Probe probe = Probe::now);
    Reference makeHere(const Name& name, const std::vector<std::string>* words, const PrincipalPointer& author, Probe probe);
    // wish: words that come after the recipe and before words.
    Reference makeLocal(const Name& name, const std::vector<std::string>* words, const PrincipalPointer& author, Probe probe = Probe::now,
                        const std::vector<DictionaryWord>& wish = {});
    std::vector<DictionaryWord> recipeOf(const Name& name) const;
    void needFlavor(const Name& name, const Class& type, const PrincipalPointer& author) const;
    std::string placeOf(const Name& name, const Address& address) const;        // subject of the right to reach it
    // The right that an author needs to use an object.
    struct Use {
        Right right;
        std::string subject;
        bool operate;               // and this right, too
    };
    Use useOf(const std::string& name) const;
    void keep(const std::string& key, const Reference& service, AccountPointer account);    // add a name to the repository
    void testAtBirth(Service& made);                                    // fails: it is not made
    void drop(const std::string& key);                                  // remove it
    friend class Observers;
    friend class Fences;
    void markFenced();                                                  // tell all objects whether they are behind a fence
    void markObserved();                                                // tell all objects that they are observed
    void markObserved(Service& s);
    Reference adopt(std::unique_ptr<Service> service, const std::string& name, const Class& type);
    Reference construct(const std::string& name, const Class& type);
    Charge chargeObject(const std::string& name, const PrincipalPointer& author);

    Host* host_;
    Loop* loop_ = nullptr;
    std::shared_ptr<Mailbox> mailbox_ = std::make_shared<Mailbox>();
    Service* self_ = nullptr;               // the object `sorm`
    const std::unique_ptr<Observer> statistics_, audit_;       // of requests
    std::unique_ptr<Observer> monitor_;     // while somebody monitors them
    std::map<std::string, std::shared_ptr<Class>, std::less<>> classes_;     // objects share theirs, which may have been removed
    std::uint64_t classChanges_ = 0;
    std::set<std::string, std::less<>> secrets_;        // names of options
    std::set<std::string> untold_;                      // names of objects, see awaitSecrets
    Repository repository_;
    mutable std::array<Recent, 64> recent_{};
    std::map<std::string, Figures> departed_;           // of objects that were removed
    Dictionary dictionary_;
    const std::unique_ptr<Remembered> remembered_;
    const std::unique_ptr<LateSpans> lateSpans_;
    std::deque<Charged<Relay>> relays_;     // the last ones, the oldest first
    struct Birth {
        std::string name;
        Probe probe;
    };
    std::vector<Birth> births_;             // objects that are being made, outermost first
    Message scratch_;                       // for dispatch, unless an outer dispatch uses it
    std::string scratchName_;
    bool scratchBusy_ = false;
    Trail lastTrail_;
    std::uint64_t locationChanges_ = 0;
    std::vector<const void*> keys_;
};

}  // namespace sorma
