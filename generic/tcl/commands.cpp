#include "tcl/commands.h"

#include <algorithm>
#include <set>
#include <span>

#include "bus/glob.h"
#include "bus/nearest.h"
#include "tcl/soCommand.h"
#include "tcl/tclService.h"

namespace sorma {

namespace {

const Prototype kSetting{Severity::error, "OPTION UNKNOWN", 1, "unknown setting \"{0}\"{2}: must be {1}"};
const Prototype kMissing{Severity::error, "OPTION MISSING", 1, "{} needs a value"};
const Prototype kNotTrusted{Severity::error, "COMM DENIED", 0, "a safe interpreter cannot grant rights; its parent can"};
const Prototype kNoChild{Severity::error, "REQUEST SYNTAX", 0, "no interpreter \"{}\""};
const Prototype kBadMethod{Severity::error, "REQUEST SYNTAX", 0, "bad method \"{}\": must be CTRL, DBX, EXEC, cget, configure, exec, or info"};
const Prototype kNotLoaded{Severity::error, "REQUEST SYNTAX", 0, "interpreter \"{}\" has no sorma yet: load {{}} Sorma {}"};

Interpreter& of(ClientData data) { return *static_cast<Interpreter*>(data); }

int wrongArgs(Tcl_Interp* interp, Tcl_Obj* const objv[], const char* usage) {
    Tcl_WrongNumArgs(interp, 1, objv, usage);
    return TCL_ERROR;
}

int setList(Tcl_Interp* interp, const std::vector<std::string>& words) {
    Tcl_Obj* list = Tcl_NewListObj(0, nullptr);
    for (auto& w : words) Tcl_ListObjAppendElement(nullptr, list, newText(w));
    Tcl_SetObjResult(interp, list);
    return TCL_OK;
}

int DispatchObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    if (objc != 2) return wrongArgs(interp, objv, "request");
    auto& i = of(data);
    return guarded(i, objc, objv, [&] {
        std::string reply;
        std::string_view request = view(objv[1]);
        std::string copy;
        bool ascii = std::all_of(request.begin(), request.end(), [](char c) { return static_cast<unsigned char>(c) < 0x80; });
        if (!ascii) request = copy = toUtf8(objv[1]);
        i.sorm.dispatch(request, reply);
        if (i.closing()) return TCL_ERROR;
        Tcl_SetObjResult(interp, newText(reply));
        return TCL_OK;
    });
}

int CreateObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    if (objc < 2) return wrongArgs(interp, objv, "name ?-option value ...?");
    auto& i = of(data);
    return guarded(i, objc, objv, [&] {
        std::vector<std::string> words;
        for (int k = 2; k < objc; ++k) words.push_back(toUtf8(objv[k]));
        std::string name = toUtf8(objv[1]);
        Reference made = i.sorm.create(name, words, nullptr);
        commandOf(i, name);
        Tcl_SetObjResult(interp, objv[1]);
        return TCL_OK;
    });
}

int RemoveObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    if (objc != 2) return wrongArgs(interp, objv, "name");
    auto& i = of(data);
    return guarded(i, objc, objv, [&] {
        i.sorm.remove(toUtf8(objv[1]), Permit::owner());
        Tcl_ResetResult(interp);
        return TCL_OK;
    });
}

int ExistsObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    if (objc != 2) return wrongArgs(interp, objv, "name");
    auto& i = of(data);
    return guarded(i, objc, objv, [&] {
        Tcl_SetObjResult(interp, i.constants.integer(i.sorm.find(toUtf8(objv[1])) != nullptr));
        return TCL_OK;
    });
}

int NamesObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    if (objc > 2) return wrongArgs(interp, objv, "?pattern?");
    auto& i = of(data);
    return guarded(i, objc, objv, [&] { return setList(interp, i.sorm.names(objc == 2 ? toUtf8(objv[1]) : "*")); });
}

