// option.h -- how a service class describes itself: options, actions, EXEC signature, example.
//
// A class declares one table; everything else follows from it: CTRL parsing, range checks, -help, -dump,
// configure/cget, completion, panels, manual pages. Nobody writes any of these by hand.
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
// The default of an option is what its member holds when the object has been constructed.
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
#include <vector>

#include "bus/access.h"
#include "bus/message.h"
#include "bus/reference.h"
#include "bus/where.h"

namespace sorma {

class Service;

// Value of an option: flag, int, double, string (also enum and service name), vector.
using Value = std::variant<bool, std::int64_t, double, std::string, std::vector<double>>;
std::string toText(const Value& value);         // as CTRL would read it again; a vector: numbers separated by spaces

enum class Type : std::uint8_t { flag, integer, real, text, choice, vector, service };
const char* toText(Type type);                  // "flag" "int" "double" "string" "enum" "vector" "service"
bool fromText(std::string_view text, Type& out);

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Outside of these a value is allowed, and people are warned.
struct Limits {
    double low = -kInfinity, high = kInfinity;
};

// What the text or number of an option stands for: name of a file (string), colour such as #ff8000 (string), s since 1970 (int, double).
enum class Kind : std::uint8_t { plain, file, colour, time };
const char* toText(Kind kind);                  // "" "file" "colour" "time"
bool fromText(std::string_view text, Kind& out);

// What most options leave at its default. Values outside low .. high are refused, and NaN where there is a range.
struct Spec {
    std::string unit = {};
    double low = -kInfinity, high = kInfinity;      // int, double, each element of a vector
    std::string help = {};
    bool fixed = false;                             // only a recipe may set it: refused after birth (OPTION READONLY)
    std::size_t minLength = 0, maxLength = SIZE_MAX;    // vector: number of elements
    // Only for those who look at it: panels, help.
    Limits warn = {}, alarm = {};                   // int, double, each element of a vector
    Kind kind = Kind::plain;
    std::vector<std::string> names = {};            // vector: of its elements
    std::string group = {};                         // options of one group stand together
    bool expert = false;                            // help and panels do not show it until somebody asks
};

struct Option {
    std::string name;               // with the dash: "-transferSpeed"
    Type type = Type::text;
    Spec spec;
    std::vector<std::string> choices;                   // enum
    std::function<Value(const Service&)> get;
    std::function<void(Service&, const Value&)> set;    // value is checked already; may throw
    // service: instead of set. The object has been found, with the rights of whoever named it; null: none.
    std::function<void(Service&, Reference)> refer = nullptr;

    std::string range() const;      // for people and panels: "0.01 .. 1.5", "largo adagio ...", "" when anything goes
    // A dict of what is said for those who look at it: warn and alarm {low high} (an open end is empty), kind, names, group, expert.
    std::string hints() const;
    std::string limitsText() const;     // "warning outside 10 .. 60, alarm above 90"
    std::string misfit() const;         // what of that does not go with the type; empty: nothing
    // Read and check a value. Fails with OPTION VALUE or OPTION RANGE, naming object, option, value and rule.
    Value parse(std::string_view object, std::string_view text) const;
    void check(std::string_view object, const Value& value, std::string_view given) const;
};

using Args = std::span<const std::string>;

// A word of CTRL or DBX that does something. It runs after all option words of its request have been accepted.
struct Action {
    static constexpr int kRest = -1;
    std::string name;               // "-stop"
    std::string usage;              // names of its arguments, as in a man page: "name ?word ...?"
    std::string help;
    int minArgs = 0, maxArgs = 0;   // kRest: all words that follow
    // Appends to reply.text. reply.author wrote the arguments: one that names something else than this object asks for more
    // rights than the one below.
    std::function<void(Service&, Args, Message& reply)> body;
    Right right = Right::configure;     // to ask of whoever wrote the request; what stops a motion asks for Right::call only
    // Of an object that is executed in ticks: it is called while they go on, and says itself where it must be BetweenTicks. Others
    // are called between two ticks, and so must be short.
    bool whileTicking = false;
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

struct Part {
    Field field;
    Count count;                    // elements; characters of text; bytes of any
    std::string unit, help;
    double low = -kInfinity, high = kInfinity;      // floats: refused outside; NaN is refused where there is a range
};

// What becomes of requests for EXEC that come while another one takes its time (Service::later). CTRL and DBX never wait.
enum class Conduct : std::uint8_t {
    serial,             // one after another, in the order in which they came
    concurrent,         // as they come: the service keeps them apart
    exclusive,          // serial, and a client may lock the object with CTRL -lock
};

class Class {
public:
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
    template <class S>
    Class& choice(std::string name, std::string S::*member, std::vector<std::string> choices, Spec spec = {}) {
        bind<std::string>(std::move(name), Type::choice, member, std::move(spec));
        options_.back().choices = std::move(choices);
        return *this;
    }
    template <class S> Class& vector(std::string name, std::vector<double> S::*member, Spec spec = {}) {
        return bind<std::vector<double>>(std::move(name), Type::vector, member, std::move(spec));
    }
    // A sub-service: the option's value is its name; the member is a reference to it. The empty name is none.
    template <class S> Class& service(std::string name, Reference S::*member, Spec spec = {});
    Class& option(Option option);                   // any other storage

