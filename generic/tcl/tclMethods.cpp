#include "tcl/tclServiceParts.h"

#include "bus/nearest.h"
#include "tcl/soCommand.h"
#include "tcl/tclServiceScript.h"
#include "tcl/waiting.h"

namespace sorma {

using namespace tcloo;

namespace {

const Prototype kNoService{Severity::error, "SERVICE FAILED", 0,
                           "{} is no service object yet: its constructor has not returned; do this in method born"};
const Prototype kNotRunning{Severity::error, "SERVICE FAILED", 0, "{} works only in a method of a service class"};
const Prototype kSymbol{Severity::error, "REQUEST SYNTAX", 0, "bad code \"{}\": must be AREA SYMBOL ?detail ...?"};
const Prototype kNoStore{Severity::error, "OPTION VALUE", 2, "{}: {} names an object, only a request may set it"};
const Prototype kNoOption{Severity::error, "OPTION UNKNOWN", 2, "{}: unknown option \"{}\"{}: must be {}"};

// sorma::fail {AREA SYMBOL ?detail ...?} text, and sorma::warn: the entry names this line of Tcl.
Entry entryOf(Interpreter& i, Severity severity, Tcl_Obj* code, Tcl_Obj* text) {
    auto words = listStrings(code);
    if (words.size() >= 3 && words[0] == "SORMA") words.erase(words.begin());
    if (words.size() < 2) fail(kSymbol, toUtf8(code));
    Entry e = makeEntry(kTcl, {});
    e.severity = severity;
    e.symbol = words[0] + " " + words[1];
    e.details.assign(words.begin() + 2, words.end());
    e.text = toUtf8(text);
    e.file.clear();
    e.line = 0;
    if (auto running = runningNow(i); running.service) e.so = running.service->name();
    auto run = currentRun(i);
    whereAmI(i, e.file, e.line, run ? bool(run->reply) : !view(coroutineName(i)).empty());
    if (e.file.empty() && run && run->service) {        // Tcl 9 knows no file either for a body that came in a variable
        e.file = run->service->type().file();
        e.line = run->service->type().line();
    }
    return e;
}

int FailObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    Interpreter::Entered entered(i);
    try {
        if (objc != 3) return wrongArgs(interp, objv, "{AREA SYMBOL ?detail ...?} text");
        throw Error(entryOf(i, Severity::error, objv[1], objv[2]));
    } catch (...) {
        // No request text: what reproduces the failure is the request to the service, which its caller enters.
        return i.raise(trailOfCurrentException({}), {});
    }
}

int WarnObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        bool verbose = objc == 4 && view(objv[1]) == "-verbose";
        if (objc != 3 && !verbose) return wrongArgs(interp, objv, "?-verbose? {AREA SYMBOL ?detail ...?} text");
        auto running = runningNow(i);
        if (!running.message) fail(kNotRunning, "sorma::warn");
        running.message->trail.add(
            entryOf(i, verbose ? Severity::verbose : Severity::warning, objv[objc - 2], objv[objc - 1]));
        return TCL_OK;
    });
}

// A TclOO object that a script has made becomes a service object at its first request. It is called by its
// command, as long as the command exists; it has no name for others.
TclService& makeAnonymous(Interpreter& i, Tcl_Object object) {
    std::string label = objectName(i.interp, object);
    if (i.constructing > 0 || Tcl_ObjectDeleted(object)) fail(kNoService, label);
    KeepState keep(i.interp);
    if (!eval(i, {str("::info"), str("object"), str("class"), str(label)})) fail(kNoService, label);
    std::string type = toUtf8(Tcl_GetObjResult(i.interp));
    std::vector<Value> initial;
    for (auto* c : lineage(i, type))
        for (auto& d : c->options) initial.push_back(d.initial);
    const std::string plain = label;
    for (int n = 2; isBound(i, label); ++n) label = plain + "#" + std::to_string(n);     // the command was renamed, and another one made
    auto fresh = std::make_unique<TclService>(i, object, std::move(initial));
    TclService& service = *fresh;
    bindAnonymous(i, label, i.sorm.makeAnonymous(std::move(fresh), label, serviceName(type)));
    return service;
}

}  // namespace

