// postures.h -- postures by name: angles of all joints, as the option -postures has them in words.
#pragma once

#include <map>
#include <string>

#include "legs.h"

namespace hand {

class Postures {
public:
    Postures() = default;
    // list: name and angles [rad] of each: 9, or 3 that hold for all fingers. Fails with OPTION VALUE and HAND LIMITS.
    Postures(const Planner& planner, const std::string& list);

    const Targets& get(const std::string& hand, const std::string& name) const;     // fails with HAND POSTURE, for that hand
    void keep(const std::string& name, const Targets& angles) { angles_[name] = angles; }
    void remove(const std::string& hand, const std::string& name);                  // fails as get
    std::string names() const;              // for people
    std::string toText() const;             // as list above

private:
    std::map<std::string, Targets> angles_;
};

}  // namespace hand
