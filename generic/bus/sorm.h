// sorm.h -- the service object request manager (SORM): repository, plant, dispatch.
//
// There is one for each interpreter, or for a thread of an embedding program. A name is enough to use an object: get() finds
// it in the repository, or the plant makes it, configures it with its recipe in the dictionary, and adds it to the
// repository.
//
// Threads:  all functions belong to the thread that made the SORM. Other threads may only post to mailbox(), which they have
//           to keep by a shared pointer.
// Re-entry: functions that make, call or remove objects run the code of classes, which may call any function of the SORM.
// Owner:    the SORM owns classes, dictionary and repository. References may keep an object alive after the SORM; its calls
//           fail then.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "bus/access.h"
#include "bus/budget.h"
#include "bus/dictionary.h"
#include "bus/loop.h"
#include "bus/message.h"
#include "bus/name.h"
#include "bus/service.h"

namespace sorma {

// The surroundings of a SORM: an interpreter, or an embedding program, which need not override anything. Called on the
// SORM's thread.
class Host {
public:
    virtual ~Host() = default;
    // Find the class and add() it. False: there is no such class. May throw Error.
    virtual bool loadClass(const std::string&) { return false; }
    virtual void removed(const std::string&) {}                     // a name was removed from the repository
    virtual void providePackage(const char*, const char*) {}        // the package of that name and version is loaded
    virtual void report(const std::string&) {}                      // the message when provide() fails
    // Run one turn of the surrounding event loop, until something was done or a time [ns]. False: there is no event loop.
    virtual bool turn(std::int64_t) { return false; }
};

class Sorm {
public:
    explicit Sorm(Host* host = nullptr);                            // the host must outlive it
    ~Sorm();
    Sorm(const Sorm&) = delete;
    Sorm& operator=(const Sorm&) = delete;

    // ---- classes ----
    void add(Class type);                                           // fails with CLASS DUPLICATE, NAME SYNTAX
    const Class* findClass(std::string_view name) const;            // null: it is not loaded
    const Class& needClass(const std::string& name);                // loads it when need be; fails with NAME UNKNOWN_CLASS
    std::vector<const Class*> classes() const;
    // Remove a class; it may be added again. Objects that it has keep using it.
    void forget(std::string_view name);

    // ---- repository ----
    Service* find(std::string_view name) const {                    // null when there is none; never makes one
        Recent& last = recent(name);
        if (last.name && *last.name == name) return last.service;
        auto found = repository_.find(name);
        if (found == repository_.end()) return nullptr;
        last = {&found->first, found->second.get()};
        return last.service;
    }
    // The object of that name, made when need be. For a remote object it blocks until the daemon has answered, unless
    // nonBlocking. Fails with NAME SYNTAX, NAME UNKNOWN_CLASS, OPTION ..., SERVICE CYCLE, SERVICE FAILED (its constructor
    // threw), ADDRESS UNRESOLVED, COMM ...
    // author: who wrote the name; null: the owner. Others need the right to call the object when it has to be made, and the
    // right to reach its place when it is elsewhere. Then they get a proxy of their own, and the other daemon gives its
    // requests no rights but those of anyone.
    Reference get(std::string_view name) {
        if (auto* known = find(name)) return Reference(known);
        return make(Name::parse(name), nullptr, nullptr);
    }
    Reference get(std::string_view name, const PrincipalPointer& author);
    // Make an object with words of CTRL beyond its recipe. Fails with SERVICE EXISTS when the name is taken, or as get.
    Reference create(std::string_view name, const std::vector<std::string>& words, const PrincipalPointer& author = nullptr);
    // Remove the object with all its names; or a second name alone. Fails with SERVICE GONE when there is none. References
    // stay valid, and calls by them fail with SERVICE GONE.
    void remove(std::string_view name);
    void alias(std::string_view name, std::string_view target, const PrincipalPointer& author = nullptr);   // a second name
    // Make an object that is not in the repository. It has its defaults, and born() was called. label: its name in messages.
    // The reference owns it; dismiss() it at its end.
    Reference makeAnonymous(std::unique_ptr<Service> service, const std::string& label, const std::string& className);
    void dismiss(const Reference& anonymous);                       // as remove: no more requests
    std::vector<std::string> names(std::string_view pattern = "*") const;
    std::size_t size() const { return repository_.size(); }

    // ---- dispatch ----
    // Execute a request that is text; reply becomes its reply as text, also when it fails. Never throws. Blocks until the
    // answer.
    void dispatch(std::string_view request, std::string& reply, const PrincipalPointer& author = nullptr) noexcept;
    // The same with a message, which becomes the reply. Throws Error.
    void call(std::string_view name, Method method, Message& m);

    Dictionary& dictionary() { return dictionary_; }
    const Dictionary& dictionary() const { return dictionary_; }
    void dictionaryChanged(std::string_view word);                  // call it after each change of the dictionary
    // Counts the changes of locations in the dictionary. When it changes, addresses that were resolved before may be wrong.
    const std::uint64_t& locationChanges() const { return locationChanges_; }

