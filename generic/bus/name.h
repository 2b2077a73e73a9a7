// name.h -- names of objects, and addresses of the processes that serve them.
//
//     class.flavor                     here
//     class.flavor@host:7014           daemon on a TCP port
//     class.flavor@host:0x14           daemon registered with that host's rpcbind as program 0x20000000 + 0x14
//     class.flavor@/run/robot.sock     daemon on a Unix-domain socket
//     class.flavor@alias               the dictionary's entry @alias says where, else a daemon of this user
//     CLASS.flavor                     the dictionary's entry CLASS says where
//
// A class is a letter, then letters, digits and _, all in one case. A flavor holds any character except white space,
// control characters, @ and Tcl's special ones: [ ] { } $ " \ ;   Dots divide a flavor into parts, and no part is empty. Host and
// alias: letters, digits, _ - and dots; an IPv6 host stands in brackets, foo@[::1]:7014 (in Tcl such a name must be quoted).
// A path begins with /.
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
    // In clear, or with TLS: `@robot cell:7014 -tls yes`. unsaid: with TLS, if this user has keys or the daemon has spoken it before.
    enum class Tls : std::uint8_t { unsaid, yes, no, tries } tls = Tls::unsaid;
    std::string as = {};        // tcp, program: the name in its certificate: the last alias that led here, else the host

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
    // The word that says where it is; empty when it is here. "@robot" or "@localhost:7014" is written after the name. The word "CARRY" is
    // the dictionary's entry for the default location of the class.
    std::string location() const;
    // The dictionary's entry with its recipe here: the name as it was written. Empty for a class in upper case without a
    // flavor: that entry is the address of all its flavors, and no recipe.
    std::string recipeKey() const;
    std::string toText() const; // as it was written: service, service@where, or CLASS.flavor

    // Fails with NAME SYNTAX; the message says which character, and where (counted from 1).
    static Name parse(std::string_view text);
    // Would parse accept it? Cheap, and never fails.
    static bool isName(std::string_view text);
    // Does a name mean an object at some location (with @, or a class in upper case)? Looks at the characters only; the text
    // need not be a name.
    static bool isElsewhere(std::string_view text);
    // Is a word of the dictionary a location (@alias or CLASS)? Else it is a recipe.
    static bool isLocation(std::string_view word);
};

// The location of a name: its text after @, or that in the dictionary's entry for a class in upper case. Empty when there is none.
std::string whereOf(const Name& name, const Dictionary& dictionary);

// Find the address of a name: follow aliases and default locations through the dictionary. The first word of an entry is an
// address, with or without @ before it (`@robot localhost:7014`, `@arm @robot`, `CARRY robot`, `@vision self`). Returns kind
// self, tcp, program or path. An alias without an entry has kind alias: then its socket is in the runtime folder.
// rule: becomes the last entry that was followed. A reconnect follows only that one. For CARRY it is "@robot" when the entry
// CARRY says robot. Names with the same rule and the same address share a connection. Fails with ADDRESS UNRESOLVED when a
// default location has no entry, or an entry has no address. It fails with DICT LOOP when aliases lead in a circle; the message shows
// the chain.
Address resolve(const Name& name, const Dictionary& dictionary, std::string* rule = nullptr);

}  // namespace sorma
