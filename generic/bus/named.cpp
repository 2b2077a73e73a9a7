#include "bus/named.h"

#include "bus/enumText.h"
#include "bus/service.h"
#include "bus/sorm.h"
#include "bus/wholeFile.h"

namespace sorma {

const char* toText(Kind kind) {
    static constexpr const char* names[] = {"", "file", "colour", "time", "folder", "segment", "program", "address"};
    return names[static_cast<int>(kind)];
}

bool fromText(std::string_view text, Kind& out) { return findText(text, Kind::plain, Kind::address, out); }

// The path of a file, as a policy names it. A segment has one name there, whether as a file or by its key.
static std::string policyPath(const std::string& value) {
    constexpr std::string_view kFolder = "/dev/shm/", kSegment = "/dev/shm/sorma.";
    std::string path = realPath(value);
    return path.starts_with(kSegment) ? std::string(kFolder) + path.substr(kSegment.size()) : path;
}

// A device of this host is a file: serial:/dev/ttyUSB0,9600,8n1. Others have their address.
static std::string addressed(const std::string& value) {
    const auto colon = value.find(':');
    if (value.compare(0, 1, "/") != 0 && (colon == value.npos || value.compare(colon + 1, 1, "/") != 0)) return value;
    const auto begin = value[0] == '/' ? 0 : colon + 1;
    return policyPath(value.substr(begin, value.find(',', begin) - begin));
}

std::optional<KindRight> rightOf(Kind kind, const std::string& value, const std::string& object) {
    if (value.empty()) return std::nullopt;
    if (kind == Kind::file || kind == Kind::folder) return KindRight{Right::files, policyPath(value)};
    if (kind == Kind::address) return KindRight{Right::files, addressed(value)};
    if (kind == Kind::segment) return KindRight{Right::files, "/dev/shm/" + value};
    if (kind == Kind::program) return KindRight{Right::program, object};
    return std::nullopt;
}

// Nothing is asked within a tick: while a cycle runs the object, it keeps what it has.
Permit needKind(const Service& user, const PrincipalPointer& author, Kind kind, const std::string& value) {
    Access& access = user.sorm().access;
    if ((!author && !access.restricted()) || RealtimeOwner::current()) return Permit::owner();
    auto needed = rightOf(kind, value, user.name());
    return needed ? access.need(author, needed->right, needed->subject, user.name()) : Permit::owner();
}

// The object that runs a program is not known here; its permit is for that program all the same.
void checkKind(const Permit& permit, Kind kind, const std::string& value) {
    if (kind == Kind::program) return permit.check(Right::program);
    if (permit.isOwners()) return;
    if (auto needed = rightOf(kind, value, {})) permit.check(needed->right, needed->subject);
}

}  // namespace sorma
