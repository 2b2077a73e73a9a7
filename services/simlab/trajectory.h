// trajectory.h -- the position of the ball on its stick, as a function of time.
//
//     still  x y z
//     line   x y z  x y z  v          from the first point to the second and back, at v [m/s]
//     circle x y z  r T               around a point, level, one round in T [s]
//     sine   x y z  ax ay az  f       amplitudes [m], frequency [Hz]
//     jerk   x y z  x y z  T          to the second point in T [s] and back, each way four pieces of constant jerk
//     file   name                     lines "t x y z", t [s] growing; straight in between, and again from the beginning
#pragma once

#include <array>
#include <stdexcept>
#include <string>
#include <vector>

namespace simlab {

using Point = std::array<double, 3>;

class Trajectory {
public:
    explicit Trajectory(const Point& at = {0.6, 0.6, 0.3}) : kind_("still"), numbers_(at.begin(), at.end()) {}
    // Fails with a std::invalid_argument that says what is expected.
    static Trajectory parse(const std::vector<std::string>& words);
    static Trajectory ofFile(const std::string& name);
    Point at(double t) const;           // t: since it began
    const std::string& text() const { return text_; }

private:
    std::string kind_, text_ = "still 0.6 0.6 0.3";
    std::vector<double> numbers_;       // of a file: rows of four
};

// A finite number from a word. Fails with a std::invalid_argument.
double toNumber(const std::string& word, const char* what);

}  // namespace simlab
