// mapFile.h -- a map in a file: text that people can read, with a version.
//
//     sorma-psom 1
//     dimension 2
//     axis 0 0.5 1            one line an axis: its nodes
//     node 1 0.25             one line a node, in row-major order: its vector
//     end
//
// Errors: PSOM FILE, naming file, line, and what was expected there.
#pragma once

#include <memory>
#include <string>

#include "psom.h"

namespace psom {

// object: the name for messages.
std::shared_ptr<Map> load(const std::string& object, const std::string& file);
// Writes the whole file, or leaves the file that was there.
void save(const std::string& object, const std::string& file, const Map& map);

}  // namespace psom
