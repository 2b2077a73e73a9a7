#include "postures.h"

#include <utility>
#include <vector>

#include <sorma.h>

namespace hand {

namespace {

const sorma::Prototype kPosture{sorma::Severity::error, "HAND POSTURE", 2, "{}: {}: {}"};
const sorma::Prototype kOrder{sorma::Severity::error, "OPTION VALUE", 2, "{}: {}: {}"};

[[noreturn]] void failUnknown(const std::string& hand, const std::string& name, const Postures& all) {
    sorma::fail(kPosture, hand, name, "no such posture; there are: " + all.names());
}

}  // namespace

Postures::Postures(const Planner& planner, const std::string& list) {
    auto wrong = [&](const std::string& why) { sorma::fail(kOrder, planner.hand, "-postures", why); };
    std::vector<std::string> words;
    try {
        words = sorma::splitWords(list);
    } catch (const sorma::Error& e) {
        wrong(std::string("is no list: ") + e.what());
    }
    if (words.size() % 2 != 0) wrong("a name and its angles must alternate, got " + std::to_string(words.size()) + " words");
    for (std::size_t i = 0; i < words.size(); i += 2) {
        const auto numbers = sorma::splitWords(words[i + 1]);
        if (numbers.size() != 3 && numbers.size() != kJoints) wrong(words[i] + " has " + std::to_string(numbers.size()) + " angles; 3 or 9 are expected");
        Targets t;
        for (std::size_t k = 0; k < kJoints; ++k)
            if (!sorma::parseNumber(numbers[k % numbers.size()], t[k])) wrong("angle \"" + numbers[k % numbers.size()] + "\" of " + words[i] + " is no number");
        if (double seconds; sorma::parseNumber(words[i], seconds)) wrong("\"" + words[i] + "\" is a number: a sequence would take it for a pause");
        planner.checkLimits(t);
        angles_[words[i]] = t;
    }
}

std::string Postures::names() const {
    std::vector<std::string> names;
    for (auto& [name, angles] : angles_) names.push_back(name);
    return names.empty() ? "there is none; CTRL -teach keeps one" : sorma::joinWords(names);
}

const Targets& Postures::get(const std::string& hand, const std::string& name) const {
    auto found = angles_.find(name);
    if (found == angles_.end()) failUnknown(hand, name, *this);
    return found->second;
}

void Postures::remove(const std::string& hand, const std::string& name) {
    if (angles_.erase(name) == 0) failUnknown(hand, name, *this);
}

std::string Postures::toText() const {
    std::string list;
    for (auto& [name, angles] : angles_) list += (list.empty() ? "" : " ") + sorma::joinWords({name, text(angles)});
    return list;
}

}  // namespace hand
