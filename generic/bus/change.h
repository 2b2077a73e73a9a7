// change.h -- a change of options that is about to be made, for Service::prepare.
#pragma once

#include <functional>
#include <string_view>
#include <vector>

#include "bus/option.h"
#include "bus/principal.h"

namespace sorma {

// Values have been read and checked, and are not set yet. Lives only while Service::prepare runs.
class Change {
public:
    struct Setting {
        int option;                     // index in the class's table
        Value value;                    // the new value
        PrincipalPointer author;        // who wrote it; null: the owner
    };
    using Values = std::vector<Setting>;                    // if an option is there twice, the last one counts

    // Both must outlive it.
    Change(const Service& service, const Values& values) : service_(service), values_(values) {}

    bool concerns(std::string_view option) const;           // does the change set this option?
    // The value that an option will have: the new one, or the present one if the change does not set it.
    Value value(std::string_view option) const;
    const PrincipalPointer& author(std::string_view option) const;      // who wrote that value
    template <class V> V get(std::string_view option) const { return std::get<V>(value(option)); }
    template <Kind kind> Named<kind> named(std::string_view option) const { return {get<std::string>(option), author(option)}; }

private:
    const Setting* find(std::string_view option) const;
    const Service& service_;
    const Values& values_;
};

// Returned by Service::prepare. It exchanges the prepared state and the present one; a second call exchanges them back,
// which undoes the change.
using Commit = std::function<void()>;

}  // namespace sorma
