// dictionary.h -- recipes, daemon addresses, default locations: one word expands to a sequence of words.
//
//     # comment to the end of the line
//     carry        -transferSpeed 0.5 -greeting 'good morning'
//     carry.slow   -SUBST carry -transferSpeed 0.2     # -SUBST splices another entry, recursively
//     @robot       localhost:7014
//
// Words are quoted as in requests (requestText.h), and separated by white space. A word that begins with # begins a comment
// unless it is quoted. A later entry of the same word replaces the earlier. A line that ends in a backslash (in an odd
// number of them) continues on the next one, a comment too, as in Tcl. Quotes end on the line on which they begin.
// Nothing is evaluated. Files may be loaded in any order: -SUBST of a word without an entry fails when the entry is used.
//
// Errors: DICT SYNTAX (file, line, what was expected), DICT FILE (cannot read or write, and why), DICT LOOP (the chain).
// DICT UNKNOWN: -SUBST names no entry; the text has file and line. A file with an error changes nothing.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "bus/kept.h"
#include "bus/named.h"
#include "bus/principal.h"

namespace sorma {

// Where a word of a recipe comes from.
struct Origin {
    std::string file;               // empty: added at run time
    int line = 0;                   // of the entry that has the word
    std::vector<std::string> via;   // entries through which it was spliced, outermost first
    std::string by;                 // who added it at run time, for people
    PrincipalPointer author;        // who wrote the word and the entries of via: see Principal::both; null: the owner
    std::string toText() const;     // "carry.dict:12 via carry", "added by joe@lab sormad[77]"
};

struct DictionaryWord {
    std::string text;
    Origin origin;
};

// One for each SORM. Threads: the SORM's.
class Dictionary {
public:
    // Is there an entry? get() has its words as written, or null when there is none. A call of expand() gets its words with
    // all -SUBST replaced, or nothing. It fails with DICT UNKNOWN when -SUBST names no entry. Beyond these limits it fails with DICT
    // SYNTAX, since entries that splice others twice grow fast.
    static constexpr std::size_t kMaxExpansion = 10'000;        // words; each entry that is spliced counts as one
    static constexpr std::size_t kMaxExpansionBytes = 1 << 22;
    static constexpr std::size_t kMaxDepth = 200;               // of -SUBST inside -SUBST
    bool has(std::string_view word) const;
    const PrincipalPointer& authorOf(std::string_view word) const;     // who wrote an entry; null: the owner, also of one that is not there
    const std::vector<std::string>* get(std::string_view word) const;
    std::vector<DictionaryWord> expand(std::string_view word) const;
    std::vector<std::string> words(std::string_view pattern = "*") const;      // sorted; glob pattern
    std::size_t size() const { return entries_.size(); }

    // Set an entry at run time. expansion: its words; a single word with white space in it is split into words first. Fails
    // with DICT LOOP when it would close a loop, with DICT SYNTAX when word is empty, begins with #, or has white space or
    // control characters.
    // by: who sets it, for people.   author: whose rights its words have; saved and loaded with it.
    // account: pays for it; fails with COMM LIMIT when that is too much.
    void add(std::string_view word, const std::vector<std::string>& expansion, const std::string& by, PrincipalPointer author = nullptr,
             AccountPointer account = nullptr);
    bool remove(std::string_view word);         // false when there was none

    // All or nothing; a file that is loaded again moves to the end of files().   permit: to read that file (bus/named.h).
    void load(const std::string& file, const Permit& permit);
    void loadText(std::string_view text, const std::string& file);      // file: for origins only
    // Read all files again; all or nothing. Entries of files become as the files say, also those that were changed at run
    // time. Entries that exist only at run time stay.
    void reload();
    // Write to files. Comments, order and unchanged lines stay, also lines that others wrote there meanwhile. Changed
    // entries are replaced in place, new ones appended, removed ones taken out. It is atomic: a temporary file in the same
    // folder, fsync, rename. Mode and owner stay, and a symbolic link stays one. Without a file: each file that has changes; new
    // run-time entries go to the file that was loaded last. Fails with DICT FILE when there is none.
    // file: if it was not loaded, it gets a copy of every entry beside what it has. If no file was loaded, it counts as loaded from
    // then on.   permit: to write that file.
    void save(const std::string& file, const Permit& permit);
    void save();
    const std::vector<std::string>& files() const { return files_; }

    // Load the files of SORMA_DICT (a path list), and add the variables SORMA_ENTRY_<word>. Never fails: what is wrong is left
    // out, line by line, and noted in leftOut().
    void loadEnvironment();
    // As load, for a file of this process's owner; what is wrong in it is left out, and noted in leftOut().
    void loadGood(const std::string& file);
    // Errors of such files and of the environment, with file and line.
    const std::vector<std::string>& leftOut() const { return leftOut_; }

private:
    struct Entry {
        std::vector<std::string> words;
        std::string file;           // empty: run time
        int line = 0;
        std::string by;             // who changed it last at run time
        PrincipalPointer author;    // null: the owner; from a file: as FILE.authors says
        bool changed = false;       // since it was read from the file
        std::size_t key = 0;        // size of its own word, which the table keeps
        std::size_t heap() const { return key + heapOf(words) + heapOf(file) + heapOf(by); }
    };
    struct Hash {
        using is_transparent = void;
        std::size_t operator()(std::string_view s) const { return std::hash<std::string_view>{}(s); }
    };
    using Table = std::unordered_map<std::string, Charged<Entry>, Hash, std::equal_to<>>;
    struct Expansion;               // one under way: what it has cost so far

    // wrong: gets the errors, and these lines are left out; null: the first error is thrown.
    static void parse(std::string_view text, const std::string& file, Table& into, std::vector<std::string>* wrong = nullptr);
    // No loop leads through an entry of fresh, once these have replaced those of base.
    static void checkLoops(const Table& fresh, const Table& base);
    void take(Table&& fresh);
    void put(std::string_view word, std::vector<std::string> words, const std::string& by, PrincipalPointer author, AccountPointer account);
    bool loaded(const std::string& file) const;
    void expandInto(std::string_view word, Expansion& state) const;
    void saveTo(const std::string& file, bool everything, bool home);

    Table entries_;
    std::vector<std::string> files_;
    std::vector<std::string> leftOut_;
    std::map<std::string, std::string, std::less<>> removed_;   // entries of files taken out since, and the file
};

}  // namespace sorma
