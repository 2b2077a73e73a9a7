#include "bus/change.h"

#include "bus/service.h"

namespace sorma {

const Change::Setting* Change::find(std::string_view option) const {
    int index = service_.type().findOption(option);
    for (auto v = values_.rbegin(); v != values_.rend(); ++v)
        if (v->option == index) return &*v;
    return nullptr;
}

bool Change::concerns(std::string_view option) const { return find(option) != nullptr; }

Value Change::value(std::string_view option) const {
    if (auto* v = find(option)) return v->value;
    return service_.type().options()[std::size_t(service_.type().findOption(option))].value(service_, Permit::owner());
}

const PrincipalPointer& Change::author(std::string_view option) const {
    if (auto* v = find(option)) return v->author;
    return service_.author(option);
}

}  // namespace sorma
