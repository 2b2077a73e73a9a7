#include "tcl/missingPackages.h"

#include <dirent.h>
#include <sys/stat.h>

#include <algorithm>
#include <memory>

#include "bus/call.h"
#include "bus/client.h"
#include "tcl/interpreter.h"

namespace sorma {

namespace {

constexpr std::size_t kMost = 10'000;           // names
constexpr std::int64_t kRest = 1'000'000'000;   // [ns] between looks for others than the owner

bool forStranger() {
    const ClientPointer& client = CallContext::currentClient();
    return client && client->principal;
}

std::int64_t changedAt(const std::string& path) {
    struct stat s;
    return stat(path.c_str(), &s) == 0 ? s.st_mtim.tv_sec * 1'000'000'000 + s.st_mtim.tv_nsec : 0;
}

}  // namespace

// `package versions` reads no files. It knows an `ifneeded` script that was added meanwhile, and each class in the folders that Tcl
// has read.
bool MissingPackages::known(const std::string& package) const {
    Obj words[] = {newText("::package"), newText("versions"), newText(package)};
    Tcl_Obj* objv[] = {words[0], words[1], words[2]};
    return Tcl_EvalObjv(interp_, 3, objv, TCL_EVAL_GLOBAL) == TCL_OK && !view(Tcl_GetObjResult(interp_)).empty();
}

bool MissingPackages::has(const std::string& package) {
    if (looked_ != 0 && forStranger() && monotonicNow() - looked_ < kRest) return !known(package);
    if (!missing_.contains(package)) return false;
    bool changed = known(package) || places() != places_ ||
                   std::any_of(seen_.begin(), seen_.end(), [](auto& s) { return changedAt(s.path) != s.changed; });
    if (changed) missing_.clear();
    looked_ = changed ? 0 : monotonicNow();
    return !changed;
}

void MissingPackages::add(const std::string& package) {
    std::string now = places();
    if (missing_.empty() || missing_.size() >= kMost || now != places_) look(now);
    missing_.insert(package);
    looked_ = monotonicNow();
}

std::string MissingPackages::places() const {
    std::string text = Tcl_EvalEx(interp_, "::list [::package unknown] [::tcl::tm::path list]", -1, TCL_EVAL_GLOBAL) == TCL_OK
                           ? toUtf8(Tcl_GetObjResult(interp_)) : std::string();
    Tcl_Obj* path = Tcl_GetVar2Ex(interp_, "auto_path", nullptr, TCL_GLOBAL_ONLY);
    return text + '\n' + (path ? toUtf8(path) : std::string());
}

// As tclPkgUnknown does: an index in each folder of the path and in each folder of those; modules by their folders.
void MissingPackages::look(const std::string& places) {
    places_ = places;
    missing_.clear();
    seen_.clear();
    auto see = [this](std::string path) {
        std::int64_t changed = changedAt(path);
        seen_.push_back({std::move(path), changed});
    };
    Tcl_Obj* path = Tcl_GetVar2Ex(interp_, "auto_path", nullptr, TCL_GLOBAL_ONLY);
    for (auto& folder : path ? listStrings(path) : std::vector<std::string>()) {
        see(folder);
        see(folder + "/pkgIndex.tcl");
        std::unique_ptr<DIR, int (*)(DIR*)> dir(opendir(folder.c_str()), closedir);
        while (dirent* e = dir ? readdir(dir.get()) : nullptr) {
            if (e->d_name[0] == '.' || (e->d_type != DT_DIR && e->d_type != DT_LNK && e->d_type != DT_UNKNOWN)) continue;
            see(folder + "/" + e->d_name);
            see(folder + "/" + e->d_name + "/pkgIndex.tcl");
        }
    }
    if (Tcl_EvalEx(interp_, "::tcl::tm::path list", -1, TCL_EVAL_GLOBAL) == TCL_OK) {
        Obj roots(Tcl_GetObjResult(interp_));
        for (auto& root : listStrings(roots))
            for (auto* part : {"", "/sorma", "/sorma/service"}) see(root + part);
    }
}

}  // namespace sorma
