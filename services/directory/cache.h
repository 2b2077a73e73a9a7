// cache.h -- what a directory has said, in a file of the runtime folder, for processes that begin while it is away.
//
// All processes of this user share the file. Its first line is JSON: directory, revision, heard. The second is JSON of the directory's own.
// Nobody else can read it. When it or its folder is wrong, there is none, and everything else works.
//
// Threads: any.
#pragma once

#include <cstdint>
#include <string>

namespace etcd {

class Cache {
public:
    explicit Cache(std::string directory) : directory_(std::move(directory)) {}     // which one, as describe() says
    struct Head {
        std::int64_t revision = 0;      // 0: there is no file
        std::int64_t heard = 0;         // [us, wallNow] when the directory has last said that this is true
    };
    Head read(std::string* json = nullptr) const;       // null: reads the first line alone
    void write(const Head& head, const std::string& json) const;

private:
    std::string file() const;

    const std::string directory_;
};

}  // namespace etcd
