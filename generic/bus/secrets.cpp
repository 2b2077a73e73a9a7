// secrets.cpp -- what a SORM hides of secret options (Spec::secret).
#include <algorithm>

#include "bus/requestText.h"
#include "bus/sorm.h"

namespace sorma {

std::vector<std::string> Sorm::masked(std::vector<std::string> words) const {
    if (secrets_.empty() && untold_.empty()) return words;
    for (std::size_t i = 0; i < words.size(); ++i) {
        if (i > 0 && isSecret(words[i - 1])) words[i] = kMask;
        else if (!isSecret(words[i])) words[i] = masked(std::move(words[i]));       // perhaps a request or a recipe in itself
    }
    return words;
}

std::string Sorm::masked(std::string request) const {
    for (auto& name : untold_)
        for (auto& start : {name + " CTRL ", name + " configure "})
            if (auto at = request.find(start); at != request.npos) return request.substr(0, at) + start + std::string(kMask);
    auto named = std::find_if(secrets_.begin(), secrets_.end(), [&](auto& name) { return request.find(name) != request.npos; });
    if (named == secrets_.end()) return request;
    try {
        auto words = splitWords(request);
        return words.size() == 1 && words[0] == request ? request : joinWords(masked(std::move(words)));
    } catch (const Error&) {
    }
    // No list of words: nothing of what may be the value is shown.
    return request.substr(0, request.find(*named) + named->size()) + " " + std::string(kMask);
}

bool Sorm::holdsSecrets(const Service& service) const {
    return service.holdsSecrets() || (!secrets_.empty() && (&service == self_ || service.name() == "dict"));
}

bool Sorm::learnSecrets(std::string_view text) {
    constexpr std::size_t kMost = 1000, kLongest = 100;         // more are no options but nonsense
    bool any = false;
    try {
        for (auto& word : splitWords(text)) {
            if (word.size() < 2 || word[0] != '-' || word.size() > kLongest) continue;
            any = true;
            if (secrets_.size() < kMost) secrets_.insert(std::move(word));
        }
    } catch (const Error&) {                                    // it tells none
    }
    return any;
}

}  // namespace sorma
