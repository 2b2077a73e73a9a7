#include "bus/budget.h"

#include <algorithm>
#include <cstring>

#include "bus/call.h"
#include "bus/catalogue.h"
#include "bus/client.h"

namespace sorma {

namespace {

const Prototype kPrincipal{Severity::error, "COMM LIMIT", 1,
    "{}: {} bytes for {} are too many: {} has {} of the {} bytes that each may make this daemon keep; raise it there: sorma::configure -budget BYTES"};
const Prototype kTotal{Severity::error, "COMM LIMIT", 1,
    "{}: {} bytes for {} are too many: all clients of this daemon together may make it keep {} bytes; raise it there: "
    "sorma::configure -totalbudget BYTES"};

constexpr const char* kUseNames[Account::kUses] = {"requests", "replies", "queues", "subscriptions", "objects", "segments",
                                                   "values", "records", "threads", "tables"};

bool isMapped(const Principal::Address& a) {            // IPv4
    return std::all_of(a.begin(), a.begin() + 10, [](auto byte) { return byte == 0; }) && a[10] == 0xff && a[11] == 0xff;
}

}  // namespace

Budget::Key Budget::keyOf(const Principal& p) {
    switch (p.kind()) {
        case Principal::Kind::user:
        case Principal::Kind::local: return {p.kind(), p.uid(), {}};
        case Principal::Kind::anyone: return {p.kind(), 0, {}};
        case Principal::Kind::several: return p.members().empty() ? Key{Principal::Kind::anyone, 0, {}} : keyOf(*p.members()[0]);
        case Principal::Kind::web:
        case Principal::Kind::cert: {                   // from whatever address
            Key key{p.kind(), 0, {}};
            const std::size_t parts[] = {std::hash<std::string>{}(p.certificate()), std::hash<std::string>{}(p.authority())};
            static_assert(sizeof parts <= sizeof key.address);
            std::memcpy(key.address.data(), parts, sizeof parts);
            return key;
        }
        case Principal::Kind::host: break;
    }
    Key key{p.kind(), 0, p.address()};
    if (!isMapped(key.address)) std::fill(key.address.begin() + 8, key.address.end(), 0);
    return key;
}

std::size_t Account::limit() const { return (owner_ ? books_->total : books_->principal).load(std::memory_order_relaxed); }

bool Account::fits(std::size_t bytes) const {
    const std::size_t all = books_->used.load(std::memory_order_relaxed), total = books_->total.load(std::memory_order_relaxed);
    const std::size_t most = owner_ ? total : total - total / 4, mine = used(), limit = this->limit();
    return mine <= limit && bytes <= limit - mine && all <= most && bytes <= most - all;
}

bool Account::exceeded() const {
    const std::size_t mine = used(), limit = this->limit();
    if (mine <= limit / 16) return false;
    const std::size_t total = books_->total.load(std::memory_order_relaxed);
    return mine > limit || books_->used.load(std::memory_order_relaxed) > total - total / 4;
}

void Account::add(Use use, std::size_t bytes) {
    used_.fetch_add(bytes, std::memory_order_relaxed);
    uses_[std::size_t(use)].fetch_add(bytes, std::memory_order_relaxed);
    books_->used.fetch_add(bytes, std::memory_order_relaxed);
}

void Account::subtract(Use use, std::size_t bytes) {
    used_.fetch_sub(bytes, std::memory_order_relaxed);
    uses_[std::size_t(use)].fetch_sub(bytes, std::memory_order_relaxed);
    books_->used.fetch_sub(bytes, std::memory_order_relaxed);
}

Entry Account::refusal(const std::string& object, Use use, std::size_t bytes) {
    refused_.fetch_add(1, std::memory_order_relaxed);
    const std::size_t mine = used(), most = limit();
    const char* what = kUseNames[std::size_t(use)];
    if (!owner_ && (mine > most || bytes > most - mine))
        return makeEntry(kPrincipal, {MessageArg::of(object), MessageArg::of(bytes), MessageArg::of(what), MessageArg::of(name_),
                                      MessageArg::of(mine), MessageArg::of(most)});
    return makeEntry(kTotal, {MessageArg::of(object), MessageArg::of(bytes), MessageArg::of(what),
                              MessageArg::of(books_->total.load(std::memory_order_relaxed))});
}

bool Charge::set(std::size_t bytes) {
    if (account_ && bytes > bytes_ && !account_->fits(bytes - bytes_)) return false;
    force(bytes);
    return true;
}

void Charge::force(std::size_t bytes) {
    if (account_ && bytes > bytes_) account_->add(use_, bytes - bytes_);
    if (account_ && bytes < bytes_) account_->subtract(use_, bytes_ - bytes);
    bytes_ = bytes;
}

void Charge::need(const std::string& object, std::size_t bytes) {
    if (!set(bytes)) throw Error(account_->refusal(object, use_, bytes));
}

void Budget::setLimits(std::size_t principal, std::size_t total) {
    books_->principal.store(principal, std::memory_order_relaxed);
    books_->total.store(total, std::memory_order_relaxed);
}

AccountPointer Budget::of(const PrincipalPointer& principal) {
    std::lock_guard lock(mutex_);
    if (!principal) {
        if (!owner_) owner_.reset(new Account(books_, "the owner", true));
        return owner_;
    }
    const Key key = keyOf(*principal);
    auto& entry = accounts_[key];
    if (auto known = entry.lock()) return known;
    std::string name = principal->toText();
    if (key.kind == Principal::Kind::host && !isMapped(key.address)) name = "host " + Principal::toText(key.address) + "/64";
    AccountPointer fresh(new Account(books_, std::move(name), false));
    entry = fresh;
    if (accounts_.size() >= sweepAt_) {
        std::erase_if(accounts_, [](auto& item) { return item.second.expired(); });
        sweepAt_ = std::max<std::size_t>(64, 2 * accounts_.size());
    }
    return fresh;
}

AccountPointer Budget::ofCaller(const PrincipalPointer& author) {
    if (CallContext* context = CallContext::current(); context && context->client) {
        auto principal = CallContext::currentPrincipal();
        return of(principal ? principal : author);
    }
    return author ? of(author) : nullptr;
}

std::vector<AccountPointer> Budget::accounts() const {
    std::vector<AccountPointer> out;
    std::lock_guard lock(mutex_);
    if (owner_) out.push_back(owner_);
    for (auto& [key, weak] : accounts_)
        if (auto account = weak.lock()) out.push_back(std::move(account));
    return out;
}

std::string Budget::text() const {
    auto all = accounts();
    std::stable_sort(all.begin(), all.end(), [](auto& a, auto& b) { return a->used() > b->used(); });
    std::string out = "all " + std::to_string(books_->used.load(std::memory_order_relaxed)) + " of " +
                      std::to_string(books_->total.load(std::memory_order_relaxed)) + " bytes";
    for (auto& a : all) {
        out += '\n' + a->name_ + ": " + std::to_string(a->used()) + " of " + std::to_string(a->limit()) + " bytes";
        for (std::size_t i = 0; i < Account::kUses; ++i)
            if (std::size_t n = a->uses_[i].load(std::memory_order_relaxed)) out += std::string(", ") + kUseNames[i] + ' ' + std::to_string(n);
        out += "; " + std::to_string(a->connections.load(std::memory_order_relaxed)) + " connections, refused " +
               std::to_string(a->refused_.load(std::memory_order_relaxed));
    }
    return out;
}

}  // namespace sorma
