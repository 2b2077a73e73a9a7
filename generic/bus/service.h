// service.h -- a service object: what its author implements, and what every object gets from its class's table.
//
// Threads: a service object belongs to the thread of its SORM. References are counted without locks.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "bus/dictionary.h"
#include "bus/message.h"
#include "bus/option.h"

namespace sorma {

class Sorm;
class Service;

// A counted reference to a service object, here or (through its proxy) elsewhere. It stays valid when the object is
// removed: calls then fail with SERVICE GONE.
class Reference {
public:
    Reference() = default;
    explicit Reference(Service* service);
    Reference(const Reference& other) : Reference(other.service_) {}
    Reference(Reference&& other) noexcept : service_(std::exchange(other.service_, nullptr)) {}
    Reference& operator=(Reference other) noexcept {
        std::swap(service_, other.service_);
        return *this;
    }
    ~Reference();

    explicit operator bool() const { return service_ != nullptr; }
    Service* operator->() const { return service_; }
    Service& operator*() const { return *service_; }
    Service* get() const { return service_; }

    // Time-optimal invocation: EXEC in place. No allocation, no lock, no clock; the class's signature is checked
    // where it demands something. Throws Error.
    inline void exec(Message& message) const;

private:
    Service* service_ = nullptr;
};

class Service {
public:
    Service();
    virtual ~Service();
    Service(const Service&) = delete;
    Service& operator=(const Service&) = delete;

    // ---- what an author implements ----

    // Do the job: the request comes in m, the result leaves in m. Throw (fail) to refuse; then the caller's message
    // is unspecified, the object's state must be as before.
    virtual void exec(Message& m) = 0;

    // The recipe has been applied, the name is known; the object is about to be called for the first time.
    virtual void born() {}

    // These options have new values. Throw to refuse: all of them are put back. Not called for the recipe (see born).
    virtual void changed(std::span<const Option* const> options) { (void)options; }

    // Check yourself; throw what is wrong, or return a verdict in clear text.
    virtual std::string selftest() { return "ok"; }

    // State that is not in the options, appended line by line as "# name value" for -dump.
    virtual void dumpState(std::string& out) const { (void)out; }

    // ---- requests with words; a proxy forwards them, others leave them as they are ----
    virtual void ctrl(Message& m);
    virtual void dbx(Message& m);
    virtual std::string location() const { return "self"; }

    // ---- what callers use ----
    const std::string& name() const { return name_; }
    const Class& type() const { return *class_; }
    Sorm& sorm() const { return *sorm_; }
    bool gone() const { return gone_; }

    // A request of any method, as the dispatcher, the Tcl command and the server make it: checks, counts, times one
    // call in 64, keeps the trail within the object's verbosity, and names this object in what is thrown.
    void invoke(Method method, Message& m);

    std::int64_t lastRun = INT64_MAX;       // [ns] of the last request that a daemon served, INT64_MAX before
    std::uint64_t calls() const { return calls_; }
    std::uint32_t references() const { return references_; }
    std::string dump() const;               // settable part: "-option value" lines; then state lines "# ..."
    std::string recipe() const;             // options that differ from their defaults, as CTRL words

private:
    friend class Reference;
    friend class Sorm;
    friend struct CommonRequests;           // service.cpp: -help, -dump, -why ... of every class

    struct Record;                          // origins, undo, audit, statistics: made when first needed
    Record& record();
    void configure(const std::vector<DictionaryWord>& words, bool birth, const std::string& request, Message* reply);
    [[noreturn]] void failGone() const;
    void enter(Method method, Message& m);
    void timed(Method method, Message& m);
    void finish(Message& m);

    std::string name_;
    const Class* class_ = nullptr;
    Sorm* sorm_ = nullptr;
    std::unique_ptr<Record> record_;
    std::uint64_t calls_ = 0;               // EXECs
    std::uint32_t references_ = 0;
    std::uint32_t names_ = 0;               // in the repository, second names included
    bool gone_ = false;
    bool checks_ = false;                   // class_->checksRequests()
    std::uint8_t verbosity_ = 1;            // 0 errors, 1 and warnings, 2 and verbose
};

inline Reference::Reference(Service* service) : service_(service) {
    if (service_) ++service_->references_;
}

inline Reference::~Reference() {
    if (service_ && --service_->references_ == 0) delete service_;
}

inline void Reference::exec(Message& message) const {
    Service& s = *service_;
    if (s.gone_) [[unlikely]] s.failGone();
    if (s.checks_) s.class_->checkRequest(s.name_, message);
    ++s.calls_;
    s.exec(message);
}

// Used by Class::service: resolves a name through the SORM of the object, so that cycles are noticed.
Reference subService(Service& user, const std::string& name);

template <class S> Class& Class::service(std::string name, Reference S::*member, Spec spec) {
    return option({std::move(name), Type::service, std::move(spec), {},
                   [member](const Service& s) {
                       const Reference& r = static_cast<const S&>(s).*member;
                       return Value(r ? r->name() : std::string());
                   },
                   [member](Service& s, const Value& v) {
                       static_cast<S&>(s).*member = subService(s, std::get<std::string>(v));
                   }});
}

}  // namespace sorma
