// users.h -- names of users, as this host knows them. Header only: the snapshot library stands alone.
#pragma once

#include <pwd.h>
#include <sys/types.h>

#include <cerrno>
#include <string>
#include <string_view>
#include <vector>

namespace sorma {

// getpwuid_r and its like, with as much room as they want.
template <class Record, class Look> bool lookUpEntry(Record& record, std::vector<char>& space, Look look) {
    space.resize(1024);
    Record* found = nullptr;
    int result;
    while ((result = look(&record, space.data(), space.size(), &found)) == ERANGE && space.size() < 1 << 20) space.resize(space.size() * 2);
    return result == 0 && found;
}

// The user's name, or the number when there is none.
inline std::string userName(uid_t uid) {
    passwd entry{};
    std::vector<char> space;
    bool known = lookUpEntry(entry, space, [uid](auto... rest) { return getpwuid_r(uid, rest...); });
    return known ? std::string(entry.pw_name) : std::to_string(uid);
}

// False: there is no such user.
inline bool userNumber(std::string_view name, uid_t& out) {
    passwd entry{};
    std::vector<char> space;
    std::string text(name);
    if (!lookUpEntry(entry, space, [&](auto... rest) { return getpwnam_r(text.c_str(), rest...); })) return false;
    out = entry.pw_uid;
    return true;
}

}  // namespace sorma
