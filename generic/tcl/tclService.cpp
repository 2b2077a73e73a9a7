#include "tcl/tclService.h"

#include <algorithm>
#include <cctype>
#include <fstream>
#include <iterator>

#include "bus/requestText.h"
#include "tcl/commandFrame.h"
#include "tcl/errorPlace.h"
#include "tcl/soCommand.h"
#include "tcl/waiting.h"

namespace sorma {

namespace {

const Prototype kTcl{Severity::error, "SERVICE FAILED", 1, "{}: {}"};
const Prototype kStack{Severity::verbose, "SERVICE STACK", 1, "{}: {}"};
const Prototype kStep{Severity::error, "SERVICE FAILED", 0, "{} failed: {}"};
const Prototype kObjectGone{Severity::error, "SERVICE GONE", 1, "{}: its TclOO object has been destroyed"};
const Prototype kInterpGone{Severity::error, "SERVICE GONE", 1, "{}: its interpreter was deleted while it was executing"};
const Prototype kDeclaration{Severity::error, "CLASS TABLE", 0, "{}: {}"};
const Prototype kOutside{Severity::error, "CLASS TABLE", 0,
                         "{} declares a service class: use it in the body of a class, behind \"superclass sorma::Service\""};
const Prototype kNoService{Severity::error, "SERVICE FAILED", 0,
                           "{} is no service object yet: its constructor has not ended; method born is for what needs one"};
const Prototype kElsewhere{Severity::error, "COMM DENIED", 2,
                           "{}: {} {} is elsewhere; of a class in Tcl only the daemon's own user may choose such an object"};
const Prototype kNotRunning{Severity::error, "SERVICE FAILED", 0, "{} belongs into a method of a service class"};
const Prototype kNothingToCancel{Severity::error, "SERVICE FAILED", 0,
    "sorma::atCancel: no request runs here that its caller could cancel; it belongs into exec, selftest, an action or an "
    "inspection of a service class, outside of coroutines of your own"};
const Prototype kSymbol{Severity::error, "REQUEST SYNTAX", 0, "bad code \"{}\": must be AREA SYMBOL ?detail ...?"};
const Prototype kNoOption{Severity::error, "OPTION UNKNOWN", 2, "{}: unknown option \"{}\": must be {}"};

struct OptionDeclaration {
    Option option;
    Value initial;
};

}  // namespace

// What the body of a TclOO class has declared. Held by the class itself, and goes with it.
struct TclClass {
    Interpreter* interpreter = nullptr;
    Tcl_Class tcl = nullptr;            // null when the TclOO class has been destroyed
    std::string service;                // name of the service class
    std::string purpose, words, example, version, conduct;
    std::vector<OptionDeclaration> options;
    std::vector<Action> actions, inspections;
    std::vector<Part> reads, writes;
    std::string file;                   // of its first declaration
    int line = 0;
    std::string path;                   // of that file, with its folders
};

namespace {

using ClassHandle = std::shared_ptr<TclClass>;      // also held by what the SORM makes of it

// ---- metadata that ties TclOO classes and objects to ours ----

void classDeleted(ClientData data) {
    auto* handle = static_cast<ClassHandle*>(data);
    TclClass& c = **handle;
    c.tcl = nullptr;
    if (!c.interpreter->closing()) c.interpreter->sorm.forget(c.service);
    delete handle;
}
void objectDeleted(ClientData data) { static_cast<TclService*>(data)->objectDeleted(); }

const Tcl_ObjectMetadataType kClassData = {TCL_OO_METADATA_VERSION_CURRENT, "sorma::Class", classDeleted, nullptr};
const Tcl_ObjectMetadataType kObjectData = {TCL_OO_METADATA_VERSION_CURRENT, "sorma::Object", objectDeleted, nullptr};

std::string lower(std::string text) {
    for (char& c : text) c = char(std::tolower(static_cast<unsigned char>(c)));
    return text;
}

// A class of Tcl may be called anything; what no name of SORMA may hold becomes a _.
std::string serviceName(std::string_view tclClass) {
    auto at = tclClass.rfind("::");
    std::string name = lower(std::string(at == std::string_view::npos ? tclClass : tclClass.substr(at + 2)));
    for (char& c : name)
        if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
    return name;
}

std::string objectName(Tcl_Interp* interp, Tcl_Object object) { return toUtf8(Tcl_GetObjectName(interp, object)); }

void answerRequests(Interpreter& i, Tcl_Object object);

TclClass& declarationsOf(Interpreter& i, Tcl_Class type) {
    if (auto* known = static_cast<ClassHandle*>(Tcl_ClassGetMetadata(type, &kClassData))) return **known;
    auto made = std::make_shared<TclClass>();
    made->interpreter = &i;
    made->tcl = type;
    made->service = serviceName(objectName(i.interp, Tcl_GetClassAsObject(type)));
    Tcl_ClassSetMetadata(type, &kClassData, new ClassHandle(made));
    answerRequests(i, Tcl_GetClassAsObject(type));
    return *made;
}

// ---- small evaluations ----

bool eval(Interpreter& i, std::initializer_list<Tcl_Obj*> words, int flags = TCL_EVAL_GLOBAL) {
    std::vector<Obj> keep(words.begin(), words.end());
    std::vector<Tcl_Obj*> objv(words);
    return Tcl_EvalObjv(i.interp, int(objv.size()), objv.data(), flags) == TCL_OK;
}

Tcl_Obj* str(std::string_view text) { return newText(text); }

std::string tailOf(const std::string& path) {
    auto slash = path.rfind('/');
    return slash == std::string::npos ? path : path.substr(slash + 1);
}

// File and line of the command that is being evaluated, as far as Tcl knows. resumed: of a coroutine that has waited.
// Returns the file with its folders.
std::string whereAmI(Interpreter& i, std::string& file, int& line, bool resumed = false) {
    KeepState keep(i.interp);
    SormaFrame saved{};
    if (!sormaDetachFrame(i.interp, &saved) && resumed) return {};
    int code = Tcl_EvalEx(i.interp, "::info frame -1", -1, 0);
    sormaAttachFrame(&saved);
    if (code != TCL_OK) return {};
    Obj frame(Tcl_GetObjResult(i.interp));
    Obj fileKey(str("file")), lineKey(str("line"));
    Tcl_Obj* value = nullptr;
    if (Tcl_DictObjGet(nullptr, frame, fileKey, &value) != TCL_OK || !value) return {};
    std::string path = toUtf8(value);
    file = tailOf(path);
    if (Tcl_DictObjGet(nullptr, frame, lineKey, &value) == TCL_OK && value) Tcl_GetIntFromObj(nullptr, value, &line);
    return path;
}

// Classes from the root of the services down to this one, without the root.
std::vector<TclClass*> lineage(Interpreter& i, const std::string& tclClass) {
    std::vector<TclClass*> out;
    if (!eval(i, {str("::sorma::tcloo::Lineage"), str(tclClass)}))      // too deep a recursion, for instance
        fail(kStep, "the look-up of class " + tclClass, toUtf8(Tcl_GetObjResult(i.interp)));
    Obj list(Tcl_GetObjResult(i.interp));
    for (auto* name : listElements(list)) {
        Tcl_Object object = Tcl_GetObjectFromObj(i.interp, name);
        if (Tcl_Class type = object ? Tcl_GetObjectAsClass(object) : nullptr) out.push_back(&declarationsOf(i, type));
    }
    return out;
}

// ---- errors from Tcl ----

std::string errorInfoOf(Tcl_Obj* options) {
    Obj key(str("-errorinfo"));
    Tcl_Obj* value = nullptr;
    return Tcl_DictObjGet(nullptr, options, key, &value) == TCL_OK && value ? toUtf8(value) : std::string();
}

// The line of a class's file that a plain Tcl error comes from. Where that cannot be told the entry keeps the class's place.
void findPlace(Interpreter& i, const std::string& info, Entry& e) {
    TclClass* type = nullptr;
    auto place = innermostMethod(info, [&](const std::string& name) {
        Tcl_Object object = Tcl_GetObjectFromObj(i.interp, Obj(str(name)));
        Tcl_Class tcl = object ? Tcl_GetObjectAsClass(object) : nullptr;
        auto* known = tcl ? static_cast<ClassHandle*>(Tcl_ClassGetMetadata(tcl, &kClassData)) : nullptr;
        if (!known || (*known)->path.empty()) return false;
        type = known->get();
        return true;
    });
    if (!type || !eval(i, {str("::info"), str("class"), str("definition"), str(place.className), str(place.method)})) return;
    Obj definition(Tcl_GetObjResult(i.interp));
    auto words = listStrings(definition);
    std::ifstream file(type->path, std::ios::binary);
    std::string source{std::istreambuf_iterator<char>(file), {}};
    if (words.size() != 2) return;
    if (int line = lineOfBody(source, words[1], place.line)) e.file = tailOf(type->path), e.line = line;
}

// What went wrong in a method, from the interpreter's result and error options, as a trail.
Trail trailOfTclError(Interpreter& i, int code, const std::string& so, const Class& type) {
    Tcl_Interp* interp = i.interp;
    Obj message(Tcl_GetObjResult(interp));
    Obj options(Tcl_GetReturnOptions(interp, code));
    Tcl_ResetResult(interp);
    Obj key(str("-errorcode"));
    Tcl_Obj* errorCodeValue = nullptr;
    Tcl_DictObjGet(nullptr, options, key, &errorCodeValue);
    std::string text = toUtf8(message);
    std::vector<std::string> words;
    if (errorCodeValue && code == TCL_ERROR) try {
        words = listStrings(errorCodeValue);
    } catch (const Error&) {
    }
    bool ours = words.size() >= 3 && words[0] == "SORMA";
    if (ours) {
        // Raised by one of our own commands below: its trail says more than a Tcl error can.
        const Trail& last = i.sorm.lastTrail();
        if (const Entry* cause = last.cause(); cause && cause->severity == Severity::error && cause->text == text) {
            Obj lastCode(errorCode(*cause));
            if (view(lastCode) == view(errorCodeValue)) return last;
        }
    }
    Entry e = ours ? Entry{} : makeEntry(kTcl, {MessageArg::of(so), MessageArg::of(text)});
    if (ours) {
        e.symbol = words[1] + " " + words[2];
        e.details.assign(words.begin() + 3, words.end());
        e.text = text;
        e.time = makeEntry(kTcl, {}).time;
    }
    e.so = so;
    e.file = type.file();
    e.line = type.line();
    Trail trail;
    std::string info = ours ? std::string() : errorInfoOf(options);
    if (info.empty()) {
        trail.add(std::move(e));
        return trail;
    }
    // The stack trace follows the error, so that it reaches the caller wherever he is.
    constexpr std::size_t kMost = 4096;
    KeepState keep(interp);
    findPlace(i, info, e);
    if (info.size() > kMost) info.erase(std::min(info.rfind('\n', kMost), kMost)), info += "\n    ...";
    Entry stack = makeEntry(kStack, {MessageArg::of(so), MessageArg::of(info)});
    stack.so = so;
    stack.file = e.file;
    stack.line = e.line;
    trail.add(std::move(e));
    trail.add(std::move(stack));
    return trail;
}

}  // namespace

// ---- the service object ----

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

namespace {

// sorma::tcloo::Done result options: the EXEC of this coroutine has come to its end.
int DoneObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    if (objc != 4) return Tcl_WrongNumArgs(interp, 1, objv, "coroutine result options"), TCL_ERROR;
    auto found = i.runs.find(std::string(view(objv[1])));
    if (found == i.runs.end()) return TCL_OK;
    Interpreter::Entered entered(i);
    auto run = std::move(found->second);
    i.runs.erase(found);
    run->done = true;
    run->result = objv[2];
    run->options = objv[3];
    Obj key(Tcl_NewStringObj("-code", -1));
    Tcl_Obj* code = nullptr;
    if (Tcl_DictObjGet(nullptr, objv[3], key, &code) != TCL_OK || !code || Tcl_GetIntFromObj(nullptr, code, &run->code) != TCL_OK)
        run->code = TCL_ERROR;
    if (run->code == TCL_RETURN) run->code = TCL_OK;
    if (!run->reply) return TCL_OK;                 // exec() is on the stack, and sees to it
    try {
        Message& m = run->reply.message();
        if (run->service) run->service->answer(*run, m);
        run->reply.complete();
    } catch (const Error& e) {
        run->reply.fail(e);
    } catch (const std::exception& e) {
        run->reply.fail(e);
    }
    Tcl_ResetResult(interp);
    return TCL_OK;
}

std::shared_ptr<TclRun> currentRun(Interpreter& i) {
    if (i.runs.empty()) return nullptr;
    auto found = i.runs.find(toUtf8(coroutineName(i)));
    return found == i.runs.end() ? nullptr : found->second;
}

// sorma::cancelled: has the caller of this EXEC given up?   sorma::atCancel script: run it when that happens
int CancelledObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    if (objc != 1) return Tcl_WrongNumArgs(interp, 1, objv, nullptr), TCL_ERROR;
    return guarded(i, objc, objv, [&] {
        auto run = currentRun(i);
        bool cancelled = CallContext::currentCancelled() || (run && run->cancelled);
        Tcl_SetObjResult(interp, Tcl_NewWideIntObj(cancelled));
        return TCL_OK;
    });
}

int AtCancelObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    if (objc != 2) return Tcl_WrongNumArgs(interp, 1, objv, "script"), TCL_ERROR;
    return guarded(i, objc, objv, [&] {
        auto run = currentRun(i);
        if (!run) fail(kNothingToCancel);
        run->atCancel = Obj(objv[1]);
        Tcl_ResetResult(interp);
        return TCL_OK;
    });
}

}  // namespace

Interpreter::Running runningNow(Interpreter& i) {
    KeepState keep(i.interp);
    auto run = currentRun(i);
    return run ? Interpreter::Running{run->service, &run->said} : i.running;
}

InCoroutine::InCoroutine(Interpreter& i, Tcl_Obj* coroutine) {
    auto found = i.runs.empty() ? i.runs.end() : i.runs.find(std::string(view(coroutine)));
    if (found == i.runs.end()) return;
    run_ = found->second;
    new (context_) CallContext(run_->context);
}

InCoroutine::~InCoroutine() {
    if (run_) reinterpret_cast<CallContext*>(context_)->~CallContext();
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
        if (sorm().find(name()) == this) sorm().remove(name());
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

    struct Around {
        Interpreter& i;
        Interpreter::Running outer;
        Interpreter::Kept kept;
        Around(Interpreter& interpreter, Interpreter::Running running)
            : i(interpreter), outer(std::exchange(i.running, running)), kept(i) {}
        ~Around() { i.running = outer; }
    };
    Message unheard;
    if (!message) message = &unheard;
    Around around(i, {const_cast<TclService*>(this), message});
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

void TclService::exec(Message& m) {
    Interpreter& i = interpreter_;
    auto run = std::make_shared<TclRun>();
    Obj command[] = {i.constants.runExec, my_, messageDict(i.constants, m)};
    begin(run, command, m);
}

void TclService::act(const std::string& method, Args args, Message& m) {
    static constexpr const char* kRun = "::sorma::tcloo::RunMethod";
    auto run = std::make_shared<TclRun>();
    run->isExec = false;
    std::vector<Obj> command{str(kRun), my_, str(method)};
    for (auto& word : args) command.emplace_back(str(word));
    begin(run, command, m);
}

// In a coroutine of its own. When it has not come to its end, the answer is given later, by Done.
void TclService::begin(const std::shared_ptr<TclRun>& run, std::span<const Obj> command, Message& m) {
    Interpreter& i = interpreter_;
    if (i.closing()) fail(kInterpGone, name());
    if (!object_) fail(kObjectGone, name());
    run->service = this;
    run->keep = Reference(this);
    run->context = CallContext::keep();
    std::string coroutine = "::sorma::co::" + std::to_string(++i.lastRun);
    i.runs.emplace(coroutine, run);
    struct Around {
        Interpreter& i;
        Interpreter::Running outer;
        Interpreter::Kept kept;
        Around(Interpreter& interpreter, Interpreter::Running running)
            : i(interpreter), outer(std::exchange(i.running, running)), kept(i) {}
        ~Around() { i.running = outer; }
    };
    int code;
    {
        Around around(i, {this, &run->said});
        constexpr std::size_t kOnStack = 8;
        Obj name = str(coroutine);
        Tcl_Obj* few[kOnStack];
        std::vector<Tcl_Obj*> many;
        Tcl_Obj** objv = few;
        if (command.size() + 2 > kOnStack) many.resize(command.size() + 2), objv = many.data();
        objv[0] = i.constants.coroutine;
        objv[1] = name;
        std::copy(command.begin(), command.end(), objv + 2);
        code = Tcl_EvalObjv(i.interp, int(command.size() + 2), objv, TCL_EVAL_GLOBAL);
        if (i.closing()) fail(kInterpGone, this->name());
    }
    if (run->done) {
        Tcl_ResetResult(i.interp);
        return answer(*run, m);
    }
    if (code != TCL_OK) {               // there is no coroutine, or it was deleted
        i.runs.erase(coroutine);
        Trail trail = run->said.trail;
        trail.append(trailOfTclError(i, code, name(), type()));
        throw Error(std::move(trail));
    }
    Tcl_ResetResult(i.interp);
    run->reply = later(m);
    run->reply.onCancel([run] {
        run->cancelled = true;
        if (!run->atCancel || !run->service || run->service->interpreter().closing()) return;
        Interpreter& i = run->service->interpreter();
        Interpreter::Kept kept(i);
        Obj script = std::exchange(run->atCancel, Obj());
        if (Tcl_EvalObjEx(i.interp, script, TCL_EVAL_GLOBAL) != TCL_OK && !i.closing()) Tcl_BackgroundException(i.interp, TCL_ERROR);
    });
}

void TclService::answer(TclRun& run, Message& m) const {
    Interpreter& i = interpreter_;
    if (run.code == TCL_OK && run.isExec) {
        m.clear();
        m.trail = std::move(run.said.trail);
        return readResult(run.result, m);
    }
    if (run.code == TCL_OK) {
        m.trail.append(run.said.trail);
        std::string said = toUtf8(run.result);
        if (!said.empty() && !m.text.empty()) m.text += '\n';
        m.text += said;
        return;
    }
    Trail trail = std::move(run.said.trail);
    Tcl_SetObjResult(i.interp, run.result);
    Tcl_SetReturnOptions(i.interp, run.options);
    trail.append(trailOfTclError(i, run.code, name(), type()));
    throw Error(std::move(trail));
}

void TclService::leaving() {
    // Those that wait have nobody to work for any more; deleting a coroutine unwinds it.
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

void TclService::changed(std::span<const Option* const> options) {
    Obj list(Tcl_NewListObj(0, nullptr));
    for (auto* o : options) Tcl_ListObjAppendElement(nullptr, list, str(o->name));
    Tcl_Obj* args[] = {list};
    call("changed", args, nullptr);
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

namespace {
TclService& serviceOf(Interpreter& i, Tcl_Object object);
}  // namespace

std::string labelOfObject(Interpreter& i, std::string_view command) {
    KeepState keep(i.interp);
    Obj word(str(command));
    Tcl_Object object = Tcl_GetObjectFromObj(i.interp, word);
    if (!object || !eval(i, {str("::info"), str("object"), str("isa"), str("typeof"), word, str("::sorma::Service")})) return {};
    if (view(Tcl_GetObjResult(i.interp)) != "1") return {};
    return serviceOf(i, object).name();
}

void tclServiceRemoved(Interpreter& interpreter, const std::string& name) {
    auto known = interpreter.tclServices.find(name);
    if (known == interpreter.tclServices.end()) return;
    TclService* service = known->second;
    if (!service->gone()) return;           // only a second name went
    interpreter.tclServices.erase(known);
    service->removed();
}

// ---- from declarations to a class ----

namespace {

Class buildClass(Interpreter& i, const std::vector<TclClass*>& line, Tcl_Class tcl) {
    std::string purpose;
    std::vector<Value> initial;
    for (auto* c : line) {
        if (!c->purpose.empty()) purpose = c->purpose;
        for (auto& d : c->options) initial.push_back(d.initial);
    }
    std::weak_ptr<TclClass> type = *static_cast<ClassHandle*>(Tcl_ClassGetMetadata(tcl, &kClassData));
    auto make = [&i, type, initial]() -> std::unique_ptr<Service> {
        auto alive = type.lock();
        if (!alive || !alive->tcl) fail(kStep, "making an object", "its class has been destroyed");
        return std::make_unique<TclService>(i, alive->tcl, initial);
    };
    Class made(line.back()->service, std::move(purpose), std::move(make));
    made.declaredAt({}, 0);
    for (auto* c : line) {
        if (!c->words.empty()) made.words(c->words);
        if (!c->example.empty()) made.example(c->example);
        if (!c->version.empty()) made.version(c->version);
        if (!c->conduct.empty())
            made.conduct(c->conduct == "concurrent" ? Conduct::concurrent : c->conduct == "exclusive" ? Conduct::exclusive : Conduct::serial);
        if (!c->file.empty()) made.declaredAt(c->file, c->line);
        for (auto& d : c->options) {
            std::size_t index = made.options().size();
            Option o = d.option;
            o.get = [index](const Service& s) { return static_cast<const TclService&>(s).value(index); };
            o.set = [index](Service& s, const Value& v) { static_cast<TclService&>(s).setValue(index, v); };
            if (o.type == Type::service)
                o.refer = [index](Service& s, Reference r) { static_cast<TclService&>(s).setService(index, std::move(r)); };
            made.option(std::move(o));
        }
        for (auto& a : c->actions) made.action(a);
        for (auto& a : c->inspections) made.inspection(a, a.right);
        for (auto& p : c->reads) made.reads(p.field, p.count, p.unit, p.help, p.low, p.high);
        for (auto& p : c->writes) made.writes(p.field, p.count, p.unit, p.help);
    }
    return made;
}

std::vector<std::string> tclClasses(Interpreter& i) {
    if (Tcl_EvalEx(i.interp, "::sorma::tcloo::Classes", -1, TCL_EVAL_GLOBAL) != TCL_OK) return {};
    Obj list(Tcl_GetObjResult(i.interp));
    return listStrings(list);
}

// ---- declaration commands ----

// The class in whose body the command stands. Fails outside of any.
TclClass& target(Interpreter& i, Tcl_Obj* command) {
    KeepState keep(i.interp);
    std::string outside = toUtf8(command);
    if (outside.starts_with("::")) outside.erase(0, 2);
    std::string name;
    if (Tcl_EvalEx(i.interp, "::oo::define::self", -1, 0) == TCL_OK) {      // 9
        name = toUtf8(Tcl_GetObjResult(i.interp));
    } else if (Tcl_EvalEx(i.interp, "::info level 0", -1, 0) == TCL_OK) {   // 8.6: the frame of oo::define NAME body
        Obj frame(Tcl_GetObjResult(i.interp));
        auto words = listElements(frame);
        if (words.size() >= 3 && view(words[0]).ends_with("oo::define")) name = toUtf8(words[1]);
        if (!name.empty() && !name.starts_with("::")) {
            Tcl_Obj* which[] = {str("::namespace"), str("which"), words[1]};
            Obj call(Tcl_NewListObj(3, which));
            if (eval(i, {str("::uplevel"), str("1"), call}, 0)) name = toUtf8(Tcl_GetObjResult(i.interp));
        }
    }
    Tcl_Object object = name.empty() ? nullptr : Tcl_GetObjectFromObj(i.interp, Obj(str(name)));
    Tcl_Class type = object ? Tcl_GetObjectAsClass(object) : nullptr;
    if (!type || lineage(i, name).empty()) fail(kOutside, outside);
    TclClass& c = declarationsOf(i, type);
    if (c.file.empty()) c.path = whereAmI(i, c.file, c.line);
    return c;
}

// After a declaration: what the SORM knows of the class is out of date, also for classes derived from it.
void declared(Interpreter& i, TclClass& c) {
    i.sorm.forget(c.service);
    for (auto& name : tclClasses(i)) {
        if (!i.sorm.findClass(serviceName(name))) continue;
        auto line = lineage(i, name);
        if (std::find(line.begin(), line.end(), &c) != line.end()) i.sorm.forget(serviceName(name));
    }
}

[[noreturn]] void bad(Tcl_Obj* command, const std::string& what) {
    std::string name = toUtf8(command);
    if (name.starts_with("::")) name.erase(0, 2);
    fail(kDeclaration, name, what);
}

double bound(Tcl_Obj* o, double open) {
    std::string_view text = view(o);
    return text.empty() || text == "*" ? open : toDouble(o);
}

// "6", "3..", "2..5", "*"
Count count(Tcl_Obj* command, Tcl_Obj* o) {
    std::string text = toUtf8(o);
    if (text == "*" || text.empty()) return {};
    std::int64_t low = 0, high = 0;
    auto dots = text.find("..");
    if (dots == std::string::npos) {
        if (parseNumber(text, low) && low >= 0) return exactly(std::size_t(low));
    } else {
        std::string first = text.substr(0, dots), last = text.substr(dots + 2);
        if (parseNumber(first, low) && low >= 0) {
            if (last.empty()) return atLeast(std::size_t(low));
            if (parseNumber(last, high) && high >= low) return between(std::size_t(low), std::size_t(high));
        }
    }
    bad(command, "bad count \"" + text + "\": must be N, N.., N..M, or *");
}

std::string oneOf(std::initializer_list<const char*> words) {
    std::string out;
    std::size_t n = 0;
    for (auto* w : words) {
        if (n > 0) out += n + 1 < words.size() ? ", " : words.size() > 2 ? ", or " : " or ";
        out += w;
        ++n;
    }
    return out;
}

int wrongArgs(Tcl_Interp* interp, Tcl_Obj* const objv[], const char* usage) {
    Tcl_WrongNumArgs(interp, 1, objv, usage);
    return TCL_ERROR;
}

int OptionObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        if (objc < 3 || objc % 2 == 0)
            return wrongArgs(interp, objv, "-name type ?-unit u? ?-range {low high}? ?-choices list? ?-length n? ?-default value? "
                                           "?-fixed boolean? ?-help text?");
        TclClass& c = target(i, objv[0]);
        OptionDeclaration d;
        Option& o = d.option;
        o.name = toUtf8(objv[1]);
        if (o.name.size() < 2 || o.name[0] != '-') bad(objv[0], "bad name \"" + o.name + "\": must begin with a dash");
        for (auto* ancestor : lineage(i, objectName(interp, Tcl_GetClassAsObject(c.tcl))))
            for (auto& known : ancestor->options)
                if (known.option.name == o.name) bad(objv[0], o.name + " is declared twice");
        if (!fromText(view(objv[2]), o.type))
            bad(objv[0], "bad type \"" + toUtf8(objv[2]) + "\": must be " +
                             oneOf({"double", "enum", "flag", "int", "service", "string", "vector"}));
        Tcl_Obj* initial = nullptr;
        for (int k = 3; k < objc; k += 2) {
            std::string_view word = view(objv[k]);
            Tcl_Obj* value = objv[k + 1];
            if (word == "-unit") {
                o.spec.unit = toUtf8(value);
            } else if (word == "-help") {
                o.spec.help = toUtf8(value);
            } else if (word == "-fixed") {
                o.spec.fixed = toBoolean(value);
            } else if (word == "-choices") {
                o.choices = listStrings(value);
            } else if (word == "-default") {
                initial = value;
            } else if (word == "-length") {
                Count n = count(objv[0], value);
                o.spec.minLength = n.low;
                o.spec.maxLength = n.high;
            } else if (word == "-range") {
                auto ends = listElements(value);
                if (ends.size() != 2) bad(objv[0], o.name + ": -range must be {low high}");
                o.spec.low = bound(ends[0], -kInfinity);
                o.spec.high = bound(ends[1], kInfinity);
            } else {
                bad(objv[0], "unknown word \"" + toUtf8(objv[k]) + "\": must be " +
                                 oneOf({"-choices", "-default", "-fixed", "-help", "-length", "-range", "-unit"}));
            }
        }
        if (o.type == Type::choice && o.choices.empty()) bad(objv[0], o.name + ": an enum needs -choices");
        if (initial) {
            d.initial = o.parse(c.service, toUtf8(initial));
        } else {
            double nearest = std::clamp(0.0, o.spec.low, o.spec.high);
            switch (o.type) {
                case Type::flag: d.initial = false; break;
                case Type::integer: d.initial = std::int64_t(nearest); break;
                case Type::real: d.initial = nearest; break;
                case Type::choice: d.initial = o.choices[0]; break;
                case Type::vector: d.initial = std::vector<double>(o.spec.minLength, nearest); break;
                default: d.initial = std::string();
            }
        }
        c.options.push_back(std::move(d));
        declared(i, c);
        return TCL_OK;
    });
}

// sorma::action, sorma::inspection: the body becomes a private method of the class.
int declareAction(Interpreter& i, int objc, Tcl_Obj* const objv[], bool ctrl) {
    return guarded(i, objc, objv, [&] {
        if (objc != 5 && !(objc == 7 && view(objv[5]) == "-right")) return wrongArgs(i.interp, objv, "-name args help body ?-right right?");
        TclClass& c = target(i, objv[0]);
        Action a;
        a.name = toUtf8(objv[1]);
        if (a.name.size() < 2 || a.name[0] != '-') bad(objv[0], "bad name \"" + a.name + "\": must begin with a dash");
        auto& list = ctrl ? c.actions : c.inspections;
        for (auto& known : list)
            if (known.name == a.name) bad(objv[0], a.name + " is declared twice");
        a.help = toUtf8(objv[3]);
        a.right = ctrl ? Right::configure : Right::inspect;
        if (objc == 7) {
            std::string right = toUtf8(objv[6]), known;
            bool found = false;
            for (Right r : {Right::call, Right::inspect, Right::configure, Right::make, Right::program}) {
                if (right == toText(r)) a.right = r, found = true;
                known += (known.empty() ? "" : ", ") + std::string(toText(r));
            }
            if (!found) bad(objv[0], a.name + ": bad right \"" + right + "\": must be one of " + known);
        }
        auto parameters = listElements(objv[2]);
        for (std::size_t k = 0; k < parameters.size(); ++k) {
            auto fields = listElements(parameters[k]);
            if (fields.empty() || fields.size() > 2) bad(objv[0], a.name + ": bad argument \"" + toUtf8(parameters[k]) + "\"");
            std::string name = toUtf8(fields[0]);
            if (!a.usage.empty()) a.usage += ' ';
            if (name == "args" && k + 1 == parameters.size()) {
                a.usage += "?word ...?";
                a.maxArgs = Action::kRest;
            } else if (fields.size() == 2) {
                a.usage += "?" + name + "?";
                ++a.maxArgs;
            } else {
                a.usage += name;
                a.minArgs = ++a.maxArgs;
            }
        }
        std::string method = (ctrl ? "CTRL" : "DBX") + a.name;
        std::string type = objectName(i.interp, Tcl_GetClassAsObject(c.tcl));
        if (!eval(i, {str("::oo::define"), str(type), str("method"), str(method), objv[2], objv[4]})) return TCL_ERROR;
        a.body = [method](Service& s, Args args, Message& reply) { static_cast<TclService&>(s).act(method, args, reply); };
        list.push_back(std::move(a));
        declared(i, c);
        Tcl_ResetResult(i.interp);
        return TCL_OK;
    });
}

int ActionObjCmd(ClientData data, Tcl_Interp*, int objc, Tcl_Obj* const objv[]) {
    return declareAction(*static_cast<Interpreter*>(data), objc, objv, true);
}
int InspectionObjCmd(ClientData data, Tcl_Interp*, int objc, Tcl_Obj* const objv[]) {
    return declareAction(*static_cast<Interpreter*>(data), objc, objv, false);
}

int declarePart(Interpreter& i, int objc, Tcl_Obj* const objv[], bool reads) {
    return guarded(i, objc, objv, [&] {
        bool ranged = objc >= 5 && view(objv[objc - 2]) == "-range";
        int words = ranged ? objc - 2 : objc;
        if (words < 3 || words > 5)
            return wrongArgs(i.interp, objv, reads ? "part count ?unit? ?help? ?-range {low high}?" : "part count ?unit? ?help?");
        TclClass& c = target(i, objv[0]);
        Part p{};
        std::string_view field = view(objv[1]);
        bool found = false;
        for (Field f : {Field::text, Field::floats, Field::ints, Field::any})
            if (field == toText(f)) p.field = f, found = true;
        if (!found) bad(objv[0], "bad part \"" + std::string(field) + "\": must be any, floats, ints, or text");
        p.count = count(objv[0], objv[2]);
        if (words > 3) p.unit = toUtf8(objv[3]);
        if (words > 4) p.help = toUtf8(objv[4]);
        if (ranged) {
            auto ends = listElements(objv[objc - 1]);
            if (ends.size() != 2) bad(objv[0], "-range must be {low high}");
            p.low = bound(ends[0], -kInfinity);
            p.high = bound(ends[1], kInfinity);
        }
        (reads ? c.reads : c.writes).push_back(std::move(p));
        declared(i, c);
        return TCL_OK;
    });
}

int ReadsObjCmd(ClientData data, Tcl_Interp*, int objc, Tcl_Obj* const objv[]) {
    return declarePart(*static_cast<Interpreter*>(data), objc, objv, true);
}
int WritesObjCmd(ClientData data, Tcl_Interp*, int objc, Tcl_Obj* const objv[]) {
    return declarePart(*static_cast<Interpreter*>(data), objc, objv, false);
}

template <std::string TclClass::*member, const char* const& usage>
int TextObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        if (objc != 2) return wrongArgs(interp, objv, usage);
        TclClass& c = target(i, objv[0]);
        c.*member = toUtf8(objv[1]);
        declared(i, c);
        return TCL_OK;
    });
}
int ConductObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        if (objc != 2) return wrongArgs(interp, objv, "serial|concurrent|exclusive");
        TclClass& c = target(i, objv[0]);
        std::string conduct = toUtf8(objv[1]);
        if (conduct != "serial" && conduct != "concurrent" && conduct != "exclusive")
            bad(objv[0], "bad conduct \"" + conduct + "\": must be concurrent, exclusive, or serial");
        c.conduct = conduct;
        declared(i, c);
        return TCL_OK;
    });
}

