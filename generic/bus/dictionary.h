// dictionary.h -- recipes, daemon addresses, default locations: one word expands to a sequence of words.
//
//     # comment to the end of the line
//     carry        -transferSpeed 0.5 -approach 0.1 \
//                  -greeting 'good morning'
//     carry.slow   -SUBST carry -transferSpeed 0.2     # -SUBST splices another entry, recursively
//     @robot       localhost:7014
//
// Words are quoted as in requests (requestText.h); white space separates; a later entry of the same word replaces the
// earlier. Nothing is evaluated.
//
// Errors: DICT SYNTAX (file, line, what was expected), DICT FILE (cannot read or write, and why), DICT LOOP (the loop
// named as a chain of words). A file with an error changes nothing.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

namespace sorma {

// Where a word of a recipe comes from.
struct Origin {
    std::string file;               // empty: added at run time
    int line = 0;
    std::vector<std::string> via;   // entries it was spliced through, outermost first
    std::string by;                 // who added it at run time
    std::string toText() const;     // "carry.dict:12 via carry", "added by joe@lab sormad[77]"
};

struct DictionaryWord {
    std::string text;
    Origin origin;
};

class Dictionary {
public:
    // Is there an entry? Its words as written / with all -SUBST spliced in. A word without entry gives nothing.
    bool has(std::string_view word) const;
    const std::vector<std::string>* get(std::string_view word) const;
    std::vector<DictionaryWord> expand(std::string_view word) const;
    std::vector<std::string> words(std::string_view pattern = "*") const;      // sorted; glob pattern
    std::size_t size() const { return entries_.size(); }

    // Set an entry at run time. expansion: one text that is split into words when it is a single word holding white
    // space, else the words. Refused with DICT LOOP when it would close a loop, DICT SYNTAX when word is empty,
    // begins with # or holds white space.
    void add(std::string_view word, const std::vector<std::string>& expansion, const std::string& by);
    bool remove(std::string_view word);         // false when there was none

    void load(const std::string& file);         // all or nothing
    void loadText(std::string_view text, const std::string& file);
    void reload();                              // forgets what files gave and reads them again; all or nothing
    // Write back: comments and order of the file are kept, changed entries replaced in place, new ones appended,
    // removed ones taken out. Atomic (temporary file in the same folder, fsync, rename; mode and owner kept).
    // file empty: the file last loaded; new run-time entries go there. Fails with DICT FILE when there is none.
    void save(const std::string& file = {});
    const std::vector<std::string>& files() const { return files_; }

    // Fill from the environment: SORMA_DICT (a path list of files) is loaded; variables SORMA_ENTRY_<word> are added.
    void loadEnvironment();

private:
    struct Entry {
        std::vector<std::string> words;
        std::string file;           // empty: run time
        int line = 0;
        std::string by;
        bool changed = false;       // since it was read from the file
    };
    struct Hash {
        using is_transparent = void;
        std::size_t operator()(std::string_view s) const { return std::hash<std::string_view>{}(s); }
    };
    using Table = std::unordered_map<std::string, Entry, Hash, std::equal_to<>>;

    static void parse(std::string_view text, const std::string& file, Table& into);
    static void checkLoops(const Table& table);
    void expandInto(std::string_view word, std::vector<std::string>& chain, std::vector<DictionaryWord>& out) const;

    Table entries_;
    std::vector<std::string> files_;
};

}  // namespace sorma
