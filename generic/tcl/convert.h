// convert.h -- converts between Tcl values and messages, without going through text.
//
// Text: Tcl's text is UTF-8 with two differences. NUL is the bytes C0 80, and Tcl 8.6 writes characters beyond U+FFFF as two
// surrogates of three bytes each. Only this file knows of these.
//
// Threads: the interpreter's; Tcl values belong to their thread.
// Owner:   a Tcl_Obj* that is returned as new has reference count 0: put it into an Obj, or give it to Tcl.
// Errors:  REQUEST SYNTAX, unless a function says otherwise. The message names the value and what was expected.
#pragma once

#include <array>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "bus/message.h"
#include "bus/option.h"
#include "bus/stream.h"
#include "tcl/tclShim.h"

namespace sorma {

// Real UTF-8 of a value: appended, or returned. Fails on half a surrogate pair, which UTF-8 cannot hold.
void appendUtf8(std::string& out, Tcl_Obj* o);
std::string toUtf8(Tcl_Obj* o);
// A new value from UTF-8. A byte that is not UTF-8 becomes the character of that number, as in Tcl itself.
Tcl_Obj* newText(std::string_view utf8);

// Elements of a list. Fails when it is not a list. The span is valid as long as the value is not changed or freed.
std::span<Tcl_Obj* const> listElements(Tcl_Obj* list);
std::vector<std::string> listStrings(Tcl_Obj* list);

// Numbers and bytes. NaN is a number. An integer must fit into 64 bits; a byte is a character up to 255.
double toDouble(Tcl_Obj* o);
std::int64_t toInteger(Tcl_Obj* o);
bool toBoolean(Tcl_Obj* o);
void toBytes(Tcl_Obj* o, std::vector<unsigned char>& out);

// Values that many replies use, so that they are not made for each. One set for each interpreter, since Tcl values belong to
// a thread.
class Constants {
public:
    Constants();
    Tcl_Obj* integer(std::int64_t n) const {        // a shared value for small numbers, else a new one
        return n >= kLow && n < kHigh ? static_cast<Tcl_Obj*>(small_[std::size_t(n - kLow)]) : Tcl_NewWideIntObj(n);
    }
    Obj empty, ret, tmsg, fmsg, imsg, amsg, tdbx, ret0;         // ret0: the list RET 0
    Obj text, floats, ints, any, words, code, trail, code0;     // code0: the dict code 0
    Obj yield, infoCoroutine, coroutine, runExec;               // command words

private:
    static constexpr std::int64_t kLow = -8, kHigh = 256;
    std::array<Obj, std::size_t(kHigh - kLow)> small_;
};

// Requests. m must be clear; after an error it may be filled in part. object: its name, for messages. They also say the word's
// number, counted from the object's name, and show the words around it.
// The words after EXEC: TMSG, FMSG, IMSG and AMSG fill the parts of the message, the other words go to m.words.
void readParts(std::string_view object, std::span<Tcl_Obj* const> words, Message& m);
// The words after exec: -text s -floats l -ints l -any bytes, then words. A part after a word is an error, but for words
// behind --.
// method: for messages, what stands between the object and the words.
void readOptions(std::string_view object, std::span<Tcl_Obj* const> words, Message& m, std::string_view method = "exec");

// Replies. Each is a new value or a shared one.
// RET code ?TMSG t? ?FMSG n x..? ?IMSG n i..? ?AMSG b64? ?TDBX trail?, as a list.
Tcl_Obj* flatReply(const Constants& constants, const Message& m);
// A dict of the parts that are not empty, and code.
Tcl_Obj* dictReply(const Constants& constants, const Message& m);
// A list of dicts: severity code text so daemon file line time, and request where there is one.
Tcl_Obj* trailList(const Trail& trail);
// The -errorcode: SORMA AREA SYMBOL detail...
Tcl_Obj* errorCode(const Entry& entry);

// Services in Tcl.
// The dict that their exec gets: text floats ints any words.
Tcl_Obj* messageDict(const Constants& constants, const Message& m);
// The dict that their exec returns (text floats ints any code) replaces the parts of m. Fails with SERVICE RESULT.
void readResult(Tcl_Obj* dict, const std::string& so, Message& m);
// The dict that the command of a subscription gets: object event number lost time request, and the parts of the message.
Tcl_Obj* eventDict(const Constants& constants, const Received& event);

// The value of an option, as `cget` returns it.
Tcl_Obj* newValue(const Value& value);

}  // namespace sorma
