#include "bus/wholeFile.h"

#include <dirent.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <ctime>

#include "bus/catalogue.h"
#include "bus/descriptor.h"

namespace sorma {

namespace {

const Prototype kFile{Severity::error, "DICT FILE", 1, "cannot {1} dictionary file \"{0}\": {2}"};

constexpr std::size_t kMaxFile = std::size_t{64} << 20;

// A process that is killed while it saves leaves a file FILE.new-PID-N. Remove those that are not quite new, of processes that
// have ended. Another host that shares the folder needs less than a minute, too.
void sweepLeftOvers(const std::string& folder, std::string_view file) {
    constexpr std::time_t kAge = 60;        // [s]
    DIR* dir = ::opendir(folder.c_str());
    if (!dir) return;
    const std::string begin = std::string(file) + ".new-";
    while (dirent* e = ::readdir(dir)) {
        std::string_view name = e->d_name;
        if (!name.starts_with(begin)) continue;
        name.remove_prefix(begin.size());
        long process = 0;
        auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), process);
        std::string_view count(end, std::size_t(name.data() + name.size() - end));
        if (error != std::errc() || process <= 0 || count.size() < 2 || count[0] != '-' ||
            count.find_first_not_of("0123456789", 1) != count.npos) continue;
        struct stat s {};
        const std::string path = folder + e->d_name;
        bool ours = ::lstat(path.c_str(), &s) == 0 && S_ISREG(s.st_mode) && s.st_uid == ::geteuid() && s.st_mtime + kAge < ::time(nullptr);
        if (ours && ::kill(pid_t(process), 0) != 0 && errno == ESRCH) ::unlink(path.c_str());
    }
    ::closedir(dir);
}

}  // namespace

void failFile(const std::string& file, const char* verb, const char* why) { fail(kFile, file, verb, why); }

std::string realPath(const std::string& file) {
    auto real = [](const std::string& path) {
        char* found = ::realpath(path.c_str(), nullptr);
        std::string out = found ? found : "";
        std::free(found);
        return out;
    };
    if (auto whole = real(file); !whole.empty()) return whole;
    auto slash = file.rfind('/');
    std::string folder = real(slash == file.npos ? "." : file.substr(0, slash + 1));
    std::string name = slash == file.npos ? file : file.substr(slash + 1);
    return folder.empty() ? file : folder == "/" ? folder + name : folder + "/" + name;
}

bool readFile(const std::string& file, bool mayLack, std::string& text) {
    Descriptor in(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
    if (!in) {
        if (errno == ENOENT && mayLack) return false;
        failFile(file, "read", std::strerror(errno));
    }
    for (char block[16384];;) {
        ssize_t n = ::read(in.get(), block, sizeof block);
        if (n == 0) return true;
        if (n < 0) {
            if (errno == EINTR) continue;
            failFile(file, "read", std::strerror(errno));
        }
        text.append(block, static_cast<std::size_t>(n));
        if (text.size() > kMaxFile) failFile(file, "read", std::strerror(EFBIG));
    }
}

void replaceFile(const std::string& file, std::string_view text, mode_t mode) {
    const std::string target = realPath(file);      // behind symbolic links: the link stays
    struct stat before {};
    const bool existed = ::stat(target.c_str(), &before) == 0;
    static std::atomic<unsigned> count{0};
    std::string temporary;
    Descriptor out;
    do {    // the name is new; not mkstemp, whose mode forgets the umask
        temporary = target + ".new-" + std::to_string(::getpid()) + '-' + std::to_string(count++);
        out = Descriptor(::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode));
    } while (!out && errno == EEXIST);
    if (!out) failFile(file, "write", std::strerror(errno));
    auto giveUp = [&](int error) {
        ::unlink(temporary.c_str());
        failFile(file, "write", std::strerror(error));
    };
    while (!text.empty()) {
        ssize_t n = ::write(out.get(), text.data(), text.size());
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) giveUp(errno);
        text.remove_prefix(static_cast<std::size_t>(n));
    }
    if (existed) {
        // Only root may give a file away; another's file becomes ours then, as with any editor that renames.
        // Owner first: changing it takes set-user-id bits off.
        if (before.st_uid != ::geteuid() || before.st_gid != ::getegid())
            if (::fchown(out.get(), before.st_uid, before.st_gid) != 0 && errno != EPERM) giveUp(errno);
        if (::fchmod(out.get(), before.st_mode & 07777) != 0) giveUp(errno);
    }
    if (::fsync(out.get()) != 0) giveUp(errno);
    if (!out.close()) giveUp(errno);
    if (::rename(temporary.c_str(), target.c_str()) != 0) giveUp(errno);
    // The new name is on disk when its folder is. Some file systems cannot sync folders; the content is safe anyway.
    auto slash = target.rfind('/');
    std::string folder = slash == target.npos ? "./" : target.substr(0, slash + 1);
    sweepLeftOvers(folder, slash == target.npos ? target : target.substr(slash + 1));
    Descriptor at(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (at) (void)!::fsync(at.get());
}

}  // namespace sorma
