// budget.h -- limits the memory that this process keeps for others: for each principal, and for all together.
//
// Memory that stays after a request, or of which a request needs much, is a Charge on the Account of its principal.
// Examples are long requests, kept replies, data that waits for a peer, subscriptions, objects, and segments of shared memory. A
// small call that is answered at once is charged nothing, and neither is what this process does for itself. Values that are
// kept carry their charge with them: see bus/kept.h.
//
// The owner by Unix-domain socket has no limit of his own. The last quarter of the limit for all is only for him, so that he
// can connect however much others keep.
//
// Threads: any. An account outlives its budget as long as something is charged to it.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "bus/message.h"
#include "bus/principal.h"

namespace sorma {

// The memory kept for one principal.
class Account {
public:
    // values: what services keep, entries of the dictionary, options; records: audit, refusals, trails.
    enum class Use : std::uint8_t { requests, replies, queues, subscriptions, objects, segments, values, records, threads, tables };
    static constexpr std::size_t kUses = 10;
    static constexpr std::size_t kThread = 8 << 20;             // [bytes] what a thread is charged with: its stack

    const std::string& name() const { return name_; }           // as the subject of a policy's line, or "the owner"
    bool owner() const { return owner_; }
    std::size_t used() const { return used_.load(std::memory_order_relaxed); }     // [bytes]
    std::size_t limit() const;                                  // [bytes]
    bool fits(std::size_t bytes) const;                         // could so much be charged now?
    // Is the limit exceeded? That can be, since Charge::force charges small things that are there already. Then new requests
    // of this principal are refused. When only the limit for all is exceeded, this is true for accounts that use more than a
    // little.
    bool over() const { return !owner_ && exceeded(); }
    // The error for a charge that was refused: COMM LIMIT, with the name of the limit. Counts the refusal.
    Entry refusal(const std::string& object, Use use, std::size_t bytes);

    std::atomic<std::uint32_t> connections{0};                  // that are open, counted by the server

private:
    friend class Budget;
    friend class Charge;
    // Limits [bytes], and the sum of all accounts. Memory order is relaxed everywhere: no other data depends on these
    // numbers.
    struct Books {
        std::atomic<std::size_t> used{0}, principal{SIZE_MAX}, total{SIZE_MAX};
    };
    Account(std::shared_ptr<Books> books, std::string name, bool owner) : books_(std::move(books)), name_(std::move(name)), owner_(owner) {}
    bool exceeded() const;
    void add(Use use, std::size_t bytes);
    void subtract(Use use, std::size_t bytes);

    const std::shared_ptr<Books> books_;
    const std::string name_;
    const bool owner_;
    std::atomic<std::size_t> used_{0}, refused_{0};
    std::array<std::atomic<std::size_t>, kUses> uses_{};
};
using AccountPointer = std::shared_ptr<Account>;

// Bytes on an account; it releases them when it is deleted. One thread at a time may use a charge.
class Charge {
public:
    Charge() = default;                                         // on no account: everything is granted
    Charge(AccountPointer account, Account::Use use) : account_(std::move(account)), use_(use) {}
    Charge(Charge&& other) noexcept : account_(std::move(other.account_)), bytes_(std::exchange(other.bytes_, 0)), use_(other.use_) {}
    Charge& operator=(Charge&& other) noexcept {
        clear();
        account_ = std::move(other.account_);
        bytes_ = std::exchange(other.bytes_, 0);
        use_ = other.use_;
        return *this;
    }
    ~Charge() { clear(); }

    std::size_t bytes() const { return bytes_; }
    const AccountPointer& account() const { return account_; }
    Account::Use use() const { return use_; }
    bool set(std::size_t bytes);                                // charge so many in all; false: too many, nothing has changed
    void force(std::size_t bytes);                              // the same without regard to the limit
    void need(const std::string& object, std::size_t bytes);    // as set; throws the refusal (COMM LIMIT) instead of false
    void clear() {
        if (bytes_ != 0) force(0);
    }

private:
    AccountPointer account_;
    std::size_t bytes_ = 0;
    Account::Use use_ = Account::Use::objects;
};

// The accounts of one SORM.
class Budget {
public:
    // For each principal, and for all together [bytes].
    void setLimits(std::size_t principal, std::size_t total);
    // A principal's account; null: the owner's. A user has one account whatever his groups and addresses. A network of IPv6
    // (/64) counts as one host.
    AccountPointer of(const PrincipalPointer& principal);
    // The account for what is made now: of the sender of the present request, else of the author of the words. Null: none.
    AccountPointer ofCaller(const PrincipalPointer& author = nullptr);
    std::vector<AccountPointer> accounts() const;
    std::string text() const;                                   // for people, a line for each account, the largest first

private:
    std::shared_ptr<Account::Books> books_ = std::make_shared<Account::Books>();
    mutable std::mutex mutex_;
    struct Key {
        Principal::Kind kind;
        uid_t uid;
        Principal::Address address;
        auto operator<=>(const Key&) const = default;
    };
    static Key keyOf(const Principal& principal);
    std::map<Key, std::weak_ptr<Account>> accounts_;
    AccountPointer owner_;
    std::size_t sweepAt_ = 64;
};

}  // namespace sorma
