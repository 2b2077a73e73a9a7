// missingPackages.h -- packages that Tcl has looked for and not found.
//
// A look goes through all folders of auto_path, which takes milliseconds; a name that is no class is typed, or asked for by a
// completion, again and again. So what was missing stays so until the path, a folder or an index on it changes.
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
    bool has(const std::string& package);       // is it known to be missing, now?
    void add(const std::string& package);       // it was just looked for

private:
    struct Seen {
        std::string path;
        std::int64_t changed;                   // [ns], 0: there is none
    };
    std::string places() const;                 // where Tcl looks, and by what command
    void look(const std::string& places);

    Tcl_Interp* interp_;
    std::string places_;
    std::vector<Seen> seen_;                    // folders, and indices in them
    std::unordered_set<std::string> missing_;
};

}  // namespace sorma
