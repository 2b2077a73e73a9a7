// sorm.h -- the service object request manager: repository, plant, dispatch.
//
// One for each interpreter (or embedding program's thread). The name alone is enough: get() finds the object, or the
// plant makes it, configures it from its recipe in the dictionary, and keeps it.
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

// What surrounds a SORM: an interpreter, or an embedding program (which needs none of it).
class Host {
public:
    virtual ~Host() = default;
    virtual bool loadClass(const std::string&) { return false; }    // make the class known; false when it cannot
    virtual void removed(const std::string&) {}                     // a name has left the repository
    virtual void providePackage(const char*, const char*) {}        // tell Tcl about a package
    virtual void report(const std::string&) {}                      // what provide() has to say when it fails
    // One turn of the event loop that surrounds the SORM, until something was done or a time [ns]. False: there is none.
    virtual bool turn(std::int64_t) { return false; }
};

class Sorm {
public:
    explicit Sorm(Host* host = nullptr);
    ~Sorm();
    Sorm(const Sorm&) = delete;
    Sorm& operator=(const Sorm&) = delete;

    // ---- classes ----
    void add(Class type);                                           // fails with CLASS DUPLICATE, NAME SYNTAX
    const Class* findClass(std::string_view name) const;
    const Class& needClass(const std::string& name);                // loads it; fails with NAME UNKNOWN_CLASS
    std::vector<const Class*> classes() const;
    // A class is no more, or will be added anew. Its objects keep it until they go.
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
    // The object of that name, made when need be. Fails with NAME SYNTAX, NAME UNKNOWN_CLASS, OPTION ..., SERVICE
    // CYCLE, SERVICE FAILED (its constructor threw), ADDRESS UNRESOLVED, COMM ...
    // author: who wrote the name. He needs the right to call the object when it has to be made, and to reach its place when
    // it is elsewhere; then what he gets is a line of his own, whose requests the other daemon judges as anyone's.
    Reference get(std::string_view name) {
        if (auto* known = find(name)) return Reference(known);
        return make(Name::parse(name), nullptr, nullptr);
    }
    Reference get(std::string_view name, const PrincipalPointer& author);
    // A new object with words beyond its recipe. Fails with SERVICE EXISTS when the name is taken.
    Reference create(std::string_view name, const std::vector<std::string>& words, const PrincipalPointer& author = nullptr);
    void remove(std::string_view name);                             // fails with SERVICE GONE when there is none
    void alias(std::string_view name, std::string_view target, const PrincipalPointer& author = nullptr);   // a second name
    // An object that is in no repository: nobody can name it, and it lives as long as whoever made it wants. label: what messages
    // call it. It has its defaults, and has been born.
    Reference makeAnonymous(std::unique_ptr<Service> service, const std::string& label, const std::string& className);
    void dismiss(const Reference& anonymous);                       // its end: no more requests
    std::vector<std::string> names(std::string_view pattern = "*") const;
    std::size_t size() const { return repository_.size(); }

    // ---- dispatch ----
    // Text in, text out; never throws. reply is overwritten.
    void dispatch(std::string_view request, std::string& reply, const PrincipalPointer& author = nullptr) noexcept;
    // By name, in place. Throws Error.
    void call(std::string_view name, Method method, Message& m);

    Dictionary& dictionary() { return dictionary_; }
    const Dictionary& dictionary() const { return dictionary_; }
    void dictionaryChanged(std::string_view word);                  // after an edit: forget what it located
    // Counts up when a location has changed: whoever has resolved a name looks again.
    const std::uint64_t& locationChanges() const { return locationChanges_; }

    const Trail& lastTrail() const { return lastTrail_; }
    void setLastTrail(const Trail& trail) {
        if (!trail.empty() || !lastTrail_.empty()) lastTrail_ = trail;
    }

    // ---- waiting ----
    // Work for this SORM's thread, from any thread: sorm.mailbox()->post(...).
    const std::shared_ptr<Mailbox>& mailbox() const { return mailbox_; }
    // Timers and descriptors for services; set by COMM. Fails with SERVICE FAILED in a program without any loop.
    Loop& loop() const;
    bool hasLoop() const { return loop_ != nullptr; }
    void setLoop(Loop* loop) { loop_ = loop; }
    // Wait for anything to happen, and let it: for those who block until an object of this process answers.
    void turn(Deadline deadline);

