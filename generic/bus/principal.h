// principal.h -- who wrote a word, as far as somebody who can be trusted says so: the kernel, or else nobody.
//
// The owner of this process is no principal: a null pointer stands for him. He is this user, or root, in the process
// itself or by a Unix-domain socket. Everybody else is one of these:
//
//     user anna              by Unix socket; the kernel says which user and which groups
//     local anna             by TCP from this host; the kernel says whose socket it is
//     host 192.168.7.21      by TCP; the address is all that is known
//     anyone                 nobody can say; also whoever only has somebody else pass his words on
//
// Interned: two peers that are the same principal share one object, and serial() is never used again.
// Threads: any.
#pragma once

#include <sys/types.h>

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace sorma {

class Principal;
using PrincipalPointer = std::shared_ptr<const Principal>;      // null: the owner

class Principal {
public:
    enum class Kind : std::uint8_t { user, local, host, anyone };
    // Numeric, IPv4 as ::ffff:a.b.c.d. All zero: not by TCP.
    using Address = std::array<unsigned char, 16>;

    // By Unix socket. Null, the owner, when it is this user or root. groups: of the process at the other end.
    static PrincipalPointer user(uid_t uid, std::vector<gid_t> groups);
    static PrincipalPointer local(uid_t uid, const Address& address);
    static PrincipalPointer host(const Address& address);
    static PrincipalPointer anyone(const Address& address = {});
    static const PrincipalPointer& nobody();                    // anyone, of no address

    // From toText(). A user that this host does not know, and whatever else cannot be read, is anyone.
    static PrincipalPointer parse(std::string_view text);
    // As the subject of a policy's line: "host 192.168.7.21".
    std::string toText() const;

    // Whose words are those that two have written together? Of the owner and another one: the other one's.
    static const PrincipalPointer& both(const PrincipalPointer& a, const PrincipalPointer& b);

    Kind kind() const { return kind_; }
    uid_t uid() const { return uid_; }                          // user, local
    const std::vector<gid_t>& groups() const { return groups_; }    // user
    const Address& address() const { return address_; }
    bool byNetwork() const { return address_ != Address{}; }
    std::uint64_t serial() const { return serial_; }

    static std::string toText(const Address& address);          // "192.168.7.21", "fe80::1"
    static bool fromText(std::string_view text, Address& out);  // numeric only

private:
    Principal() = default;
    static PrincipalPointer intern(Principal wanted);

    Kind kind_ = Kind::anyone;
    uid_t uid_ = 0;
    std::vector<gid_t> groups_;         // sorted
    Address address_{};
    std::uint64_t serial_ = 0;
};

// Names of users as the system has them. userName of an unknown one is its number.
std::string userName(uid_t uid);
bool userNumber(std::string_view name, uid_t& out);
bool groupNumber(std::string_view name, gid_t& out);

}  // namespace sorma
