#include "cache.h"

#include <unistd.h>

#include <fstream>

#include "bus/catalogue.h"
#include "bus/fnv.h"
#include "bus/wholeFile.h"
#include "comm/keys.h"
#include "comm/runtimeFolder.h"
#include "json.h"

namespace etcd {

// Fails when there is no folder that is ours alone.
std::string Cache::file() const {
    sorma::Fnv<> hash;
    hash.add(directory_.data(), directory_.size());
    return sorma::runtimeFolder() + "/directory-" + std::to_string(hash.value()) + ".cache";
}

Cache::Head Cache::read(std::string* json) const try {
    const std::string path = file();
    if (!sorma::keys::exposed(path).empty()) return {};
    std::ifstream in(path);
    std::string line;
    std::getline(in, line);
    const Json first = Json::parse(line);
    if (first["directory"].text() != directory_) return {};
    if (json) std::getline(in, *json);
    return {first["revision"].number(), first["heard"].number()};
} catch (const sorma::Error&) {
    return {};
}

void Cache::write(const Head& head, const std::string& json) const try {
    const std::string path = file();
    if (!sorma::keys::exposed(path).empty()) unlink(path.c_str());      // replacing keeps a file's mode
    sorma::replaceFile(path, "{\"directory\":" + quoted(directory_) + ",\"revision\":\"" + std::to_string(head.revision) + "\",\"heard\":\"" +
                       std::to_string(head.heard) + "\"}\n" + json + "\n", 0600);
} catch (const sorma::Error&) {
}

}  // namespace etcd
