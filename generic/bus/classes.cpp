// classes.cpp -- the classes that a SORM has.
#include "bus/nearest.h"
#include "bus/sorm.h"

namespace sorma {

namespace {

const Prototype kUnknownClass{Severity::error, "NAME UNKNOWN_CLASS", 1,
                              "unknown service class \"{0}\"{1} in \"{0}\": no package sorma::service::{0} was found either{2}"};
const Prototype kDuplicate{Severity::error, "CLASS DUPLICATE", 1, "service class \"{}\" is registered already, {}"};
const Prototype kClassName{Severity::error, "NAME SYNTAX", 1, "bad class name \"{}\": must be lower-case letters, digits and _"};

}  // namespace

void Sorm::add(Class type) {
    Name parsed;
    try {
        parsed = Name::parse(type.name());
    } catch (const Error&) {
    }
    if (parsed.service != type.name() || !parsed.flavor.empty() || !parsed.local()) fail(kClassName, type.name());
    if (auto* known = findClass(type.name())) fail(kDuplicate, type.name(), known->file().empty() ? "by a class of Tcl" : "from " + known->file() + ":" + std::to_string(known->line()));
    for (auto& o : type.options())
        if (o.spec.secret) secrets_.insert(o.name);
    std::string name = type.name();
    ++classChanges_;
    classes_.emplace(std::move(name), std::make_shared<Class>(std::move(type)));
}

const Class* Sorm::findClass(std::string_view name) const {
    auto found = classes_.find(name);
    return found == classes_.end() ? nullptr : found->second.get();
}

const Class& Sorm::needClass(const std::string& name) {
    const Class* known = findClass(name);
    if (!known && host_ && host_->loadClass(name)) known = findClass(name);
    if (!known) {
        std::vector<std::string> names = host_ ? host_->classNames() : std::vector<std::string>();
        for (auto& [key, type] : classes_) names.push_back(key);
        std::string hint = didYouMean(name, names), places = hint.empty() && host_ ? host_->classPlaces() : std::string();
        fail(kUnknownClass, name, hint, places.empty() ? places : " in " + places);
    }
    return *known;
}

std::vector<const Class*> Sorm::classes() const {
    std::vector<const Class*> out;
    for (auto& [name, type] : classes_) out.push_back(type.get());
    return out;
}

void Sorm::forget(std::string_view name) {
    auto found = classes_.find(name);
    if (found == classes_.end()) return;
    classes_.erase(found);
    ++classChanges_;
    if (network) network->outdated();
}

}  // namespace sorma
