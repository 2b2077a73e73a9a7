#include "tcl/tclServiceParts.h"

#include <algorithm>

#include "bus/bookkeeping.h"
#include "tcl/soCommand.h"

namespace sorma {

using namespace tcloo;

namespace {

const Prototype kElsewhere{Severity::error, "COMM DENIED", 2,
                           "{}: {} {} is elsewhere; of a class in Tcl only the daemon's own user may choose such an object"};

}  // namespace

TclService::TclService(Interpreter& i, Tcl_Class type, std::vector<Value> initial)
    : interpreter_(i), values_(std::move(initial)) {
    std::string className = objectName(i.interp, Tcl_GetClassAsObject(type));
    KeepState keep(i.interp);
    ++i.constructing;
    object_ = Tcl_NewObjectInstance(i.interp, type, nullptr, nullptr, 0, nullptr, 0);
    --i.constructing;
    if (!object_) fail(kStep, "the constructor of " + className, toUtf8(Tcl_GetObjResult(i.interp)));
    Tcl_ObjectSetMetadata(object_, &kObjectData, this);
    my_ = str(std::string(Tcl_GetObjectNamespace(object_)->fullName) + "::my");
}

TclService::TclService(Interpreter& i, Tcl_Object object, std::vector<Value> initial)
    : interpreter_(i), object_(object), anonymous_(true), values_(std::move(initial)) {
    Tcl_ObjectSetMetadata(object_, &kObjectData, this);
    my_ = str(std::string(Tcl_GetObjectNamespace(object_)->fullName) + "::my");
}

TclService::~TclService() {
    if (!name().empty()) {
        auto known = interpreter_.tclServices.find(name());
        if (known != interpreter_.tclServices.end() && known->second == this) interpreter_.tclServices.erase(known);
    }
    removed();
}

void TclService::removed() {
    Tcl_Object object = std::exchange(object_, nullptr);
    if (!object) return;
    Tcl_ObjectSetMetadata(object, &kObjectData, nullptr);
    if (!Tcl_ObjectDeleted(object)) Tcl_DeleteCommandFromToken(interpreter_.interp, Tcl_GetObjectCommand(object));
}

void TclService::objectDeleted() {
    if (!object_) return;
    object_ = nullptr;
    if (interpreter_.closing() || gone() || name().empty()) return;
    if (anonymous_) {
        Reference keep(this);
        sorm().dismiss(keep);
        return releaseAnonymous(interpreter_, name());
    }
    try {
        if (sorm().find(name()) == this) sorm().remove(name(), Permit::owner());
    } catch (...) {     // it is not in the repository any more
    }
}

void TclService::setValue(std::size_t option, const Value& value) {
    values_[option] = value;
}

// Tcl code calls the object by its name, as the owner: so nobody else may name one that is elsewhere.
void TclService::setService(std::size_t option, Reference r) {
    if (r && r->isElsewhere() && sorm().find(r->name()) != r.get())
        fail(kElsewhere, name(), type().options()[option].name, r->name());
    services_.resize(values_.size());
    values_[option] = r ? r->name() : std::string();
    services_[option] = std::move(r);
}

Obj TclService::call(std::string_view method, std::span<Tcl_Obj* const> args, Message* message) const {
    Interpreter& i = interpreter_;
    Tcl_Interp* interp = i.interp;
    if (i.closing()) fail(kInterpGone, name());
    if (!object_) fail(kObjectGone, name());
    Obj command(my_), word(str(method));
    constexpr std::size_t kOnStack = 8;
    Tcl_Obj* few[kOnStack];
    std::vector<Tcl_Obj*> many;
    Tcl_Obj** objv = few;
    std::size_t n = args.size() + 2;
    if (n > kOnStack) {
        many.resize(n);
        objv = many.data();
    }
    objv[0] = command;
    objv[1] = word;
    std::copy(args.begin(), args.end(), objv + 2);

    Message unheard;
    if (!message) message = &unheard;
    Executing executing(i, {const_cast<TclService*>(this), message});
    int code = Tcl_EvalObjv(interp, int(n), objv, TCL_EVAL_GLOBAL);
    if (i.closing()) fail(kInterpGone, name());
    if (code == TCL_OK) {
        Obj result(Tcl_GetObjResult(interp));
        Tcl_ResetResult(interp);
        return result;
    }
    Trail trail = message->trail;
    trail.append(trailOfTclError(i, code, name(), type()));
    throw Error(std::move(trail));
}

void TclService::removing() {
    // Requests that wait end here: deleting their coroutines unwinds them.
    Interpreter& i = interpreter_;
    if (i.closing()) return;
    std::vector<std::pair<std::string, std::shared_ptr<TclRun>>> mine;
    for (auto& [coroutine, run] : i.runs)
        if (run->service == this && run->reply) mine.emplace_back(coroutine, run);
    for (auto& [coroutine, run] : mine) {
        Tcl_DeleteCommand(i.interp, coroutine.c_str());
        i.runs.erase(coroutine);
        run->reply.fail(Error(makeEntry(kObjectGone, {MessageArg::of(name())})));
    }
}

void TclService::born() {
    interpreter_.tclServices.insert_or_assign(name(), this);
    call("born", {}, nullptr);
}

static Obj namesOf(std::span<const Option* const> options) {
    Obj list(Tcl_NewListObj(0, nullptr));
    for (auto* o : options) Tcl_ListObjAppendElement(nullptr, list, str(o->name));
    return list;
}

void TclService::changed(std::span<const Option* const> options) {
    Obj list = namesOf(options);
    Tcl_Obj* args[] = {list};
    call("changed", args, nullptr);
}

bool TclService::settles() {
    if (!settles_ && object_) {
        KeepState keep(interpreter_.interp);
        settles_ = false;
        if (eval(interpreter_, {str("::info"), str("object"), str("methods"), str(command()), str("-all")}))
            for (auto& method : listStrings(Tcl_GetObjResult(interpreter_.interp))) settles_ = *settles_ || method == "settle";
    }
    return settles_.value_or(false);
}

void TclService::settle(std::span<const Option* const> options, Message& m) {
    if (!settles()) return;
    const std::vector<std::string> names{toUtf8(namesOf(options))};
    act("settle", names, m);
}

void TclService::store(std::span<const std::pair<std::size_t, Value>> values, bool settling) {
    std::vector<const Option*> fresh;
    for (auto& [option, value] : values) {
        if (values_[option] == value) continue;
        values_[option] = value;
        noteFound(*this, option, value, settling);
        fresh.push_back(&type().options()[option]);
    }
    if (!fresh.empty() && sorm().announces()) sorm().announceChange(*this, fresh);
}

void TclService::answerSelftest(Message& m) { act("selftest", {}, m); }

void TclService::dumpState(std::string& out) const {
    std::string lines = toUtf8(call("dump", {}, nullptr));
    for (std::size_t at = 0; at < lines.size();) {
        std::size_t end = std::min(lines.find('\n', at), lines.size());
        std::string_view line(lines.data() + at, end - at);
        at = end + 1;
        if (line.empty()) continue;
        if (!out.empty() && out.back() != '\n') out += '\n';
        if (line[0] != '#') out += "# ";
        out += line;
    }
}

std::string TclService::command() const { return object_ ? objectName(interpreter_.interp, object_) : std::string(); }

std::string labelOfObject(Interpreter& i, std::string_view command) {
    KeepState keep(i.interp);
    Obj word(str(command));
    Tcl_Object object = Tcl_GetObjectFromObj(i.interp, word);
    if (!object || !eval(i, {str("::info"), str("object"), str("isa"), str("typeof"), word, str("::sorma::Service")})) return {};
    if (view(Tcl_GetObjResult(i.interp)) != "1") return {};
    return serviceOf(i, object).name();
}

Service* anonymousTclObject(Interpreter& i, const std::string& command) {
    KeepState keep(i.interp);
    Obj word(str(command));
    Tcl_Object object = Tcl_GetObjectFromObj(i.interp, word);
    auto* service = object ? static_cast<TclService*>(Tcl_ObjectGetMetadata(object, &kObjectData)) : nullptr;
    return service && service->name().starts_with("::") ? service : nullptr;
}

void tclServiceRemoved(Interpreter& interpreter, const std::string& name) {
    auto known = interpreter.tclServices.find(name);
    if (known == interpreter.tclServices.end()) return;
    TclService* service = known->second;
    if (!service->gone()) return;           // only a second name was removed
    interpreter.tclServices.erase(known);
    service->removed();
}

bool initTclServices(Interpreter& i) {
    if (!initMethods(i)) return false;
    initRuns(i);
    initDeclarations(i);
    Tcl_ResetResult(i.interp);
    return true;
}

}  // namespace sorma
