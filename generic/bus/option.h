// option.h -- the description of a service class: options, actions, EXEC signature, example.
//
// A class declares one table. CTRL parsing, range checks, -help, -dump, configure, cget, completion, panels and manual pages
// are made from it.
//
//     sorma::Class Carry::describe() {
//         return sorma::Class::of<Carry>("carry", "carries a thing from one place to another")
//             .real("-transferSpeed", &Carry::speed_, {.unit = "m/s", .low = 0.01, .high = 1.5, .help = "speed while loaded"})
//             .choice("-grip", &Carry::grip_, {"soft", "firm"}, {.help = "how to hold"})
//             .service("-arm", &Carry::arm_, {.help = "arm that moves"})
//             .action("-stop", &Carry::stop, "", "stop at once")
//             .reads(sorma::Field::floats, sorma::exactly(6), "m", "from (3), to (3)")
//             .example("carry EXEC FMSG 6 3 4 0 4 5 0");
//     }
//
// The default of an option is the value of its member after construction.
//
// Threads: a table is complete before its class is added to a SORM; then any thread may read it. Functions in it are called
//          by the thread that uses the object.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <tuple>
#include <vector>

#include "bus/access.h"
#include "bus/message.h"
#include "bus/named.h"
#include "bus/reference.h"
#include "bus/where.h"

namespace sorma {

class Service;

// Value of an option: flag, int, double, string (also enum and service name), vector.
using Value = std::variant<bool, std::int64_t, double, std::string, std::vector<double>>;
std::string toText(const Value& value);         // as CTRL reads it; a vector: numbers separated by spaces

enum class Type : std::uint8_t { flag, integer, real, text, choice, vector, service };
const char* toText(Type type);                  // "flag" "int" "double" "string" "enum" "vector" "service"
bool fromText(std::string_view text, Type& out);

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

// A value outside of these is allowed; panels show it as a warning or an alarm.
struct Limits {
    double low = -kInfinity, high = kInfinity;
};

// A word does this to the world. A caller needs Right::operate besides the word's own right to move, power or fire something.
// Every caller may stop it.
enum class Danger : std::uint8_t { none, move, power, fire, stop };
const char* toText(Danger danger);              // "" "move" "power" "fire" "stop"
bool fromText(std::string_view text, Danger& out);
constexpr bool needsOperate(Danger danger) { return danger != Danger::none && danger != Danger::stop; }

// The properties of an option that most options do not set. Values outside low .. high are refused; NaN is refused when
// there is a range.
struct Spec {
    std::string unit = {};                          // "m/s"; empty: none
    double low = -kInfinity, high = kInfinity;      // int, double, each element of a vector
    std::string help = {};                          // a line for people
    bool fixed = false;                             // only a recipe may set it; later it is refused (OPTION READONLY)
    std::size_t minLength = 0, maxLength = SIZE_MAX;    // vector: number of elements
    Danger danger = Danger::none;                   // of setting it; not stop
    // The rest is only for panels and help.
    Limits warn = {}, alarm = {};                   // int, double, each element of a vector
    Kind kind = Kind::plain;
    std::vector<std::string> literals = {};         // of such a kind: words of the class's own, which name no file or program
    std::vector<std::string> names = {};            // vector: names of its elements
    std::string group = {};                         // options of one group are shown together
    bool expert = false;                            // help and panels show it only on demand
    // kMask stands for the value wherever somebody may see it who may not set it: dumps, trails, audits, events, monitors, the
    // dictionary. Not for a flag, an enum or a service.
    bool secret = false;
    // service: its object is executed in this one's EXEC, and has its real-time owner (Service::parts). False: it gets requests of its own.
    bool part = true;
};
inline constexpr std::string_view kMask = "********";

// Reads the value of an option. It is called through Option::value, which asks for a permit.
class Getter {
public:
    template <class F> Getter(F read) : read_(std::move(read)) {}

private:
    friend struct Option;
    std::function<Value(const Service&)> read_;
};

struct Option {
    std::string name;               // with the dash: "-transferSpeed"
    Type type = Type::text;
    Spec spec;
    std::vector<std::string> choices;                   // enum: the values that are allowed
    Getter get = nullptr;                               // must not throw
    std::function<void(Service&, const Value&)> set;    // the value has been checked; throw to refuse it
    // type service: called instead of set. The object has been found with the rights of the author of its name; null: none.
    std::function<void(Service&, Reference)> refer = nullptr;
    // A value that names a file or program: called instead of set, with its author (bus/named.h).
    std::function<void(Service&, const std::string& text, const PrincipalPointer& author)> entrust = nullptr;