constexpr const char* kTextUsage = "text";
constexpr const char* kUsageUsage = "usage";
constexpr const char* kRequestUsage = "request";
constexpr const char* kVersionUsage = "version";

// ---- inside methods ----


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

// A TclOO object that somebody has made himself becomes a service object when it is first asked as one. It is called by its
// command, as long as that lives; nobody else can name it.
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
    for (int n = 2; isBound(i, label); ++n) label = plain + "#" + std::to_string(n);     // the command was renamed, and made anew
    auto fresh = std::make_unique<TclService>(i, object, std::move(initial));
    TclService& service = *fresh;
    bindAnonymous(i, label, i.sorm.makeAnonymous(std::move(fresh), label, serviceName(type)));
    return service;
}

// The SO of a TclOO object.
TclService& serviceOf(Interpreter& i, Tcl_Object object) {
    auto* service = static_cast<TclService*>(Tcl_ObjectGetMetadata(object, &kObjectData));
    if (!service) return makeAnonymous(i, object);
    if (service->name().empty()) fail(kNoService, objectName(i.interp, object));
    return *service;
}

// The SO of the object whose method runs.
TclService& self(Tcl_ObjectContext context, Interpreter& i) { return serviceOf(i, Tcl_ObjectContextObject(context)); }

// A word that an object of a service class does not know: requests are for its service object.
int UnknownOfObject(ClientData data, Tcl_Interp* interp, Tcl_ObjectContext context, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    int skip = int(Tcl_ObjectContextSkippedArgs(context));
    if (objc <= skip || !isSoMethod(objv[skip])) return Tcl_ObjectContextInvokeNext(interp, context, objc, objv, skip);
    return guarded(i, objc, objv, [&] { return callByName(i, self(context, i).name(), objc - skip + 1, objv + skip - 1); });
}

