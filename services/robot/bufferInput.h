// bufferInput.h -- a snapshot buffer that is read in ticks. Its writer may be missing, end, or be replaced.
//
// Threads:   look() by the SORM's thread, while ticks go on; use() between ticks; reader() in a tick.
// Allocates: only look().
#pragma once

#include <optional>
#include <string>

#include <shmem/ring.h>

#include "bus/incident.h"

namespace robot {

class BufferInput {
public:
    using Found = std::optional<shmem::Reader>;

    // Floats of a record: at least, at most.
    BufferInput(std::size_t least, std::size_t most) : least_(least), most_(most) {}

    void expect(std::size_t floats) { least_ = most_ = floats; }
    bool attached() const { return reader_ && !reader_->retired(); }
    // None: nobody writes it, or its records have another size; missing() says so.
    Found look(const std::string& key);
    void use(Found found);
    std::string missing() const;        // by the SORM's thread: why there is none; empty while there is one, and before the first look
    void tellIncidents(const std::string& object, const std::string& key, sorma::Incidents& out) const;
    const shmem::Reader* reader() const { return attached() ? &*reader_ : nullptr; }

private:
    std::size_t least_, most_;
    Found reader_;
    std::string problem_;               // of the last look
    bool misfit_ = false;               // the one that was looked at last has records of another size
    sorma::Tally ended_, misfits_;
};

}  // namespace robot
