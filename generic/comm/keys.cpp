#include "comm/keys.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <fstream>
#include <map>
#include <mutex>
#include <sstream>

#include "bus/descriptor.h"
#include "bus/users.h"

namespace sorma::keys {

namespace {

std::string variable(const char* name) {
    const char* value = getenv(name);
    return value ? value : "";
}

std::string firstWord(const std::string& path) {
    std::ifstream in(path);
    std::string word;
    in >> word;
    return word;
}

}  // namespace

std::string folder() {
    if (auto own = variable("SORMA_KEYS"); !own.empty()) return own;
    if (auto config = variable("XDG_CONFIG_HOME"); !config.empty()) return config + "/sorma/keys";
    auto home = variable("HOME");
    return home.empty() ? home : home + "/.config/sorma/keys";
}

std::string file(const std::string& name) { return folder() + "/" + name; }

bool present() { return !folder().empty() && (access(file("own").c_str(), F_OK) == 0 || access(file("authority.pem").c_str(), F_OK) == 0); }

std::string ownName(const std::string& daemon) {
    if (!daemon.empty() && access(file(daemon + ".pem").c_str(), F_OK) == 0) return daemon;
    return firstWord(file("own"));
}

std::string stamp(std::initializer_list<std::string> names) {
    std::string out = folder();
    for (auto& name : names) {
        struct stat s;
        if (stat(file(name).c_str(), &s) == 0)
            out += ' ' + std::to_string(s.st_ino) + ':' + std::to_string(s.st_size) + ':' + std::to_string(s.st_mtim.tv_sec) + '.' + std::to_string(s.st_mtim.tv_nsec);
    }
    return out;
}

std::string unreadable(const std::string& name) {
    struct stat s;
    if (lstat(file(name).c_str(), &s) != 0) return errno == ENOENT ? "" : std::strerror(errno);
    const Descriptor in(open(file(name).c_str(), O_RDONLY | O_CLOEXEC));
    char first;
    return in && read(in.get(), &first, 1) >= 0 ? "" : std::strerror(errno);
}

std::string pinned(const std::string& name) {
    static std::mutex mutex;
    static auto& pins = *new std::map<std::string, std::string>;
    static auto& read = *new std::string;               // stamp() of the file that is in pins
    std::lock_guard lock(mutex);
    if (auto now = stamp({"pins"}); now != read) {
        pins.clear();
        std::ifstream in(file("pins"));
        std::string line, one, since;
        while (std::getline(in, line))
            if (std::istringstream words(line); words >> one >> since) pins.emplace(one, since);
        read = now;
    }
    auto found = pins.find(name);
    return found == pins.end() ? std::string() : found->second;
}

// One write, so that processes that pin at the same time do not mix their lines.
std::string pin(const std::string& name) {
    if (!pinned(name).empty()) return {};
    char date[16] = "";
    const time_t now = time(nullptr);
    struct tm parts;
    strftime(date, sizeof date, "%Y-%m-%d", gmtime_r(&now, &parts));
    const std::string line = name + ' ' + date + '\n';
    const Descriptor out(open(file("pins").c_str(), O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0600));
    if (out && write(out.get(), line.data(), line.size()) == ssize_t(line.size())) return {};
    return file("pins") + ": " + std::strerror(errno);
}

std::set<std::string> revoked() {
    std::ifstream in(file("revoked"));
    std::set<std::string> all;
    for (std::string line, word; std::getline(in, line);)
        if (std::istringstream words(line); words >> word && word[0] != '#') all.insert(word);
    return all;
}

std::string exposed(const std::string& path) {
    struct stat s;
    if (stat(path.c_str(), &s) != 0) return std::strerror(errno);
    if (s.st_uid != geteuid() && s.st_uid != 0) return "it belongs to " + userName(s.st_uid);
    if (s.st_mode & 077) return "others than its owner may read it: chmod 600 " + path;
    return {};
}

}  // namespace sorma::keys
