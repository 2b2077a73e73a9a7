// checks.h -- what a program of checks says, and its groups: runGroups runs the one that its first argument names, else all.
//
// Each failed check is one line; the last line is "N passed, N failed". Exit code 0 when none failed.
#pragma once

#include <cstdio>
#include <cstring>
#include <exception>
#include <string>
#include <type_traits>

inline int passed = 0, failed = 0;

inline void note(bool good, int line, const std::string& what) {
    ++(good ? passed : failed);
    if (!good) std::printf("line %d: %s\n", line, what.c_str());
}
// Both as text: strings, or numbers.
template <class T> std::string asText(const T& value) {
    if constexpr (std::is_arithmetic_v<T>) return std::to_string(value);
    else return std::string(value);
}
template <class A, class B> void same(const A& is, const B& wanted, int line) {
    const std::string i = asText(is), w = asText(wanted);
    note(i == w, line, "\"" + i + "\", not \"" + w + "\"");
}
#define CHECK(condition) note((condition), __LINE__, #condition)
#define EQUAL(is, wanted) same((is), (wanted), __LINE__)

struct Group {
    const char* name;
    void (*run)();
};

template <class Groups> int runGroups(const Groups& groups, int argc, char** argv) {
    for (const Group& group : groups) {
        if (argc > 1 && std::strcmp(argv[1], group.name) != 0) continue;
        try {
            group.run();
        } catch (const std::exception& e) {
            note(false, 0, std::string(group.name) + " threw: " + e.what());
        }
    }
    std::printf("%d passed, %d failed\n", passed, failed);
    return failed > 0 || passed == 0;
}
