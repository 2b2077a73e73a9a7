// anonymous.cpp -- objects that are in no repository: they belong to whoever has made them.
#include "bus/call.h"
#include "bus/sorm.h"

namespace sorma {

namespace {

const Prototype kOfSorm{Severity::error, "SERVICE PROTECTED", 1, "{}: there is one object of class {}, and it belongs to the SORM"};

}  // namespace

Reference Sorm::makeAnonymous(std::unique_ptr<Service> service, const std::string& label, const std::string& className,
                              const std::vector<std::string>& words) {
    const std::shared_ptr<const Class> type = needClass(className).shared_from_this();     // a word may remove it
    if (className == self_->name() || className == "dict") fail(kOfSorm, label, className);
    if (!service) access.need(nullptr, Right::make, className, label);
    Charge charge = chargeObject(label, nullptr);
    Reference made = service ? adopt(std::move(service), label, *type) : construct(label, *type);
    made->charge_ = std::move(charge);
    type->learnDefaults(*made);
    std::vector<DictionaryWord> recipe;
    for (auto& w : words) recipe.push_back({w, Origin{{}, 0, {}, CallContext::currentCallers(), nullptr}});
    Message reply;
    try {
        if (!recipe.empty()) made->configure(recipe, true, &reply);
        made->born();
        testAtBirth(*made);
    } catch (...) {
        throw Error(trailOfCurrentException(label));
    }
    return made;
}

void Sorm::dismiss(const Reference& anonymous) {
    if (!anonymous->gone()) anonymous->left();
}

}  // namespace sorma