    // The present value.   permit: to inspect the object.
    Value value(const Service& service, const Permit& permit) const;
    std::string range() const;      // for people and panels: "0.01 .. 1.5", "largo adagio ...", "" when all values are allowed
    // A dict for panels: warn and alarm {low high} (an open end is empty), kind, names, group, expert, secret.
    std::string hints() const;
    // A value names something of the option's kind, unless it is one of its literals.
    Kind kindOf(std::string_view value) const;
    std::string limitsText() const;     // for people: "warning outside 10 .. 60, alarm above 90"
    std::string misfit() const;         // a property that does not fit the type; empty: none
    // Read and check a value. Fails with OPTION VALUE or OPTION RANGE; the message has object, option, value and rule.
    Value parse(std::string_view object, std::string_view text) const;
    void check(std::string_view object, const Value& value, std::string_view given) const;
};

using Args = std::span<const std::string>;

// The body of an action. It is called through Action::run, which asks for a permit.
class Body {
public:
    template <class F> Body(F run) : run_(std::move(run)) {}
    // For a language without types: its arguments have these kinds, and come as texts when their author's rights have been
    // asked. In C++ the kinds follow from the type of a member function, see Class::action.
    template <class F> static Body untyped(F run, std::vector<Kind> kinds) {
        Body body(std::move(run));
        body.kinds_ = std::move(kinds);
        return body;
    }

private:
    friend struct Action;
    std::function<void(Service&, Args, Message& reply)> run_;
    std::vector<Kind> kinds_;
};

// An action (a word of CTRL) or an inspection (a word of DBX). It runs after all options of its request were set.
struct Action {
    static constexpr int kRest = -1;
    std::string name;               // "-stop"
    std::string usage;              // names of its arguments, as in a man page: "name ?word ...?"
    std::string help;               // a line for people
    int minArgs = 0, maxArgs = 0;   // maxArgs kRest: all words that follow
    // Appends its answer to reply.text; throws to refuse. The arguments are by reply.author. If one of them names another
    // thing than this object, the body checks the author's right to it.
    Body body = nullptr;
    Right right = Right::configure;     // that the author of the request needs; only Right::call for an action that stops a motion
    // For an object that is executed in ticks. If true, the body runs while ticks go on, and uses BetweenTicks where it has to.
    // If false, it runs between two ticks, and so must be short.
    bool whileTicking = false;
    Danger danger = Danger::none;       // stop: the right is call
    bool repeatable = false;            // see Class::repeatable; an inspection is, if it needs only the right to inspect
    // Kinds of its arguments; the last holds for all that follow. Empty: all are plain.
    const std::vector<Kind>& kinds() const { return body.kinds_; }

    void run(Service& service, Args args, Message& reply, const Permit& permit) const;      // permit: to `right` on the object
};

// Parts of a message that EXEC reads and writes.
enum class Field : std::uint8_t { text, floats, ints, any };
const char* toText(Field field);    // "text" "floats" "ints" "any"

struct Count {
    std::size_t low = 0, high = SIZE_MAX;
};
constexpr Count exactly(std::size_t n) { return {n, n}; }
constexpr Count atLeast(std::size_t n) { return {n, SIZE_MAX}; }
constexpr Count between(std::size_t low, std::size_t high) { return {low, high}; }

// A part of the EXEC signature.
struct Part {
    Field field;
    Count count;                    // elements; bytes of text and any
    std::string unit, help;
    double low = -kInfinity, high = kInfinity;      // floats: others are refused; NaN is refused when there is a range
};

// The treatment of EXEC requests that come while the object still has to answer another one (Service::later). CTRL and DBX
// never wait.
enum class Concurrency : std::uint8_t {
    serial,             // they run one after another, in order
    concurrent,         // each starts when it comes; the service has to handle several at a time
    exclusive,          // as serial; and a client may lock the object with CTRL -lock
};

// Which flavors a name of the class may have. A name with another one makes no object (NAME UNKNOWN_FLAVOR); only
// sorma::create and `sorm CTRL -create` do.
enum class Flavors : std::uint8_t {
    unsaid,             // any, unless names are strict (Sorm::strict)
    any,                // any in either case: the flavor has a meaning of its own, as with shmem_r.KEY
    dictionary,         // only those that have an entry in the dictionary
};

// The table. Each function adds to it and returns it, so that calls can be chained.
class Class : public std::enable_shared_from_this<Class> {
public:
    // purpose: a line for people.   make: makes an object, which then has the defaults; it may throw.
    Class(std::string name, std::string purpose, std::function<std::unique_ptr<Service>()> make,
          Where where = Where::current());