// The classes that the SORM knows, and TclOO classes that have not been used yet.
int ClassesObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    if (objc > 2) return wrongArgs(interp, objv, "?pattern?");
    auto& i = of(data);
    return guarded(i, objc, objv, [&] {
        std::string pattern = objc == 2 ? toUtf8(objv[1]) : "*";
        std::set<std::string> names;
        for (auto* c : i.sorm.classes()) names.insert(c->name());
        for (auto& name : tclClassNames(i)) names.insert(name);
        std::vector<std::string> out;
        for (auto& name : names)
            if (globMatch(pattern, name)) out.push_back(name);
        return setList(interp, out);
    });
}

int CatalogueObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    if (objc > 2) return wrongArgs(interp, objv, "?pattern?");
    return guarded(of(data), objc, objv, [&] {
        std::string pattern = objc == 2 ? toUtf8(objv[1]) : "*";
        Tcl_Obj* list = Tcl_NewListObj(0, nullptr);
        Obj keep(list);
        for (auto* p : catalogue()) {
            std::string_view symbol = p->symbol;
            if (!globMatch(pattern, symbol)) continue;
            auto space = std::min(symbol.find(' '), symbol.size());
            Tcl_Obj* fields[] = {newText(symbol.substr(0, space)),
                                 newText(symbol.substr(std::min(space + 1, symbol.size()))),
                                 newText(toText(p->severity)), newText(p->text), newText(p->file), Tcl_NewWideIntObj(p->line)};
            Tcl_ListObjAppendElement(nullptr, list, Tcl_NewListObj(6, fields));
        }
        Tcl_SetObjResult(interp, list);
        return TCL_OK;
    });
}

int TrailObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    if (objc > 2) return wrongArgs(interp, objv, "?SO?");
    auto& i = of(data);
    return guarded(i, objc, objv, [&] {
        if (objc == 1) {
            Tcl_SetObjResult(interp, trailList(i.sorm.lastTrail()));
            return TCL_OK;
        }
        Message m;
        m.words = {"-info", "trail"};
        i.sorm.call(toUtf8(objv[1]), Method::dbx, m);
        Tcl_SetObjResult(interp, newText(m.text));
        return TCL_OK;
    });
}

int ConfigureObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = of(data);
    return guarded(i, objc, objv, [&] {
        auto find = [&](Tcl_Obj* word) -> const Setting& {
            std::string_view name = view(word);
            std::string known;
            for (auto& s : i.settings()) {
                if (s.name == name) return s;
                known += (known.empty() ? "" : ", ") + s.name;
            }
            std::vector<std::string> names;
            for (auto& s : i.settings()) names.push_back(s.name);
            fail(kSetting, toUtf8(word), known, didYouMean(name, names));
        };
        if (objc == 1) {
            Tcl_Obj* list = Tcl_NewListObj(0, nullptr);
            for (auto& s : i.settings()) {
                Tcl_ListObjAppendElement(nullptr, list, newText(s.name));
                Tcl_ListObjAppendElement(nullptr, list, newText(s.get()));
            }
            Tcl_SetObjResult(interp, list);
            return TCL_OK;
        }
        if (objc == 2) {
            Tcl_SetObjResult(interp, newText(find(objv[1]).get()));
            return TCL_OK;
        }
        for (int k = 1; k < objc; k += 2) find(objv[k]);
        if (objc % 2 == 0) fail(kMissing, toUtf8(objv[objc - 1]));
        // All or nothing, as with CTRL.
        std::vector<std::pair<const Setting*, std::string>> before;
        try {
            for (int k = 1; k < objc; k += 2) {
                const Setting& s = find(objv[k]);
                before.emplace_back(&s, s.get());
                s.set(toUtf8(objv[k + 1]));
            }
        } catch (...) {
            while (!before.empty()) {
                before.back().first->set(before.back().second);
                before.pop_back();
            }
            throw;
        }
        Tcl_ResetResult(interp);
        return TCL_OK;
    });
}

