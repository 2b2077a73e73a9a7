// where.h -- a place in the source, for messages.
//
// What std::source_location is for, of which clang 14 has only the name: taken as a default argument it tells file
// and line of the caller.
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