    const Trail& lastTrail() const { return lastTrail_; }           // of the last request
    void setLastTrail(const Trail& trail) {
        if (!trail.empty() || !lastTrail_.empty()) lastTrail_ = trail;
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

    // Publish an event of the object `sorm`: object.made, object.removed, object.changed, dictionary.changed,
    // connection.opened, connection.closed, subscription.opened, subscription.closed, and for each entry of a trail
    // trail.error, trail.warning or trail.verbose.
    void announce(std::string_view event, std::string_view text, std::vector<std::string> words = {});
    void announceLater(std::string_view event, std::string text, std::vector<std::string> words);    // when the loop has its turn
    void announce(const Trail& trail);
    bool announces() const { return self_ && self_->stream_; }      // does anybody listen, or has listened?
    // Publish object.changed: its text is the name; its words: name -opt value ... by
    void announceChange(const Service& service, std::span<const Option* const> options);
    // Does anybody monitor requests (bus/monitor.h)? monitor() publishes to those who do.
    bool monitored() const { return self_ && self_->isMonitored(); }
    void monitor(std::string_view event, const Message& m);

    Host* host() const { return host_; }                            // null: none
    Access access;                                                  // the policy
    // May the author use the object of that name through another object: call it, or reach its place when it is elsewhere?
    bool mayUse(const PrincipalPointer& author, const std::string& name) const;
    // Fails with COMM DENIED if not.   user: the object that was to use it, for the message.
    void needUse(const PrincipalPointer& author, const std::string& name, const std::string& user);
    Budget budget;                                                  // memory that this process keeps for others
    std::string daemonName;                                         // as served; empty: this is no daemon

    // While it is true, making the proxy of a remote object does not block: the daemon is not asked whether it has the
    // object.
    bool nonBlocking = false;

    // Makes the proxy of a remote object; set by COMM. recipe: this client's recipe for the object; the proxy sends it to
    // the daemon as CTRL.   relayFor: who named the object, when it was not the owner.
    using ProxyMaker = std::function<std::unique_ptr<Service>(const Name&, std::vector<std::string> recipe, const PrincipalPointer& relayFor)>;
    ProxyMaker makeProxy;
    // Facts about connections, daemons and servers for DBX of the object `sorm`, as lines of text; set by COMM.
    std::function<std::string(std::string_view what)> networkFacts;

    // The SORM of an interpreter, for packages that know only the pointer to it. Any pointer serves as key. Null: there is
    // none.
    static Sorm* of(const void* key);
    void bindTo(const void* key);                                   // until the SORM is deleted

private:
    struct Hash {
        using is_transparent = void;
        std::size_t operator()(std::string_view s) const { return std::hash<std::string_view>{}(s); }
    };
    using Repository = std::unordered_map<std::string, Reference, Hash, std::equal_to<>>;

    void dispatchWith(Message& m, std::string& name, std::string_view request, std::string& reply, const PrincipalPointer& author) noexcept;
    void dispatchInside(std::string_view request, std::string& reply, const PrincipalPointer& author) noexcept;
    // The last names that find() found, so that a name that is used again needs no look-up in repository_.
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

    Reference make(const Name& name, const std::vector<std::string>* words, const PrincipalPointer& author);
    Reference makeHere(const Name& name, const std::vector<std::string>* words, const PrincipalPointer& author);
    // wish: words that come after the recipe and before words.
    Reference makeLocal(const Name& name, const std::vector<std::string>* words, const PrincipalPointer& author,
                        const std::vector<DictionaryWord>& wish = {});
    std::vector<DictionaryWord> recipeOf(const Name& name) const;
    std::string placeOf(const Name& name, const Address& address) const;        // subject of the right to reach it
    // The right that an author needs to use an object.
    struct Use {
        Right right;
        std::string subject;
    };
    Use useOf(const std::string& name) const;
    void keep(const std::string& key, const Reference& service);        // add a name to the repository
    void drop(const std::string& key);                                  // remove it
    Reference adopt(std::unique_ptr<Service> service, const std::string& name, const Class& type);

    Host* host_;
    Loop* loop_ = nullptr;
    std::shared_ptr<Mailbox> mailbox_ = std::make_shared<Mailbox>();
    Service* self_ = nullptr;               // the object `sorm`
    std::map<std::string, std::unique_ptr<Class>, std::less<>> classes_;
    std::vector<std::unique_ptr<Class>> forgotten_;     // removed classes, to which objects may still point
    Repository repository_;
    mutable std::array<Recent, 64> recent_{};
    Dictionary dictionary_;
    std::vector<std::string> births_;       // names of objects that are being made, outermost first
    Message scratch_;                       // for dispatch, unless an outer dispatch uses it
    std::string scratchName_;
    bool scratchBusy_ = false;
    Trail lastTrail_;
    std::uint64_t locationChanges_ = 0;
    std::vector<const void*> keys_;
};

}  // namespace sorma