// sorma::grant interp ?allow|deny right ... ?on pattern ...??: what a safe interpreter may, in the words of a policy.
// Returns all that has been said so, the latest first.
int GrantObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    if (objc < 2) return wrongArgs(interp, objv, "interp ?allow|deny right ?right ...? ?on pattern ?pattern ...???");
    auto& i = of(data);
    return guarded(i, objc, objv, [&] {
        if (i.safe || Tcl_IsSafe(interp)) fail(kNotTrusted);
        std::string path = toUtf8(objv[1]);
        Tcl_Interp* child = Tcl_GetChild(interp, Tcl_GetString(objv[1]));
        if (!child || child == interp) fail(kNoChild, path);
        Interpreter* theirs = Interpreter::of(child);
        if (!theirs) fail(kNotLoaded, path, path);
        std::vector<std::string> words;
        for (int k = 2; k < objc; ++k) words.push_back(toUtf8(objv[k]));
        if (!words.empty()) theirs->sorm.access.grant(words);
        Tcl_Obj* result = Tcl_NewListObj(0, nullptr);
        for (auto& line : theirs->sorm.access.grants()) Tcl_ListObjAppendElement(nullptr, result, newText(line));
        Tcl_SetObjResult(interp, result);
        return TCL_OK;
    });
}

// sorma::KeepTrail script: evaluate a script in the caller's frame; the trail of the last request is afterwards what it was
// before. For inspectors that look around between two lines of their user.
int KeepTrailObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    if (objc != 2) return wrongArgs(interp, objv, "script");
    auto& i = of(data);
    return guarded(i, objc, objv, [&] {
        Trail before = i.sorm.lastTrail();
        int code = Tcl_EvalObjEx(interp, objv[1], 0);
        if (!i.closing()) i.sorm.setLastTrail(before);
        return code;
    });
}

// sorma::DidYouMean word known: " (did you mean -tempo?)", or nothing when no word of the list is near.
int DidYouMeanObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    if (objc != 3) return wrongArgs(interp, objv, "word known");
    return guarded(of(data), objc, objv, [&] {
        Tcl_SetObjResult(interp, newText(didYouMean(toUtf8(objv[1]), listStrings(objv[2]))));
        return TCL_OK;
    });
}

// sorma::RequestWords name method ?word ...?: METHOD and the words of a request as its object gets them, without the parts of EXEC.
int RequestWordsObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    if (objc < 3) return wrongArgs(interp, objv, "name method ?word ...?");
    return guarded(of(data), objc, objv, [&] {
        const std::string name = toUtf8(objv[1]);
        const std::string_view method = view(objv[2]);
        const std::span<Tcl_Obj* const> given(objv + 3, std::size_t(objc - 3));
        Message m;
        std::vector<std::string> words{"DBX"};
        if (method == "EXEC" || method == "CTRL" || method == "DBX") words[0] = method;
        else if (method == "exec") words[0] = "EXEC";
        else if (method == "configure" && given.size() > 1) words[0] = "CTRL";
        else if (method == "configure") words.insert(words.end(), {"-info", "options"});
        else if (method == "cget" || method == "info") words.emplace_back(method == "cget" ? "-get" : "-info");
        else fail(kBadMethod, std::string(method));
        if (method == "EXEC") readParts(name, given, m);
        else if (method == "exec") readOptions(name, given, m);
        else for (auto* o : given) m.words.push_back(toUtf8(o));
        words.insert(words.end(), m.words.begin(), m.words.end());
        return setList(interp, words);
    });
}

}  // namespace

void initCommands(Interpreter& i) {
    i.define("dispatch", DispatchObjCmd);
    i.define("create", CreateObjCmd);
    i.define("remove", RemoveObjCmd);
    i.define("exists", ExistsObjCmd);
    i.define("names", NamesObjCmd);
    i.define("classes", ClassesObjCmd);
    i.define("catalogue", CatalogueObjCmd);
    i.define("trail", TrailObjCmd);
    i.define("configure", ConfigureObjCmd);
    i.define("grant", GrantObjCmd);
    Tcl_CreateObjCommand(i.interp, "::sorma::KeepTrail", KeepTrailObjCmd, &i, nullptr);
    Tcl_CreateObjCommand(i.interp, "::sorma::RequestWords", RequestWordsObjCmd, &i, nullptr);
    Tcl_CreateObjCommand(i.interp, "::sorma::DidYouMean", DidYouMeanObjCmd, &i, nullptr);
}

}  // namespace sorma
