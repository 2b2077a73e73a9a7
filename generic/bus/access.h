// access.h -- who may do what: the policy of one SORM, and the one place that is asked.
//
// A right is asked of whoever wrote the word that is acted on (Message::author, Origin::author): when it is set, and when
// it is used. The owner of the process (a null principal) may do everything, unless the SORM is that of a safe
// interpreter, which has what its parent has granted.
//
// A policy is text, one line a rule; per right the first line that names it and fits decides:
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
// Threads: the SORM's, but may() of a mask that is known already.
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
    call = 1,           // EXEC, first use by name, and whatever stops a motion
    inspect = 2,        // DBX, -help, -dump, subscriptions
    configure = 4,      // options and actions of CTRL
    make = 8,           // create, second names, remove
    dictionary = 16,    // change an entry
    files = 32,         // read or write a file
    program = 64,       // run a program
    reach = 128,        // make this daemon call elsewhere
    policy = 256,       // change the policy: the owner's alone, no line gives it
};
using Rights = std::uint16_t;
constexpr Rights operator|(Right a, Right b) { return Rights(Rights(a) | Rights(b)); }
constexpr Rights operator|(Rights a, Right b) { return Rights(a | Rights(b)); }
const char* toText(Right right);

class Access {
public:
    // ---- asking ----

    // Returns when the author may; else fails with COMM DENIED, naming caller, right, subject and the line that would
    // allow it, and counts the refusal. subject: what the line's PATTERN is for. object: which the message names.
    void need(const PrincipalPointer& author, Right right, std::string_view subject, std::string_view object) {
        if (author || restricted_) [[unlikely]] ask(author, right, subject, object);
    }
    // All the rights that a principal has on one subject. Good as long as epoch() stays.
    Rights rights(const PrincipalPointer& author, std::string_view subject) const;
    std::uint32_t epoch() const { return epoch_; }
    std::function<void()> changed;                      // called when another policy holds
    // Raises COMM DENIED and counts it, whatever the policy says.
    [[noreturn]] void refuse(const PrincipalPointer& author, Right right, std::string_view subject, std::string_view object);

    // ---- the policy ----

    // Adds a line at the end of those that were added so: all of them come before those of the file. Fails with POLICY
    // SYNTAX, which says what was expected and at which word. source: where it comes from, for messages.
    void add(std::string_view line, std::string source);
    // The lines of a file, in place of those that a file gave before. All or nothing. Fails with POLICY FILE, POLICY SYNTAX;
    // also when others than its owner may write to it, or it belongs to neither this user nor root.
    void load(const std::string& file);
    // $XDG_CONFIG_HOME/sorma/policy, else ~/.config/sorma/policy, when there is one and no file has been loaded.
    void loadDefault();
    void reload();                                      // the file that was loaded, again
    std::string text() const;                           // a line each, where it comes from behind it
    // Would it be allowed? "yes, by ..." or "no, by ...". subject: two words, as in a line; "anyone" is one.
    std::string explain(std::string_view subject, std::string_view right, std::string_view on) const;

    // ---- what was refused ----
    std::uint64_t denials() const { return denials_; }
    std::string deniedText() const;                     // the count, and the latest, a line each

    // ---- a safe interpreter ----
    // From now on the owner himself has what grant() says; else all but files, program and reach.
    void restrict() { restricted_ = true; }
    bool restricted() const { return restricted_; }
    // words: a line without its SUBJECT: {allow reach on robot}. Later ones go before.
    void grant(const std::vector<std::string>& words);
    std::vector<std::string> grants() const;

    std::string daemon;                                 // whom messages name, behind an @; empty: no daemon

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
