// pin.h -- where the wires of a circuit end: named parts of the floats that EXEC reads and writes.
//
// Every object whose EXEC signature has floats has the pins `in` and `out`; a class may name parts of them. Pins are
// found by Service::pins here, and by DBX -pins at a distance: a line for each, "name in|out at length unit help".
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
    std::size_t at = 0;             // where it begins in the floats that are read, or written
    std::size_t length = kOpen;     // elements; kOpen: not known before something is wired to it
    std::string unit = {}, help = {};

    std::string toText() const;     // the line of DBX -pins
    static std::vector<Pin> fromText(std::string_view lines);   // fails with REQUEST SYNTAX
};

}  // namespace sorma
