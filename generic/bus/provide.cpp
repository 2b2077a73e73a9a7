#include "sorma.h"

namespace sorma {

int provide(Tcl_Interp* interp, const char* package, const char* version, std::vector<Class> classes) noexcept {
    Sorm* sorm = nullptr;
    std::vector<std::string> added;
    try {
        sorm = Sorm::of(interp);
        if (!sorm) return 1;        // there is no SORM, so no host to report to
        for (auto& c : classes) {
            std::string name = c.name();
            c.version(version);
            sorm->add(std::move(c));
            added.push_back(std::move(name));
        }
        if (sorm->host()) sorm->host()->providePackage(package, version);
        return 0;
    } catch (...) {
        try {
            for (auto& name : added) sorm->forget(name);
            Trail trail = trailOfCurrentException({});
            if (auto* cause = trail.cause(); cause && sorm->host()) sorm->host()->report(cause->text);
        } catch (...) {
        }
    }
    return 1;
}

}  // namespace sorma
