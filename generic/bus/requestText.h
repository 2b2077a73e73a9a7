// requestText.h -- requests and replies as text, the way people type them.
//
//     request = name ("EXEC" part* | ("CTRL" | "DBX") word*)
//     reply   = name "RET" code part*                                  (without free words)
//     part    = "TMSG" word | "FMSG" n number{n} | "IMSG" n integer{n} | "AMSG" base64 | "TDBX" word | word
//     word    = bare | '"' ... '"' | "'" ... "'" | "{" ... "}"
//
// Reading. Bare words end at white space and are taken as they stand; only their first character decides that they
// are bare. Inside "..." a backslash escapes: \n \t \r, \xHH (the character U+00HH), and any ASCII punctuation or space
// stands for itself; inside '...' nothing escapes; inside {...} nothing does and braces must balance. A quoted word
// is never a keyword. Each part comes once. What follows the n numbers of FMSG or IMSG must not be a bare number: a
// count that is too small would go unnoticed.
//
// Writing, the canonical form. Parts stand in the order above, empty ones are left out, then the free words. A word is
//     bare    when it is not empty and holds no white space, control character, quote or brace;
//     {...}   else, when it holds no control character and no backslash, and its braces balance;
//     "..."   else, with \" \\ \n \t \r, and \xHH for other control characters.
// So a word never contains a newline, whatever it means, and each form gives back the same word when it is read:
// bare and {...} since nothing in them ends the word early or is altered, "..." since all that would is escaped.
// Bytes that are not UTF-8 are written as U+FFFD. A free word that would be read as a keyword, or as a number too many,
// is quoted.
//
// Numbers are written in the shortest form that reads back to the same bits (std::to_chars; nan of either sign is
// nan) and read without regard to locale. Canonical text -> message -> text is the identity, and so is message -> text
// -> message, apart from what a direction leaves out: requests carry no code and no trail, replies no free words.
//
// Errors: REQUEST SYNTAX, naming what was expected and at which word (counted from 1); text that is not UTF-8.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "bus/message.h"

namespace sorma {

// Takes words off a text, one by one. The views stay valid until the next call.
class WordReader {
public:
    explicit WordReader(std::string_view text) : text_(text) {}
    // The next word; false at the end. Fails with REQUEST SYNTAX on unbalanced quotes or junk after a closing quote.
    bool next(std::string_view& word);
    bool quoted() const { return quoted_; }             // was the last word quoted?
    // The next word when it is a bare number, without looking at it twice; else false, and nothing is taken.
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

// Append a word to out (with a space before it unless out is empty or ends in white space), quoted where it must be.
// keywords: also quote what would otherwise be read as a keyword (TMSG, FMSG, IMSG, AMSG, TDBX).
void appendWord(std::string& out, std::string_view word, bool keywords = false);
void appendQuoted(std::string& out, std::string_view word);     // the same, always quoted
std::string joinWords(const std::vector<std::string>& words);

// Shortest text of a number that reads back to the same bits.
void appendNumber(std::string& out, double value);
void appendNumber(std::string& out, std::int64_t value);
std::string numberText(double value);
// For people to read: 1000, not 1e+03; an exponent only where the digits would be too many.
std::string plainNumber(double value);
// The whole text must be a number; no locale, surrounding space or hexadecimal. False otherwise, value unchanged;
// also when it is beyond the range of the type.
bool parseNumber(std::string_view text, double& value);
bool parseNumber(std::string_view text, std::int64_t& value);

// A word of foreign origin for a message to people: in quotes, control characters escaped, cut when it is long.
std::string shown(std::string_view word);

bool isUtf8(std::string_view text);
void appendBase64(std::string& out, const unsigned char* data, std::size_t size);
bool parseBase64(std::string_view text, std::vector<unsigned char>& out);   // appends; false when malformed

// Parse a request. message is cleared first. For CTRL and DBX all further words go to message.words. After a failure
// name holds what was recognized as the name; method and message are unspecified. The name is not checked.
// Allocates only where name and message are too small for what comes, and for words with escapes.
void parseRequest(std::string_view text, std::string& name, Method& method, Message& message);
// The parts behind NAME METHOD, from a reader that stands there.
void parseParts(WordReader& reader, Method method, Message& message);
void appendRequest(std::string& out, std::string_view name, Method method, const Message& message);

void parseReply(std::string_view text, std::string& name, Message& message);
void appendReply(std::string& out, std::string_view name, const Message& message);
// Text, floats, ints and any as they stand in requests and replies, each part with a space before it unless out is
// empty; not code, trail and free words.
void appendParts(std::string& out, const Message& message);

// A trail as the one word after TDBX, and back. One line for each entry:
// severity {SYMBOL detail...} {text} so daemon file line time {request}, words quoted as above. The line
// "dropped n" comes first when entries went. Beyond Trail::limit() entries of the text are dropped.
std::string trailToWord(const Trail& trail);
Trail trailFromWord(std::string_view word);

}  // namespace sorma
