#include "bus/principal.h"

#include <arpa/inet.h>
#include <grp.h>
#include <netinet/in.h>
#include <pwd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <map>
#include <mutex>
#include <tuple>

namespace sorma {

namespace {

constexpr unsigned char kMapped[12] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xff, 0xff};

bool isMapped(const Principal::Address& a) { return std::memcmp(a.data(), kMapped, sizeof kMapped) == 0; }

// getpwuid_r and its like, with as much room as they want.
template <class Record, class Look> bool lookUp(Record& record, std::vector<char>& space, Look look) {
    space.resize(1024);
    Record* found = nullptr;
    int result;
    while ((result = look(&record, space.data(), space.size(), &found)) == ERANGE && space.size() < 1 << 20) space.resize(space.size() * 2);
    return result == 0 && found;
}

}  // namespace

std::string userName(uid_t uid) {
    passwd entry{};
    std::vector<char> space;
    bool known = lookUp(entry, space, [uid](auto... rest) { return getpwuid_r(uid, rest...); });
    return known ? std::string(entry.pw_name) : std::to_string(uid);
}

bool userNumber(std::string_view name, uid_t& out) {
    passwd entry{};
    std::vector<char> space;
    std::string text(name);
    if (!lookUp(entry, space, [&](auto... rest) { return getpwnam_r(text.c_str(), rest...); })) return false;
    out = entry.pw_uid;
    return true;
}

bool groupNumber(std::string_view name, gid_t& out) {
    group entry{};
    std::vector<char> space;
    std::string text(name);
    if (!lookUp(entry, space, [&](auto... rest) { return getgrnam_r(text.c_str(), rest...); })) return false;
    out = entry.gr_gid;
    return true;
}

// The table holds who is in use somewhere; it is swept when it has doubled, so it stays in proportion to that.
PrincipalPointer Principal::intern(Principal wanted) {
    using Key = std::tuple<Kind, uid_t, std::vector<gid_t>, Address>;
    static std::mutex mutex;
    static auto& table = *new std::map<Key, std::weak_ptr<const Principal>>;    // outlives every thread
    static std::size_t sweepAt = 64;
    static std::uint64_t last = 0;
    std::lock_guard lock(mutex);
    auto& entry = table[{wanted.kind_, wanted.uid_, wanted.groups_, wanted.address_}];
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

std::string Principal::toText() const {
    switch (kind_) {
        case Kind::user: return "user " + userName(uid_);
        case Kind::local: return "local " + userName(uid_);
        case Kind::host: return "host " + toText(address_);
        case Kind::anyone: break;
    }
    return "anyone";
}

PrincipalPointer Principal::parse(std::string_view text) {
    auto gap = text.find(' ');
    std::string_view kind = text.substr(0, gap), rest = gap == text.npos ? std::string_view() : text.substr(gap + 1);
    Address address{};
    uid_t uid = 0;
    if (kind == "host" && fromText(rest, address)) return host(address);
    if (kind == "local" && userNumber(rest, uid)) {
        fromText("127.0.0.1", address);
        return local(uid, address);
    }
    if (kind == "user" && userNumber(rest, uid)) return user(uid, {});
    return anyone();
}

const PrincipalPointer& Principal::both(const PrincipalPointer& a, const PrincipalPointer& b) {
    if (!a) return b;
    if (!b || a == b) return a;
    return nobody();
}

const PrincipalPointer& Principal::nobody() {
    static const PrincipalPointer one = anyone();
    return one;
}

std::string Principal::toText(const Address& address) {
    char text[INET6_ADDRSTRLEN] = "";
    if (isMapped(address)) inet_ntop(AF_INET, address.data() + sizeof kMapped, text, sizeof text);
    else inet_ntop(AF_INET6, address.data(), text, sizeof text);
    return text;
}

bool Principal::fromText(std::string_view text, Address& out) {
    std::string copy(text);
    Address read{};
    if (inet_pton(AF_INET, copy.c_str(), read.data() + sizeof kMapped) == 1) std::memcpy(read.data(), kMapped, sizeof kMapped);
    else if (inet_pton(AF_INET6, copy.c_str(), read.data()) != 1) return false;
    out = read;
    return true;
}

}  // namespace sorma
