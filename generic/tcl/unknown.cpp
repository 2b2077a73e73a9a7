#include "tcl/unknown.h"

#include <memory>

#include "tcl/anonymous.h"
#include "tcl/soCommand.h"
#include "tcl/waiting.h"

namespace sorma {

namespace {

using Objects = Tcl_Obj* const*;

const Prototype kEmpty{Severity::error, "NAME EMPTY", 0, "the name before {} is empty; does an option of type service name nobody?"};

const Prototype kNoMethod{Severity::error, "REQUEST SYNTAX", 0, "wrong # args: should be \"{} method ?word ...?\""};

// The meaning of an unknown command word.
struct Mention {
    std::string name;       // empty: nothing
    bool certain = false;   // it can be nothing else: it has an address or is in our namespace
    bool slip = false;      // CLASS.FLAVOR without a method of ours: an object if there is such a class, and no program of that name
};

Mention mentioned(int objc, Objects objv) {
    Mention out;
    std::string_view word = view(objv[0]);
    auto strip = [&](std::string_view prefix) {
        if (!word.starts_with(prefix)) return false;
        word.remove_prefix(prefix.size());
        return true;
    };
    out.certain = strip(kSoNamespace) || strip(kSoNamespace.substr(2));
    if (!out.certain) strip("::");
    bool address = word.find('@') != std::string_view::npos;
    out.certain = out.certain || address;
    if (!address && word.find("::") != std::string_view::npos) return out;
    out.slip = !out.certain && word.find('.') != std::string_view::npos && Name::isName(std::string(word)) && (objc < 2 || !isSoMethod(objv[1]));
    if (!out.certain && !out.slip && (objc < 2 || (!isSoMethod(objv[1]) && (word.empty() || !makesObject(objv[1]))))) return out;
    if (word.empty()) fail(kEmpty, toUtf8(objv[1]));
    out.name = word;
    return out;
}

int invalidCommand(Tcl_Interp* interp, Tcl_Obj* word) {
    Tcl_SetObjResult(interp, Tcl_ObjPrintf("invalid command name \"%s\"", Tcl_GetString(word)));
    Tcl_SetErrorCode(interp, "TCL", "LOOKUP", "COMMAND", Tcl_GetString(word), nullptr);
    return TCL_ERROR;
}

// Our own error, kept until the handler before ours was tried.
struct Unanswered {
    Interpreter* interpreter;
    Trail trail;
    std::string request, word;
};

int afterPrevious(ClientData data[], Tcl_Interp* interp, int code) {
    auto* words = static_cast<Tcl_Obj*>(data[0]);
    auto* unanswered = static_cast<Unanswered*>(data[1]);
    if (unanswered) {
        if (code == TCL_ERROR && !Tcl_InterpDeleted(interp) &&
            view(Tcl_GetObjResult(interp)) == "invalid command name \"" + unanswered->word + "\"")
            code = unanswered->interpreter->raise(std::move(unanswered->trail), unanswered->request);
        delete unanswered;
    }
    Tcl_DecrRefCount(words);
    return code;
}

// Call the handler before us as if we were not there: without a frame or a line of our own in the error trace. No C stack lies in
// between, so the procedures that it loads may yield.
int previousHandler(Interpreter& i, Tcl_Interp* interp, int objc, Objects objv, Unanswered* unanswered) {
    Tcl_Obj* words;
    if (i.previousUnknown) {
        words = Tcl_DuplicateObj(i.previousUnknown);
    } else if (Tcl_FindCommand(interp, "::unknown", nullptr, TCL_GLOBAL_ONLY)) {
        Tcl_Obj* handler = Tcl_NewStringObj("::unknown", -1);
        words = Tcl_NewListObj(1, &handler);
    } else {
        int code = invalidCommand(interp, objv[0]);
        if (unanswered) {
            code = i.raise(std::move(unanswered->trail), unanswered->request);
            delete unanswered;
        }
        return code;
    }
    Tcl_IncrRefCount(words);
    for (int k = 0; k < objc; ++k) Tcl_ListObjAppendElement(nullptr, words, objv[k]);
    Tcl_Size n;
    Tcl_Obj** all;
    Tcl_ListObjGetElements(nullptr, words, &n, &all);
    Tcl_NRAddCallback(interp, afterPrevious, words, unanswered, nullptr, nullptr);
    return Tcl_NREvalObjv(interp, int(n), all, TCL_EVAL_NOERR);
}

int UnknownNRCmd(ClientData data, Tcl_Interp* interp, int objc, Objects objv) {
    Interpreter& i = *static_cast<Interpreter*>(data);
    if (objc < 2) {
        Tcl_WrongNumArgs(interp, 1, objv, "name ?word ...?");
        return TCL_ERROR;
    }
    --objc;
    ++objv;
    Unanswered* unanswered = nullptr;
    {
        Interpreter::Entered entered(i);
        Mention mention;
        try {
            mention = mentioned(objc, objv);
            if (!mention.name.empty()) {
                if (!Name::isName(mention.name)) {
                    mention.certain = false;
                    Name::parse(mention.name);      // fails, and says what is wrong with it
                }
                const bool method = objc > 1 && isSoMethod(objv[1]);
                if (!method && objc > 1 && makesObject(objv[1]) && mention.name.find_first_of(".@") == std::string::npos) {
                    i.sorm.needClass(mention.name);
                    mention.certain = true;
                    return makeByClass(i, mention.name, objc, objv);
                }
                if (!method) {                      // no connection is made for a slip of the pen
                    if (mention.slip) i.sorm.needClass(Name::parse(mention.name).className);
                    if (objc > 1) badMethod(objv[1]);
                    if (mention.slip) fail(kNoMethod, mention.name);
                    Tcl_WrongNumArgs(interp, 1, objv, "method ?word ...?");
                    return TCL_ERROR;
                }
                // In a coroutine nothing may block, not even the first mention of a remote object.
                return callByName(i, mention.name, objc, objv, view(coroutineName(i)).empty() ? Probe::now : Probe::later);
            }
        } catch (const Error& e) {
            Trail trail = trailOfCurrentException({});
            std::string request = requestAsTyped(mention.name, objc, objv);
            bool nobodys = e.is("NAME UNKNOWN_CLASS") || e.is("NAME SYNTAX") || e.is("ADDRESS UNRESOLVED") || e.is("COMM DENIED");
            if (mention.certain || !(nobodys || mention.slip)) return i.raise(std::move(trail), request);
            // Many a word of Tcl has such a method: what we say of it would mislead.
            if (mention.slip ? !nobodys : !makesObject(objv[1])) unanswered = new Unanswered{&i, std::move(trail), std::move(request), std::string(view(objv[0]))};
        } catch (...) {
            return i.raise(trailOfCurrentException({}), commandText(objc, objv));
        }
        if (i.closing()) {
            delete unanswered;
            return TCL_ERROR;
        }
    }
    return previousHandler(i, interp, objc, objv, unanswered);
}

int UnknownObjCmd(ClientData data, Tcl_Interp* interp, int objc, Objects objv) {
    return Tcl_NRCallObjProc(interp, UnknownNRCmd, data, objc, objv);
}

}  // namespace

void initUnknown(Interpreter& i) {
    Tcl_NRCreateCommand(i.interp, "::sorma::Unknown", UnknownObjCmd, UnknownNRCmd, &i, nullptr);
    if (Tcl_EvalEx(i.interp, "::namespace eval :: {::namespace unknown}", -1, TCL_EVAL_GLOBAL) == TCL_OK) {
        Obj before(Tcl_GetObjResult(i.interp));
        std::string_view text = view(before);
        if (!text.empty() && text != "::unknown") i.previousUnknown = Tcl_DuplicateObj(before);
    }
    Tcl_EvalEx(i.interp, "::namespace eval :: {::namespace unknown ::sorma::Unknown}", -1, TCL_EVAL_GLOBAL);
}

}  // namespace sorma
