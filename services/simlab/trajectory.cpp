#include "trajectory.h"

#include <charconv>
#include <cmath>
#include <fstream>
#include <sstream>

namespace simlab {

namespace {

struct Kind { const char *name, *usage; std::size_t numbers; };
constexpr Kind kKinds[] = {{"still", "x y z", 3}, {"line", "x y z x y z speed", 7}, {"circle", "x y z radius period", 5},
                           {"sine", "x y z ax ay az frequency", 7}, {"jerk", "x y z x y z time", 7}};
constexpr double kFar = 5;              // [m]

// From 0 to 1 in a time 1: jerk j, -j, -j, j.
double jerked(double u) {
    if (u > 0.5) return 1 - jerked(1 - u);
    constexpr double j = 32, h = 0.25;
    if (u <= h) return j * u * u * u / 6;
    const double w = u - h;
    return j * (h * h * h / 6 + h * h / 2 * w + h * w * w / 2 - w * w * w / 6);
}

// 0 to 1 and back, in 2.
double toAndFro(double u) {
    u = std::fmod(u, 2);
    return u > 1 ? 2 - u : u;
}

}  // namespace

double toNumber(const std::string& word, const char* what) {
    double x = 0;
    auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), x);
    if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(x))
        throw std::invalid_argument("\"" + word + "\" must be a number: " + what);
    return x;
}

Trajectory Trajectory::parse(const std::vector<std::string>& words) {
    for (auto& kind : kKinds) {
        if (words.empty() || words[0] != kind.name) continue;
        if (words.size() != kind.numbers + 1)
            throw std::invalid_argument(std::string(kind.name) + " takes " + kind.usage + ", not " +
                                        std::to_string(words.size() - 1) + " numbers");
        Trajectory p;
        p.kind_ = kind.name;
        p.numbers_.clear();
        p.text_ = kind.name;
        for (std::size_t i = 1; i < words.size(); ++i) {
            p.numbers_.push_back(toNumber(words[i], kind.usage));
            if (std::fabs(p.numbers_.back()) > kFar)
                throw std::invalid_argument(words[i] + " is outside -5 .. 5: " + kind.usage);
            p.text_ += " " + words[i];
        }
        const double last = p.numbers_.back();
        if (kind.numbers > 3 && last <= 0)
            throw std::invalid_argument(std::string(kind.name) + ": the last of " + kind.usage + " must be above 0, not " +
                                        words.back());
        return p;
    }
    throw std::invalid_argument("bad path \"" + (words.empty() ? std::string() : words[0]) +
                                "\": must be circle, file, jerk, line, sine, or still");
}

Trajectory Trajectory::ofFile(const std::string& name) {
    std::ifstream in(name);
    if (!in) throw std::invalid_argument("cannot read " + name);
    Trajectory p;
    p.kind_ = "file";
    p.text_ = "file " + name;
    p.numbers_.clear();
    std::string line;
    for (int n = 1; std::getline(in, line); ++n) {
        std::istringstream words(line);
        words.imbue(std::locale::classic());
        double row[4];
        if (line.empty() || line[0] == '#') continue;
        if (!(words >> row[0] >> row[1] >> row[2] >> row[3]) || !(words >> std::ws).eof())
            throw std::invalid_argument(name + ":" + std::to_string(n) + ": must be t x y z");
        if (!p.numbers_.empty() && row[0] <= p.numbers_[p.numbers_.size() - 4])
            throw std::invalid_argument(name + ":" + std::to_string(n) + ": its time is not after that of the line before");
        p.numbers_.insert(p.numbers_.end(), row, row + 4);
    }
    if (p.numbers_.size() < 8) throw std::invalid_argument(name + ": at least two lines t x y z are needed");
    return p;
}

Point Trajectory::at(double t) const {
    const double* n = numbers_.data();
    const Point from{n[0], n[1], n[2]};
    auto between = [&](double u) {
        return Point{from[0] + u * (n[3] - n[0]), from[1] + u * (n[4] - n[1]), from[2] + u * (n[5] - n[2])};
    };
    if (kind_ == "still") return from;
    if (kind_ == "line") {
        const double length = std::hypot(n[3] - n[0], n[4] - n[1], n[5] - n[2]);
        return length > 0 ? between(toAndFro(t * n[6] / length)) : from;
    }
    if (kind_ == "circle") {
        const double a = 2 * M_PI * t / n[4];
        return {n[0] + n[3] * std::cos(a), n[1] + n[3] * std::sin(a), n[2]};
    }
    if (kind_ == "sine") {
        const double s = std::sin(2 * M_PI * n[6] * t);
        return {n[0] + n[3] * s, n[1] + n[4] * s, n[2] + n[5] * s};
    }
    if (kind_ == "jerk") return between(jerked(toAndFro(t / n[6])));
    const std::size_t rows = numbers_.size() / 4;
    t = n[0] + std::fmod(t, n[4 * (rows - 1)] - n[0]);
    std::size_t i = 1;
    while (i + 1 < rows && n[4 * i] < t) ++i;
    const double *a = n + 4 * (i - 1), *b = n + 4 * i, u = (t - a[0]) / (b[0] - a[0]);
    return {a[1] + u * (b[1] - a[1]), a[2] + u * (b[2] - a[2]), a[3] + u * (b[3] - a[3])};
}

}  // namespace simlab
