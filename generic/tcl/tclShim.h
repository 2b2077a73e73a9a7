// tclShim.h -- hides the differences between Tcl 8.6 and Tcl 9 from our sources. Include it instead of tcl.h.
#pragma once

#include <climits>
#include <cstddef>
#include <string_view>
#include <utility>

#include <tcl.h>
#include <tclOO.h>

#ifndef TCL_SIZE_MAX                // Tcl 8.6 has none of these
typedef int Tcl_Size;
#define TCL_SIZE_MAX INT_MAX
#endif
#ifndef Tcl_GetChild
#define Tcl_GetChild Tcl_GetSlave   // 8.6 before .11
#endif

namespace sorma {

#if TCL_MAJOR_VERSION < 9
using TclFreeArg = char*;           // type of the argument of a Tcl_FreeProc
#else
using TclFreeArg = void*;
#endif

// A length as Tcl takes it. Throws std::length_error when it is too large for this Tcl (2 GB in 8.6).
Tcl_Size tclSize(std::size_t n);

// A counted reference to a Tcl value; may be null. Use it only in the thread of the value.
class Obj {
public:
    Obj() = default;
    Obj(Tcl_Obj* o) : o_(o) {
        if (o_) Tcl_IncrRefCount(o_);
    }
    Obj(const Obj& other) : Obj(other.o_) {}
    Obj(Obj&& other) noexcept : o_(std::exchange(other.o_, nullptr)) {}
    Obj& operator=(Obj other) noexcept {
        std::swap(o_, other.o_);
        return *this;
    }
    ~Obj() {
        if (o_) Tcl_DecrRefCount(o_);
    }
    operator Tcl_Obj*() const { return o_; }
    explicit operator bool() const { return o_ != nullptr; }

private:
    Tcl_Obj* o_ = nullptr;
};

// The value's text in Tcl's encoding, which is not quite UTF-8 (see convert.h). Valid as long as the value is not changed or
// freed.
inline std::string_view view(Tcl_Obj* o) {
    if (o->bytes) return {o->bytes, std::size_t(o->length)};
    Tcl_Size n;
    const char* text = Tcl_GetStringFromObj(o, &n);
    return {text, std::size_t(n)};
}

}  // namespace sorma