    // What happens in the SORM is published by the SO `sorm`: object.made, object.removed, object.changed, dictionary.changed,
    // connection.opened, connection.closed, and trail.error, trail.warning, trail.verbose as entries occur.
    void announce(std::string_view event, std::string_view text, std::vector<std::string> words = {});
    void announce(const Trail& trail);
    bool announces() const { return self_ && self_->stream_; }      // does anybody listen, or has listened?
    // object.changed: text: its name; words: name -opt value ... by
    void announceChange(const Service& service, std::span<const Option* const> options);
    // Does anybody listen to what passes? And tell him: bus/monitor.h.
    bool monitored() const { return self_ && self_->isMonitored(); }
    void monitor(std::string_view event, const Message& m);

    Host* host() const { return host_; }
    Access access;                                                  // who may do what
    // May he use the object of that name through one that acts on his words: call it, or reach its place when it is elsewhere?
    bool mayUse(const PrincipalPointer& author, const std::string& name) const;
    // Else fails with COMM DENIED, which names the object that was to use it.
    void needUse(const PrincipalPointer& author, const std::string& name, const std::string& user);
    Budget budget;                                                  // and how much he may make this process keep
    std::string daemonName;                                         // as served; empty when not a daemon

    // While it is set, names of remote objects are taken on trust: nothing blocks to ask the daemon whether it has them.
    bool nonBlocking = false;

    // Makes the proxy of a remote object; set by COMM. The recipe is this client's own wish for the object, from its
    // dictionary, and goes to the daemon as CTRL. relayFor: who has named it, when it is not the owner.
    using ProxyMaker = std::function<std::unique_ptr<Service>(const Name&, std::vector<std::string> recipe, const PrincipalPointer& relayFor)>;
    ProxyMaker makeProxy;
    // What COMM adds to the SO `sorm`: connections, daemons, server facts, as text in lines.
    std::function<std::string(std::string_view what)> networkFacts;

    // The SORM of an interpreter (any pointer serves as key), for packages that know only the pointer.
    static Sorm* of(const void* key);
    void bindTo(const void* key);                                   // undone by the destructor

private:
    struct Hash {
        using is_transparent = void;
        std::size_t operator()(std::string_view s) const { return std::hash<std::string_view>{}(s); }
    };
    using Repository = std::unordered_map<std::string, Reference, Hash, std::equal_to<>>;

    void dispatchWith(Message& m, std::string& name, std::string_view request, std::string& reply, const PrincipalPointer& author) noexcept;
    void dispatchInside(std::string_view request, std::string& reply, const PrincipalPointer& author) noexcept;
    // What find() found last: a name that is used again needs no hash and no walk along a chain.
    // Invariant: name points to a key of repository_, service is what it holds there.
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
    // wish: what follows its recipe, and comes before the words.
    Reference makeLocal(const Name& name, const std::vector<std::string>* words, const PrincipalPointer& author,
                        const std::vector<DictionaryWord>& wish = {});
    std::vector<DictionaryWord> recipeOf(const Name& name) const;
    std::string placeOf(const Name& name, const Address& address) const;        // as patterns of `reach` see it
    struct Use {
        Right right;
        std::string subject;
    };
    Use useOf(const std::string& name) const;
    void keep(const std::string& key, const Reference& service);
    void drop(const std::string& key);
    Reference adopt(std::unique_ptr<Service> service, const std::string& name, const Class& type);

    Host* host_;
    Loop* loop_ = nullptr;
    std::shared_ptr<Mailbox> mailbox_ = std::make_shared<Mailbox>();
    Service* self_ = nullptr;               // the SO `sorm`
    std::map<std::string, std::unique_ptr<Class>, std::less<>> classes_;
    std::vector<std::unique_ptr<Class>> forgotten_;     // objects may still point at them
    Repository repository_;
    mutable std::array<Recent, 64> recent_{};
    Dictionary dictionary_;
    std::vector<std::string> births_;       // names under construction, outermost first
    Message scratch_;                       // of dispatch, while not in use by an outer dispatch
    std::string scratchName_;
    bool scratchBusy_ = false;
    Trail lastTrail_;
    std::uint64_t locationChanges_ = 0;
    std::vector<const void*> keys_;
};

}  // namespace sorma
