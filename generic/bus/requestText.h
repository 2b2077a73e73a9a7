// requestText.h -- requests and replies as text, as people type them.
//
//     request = name ("EXEC" part* | ("CTRL" | "DBX") word*)
//     reply   = name "RET" code part*                                  (without free words)
//     part    = "TMSG" word | "FMSG" n number{n} | "IMSG" n integer{n} | "AMSG" base64 | "TDBX" word | word
//     word    = bare | '"' ... '"' | "'" ... "'" | "{" ... "}"
//
// Reading. The first character of a word decides whether it is bare. A bare word ends at white space, and nothing in it is
// special. Inside "..." a backslash escapes: \n \t \r, \xHH (the character U+00HH), and ASCII punctuation and space stand
// for themselves. Inside '...' and {...} nothing escapes; in {...} braces must balance. A quoted word is never a keyword.
// Each part may come once. No bare number may follow the n numbers of FMSG or IMSG, since then the count is too small.
//
// Writing, the canonical form. First the parts in the order above, without the empty ones, then the free words. A word is
// written
//     bare    when it is not empty and has no white space, control character, quote or brace;
//     {...}   else, when it has no control character and no backslash, and its braces balance;
//     "..."   else, with \" \\ \n \t \r, and \xHH for other control characters.
// So the text never has a newline, and reading gives the same word again. Bytes that are not UTF-8 are written as U+FFFD. A
// free word is quoted if it would be read as a keyword or as one more number.
//
// Numbers are written in the shortest form that reads back to the same bits (std::to_chars; nan of either sign is nan). Reading
// does not depend on the locale. Canonical text -> message -> text gives the same text, and message -> text -> message the same
// message. Parts that a direction does not have are lost: requests have no code and no trail, replies no free words.
//
// Threads: any; there is no state.
// Errors:  REQUEST SYNTAX. The message has the expected part and the number of the word, from 1; or it says that the text is not
//          UTF-8.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "bus/base64.h"
#include "bus/message.h"
#include "bus/utf8.h"

namespace sorma {

// Reads the words of a text, one by one. The text must outlive it; a word that it returns is valid until the next call.
class WordReader {
public:
    explicit WordReader(std::string_view text) : text_(text) {}
    // The next word; false at the end. Fails with REQUEST SYNTAX on unbalanced quotes or junk after a closing quote.
    bool next(std::string_view& word);
    bool quoted() const { return quoted_; }             // was the last word quoted?
    // The next word if it is a bare number; else false, and nothing is read.
    bool nextNumber(double& value);
    bool nextNumber(std::int64_t& value);
    std::size_t index() const { return index_; }        // number of the last word, from 1
    std::string_view rest() const { return text_.substr(at_); }

private:
    bool nextQuoted(std::string_view& word);
    template <class T> bool takeNumber(T& value);

    std::string_view text_;
    std::size_t at_ = 0, index_ = 0;
    bool quoted_ = false;
    std::string scratch_;       // holds a word that had escapes
};

// All words of a text.
std::vector<std::string> splitWords(std::string_view text);

// Append a word to out, with a space before it unless out is empty or ends in white space, and quoted if it has to be.
// With keywords, it is also quoted if it would be read as a keyword (TMSG, FMSG, IMSG, AMSG, TDBX).
void appendWord(std::string& out, std::string_view word, bool keywords = false);
void appendQuoted(std::string& out, std::string_view word);     // the same, always quoted
std::string joinWords(const std::vector<std::string>& words);

// Shortest text of a number that reads back to the same bits.
void appendNumber(std::string& out, double value);
void appendNumber(std::string& out, std::int64_t value);
std::string numberText(double value);
// For people: 1000, not 1e+03; an exponent only where there would be too many digits.
std::string plainNumber(double value);
// Read a text that is a number and nothing else: no surrounding space, no hexadecimal, no locale. False: it is not, or it is
// beyond the range of the type; then value is unchanged.
bool parseNumber(std::string_view text, double& value);
bool parseNumber(std::string_view text, std::int64_t& value);

// A word that a peer or user sent, for messages: in quotes, control characters escaped, cut when it is long.
std::string shown(std::string_view word);

// Parse a request. message is cleared first. For CTRL and DBX all further words go to message.words. After an error name is
// the name if it was found; method and message are unspecified. The name is not checked. Allocates only when name and
// message are too small, and for words with escapes.
void parseRequest(std::string_view text, std::string& name, Method& method, Message& message);
// Parse the parts after NAME METHOD.   reader: has read these two.
void parseParts(WordReader& reader, Method method, Message& message);
void appendRequest(std::string& out, std::string_view name, Method method, const Message& message);

void parseReply(std::string_view text, std::string& name, Message& message);
// plain: the name is known to need no quotes, and out is empty.
void appendReply(std::string& out, std::string_view name, const Message& message, bool plain = false);
// Append text, floats, ints and any as in requests and replies, with a space before each part unless out is empty; without
// code, trail and free words.
void appendParts(std::string& out, const Message& message);

}  // namespace sorma
