#include "bus/dictionaryText.h"

#include <algorithm>
#include <unordered_map>
#include <utility>

#include "bus/catalogue.h"
#include "bus/requestText.h"

namespace sorma {

namespace {

const Prototype kLine{Severity::error, "DICT SYNTAX", 2, "{}:{}: {}"};

// A line above an entry that another than the owner has written, in files of former versions: it names the author. Today the
// authors stand in FILE.authors.
constexpr std::string_view kAuthorMark = "#@ by ";
constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";

bool isWhite(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

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

// Call body(line, words, word) for each line with an entry; words has taken its first one. Call other(line) for the rest. Lines that
// do not parse are among these: somebody has spoilt them since the file was loaded, and they are not ours to mend.
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

// So that a line can follow.
void endLine(std::string& text) {
    if (text.empty()) return;
    if (text.back() != '\n') text += '\n';
    std::string_view end = std::string_view(text).substr(0, text.size() - 1);
    end.remove_prefix(std::min(end.rfind('\n') + 1, end.size()));
    if (end.ends_with('\r')) end.remove_suffix(1);
    if (continues(end)) text += '\n';       // else it would take the next line in
}

}  // namespace

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

const char* badExpansion(const std::vector<std::string>& words) {
    if (words.empty()) return nullptr;
    // Names follow every -SUBST, so only the last one can lack its own: -SUBST -SUBST names the entry "-SUBST".
    std::size_t i = 0;
    while (i < words.size()) i += words[i] == kSubst ? 2 : 1;
    return i > words.size() ? "-SUBST needs the word of an entry after it" : nullptr;
}

void readEntries(std::string_view text, const std::string& file, std::vector<std::string>* wrong, const std::function<void(EntryLine)>& body) {
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
            EntryLine entry{std::string(word), {}, line.number, {}};
            while (reader.next(word)) entry.words.emplace_back(word);
            if (auto why = badExpansion(entry.words)) fail(kLine, file, line.number, why);
            entry.author = std::exchange(author, {});
            body(std::move(entry));
        } catch (const Error& e) {
            const Error said = e.is("DICT SYNTAX") ? e : Error(makeEntry(kLine, {MessageArg::of(file), MessageArg::of(line.number), MessageArg::of(e.what())}));
            if (!wrong) throw said;
            wrong->push_back(said.what());
            author.clear();
        }
    }
}

std::string changedText(std::string_view old, const EntryChanges& changes) {
    // Entries are found by their word, not by the line they were read from: others may have edited the file since.
    // The last line of a word counts; those before it do not matter and stay.
    std::unordered_map<std::string, std::size_t> last;      // word -> where its last line begins
    eachLine(old, [&](const LogicalLine& line, LineWords&, std::string_view word) { last.insert_or_assign(std::string(word), line.begin); },
             [](const LogicalLine&) {});

    std::string text;
    std::size_t copied = 0;         // of old
    std::size_t mark = old.npos;    // of old: where the line begins that names the author of the next entry
    auto change = [&](const LogicalLine& line, LineWords& words, std::string_view word) {
        const std::size_t begin = std::min(std::exchange(mark, old.npos), line.begin);
        auto found = changes.find(word);
        if (found == changes.end() || (found->second && last[std::string(word)] != line.begin)) return;
        // The author's mark goes. The lines between it and its entry stay.
        text += old.substr(copied, begin - copied);
        if (begin < line.begin) {
            std::size_t next = old.find('\n', begin) + 1;
            text += old.substr(next, line.begin - next);
        }
        copied = line.end;
        if (found->second) appendReplaced(text, line, words, *found->second, old.substr(line.begin, line.end - line.begin));
    };
    eachLine(old, change, [&](const LogicalLine& line) {
        if (!markedAuthor(line).empty()) mark = line.begin;
    });
    text += old.substr(copied);

    for (bool first = true; auto& [word, words] : changes) {
        if (!words || last.contains(std::string(word))) continue;
        if (std::exchange(first, false)) endLine(text);
        appendEntryWord(text, word);
        for (auto& w : *words) appendEntryWord(text, w);
        text += '\n';
    }
    return text;
}

}  // namespace sorma
