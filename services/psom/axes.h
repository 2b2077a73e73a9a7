// axes.h -- reads and checks the axes of a map.
#pragma once

#include <string>
#include <vector>

namespace psom {

constexpr std::size_t kMostDimension = 1000, kMostNumbers = 4'000'000;      // of a vector; of all vectors together

// "{-1 0 1} {chebyshev 4 2 8} {equidistant 5 0 1}": nodes, or how to place so many of them in a range.
// Fails with OPTION VALUE, naming the object.
std::vector<std::vector<double>> parseAxes(const std::string& object, const std::string& text);

// The error in the axes; empty: none.
std::string checkAxes(const std::vector<std::vector<double>>& axes, std::size_t dimension);

}  // namespace psom
