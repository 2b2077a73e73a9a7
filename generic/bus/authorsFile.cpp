#include "bus/authorsFile.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "bus/fnv.h"
#include "bus/wholeFile.h"

namespace sorma {

namespace {

constexpr std::size_t kDigits = 16;

std::string hash(std::string_view word, const std::vector<std::string>& words) {
    Fnv h;
    auto add = [&](std::string_view text) {
        h.add(text.data(), text.size());
        h.add(0xff);                                                // a byte that no UTF-8 has, between words
    };
    add(word);
    for (auto& w : words) add(w);
    char digits[kDigits + 1];
    std::snprintf(digits, sizeof digits, "%016llx", static_cast<unsigned long long>(h.value()));
    return digits;
}

}  // namespace

AuthorsFile::AuthorsFile(const std::string& file) : path_(realPath(file) + ".authors") {
    std::string text;
    if (!readFile(path_, true, text)) return;
    struct stat facts {};
    if (::stat(path_.c_str(), &facts) != 0) failFile(path_, "read", std::strerror(errno));
    if ((facts.st_uid != ::geteuid() && facts.st_uid != 0) || (facts.st_mode & (S_IWGRP | S_IWOTH)))
        failFile(path_, "trust", "others than its owner may have written it; chmod go-w it, or remove it to make all entries yours");
    for (std::string_view rest = text; !rest.empty();) {
        auto line = rest.substr(0, rest.find('\n'));
        rest.remove_prefix(std::min(rest.size(), line.size() + 1));
        // A line that has lost its author is anyone's, not the owner's.
        if (line.size() > kDigits && line[kDigits] == ' ') lines_.insert_or_assign(std::string(line.substr(0, kDigits)), line.substr(kDigits + 1));
    }
}

PrincipalPointer AuthorsFile::of(std::string_view word, const std::vector<std::string>& words) const {
    auto found = lines_.find(hash(word, words));
    return found == lines_.end() ? nullptr : Principal::parse(found->second);
}

void AuthorsFile::note(std::string_view word, const std::vector<std::string>& words, const PrincipalPointer& author) {
    if (!author) return;
    // Anybody can make an entry with the hash of another one: both authors count for both.
    auto& text = now_[hash(word, words)];
    text = (text.empty() ? author : Principal::both(Principal::parse(text), author))->toText();
}

void AuthorsFile::writeBefore() const {
    if (lines_ == now_) return;
    auto all = lines_;
    for (auto& [hash, author] : now_) all.insert_or_assign(hash, author);
    write(all);
}

void AuthorsFile::writeAfter() const {
    if (lines_ == now_) return;
    if (!now_.empty()) write(now_);
    else if (::unlink(path_.c_str()) != 0 && errno != ENOENT) failFile(path_, "remove", std::strerror(errno));
}

void AuthorsFile::write(const Lines& lines) const {
    std::string text = "# Who wrote entries of the dictionary beside this file. An entry without a line is its owner's.\n";
    for (auto& [hash, author] : lines) text += hash + " " + author + "\n";
    replaceFile(path_, text, 0600);
}

}  // namespace sorma
