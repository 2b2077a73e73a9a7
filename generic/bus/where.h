// where.h -- a place in the source, for messages.
//
// As a default argument it is the file and line of the caller. It replaces std::source_location, which clang 14 does not
// have.
//
//     void raise(const char* text, Where where = Where::current());
#pragma once

namespace sorma {

struct Where {
    const char* file;       // with the folders that the compiler was given
    int line;

    static constexpr Where current(const char* file = __builtin_FILE(), int line = __builtin_LINE()) { return {file, line}; }
};

}  // namespace sorma
