// ahead.h -- what the process of an object would refuse, known before the request is sent.
//
// A caller that has the same class can check the words and arguments of a request itself, and saves the way. The answer to
// DBX -info secrets has three integers for that, the facts of the object. They are the fingerprint of its class, the rights that the
// caller has to it, and a hash of its own name. The facts fit when the caller's class has the same fingerprint, and the caller uses
// that name. Then it refuses what the object would refuse, in the same words. Everything that is not certain is sent. The
// caller is told when the facts may be wrong: Network::outdated.
//
// Threads: the SORM's of that class.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "bus/access.h"
#include "bus/message.h"
#include "bus/option.h"

namespace sorma::ahead {

// name: the object's own.   rights: of the caller, to the object.
std::vector<std::int64_t> facts(const Class& type, std::string_view name, Rights rights);

// Do the facts of an object fit, when a caller knows it by this name and has this class?
bool fit(const std::vector<std::int64_t>& facts, const Class& type, std::string_view name);
Rights rightsIn(const std::vector<std::int64_t>& facts);        // facts: that fit

// Fails as the object of that name would, as far as the table of its class decides it.
void check(const Class& type, std::string_view object, Method method, const Message& m, Rights rights);

}  // namespace sorma::ahead
