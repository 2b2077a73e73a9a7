// kept.h -- what stays for somebody after his request: a Charged value pays for its memory, and its text is cut before.
//
// A Charged<T> holds a thing that is kept because of a peer's words: sessions, names, entries of the dictionary, values of
// options and services, audit, refusals, trails. Its bytes are on the account of who caused it, and are given back with the
// value.
// A limit by count stays beside it where there is one.
//
// A type T of several members says what it holds: std::size_t heap() const, in bytes beyond sizeof(T).
//
// Threads: a Charged value belongs to one thread at a time, as its Charge.
#pragma once

#include <concepts>
#include <cstddef>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "bus/budget.h"

namespace sorma {

// How much of a text is kept [bytes].
inline constexpr std::size_t kKeptName = 256;           // names of people, hosts and programs
inline constexpr std::size_t kKeptText = 1000;          // a request, or a line of a trail
inline constexpr std::size_t kQuotedText = 4096;        // what an error quotes

// The text, or its beginning and how much is missing: "abc... 9 999 950 bytes more", at most so many bytes in all. most: 64
// or more. UTF-8 is not cut inside a character. This is the one place that cuts the text of a peer.
std::string cutText(std::string_view text, std::size_t most = kKeptText);
// The same in place; text that is short enough is not touched.
void cutInPlace(std::string& text, std::size_t most = kKeptText);
// A trail as it is kept: each of its texts is cut.
Trail cutTrail(const Trail& trail);

// Bytes that a value holds beyond its own size.
template <class T> concept SaysHeap = requires(const T& value) {
    { value.heap() } -> std::convertible_to<std::size_t>;
};
template <SaysHeap T> std::size_t heapOf(const T& value) { return value.heap(); }
template <class T> requires std::is_arithmetic_v<T> std::size_t heapOf(T) { return 0; }
std::size_t heapOf(const std::string& text);
std::size_t heapOf(const Entry& entry);
std::size_t heapOf(const Trail& trail);
std::size_t heapOf(const Message& message);
template <class T> std::size_t heapOf(const std::vector<T>& values) {
    std::size_t bytes = values.capacity() * sizeof(T);
    if constexpr (!std::is_arithmetic_v<T>)
        for (auto& value : values) bytes += heapOf(value);
    return bytes;
}
template <class... T> std::size_t heapOf(const std::variant<T...>& value) {
    return std::visit([](auto& held) { return heapOf(held); }, value);
}

// Free the memory that a value holds. Assigning an empty one is not enough: a text then keeps its memory.
template <class T> void freeMemory(T& value) { [[maybe_unused]] const T old = std::exchange(value, T()); }

// A value, and its bytes on an account. The account may be null: then it is this process's own, and charged to nobody.
template <class T> class Charged {
public:
    static constexpr std::size_t kNode = 64;            // of the container that keeps it [bytes]

    Charged() = default;
    // Fails with COMM LIMIT when it is too much. object: who keeps it, for the message.
    Charged(const std::string& object, AccountPointer account, Account::Use use, T value)
        : value_(std::move(value)), charge_(std::move(account), use) {
        charge_.need(object, bytes());
    }
    // Without regard to the limit: small things, of which there is a limit by count.
    static Charged forced(AccountPointer account, Account::Use use, T value) {
        Charged out;
        out.value_ = std::move(value);
        out.charge_ = Charge(std::move(account), use);
        out.charge_.force(out.bytes());
        return out;
    }

    const T& operator*() const { return value_; }
    const T* operator->() const { return &value_; }
    const AccountPointer& account() const { return charge_.account(); }

    // Another value in its place, which fill(T&) writes over the present one: so it can use the memory again. bytes: what it
    // will hold beyond sizeof(T). Fails with COMM LIMIT when that is too much; then nothing has changed.
    template <class Fill>
    void refill(const std::string& object, AccountPointer account, Account::Use use, std::size_t bytes, Fill fill) {
        const std::size_t wanted = sizeof(T) + kNode + bytes;
        if (account == charge_.account()) {
            charge_.need(object, wanted);
        } else {
            Charge fresh(std::move(account), use);
            fresh.need(object, wanted);
            charge_ = std::move(fresh);
        }
        if (heapOf(value_) > 2 * bytes + 1024) freeMemory(value_);      // of a larger value before
        fill(value_);
        charge_.force(this->bytes());
    }
    // Change it without regard to the limit, on the same account or on another one.
    template <class Change> void edit(Change change) {
        change(value_);
        charge_.force(bytes());
    }
    template <class Change> void charge(AccountPointer account, Account::Use use, Change change) {
        if (account != charge_.account()) charge_ = Charge(std::move(account), use);
        edit(std::move(change));
    }
    // A second one of the same account.
    Charged again() const { return forced(charge_.account(), charge_.use(), value_); }
    // The value, which is charged to nobody any more.
    T release() {
        charge_.clear();
        return std::move(value_);
    }

private:
    std::size_t bytes() const { return charge_.account() ? sizeof(T) + kNode + heapOf(value_) : 0; }

    T value_{};
    Charge charge_;
};

}  // namespace sorma
