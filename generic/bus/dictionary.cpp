#include "bus/dictionary.h"

#include <dirent.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <set>
#include <utility>

#include "bus/catalogue.h"
#include "bus/descriptor.h"
#include "bus/fnv.h"
#include "bus/glob.h"
#include "bus/nearest.h"
#include "bus/requestText.h"

extern char** environ;

namespace sorma {

namespace {

const Prototype kLine{Severity::error, "DICT SYNTAX", 2, "{}:{}: {}"};
const Prototype kEntry{Severity::error, "DICT SYNTAX", 1, "dictionary entry {1}: {2}"};
const Prototype kLoop{Severity::error, "DICT LOOP", 1, "dictionary entry {0}: -SUBST leads in a loop: {1}"};
const Prototype kLoopInFile{Severity::error, "DICT LOOP", 1, "dictionary entry {0}: -SUBST leads in a loop: {1} ({2}:{3})"};
const Prototype kTooLarge{Severity::error, "DICT SYNTAX", 1, "dictionary entry {}: its expansion exceeds {}"};
const Prototype kNoSubst{Severity::error, "DICT UNKNOWN", 2, "dictionary entry {0}: -SUBST {1}{3}: there is no entry of that name ({2})"};
const Prototype kFile{Severity::error, "DICT FILE", 1, "cannot {1} dictionary file \"{0}\": {2}"};
const Prototype kNoFile{Severity::error, "DICT FILE", 0, "no dictionary file is loaded; name the one to write: dict CTRL -save FILE"};

// A line above an entry that another than the owner has written, in files of former versions: it names the author. Today the
// authors stand in FILE.authors.
constexpr std::string_view kAuthorMark = "#@ by ";
constexpr std::string_view kSubst = "-SUBST", kByteOrderMark = "\xef\xbb\xbf";
constexpr std::size_t kMaxFile = std::size_t{64} << 20;

bool isWhite(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

// Why a word cannot name an entry; null when it can.
const char* badKey(std::string_view word) {
    if (word.empty()) return "the word is empty";
    if (word[0] == '#') return "the word begins with #, like a comment";
    if (word.starts_with(kByteOrderMark)) return "the word begins with a byte order mark";   // at a file's start it would vanish
    for (char c : word) {
        if (isWhite(c)) return "the word holds white space";
        if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) return "the word holds a control character";
    }
    return isUtf8(word) ? nullptr : "the word is not UTF-8";
}

// Why words cannot be an expansion; null when they can.
const char* badExpansion(const std::vector<std::string>& words) {
    if (words.empty()) return nullptr;
    // Names follow every -SUBST, so only the last one can lack its own: -SUBST -SUBST names the entry "-SUBST".
    std::size_t i = 0;
    while (i < words.size()) i += words[i] == kSubst ? 2 : 1;
    return i > words.size() ? "-SUBST needs the word of an entry after it" : nullptr;
}

// Line as the parser sees it: continuations joined.
struct LogicalLine {
    std::size_t begin, end;         // in the file, with the newline
    int number;                     // of its first line
    bool joined = false;            // has continuations
    std::string_view text;          // without newline; valid until the next line is taken
};

// Does a line without its newline go on with the next one?
bool continues(std::string_view line) {
    std::size_t last = line.find_last_not_of('\\');
    return (line.size() - (last == line.npos ? 0 : last + 1)) % 2 == 1;
}

class LineReader {
public:
    explicit LineReader(std::string_view text) : text_(text) {
        if (text_.starts_with(kByteOrderMark)) at_ = kByteOrderMark.size();
    }

    bool next(LogicalLine& line) {
        if (at_ >= text_.size()) return false;
        line = {at_, at_, number_ + 1, false, {}};
        buffer_.clear();
        for (;;) {
            std::string_view piece = physical();
            const bool goesOn = continues(piece);
            if (goesOn) piece.remove_suffix(1);
            if (goesOn || line.joined) buffer_ += piece;
            else line.text = piece;
            if (!goesOn) break;
            line.joined = true;
            if (at_ >= text_.size()) break;
            buffer_ += ' ';
        }
        if (line.joined) line.text = buffer_;
        line.end = at_;
        return true;
    }

private:
    std::string_view physical() {
        ++number_;
        std::size_t end = text_.find('\n', at_);
        std::string_view piece = text_.substr(at_, end == text_.npos ? end : end - at_);
        at_ = end == text_.npos ? text_.size() : end + 1;
        if (piece.ends_with('\r')) piece.remove_suffix(1);
        return piece;
    }

