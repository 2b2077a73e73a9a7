// wholeFile.h -- a file that is read whole, and replaced whole.
//
// A reader finds the old text or the new one, also after a crash. A temporary file of the same folder gets the new text. It is
// synchronized, and then renamed.
//
// Errors: DICT FILE, with the file, what could not be done, and why.
#pragma once

#include <sys/types.h>

#include <string>
#include <string_view>

namespace sorma {

// The path of a file without links and dots, as policies name it. If the file does not exist, its folder's path and its
// name.
std::string realPath(const std::string& file);

// Append the file's bytes to text, 64 MiB at most. Returns false when the file does not exist and mayLack is true.
bool readFile(const std::string& file, bool mayLack, std::string& text);

// Mode and owner stay, and a symbolic link stays one.   mode: of a file that did not exist, less the umask.
void replaceFile(const std::string& file, std::string_view text, mode_t mode = 0666);

// verb: "read", "write", "trust", "remove".   why: the reason, and the way out where there is one
[[noreturn]] void failFile(const std::string& file, const char* verb, const char* why);

}  // namespace sorma
