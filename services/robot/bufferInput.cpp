#include "bufferInput.h"

namespace robot {

BufferInput::Found BufferInput::look(const std::string& key) {
    problem_.clear();
    try {
        shmem::Reader reader(key);
        const std::size_t floats = reader.shape().floats;
        if (!reader.retired()) {
            const bool fits = floats >= least_ && floats <= most_;
            if (!fits && !misfit_) ++misfits_;
            misfit_ = !fits;
            if (fits) return reader;
        }
        problem_ = key + " has records of " + std::to_string(floats) + " floats; " + std::to_string(least_) +
                  (most_ > least_ ? " or more" : "") + " are expected";
    } catch (const shmem::Failure& f) {
        problem_ = f.what();
    }
    return {};
}

void BufferInput::use(Found found) {
    if (reader_ && !attached()) ++ended_;
    reader_ = std::move(found);
}

std::string BufferInput::missing() const { return reader_ && !attached() ? "its writer has ended" : problem_; }

void BufferInput::tellIncidents(const std::string& object, const std::string& key, sorma::Incidents& out) const {
    out.push_back({object, "buffer " + key + " has ended", ended_});
    out.push_back({object, "buffer " + key + " has another size", misfits_});
}

}  // namespace robot