    template <class S>
    static Class of(std::string name, std::string purpose,
                    Where where = Where::current()) {
        return Class(std::move(name), std::move(purpose), [] { return std::make_unique<S>(); }, where);
    }

    template <class S> Class& flag(std::string name, bool S::*member, Spec spec = {}) {
        return bind<bool>(std::move(name), Type::flag, member, std::move(spec));
    }
    template <class S, class I> Class& integer(std::string name, I S::*member, Spec spec = {}) {
        return bind<std::int64_t>(std::move(name), Type::integer, member, std::move(spec));
    }
    template <class S> Class& real(std::string name, double S::*member, Spec spec = {}) {
        return bind<double>(std::move(name), Type::real, member, std::move(spec));
    }
    template <class S> Class& text(std::string name, std::string S::*member, Spec spec = {}) {
        return bind<std::string>(std::move(name), Type::text, member, std::move(spec));
    }
    // The name of a file, folder, segment or program: the kind comes from the member.
    template <class S, Kind kind> Class& named(std::string name, Named<kind> S::*member, Spec spec = {}) {
        spec.kind = kind;
        return option({std::move(name), Type::text, std::move(spec), {},
                       [member](const Service& s) { return Value((static_cast<const S&>(s).*member).get(Permit::owner())); },
                       nullptr, nullptr,
                       [member](Service& s, const std::string& text, const PrincipalPointer& author) {
                           static_cast<S&>(s).*member = Named<kind>(text, author);
                       }});
    }
    template <class S>
    Class& choice(std::string name, std::string S::*member, std::vector<std::string> choices, Spec spec = {}) {
        bind<std::string>(std::move(name), Type::choice, member, std::move(spec));
        options_.back().choices = std::move(choices);
        return *this;
    }
    template <class S> Class& vector(std::string name, std::vector<double> S::*member, Spec spec = {}) {
        return bind<std::vector<double>>(std::move(name), Type::vector, member, std::move(spec));
    }
    // Options. name: with the dash; member: of the service class S, where the value is stored.
    // A sub-service: the value is its name, the member a reference to it. The empty name means none.
    template <class S> Class& service(std::string name, Reference S::*member, Spec spec = {});
    Class& option(Option option);                   // any other storage

    template <class S>
    Class& action(std::string name, void (S::*body)(Args, Message&), std::string usage, std::string help,
                  int minArgs = 0, int maxArgs = 0, Right right = Right::configure) {
        return action({std::move(name), std::move(usage), std::move(help), minArgs, maxArgs,
                       [body](Service& s, Args args, Message& reply) { (static_cast<S&>(s).*body)(args, reply); }, right});
    }
    // All its arguments name files, folders, segments or programs: their kinds come from the body, which gets the names only
    // for a permit (bus/named.h).   least: so many must be given; a Named is empty for others.
    template <class S, Kind... kinds>
        requires(sizeof...(kinds) > 0)
    Class& action(std::string name, void (S::*body)(Message&, const Named<kinds>&...), std::string usage, std::string help,
                  int least = sizeof...(kinds), Right right = Right::configure, bool whileTicking = false) {
        auto run = [body](Service& s, Args args, Message& reply) {
            std::size_t at = 0;
            auto next = [&] { return at < args.size() ? args[at++] : std::string(); };
            std::tuple<Named<kinds>...> all{Named<kinds>(next(), reply.author)...};         // in braces: from left to right
            std::apply([&](auto&... named) { (static_cast<S&>(s).*body)(reply, named...); }, all);
        };
        return action({std::move(name), std::move(usage), std::move(help), least, int(sizeof...(kinds)), Body::untyped(run, {kinds...}), right,
                       whileTicking});
    }
    Class& action(Action action);                   // of CTRL
    Class& inspection(Action action, Right right = Right::inspect);     // of DBX
    Class& danger(Danger danger);                   // of the action or inspection that was declared last
    // EXEC does this; with words, such as "power off": only an EXEC that begins with one of them; the first that fits decides.
    Class& execDanger(Danger danger, std::vector<std::string> words = {});
    // The class promises: to execute such a request twice does what once does. So sorma::retry may send it again when it has
    // perhaps run. words: first words of EXEC, and names of declared actions; none: every EXEC. A request that moves,
    // powers or fires something is never sent again.
    Class& repeatable(std::vector<std::string> words = {});
    // execRight: EXEC needs this right instead of Right::call. actsOnWords: the words of EXEC name other objects, files or
    // programs. Then exec finds their author in the message, and checks the author's rights.
    Class& execRight(Right right);
    Class& actsOnWords();

