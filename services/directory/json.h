// json.h -- reads and writes the JSON of etcd's gateway, by nlohmann's library. A look-up of what is not there gives an empty value.
//
// Threads: any.
#pragma once

#include <cstdint>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace etcd {

// A value in a text that was read; it keeps all of it.
class Json {
public:
    // Not JSON: an empty one, as for null.
    static Json parse(std::string_view text);
    Json operator[](std::string_view name) const;       // a member of an object; an empty one when there is none
    std::vector<Json> items() const;                    // of an array
    std::string text() const;                           // a string; a number or true as written; of all else nothing
    std::int64_t number() const;                        // etcd writes those of 64 bits as strings. 0: it is none
    bool empty() const;                                 // nothing, null, false, "", [] or {}

private:
    std::shared_ptr<const nlohmann::json> all_;
    const nlohmann::json* at_ = nullptr;                // within it; null: nothing is there
};

std::string quoted(std::string_view text);          // as a JSON string
std::string base64(std::string_view bytes);         // the same, in base64, as etcd takes keys and values
std::string plain(const std::string& base64);       // back; empty when malformed

}  // namespace etcd
