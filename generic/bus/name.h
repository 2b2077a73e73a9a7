// name.h -- names and addresses: who is meant, and where it is served.
//
//     class.flavor                     here
//     class.flavor@host:7014           daemon on a TCP port
//     class.flavor@host:0x14           daemon registered with that host's rpcbind as program 0x20000000 + 0x14
//     class.flavor@/run/robot.sock     daemon on a Unix-domain socket
//     class.flavor@alias               the dictionary's entry @alias says where, else a daemon of this user
//     CLASS.flavor                     the dictionary's entry CLASS says where
//
// A class is a letter, then letters, digits and _, all in one case. A flavor holds any character except white space,
// control characters, @ and Tcl's special ones: [ ] { } $ " \ ;   Host and alias: letters, digits, _ - and dots; an
// IPv6 host stands in brackets, foo@[::1]:7014 (in Tcl such a name must be quoted). A path begins with /.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace sorma {

class Dictionary;

struct Address {
    enum class Kind { self, tcp, program, path, alias };
    Kind kind = Kind::self;
    std::string host;           // tcp, program: host name;  path: of a Unix-domain socket;  alias: the alias
    std::uint32_t number = 0;   // tcp: port;  program: offset from 0x20000000
    bool wait = false;          // calls wait for the daemon when nothing listens there: `@robot localhost:7014 -wait`

    std::string toText() const;                         // as written after @; "self" for self
    static Address parse(std::string_view text);        // what stands after @; fails with NAME SYNTAX
    bool operator==(const Address&) const = default;
};

struct Name {
    std::string service;        // as the serving process names it: "class.flavor", class in lower case
    std::string className;      // lower case
    std::string flavor;         // without the dot; may be empty
    std::string where;          // text after @, empty when none
    bool byDefault = false;     // class was written in upper case

    bool local() const { return where.empty() && !byDefault; }
    // What says where it is: "@robot", "@localhost:7014" as written after the name; "CARRY", the entry that is the class's
    // default location; empty when it is here.
    std::string location() const;
    // The dictionary's entry that holds its recipe here: as the name was written. Empty for a class in upper case alone: that
    // entry is the address of all its flavors, and no recipe of one of them.
    std::string recipeKey() const;
    std::string toText() const; // as it was written: service, service@where, or CLASS.flavor

    // Fails with NAME SYNTAX, saying which character and where (counted from 1).
    static Name parse(std::string_view text);
    // Same rule, no error: cheap test whether a word can be a name at all.
    static bool isName(std::string_view text);
    // Would a text, if it is a name, mean an object at some location (with @, or a class in upper case)? A look at the
    // characters, for those who serve nothing but local names.
    static bool isElsewhere(std::string_view text);
    // Is a word of the dictionary a location, @alias or CLASS, rather than a recipe?
    static bool isLocation(std::string_view word);
};

// Follow aliases and default locations through the dictionary: the first word of an entry is an address, with or
// without @ before it (`@robot localhost:7014`, `@arm @robot`, `CARRY robot`, `@vision self`). Returns kind self, tcp, program or path; kind alias
// when the alias has no entry (then it is looked for in the runtime directory).
// rule: becomes the last location on that way, which alone decides where a connection leads that is made anew: of CARRY
// it is "@robot" when the entry CARRY says robot. Names with one rule and one address share a connection.
// Fails with ADDRESS UNRESOLVED: a default location without an entry, an entry that holds no address; with DICT LOOP:
// aliases that lead in a circle, named as a chain.
Address resolve(const Name& name, const Dictionary& dictionary, std::string* rule = nullptr);

}  // namespace sorma
