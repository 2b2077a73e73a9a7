// errorPlace.h -- where in a source file a Tcl error has happened, from its stack trace.
//
// Tcl says only which method, and on which line of its body. Where that body stands is found by looking for it in the file of its
// class; it is known only when it stands there once.
#pragma once

#include <functional>
#include <string>
#include <string_view>

namespace sorma {

struct ErrorPlace {
    std::string className, method;
    int line = 0;               // of the method's body, from 1; 0: no method is named
};

// The innermost method of a class that errorInfo names, of those that `known` accepts.
ErrorPlace innermostMethod(std::string_view errorInfo, const std::function<bool(const std::string& className)>& known);

// The line of the source on which a line of the body stands. 0: the body is not there, or more than once.
int lineOfBody(std::string_view source, std::string_view body, int line);

}  // namespace sorma