    // EXEC signature. Declare all of it or nothing (reads, writes, words). With the first declaration, parts and words that are
    // not declared are refused before EXEC runs, and so is another length. A reply with code 0 may omit a declared part;
    // another length is an error (SERVICE FAILED). A class that declares nothing accepts everything. All this is for
    // requests by name. By Reference only the lengths of declared parts are checked. So clear() a message that you use
    // again, if the object may be in another process: parts that are left from the call before would be sent, too.
    Class& reads(Field field, Count count, std::string unit, std::string help, double low = -kInfinity,
                 double high = kInfinity);
    Class& writes(Field field, Count count, std::string unit, std::string help);
    Class& words(std::string usage);                // words that EXEC takes: "?nearestTo|latest?"
    // An EXEC of two words, of which the second names a file, folder, segment or program. Its kind comes from the body, which
    // gets the name only for a permit. exec calls it by Service::execWord.
    template <class S, Kind kind> Class& word(std::string verb, void (S::*body)(Message&, const Named<kind>&)) {
        return word({std::move(verb), 1, kind, [body](Service& s, Message& m) { (static_cast<S&>(s).*body)(m, Named<kind>(m.words[1], m.author)); }});
    }
    // For a language without types: the word comes as text, when its author's right has been asked.   verb: the first word of
    // such requests, "" for all; at: its place, from 0.
    Class& untypedWord(std::string verb, std::size_t at, Kind kind) { return word({std::move(verb), at, kind}); }
    Class& example(std::string request);            // printed by -help, run by the tests
    Class& version(std::string version);
    Class& concurrency(Concurrency concurrency);                // default: serial
    Class& flavors(Flavors flavors);
    // An object that does not pass its self-test is not made. It has so long for it [s].
    Class& testedAtBirth(double seconds = 10);
    // The class promises: EXEC without words does not allocate, lock, wait or use the SORM, but for its first calls. So the
    // object may be a step of a cycle.
    Class& realtime();
    // The class promises two things. The output of EXEC depends only on earlier requests, not on the floats of this one.
    // Without floats EXEC writes its next output and changes nothing. So the object may close a loop of a circuit.
    Class& withoutFeedthrough();
    Class& declaredAt(std::string file, int line);  // place of the declaration, for classes in other languages

    Concurrency concurrency() const { return concurrency_; }
    Flavors flavors() const { return flavors_; }
    bool isRealtime() const { return realtime_; }
    double testedAtBirth() const { return testedAtBirth_; }         // [s]; 0: it is not
    Right execRight() const { return execRight_; }
    // Why a request may not be sent again; empty: it may.
    std::string whyNotRepeatable(const Message& m, Method method) const;
    std::string repeatableText() const;                 // for people: "EXEC latest, CTRL -home"; empty: nothing is declared
    std::vector<std::string> repeatables() const;       // words as above; an empty one: every EXEC
    bool doesActOnWords() const { return actsOnWords_; }
    // Does this EXEC need Right::operate? The second: does any?
    bool isDangerous(const Message& m) const;
    bool isDangerous() const;
    // {word danger ...} of all words of EXEC (an empty word: every EXEC), CTRL and DBX that declare one, options too.
    std::vector<std::string> dangers() const;
    struct Word {
        std::string verb;
        std::size_t at;
        Kind kind;
        std::function<void(Service&, Message&)> body = nullptr;
    };
    const std::vector<Word>& wordKinds() const { return wordKinds_; }
    bool hasFeedthrough() const { return feedthrough_; }
    const std::string& name() const { return name_; }
    const std::string& purpose() const { return purpose_; }
    const std::vector<Option>& options() const { return options_; }
    const std::vector<Action>& actions() const { return actions_; }
    const std::vector<Action>& inspections() const { return inspections_; }
    const std::vector<Part>& reads() const { return reads_; }
    const std::vector<Part>& writes() const { return writes_; }
    const std::string& words() const { return words_; }
    const std::string& example() const { return example_; }
    const std::string& version() const { return version_; }
    const std::string& file() const { return file_; }
    int line() const { return line_; }

