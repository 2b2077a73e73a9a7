// access.h -- who may do what: the policy of one SORM. Every check of a right is made here.
//
// Each author of the word that is acted on (Message::author, Origin::author) needs the right: when the word is set, and again
// when it is used. It is asked for the object that is reached, after spelling and second names. The owner of the
// process (a null principal) may do everything. An exception is the SORM of a safe interpreter: its owner has the rights
// that the parent has granted.
//
// A function takes a Permit when it reaches an object, a value, an event, a file or a program for somebody. Only this file makes
// permits; bus/named.h asks for those of files and programs. So a door that forgets to ask does not compile. The code of a
// class acts for the owner: Permit::owner(). doors() lists the doors.
//
// A policy is text; each line is a rule. For each right the first line decides that names the right and fits:
//
//     LINE    := allow|deny SUBJECT RIGHT... ?on PATTERN...?  |  revoke CERTIFICATE...
//     SUBJECT := user NAME | group NAME | local NAME | host ADDRESS?/BITS? | cert CERTIFICATE | web LOGIN | anyone
//     CERTIFICATE := NAME | NAME@ORGANISATION, each of them a pattern; without @ of any organisation
//     RIGHT   := call inspect configure make dictionary files program reach operate relay
//                use = call inspect;  tune = use configure make dictionary;  everything
//     PATTERN := as Tcl's string match (bus/glob.h), default *
//                on the object's own name   dictionary: the entry   files: the real path   reach: the text after @
//
// First come the lines that were added at run time, the newest first. Then come those of the command line, in their order, those of
// the file, and last these, which are built in. So others may do nothing until a line says more.
//     allow local SELF tune operate
//     allow cert * tune            for certificates of our own authority
//     allow web SELF tune
//     allow anyone use             of a daemon that is open
//
// Threads: the SORM's.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "bus/kept.h"
#include "bus/principal.h"

namespace sorma {

enum class Right : std::uint16_t {
    call = 1,           // EXEC, first use by name, and everything that stops a motion (Danger::stop)
    inspect = 2,        // DBX, -help, -dump, subscriptions
    configure = 4,      // options and actions of CTRL
    make = 8,           // create, second names, remove
    dictionary = 16,    // change an entry
    files = 32,         // read or write a file
    program = 64,       // run a program
    reach = 128,        // make this daemon call elsewhere
    policy = 256,       // change the policy: only the owner has it, no line can give it
    operate = 512,      // besides: whatever moves, powers or fires something (Danger)
    relay = 1024,       // pass requests on for others: then they have the rights of their author, too; else those of anyone
};
using Rights = std::uint16_t;
constexpr Rights operator|(Right a, Right b) { return Rights(Rights(a) | Rights(b)); }
constexpr Rights operator|(Rights a, Right b) { return Rights(a | Rights(b)); }
const char* toText(Right right);

// The proof that all authors have a right to a target, for the call that it is given to. Do not keep it: the policy may change.
class Permit {
public:
    // For what the code of a class does, or the program itself: the owner needs no right.
    static Permit owner() { return Permit(); }
    // Is it the right to this target? Else fails with POLICY PERMIT, an error of the code that has asked for something else.
    void check(Right right, std::string_view target) const {
        if (!owner_) [[unlikely]] compare(right, target);
    }
    void check(Right right) const;                  // the same for a target that only whoever has asked knows
    bool includes(Right right) const { return owner_ || (rights_ & Rights(right)); }      // to the same target
    bool isOwners() const { return owner_; }

private:
    friend class Access;
    Permit() = default;
    Permit(Rights rights, std::string_view target);
    void compare(Right right, std::string_view target) const;
    bool owner_ = true;
    Rights rights_ = 0;
    std::size_t target_ = 0;            // hash of its name
};

// A door: a way by which something is reached for somebody.
struct Door {
    const char* words;                  // as they are typed, or what else it is
    Right right;
    const char* target;                 // for what the right is asked
};

class Access {
public:
    // ---- checking a right ----

    // Returns if the author has the right. Else counts the refusal and fails with COMM DENIED; the message names caller,
    // right, subject, and the line that would allow it.   subject: what the line's PATTERN is compared with.   object: for
    // the message.
    Permit need(const PrincipalPointer& author, Right right, std::string_view subject, std::string_view object) {
        if (author || restricted_) [[unlikely]] return ask(author, right, subject, object);
        return Permit();
    }
    // All doors, for the manual and the tests.
    static const std::vector<Door>& doors();
    // All the rights that a principal has on one subject; of several principals: those that each of them has. Valid until
    // epoch() changes.
    Rights rights(const PrincipalPointer& author, std::string_view subject) const;
    std::uint32_t epoch() const { return epoch_; }      // counts the changes of the policy
    Budget* budget = nullptr;                           // pays for refusals that are remembered; null: nobody does
    // Called after each change, inside the function that made it, until unwatch. A holder of something for a principal (a
    // subscription, a lock) ends it here when the right is gone. who: any pointer, as the key.
    void watch(const void* who, std::function<void()> changed) { watchers_[who] = std::move(changed); }
    void unwatch(const void* who) { watchers_.erase(who); }
    // Fails with COMM DENIED and counts it, whatever the policy says.
    [[noreturn]] void refuse(const PrincipalPointer& author, Right right, std::string_view subject, std::string_view object);