// The service object of a TclOO object.
TclService& tcloo::serviceOf(Interpreter& i, Tcl_Object object) {
    auto* service = static_cast<TclService*>(Tcl_ObjectGetMetadata(object, &kObjectData));
    if (!service) return makeAnonymous(i, object);
    if (service->name().empty()) fail(kNoService, objectName(i.interp, object));
    return *service;
}

namespace {

// The service object of the object whose method runs.
TclService& self(Tcl_ObjectContext context, Interpreter& i) { return serviceOf(i, Tcl_ObjectContextObject(context)); }

// A word that an object of a service class does not know: requests are for its service object.
int UnknownOfObject(ClientData data, Tcl_Interp* interp, Tcl_ObjectContext context, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    int skip = int(Tcl_ObjectContextSkippedArgs(context));
    if (objc <= skip || !isSoMethod(objv[skip])) return Tcl_ObjectContextInvokeNext(interp, context, objc, objv, skip);
    return guarded(i, objc, objv, [&] { return callByName(i, self(context, i).name(), objc - skip + 1, objv + skip - 1); });
}

// Fails when it has no such option.
std::size_t optionAt(TclService& s, Tcl_Obj* name) {
    const std::string word = toUtf8(name);
    int index = s.type().findOption(word);
    if (index >= 0) return std::size_t(index);
    std::string known;
    std::vector<std::string> names;
    for (auto& o : s.type().options()) known += (known.empty() ? "" : ", ") + o.name, names.push_back(o.name);
    fail(kNoOption, s.name(), word, didYouMean(word, names), known.empty() ? "(this class has no options)" : known);
}

int CgetMethod(ClientData data, Tcl_Interp* interp, Tcl_ObjectContext context, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        int skip = int(Tcl_ObjectContextSkippedArgs(context));
        if (objc != skip + 1) return Tcl_WrongNumArgs(interp, skip, objv, "-option"), TCL_ERROR;
        TclService& s = self(context, i);
        const std::size_t index = optionAt(s, objv[skip]);
        Value value = s.value(index);
        if (s.type().options()[index].type == Type::service) {
            auto& name = std::get<std::string>(value);
            if (!name.empty()) i.sorm.needUse(s.author(s.type().options()[index].name), name, s.name());
            Tcl_SetObjResult(interp, newText(name.empty() ? name : commandOf(i, name)));
        } else {
            Tcl_SetObjResult(interp, newValue(value));
        }
        return TCL_OK;
    });
}

int ConfigureMethod(ClientData data, Tcl_Interp* interp, Tcl_ObjectContext context, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        int skip = int(Tcl_ObjectContextSkippedArgs(context));
        if (objc < skip + 2) return Tcl_WrongNumArgs(interp, skip, objv, "-option value ?-option value ...?"), TCL_ERROR;
        Reference s(&self(context, i));
        Message m;
        for (int k = skip; k < objc; ++k) m.words.push_back(toUtf8(objv[k]));
        s->invoke(Method::ctrl, m);
        return TCL_OK;
    });
}

int StoreMethod(ClientData data, Tcl_Interp* interp, Tcl_ObjectContext context, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        int skip = int(Tcl_ObjectContextSkippedArgs(context));
        if ((objc - skip) % 2) return Tcl_WrongNumArgs(interp, skip, objv, "?-option value ...?"), TCL_ERROR;
        TclService& s = self(context, i);
        std::vector<std::pair<std::size_t, Value>> values;
        for (int k = skip; k < objc; k += 2) {
            const std::size_t index = optionAt(s, objv[k]);
            auto& o = s.type().options()[index];
            if (o.type == Type::service) fail(kNoStore, s.name(), o.name);
            values.emplace_back(index, o.parse(s.name(), toUtf8(objv[k + 1])));
        }
        auto run = currentRun(i);
        s.store(values, run && run->settles && run->service == &s);
        return TCL_OK;
    });
}

int PublishMethod(ClientData data, Tcl_Interp* interp, Tcl_ObjectContext context, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        int skip = int(Tcl_ObjectContextSkippedArgs(context));
        if (objc < skip + 1)
            return Tcl_WrongNumArgs(interp, skip, objv, "event ?-text text? ?-floats list? ?-ints list? ?-any bytes? ?word ...?"), TCL_ERROR;
        Message m;
        readOptions(self(context, i).name(), {objv + skip + 1, std::size_t(objc - skip - 1)}, m, "publish event");
        InCoroutine request(i, coroutineName(i));       // whose number the event carries
        self(context, i).tell(toUtf8(objv[skip]), m);
        return TCL_OK;
    });
}

