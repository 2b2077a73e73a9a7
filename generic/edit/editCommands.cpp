// editCommands.cpp -- the package sorma::edit as Tcl sees it. Nothing changes at the terminal before its first command
// that needs it; `detach`, and the end of the program, put everything back.
//
//     sorma::edit usable                      why no line can be edited here; empty when it can
//     sorma::edit columns                     width of the terminal, 0 when there is none
//     sorma::edit read ?-prompt text? ?-complete prefix? ?-hint prefix?
//                                             list of how (line, end or interrupt) and the line's text
//     sorma::edit hint                        make the hint again, while a line is read
//     sorma::edit wait varName                runs the event loop until the variable exists (1) or Ctrl-C is typed (0)
//     sorma::edit remember ?entry ...?        into the history
//     sorma::edit attach, detach              take the terminal's signals and guard its output; give them back
//
// -complete is called with line and cursor and returns a dict of from, words and hint, -hint with the same and returns
// text. Positions count Tcl's characters. Their errors are background errors, one for each line.
#include <memory>

#include "edit/lineEditor.h"
#include "edit/text.h"

namespace {

using namespace sorma;
using namespace sorma::edit;

struct Package {
    Tcl_Interp* interp;
    std::unique_ptr<LineEditor> editor;

    LineEditor& attached() {
        if (!editor) editor = std::make_unique<LineEditor>(interp);
        return *editor;
    }
};

LineEditor* attachedAnywhere = nullptr;     // signals and terminal are the process's

int failWith(Tcl_Interp* interp, const char* symbol, const std::string& message) {
    Tcl_SetObjResult(interp, Tcl_NewStringObj(message.data(), tclSize(message.size())));
    Tcl_SetErrorCode(interp, "SORMA", "EDIT", symbol, nullptr);
    return TCL_ERROR;
}

void restoreTerminal(ClientData data) { static_cast<Package*>(data)->editor.reset(); }

int attach(Package& p) {
    if (attachedAnywhere && attachedAnywhere != p.editor.get())
        return failWith(p.interp, "BUSY", "another interpreter of this process has the terminal");
    attachedAnywhere = &p.attached();
    return TCL_OK;
}

// Did the script end by an interrupt?
bool isCancelled(Tcl_Interp* interp) {
    Obj options(Tcl_GetReturnOptions(interp, TCL_ERROR));
    Obj key(Tcl_NewStringObj("-errorcode", -1));
    Tcl_Obj* value = nullptr;
    Tcl_DictObjGet(nullptr, options, key, &value);
    return value && view(value).starts_with("TCL CANCEL");
}

// Call a prefix with the line and the cursor, with the interpreter's state kept. Null after an error.
Obj ask(Package& p, const Obj& prefix, const std::wstring& line, std::size_t point, bool& broken) {
    if (broken) return {};
    Tcl_Interp* interp = p.interp;
    Tcl_InterpState state = Tcl_SaveInterpState(interp, TCL_OK);
    Obj command(Tcl_DuplicateObj(prefix));
    Tcl_ListObjAppendElement(nullptr, command, newText(line));
    Tcl_ListObjAppendElement(nullptr, command, Tcl_NewWideIntObj(tclLength(std::wstring_view(line).substr(0, point))));
    Obj result;
    if (Tcl_EvalObjEx(interp, command, TCL_EVAL_GLOBAL | TCL_EVAL_DIRECT) == TCL_OK) {
        result = Tcl_GetObjResult(interp);
    } else if (isCancelled(interp)) {
        p.editor->interrupt();
    } else {
        broken = true;
        Tcl_BackgroundException(interp, TCL_ERROR);
    }
    Tcl_RestoreInterpState(interp, state);
    return result;
}

LineEditor::Completion completionOf(const Obj& dict, const std::wstring& line) {
    LineEditor::Completion out;
    if (!dict) return out;
    auto field = [&](const char* key) {
        Tcl_Obj* value = nullptr;
        Obj name(Tcl_NewStringObj(key, -1));
        Tcl_DictObjGet(nullptr, dict, name, &value);
        return value;
    };
    int from = 0;
    if (Tcl_Obj* o = field("from"); o && Tcl_GetIntFromObj(nullptr, o, &from) == TCL_OK && from >= 0)
        out.from = tclPrefix(line, from).size();
    Tcl_Size n = 0;
    Tcl_Obj** words = nullptr;
    if (Tcl_Obj* o = field("words"); o && Tcl_ListObjGetElements(nullptr, o, &n, &words) == TCL_OK)
        for (Tcl_Size k = 0; k < n; ++k) out.words.push_back(toWide(words[k]));
    return out;
}

int ReadCmd(Package& p, int objc, Tcl_Obj* const objv[]) {
    static const char* const options[] = {"-complete", "-hint", "-prompt", nullptr};
    Obj values[3];
    if (objc % 2 != 0) {
        Tcl_WrongNumArgs(p.interp, 2, objv, "?-prompt text? ?-complete prefix? ?-hint prefix?");
        return TCL_ERROR;
    }
    for (int k = 2; k < objc; k += 2) {
        int index;
        if (Tcl_GetIndexFromObj(p.interp, objv[k], options, "option", 0, &index) != TCL_OK) return TCL_ERROR;
        values[index] = objv[k + 1];
    }
    if (std::string why = LineEditor::unusable(); !why.empty()) return failWith(p.interp, "TERMINAL", why);
    if (attach(p) != TCL_OK) return TCL_ERROR;
    LineEditor& editor = *p.editor;
    if (editor.busy()) return failWith(p.interp, "BUSY", "a line is being read already");
    bool broken = false;
    auto complete = [&](const std::wstring& line, std::size_t point) {
        return completionOf(ask(p, values[0], line, point, broken), line);
    };
    auto hint = [&](const std::wstring& line, std::size_t point) {
        Obj text = ask(p, values[1], line, point, broken);
        return text ? toWide(text) : std::wstring();
    };
    std::wstring line;
    auto how = editor.read(values[2] ? toWide(values[2]) : L"% ", values[0] ? LineEditor::Complete(complete) : nullptr,
                           values[1] ? LineEditor::Hint(hint) : nullptr, line);
    const char* word = how == LineEditor::How::line ? "line" : how == LineEditor::How::end ? "end" : "interrupt";
    Tcl_Obj* result[] = {Tcl_NewStringObj(word, -1), newText(line)};
    Tcl_SetObjResult(p.interp, Tcl_NewListObj(2, result));
    return TCL_OK;
}

int WaitCmd(Package& p, int objc, Tcl_Obj* const objv[]) {
    if (objc != 3) {
        Tcl_WrongNumArgs(p.interp, 2, objv, "varName");
        return TCL_ERROR;
    }
    if (attach(p) != TCL_OK) return TCL_ERROR;
    bool there = false, interrupted = false;
    {
        Signals::Waiting waiting(p.editor->signals);
        while (true) {
            there = Tcl_GetVar2Ex(p.interp, Tcl_GetString(objv[2]), nullptr, TCL_GLOBAL_ONLY) != nullptr;
            if (there || interrupted) break;
            Tcl_DoOneEvent(TCL_ALL_EVENTS);
            interrupted = p.editor->signals.interrupted();
        }
    }
    Tcl_SetObjResult(p.interp, Tcl_NewWideIntObj(there));
    return TCL_OK;
}

int EditObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& p = *static_cast<Package*>(data);
    static const char* const words[] = {"attach", "columns", "detach", "hint", "read", "remember", "usable", "wait", nullptr};
    enum { attachWord, columnsWord, detachWord, hintWord, readWord, rememberWord, usableWord, waitWord };
    int word;
    if (objc < 2) {
        Tcl_WrongNumArgs(interp, 1, objv, "subcommand ?arg ...?");
        return TCL_ERROR;
    }
    if (Tcl_GetIndexFromObj(interp, objv[1], words, "subcommand", 0, &word) != TCL_OK) return TCL_ERROR;
    if (word == readWord) return ReadCmd(p, objc, objv);
    if (word == waitWord) return WaitCmd(p, objc, objv);
    if (word == rememberWord) {
        if (attach(p) != TCL_OK) return TCL_ERROR;
        for (int k = 2; k < objc; ++k) p.editor->remember(toWide(objv[k]));
        return TCL_OK;
    }
    if (objc != 2) {
        Tcl_WrongNumArgs(interp, 2, objv, nullptr);
        return TCL_ERROR;
    }
    if (word == attachWord) return attach(p);
    if (word == columnsWord) {
        Tcl_SetObjResult(interp, Tcl_NewWideIntObj(LineEditor::columns()));
    } else if (word == hintWord) {
        if (p.editor) p.editor->renewHint();
    } else if (word == detachWord) {
        if (p.editor && (p.editor->busy() || p.editor->signals.waiting())) return failWith(interp, "BUSY", "another command waits for a line or a variable");
        if (p.editor) attachedAnywhere = nullptr;
        p.editor.reset();
    } else {
        std::string why = LineEditor::unusable();
        Tcl_SetObjResult(interp, Tcl_NewStringObj(why.data(), tclSize(why.size())));
    }
    return TCL_OK;
}

void deleted(ClientData data) {
    auto* p = static_cast<Package*>(data);
    // A callback has deleted the interpreter that waits for it: what waits stands on this, and is left to the end.
    if (p->editor && p->editor->signals.waiting()) return;
    if (p->editor) attachedAnywhere = nullptr;
    Tcl_DeleteExitHandler(restoreTerminal, p);
    delete p;
}

}  // namespace

extern "C" DLLEXPORT int Sormaedit_Init(Tcl_Interp* interp) {
    if (!Tcl_InitStubs(interp, "8.6-", 0)) return TCL_ERROR;
    if (!Tcl_FindNamespace(interp, "::sorma", nullptr, 0)) Tcl_CreateNamespace(interp, "::sorma", nullptr, nullptr);
    auto* p = new Package{interp, nullptr};
    Tcl_CreateExitHandler(restoreTerminal, p);
    Tcl_CreateObjCommand(interp, "::sorma::edit", EditObjCmd, p, deleted);
    return Tcl_PkgProvideEx(interp, "sorma::edit", "1.0", nullptr);
}
