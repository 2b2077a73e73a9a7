#include "bus/dictionary.h"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <set>
#include <utility>

#include "bus/authorsFile.h"
#include "bus/catalogue.h"
#include "bus/dictionaryText.h"
#include "bus/glob.h"
#include "bus/nearest.h"
#include "bus/requestText.h"
#include "bus/wholeFile.h"

extern char** environ;

namespace sorma {

namespace {

const Prototype kEntry{Severity::error, "DICT SYNTAX", 1, "dictionary entry {1}: {2}"};
const Prototype kLoop{Severity::error, "DICT LOOP", 1, "dictionary entry {0}: -SUBST leads in a loop: {1}"};
const Prototype kLoopInFile{Severity::error, "DICT LOOP", 1, "dictionary entry {0}: -SUBST leads in a loop: {1} ({2}:{3})"};
const Prototype kTooLarge{Severity::error, "DICT SYNTAX", 1, "dictionary entry {}: its expansion exceeds {}"};
const Prototype kNoSubst{Severity::error, "DICT UNKNOWN", 2, "dictionary entry {0}: -SUBST {1}{3}: there is no entry of that name ({2})"};
const Prototype kNoFile{Severity::error, "DICT FILE", 0, "no dictionary file is loaded; name the one to write: dict CTRL -save FILE"};

template <class Table> void learnAuthors(Table& table, const std::string& file) {
    AuthorsFile authors(file);
    for (auto& [word, kept] : table)
        if (kept->file == file && !kept->author) kept.edit([&, &word = word](auto& entry) { entry.author = authors.of(word, entry.words); });
}

}  // namespace

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
    if (expansion.size() != 1 || expansion[0].find_first_of(" \t\n\v\f\r") == std::string::npos)
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
    readEntries(text, file, wrong, [&](EntryLine found) {
        Entry entry;
        entry.words = std::move(found.words);
        entry.file = file;
        entry.line = found.line;
        if (!found.author.empty()) entry.author = Principal::parse(found.author);
        into.insert_or_assign(std::move(found.word), Charged<Entry>::forced(nullptr, Account::Use::values, std::move(entry)));
    });
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
    // Must the entry stand in the file in our words?
    auto ours = [&](const Entry& e) { return everything || (e.file.empty() ? home : e.file == file && e.changed); };
    EntryChanges changes;
    for (auto& [word, entry] : entries_)
        if (ours(*entry) || (entry->file == file && !exists)) changes.emplace(word, &entry->words);
    for (auto& [word, from] : removed_)
        if (from == file) changes.emplace(word, nullptr);
    if (changes.empty()) return;
    const std::string text = changedText(old, changes);

    // An entry has the author that it has here, unless another process has written it: then the one that stands there.
    AuthorsFile authors(file);
    std::map<std::string, int> lines;
    std::vector<std::string> spoilt;        // since it was loaded
    readEntries(text, file, &spoilt, [&](EntryLine e) {
        auto found = entries_.find(e.word);
        const bool here = found != entries_.end() && (found->second->file == file || ours(*found->second)) && found->second->words == e.words;
        authors.note(e.word, e.words, here ? found->second->author : authors.of(e.word, e.words));
        lines.insert_or_assign(std::move(e.word), e.line);
    });
    authors.writeBefore();
    if (!exists || text != old) replaceFile(file, text);
    authors.writeAfter();

    // The file is written: from here on only memory follows.
    std::erase_if(removed_, [&](auto& gone) { return gone.second == file; });
    for (auto& [word, kept] : entries_)
        kept.edit([&, &word = word](Entry& entry) {
            if (entry.file.empty() && home) entry.file = file;
            if (entry.file != file) return;
            entry.changed = false;
            if (auto line = lines.find(word); line != lines.end()) entry.line = line->second;
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
