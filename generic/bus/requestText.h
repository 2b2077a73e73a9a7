// requestText.h -- requests and replies as text, the way people type them.
//
//     request = name ("EXEC" part* | ("CTRL" | "DBX") word*)
//     reply   = name "RET" code part*
//     part    = "TMSG" word | "FMSG" n number{n} | "IMSG" n integer{n} | "AMSG" base64 | "TDBX" word | word
//     word    = bare | '"' ... '"' | "'" ... "'" | "{" ... "}"
//
// Bare words end at white space and are taken as they stand. Inside "..." a backslash escapes (\" \\ \n \t \r \xHH);
// inside '...' nothing does; inside {...} nothing does and braces must balance. A quoted word is never a keyword.
// Numbers are written in the shortest form that reads back to the same bits (std::to_chars) and read without regard
// to locale. Canonical text (what these functions write) -> message -> text is the identity.
//
// Errors: REQUEST SYNTAX, naming what was expected and at which word (counted from 1); text that is not UTF-8.
#pragma once

#include <cstddef>
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
    std::size_t index() const { return index_; }        // its number, from 1
    std::string_view rest() const { return text_.substr(at_); }

private:
    std::string_view text_;
    std::size_t at_ = 0, index_ = 0;
    bool quoted_ = false;
    std::string scratch_;       // holds a word that had escapes
};

// All words of a text.
std::vector<std::string> splitWords(std::string_view text);

// Append a word to out (with a space before it unless out is empty or ends in one), quoted where it must be.
// keywords: also quote what would otherwise be read as a keyword (TMSG, FMSG, IMSG, AMSG, TDBX).
void appendWord(std::string& out, std::string_view word, bool keywords = false);
std::string joinWords(const std::vector<std::string>& words);

// Shortest text of a number that reads back to the same bits.
void appendNumber(std::string& out, double value);
void appendNumber(std::string& out, std::int64_t value);
std::string numberText(double value);
// The whole text must be a number; no locale, surrounding space or hexadecimal. False otherwise, value unchanged.
bool parseNumber(std::string_view text, double& value);
bool parseNumber(std::string_view text, std::int64_t& value);

bool isUtf8(std::string_view text);
void appendBase64(std::string& out, const unsigned char* data, std::size_t size);
bool parseBase64(std::string_view text, std::vector<unsigned char>& out);   // appends; false when malformed

// Parse a request. name views into text (or into the reader's scratch when quoted: then it is copied to nameScratch).
// message is cleared first. For CTRL and DBX all further words go to message.words.
void parseRequest(std::string_view text, std::string& name, Method& method, Message& message);
// The parts behind NAME METHOD, from a reader that stands there.
void parseParts(WordReader& reader, Method method, Message& message);
void appendRequest(std::string& out, std::string_view name, Method method, const Message& message);

void parseReply(std::string_view text, std::string& name, Message& message);
void appendReply(std::string& out, std::string_view name, const Message& message);
// The parts of a message as they stand in requests and replies, each with a space before it; not code and trail.
void appendParts(std::string& out, const Message& message);

// A trail as the one word after TDBX, and back. One line for each entry:
// severity {SYMBOL detail...} {text} so daemon file line time {request}, words quoted as above.
std::string trailToWord(const Trail& trail);
Trail trailFromWord(std::string_view word);

}  // namespace sorma