int NameMethod(ClientData data, Tcl_Interp* interp, Tcl_ObjectContext context, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        int skip = int(Tcl_ObjectContextSkippedArgs(context));
        if (objc != skip) return Tcl_WrongNumArgs(interp, skip, objv, nullptr), TCL_ERROR;
        Tcl_SetObjResult(interp, newText(self(context, i).name()));
        return TCL_OK;
    });
}

// The command of a service class is also its first service object: `carry EXEC ...` where ::carry is the TclOO class.
// Words that it does not know come here; whatever is no request of ours goes on to the handler of all objects.
int UnknownOfClass(ClientData data, Tcl_Interp* interp, Tcl_ObjectContext context, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    int skip = int(Tcl_ObjectContextSkippedArgs(context));
    if (objc <= skip || !isSoMethod(objv[skip])) return Tcl_ObjectContextInvokeNext(interp, context, objc, objv, skip);
    return guarded(i, objc, objv, [&] {
        std::string name = serviceName(objectName(interp, Tcl_ObjectContextObject(context)));
        return callByName(i, name, objc - skip + 1, objv + skip - 1);
    });
}

constexpr Tcl_MethodType kCget = {TCL_OO_METHOD_VERSION_CURRENT, "sorma::cget", CgetMethod, nullptr, nullptr};
constexpr Tcl_MethodType kConfigure = {TCL_OO_METHOD_VERSION_CURRENT, "sorma::configure", ConfigureMethod, nullptr, nullptr};
constexpr Tcl_MethodType kName = {TCL_OO_METHOD_VERSION_CURRENT, "sorma::name", NameMethod, nullptr, nullptr};
constexpr Tcl_MethodType kPublish = {TCL_OO_METHOD_VERSION_CURRENT, "sorma::publish", PublishMethod, nullptr, nullptr};
constexpr Tcl_MethodType kStore = {TCL_OO_METHOD_VERSION_CURRENT, "sorma::store", StoreMethod, nullptr, nullptr};
constexpr Tcl_MethodType kUnknownOfObject = {TCL_OO_METHOD_VERSION_CURRENT, "sorma::unknown", UnknownOfObject, nullptr, nullptr};
constexpr Tcl_MethodType kUnknownOfClass = {TCL_OO_METHOD_VERSION_CURRENT, "sorma::unknown", UnknownOfClass, nullptr, nullptr};

int AdoptObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    Tcl_Object object = objc == 2 ? Tcl_GetObjectFromObj(interp, objv[1]) : nullptr;
    if (Tcl_Class type = object ? Tcl_GetObjectAsClass(object) : nullptr) declarationsOf(*static_cast<Interpreter*>(data), type);
    return TCL_OK;
}

}  // namespace

// A class learns it when it becomes a service class: other classes of the program stay as they are.
void tcloo::answerRequests(Interpreter& i, Tcl_Object object) {
    Tcl_NewInstanceMethod(i.interp, object, Obj(str("unknown")), 0, &kUnknownOfClass, &i);
}

bool tcloo::initMethods(Interpreter& i) {
    Tcl_Interp* interp = i.interp;
    if (Tcl_EvalEx(interp, kScript, -1, TCL_EVAL_GLOBAL) != TCL_OK) return false;
    Tcl_Object root = Tcl_GetObjectFromObj(interp, Obj(str("::sorma::Service")));
    Tcl_Class service = root ? Tcl_GetObjectAsClass(root) : nullptr;
    if (!service) return false;
    auto addMethod = [&](const char* name, bool exported, const Tcl_MethodType* method) {
        Tcl_NewMethod(interp, service, Obj(str(name)), exported, method, &i);
    };
    addMethod("cget", true, &kCget);
    addMethod("configure", true, &kConfigure);
    addMethod("name", true, &kName);
    addMethod("publish", false, &kPublish);
    addMethod("store", false, &kStore);
    addMethod("unknown", false, &kUnknownOfObject);
    i.define("fail", FailObjCmd);
    i.define("warn", WarnObjCmd);
    Tcl_CreateObjCommand(interp, "::sorma::tcloo::Adopt", AdoptObjCmd, &i, nullptr);
    return true;
}

}  // namespace sorma
