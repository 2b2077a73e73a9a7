// serviceRemembered.cpp -- an object remembers values beyond its process: see bus/remembered.h.
#include <algorithm>

#include "bus/measured.h"
#include "bus/nearest.h"
#include "bus/remembered.h"
#include "bus/requestText.h"
#include "bus/serviceParts.h"
#include "bus/sorm.h"

namespace sorma {

namespace {

const Prototype kNoFile{Severity::error, "DICT FILE", 1,
                        "{}: no dictionary file is loaded, and values are remembered beside it: load one, dict CTRL -load FILE"};
const Prototype kWhich{Severity::error, "OPTION VALUE", 2, "{}: {} {}: expected 1, 0, or a list of options, and there is no option {}{}"};
const Prototype kNameless{Severity::error, "SERVICE FAILED", 1, "{}: an object without a name cannot remember values: they are kept by its name"};
const Prototype kSecret{Severity::error, "OPTION VALUE", 2, "{}: {} {} is secret, and is not remembered: write it into the recipe"};
const Prototype kMeasured{Severity::error, "OPTION VALUE", 2, "{}: {} {} is measured, and is not remembered"};
const Prototype kStale{Severity::warning, "OPTION VALUE", 2, "{}: {} {} was remembered, but cannot be set any more: {}"};
const Prototype kLong{Severity::warning, "OPTION VALUE", 2, "{}: {} has {} bytes; values beyond {} are not remembered"};

constexpr std::size_t kMostText = 4096;     // [bytes] of a value

}  // namespace

// write: note it in the file, too.
void Service::rememberOnly(const std::string& which, const PrincipalPointer& author, bool write) {
    if (!Name::isName(name_)) fail(kNameless, name_);
    if (sorm_->remembered().file().empty()) fail(kNoFile, name_);
    auto& options = class_->options();
    std::vector<bool> chosen(options.size(), false);
    if (which == "1") {
        for (std::size_t k = 0; k < options.size(); ++k) chosen[k] = !options[k].spec.secret && !options[k].spec.fixed && !isMeasured(options[k]);
    } else if (which != "0") {
        std::vector<std::string> names;
        for (auto& o : options) names.push_back(o.name);
        for (auto& word : splitWords(which)) {
            const int index = class_->findOption(word);
            if (index < 0) fail(kWhich, name_, Remembered::kSwitch, sorma::shown(which), sorma::shown(word), didYouMean(word, names));
            if (options[std::size_t(index)].spec.secret) fail(kSecret, name_, Remembered::kSwitch, word);
            if (isMeasured(options[std::size_t(index)])) fail(kMeasured, name_, Remembered::kSwitch, word);
            chosen[std::size_t(index)] = true;
        }
    }
    auto& before = record().remembers;
    if (write) {
        auto& file = sorm_->remembered();
        for (std::size_t k = 0; k < before.size(); ++k)
            if (before[k] && !chosen[k]) file.forget(name_, options[k].name);
        file.set(name_, {Remembered::kSwitch, which, CallContext::currentCallers(), wallNow(), author});
        file.flush();
    }
    before = std::find(chosen.begin(), chosen.end(), true) == chosen.end() ? std::vector<bool>() : chosen;
}

// They have just been set.
void Service::remember(const std::vector<const Option*>& options) {
    if (!record_ || record_->remembers.empty()) return;
    for (auto* o : options) {
        const auto k = std::size_t(o - class_->options().data());
        if (!record_->remembers[k]) continue;
        auto& source = *record_->sources[k];
        using Kind = Record::Source::Kind;
        if (source.kind == Kind::initial || source.kind == Kind::recipe || source.kind == Kind::found) {       // by -undo, or refused
            sorm_->remembered().forget(name_, o->name);
            continue;
        }
        std::string text = toText(o->value(*this, Permit::owner()));
        if (text.size() > kMostText) {
            keepTrail(Trail(makeEntry(kLong, {MessageArg::of(name_), MessageArg::of(o->name), MessageArg::of(text.size()), MessageArg::of(kMostText)})));
            continue;
        }
        sorm_->remembered().set(name_, {o->name, std::move(text), source.by, source.time, source.author});
    }
    try {
        sorm_->remembered().flush();
    } catch (const Error& e) {              // they are set all the same
        noteFailure(e.trail);
    }
}

// At birth, after the recipe. A value that is not valid any more, or whose author has lost the right to it, is left out with
// a warning: the object is made.
void Service::recall(const std::vector<std::string>* given) {
    for (auto& v : sorm_->remembered().of(name_)) {
        try {
            if (v.option == Remembered::kSwitch) {
                rememberOnly(v.text, v.author, false);
                continue;
            }
            if (given && std::find(given->begin(), given->end(), v.option) != given->end()) continue;
            Origin origin;
            origin.by = v.by;
            origin.author = v.author;
            configure({{v.option, origin}, {v.text, origin}}, true, nullptr);
            const int index = class_->findOption(v.option);
            record().sources[std::size_t(index)].edit([&](auto& source) {
                source.kind = Record::Source::Kind::remembered;
                source.by = v.by;
                source.time = v.time;
            });
        } catch (const Error& e) {
            Trail trail(makeEntry(kStale, {MessageArg::of(name_), MessageArg::of(v.option), MessageArg::of(sorma::shown(v.text)), MessageArg::of(e.what())}));
            keepTrail(trail);
            sorm_->announce(trail);
        }
    }
}

}  // namespace sorma
