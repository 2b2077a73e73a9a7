// pin.h -- the ends of a circuit's wires: named parts of the floats that EXEC reads and writes.
//
// Every object whose EXEC signature has floats has the pins `in` and `out`. A class may name parts of them. Service::pins
// lists the pins of an object; DBX -pins does the same for one in another process, with a line for each: "name in|out at
// length unit help".
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace sorma {

struct Pin {
    static constexpr std::size_t kOpen = SIZE_MAX;

    std::string name;
    bool input = true;
    std::size_t at = 0;             // index of its first element in the floats that are read, or written
    std::size_t length = kOpen;     // elements; kOpen: known only when something is wired to it
    std::string unit = {}, help = {};

    std::string toText() const;     // the line of DBX -pins
    static std::vector<Pin> fromText(std::string_view lines);   // fails with REQUEST SYNTAX
};

}  // namespace sorma
