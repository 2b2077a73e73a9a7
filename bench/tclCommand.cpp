// tclCommand.cpp -- calls of a service object from a script, in this process.
#include "rows.h"

#include <cstring>

#include "interpreter.h"

namespace bench {

namespace {

const std::vector<Case> kCases = {
    {"T", "Tcl command: nop EXEC", "bare C command with sub-command look-up", 1.5, 0, 0, Interpreter::kUnrolled},
    {"T10", "Tcl command: echo EXEC FMSG 10 x ...", "bare C command, 10 doubles in, list of 14 out", 1.5, 0, 0,
     Interpreter::kUnrolled},
};

const char* const kMethods[] = {"EXEC", "CTRL", "DBX", "exec", "configure", "cget", "info", "destroy", nullptr};

// Shared by the floors: the values that every reply has.
struct Words {
    sorma::Obj ret{Tcl_NewStringObj("RET", -1)}, zero{Tcl_NewWideIntObj(0)}, fmsg{Tcl_NewStringObj("FMSG", -1)};
    sorma::Obj done;
    Words() {
        Tcl_Obj* both[] = {ret, zero};
        done = Tcl_NewListObj(2, both);
    }
};

// floorNop EXEC
int FloorNopObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    int method;
    if (objc < 2 || Tcl_GetIndexFromObj(interp, objv[1], kMethods, "method", TCL_EXACT, &method) != TCL_OK) return TCL_ERROR;
    Tcl_SetObjResult(interp, static_cast<Words*>(data)->done);
    return TCL_OK;
}

// floorTen EXEC FMSG 10 x1 ... x10
int FloorTenObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& words = *static_cast<Words*>(data);
    int method, n;
    if (objc != 14 || Tcl_GetIndexFromObj(interp, objv[1], kMethods, "method", TCL_EXACT, &method) != TCL_OK ||
        std::strcmp(Tcl_GetString(objv[2]), "FMSG") != 0 || Tcl_GetIntFromObj(interp, objv[3], &n) != TCL_OK || n != 10)
        return TCL_ERROR;
    Tcl_Obj* out[14] = {words.ret, words.zero, words.fmsg, objv[3]};
    double values[10];
    for (int i = 0; i < 10; ++i)
        if (Tcl_GetDoubleFromObj(interp, objv[i + 4], &values[i]) != TCL_OK) return TCL_ERROR;
    for (int i = 0; i < 10; ++i) out[i + 4] = Tcl_NewDoubleObj(values[i]);
    Tcl_SetObjResult(interp, Tcl_NewListObj(14, out));
    return TCL_OK;
}

}  // namespace

void tclCommand(Table& table) {
    if (!table.wantsAny(kCases)) return;
    Words words;
    Interpreter interpreter;
    Tcl_CreateObjCommand(interpreter.tcl(), "floorNop", FloorNopObjCmd, &words, nullptr);
    Tcl_CreateObjCommand(interpreter.tcl(), "floorTen", FloorTenObjCmd, &words, nullptr);

    auto measure = [&](const Case& of, const std::string& call, const std::string& floorCall) {
        if (interpreter.eval(call) != interpreter.eval(floorCall))
            throw std::runtime_error(call + " does not give what its floor gives");
        std::string row = interpreter.loop(call), floor = interpreter.loop(floorCall);
        auto body = [&](const std::string& loop) -> Body {
            return [&interpreter, loop](std::int64_t count) {
                std::int64_t start = now();
                interpreter.run(loop, count);
                return now() - start;
            };
        };
        table.measure(of, body(row), body(floor));
    };
    measure(kCases[0], "nop EXEC", "floorNop EXEC");
    std::string ten = " EXEC FMSG 10";
    for (int i = 0; i < 10; ++i) ten += " " + std::to_string(i) + ".125";
    measure(kCases[1], "echo" + ten, "floorTen" + ten);
}

}  // namespace bench
