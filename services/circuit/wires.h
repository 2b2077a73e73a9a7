// wires.h -- reads the wires of a circuit from text.
//
//     wires   = wire? ((";" | newline) wire?)*        # after white space: a comment to the end of the line
//     wire    = source "->" sink                                  (white space around the arrow)
//     source  = end | number (white-space number)*                numbers: constants, one for each element
//     sink    = end
//     end     = (object ".")? pin ("[" first (":" last)? "]")?     without object: a pin of the circuit's own
//     object  = a name as everywhere: gain.k, shmem_r.pos@robot.lab:7014
//     pin     = (letter | "_") (letter | digit | "_" | "-")*
//
// An end is read backwards, since names may contain dots. Elements count from 0; a slice includes its last one.
//
// The circuit's own pins may be declared; that gives them an order, a length and a unit of measurement:
//
//     pins    = pin ((";" | newline) pin)*
//     pin     = name length? unit?
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace circuit {

inline constexpr std::size_t kMaxElements = 1'000'000;      // of a pin, and of all that a unit reads or writes
inline constexpr std::size_t kMaxFloats = 10'000'000;       // of all units

struct End {
    std::string object;             // empty: the circuit itself
    std::string pin;                // empty: constants
    bool whole = true;              // no slice
    std::size_t first = 0, last = 0;
    std::vector<double> constants;

    bool constant() const { return pin.empty(); }
    std::string pinText() const { return object.empty() ? pin : object + "." + pin; }
    std::string toText() const;     // as it would be written
};

// "gain.k.in[0:2]"; one element: "gain.k.in[1]".
std::string sliceText(const std::string& pin, std::size_t first, std::size_t length);

struct Wire {
    End source, sink;
    std::size_t number = 0;         // from 1
    std::string text;               // as written
};

struct OwnPin {
    std::string name;
    std::size_t length = 0;         // 0: as the wires say
    std::string unit;
};

// owner: the circuit's name, for messages. Both fail with CIRCUIT SYNTAX.
std::vector<Wire> parseWires(std::string_view owner, std::string_view text);
std::vector<OwnPin> parsePins(std::string_view owner, std::string_view option, std::string_view text);

}  // namespace circuit
