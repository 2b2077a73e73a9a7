#include "mapFile.h"

#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <utility>

#include <sorma.h>

#include "axes.h"

namespace psom {

namespace {

const sorma::Prototype kLine{sorma::Severity::error, "PSOM FILE", 2, "{}: {} line {}: {}"};
const sorma::Prototype kFile{sorma::Severity::error, "PSOM FILE", 2, "{}: cannot {} {}: {}"};

class Reader {
public:
    Reader(const std::string& object, const std::string& file) : object_(object), file_(file), in_(file) {
        if (!in_) sorma::fail(kFile, object_, "read", file_, std::strerror(errno));
    }

    // The numbers of the next line, which begins with that word.
    std::vector<double> numbers(const std::string& word) {
        next();
        if (words_.empty() || words_[0] != word) refuse("expected \"" + word + "\", got \"" + line_.substr(0, 40) + "\"");
        std::vector<double> out;
        for (std::size_t i = 1; i < words_.size(); ++i) {
            double value = 0;
            auto& text = words_[i];
            auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
            if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value))
                refuse("\"" + text.substr(0, 40) + "\" is not a number");
            out.push_back(value);
        }
        return out;
    }
    bool continues(const std::string& word) {
        next();
        again_ = true;
        return !words_.empty() && words_[0] == word;
    }
    [[noreturn]] void refuse(const std::string& why) { sorma::fail(kLine, object_, file_, number_, why); }

private:
    void next() {
        if (std::exchange(again_, false)) return;
        ++number_;
        if (!std::getline(in_, line_)) line_ = "the end of the file";
        words_.clear();
        for (std::size_t i = 0; i < line_.size();) {
            auto from = line_.find_first_not_of(" \t\r", i);
            if (from == std::string::npos) break;
            i = std::min(line_.find_first_of(" \t\r", from), line_.size());
            words_.push_back(line_.substr(from, i - from));
        }
    }

    const std::string &object_, &file_;
    std::ifstream in_;
    std::string line_;
    std::vector<std::string> words_;
    int number_ = 0;
    bool again_ = false;
};

}  // namespace

std::shared_ptr<Map> load(const std::string& object, const std::string& file) {
    Reader in(object, file);
    auto version = in.numbers("sorma-psom");
    if (version.size() != 1 || version[0] != 1) in.refuse("this is another version than 1, which is known here");
    auto dimension = in.numbers("dimension");
    if (dimension.size() != 1 || dimension[0] < 1 || dimension[0] > double(kMostDimension) || dimension[0] != std::floor(dimension[0]))
        in.refuse("expected one whole number, 1 .. " + std::to_string(kMostDimension));
    const std::size_t d = std::size_t(dimension[0]);
    std::vector<std::vector<double>> axes;
    while (in.continues("axis")) {
        axes.push_back(in.numbers("axis"));
        if (auto wrong = checkAxes(axes, d); !wrong.empty()) in.refuse(wrong);
    }
    if (axes.empty()) in.numbers("axis");
    auto map = std::make_shared<Map>(axes, d);
    std::vector<double> vectors;
    for (std::size_t a = 0; a < map->nodes(); ++a) {
        auto w = in.numbers("node");
        if (w.size() != d) in.refuse("expected " + std::to_string(d) + " numbers, got " + std::to_string(w.size()));
        vectors.insert(vectors.end(), w.begin(), w.end());
    }
    in.numbers("end");
    map->train(vectors);
    return map;
}

void save(const std::string& object, const std::string& file, const Map& map) {
    std::string text = "sorma-psom 1\ndimension " + std::to_string(map.dimension()) + "\n";
    auto line = [&](const char* word, const double* from, std::size_t n) {
        text += word;
        for (std::size_t i = 0; i < n; ++i) text += ' ', sorma::appendNumber(text, from[i]);
        text += '\n';
    };
    for (auto& axis : map.axes()) line("axis", axis.data(), axis.size());
    auto vectors = map.vectors();
    for (std::size_t a = 0; a < map.nodes(); ++a) line("node", &vectors[a * map.dimension()], map.dimension());
    text += "end\n";
    const std::string part = file + ".part";
    std::ofstream out(part, std::ios::binary | std::ios::trunc);
    out << text;
    out.close();
    if (!out || std::rename(part.c_str(), file.c_str())) {
        const std::string why = std::strerror(errno);
        std::remove(part.c_str());
        sorma::fail(kFile, object, "write", file, why);
    }
}

}  // namespace psom
