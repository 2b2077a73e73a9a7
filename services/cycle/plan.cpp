#include "plan.h"

#include <algorithm>

namespace cycle {

namespace {

constexpr std::size_t kUsualLength = 64;                // of the parts of a message, when an object does not say

}  // namespace

void Step::reserve() {
    std::size_t floats = kUsualLength;
    for (auto& pin : object->pins())
        if (pin.length != sorma::Pin::kOpen) floats = std::max(floats, pin.at + pin.length);
    message.floats.reserve(floats);
    message.ints.reserve(kUsualLength);
    message.text.reserve(std::max(request.text.size(), kUsualLength));
    message.any.reserve(std::max(request.any.size(), kUsualLength));
}

void Plan::findNearAction(bool executes) {
    nearAction.clear();
    if (executes) sorma::addTree(*onFault->object, nearAction);
    Objects far;
    auto visit = [&](auto& self, sorma::Service& object) -> bool {
        if (nearAction.count(&object)) return true;
        if (!far.insert(&object).second) return false;
        bool near = false;
        for (auto& part : object.parts()) near |= self(self, *part);
        if (near) nearAction.insert(&object);
        return near;
    };
    for (auto& step : steps) step.nearAction = !nearAction.empty() && visit(visit, *step.object);
}

}  // namespace cycle
