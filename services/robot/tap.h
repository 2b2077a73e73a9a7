// tap.h -- a snapshot buffer as a tick reads it: its writer may be missing, end, or be replaced by another one.
//
// Threads:   look() by the SORM's thread; take() and use() between ticks; reader() in a tick.
// Allocates: look() alone.
#pragma once

#include <optional>
#include <string>

#include <shmem/ring.h>

namespace robot {

class Tap {
public:
    using Found = std::optional<shmem::Reader>;

    // Floats of a record: at least, at most.
    Tap(std::size_t least, std::size_t most) : least_(least), most_(most) {}

    bool attached() const { return reader_ && !reader_->retired(); }
    // None: nobody writes it, or its records have another size; `problem` says so.
    Found look(const std::string& key, std::string& problem) const;
    void use(Found found) { reader_ = std::move(found); }
    const shmem::Reader* reader() const { return attached() ? &*reader_ : nullptr; }

private:
    std::size_t least_, most_;
    Found reader_;
};

}  // namespace robot
