#include "comm/runtimeFolder.h"

#include <dirent.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <memory>

#include "bus/catalogue.h"

namespace sorma {

namespace {

const Prototype kFolder{Severity::error, "COMM DENIED", 1, "runtime folder {}: {}; set SORMA_RUNTIME_DIR to a folder of your own with mode 0700"};

}  // namespace

std::string runtimeFolder() {
    std::string folder;
    if (const char* own = std::getenv("SORMA_RUNTIME_DIR"); own && *own) folder = own;
    else if (const char* xdg = std::getenv("XDG_RUNTIME_DIR"); xdg && *xdg) folder = std::string(xdg) + "/sorma";
    else folder = "/tmp/sorma-" + std::to_string(getuid());
    if (mkdir(folder.c_str(), 0700) < 0 && errno != EEXIST) fail(kFolder, folder, std::strerror(errno));
    struct stat s;
    if (lstat(folder.c_str(), &s) < 0) fail(kFolder, folder, std::strerror(errno));
    if (!S_ISDIR(s.st_mode)) fail(kFolder, folder, "is not a folder");
    if (s.st_uid != geteuid()) fail(kFolder, folder, "belongs to another user");
    if (s.st_mode & 066) fail(kFolder, folder, s.st_mode & 022 ? "others may write to it" : "others may look into it");
    return folder;
}

std::string runtimeSocket(const std::string& name) { return runtimeFolder() + "/" + name + std::string(kSocketEnding); }

std::vector<std::string> namesIn(const std::string& folder, std::string_view ending) {
    std::vector<std::string> found;
    std::unique_ptr<DIR, int (*)(DIR*)> dir(opendir(folder.c_str()), closedir);
    while (dirent* e = dir ? readdir(dir.get()) : nullptr) {
        std::string_view file = e->d_name;
        if (file.size() > ending.size() && file.ends_with(ending)) found.emplace_back(file.substr(0, file.size() - ending.size()));
    }
    std::sort(found.begin(), found.end());
    return found;
}

}  // namespace sorma