int CgetMethod(ClientData data, Tcl_Interp* interp, Tcl_ObjectContext context, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        int skip = int(Tcl_ObjectContextSkippedArgs(context));
        if (objc != skip + 1) return Tcl_WrongNumArgs(interp, skip, objv, "-option"), TCL_ERROR;
        TclService& s = self(context, i);
        int index = s.type().findOption(view(objv[skip]));
        if (index < 0) {
            std::string known;
            for (auto& o : s.type().options()) known += (known.empty() ? "" : ", ") + o.name;
            fail(kNoOption, s.name(), toUtf8(objv[skip]), known.empty() ? "(this class has no options)" : known);
        }
        Value value = s.value(std::size_t(index));
        if (s.type().options()[std::size_t(index)].type == Type::service) {
            auto& name = std::get<std::string>(value);
            if (!name.empty()) i.sorm.needUse(s.author(s.type().options()[std::size_t(index)].name), name, s.name());
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

int PublishMethod(ClientData data, Tcl_Interp* interp, Tcl_ObjectContext context, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        int skip = int(Tcl_ObjectContextSkippedArgs(context));
        if (objc < skip + 1)
            return Tcl_WrongNumArgs(interp, skip, objv, "event ?-text text? ?-floats list? ?-ints list? ?-any bytes? ?word ...?"), TCL_ERROR;
        Message m;
        readOptions({objv + skip + 1, std::size_t(objc - skip - 1)}, m);
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
constexpr Tcl_MethodType kUnknownOfObject = {TCL_OO_METHOD_VERSION_CURRENT, "sorma::unknown", UnknownOfObject, nullptr, nullptr};
constexpr Tcl_MethodType kUnknownOfClass = {TCL_OO_METHOD_VERSION_CURRENT, "sorma::unknown", UnknownOfClass, nullptr, nullptr};

int AdoptObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    Tcl_Object object = objc == 2 ? Tcl_GetObjectFromObj(interp, objv[1]) : nullptr;
    if (Tcl_Class type = object ? Tcl_GetObjectAsClass(object) : nullptr) declarationsOf(*static_cast<Interpreter*>(data), type);
    return TCL_OK;
}

// A class learns it when it becomes a service class: other classes of the program stay as they are.
void answerRequests(Interpreter& i, Tcl_Object object) {
    Tcl_NewInstanceMethod(i.interp, object, Obj(str("unknown")), 0, &kUnknownOfClass, &i);
}

// What does not need C++. It is here and not in a file because a safe interpreter can read none.
constexpr const char* kScript = R"tcl(
namespace eval ::sorma::tcloo {}
namespace eval ::sorma::co {}

# Root of all service classes written in Tcl. Each method but exec may be left as it is.
#       exec message    do the job. message: dict of text floats ints any words. Returns a dict of what it answers among
#                       text floats ints any code; what is missing is empty
#       born            the recipe has been applied and the name is known
#       changed options these options have new values; an error refuses them all
#       selftest        an error, or a verdict in clear text
#       dump            further state, a line for each: name value
::oo::class create ::sorma::Service {
    method exec {message} {error "[info object class [self]] has no method exec {message}"}
    method born {} {}
    method changed {options} {}
    method selftest {} {return ok}
    method dump {} {}
}

# A class that declares nothing becomes a service class when it has been made; others do with their first declaration. Nothing
# tells of a new subclass, so the maker of classes is watched: what it makes stays as it was made.
proc ::sorma::tcloo::Made {command code class op} {
    if {$code == 0 && [::llength [Lineage $class]]} {Adopt $class}
}
::trace add execution ::oo::class leave ::sorma::tcloo::Made

# All service classes, as commands.
proc ::sorma::tcloo::Classes {{from ::sorma::Service}} {
    set all {}
    foreach class [::info class subclasses $from] {
        ::lappend all $class {*}[Classes $class]
    }
    ::lsort -unique $all
}

# Body of the coroutine that an EXEC runs in.
proc ::sorma::tcloo::Run {my message} {
    ::set coroutine [::info coroutine]
    ::catch {$my exec $message} result options
    Done $coroutine $result $options
}

# The same of an action.
proc ::sorma::tcloo::RunMethod {args} {
    ::set coroutine [::info coroutine]
    ::catch $args result options
    Done $coroutine $result $options
}

# A service class behind those it derives from; empty when it is none.
proc ::sorma::tcloo::Lineage {class} {
    if {![::info object isa class $class] || $class eq "::sorma::Service"} {return {}}
    foreach super [::info class superclasses $class] {
        if {$super eq "::sorma::Service"} {return [::list $class]}
        set above [Lineage $super]
        if {[::llength $above]} {return [::lappend above $class]}
    }
    return {}
}
)tcl";

}  // namespace