    std::string_view text_;
    std::size_t at_ = 0;
    int number_ = 0;
    std::string buffer_;
};

// Takes the words of a line, up to its comment. Throws what WordReader throws.
class LineWords {
public:
    explicit LineWords(std::string_view line) : line_(line), reader_(line) {}
    bool next(std::string_view& word) {
        std::string_view rest = reader_.rest();
        std::size_t skip = 0;
        while (skip < rest.size() && isWhite(rest[skip])) ++skip;
        at_ = line_.size() - rest.size() + skip;
        return at_ < line_.size() && line_[at_] != '#' && reader_.next(word);
    }
    std::size_t begin() const { return at_; }       // of the last word; after the last one, of the comment
    std::size_t end() const { return line_.size() - reader_.rest().size(); }

private:
    std::string_view line_;
    WordReader reader_;
    std::size_t at_ = 0;
};

// The author that a line above an entry names; empty: none.
std::string_view markedAuthor(const LogicalLine& line) {
    std::string_view text = line.text;
    if (!text.starts_with(kAuthorMark)) return {};
    text.remove_prefix(kAuthorMark.size());
    while (!text.empty() && isWhite(text.back())) text.remove_suffix(1);
    return text.empty() ? std::string_view("anyone") : text;
}

// body(line, words, word) for each line of a file that holds an entry; words has taken its first one. Lines that do not
// parse are passed over: spoilt since the file was loaded, and not ours to mend.
template <class F, class G> void eachLine(std::string_view text, F body, G other) {
    LineReader lines(text);
    for (LogicalLine line; lines.next(line);) {
        LineWords words(line.text);
        std::string_view word;
        bool found = false;
        try {
            found = words.next(word);
        } catch (const Error&) {
        }
        if (found) body(line, words, word);
        else other(line);
    }
}
template <class F> void eachEntry(std::string_view text, F body) {
    eachLine(text, body, [](const LogicalLine&) {});
}

void appendEntryWord(std::string& out, std::string_view word) {
    // A backslash at the end of a line would continue it, # would begin a comment.
    if (word.starts_with('#') || word.find('\\') != word.npos) appendQuoted(out, word);
    else appendWord(out, word);
}

// The line of an entry with other words. The word and the gap behind it stay, so that columns stay in line, and so
// does the comment. words has taken the first word.
void appendReplaced(std::string& out, const LogicalLine& line, LineWords& words, const std::vector<std::string>& now,
                    std::string_view raw) {
    const std::size_t keyEnd = words.end();
    std::size_t gapEnd = keyEnd, comment = line.text.size();
    try {
        std::string_view word;
        for (bool first = true; words.next(word); first = false)
            if (first) gapEnd = words.begin();
        comment = words.begin();
    } catch (const Error&) {        // a file with errors is replaced
    }
    out += line.text.substr(0, keyEnd);
    if (!now.empty() && !line.joined) out += line.text.substr(keyEnd, gapEnd - keyEnd);
    for (auto& word : now) appendEntryWord(out, word);
    if (comment < line.text.size()) (out += "  ") += line.text.substr(comment);
    out += raw.ends_with("\r\n") ? "\r\n" : "\n";
}

// ---- files ----

[[noreturn]] void failFile(const std::string& file, const char* verb, int error) {
    fail(kFile, file, verb, std::strerror(error));
}

// Returns false when the file does not exist and that is allowed.
bool readFile(const std::string& file, bool mayLack, std::string& text) {
    Descriptor in(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
    if (!in) {
        if (errno == ENOENT && mayLack) return false;
        failFile(file, "read", errno);
    }
    for (char block[16384];;) {
        ssize_t n = ::read(in.get(), block, sizeof block);
        if (n == 0) return true;
        if (n < 0) {
            if (errno == EINTR) continue;
            failFile(file, "read", errno);
        }
        text.append(block, static_cast<std::size_t>(n));
        if (text.size() > kMaxFile) failFile(file, "read", EFBIG);
    }
}

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

void replaceFile(const std::string& file, std::string_view text, mode_t mode = 0666) {
    std::string target = file;              // behind symbolic links: the link stays
    if (char* real = ::realpath(file.c_str(), nullptr)) {
        target = real;
        std::free(real);
    }
    struct stat before {};
    const bool existed = ::stat(target.c_str(), &before) == 0;
    static std::atomic<unsigned> count{0};
    std::string temporary;
    Descriptor out;
    do {    // the name is new; not mkstemp, whose mode forgets the umask
        temporary = target + ".new-" + std::to_string(::getpid()) + '-' + std::to_string(count++);
        out = Descriptor(::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode));
    } while (!out && errno == EEXIST);
    if (!out) failFile(file, "write", errno);
    auto giveUp = [&](int error) {
        ::unlink(temporary.c_str());
        failFile(file, "write", error);
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

// FILE.authors stands beside FILE, and only the owner may read it. Each line has a hash of an entry, its word included, and the
// author, if that is not the owner. An entry that somebody has edited since has another hash, and so is the owner's.
class AuthorsFile {
public:
    // Fails with DICT FILE when it cannot be read, or others than the owner may have written it.
    explicit AuthorsFile(const std::string& file) : path_(realPath(file) + ".authors") {
        std::string text;
        if (!readFile(path_, true, text)) return;
        struct stat facts {};
        if (::stat(path_.c_str(), &facts) != 0) failFile(path_, "read", errno);
        if ((facts.st_uid != ::geteuid() && facts.st_uid != 0) || (facts.st_mode & (S_IWGRP | S_IWOTH)))
            fail(kFile, path_, "trust", "others than its owner may have written it; chmod go-w it, or remove it to make all entries yours");
        was_ = text;
        for (std::string_view rest = text; !rest.empty();) {
            auto line = rest.substr(0, rest.find('\n'));
            rest.remove_prefix(std::min(rest.size(), line.size() + 1));
            // A line that has lost its author is anyone's, not the owner's.
            if (line.size() > kDigits && line[kDigits] == ' ') lines_.insert_or_assign(std::string(line.substr(0, kDigits)), line.substr(kDigits + 1));
        }
    }

    // Null: the owner.
    PrincipalPointer of(std::string_view word, const std::vector<std::string>& words) const {
        auto found = lines_.find(hash(word, words));
        return found == lines_.end() ? nullptr : Principal::parse(found->second);
    }
    void note(std::string_view word, const std::vector<std::string>& words, const PrincipalPointer& author) {
        if (!author) return;
        // Anybody can make an entry with the hash of another one: both authors count for both.
        auto& text = now_[hash(word, words)];
        text = (text.empty() ? author : Principal::both(Principal::parse(text), author))->toText();
    }
    // Write the file, before and after the dictionary itself is written. All old lines stay until then. So no entry loses its
    // author when this process ends in between.
    void writeBefore() const {
        auto all = lines_;
        for (auto& [hash, author] : now_) all.insert_or_assign(hash, author);
        write(all);
    }
    void writeAfter() const {
        if (!now_.empty()) return write(now_);
        if (!was_.empty() && ::unlink(path_.c_str()) != 0 && errno != ENOENT) failFile(path_, "remove", errno);
    }
    bool changed() const { return lines_ != now_; }

private:
    static constexpr std::size_t kDigits = 16;
    using Lines = std::map<std::string, std::string, std::less<>>;      // by hash

    static std::string hash(std::string_view word, const std::vector<std::string>& words) {
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
    void write(const Lines& lines) const {
        if (lines.empty()) return;
        std::string text = "# Who wrote entries of the dictionary beside this file. An entry without a line is its owner's.\n";
        for (auto& [hash, author] : lines) text += hash + " " + author + "\n";
        replaceFile(path_, text, 0600);
    }

    const std::string path_;
    std::string was_;
    Lines lines_, now_;
};

template <class Table> void learnAuthors(Table& table, const std::string& file) {
    AuthorsFile authors(file);
    for (auto& [word, kept] : table)
        if (kept->file == file && !kept->author) kept.edit([&, &word = word](auto& entry) { entry.author = authors.of(word, entry.words); });
}

}  // namespace

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

std::string Origin::toText() const {
    std::string out = file.empty() ? "added" + (by.empty() ? std::string(" at run time") : " by " + by)
                                   : file + ':' + std::to_string(line);
    const char* separator = " via ";
    for (auto& word : via) {
        out += separator + word;
        separator = " -> ";
    }
    return out;
}

// ---- looking up ----

const PrincipalPointer& Dictionary::authorOf(std::string_view word) const {
    static const PrincipalPointer owner;
    auto found = entries_.find(word);
    return found == entries_.end() ? owner : found->second->author;
}

bool Dictionary::has(std::string_view word) const { return entries_.find(word) != entries_.end(); }

const std::vector<std::string>* Dictionary::get(std::string_view word) const {
    auto found = entries_.find(word);
    return found == entries_.end() ? nullptr : &found->second->words;
}

struct Dictionary::Expansion {
    std::string_view root;
    std::vector<DictionaryWord> out;
    PrincipalPointer author;            // of all the entries that are being spliced
    std::vector<std::string> via;       // entries that are being spliced
    std::size_t words = 0, bytes = 0;
};

std::vector<DictionaryWord> Dictionary::expand(std::string_view word) const {
    Expansion state{word, {}, nullptr, {}, 0, 0};
    expandInto(word, state);
    return std::move(state.out);
}

void Dictionary::expandInto(std::string_view word, Expansion& state) const {
    auto found = entries_.find(word);
    if (found == entries_.end()) return;
    const Entry& entry = *found->second;
    Origin origin;
    if (entry.file.empty() || entry.changed) {
        origin.by = entry.by;
    } else {
        origin.file = entry.file;
        origin.line = entry.line;
    }
    origin.via = state.via;
    origin.author = Principal::both(state.author, entry.author);
    std::size_t weight = origin.file.size() + origin.by.size();
    for (auto& step : origin.via) weight += step.size();
    auto count = [&](std::size_t bytes) {
        if (++state.words > kMaxExpansion) fail(kTooLarge, state.root, std::to_string(kMaxExpansion) + " words");
        state.bytes += bytes;
        if (state.bytes > kMaxExpansionBytes) fail(kTooLarge, state.root, std::to_string(kMaxExpansionBytes) + " bytes");
    };
    for (std::size_t i = 0; i < entry.words.size(); ++i) {
        if (entry.words[i] == kSubst && i + 1 < entry.words.size()) {
            const std::string& next = entry.words[++i];
            count(0);
            if (!has(next)) fail(kNoSubst, state.root, next, origin.toText(), didYouMean(next, this->words()));
            if (state.via.size() == kMaxDepth) fail(kTooLarge, state.root, std::to_string(kMaxDepth) + " levels of -SUBST");
            state.via.push_back(next);
            auto outer = std::exchange(state.author, origin.author);
            expandInto(next, state);
            state.author = std::move(outer);
            state.via.pop_back();
        } else {
            count(entry.words[i].size() + weight);
            state.out.push_back({entry.words[i], origin});
        }
    }
}

std::vector<std::string> Dictionary::words(std::string_view pattern) const {
    std::vector<std::string> out;
    for (auto& [word, entry] : entries_)
        if (globMatch(pattern, word)) out.push_back(word);
    std::sort(out.begin(), out.end());
    return out;
}

// ---- changing ----

// Depth first, without recursion: a file may chain thousands of entries.
void Dictionary::checkLoops(const Table& fresh, const Table& base) {
    enum State : char { open = 1, done };
    struct Frame {
        std::string_view word;
        const Entry* entry;
        std::size_t at;
    };
    std::unordered_map<std::string_view, char> states;
    std::vector<Frame> stack;
    auto enter = [&](std::string_view word) {
        auto found = fresh.find(word);
        if (found == fresh.end()) {
            found = base.find(word);
            if (found == base.end()) return;
        }
        char& state = states[found->first];
        if (state == done) return;
        if (state == open) {
            std::string chain;
            const Frame* blame = nullptr;       // the first in the loop that is new
            bool inside = false;
            for (auto& f : stack) {
                inside = inside || f.word == word;
                if (!inside) continue;
                (chain += f.word) += " -> ";
                if (!blame && fresh.find(f.word) != fresh.end()) blame = &f;
            }
            chain += word;
            if (!blame) blame = &stack.back();
            const Entry& e = *blame->entry;
            if (e.file.empty() || e.changed) fail(kLoop, blame->word, chain);
            fail(kLoopInFile, blame->word, chain, e.file, e.line);
        }
        state = open;
        stack.push_back({found->first, &*found->second, 0});
    };
    for (auto& [word, entry] : fresh) {
        enter(word);
        while (!stack.empty()) {
            Frame& f = stack.back();
            auto& words = f.entry->words;
            while (f.at < words.size() && words[f.at] != kSubst) ++f.at;
            if (f.at + 1 < words.size()) {
                f.at += 2;
                enter(words[f.at - 1]);     // may move the frames
            } else {
                states[f.word] = done;
                stack.pop_back();
            }
        }
    }
}

void Dictionary::take(Table&& fresh) {
    for (auto& [word, entry] : fresh) {
        removed_.erase(word);
        entries_.insert_or_assign(word, std::move(entry));
    }
}

void Dictionary::add(std::string_view word, const std::vector<std::string>& expansion, const std::string& by, PrincipalPointer author,
                     AccountPointer account) {
    if (auto why = badKey(word)) fail(kEntry, word, shown(word), why);
    if (expansion.size() != 1 || std::none_of(expansion[0].begin(), expansion[0].end(), isWhite))
        return put(word, expansion, by, std::move(author), std::move(account));
    std::vector<std::string> words;
    try {
        words = splitWords(expansion[0]);
    } catch (const Error& e) {
        fail(kEntry, word, shown(word), e.what());
    }
    put(word, std::move(words), by, std::move(author), std::move(account));
}

void Dictionary::put(std::string_view word, std::vector<std::string> words, const std::string& by, PrincipalPointer author,
                     AccountPointer account) {
    if (auto why = badKey(word)) fail(kEntry, word, shown(word), why);
    for (auto& w : words)
        if (!isUtf8(w)) fail(kEntry, word, shown(word), shown(w) + " is not UTF-8");
    if (auto why = badExpansion(words)) fail(kEntry, word, shown(word), why);

    Entry entry;
    auto found = entries_.find(word);
    auto gone = removed_.find(word);
    if (found != entries_.end()) {
        if (found->second->words == words && found->second->author == author) return;
        entry.file = found->second->file;
        entry.line = found->second->line;
    } else if (gone != removed_.end()) {
        entry.file = gone->second;
    }
    if (!loaded(entry.file)) entry.file.clear();        // a text that is not a file cannot be written back
    entry.words = std::move(words);
    entry.by = by;
    entry.author = std::move(author);
    entry.changed = !entry.file.empty();
    entry.key = word.size();
    Table fresh;
    fresh.emplace(word, Charged<Entry>("dict", std::move(account), Account::Use::values, std::move(entry)));
    checkLoops(fresh, entries_);
    take(std::move(fresh));
}

bool Dictionary::loaded(const std::string& file) const { return std::find(files_.begin(), files_.end(), file) != files_.end(); }

bool Dictionary::remove(std::string_view word) {
    auto found = entries_.find(word);
    if (found == entries_.end()) return false;
    if (loaded(found->second->file)) removed_.insert_or_assign(found->first, found->second->file);
    entries_.erase(found);
    return true;
}

// ---- files ----

void Dictionary::parse(std::string_view text, const std::string& file, Table& into, std::vector<std::string>* wrong) {
    LineReader lines(text);
    std::string author;                 // of the next entry
    for (LogicalLine line; lines.next(line);) {
        try {
            if (!isUtf8(line.text)) fail(kLine, file, line.number, "the line is not UTF-8");
            LineWords reader(line.text);
            std::string_view word;
            if (!reader.next(word)) {
                if (auto named = markedAuthor(line); !named.empty()) author = named;
                continue;
            }
            if (auto why = badKey(word)) fail(kLine, file, line.number, why);
            std::string key(word);
            Entry entry;
            while (reader.next(word)) entry.words.emplace_back(word);
            if (auto why = badExpansion(entry.words)) fail(kLine, file, line.number, why);
            entry.file = file;
            entry.line = line.number;
            if (!author.empty()) entry.author = Principal::parse(std::exchange(author, {}));
            into.insert_or_assign(std::move(key), Charged<Entry>::forced(nullptr, Account::Use::values, std::move(entry)));
        } catch (const Error& e) {
            const Error said = e.is("DICT SYNTAX") ? e : Error(makeEntry(kLine, {MessageArg::of(file), MessageArg::of(line.number), MessageArg::of(e.what())}));
            if (!wrong) throw said;
            wrong->push_back(said.what());
            author.clear();
        }
    }
}

void Dictionary::loadText(std::string_view text, const std::string& file) {
    Table fresh;
    parse(text, file, fresh);
    checkLoops(fresh, entries_);
    take(std::move(fresh));
}

void Dictionary::load(const std::string& file, const Permit& permit) {
    checkKind(permit, Kind::file, file);
    std::string text;
    readFile(file, false, text);
    Table fresh;
    parse(text, file, fresh);
    learnAuthors(fresh, file);
    checkLoops(fresh, entries_);
    take(std::move(fresh));
    std::erase(files_, file);
    files_.push_back(file);
}

void Dictionary::reload() {
    const std::set<std::string, std::less<>> known(files_.begin(), files_.end());
    Table all;
    for (auto& [word, entry] : entries_)
        if (!known.contains(entry->file)) all.emplace(word, entry.again());
    for (auto& file : files_) {
        std::string text;
        readFile(file, false, text);
        Table fresh;
        parse(text, file, fresh);
        learnAuthors(fresh, file);
        for (auto& [word, entry] : fresh) all.insert_or_assign(word, std::move(entry));
    }
    checkLoops(all, Table());
    entries_ = std::move(all);
    std::erase_if(removed_, [&](auto& gone) { return known.contains(gone.second); });
}

void Dictionary::save(const std::string& file, const Permit& permit) {
    checkKind(permit, Kind::file, file);
    const bool home = loaded(file) || files_.empty();
    saveTo(file, !loaded(file), home);
    if (files_.empty()) files_.push_back(file);
}

void Dictionary::save() {
    if (files_.empty()) fail(kNoFile);
    const std::vector<std::string> files = files_;
    for (auto& f : files) saveTo(f, false, f == files.back());
}

// everything: entries of other files are written too;  home: entries of no file get this one as theirs.
void Dictionary::saveTo(const std::string& file, bool everything, bool home) {
    std::string old;
    const bool exists = readFile(file, true, old);
    // Which entries must stand in the file in our words, and which must only stand there.
    auto ours = [&](const Entry& e) { return everything || (e.file.empty() ? home : e.file == file && e.changed); };
    auto wanted = [&](const Entry& e) { return ours(e) || (e.file == file && !exists); };
    auto removed = [&](std::string_view word) {
        auto gone = removed_.find(word);
        return gone != removed_.end() && gone->second == file;
    };
    bool dirty = std::any_of(removed_.begin(), removed_.end(), [&](auto& gone) { return gone.second == file; });
    for (auto& [word, entry] : entries_) dirty = dirty || wanted(*entry);
    if (!dirty) return;

    // Entries are found by their word, not by the line they were read from: others may have edited the file since.
    // The last line of a word counts; those before it do not matter and stay.
    std::unordered_map<std::string, std::size_t> last;      // word -> where its last line begins
    std::string key;
    eachEntry(old, [&](const LogicalLine& line, LineWords&, std::string_view word) {
        last.insert_or_assign(std::string(word), line.begin);
    });

    std::string text;
    std::size_t copied = 0;         // of old
    std::size_t mark = old.npos;    // of old: where the line begins that names the author of the next entry
    auto take = [&](const LogicalLine& line, LineWords& words, std::string_view word) {
        key = word;
        auto found = entries_.find(key);
        const bool goes = removed(key);
        const std::size_t begin = std::min(std::exchange(mark, old.npos), line.begin);
        if (!goes && (found == entries_.end() || !ours(*found->second) || last[key] != line.begin)) return;
        // The author's mark goes. The lines between it and its entry stay.
        text += std::string_view(old).substr(copied, begin - copied);
        if (begin < line.begin) {
            std::size_t next = old.find('\n', begin) + 1;
            text += std::string_view(old).substr(next, line.begin - next);
        }
        copied = line.end;
        if (!goes) appendReplaced(text, line, words, found->second->words, std::string_view(old).substr(line.begin, line.end - line.begin));
    };
    eachLine(old, take, [&](const LogicalLine& line) {
        if (!markedAuthor(line).empty()) mark = line.begin;
    });
    text += std::string_view(old).substr(copied);

    std::vector<std::string_view> fresh;
    for (auto& [word, entry] : entries_)
        if (wanted(*entry) && !last.contains(word)) fresh.push_back(word);
    std::sort(fresh.begin(), fresh.end());
    if (!fresh.empty() && !text.empty()) {
        if (text.back() != '\n') text += '\n';
        std::string_view end = std::string_view(text).substr(0, text.size() - 1);
        end.remove_prefix(std::min(end.rfind('\n') + 1, end.size()));
        if (end.ends_with('\r')) end.remove_suffix(1);
        if (continues(end)) text += '\n';       // else it would take the next line in
    }
    for (auto word : fresh) {
        appendEntryWord(text, word);
        for (auto& w : entries_.find(word)->second->words) appendEntryWord(text, w);
        text += '\n';
    }
    // An entry has the author that it has here, unless another process has written it: then the one that stands there.
    AuthorsFile authors(file);
    eachEntry(text, [&](const LogicalLine&, LineWords& reader, std::string_view word) {
        const std::string entry(word);
        std::vector<std::string> words;
        try {
            for (std::string_view w; reader.next(w);) words.emplace_back(w);
        } catch (const Error&) {            // spoilt since it was loaded
            return;
        }
        auto found = entries_.find(entry);
        const bool here = found != entries_.end() && (found->second->file == file || ours(*found->second)) && found->second->words == words;
        authors.note(entry, words, here ? found->second->author : authors.of(entry, words));
    });
    const bool differs = !exists || text != old;
    if (authors.changed()) authors.writeBefore();
    if (differs) replaceFile(file, text);
    if (authors.changed()) authors.writeAfter();

    // The file is written: from here on only memory follows.
    std::erase_if(removed_, [&](auto& gone) { return gone.second == file; });
    for (auto& [word, kept] : entries_)
        kept.edit([&](Entry& entry) {
            if (entry.file.empty() && home) entry.file = file;
            if (entry.file == file) entry.changed = false;
        });
    eachEntry(text, [&](const LogicalLine& line, LineWords&, std::string_view word) {
        auto found = entries_.find(word);
        if (found != entries_.end() && found->second->file == file) found->second.edit([&](Entry& entry) { entry.line = line.number; });
    });
}

// ---- environment ----

void Dictionary::loadGood(const std::string& file) {
    try {
        std::string text;
        readFile(file, false, text);
        Table fresh;
        parse(text, file, fresh, &leftOut_);
        learnAuthors(fresh, file);
        try {
            checkLoops(fresh, entries_);
            take(std::move(fresh));
        } catch (const Error&) {        // one by one, in the order of the file: the entry that closes a loop is left out
            std::vector<Table::node_type> nodes;
            while (!fresh.empty()) nodes.push_back(fresh.extract(fresh.begin()));
            std::sort(nodes.begin(), nodes.end(), [](auto& a, auto& b) { return a.mapped()->line < b.mapped()->line; });
            for (auto& node : nodes) {
                Table one;
                one.insert(std::move(node));
                try {
                    checkLoops(one, entries_);
                    take(std::move(one));
                } catch (const Error& e) {
                    leftOut_.push_back(e.what());
                }
            }
        }
        std::erase(files_, file);
        files_.push_back(file);
    } catch (const Error& e) {
        leftOut_.push_back(e.what());
    }
}

void Dictionary::loadEnvironment() {
    leftOut_.clear();
    if (const char* list = std::getenv("SORMA_DICT")) {
        for (std::string_view rest = list; !rest.empty();) {
            std::size_t end = std::min(rest.find(':'), rest.size());
            if (end > 0) loadGood(std::string(rest.substr(0, end)));
            rest.remove_prefix(std::min(end + 1, rest.size()));
        }
    }
    constexpr std::string_view kPrefix = "SORMA_ENTRY_";
    std::vector<std::string_view> found;
    for (char** at = environ; at && *at; ++at)
        if (std::string_view(*at).starts_with(kPrefix)) found.push_back(*at);
    std::sort(found.begin(), found.end());
    for (auto variable : found) {
        std::size_t equals = variable.find('=');
        if (equals == variable.npos) continue;
        std::string_view word = variable.substr(kPrefix.size(), equals - kPrefix.size());
        const std::string origin = "environment variable " + std::string(variable.substr(0, equals));
        try {
            put(word, splitWords(variable.substr(equals + 1)), origin, nullptr, nullptr);
        } catch (const Error& e) {
            leftOut_.push_back(origin + ": " + e.what());
        }
    }
}

}  // namespace sorma
