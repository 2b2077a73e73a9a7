#include "tcl/anonymous.h"

#include "bus/glob.h"
#include "tcl/soCommand.h"
#include "tcl/tclService.h"

namespace sorma {

namespace {

const Prototype kTaken{Severity::error, "SERVICE EXISTS", 1, "{}: there is a command of that name already"};
const Prototype kName{Severity::error, "NAME SYNTAX", 1, "bad command \"{}\" for an object of class {}: {}"};

constexpr std::string_view kNew = "::sorma::obj::";     // commands that new makes

// The command as it is called from anywhere.
std::string fullName(Interpreter& i, const std::string& className, const std::string& given) {
    if (given.empty() || given.ends_with("::")) fail(kName, given, className, "it is empty");
    if (given.find('@') != std::string::npos) fail(kName, given, className, "@ stands before an address, and such an object has none");
    if (given.starts_with("::")) return given;
    const std::string space = Tcl_GetCurrentNamespace(i.interp)->fullName;
    return (space == "::" ? space : space + "::") + given;
}

void needFree(Interpreter& i, const std::string& command) {
    const bool object = command.rfind("::") == 0 && i.sorm.find(command.substr(2));
    if (object || Tcl_FindCommand(i.interp, command.c_str(), nullptr, TCL_GLOBAL_ONLY)) fail(kTaken, command);
}

std::string freeName(Interpreter& i, const std::string& className) {
    for (;;) {
        std::string command = std::string(kNew) + className + std::to_string(++i.lastObject);
        if (!Tcl_FindCommand(i.interp, command.c_str(), nullptr, TCL_GLOBAL_ONLY)) return command;
    }
}

// sorma::anonymous ?pattern?: list of {command class calls underway}
int AnonymousObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    if (objc > 2) return Tcl_WrongNumArgs(interp, 1, objv, "?pattern?"), TCL_ERROR;
    return guarded(i, objc, objv, [&] {
        const std::string pattern = objc == 2 ? toUtf8(objv[1]) : "*";
        Obj list(Tcl_NewListObj(0, nullptr));
        for (auto& [command, so] : anonymousObjects(i)) {
            if (!globMatch(pattern, command)) continue;
            Tcl_Obj* fields[] = {newText(command), newText(so->type().name()), Tcl_NewWideIntObj(Tcl_WideInt(so->calls())),
                                 Tcl_NewWideIntObj(Tcl_WideInt(so->underWay()))};
            Tcl_ListObjAppendElement(nullptr, list, Tcl_NewListObj(4, fields));
        }
        Tcl_SetObjResult(interp, list);
        return TCL_OK;
    });
}

// sorma::AnonymousObject word: {command class} of the object that it calls at global level; empty: it calls none.
int AnonymousObjectObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    if (objc != 2) return Tcl_WrongNumArgs(interp, 1, objv, "word"), TCL_ERROR;
    return guarded(i, objc, objv, [&] {
        std::string word = toUtf8(objv[1]);
        if (!word.starts_with("::")) word.insert(0, "::");
        Tcl_ResetResult(interp);
        if (Service* so = anonymousObject(i, word)) {
            Tcl_Obj* fields[] = {newText(word), newText(so->type().name())};
            Tcl_SetObjResult(interp, Tcl_NewListObj(2, fields));
        }
        return TCL_OK;
    });
}

}  // namespace

bool makesObject(Tcl_Obj* word) { return view(word) == "create" || view(word) == "new"; }

int makeByClass(Interpreter& i, const std::string& className, int objc, Tcl_Obj* const objv[]) {
    const int named = view(objv[1]) == "create" ? 1 : 0;
    i.sorm.needClass(className);
    if (const std::string tcl = tclClassOf(i, className); !tcl.empty()) {
        Obj command(newText(tcl));
        std::vector<Tcl_Obj*> words(objv, objv + objc);
        words[0] = command;
        return Tcl_EvalObjv(i.interp, objc, words.data(), 0);
    }
    if (objc < 2 + named) return Tcl_WrongNumArgs(i.interp, 2, objv, "command ?-option value ...?"), TCL_ERROR;
    const std::string command = named ? fullName(i, className, toUtf8(objv[2])) : freeName(i, className);
    needFree(i, command);
    std::string label = command;
    for (int n = 2; isBound(i, label); ++n) label = command + "#" + std::to_string(n);      // that one's command was renamed
    std::vector<std::string> words;
    for (int k = 2 + named; k < objc; ++k) words.push_back(toUtf8(objv[k]));
    Reference made = i.sorm.makeAnonymous(nullptr, label, className, words);
    try {
        if (i.closing()) return i.sorm.dismiss(made), TCL_ERROR;
        needFree(i, command);               // its birth may have run a script
    } catch (...) {
        i.sorm.dismiss(made);
        throw;
    }
    bindAnonymous(i, label, made, command);
    Tcl_SetObjResult(i.interp, newText(command));
    return TCL_OK;
}

void initAnonymous(Interpreter& i) {
    i.define("anonymous", AnonymousObjCmd);
    Tcl_CreateObjCommand(i.interp, "::sorma::AnonymousObject", AnonymousObjectObjCmd, &i, nullptr);
}

}  // namespace sorma