bool registerTclClass(Interpreter& i, const std::string& name) {
    std::string best;
    for (auto& tcl : tclClasses(i)) {
        if (serviceName(tcl) != name) continue;
        if (best.empty() || tcl.rfind("::") == 0) best = tcl;       // the global one first
    }
    if (best.empty()) return false;
    Tcl_Object object = Tcl_GetObjectFromObj(i.interp, Obj(str(best)));
    if (!object) return false;
    Tcl_Class type = Tcl_GetObjectAsClass(object);
    declarationsOf(i, type);
    i.sorm.add(buildClass(i, lineage(i, best), type));
    return true;
}

std::vector<std::string> tclClassNames(Interpreter& i) {
    std::vector<std::string> out;
    for (auto& tcl : tclClasses(i)) out.push_back(serviceName(tcl));
    return out;
}

bool initTclServices(Interpreter& i) {
    Tcl_Interp* interp = i.interp;
    if (Tcl_EvalEx(interp, kScript, -1, TCL_EVAL_GLOBAL) != TCL_OK) return false;
    auto classOf = [&](const char* name) {
        Tcl_Object object = Tcl_GetObjectFromObj(interp, Obj(str(name)));
        return object ? Tcl_GetObjectAsClass(object) : nullptr;
    };
    auto addMethod = [&](Tcl_Class type, const char* name, bool exported, const Tcl_MethodType* method) {
        Tcl_NewMethod(interp, type, Obj(str(name)), exported, method, &i);
    };
    Tcl_Class service = classOf("::sorma::Service");
    if (!service) return false;
    addMethod(service, "cget", true, &kCget);
    addMethod(service, "configure", true, &kConfigure);
    addMethod(service, "name", true, &kName);
    addMethod(service, "publish", false, &kPublish);
    addMethod(service, "unknown", false, &kUnknownOfObject);

    struct Command {
        const char* name;
        Tcl_ObjCmdProc* proc;
    };
    for (auto& c : std::initializer_list<Command>{
             {"option", OptionObjCmd}, {"action", ActionObjCmd}, {"inspection", InspectionObjCmd}, {"cancelled", CancelledObjCmd}, {"atCancel", AtCancelObjCmd},
             {"conduct", ConductObjCmd}, {"reads", ReadsObjCmd}, {"writes", WritesObjCmd}, {"fail", FailObjCmd}, {"warn", WarnObjCmd},
             {"purpose", TextObjCmd<&TclClass::purpose, kTextUsage>}, {"words", TextObjCmd<&TclClass::words, kUsageUsage>},
             {"example", TextObjCmd<&TclClass::example, kRequestUsage>},
             {"version", TextObjCmd<&TclClass::version, kVersionUsage>}})
        i.define(c.name, c.proc);
    Tcl_CreateObjCommand(interp, "::sorma::tcloo::Done", DoneObjCmd, &i, nullptr);
    Tcl_CreateObjCommand(interp, "::sorma::tcloo::Adopt", AdoptObjCmd, &i, nullptr);
    Tcl_ResetResult(interp);
    return true;
}

}  // namespace sorma
