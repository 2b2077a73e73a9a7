// access.h -- who may do what: the policy of one SORM. Every check of a right is made here.
//
// The right is needed by the author of the word that is acted on (Message::author, Origin::author): when the word is set,
// and again when it is used. The owner of the process (a null principal) may do everything. An exception is the SORM of a
// safe interpreter: its owner has the rights that the parent has granted.
//
// A policy is text; each line is a rule. For each right the first line decides that names the right and fits:
//
//     LINE    := allow|deny SUBJECT RIGHT... ?on PATTERN...?
//     SUBJECT := user NAME | group NAME | local NAME | host ADDRESS?/BITS? | anyone
//     RIGHT   := call inspect configure make dictionary files program reach
//                use = call inspect;  tune = use configure make dictionary;  everything
//     PATTERN := as Tcl's string match, on the object's own name; dictionary: the entry; files: the real path; reach: the
//                text after @. Default *
//
// and last, built in: allow local SELF tune; allow anyone use.
//
// Threads: the SORM's.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "bus/principal.h"

namespace sorma {

enum class Right : std::uint16_t {
    call = 1,           // EXEC, first use by name, and everything that stops a motion
    inspect = 2,        // DBX, -help, -dump, subscriptions
    configure = 4,      // options and actions of CTRL
    make = 8,           // create, second names, remove
    dictionary = 16,    // change an entry
    files = 32,         // read or write a file
    program = 64,       // run a program
    reach = 128,        // make this daemon call elsewhere
    policy = 256,       // change the policy: only the owner has it, no line can give it
};
using Rights = std::uint16_t;
constexpr Rights operator|(Right a, Right b) { return Rights(Rights(a) | Rights(b)); }
constexpr Rights operator|(Rights a, Right b) { return Rights(a | Rights(b)); }
const char* toText(Right right);

class Access {
public:
    // ---- checking a right ----

    // Returns if the author has the right. Else counts the refusal and fails with COMM DENIED; the message names caller,
    // right, subject, and the line that would allow it.   subject: what the line's PATTERN is compared with.   object: for
    // the message.
    void need(const PrincipalPointer& author, Right right, std::string_view subject, std::string_view object) {
        if (author || restricted_) [[unlikely]] ask(author, right, subject, object);
    }
    // All the rights that a principal has on one subject. Valid until epoch() changes.
    Rights rights(const PrincipalPointer& author, std::string_view subject) const;
    std::uint32_t epoch() const { return epoch_; }      // counts the changes of the policy
    std::function<void()> changed;                      // called after each change, inside the function that made it
    // Fails with COMM DENIED and counts it, whatever the policy says.
    [[noreturn]] void refuse(const PrincipalPointer& author, Right right, std::string_view subject, std::string_view object);

    // ---- the policy ----

    // Add a line after those that were added before; all of them come before the lines of the file. Fails with POLICY
    // SYNTAX; the message says what was expected and at which word.   source: where the line comes from, for messages.
    void add(std::string_view line, std::string source);
    // Load a file. Its lines replace those of a file that was loaded before. All or nothing. Fails with POLICY SYNTAX, and
    // with POLICY FILE when it cannot be read, when others than its owner may write to it, or when it belongs to neither
    // this user nor root.
    void load(const std::string& file);
    // Load $XDG_CONFIG_HOME/sorma/policy, else ~/.config/sorma/policy, if it exists and no file has been loaded.
    void loadDefault();
    void reload();                                      // load the same file again
    std::string text() const;                           // the policy, a line each, with the source after it
    // Would it be allowed? "yes, by ..." or "no, by ...". subject: as in a line: two words, or "anyone".
    std::string explain(std::string_view subject, std::string_view right, std::string_view on) const;

    // ---- what was refused ----
    std::uint64_t denials() const { return denials_; }
    std::string deniedText() const;                     // the count, then the latest refusals, a line each

    // ---- a safe interpreter ----
    // From now on the owner needs rights, too: all but files, program and reach are allowed, unless grant() says otherwise.
    void restrict() { restricted_ = true; }
    bool restricted() const { return restricted_; }
    // words: a line without its SUBJECT: {allow reach on robot}. Later ones come before earlier ones.
    void grant(const std::vector<std::string>& words);
    std::vector<std::string> grants() const;

    std::string daemon;                                 // for messages: name of the daemon; empty: no daemon

private:
    struct Line {
        enum class Subject : std::uint8_t { user, group, local, host, anyone, owner } subject = Subject::anyone;
        bool allow = false;
        std::uint32_t number = 0;                       // uid or gid
        Principal::Address address{};
        int bits = 128;
        Rights rights = 0;
        std::vector<std::string> patterns;              // empty: everything
        std::string text, source;

        bool fits(const Principal* who) const;
        bool covers(std::string_view subject) const;
    };
    static Line parse(std::string_view text, std::string source);
    static void parseRights(Line& line, const std::vector<std::string>& words, std::size_t at);
    static const std::vector<Line>& builtIn();
    const Line* decide(const Principal* who, Right right, std::string_view subject) const;
    template <class F> void eachLine(F body) const;
    void anotherHolds();
    void ask(const PrincipalPointer& author, Right right, std::string_view subject, std::string_view object);
    std::string remedy(const PrincipalPointer& author, Right right, std::string_view subject) const;

    std::vector<Line> given_, ofFile_, granted_;
    std::string file_;
    bool restricted_ = false;
    std::uint32_t epoch_ = 1;
    std::uint64_t denials_ = 0;
    struct Denial {
        std::int64_t time;
        std::string text;
        std::uint64_t times;
    };
    std::deque<Denial> denied_;
};

}  // namespace sorma
