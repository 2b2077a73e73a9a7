#include "bus/principal.h"

#include <arpa/inet.h>
#include <grp.h>
#include <netinet/in.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <mutex>
#include <tuple>

namespace sorma {

namespace {

constexpr std::string_view kAnd = " + ";
constexpr std::string_view kTooMany = "too many authors";
constexpr std::size_t kMostMembers = 16;
constexpr unsigned char kMapped[12] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xff, 0xff};     // ::ffff:

}  // namespace

bool groupNumber(std::string_view name, gid_t& out) {
    group entry{};
    std::vector<char> space;
    std::string text(name);
    if (!lookUpEntry(entry, space, [&](auto... rest) { return getgrnam_r(text.c_str(), rest...); })) return false;
    out = entry.gr_gid;
    return true;
}

std::vector<gid_t> groupsOf(uid_t uid) {
    passwd entry{};
    std::vector<char> space;
    if (!lookUpEntry(entry, space, [uid](auto... rest) { return getpwuid_r(uid, rest...); })) return {};
    int count = 32;
    std::vector<gid_t> groups(static_cast<std::size_t>(count));
    while (getgrouplist(entry.pw_name, entry.pw_gid, groups.data(), &count) < 0) groups.resize(static_cast<std::size_t>(count) + 1);
    groups.resize(static_cast<std::size_t>(count));
    return groups;
}

// The table holds who is in use somewhere; it is swept when it has doubled, so it stays in proportion to that.
PrincipalPointer Principal::intern(Principal wanted) {
    using Key = std::tuple<Kind, uid_t, std::vector<gid_t>, std::vector<PrincipalPointer>, Address, std::string, std::string, bool>;
    static std::mutex mutex;
    static auto& table = *new std::map<Key, std::weak_ptr<const Principal>>;    // outlives every thread
    static std::size_t sweepAt = 64;
    static std::uint64_t last = 0;
    std::lock_guard lock(mutex);
    auto& entry = table[{wanted.kind_, wanted.uid_, wanted.groups_, wanted.members_, wanted.address_, wanted.certificate_, wanted.authority_, wanted.own_}];
    if (auto known = entry.lock()) return known;
    wanted.serial_ = ++last;
    PrincipalPointer fresh(new Principal(std::move(wanted)));
    entry = fresh;
    if (table.size() >= sweepAt) {
        std::erase_if(table, [](auto& item) { return item.second.expired(); });
        sweepAt = std::max<std::size_t>(64, 2 * table.size());
    }
    return fresh;
}

PrincipalPointer Principal::user(uid_t uid, std::vector<gid_t> groups) {
    if (uid == geteuid() || uid == 0) return nullptr;
    Principal p;
    p.kind_ = Kind::user;
    p.uid_ = uid;
    std::sort(groups.begin(), groups.end());
    groups.erase(std::unique(groups.begin(), groups.end()), groups.end());
    p.groups_ = std::move(groups);
    return intern(std::move(p));
}

PrincipalPointer Principal::local(uid_t uid, const Address& address) {
    Principal p;
    p.kind_ = Kind::local;
    p.uid_ = uid;
    p.address_ = address;
    return intern(std::move(p));
}

PrincipalPointer Principal::host(const Address& address) {
    Principal p;
    p.kind_ = Kind::host;
    p.address_ = address;
    return intern(std::move(p));
}

PrincipalPointer Principal::anyone(const Address& address) {
    Principal p;
    p.address_ = address;
    return intern(std::move(p));
}

PrincipalPointer Principal::cert(std::string_view name, std::string_view organisation, std::string authority, bool own, const Address& address) {
    Principal p;
    p.kind_ = Kind::cert;
    p.certificate_ = name;
    if (!organisation.empty()) p.certificate_ += '@' + std::string(organisation);
    p.authority_ = std::move(authority);
    p.own_ = own;
    p.address_ = address;
    return intern(std::move(p));
}

