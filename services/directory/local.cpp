// The directory of one host: it needs no server.

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <map>

#include <sorma.h>

#include "comm/runtimeFolder.h"
#include "rows.h"

namespace directory {

namespace {

using sorma::Descriptor;
using sorma::Directory;
using sorma::runtimeFolder;

// The directory of one host. A claim is a file with a lock, which the kernel takes away when its process ends.
class LocalDirectory : public Directory {
public:
    std::string describe() const override { return "local " + runtimeFolder(); }

    void claim(const Entry& wanted) override {
        Held& own = held_[wanted.name];
        if (own.file) own.file.close();
        own.entry = wanted;
        take(own);
    }

    Claim claimed(const std::string& name) override {
        const auto found = held_.find(name);
        if (found == held_.end()) return {};
        Held& own = found->second;
        if (!own.file) take(own);
        if (!own.file) return {Claim::State::taken, 0, 0, 0, own.why};
        return {Claim::State::owned, own.entry.epoch, sorma::bootNow(), 0, {}};
    }

    void release(const std::vector<std::string>& names) override {
        for (auto& name : names) {
            const auto found = held_.find(name);
            if (found == held_.end()) continue;
            if (found->second.file) unlink(path(name).c_str());
            held_.erase(found);
        }
    }

    Found find(const std::string& name) override {
        Entry entry{name};
        if (read(entry)) return {Found::State::known, entry, 0, {}};
        const std::string socket = sorma::runtimeSocket(name);
        if (access(socket.c_str(), F_OK) != 0) return {Found::State::absent, {}, 0, "no daemon of this user listens on " + socket};
        entry.machine = sorma::thisMachine();
        entry.addresses = {socket};
        return {Found::State::known, entry, 0, {}};
    }

    std::vector<Entry> entries() override {
        std::vector<Entry> out;
        for (auto& name : sorma::namesIn(runtimeFolder(), kClaim))
            if (Entry entry{name}; read(entry)) out.push_back(std::move(entry));
        return out;
    }

    void wait(std::int64_t until) override { poll(nullptr, 0, int(std::clamp<std::int64_t>((until - sorma::monotonicNow()) / 1'000'000, 0, 10))); }

    ~LocalDirectory() override {
        while (!held_.empty()) release({held_.begin()->first});
    }

private:
    static constexpr std::string_view kClaim = ".claim";
    struct Held {
        Entry entry;
        Descriptor file;                // locked; none: somebody else has the name
        std::string why;
    };

    static std::string path(const std::string& name) { return runtimeFolder() + "/" + name + std::string(kClaim); }

    // Its own lock belongs to the open file, so that two in one process exclude each other.
    static bool locked(int fd, short kind, int command) {
        struct flock lock{};
        lock.l_type = kind;
        lock.l_whence = SEEK_SET;
        return fcntl(fd, command, &lock) == 0 && (command == F_OFD_SETLK || lock.l_type != F_UNLCK);
    }

    void take(Held& own) {
        const std::string file = path(own.entry.name);
        for (;;) {
            Descriptor fd(open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600));
            if (!fd) return void(own.why = file + ": " + std::strerror(errno));
            if (!locked(fd.get(), F_WRLCK, F_OFD_SETLK)) {
                Entry other{own.entry.name};
                own.why = read(other) ? other.identity : "another process";
                return;
            }
            // The one before may have removed the file that we have opened.
            struct stat mine{}, there{};
            if (fstat(fd.get(), &mine) < 0 || stat(file.c_str(), &there) < 0 || mine.st_ino != there.st_ino) continue;
            own.entry.epoch = sorma::bootNow();
            std::string text = own.entry.identity + '\n' + own.entry.machine + '\n' + std::to_string(own.entry.epoch) + '\n';
            for (auto& address : own.entry.addresses) text += address + '\n';
            if (ftruncate(fd.get(), 0) < 0 || pwrite(fd.get(), text.data(), text.size(), 0) != ssize_t(text.size())) own.why = std::strerror(errno);
            own.file = std::move(fd);
            if (changed) changed(own.entry.name);
            return;
        }
    }

    // Does a living process own it? Then the entry says the rest.
    static bool read(Entry& entry) {
        const Descriptor fd(open(path(entry.name).c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
        if (!fd || !locked(fd.get(), F_RDLCK, F_OFD_GETLK)) return false;
        char text[4096];
        const ssize_t n = pread(fd.get(), text, sizeof text, 0);
        std::vector<std::string> lines;
        std::string_view rest(text, std::size_t(std::max<ssize_t>(n, 0)));
        for (std::size_t end; (end = rest.find('\n')) != rest.npos; rest.remove_prefix(end + 1)) lines.emplace_back(rest.substr(0, end));
        if (lines.size() < 3) return false;
        entry.identity = lines[0], entry.machine = lines[1], entry.epoch = std::strtoll(lines[2].c_str(), nullptr, 10);
        entry.addresses.assign(lines.begin() + 3, lines.end());
        return true;
    }

    std::map<std::string, Held> held_;
};

}  // namespace

std::unique_ptr<Directory> local(sorma::Sorm&, sorma::Loop&, const std::vector<std::string>&) { return std::make_unique<LocalDirectory>(); }

}  // namespace directory
