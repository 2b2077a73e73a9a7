// authorsFile.h -- who wrote the entries of a dictionary's file.
//
// FILE.authors stands beside FILE, and only the owner may read it. Each line has a hash of an entry, its word included, and the
// author, if that is not the owner. An entry that somebody has edited since has another hash, and so is the owner's.
//
// Errors: DICT FILE.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "bus/principal.h"

namespace sorma {

class AuthorsFile {
public:
    // Read FILE.authors, if there is one.   file: the dictionary's. Fails also when others than the owner may have written it.
    explicit AuthorsFile(const std::string& file);

    // The author of an entry of these words, as the file said when it was read; null: the owner.
    PrincipalPointer of(std::string_view word, const std::vector<std::string>& words) const;

    // For the next version of the file, which has these authors alone.
    void note(std::string_view word, const std::vector<std::string>& words, const PrincipalPointer& author);
    // Write that version, before and after the dictionary itself is written. All old lines stay until then. So no entry loses its
    // author when this process ends in between. Both do nothing when nothing has changed.
    void writeBefore() const;
    void writeAfter() const;

private:
    using Lines = std::map<std::string, std::string, std::less<>>;      // author by hash

    void write(const Lines& lines) const;

    const std::string path_;
    Lines lines_, now_;                 // as read; of the next version
};

}  // namespace sorma
