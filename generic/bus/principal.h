// principal.h -- who wrote a word, as the kernel says. A claim of a peer about itself never counts.
//
// A null pointer stands for the owner of this process: this user or root, in the process itself or by a Unix-domain socket.
// All others are one of these:
//
//     user anna              by Unix socket; the kernel knows the user and the groups
//     local anna             by TCP from this host; the kernel knows whose socket it is
//     host 192.168.7.21      by TCP; only the address is known
//     cert desk@lab          by TCP with TLS, from whatever address: the name and organisation in a certificate that was verified
//     web anna               logged in at a web server of the daemon's user (sorma-web), which passes the words on
//     anyone                 not known; also the author of words that a neighbour without the right `relay` passes on
//     A + B                  words that several have written together: whatever they ask for, each of them needs the right to
//
// Principals are interned: equal ones are the same object. No two ever have the same serial().
// Threads: any.
#pragma once

#include <sys/types.h>

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "bus/users.h"

namespace sorma {

class Principal;
using PrincipalPointer = std::shared_ptr<const Principal>;      // null: the owner

class Principal {
public:
    enum class Kind : std::uint8_t { user, local, host, anyone, several, cert, web };
    // IPv6, or IPv4 as ::ffff:a.b.c.d. All zero: not by TCP.
    using Address = std::array<unsigned char, 16>;

    // By Unix socket. Returns null, the owner, for this user and root.   groups: of the process at the other end.
    static PrincipalPointer user(uid_t uid, std::vector<gid_t> groups);
    static PrincipalPointer local(uid_t uid, const Address& address);
    static PrincipalPointer host(const Address& address);
    static PrincipalPointer anyone(const Address& address = {});
    // authority: names the one that has signed the certificate; empty: a neighbour says it.   own: it is that of this user's own keys.
    static PrincipalPointer cert(std::string_view name, std::string_view organisation, std::string authority, bool own, const Address& address);
    static PrincipalPointer web(std::string_view login);
    static const PrincipalPointer& nobody();                    // anyone, without an address

    // From toText(). A user has the groups that this host knows. A user that it does not know, and all text that cannot be
    // read, is anyone.
    static PrincipalPointer parse(std::string_view text);
    // As the subject of a policy's line: "host 192.168.7.21". Several are all named: "user anna + host 192.168.7.21".
    std::string toText() const;

    // The author of words that two have written together: both of them, each one once. When one of them is the owner, it is
    // the other one. More than 16 together have no right at all.
    static PrincipalPointer both(const PrincipalPointer& a, const PrincipalPointer& b);

    Kind kind() const { return kind_; }
    uid_t uid() const { return uid_; }                          // user, local
    const std::vector<gid_t>& groups() const { return groups_; }    // user
    const std::vector<PrincipalPointer>& members() const { return members_; }       // several; empty: too many of them
    const Address& address() const { return address_; }
    const std::string& certificate() const { return certificate_; }     // cert: NAME@ORGANISATION, or NAME; web: the login
    const std::string& authority() const { return authority_; }         // cert: as given
    bool ofOwnAuthority() const { return own_; }                // cert
    bool byNetwork() const { return address_ != Address{}; }
    std::uint64_t serial() const { return serial_; }

    static std::string toText(const Address& address);          // "192.168.7.21", "fe80::1"
    static bool fromText(std::string_view text, Address& out);  // numeric only
    static bool isIPv4(const Address& address);
    static Address fromIPv4(const void* four);                  // its four bytes

private:
    Principal() = default;
    static PrincipalPointer intern(Principal wanted);

    Kind kind_ = Kind::anyone;
    uid_t uid_ = 0;
    std::vector<gid_t> groups_;         // sorted
    std::vector<PrincipalPointer> members_;     // by serial
    Address address_{};
    std::string certificate_, authority_;
    bool own_ = false;
    std::uint64_t serial_ = 0;
};

// Users of this host, as bus/users.h. False: there is no such group.
bool groupNumber(std::string_view name, gid_t& out);
std::vector<gid_t> groupsOf(uid_t uid);                        // empty: this host does not know the user

}  // namespace sorma
