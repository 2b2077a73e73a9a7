// repeatable.cpp -- which requests may be sent again when nobody knows whether they have run: Class::repeatable.
#include <algorithm>

#include "bus/catalogue.h"
#include "bus/serviceParts.h"

namespace sorma {

namespace {

const Prototype kNoAction{Severity::error, "CLASS TABLE", 2, "class {}: {} is to be repeatable, but is no action that was declared before"};

}  // namespace

Class& Class::repeatable(std::vector<std::string> words) {
    if (words.empty()) words.emplace_back();
    for (auto& word : words) {
        if (!word.starts_with('-')) {
            execRepeatables_.push_back(std::move(word));
            continue;
        }
        auto action = std::find_if(actions_.begin(), actions_.end(), [&](auto& a) { return a.name == word; });
        if (action == actions_.end()) fail(kNoAction, name_, word);
        action->repeatable = true;
    }
    return *this;
}

std::vector<std::string> Class::repeatables() const {
    auto out = execRepeatables_;
    for (auto& a : actions_)
        if (a.repeatable) out.push_back(a.name);
    return out;
}

std::string Class::repeatableText() const {
    std::string out;
    for (auto& word : repeatables())
        out += (out.empty() ? "" : ", ") + (word.empty() ? std::string("EXEC") : (word.starts_with('-') ? "CTRL " : "EXEC ") + word);
    return out;
}

std::string Class::whyNotRepeatable(const Message& m, Method method) const {
    const std::string declares = "class " + name_ + " does not declare ";
    if (method == Method::exec) {
        if (isDangerous(m)) return "EXEC of class " + name_ + " moves, powers or fires something";
        const std::string first = m.words.empty() ? std::string() : m.words[0];
        const bool declared = std::any_of(execRepeatables_.begin(), execRepeatables_.end(), [&](auto& word) { return word.empty() || word == first; });
        return declared ? std::string() : declares + (first.empty() || (words_.empty() && execRepeatables_.empty()) ? "EXEC" : "EXEC " + first) + " repeatable";
    }
    // An argument that looks like a word is taken for one: then the request is rather not repeated.
    const bool ctrl = method == Method::ctrl;
    bool known = false;
    for (auto& word : m.words) {
        if (ctrl && findOption(word) >= 0) return word + " sets an option, and another value may have been set meanwhile";
        const Action* action = ctrl ? CommonRequests::findAction(*this, word) : CommonRequests::findInspection(*this, word);
        if (action && needsOperate(action->danger)) return word + " moves, powers or fires something";
        if (action && !action->repeatable) return declares + word + " repeatable";
        known = known || action;
    }
    return known ? std::string() : declares + "such a request repeatable";
}

}  // namespace sorma