    // ---- the policy ----

    // Add a line of the command line, after those that were added before. Fails with POLICY SYNTAX; the message says what was
    // expected and at which word.   source: where the line comes from, for messages.
    void add(std::string_view line, std::string source);
    // Add a line at run time, before all others. Returns its number, which text() and explain() show. Fails as add.
    int addFirst(std::string_view line, const std::string& source);
    // Take back a line that was added at run time. Fails with POLICY LINE when none has this number; the message names those
    // that there are.
    void remove(int number);
    // Load a file. Its lines replace those of a file that was loaded before. All or nothing. Fails with POLICY SYNTAX, and
    // with POLICY FILE when it cannot be read or others than its owner may write to it. The owner must be this user or root.
    void load(const std::string& file);
    // Load $XDG_CONFIG_HOME/sorma/policy, else ~/.config/sorma/policy, if it exists and no file has been loaded.
    void loadDefault();
    void reload();                                      // load the same file again
    std::string text() const;                           // the policy, a line each, with the source after it
    // Would it be allowed? "yes, by ..." or "no, by ...". subject: as in a line: two words, or "anyone".
    std::string explain(std::string_view subject, std::string_view right, std::string_view on) const;

    // ---- what was refused ----
    void note(const PrincipalPointer& author, const std::string& what);      // count a refusal that was made elsewhere, and remember it
    std::uint64_t denials() const { return denials_; }
    std::string deniedText() const;                     // the count, then the latest refusals, a line each

    // ---- a safe interpreter ----
    // From now on the owner needs rights, too: all but files, program and reach are allowed, unless grant() says otherwise.
    void restrict() { restricted_ = true; }
    bool restricted() const { return restricted_; }
    // words: a line without its SUBJECT: {allow reach on robot}. The last matching line wins.
    void grant(const std::vector<std::string>& words);
    std::vector<std::string> grants() const;

    std::string daemon;                                 // for messages: name of the daemon; empty: no daemon

    // Everybody may use it, as for a demonstration (sormad -open 1).
    void setOpen(bool open) {
        if (open_ == open) return;
        open_ = open;
        anotherHolds();
    }
    bool isOpen() const { return open_; }

    // A line revokes this certificate.
    bool revokes(std::string_view name, std::string_view organisation) const;

private:
    friend class Service;                               // it keeps the rights that it has asked for
    static Permit known(Rights rights, std::string_view subject) { return Permit(rights, subject); }
    struct Line {
        enum class Subject : std::uint8_t { user, group, local, host, cert, web, anyone, owner, ownAuthority } subject = Subject::anyone;
        bool allow = false;
        std::uint32_t number = 0;                       // uid or gid
        Principal::Address address{};
        int bits = 128;
        Rights rights = 0;
        std::vector<std::string> patterns;              // empty: everything
        std::vector<std::string> certificates;          // cert, web: one; revoke: all of them, and no rights
        std::string text, source;
        int line = 0;                                   // its number, if it was added at run time

        bool fits(const Principal* who) const;
        bool covers(std::string_view subject) const;
    };
    static Line parse(std::string_view text, std::string source);
    static Line parseGiven(std::string_view text, std::string source);      // the word allow may be missing
    static void parseHost(Line& line, const std::string& host);
    static void parseRights(Line& line, const std::vector<std::string>& words, std::size_t at);
    const std::vector<Line>& builtIn() const;
    const Line* decide(const Principal* who, Right right, std::string_view subject) const;
    Rights rightsOfOne(const Principal* who, std::string_view subject) const;
    template <class F> void eachLine(F body) const;
    void anotherHolds();
    Permit ask(const PrincipalPointer& author, Right right, std::string_view subject, std::string_view object);
    std::string remedy(const PrincipalPointer& author, Right right, std::string_view subject) const;

    std::vector<Line> added_, given_, ofFile_, granted_;    // at run time, the newest first; by the command line; ...
    int lastAdded_ = 0;                                 // number of the line that was added last at run time
    std::map<const void*, std::function<void()>> watchers_;
    std::string file_;
    bool restricted_ = false, open_ = false;
    std::uint32_t epoch_ = 1;
    std::uint64_t denials_ = 0;
    struct Denial {
        std::int64_t time;
        std::string text;
        std::uint64_t times;
        std::size_t heap() const { return heapOf(text); }
    };
    std::deque<Charged<Denial>> denied_;
};

}  // namespace sorma