PrincipalPointer Principal::web(std::string_view login) {
    Principal p;
    p.kind_ = Kind::web;
    p.certificate_ = login;
    return intern(std::move(p));
}

std::string Principal::toText() const {
    switch (kind_) {
        case Kind::user: return "user " + userName(uid_);
        case Kind::local: return "local " + userName(uid_);
        case Kind::host: return "host " + toText(address_);
        case Kind::cert: return "cert " + certificate_;
        case Kind::web: return "web " + certificate_;
        case Kind::several: {
            std::string out;
            for (auto& member : members_) out += std::string(out.empty() ? std::string_view() : kAnd) + member->toText();
            return out.empty() ? std::string(kTooMany) : out;
        }
        case Kind::anyone: break;
    }
    return "anyone";
}

PrincipalPointer Principal::parse(std::string_view text) {
    if (auto at = text.find(kAnd); at != text.npos) return both(parse(text.substr(0, at)), parse(text.substr(at + kAnd.size())));
    if (text == kTooMany) {
        Principal p;
        p.kind_ = Kind::several;
        return intern(std::move(p));
    }
    auto gap = text.find(' ');
    std::string_view kind = text.substr(0, gap), rest = gap == text.npos ? std::string_view() : text.substr(gap + 1);
    Address address{};
    uid_t uid = 0;
    if (kind == "host" && fromText(rest, address)) return host(address);
    if (kind == "local" && userNumber(rest, uid)) {
        fromText("127.0.0.1", address);
        return local(uid, address);
    }
    if (kind == "cert" && !rest.empty()) return cert(rest, {}, {}, false, {});
    if (kind == "web" && !rest.empty()) return web(rest);
    if (kind == "user" && userNumber(rest, uid)) return user(uid, groupsOf(uid));
    return anyone();
}

PrincipalPointer Principal::both(const PrincipalPointer& a, const PrincipalPointer& b) {
    if (!a) return b;
    if (!b || a == b) return a;
    Principal p;
    p.kind_ = Kind::several;
    for (auto* one : {&a, &b}) {
        const bool many = (*one)->kind() == Kind::several;
        if (many && (*one)->members_.empty()) return *one;
        if (many) p.members_.insert(p.members_.end(), (*one)->members_.begin(), (*one)->members_.end());
        else p.members_.push_back(*one);
    }
    auto bySerial = [](auto& x, auto& y) { return x->serial() < y->serial(); };
    std::sort(p.members_.begin(), p.members_.end(), bySerial);
    p.members_.erase(std::unique(p.members_.begin(), p.members_.end()), p.members_.end());
    if (p.members_.size() == 1) return p.members_[0];
    if (p.members_.size() > kMostMembers) p.members_.clear();
    return intern(std::move(p));
}

const PrincipalPointer& Principal::nobody() {
    static const PrincipalPointer one = anyone();
    return one;
}

bool Principal::isIPv4(const Address& address) { return std::memcmp(address.data(), kMapped, sizeof kMapped) == 0; }

Principal::Address Principal::fromIPv4(const void* four) {
    Address out;
    std::memcpy(out.data(), kMapped, sizeof kMapped);
    std::memcpy(out.data() + sizeof kMapped, four, 4);
    return out;
}

std::string Principal::toText(const Address& address) {
    char text[INET6_ADDRSTRLEN] = "";
    if (isIPv4(address)) inet_ntop(AF_INET, address.data() + sizeof kMapped, text, sizeof text);
    else inet_ntop(AF_INET6, address.data(), text, sizeof text);
    return text;
}

bool Principal::fromText(std::string_view text, Address& out) {
    std::string copy(text);
    Address read{};
    in_addr four{};
    if (inet_pton(AF_INET, copy.c_str(), &four) == 1) read = fromIPv4(&four);
    else if (inet_pton(AF_INET6, copy.c_str(), read.data()) != 1) return false;
    out = read;
    return true;
}

}  // namespace sorma
