// catalogue.h -- errors, warnings and verbose messages: declared once, raised in one line.
//
//     const Prototype kRange{Severity::error, "OPTION RANGE", 2, "{}: {} {} is outside {} .. {} {}"};
//     fail(kRange, object, option.name, given, low, high, unit);   // -errorcode {SORMA OPTION RANGE object option}
//     message.warn(kDusty, 0.4);                                   // an entry in the trail, the call goes on
//
// A prototype has static storage. It adds itself to the catalogue that `sorma::catalogue` lists, and removes itself when its
// library is unloaded. The text is a format of {fmt}. It comes from code, never from a peer.
//
// Threads: any. The catalogue has a lock; it is taken when libraries are loaded and unloaded, and by catalogue().
#pragma once

#include <cstdint>
#include <exception>
#include <initializer_list>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "bus/trail.h"
#include "bus/where.h"

namespace sorma {

class Prototype {
public:
    // symbol:  area and symbol, "OPTION RANGE". Choose it by what the caller can do next.
    // details: so many arguments, from the first on, become part of the error code.
    Prototype(Severity severity, const char* symbol, int details, const char* text,
              Where where = Where::current());
    ~Prototype();
    Prototype(const Prototype&) = delete;
    Prototype& operator=(const Prototype&) = delete;

    const Severity severity;
    const char* const symbol;
    const int details;
    const char* const text;
    const char* const file;     // where it is declared
    const int line;

private:
    friend std::vector<const Prototype*> catalogue();
    // Links of the list of all prototypes: no memory of its own, so it works before main and while libraries unload.
    Prototype* next_ = nullptr;
    Prototype* previous_ = nullptr;
};

// All prototypes of the process, ordered by symbol.
std::vector<const Prototype*> catalogue();

// An argument of a message: a text, which must outlive it, or a number, which is written in its shortest form.
struct MessageArg {
    enum class Kind { text, real, integer } kind;
    std::string_view text;
    double real = 0;
    std::int64_t integer = 0;

    template <class T> static MessageArg of(const T& value) {
        if constexpr (std::is_same_v<T, bool>) return {Kind::text, value ? "true" : "false"};
        else if constexpr (std::is_floating_point_v<T>) return {Kind::real, {}, static_cast<double>(value)};
        else if constexpr (std::is_integral_v<T>) return {Kind::integer, {}, 0, static_cast<std::int64_t>(value)};
        else return {Kind::text, std::string_view(value)};
    }
};

// A prototype together with the place that raises it.
struct Raised {
    const Prototype& prototype;
    Where where;
    Raised(const Prototype& p, Where at = Where::current()) : prototype(p), where(at) {}
};

// An entry for a trail, made of a prototype and its arguments, with place and time.
Entry makeEntry(const Raised& raised, std::initializer_list<MessageArg> args);

// The exception of SORMA: a trail whose cause() is the error.
class Error : public std::exception {
public:
    explicit Error(Entry entry) : trail(std::move(entry)) {}
    explicit Error(Trail t) : trail(std::move(t)) {}
    const char* what() const noexcept override;     // text of the cause
    // The words after SORMA of the error code: {"OPTION", "RANGE", "carry.slow", "-transferSpeed"}; all words of a code that
    // a class in Tcl has made of its own.
    std::vector<std::string> code() const;
    bool is(std::string_view symbol) const;    // e.g. is("COMM TIMEOUT")

    Trail trail;
};

// Throw an Error of one entry. It knows the file and line of the call.
template <class... Args> [[noreturn]] void fail(Raised raised, const Args&... args) {
    throw Error(makeEntry(raised, {MessageArg::of(args)...}));
}

// The exception that is being handled as a trail: Error, std::exception or anything else. Call it inside a catch block.
// so: name of the service object, for entries that have none.
Trail trailOfCurrentException(std::string_view so);

}  // namespace sorma
