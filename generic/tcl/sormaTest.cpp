// sormaTest.cpp -- commands for tests and measurements only; never installed.
//
//     sormatest::bare word          a C command with a sub-command look-up: what `nop EXEC` is measured against
//     sormatest::ten word n x1..x10 a C command that reads ten doubles and returns a list of ten: `echo EXEC FMSG 10 ...`
//     sormatest::repeat n word...   evaluates a command n times from C, returns nanoseconds for each
//     sormatest::allocations n word...   ... returns how often C++ allocated meanwhile. It counts when this library was
//                                   there before libstdc++ (LD_PRELOAD); Tcl's own values come from malloc, uncounted
//     sormatest::become user        from now on this process is another user's; only root may
#include <grp.h>
#include <pwd.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <new>

#include "tcl/tclShim.h"

namespace {

std::size_t allocations = 0;        // of this process's only thread that matters; a test looks at nothing else

void* allocate(std::size_t size) {
    ++allocations;
    if (void* memory = std::malloc(size ? size : 1)) return memory;
    throw std::bad_alloc();
}

}  // namespace

void* operator new(std::size_t size) { return allocate(size); }
void* operator new[](std::size_t size) { return allocate(size); }
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t) noexcept { std::free(memory); }

namespace {

int BareObjCmd(ClientData, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    static const char* const names[] = {"EXEC", "CTRL", "DBX", "exec", "configure", "cget", "info", "destroy", nullptr};
    int index;
    if (objc < 2) return TCL_ERROR;
    return Tcl_GetIndexFromObj(interp, objv[1], names, "method", TCL_EXACT, &index);
}

int TenObjCmd(ClientData, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    if (objc != 11) return TCL_ERROR;
    Tcl_Obj* out[10];
    double value;
    for (int i = 0; i < 10; ++i) {
        if (Tcl_GetDoubleFromObj(interp, objv[i + 1], &value) != TCL_OK) return TCL_ERROR;
        out[i] = Tcl_NewDoubleObj(value);
    }
    Tcl_SetObjResult(interp, Tcl_NewListObj(10, out));
    return TCL_OK;
}

// The command behind a count, so many times.
int repeat(Tcl_Interp* interp, int objc, Tcl_Obj* const objv[], int& n) {
    if (objc < 3) {
        Tcl_WrongNumArgs(interp, 1, objv, "count word ?word ...?");
        return TCL_ERROR;
    }
    if (Tcl_GetIntFromObj(interp, objv[1], &n) != TCL_OK || n < 1) return TCL_ERROR;
    for (int i = 0; i < n; ++i)
        if (Tcl_EvalObjv(interp, objc - 2, objv + 2, 0) != TCL_OK) return TCL_ERROR;
    return TCL_OK;
}

int RepeatObjCmd(ClientData, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    int n = 1;
    auto start = std::chrono::steady_clock::now();
    if (repeat(interp, objc, objv, n) != TCL_OK) return TCL_ERROR;
    auto passed = std::chrono::steady_clock::now() - start;
    Tcl_SetObjResult(interp, Tcl_NewDoubleObj(std::chrono::duration<double, std::nano>(passed).count() / n));
    return TCL_OK;
}

int AllocationsObjCmd(ClientData, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    int n = 1;
    std::size_t before = allocations;
    if (repeat(interp, objc, objv, n) != TCL_OK) return TCL_ERROR;
    Tcl_SetObjResult(interp, Tcl_NewWideIntObj(Tcl_WideInt(allocations - before)));
    return TCL_OK;
}

int BecomeObjCmd(ClientData, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    if (objc != 2) {
        Tcl_WrongNumArgs(interp, 1, objv, "user");
        return TCL_ERROR;
    }
    const passwd* user = getpwnam(Tcl_GetString(objv[1]));
    if (user && setgroups(1, &user->pw_gid) == 0 && setgid(user->pw_gid) == 0 && setuid(user->pw_uid) == 0) return TCL_OK;
    Tcl_SetObjResult(interp, Tcl_NewStringObj(user ? "only root may become another user" : "there is no such user", -1));
    return TCL_ERROR;
}

}  // namespace

extern "C" DLLEXPORT int Sormatest_Init(Tcl_Interp* interp) {
    if (!Tcl_InitStubs(interp, "8.6-", 0)) return TCL_ERROR;
    Tcl_CreateNamespace(interp, "::sormatest", nullptr, nullptr);
    Tcl_CreateObjCommand(interp, "::sormatest::bare", BareObjCmd, nullptr, nullptr);
    Tcl_CreateObjCommand(interp, "::sormatest::ten", TenObjCmd, nullptr, nullptr);
    Tcl_CreateObjCommand(interp, "::sormatest::repeat", RepeatObjCmd, nullptr, nullptr);
    Tcl_CreateObjCommand(interp, "::sormatest::allocations", AllocationsObjCmd, nullptr, nullptr);
    Tcl_CreateObjCommand(interp, "::sormatest::become", BecomeObjCmd, nullptr, nullptr);
    return Tcl_PkgProvideEx(interp, "sormatest", "1.0", nullptr);
}
