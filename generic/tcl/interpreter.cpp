#include "tcl/interpreter.h"

#include <algorithm>

#include "bus/call.h"
#include "bus/kept.h"
#include "bus/requestText.h"
#include "tcl/soCommand.h"
#include "tcl/tclService.h"

namespace sorma {

namespace {

constexpr const char* kKey = "sorma";

const Prototype kInteger{Severity::error, "OPTION VALUE", 1, "{} expects {}{}, got \"{}\""};
const Prototype kRange{Severity::error, "OPTION RANGE", 1, "{} {} is outside {} .. {}{}"};
const Prototype kPackage{Severity::error, "SERVICE PACKAGE", 1, "service class \"{}\" cannot be loaded: {}"};

}  // namespace

// Restores two global variables, in which a search for a missing package leaves its error.
class KeepErrorVariables {
public:
    explicit KeepErrorVariables(Tcl_Interp* interp) : interp_(interp) {
        for (int k = 0; k < 2; ++k) before_[k] = Tcl_GetVar2Ex(interp, kNames[k], nullptr, TCL_GLOBAL_ONLY);
    }
    ~KeepErrorVariables() {
        if (Tcl_InterpDeleted(interp_)) return;
        for (int k = 0; k < 2; ++k)
            if (before_[k]) Tcl_SetVar2Ex(interp_, kNames[k], nullptr, before_[k], TCL_GLOBAL_ONLY);
            else Tcl_UnsetVar2(interp_, kNames[k], nullptr, TCL_GLOBAL_ONLY);
    }
    KeepErrorVariables(const KeepErrorVariables&) = delete;
    KeepErrorVariables& operator=(const KeepErrorVariables&) = delete;

private:
    static constexpr const char* kNames[] = {"errorInfo", "errorCode"};
    Tcl_Interp* interp_;
    Obj before_[2];
};

Interpreter::Interpreter(Tcl_Interp* i, bool isSafe) : interp(i), safe(isSafe), sorm(this), missing_(i) {
    if (safe) sorm.access.restrict();
    sorm.bindTo(interp);
    Tcl_SetAssocData(interp, kKey, deleted, this);
    addInteger("-traillimit", "entries", "longest trail of a request; the oldest verbose entries go first (whole process)",
               1, 1'000'000, [] { return std::int64_t(Trail::limit()); }, [](std::int64_t n) { Trail::setLimit(std::size_t(n)); });
    addInteger("-strict", "", "1: a name makes an object only if its flavor is in the dictionary, or its class takes any", 0, 1,
               [this] { return std::int64_t(sorm.strict); }, [this](std::int64_t n) { sorm.strict = n != 0; });
}

Interpreter::~Interpreter() {
    closed_ = true;
    while (!endings_.empty()) {
        auto action = std::move(endings_.back());
        endings_.pop_back();
        try {
            action();
        } catch (...) {     // no caller could get the error
        }
    }
    releaseBindings(*this);
}

Interpreter* Interpreter::of(Tcl_Interp* interp) { return static_cast<Interpreter*>(Tcl_GetAssocData(interp, kKey, nullptr)); }

void Interpreter::deleted(ClientData data, Tcl_Interp*) {
    auto* self = static_cast<Interpreter*>(data);
    self->closed_ = true;
    self->due_ = true;
    if (self->depth_ == 0) delete self;
}

void Interpreter::whenIdle(std::function<void()> action) {
    if (depth_ == 0) return action();
    waiting_.push_back(std::move(action));
    due_ = true;
}

// The actions may make calls, and add more actions.
void Interpreter::idle() {
    ++depth_;
    while (!waiting_.empty()) {
        auto actions = std::move(waiting_);
        waiting_.clear();
        for (auto& action : actions) action();
    }
    --depth_;
    due_ = closed_;
    if (closed_) delete this;
}

void Interpreter::define(const char* name, Tcl_ObjCmdProc* proc) {
    std::string full = std::string("::sorma::") + name;
    Tcl_CreateObjCommand(interp, full.c_str(), proc, this, nullptr);
    Tcl_Export(interp, Tcl_FindNamespace(interp, "::sorma", nullptr, 0), name, 0);
}

void Interpreter::add(Setting setting) {
    auto after = std::find_if(settings_.begin(), settings_.end(), [&](auto& s) { return s.name > setting.name; });
    settings_.insert(after, std::move(setting));
}

void Interpreter::addInteger(std::string name, std::string unit, std::string help, std::int64_t low, std::int64_t high,
                             std::function<std::int64_t()> get, std::function<void(std::int64_t)> set) {
    std::string ofUnit = unit.empty() ? std::string() : " of " + unit, inUnit = unit.empty() ? std::string() : " " + unit;
    auto text = [get = std::move(get)] { return std::to_string(get()); };
    auto take = [=, set = std::move(set)](const std::string& value) {
        std::int64_t n = 0;
        const bool flag = low == 0 && high == 1, number = parseNumber(value, n);
        if (!number || (flag && (n < low || n > high))) fail(kInteger, name, flag ? "0 or 1" : "a whole number", ofUnit, value);
        if (n < low || n > high) fail(kRange, name, n, low, high, inUnit);
        set(n);
    };
    add({name, std::move(unit), std::move(help), std::move(text), std::move(take)});
}

int Interpreter::raise(Trail trail, const std::string& request) noexcept {
    if (closing()) return TCL_ERROR;
    try {
        for (auto& e : trail.entries())
            if (e.request.empty()) e.request = sorm.masked(request);
        const Entry* cause = trail.cause();
        Tcl_ResetResult(interp);
        if (cause) {
            Tcl_SetObjResult(interp, newText(cause->text));
            Tcl_SetObjErrorCode(interp, errorCode(*cause));
        }
        Obj info(newText("\n" + trail.toText()));
        Tcl_AppendObjToErrorInfo(interp, info);
        sorm.setLastTrail(trail);
    } catch (...) {
        Tcl_SetObjResult(interp, Tcl_NewStringObj("out of memory", -1));
    }
    return TCL_ERROR;
}

// ---- Host ----

bool Interpreter::loadClass(const std::string& name) {
    if (closing()) return false;
    KeepState keep(interp);
    KeepErrorVariables keepVariables(interp);
    if (registerTclClass(*this, name)) return true;
    std::string package = "sorma::service::" + name;
    if (name.size() > kKeptName || missing_.has(package)) return false;
    sorm.access.need(nullptr, Right::files, package, name);
    Obj words[] = {Tcl_NewStringObj("::package", -1), Tcl_NewStringObj("require", -1), newText(package)};
    Tcl_Obj* objv[] = {words[0], words[1], words[2]};
    if (Tcl_EvalObjv(interp, 3, objv, TCL_EVAL_GLOBAL) == TCL_OK) {
        if (!sorm.findClass(name)) registerTclClass(*this, name);       // the package may define a TclOO class
        return true;
    }
    std::string message = toUtf8(Tcl_GetObjResult(interp));
    if (message != "can't find package " + package) fail(kPackage, name, message);
    missing_.add(package);
    // Tcl has made an entry for the name all the same, and keeps it.
    words[1] = newText("forget");
    Tcl_Obj* forget[] = {words[0], words[1], words[2]};
    Tcl_EvalObjv(interp, 3, forget, TCL_EVAL_GLOBAL);
    return false;
}

// Without modules that hold classes of other names, and without what this build has left out; pkgIndex.tcl tells both.
std::vector<std::string> Interpreter::classNames() {
    if (closing()) return {};
    KeepState keep(interp);
    std::vector<std::string> out = tclClassNames(*this);
    constexpr const char* kNames = "::apply {{} {lmap package [lsearch -all -inline -glob [package names] sorma::service::*] {"
                                   "if {[package versions $package] eq {0.1} || [package versions sorma::module::[namespace tail $package]] ne {}} continue; "
                                   "namespace tail $package}}}";
    if (Tcl_EvalEx(interp, kNames, -1, TCL_EVAL_GLOBAL) != TCL_OK) return out;
    Obj names(Tcl_GetObjResult(interp));
    for (auto& name : listStrings(names)) out.push_back(name);
    return out;
}

// The folders of auto_path; the list stays short.
std::string Interpreter::classPlaces() {
    constexpr std::size_t kLongest = 300;
    Tcl_Obj* path = closing() || safe ? nullptr : Tcl_GetVar2Ex(interp, "auto_path", nullptr, TCL_GLOBAL_ONLY);
    if (!path) return {};
    std::string out;
    for (auto& folder : listStrings(path)) {
        if (out.size() + folder.size() > kLongest) return out + ", ...";
        out += (out.empty() ? "" : ", ") + folder;
    }
    return out;
}

void Interpreter::removed(const std::string& name) {
    if (closing()) return;
    tclServiceRemoved(*this, name);
    deleteCommands(*this, name);
}

void Interpreter::providePackage(const char* package, const char* version) {
    if (!closing()) Tcl_PkgProvideEx(interp, package, version, nullptr);
}

void Interpreter::report(const std::string& message) {
    if (!closing()) Tcl_SetObjResult(interp, newText(message));
}

bool Interpreter::turn(std::int64_t until) {
    if (closing()) return false;
    std::int64_t left = std::max<std::int64_t>(until - monotonicNow(), 0) / 1'000'000 + 1;
    Tcl_TimerToken timer = Tcl_CreateTimerHandler(int(std::min<std::int64_t>(left, 3'600'000)), [](ClientData) {}, nullptr);
    KeepState keep(interp);
    CallContext::Fresh fresh;
    Tcl_DoOneEvent(TCL_ALL_EVENTS);
    Tcl_DeleteTimerHandler(timer);
    return true;
}

void runScript(Interpreter& i, Tcl_Obj* script) {
    Obj keep(script);
    if (i.closing()) return;
    Interpreter::Kept kept(i);
    if (Tcl_EvalObjEx(i.interp, script, TCL_EVAL_GLOBAL) != TCL_OK && !i.closing()) Tcl_BackgroundException(i.interp, TCL_ERROR);
}

void callBack(Interpreter& i, Tcl_Obj* prefix, std::initializer_list<Tcl_Obj*> words) {
    std::vector<Obj> keep(words.begin(), words.end());
    if (i.closing() || view(prefix).empty()) return;
    Obj command(Tcl_DuplicateObj(prefix));
    for (auto* w : words)
        if (Tcl_ListObjAppendElement(i.interp, command, w) != TCL_OK) return Tcl_BackgroundException(i.interp, TCL_ERROR);
    runScript(i, command);
}

std::string commandText(int objc, Tcl_Obj* const objv[]) {
    constexpr std::size_t kLongest = 4096;
    std::string out;
    for (int i = 0; i < objc && out.size() < kLongest; ++i) appendWord(out, view(objv[i]));
    if (out.size() > kLongest) out.resize(kLongest);
    while (!out.empty() && !isUtf8(out)) out.pop_back();
    return out;
}

}  // namespace sorma
