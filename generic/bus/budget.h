// budget.h -- how much memory others may make this process keep for them: each principal, and all together.
//
// What a request leaves behind, or needs much of, is a Charge on the Account of the principal who has asked: long requests,
// replies that are kept, what waits for a peer, subscriptions, objects, segments of shared memory. A small call that is
// answered at once is charged nothing.
//
// What this process does for itself is not charged. The owner by Unix-domain socket has no limit but the one for all, of which
// the last quarter is his alone: whatever others keep, he is let in.
//
// Threads: any. Accounts outlive their budget as long as something is charged to them.
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

class Account {
public:
    enum class Use : std::uint8_t { requests, replies, queues, subscriptions, objects, segments };
    static constexpr std::size_t kUses = 6;

    const std::string& name() const { return name_; }           // as the subject of a policy's line; "the owner"
    bool owner() const { return owner_; }
    std::size_t used() const { return used_.load(std::memory_order_relaxed); }
    std::size_t limit() const;
    bool fits(std::size_t bytes) const;                         // could so much be charged now?
    // Some things are charged whatever the limit, since they are small and there already: then he gets nothing new. Where all
    // together have too much, that is for those who have more than a little.
    bool over() const { return !owner_ && exceeded(); }
    // What to tell who cannot have so much: COMM LIMIT, with the limit's name. The refusal is counted.
    Entry refusal(const std::string& object, Use use, std::size_t bytes);

    std::atomic<std::uint32_t> connections{0};

private:
    friend class Budget;
    friend class Charge;
    // Limits and sum of all accounts. Relaxed everywhere: numbers that order nothing.
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

// So many bytes on an account, given back when this goes.
class Charge {
public:
    Charge() = default;                                         // on nobody's: always granted
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
    bool set(std::size_t bytes);                                // from now on so many; false: too many, nothing has changed
    void force(std::size_t bytes);                              // the same whatever the limit
    void need(const std::string& object, std::size_t bytes);    // set, or throws the refusal
    void clear() {
        if (bytes_ != 0) force(0);
    }

private:
    AccountPointer account_;
    std::size_t bytes_ = 0;
    Account::Use use_ = Account::Use::objects;
};

class Budget {
public:
    // Of each principal, and of all together [bytes].
    void setLimits(std::size_t principal, std::size_t total);
    // A principal's account; null: the owner's. A user has one whatever his groups and addresses, a network of IPv6 (/64) is
    // one host.
    AccountPointer of(const PrincipalPointer& principal);
    // Whom to charge for what is made now: whoever sent the present request, else the author of the words. Null: nobody.
    AccountPointer ofCaller(const PrincipalPointer& author = nullptr);
    std::vector<AccountPointer> accounts() const;
    std::string text() const;                                   // a line for each account, the largest first

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
