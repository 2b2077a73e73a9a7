// dictionaryText.h -- a dictionary's file as text: its entries read, and written among what else stands there.
//
// dictionary.h has the syntax. Files belong to people: comments, order and columns stay when entries change.
//
// Threads: any; there is no state.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace sorma {

inline constexpr std::string_view kSubst = "-SUBST";

// Why a word cannot name an entry; null when it can.
const char* badKey(std::string_view word);
// Why words cannot be an expansion; null when they can.
const char* badExpansion(const std::vector<std::string>& words);

struct EntryLine {
    std::string word;
    std::vector<std::string> words;
    int line;                           // its first one, from 1
    std::string author;                 // named in the line above, as former versions did; empty: none
};
// Give body each entry, in the order of the text.   file: for messages.   wrong: gets the errors, and these lines are left out;
// null: the first error is thrown, a DICT SYNTAX.
void readEntries(std::string_view text, const std::string& file, std::vector<std::string>* wrong, const std::function<void(EntryLine)>& body);

// By word: the words that an entry gets; null: the entry goes.
using EntryChanges = std::map<std::string_view, const std::vector<std::string>*>;
// The text with these changes. Other lines stay as they are, also those that do not parse. Entries that are not there yet are
// appended.
std::string changedText(std::string_view old, const EntryChanges& changes);

}  // namespace sorma
