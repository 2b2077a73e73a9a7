#include "bus/remembered.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <ctime>

#include "bus/named.h"
#include "bus/sorm.h"

namespace sorma {

namespace {

const Prototype kFile{Severity::error, "DICT FILE", 1, "values are remembered beside the dictionary, and {} cannot be locked: {}"};

// "2026-11-25T19:02:11.120417Z". Its length is fixed, so that one that was cut is none.
std::string timeText(std::int64_t time) {
    const std::time_t seconds = time / 1'000'000;
    std::tm utc{};
    ::gmtime_r(&seconds, &utc);
    char day[32], out[48];
    std::strftime(day, sizeof day, "%Y-%m-%dT%H:%M:%S", &utc);
    std::snprintf(out, sizeof out, "%s.%06dZ", day, int(time % 1'000'000));
    return out;
}

bool parseTime(const std::string& text, std::int64_t& time) {
    std::tm utc{};
    int micro = 0;
    if (std::sscanf(text.c_str(), "%d-%d-%dT%d:%d:%d.%dZ", &utc.tm_year, &utc.tm_mon, &utc.tm_mday, &utc.tm_hour, &utc.tm_min,
                    &utc.tm_sec, &micro) != 7)
        return false;
    utc.tm_year -= 1900;
    --utc.tm_mon;
    time = std::int64_t(::timegm(&utc)) * 1'000'000 + micro;
    return timeText(time) == text;
}

// Others who share the file wait meanwhile.
class Locked {
public:
    explicit Locked(const std::string& file) : fd_(::open(file.c_str(), O_RDONLY | O_CLOEXEC)) {
        int failed = 0;
        while (fd_ < 0 || (failed = ::flock(fd_, LOCK_EX)) != 0)
            if (fd_ < 0 || errno != EINTR) {
                const int error = errno;
                if (fd_ >= 0) ::close(fd_);
                fail(kFile, file, std::string(std::strerror(error)));
            }
    }
    ~Locked() { ::close(fd_); }
    Locked(const Locked&) = delete;
    Locked& operator=(const Locked&) = delete;

private:
    int fd_;
};

}  // namespace

std::string Remembered::file() const {
    auto& files = sorm_.dictionary().files();
    return files.empty() ? std::string() : files.back() + ".remembered";
}

void Remembered::read() {
    const std::string path = file();
    struct stat facts{};
    std::pair<std::int64_t, std::uint64_t> state;
    if (!path.empty() && ::stat(path.c_str(), &facts) == 0)
        state = {std::int64_t(facts.st_mtim.tv_sec) * 1'000'000'000 + facts.st_mtim.tv_nsec, facts.st_ino};
    if (path == read_ && state == state_) return;
    read_ = path;
    state_ = state;
    known_.clear();
    if (state.second == 0) return;
    Dictionary file;
    file.loadGood(path);
    for (auto& word : file.words()) {
        const auto slash = word.find('/');
        auto& words = *file.get(word);
        Value v;
        // Lines that were cut or spoilt are left out, and so is an option that somebody has written without its time.
        if (slash == word.npos || words.size() != 3 || !parseTime(words[1], v.time)) continue;
        v.option = word.substr(slash + 1);
        v.text = words[0];
        v.by = words[2];
        v.author = file.authorOf(word);
        auto& values = known_[word.substr(0, slash)];
        values.insert(v.option == kSwitch ? values.begin() : values.end(), std::move(v));
    }
}

std::vector<Remembered::Value> Remembered::of(std::string_view object) {
    if (file().empty()) return {};
    read();
    auto found = known_.find(object);
    return found == known_.end() ? std::vector<Value>() : found->second;
}

void Remembered::set(std::string_view object, Value value) {
    auto key = std::pair(std::string(object), value.option);
    fresh_.insert_or_assign(std::move(key), std::move(value));
}

void Remembered::forget(std::string_view object, std::string_view option) {
    fresh_.insert_or_assign(std::pair(std::string(object), std::string(option)), Value());
}

void Remembered::flush() {
    if (fresh_.empty()) return;
    const std::string path = file();
    if (path.empty()) return fresh_.clear();        // the dictionary's file is gone, and they have no place
    Locked lock(sorm_.dictionary().files().back());
    if (int made = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600); made >= 0) ::close(made);
    Dictionary file;
    file.loadGood(path);
    for (auto& [key, value] : fresh_) {
        const std::string word = key.first + '/' + key.second;
        if (value.option.empty()) file.remove(word);
        else file.add(word, {value.text, timeText(value.time), value.by}, value.by, value.author);
    }
    file.save(path, Permit::owner());
    fresh_.clear();
}

}  // namespace sorma
