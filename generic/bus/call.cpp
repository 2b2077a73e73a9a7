#include "bus/call.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <random>

#include "bus/client.h"
#include "bus/reply.h"

namespace sorma {

namespace {

thread_local CallContext* theContext = nullptr;

}  // namespace

std::string Caller::toText() const {
    std::string claim = user.empty() && program.empty() ? std::string() : user + (host.empty() ? std::string() : '@' + host) + ' ' + program + '[' + std::to_string(process) + ']';
    if (known.empty()) return claim;
    return claim.empty() ? known : known + " (claims " + claim + ")";
}

const Caller& Caller::self() {
    static const Caller caller = [] {
        Caller c;
        char host[256] = "";
        if (gethostname(host, sizeof host - 1) != 0) host[0] = 0;
        c.user = userName(geteuid());
        c.host = host[0] ? host : "localhost";
        c.program = program_invocation_short_name;
        c.address = "self";
        c.process = getpid();
        return c;
    }();
    return caller;
}

// ---- contexts that are kept ----

std::string KeptCall::callers() const {
    std::string text = (client ? client->caller : Caller::self()).toText();
    return behalf.empty() ? text : text + " for " + behalf;
}

void KeptCall::begun(const std::shared_ptr<Pending>& pending) {
    constexpr std::size_t kFew = 8;
    if (begun_.size() >= kFew && begun_.size() == begun_.capacity())
        std::erase_if(begun_, [](auto& weak) {
            auto p = weak.lock();
            return !p || p->answered();
        });
    begun_.push_back(pending);
}

void KeptCall::cancel() {
    if (cancelled_.exchange(true, std::memory_order_relaxed)) return;
    for (auto& weak : std::exchange(begun_, {}))
        if (auto p = weak.lock()) Future(std::move(p)).cancel();
}

// ---- contexts on the stack ----

const ClientPointer CallContext::kThisProcess;
const std::string CallContext::kNobody;

CallContext::CallContext(const ClientPointer& client, Deadline deadline, std::uint64_t request, const std::string& behalf)
    : client(client), deadline(deadline), behalf(behalf), request_(request), outer_(theContext) {
    theContext = this;
}

CallContext::CallContext(const KeptCallPointer& kept)
    : client(kept ? kept->client : kThisProcess), deadline(kept ? kept->deadline : Deadline()),
      behalf(kept ? kept->behalf : kNobody), cancelled(kept && kept->cancelled()), span(kept ? kept->span : nullptr), heard(kept ? kept->heard : HeardEpoch()), request_(kept ? kept->request : 0), kept_(kept),
      outer_(theContext) {
    theContext = kept ? this : nullptr;
}

CallContext::~CallContext() {
    theContext = outer_;
    if (kept_) kept_->subTime += subTime;
}

std::uint32_t CallContext::waitedForOthers() const { return subTime + (kept_ ? kept_->subTime : 0); }

void CallContext::cancel() {
    cancelled.store(true, std::memory_order_relaxed);       // a hint, it orders nothing
    if (auto kept = kept_) kept->cancel();
}

CallContext::Fresh::Fresh() : outer_(theContext) { theContext = nullptr; }
CallContext::Fresh::~Fresh() { theContext = outer_; }

CallContext* CallContext::current() { return theContext; }
Deadline CallContext::currentDeadline() { return theContext ? theContext->deadline : Deadline(); }
Deadline CallContext::deadlineForCalls(std::int64_t now) {
    constexpr std::int64_t kMost = 100'000'000;             // [ns]
    Deadline mine = currentDeadline();
    if (mine.none() || mine.when() - now <= 0) return mine;
    return Deadline::at(mine.when() - std::min((mine.when() - now) / 10, kMost));
}
const Caller& CallContext::currentCaller() {
    return theContext && theContext->client ? theContext->client->caller : Caller::self();
}
ClientPointer CallContext::currentClient() { return theContext ? theContext->client : nullptr; }
std::string CallContext::currentCallers() {
    std::string text = currentCaller().toText();
    if (theContext && !theContext->behalf.empty()) text += " for " + theContext->behalf;
    return text;
}
PrincipalPointer CallContext::currentPrincipal() {
    return theContext && theContext->client ? theContext->client->principal : nullptr;
}
std::uint64_t CallContext::currentRequest() {
    CallContext* c = theContext;
    if (c && c->request_ == 0) c->request_ = newRequest();
    return c ? c->request_ : 0;
}

bool CallContext::currentGivenUp() {
    CallContext* c = theContext;
    return c && (c->cancelled.load(std::memory_order_relaxed) || (c->kept_ && c->kept_->cancelled()));
}

bool CallContext::currentCancelled() { return currentGivenUp() || (theContext && theContext->deadline.passed()); }

KeptCallPointer CallContext::keep() {
    CallContext* c = theContext;
    if (!c) return nullptr;
    if (!c->kept_) {
        c->kept_ = std::make_shared<KeptCall>(c->client, c->deadline, currentRequest(), c->behalf);
        c->kept_->span = c->span;
        c->kept_->heard = c->heard;
        if (c->cancelled.load(std::memory_order_relaxed)) c->kept_->cancel();     // before anybody kept it
    }
    return c->kept_;
}

std::uint64_t CallContext::newRequest() {
    // From a random number on, so that those of many processes do not meet; below 2^62: it is a signed number in Tcl.
    static std::atomic<std::uint64_t> last = [] {
        std::random_device random;
        return (std::uint64_t(random()) << 32 | random()) >> 2;
    }();
    return last.fetch_add(1, std::memory_order_relaxed) + 1;
}

}  // namespace sorma