    template <class S>
    Class& action(std::string name, void (S::*body)(Args, Message&), std::string usage, std::string help,
                  int minArgs = 0, int maxArgs = 0, Right right = Right::configure) {
        return action({std::move(name), std::move(usage), std::move(help), minArgs, maxArgs,
                       [body](Service& s, Args args, Message& reply) { (static_cast<S&>(s).*body)(args, reply); }, right});
    }
    Class& action(Action action);                   // of CTRL
    Class& inspection(Action action, Right right = Right::inspect);     // of DBX
    // EXEC asks for another right than to call. actsOnWords: its words name what is done, by whom, or with what, so that it
    // finds their author in the message and must ask for him.
    Class& execRight(Right right);
    Class& actsOnWords();

    // EXEC signature. A class that declares any of it (reads, writes, words) has declared all: of a request by name, a part
    // or word that is not declared is refused before EXEC runs, and so is a declared part of another length. A reply with
    // code 0 may leave a declared part out; another length is an error. A class that declares nothing takes what comes.
    // By reference only the lengths of what is declared are checked, and nobody looks at what is left in a message from the
    // call before: clear() one that is used again, if the object may be in another process.
    Class& reads(Field field, Count count, std::string unit, std::string help, double low = -kInfinity,
                 double high = kInfinity);
    Class& writes(Field field, Count count, std::string unit, std::string help);
    Class& words(std::string usage);                // words that EXEC takes: "?nearestTo|latest?"
    Class& example(std::string request);            // printed by -help, run by the tests
    Class& version(std::string version);
    Class& conduct(Conduct conduct);                // serial unless said otherwise
    // Once warmed up, EXEC without words neither allocates, locks, waits nor touches the SORM: it may be a step of a cycle.
    Class& realtime();
    // What EXEC writes depends on earlier requests alone, not on the floats of this one; and without floats it writes what it
    // will write next, and changes nothing. Such a unit may close a loop of a circuit.
    Class& withoutFeedthrough();
    Class& declaredAt(std::string file, int line);  // where, when it is not the place of the constructor: other languages

    Conduct conduct() const { return conduct_; }
    bool isRealtime() const { return realtime_; }
    Right execRight() const { return execRight_; }
    bool doesActOnWords() const { return actsOnWords_; }
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

    int findOption(std::string_view name) const;    // index, or -1; unique abbreviations are not accepted
    const Action* findAction(std::string_view name) const;
    const Action* findInspection(std::string_view name) const;
    std::unique_ptr<Service> make() const { return make_(); }

    // The default of each option: what the first object of the class held when constructed.
    const std::vector<Value>& defaults() const { return defaults_; }
    void learnDefaults(const Service& fresh) const;

    // What there is to check, as Service keeps it.
    enum Check : std::uint8_t { lengths = 1, undeclared = 2, replies = 4 };
    std::uint8_t checks() const { return checks_; }
    void checkRequest(std::string_view object, const Message& m) const;     // its lengths; fails with REQUEST SIGNATURE, RANGE
    // The same for a request by name, also what is not declared.
    void checkNamed(std::string_view object, const Message& m) const {
        if (!takes(m)) [[unlikely]] refuse(object, m);
        if (ranged_) checkRequest(object, m);
    }
    void dropUndeclared(Message& m) const;
    void checkReply(std::string_view object, const Message& m) const;       // fails with SERVICE FAILED

    std::string helpText(std::string_view object, bool expert = false) const;     // expert: those options, too
    std::string signatureText() const;

private:
    template <class V, class S, class M> Class& bind(std::string name, Type type, M S::*member, Spec spec) {
        return option({std::move(name), type, std::move(spec), {},
                       [member](const Service& s) { return Value(V(static_cast<const S&>(s).*member)); },
                       [member](Service& s, const Value& v) { static_cast<S&>(s).*member = M(std::get<V>(v)); }});
    }

    // Does each part have a length that is declared? One comparison for each: lengths below the range wrap around.
    bool takes(const Message& m) const {
        auto within = [this](std::size_t n, Field f) {
            const Count& c = takes_[std::size_t(f)];
            return n - c.low <= c.high - c.low;
        };
        return within(m.text.size(), Field::text) && within(m.floats.size(), Field::floats) &&
               within(m.ints.size(), Field::ints) && within(m.any.size(), Field::any) && (takesWords_ || m.words.empty());
    }
    [[noreturn]] void refuse(std::string_view object, const Message& m) const;
    void declared();

    std::string name_, purpose_, words_, example_, version_ = "1.0", file_;
    int line_;
    std::function<std::unique_ptr<Service>()> make_;
    std::vector<Option> options_;
    std::vector<Action> actions_, inspections_;
    std::vector<Part> reads_, writes_;
    mutable std::vector<Value> defaults_;
    std::uint8_t checks_ = 0;               // of Check
    std::array<Count, 4> takes_{};          // by Field: lengths that some part allows; without any signature: all
    bool takesWords_ = true, ranged_ = false;
    bool realtime_ = false, feedthrough_ = true, actsOnWords_ = false;
    Right execRight_ = Right::call;
    Conduct conduct_ = Conduct::serial;
};

}  // namespace sorma
