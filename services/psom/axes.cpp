#include "axes.h"

#include <charconv>
#include <cmath>

#include <sorma.h>

#include "psom.h"

namespace psom {

namespace {

const sorma::Prototype kAxes{sorma::Severity::error, "OPTION VALUE", 2, "{}: {}: {}"};

bool read(const std::string& text, double& value) {
    auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    return error == std::errc() && end == text.data() + text.size() && std::isfinite(value);
}

}  // namespace

std::vector<std::vector<double>> parseAxes(const std::string& object, const std::string& text) {
    std::vector<std::vector<double>> axes;
    for (auto& axis : sorma::splitWords(text)) {
        auto words = sorma::splitWords(axis);
        auto refuse = [&](const std::string& why) { sorma::fail(kAxes, object, "-axes", "\"" + axis + "\" " + why); };
        std::vector<double> nodes;
        if (!words.empty() && (words[0] == "chebyshev" || words[0] == "equidistant")) {
            double n = 0, low = 0, high = 0;
            if (words.size() != 4 || !read(words[1], n) || !read(words[2], low) || !read(words[3], high) || n != std::floor(n) || n < 2 ||
                n > double(kMostNodes) || !(low < high))
                refuse("must be \"" + words[0] + " n low high\", n from 2 to " + std::to_string(kMostNodes) + ", low below high");
            nodes = (words[0] == "chebyshev" ? chebyshev : equidistant)(std::size_t(n), low, high);
        } else {
            for (auto& word : words) {
                nodes.emplace_back();
                if (!read(word, nodes.back())) refuse("must be numbers, or \"chebyshev n low high\", or \"equidistant n low high\"");
            }
        }
        axes.push_back(std::move(nodes));
    }
    if (auto wrong = axes.empty() ? std::string() : checkAxes(axes, 1); !wrong.empty()) sorma::fail(kAxes, object, "-axes", wrong);
    return axes;
}

std::string checkAxes(const std::vector<std::vector<double>>& axes, std::size_t dimension) {
    if (axes.size() > kMostAxes) return "there are " + std::to_string(axes.size()) + " axes, at most " + std::to_string(kMostAxes) + " are possible";
    double numbers = double(dimension);
    for (std::size_t v = 0; v < axes.size(); ++v) {
        auto& axis = axes[v];
        auto which = "axis " + std::to_string(v + 1);
        if (axis.size() < 2 || axis.size() > kMostNodes)
            return which + " has " + std::to_string(axis.size()) + " nodes, it must have 2 to " + std::to_string(kMostNodes);
        for (std::size_t i = 1; i < axis.size(); ++i)
            if (!(axis[i] > axis[i - 1])) return "the nodes of " + which + " must rise";
        numbers *= double(axis.size());
    }
    if (numbers > double(kMostNumbers)) return "that makes more than " + std::to_string(kMostNumbers) + " numbers";
    return {};
}

}  // namespace psom
