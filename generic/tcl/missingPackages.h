// missingPackages.h -- remembers the packages that Tcl did not find.
//
// Tcl reads all folders of auto_path to find a package, which takes milliseconds. Names that are no class are often asked
// for again, for instance by completion. So a package that was missing counts as missing until auto_path changes, or a
// folder or an index in it. For others than the owner we look once a second at most.
//
// Threads: the interpreter's. Both functions evaluate Tcl commands, and change the interpreter's result.
#pragma once

#include <cstdint>
#include <string>
#include <unordered_set>
#include <vector>

#include "tcl/tclShim.h"

namespace sorma {

class MissingPackages {
public:
    explicit MissingPackages(Tcl_Interp* interp) : interp_(interp) {}
    bool has(const std::string& package);       // true: it is still missing, and there is no need to look again
    void add(const std::string& package);       // Tcl has just looked for it and not found it

private:
    bool known(const std::string& package) const;       // have we read of a package of that name?
    struct Seen {
        std::string path;
        std::int64_t changed;                   // [ns], 0: it does not exist
    };
    std::string places() const;                 // the folders that Tcl reads, and the command that reads them
    void look(const std::string& places);       // forget all names, and note how the folders are now

    Tcl_Interp* interp_;
    std::string places_;                        // as places() was when we looked
    std::vector<Seen> seen_;                    // folders, and the indices in them
    std::unordered_set<std::string> missing_;   // names
    std::int64_t looked_ = 0;                   // [ns] when the folders were last seen to be as we know them; 0: never
};

}  // namespace sorma
