#include "tap.h"

namespace robot {

Tap::Found Tap::look(const std::string& key, std::string& problem) const {
    problem.clear();
    try {
        shmem::Reader reader(key);
        const std::size_t floats = reader.shape().floats;
        if (!reader.retired() && floats >= least_ && floats <= most_) return reader;
        problem = key + " has records of " + std::to_string(floats) + " floats; " + std::to_string(least_) +
                  (most_ > least_ ? " or more" : "") + " are expected";
    } catch (const shmem::Failure& f) {
        problem = f.what();
    }
    return {};
}

}  // namespace robot
