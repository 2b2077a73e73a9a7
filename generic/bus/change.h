// change.h -- what the options of an object are going to be: for Service::prepare.
#pragma once

#include <functional>
#include <string_view>
#include <vector>

#include "bus/option.h"
#include "bus/principal.h"

namespace sorma {

class Change {
public:
    struct Setting {
        int option;                     // index
        Value value;                    // the new one
        PrincipalPointer author;        // who has written it
    };
    using Values = std::vector<Setting>;                    // the last one of an option counts

    // Both must outlive it.
    Change(const Service& service, const Values& values) : service_(service), values_(values) {}

    bool concerns(std::string_view option) const;           // one of those that are set
    // What an option is going to be: the new value, or the present one when it is not set.
    Value value(std::string_view option) const;
    const PrincipalPointer& author(std::string_view option) const;      // of that value
    template <class V> V get(std::string_view option) const { return std::get<V>(value(option)); }

private:
    const Setting* find(std::string_view option) const;
    const Service& service_;
    const Values& values_;
};

// Puts what has been prepared in the place of what is there, and keeps that: called once more, it takes the change back.
using Commit = std::function<void()>;

}  // namespace sorma
