#include "tcl/eventLoops.h"

#include <memory>
#include <vector>

#include "bus/call.h"

namespace sorma {

namespace {

struct Wrapped {
    Tcl_ObjCmdProc* proc;
    ClientData data;
    Interpreter& interpreter;
};

int FreshObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    Wrapped original = *static_cast<Wrapped*>(data);        // the interpreter may end while it runs
    CallContext::Fresh fresh;
    return original.proc(original.data, interp, objc, objv);
}

int LoadObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    Wrapped original = *static_cast<Wrapped*>(data);
    Interpreter::Entered entered(original.interpreter);     // keeps it until we have returned
    int code = original.proc(original.data, interp, objc, objv);
    if (!original.interpreter.closing()) wrapEventLoops(original.interpreter);
    return code;
}

void wrap(Interpreter& i, const char* name, Tcl_ObjCmdProc* around) {
    Tcl_CmdInfo info;
    if (!Tcl_GetCommandInfo(i.interp, name, &info) || !info.isNativeObjectProc || !info.objProc || info.objProc == around) return;
    auto original = std::make_shared<Wrapped>(Wrapped{info.objProc, info.objClientData, i});
    info.objProc = around;
    info.objClientData = original.get();
    if (Tcl_SetCommandInfo(i.interp, name, &info)) i.atEnd([original] {});
}

}  // namespace

void wrapEventLoops(Interpreter& i) {
    for (auto* name : {"::vwait", "::update", "::tkwait"}) wrap(i, name, FreshObjCmd);
    wrap(i, "::load", LoadObjCmd);
}

}  // namespace sorma
