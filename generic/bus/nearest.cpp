#include "bus/nearest.h"

#include <algorithm>
#include <array>

namespace sorma {

namespace {

constexpr std::size_t kLongest = 64, kMost = 3;     // bytes of a word; words that are offered

char lower(char c) { return c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c; }

// Letters to change, insert, take out or swap with the next one; a number above most when it takes more.
std::size_t distance(std::string_view a, std::string_view b, std::size_t most) {
    if (std::max(a.size(), b.size()) - std::min(a.size(), b.size()) > most) return most + 1;
    using Row = std::array<std::size_t, kLongest + 1>;
    Row before{}, last{}, row{};
    for (std::size_t j = 0; j <= b.size(); ++j) last[j] = j;
    for (std::size_t i = 1; i <= a.size(); ++i) {
        row[0] = i;
        for (std::size_t j = 1; j <= b.size(); ++j) {
            bool same = lower(a[i - 1]) == lower(b[j - 1]);
            row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + (same ? 0 : 1)});
            if (i > 1 && j > 1 && lower(a[i - 1]) == lower(b[j - 2]) && lower(a[i - 2]) == lower(b[j - 1]))
                row[j] = std::min(row[j], before[j - 2] + 1);
        }
        before = last;
        last = row;
    }
    return last[b.size()];
}

bool begins(std::string_view whole, std::string_view part) {
    return part.size() >= 3 && whole.size() > part.size() &&
           std::equal(part.begin(), part.end(), whole.begin(), [](char a, char b) { return lower(a) == lower(b); });
}

}  // namespace

std::vector<std::string> nearest(std::string_view word, const std::vector<std::string>& known) {
    std::vector<std::string> out;
    if (word.empty() || word.size() > kLongest) return out;
    const std::size_t most = word.size() < 3 ? 0 : std::min<std::size_t>(3, std::max<std::size_t>(1, word.size() / 3));
    std::size_t least = most + 2;
    for (auto& candidate : known) {
        if (candidate.empty() || candidate.size() > kLongest || candidate == word) continue;
        std::size_t d = distance(word, candidate, most);
        if (d > most) {
            if (!begins(candidate, word) && !begins(word, candidate)) continue;
            d = most + 1;       // behind whatever is mistyped
        }
        if (d < least) out.clear(), least = d;
        if (d == least) out.push_back(candidate);
    }
    std::sort(out.begin(), out.end());
    out.erase(std::unique(out.begin(), out.end()), out.end());
    if (out.size() > kMost) out.resize(kMost);
    return out;
}

std::string didYouMean(std::string_view word, const std::vector<std::string>& known) {
    auto near = nearest(word, known);
    std::string out;
    for (std::size_t i = 0; i < near.size(); ++i) out += (i == 0 ? " (did you mean " : i + 1 < near.size() ? ", " : " or ") + near[i];
    return out.empty() ? out : out + "?)";
}

std::string oneOf(std::vector<std::string> words) {
    std::sort(words.begin(), words.end());
    words.erase(std::unique(words.begin(), words.end()), words.end());
    std::string out;
    for (std::size_t i = 0; i < words.size(); ++i) {
        if (i > 0) out += words.size() > 2 ? ", " : " ";
        if (i > 0 && i + 1 == words.size()) out += "or ";
        out += words[i];
    }
    return out;
}

}  // namespace sorma
