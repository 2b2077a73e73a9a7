// remembered.h -- values that operators have set, and that outlive the process: CTRL -remember, -forget.
//
// They stand in FILE.remembered beside the dictionary file that was loaded last, as entries of a dictionary of its own:
//
//     gain.a/-gain      2.5 2026-11-25T19:02:11.120417Z "anna@cell tclsh[77]"
//     gain.a/-remember  1 2026-11-25T18:40:02.000311Z "anna@cell tclsh[77]"
//
// An object that is made gets them after its recipe. Each value keeps its author (FILE.remembered.authors): it is set with
// that one's rights. Several processes may share the file: each writes what was set in it, while it has locked the
// dictionary's file. The file is replaced as a whole: a process that is killed leaves the old values or the new ones.
//
// Threads: the SORM's.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "bus/dictionary.h"
#include "bus/principal.h"

namespace sorma {

class Sorm;

class Remembered {
public:
    struct Value {
        std::string option, text;
        std::string by;                 // who set it, for people
        std::int64_t time = 0;          // [us since 1970]
        PrincipalPointer author;        // whose rights it has; null: the owner
    };
    static constexpr const char* kSwitch = "-remember";     // as an option: which ones are remembered

    explicit Remembered(Sorm& sorm) : sorm_(sorm) {}

    std::string file() const;                               // empty: no dictionary file is loaded
    std::vector<Value> of(std::string_view object);         // the switch is the first one
    // flush() writes what was set and forgotten, before the request is answered that has set it. It fails with DICT FILE; then
    // the next one tries again.
    void set(std::string_view object, Value value);
    void forget(std::string_view object, std::string_view option);
    void flush();

private:
    void read();

    Sorm& sorm_;
    std::string read_;                  // the file that known_ was read from, and its state then
    std::pair<std::int64_t, std::uint64_t> state_;          // [ns] of its last change, inode
    std::map<std::string, std::vector<Value>, std::less<>> known_;      // by object
    std::map<std::pair<std::string, std::string>, Value> fresh_;        // by object and option; option empty: forget it
};

}  // namespace sorma
