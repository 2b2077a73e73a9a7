// errorPlace.h -- finds the line of a source file where a Tcl error happened.
//
// Tcl's stack trace says only which method it was, and the line within its body. So the body is searched for in the file of
// its class. The line is known if the body occurs there exactly once.
//
// Threads: any; nothing here uses Tcl.
#pragma once

#include <functional>
#include <string>
#include <string_view>

namespace sorma {

struct ErrorPlace {
    std::string className, method;
    int line = 0;               // of the method's body, from 1; 0: no method is named
};

// The innermost method that errorInfo names of a class for which known() returns true.
ErrorPlace innermostMethod(std::string_view errorInfo, const std::function<bool(const std::string& className)>& known);

// The line of the source, from 1, for a line of the body. 0: the source does not have the body, or more than once.
int lineOfBody(std::string_view source, std::string_view body, int line);

}  // namespace sorma
