// convert.h -- between Tcl values and messages, without a detour through text.
//
// Text: Tcl's own is UTF-8 with two habits: NUL is the bytes C0 80, and 8.6 writes characters beyond U+FFFF as two
// surrogates of three bytes each. Neither ever leaves this file. ASCII, and most else, is copied as it stands.
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

// Real UTF-8 of a value, appended / returned. Fails with REQUEST SYNTAX on half a surrogate pair, which no UTF-8 can hold.
void appendUtf8(std::string& out, Tcl_Obj* o);
std::string toUtf8(Tcl_Obj* o);
// A new value from UTF-8. Bytes that are not UTF-8 become the characters of the same number, as in Tcl itself.
Tcl_Obj* newText(std::string_view utf8);

// Elements of a list, with the reason when it is none. Fails with REQUEST SYNTAX.
std::span<Tcl_Obj* const> listElements(Tcl_Obj* list);
std::vector<std::string> listStrings(Tcl_Obj* list);

// Numbers and bytes. They fail with REQUEST SYNTAX, naming what is wrong; a NaN is a number.
double toDouble(Tcl_Obj* o);
std::int64_t toInteger(Tcl_Obj* o);
bool toBoolean(Tcl_Obj* o);
void toBytes(Tcl_Obj* o, std::vector<unsigned char>& out);

// Values that replies share, one set for each interpreter (Tcl values belong to a thread).
class Constants {
public:
    Constants();
    Tcl_Obj* integer(std::int64_t n) const {        // shared when small, else new
        return n >= kLow && n < kHigh ? static_cast<Tcl_Obj*>(small_[std::size_t(n - kLow)]) : Tcl_NewWideIntObj(n);
    }
    Obj empty, ret, tmsg, fmsg, imsg, amsg, tdbx, ret0;         // ret0: the list RET 0
    Obj text, floats, ints, any, words, code, trail, code0;     // code0: the dict code 0
    Obj yield, infoCoroutine, coroutine, runExec;               // command words

private:
    static constexpr std::int64_t kLow = -8, kHigh = 256;
    std::array<Obj, std::size_t(kHigh - kLow)> small_;
};

// Words behind EXEC: parts go into the parts of the message, the rest into m.words. m is clear.
void readParts(std::span<Tcl_Obj* const> words, Message& m);
// Words behind exec: -text s -floats l -ints l -any bytes, then words. m is clear.
void readOptions(std::span<Tcl_Obj* const> words, Message& m);
// RET code ?TMSG t? ?FMSG n x..? ?IMSG n i..? ?AMSG b64? ?TDBX trail?, as a new list (or the shared RET 0).
Tcl_Obj* flatReply(const Constants& constants, const Message& m);
// Dict of what is not empty; code always.
Tcl_Obj* dictReply(const Constants& constants, const Message& m);
// List of dicts: severity code text so daemon file line time, and request where there is one.
Tcl_Obj* trailList(const Trail& trail);
// SORMA AREA SYMBOL detail...
Tcl_Obj* errorCode(const Entry& entry);

// The dict text floats ints any words that a TclOO service gets, and what it returns (text floats ints any code).
Tcl_Obj* messageDict(const Constants& constants, const Message& m);
// What the command of a subscription gets: object event number lost time request, and the dict of the message.
Tcl_Obj* eventDict(const Constants& constants, const Received& event);
void readResult(Tcl_Obj* dict, Message& m);     // replaces the parts of m; fails with SERVICE RESULT

Tcl_Obj* newValue(const Value& value);

}  // namespace sorma