    int findOption(std::string_view name) const;    // index, or -1; abbreviations are not accepted
    const Action* findAction(std::string_view name) const;          // null: there is none
    const Action* findInspection(std::string_view name) const;
    // Does CTRL or DBX of its objects take this word: an option or action, or an inspection? It counts those that every class has.
    bool takes(Method method, std::string_view word) const;
    std::unique_ptr<Service> make() const { return make_(); }

    // The default of each option: the values of the first object of the class after its construction.
    const std::vector<Value>& defaults() const { return defaults_; }
    void learnDefaults(const Service& fresh) const;

    // The checks of Service: a sum of these.
    enum Check : std::uint8_t { lengths = 1, undeclared = 2, replies = 4 };
    std::uint8_t checks() const { return checks_; }
    void checkRequest(std::string_view object, const Message& m) const;     // lengths and ranges; fails with REQUEST SIGNATURE, RANGE
    // The same for a request by name; it refuses parts and words that are not declared, too.
    void checkNamed(std::string_view object, const Message& m) const {
        if (!takes(m)) [[unlikely]] refuse(object, m);
        if (ranged_) checkRequest(object, m);
    }
    void dropUndeclared(Message& m) const;
    // A number for the table. Classes of two processes with the same number refuse the same words and arguments in the same words: see
    // bus/ahead.h.
    std::uint64_t fingerprint() const;
    void checkReply(std::string_view object, const Message& m) const;       // fails with SERVICE FAILED

    std::string helpText(std::string_view object, bool expert = false) const;     // expert: with expert options
    std::string signatureText() const;

private:
    template <class V, class S, class M> Class& bind(std::string name, Type type, M S::*member, Spec spec) {
        if (carriesRight(spec.kind)) refuseKind(name);
        return option({std::move(name), type, std::move(spec), {},
                       [member](const Service& s) { return Value(V(static_cast<const S&>(s).*member)); },
                       [member](Service& s, const Value& v) { static_cast<S&>(s).*member = M(std::get<V>(v)); }});
    }

    // Does each part have a length that is declared? One comparison for each part: lengths below the range wrap around.
    bool takes(const Message& m) const {
        auto within = [this](std::size_t n, Field f) {
            const Count& c = takes_[std::size_t(f)];
            return n - c.low <= c.high - c.low;
        };
        return within(m.text.size(), Field::text) && within(m.floats.size(), Field::floats) &&
               within(m.ints.size(), Field::ints) && within(m.any.size(), Field::any) && (takesWords_ || m.words.empty());
    }
    [[noreturn]] void refuse(std::string_view object, const Message& m) const;
    [[noreturn]] void refuseKind(const std::string& option) const;      // the member gives its text to everybody
    Class& word(Word word);
    void declared();

    std::string name_, purpose_, words_, example_, version_ = "1.0", file_;
    int line_;
    std::function<std::unique_ptr<Service>()> make_;
    std::vector<Option> options_;
    std::vector<Action> actions_, inspections_;
    std::vector<Part> reads_, writes_;
    mutable std::vector<Value> defaults_;
    mutable std::uint64_t fingerprint_ = 0;         // 0: not asked for yet
    std::vector<Word> wordKinds_;
    std::uint8_t checks_ = 0;               // sum of Check
    std::array<Count, 4> takes_{};          // by Field: lengths that some part allows; without a signature: all
    bool takesWords_ = true, ranged_ = false;
    double testedAtBirth_ = 0;
    bool realtime_ = false, feedthrough_ = true, actsOnWords_ = false;
    Right execRight_ = Right::call;
    std::vector<std::string> execRepeatables_;      // words; an empty one: every EXEC
    std::vector<std::pair<std::string, Danger>> execDangers_;   // by word; empty word: every EXEC
    bool lastIsInspection_ = false;         // what was declared last, for danger()
    Concurrency concurrency_ = Concurrency::serial;
    Flavors flavors_ = Flavors::unsaid;
};

}  // namespace sorma
