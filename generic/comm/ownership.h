// ownership.h -- objects that obey the owner of a name alone.
//
//     sormad -name robot -directory 1 -owned carry.*
//
// While the daemon does not own its name it refuses EXEC and CTRL for such objects: bus/fence.h has the doors. It judges by its own
// clock, so a daemon that was stopped refuses before it has heard of the next owner.
//
// A client that has found the daemon by the directory says with each call which epoch of the name it knows (doc/wire.md). A lower epoch than the
// daemon's is refused. A higher one says that somebody else has become the owner. The clock here may be wrong then, and nothing is accepted
// until the directory has renewed the claim. That is believed of callers that may call the object.
//
// Threads: the SORM's.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "bus/fence.h"
#include "comm/directory.h"

namespace sorma {

class Ownership : public Fence {
public:
    // self: as it was claimed there. patterns: of names of objects, as globMatch.
    Ownership(std::shared_ptr<Directory> directory, Directory::Entry self, std::vector<std::string> patterns);
    bool covers(std::string_view object) const override;
    // A higher epoch of those who are trusted is believed. Fails with DIRECTORY NOT_OWNER or DIRECTORY STALE.
    void need(std::string_view object, std::int64_t epoch, bool trusted, bool& elsewhere) override;

private:
    struct Owner {                          // the other one
        bool known = false;                 // there is one
        std::string text;                   // for people
    };
    Owner owner() const;

    const std::shared_ptr<Directory> directory_;
    const Directory::Entry self_;
    const std::vector<std::string> patterns_;
    std::int64_t last_ = 0;                 // epoch with which the name was ours
    std::int64_t doubted_ = 0;              // [ns, bootNow] when a client knew of a later owner; 0: never
};

}  // namespace sorma
