#include "tcl/soCommand.h"

#include <algorithm>
#include <cstring>

#include "bus/nearest.h"
#include "bus/requestText.h"
#include "comm/proxy.h"
#include "tcl/anonymous.h"
#include "tcl/pendingCommand.h"
#include "tcl/tclService.h"
#include "tcl/unknown.h"
#include "tcl/waiting.h"

namespace sorma {

namespace {

const Prototype kNoOption{Severity::error, "OPTION UNKNOWN", 2, "{}: unknown option \"{}\""};
const Prototype kBadMethod{Severity::error, "REQUEST SYNTAX", 0, "bad method \"{}\"{}: must be {}"};
const Prototype kNotAsync{Severity::error, "REQUEST SYNTAX", 0, "{}{} cannot be asked for later: must be {}"};
const Prototype kPairs{Severity::error, "OPTION MISSING", 2, "{}: {} needs a value"};

const std::vector<std::string> kLater{"CTRL", "DBX", "EXEC", "cget", "configure", "exec", "info"};
const std::vector<std::string> kMethods{"CTRL", "DBX", "EXEC", "cget", "configure", "destroy", "exec", "info"};

[[noreturn]] void failNotAsync(Tcl_Obj* word) { fail(kNotAsync, toUtf8(word), didYouMean(toUtf8(word), kLater), oneOf(kLater)); }

enum class Word { none, EXEC, CTRL, DBX, exec, configure, cget, info, destroy };

inline Word methodOf(Tcl_Obj* o) {
    std::string_view w = view(o);
    if (w.size() == 4 && std::memcmp(w.data(), "EXEC", 4) == 0) [[likely]] return Word::EXEC;
    switch (w.size()) {
        case 3: return w == "DBX" ? Word::DBX : Word::none;
        case 4:
            if (w == "CTRL") return Word::CTRL;
            if (w == "exec") return Word::exec;
            if (w == "cget") return Word::cget;
            return w == "info" ? Word::info : Word::none;
        case 7: return w == "destroy" ? Word::destroy : Word::none;
        case 9: return w == "configure" ? Word::configure : Word::none;
        default: return Word::none;
    }
}

}  // namespace

// The data of a service object's commands. It exists while one of the commands does, and while a call is in progress.
class SoBinding {
public:
    struct Command {                    // client data of a Tcl command
        SoBinding* owner = nullptr;
        Tcl_Command token = nullptr;
    };
    SoBinding(Interpreter& i, std::string n, Reference r)
        : interpreter(i), name(std::move(n)), so(std::move(r)), remote(so->isElsewhere()) {
        for (auto& c : commands) c.owner = this;
    }

    Interpreter& interpreter;
    const std::string name;
    Reference so;
    bool remote;                        // so stands for an object of another process
    Message message;                    // reused by each call that finds it free, so that a call does not allocate
    bool messageBusy = false;
    bool registered = false;            // in interpreter.bindings
    bool ownsObject = false;            // so is in no repository, and ends with its command
    Command commands[2];                // ::sorma::so::NAME and ::NAME

    // Without a command it goes, but not under the feet of a call in progress.
    void deleteUnused() {
        if (commands[0].token || commands[1].token) return;
        if (registered) interpreter.bindings.erase(name);
        registered = false;
        interpreter.whenIdle([this] { delete this; });
    }
    // A call in progress may stand on the reference that is replaced.
    void renew(Reference fresh) {
        std::swap(so, fresh);
        remote = so->isElsewhere();
        interpreter.whenIdle([old = std::move(fresh)] {});
    }

    // The binding's own message, or a fresh one while an outer call uses that. It is clear, and is cleared afterwards
    // unless the user says that it still is.
    class Borrowed {
    public:
        explicit Borrowed(SoBinding& b) : b_(b), own_(!b.messageBusy), m_(own_ ? &b.message : new Message) {
            if (own_) b.messageBusy = true;
        }
        ~Borrowed() {
            if (!own_) {
                delete m_;
                return;
            }
            if (!clear_) m_->reset();
            b_.messageBusy = false;
        }
        Borrowed(const Borrowed&) = delete;
        Borrowed& operator=(const Borrowed&) = delete;
        Message& operator*() const { return *m_; }
        void stillClear() { clear_ = true; }

    private:
        SoBinding& b_;
        const bool own_;
        bool clear_ = false;
        Message* const m_;
    };
};

using Objects = Tcl_Obj* const*;

[[noreturn]] void badMethod(Tcl_Obj* word) { fail(kBadMethod, toUtf8(word), didYouMean(toUtf8(word), kMethods), oneOf(kMethods)); }

std::string requestAsTyped(const std::string& name, int objc, Objects objv) {
    constexpr std::size_t kLongest = 4096;
    std::string out;
    try {
        Message m;
        Word method = objc > 1 ? methodOf(objv[1]) : Word::none;
        std::span<Tcl_Obj* const> words(objv + std::min(objc, 2), std::size_t(std::max(objc - 2, 0)));
        auto take = [&](std::initializer_list<const char*> first) {
            for (auto* w : first) m.words.emplace_back(w);
            for (auto* o : words) m.words.push_back(toUtf8(o));
        };
        Method verb = Method::dbx;
        switch (method) {
            case Word::EXEC: verb = Method::exec; readParts(name, words, m); break;
            case Word::exec: verb = Method::exec; readOptions(name, words, m); break;
            case Word::CTRL: case Word::configure: verb = Method::ctrl; take({}); break;
            case Word::DBX: take({}); break;
            case Word::cget: take({"-get"}); break;
            case Word::info: take({"-info"}); break;
            default: return commandText(objc, objv);
        }
        appendRequest(out, name, verb, m);
    } catch (...) {         // it could not be read: show the words as they came
        return commandText(objc, objv);
    }
    if (out.size() > kLongest) {
        out.resize(kLongest);
        while (!out.empty() && !isUtf8(out)) out.pop_back();
    }
    return out;
}

namespace {

// After a request that succeeded with something to say.
[[gnu::noinline]] void keepTrail(Interpreter& interpreter, const std::string& name, Message& m, int objc, Objects objv) {
    if (!m.trail.empty()) {
        std::string request = requestAsTyped(name, objc, objv);
        for (auto& e : m.trail.entries())
            if (e.request.empty()) e.request = interpreter.sorm.masked(request);
        // Inside a TclOO service this was a call to a sub-service: its messages travel on with the reply.
        if (auto running = runningNow(interpreter); running.message) running.message->trail.append(m.trail);
    }
    interpreter.sorm.setLastTrail(m.trail);
}

inline void invoke(SoBinding& b, Method method, Message& m, int objc, Objects objv) {
    b.so->invoke(method, m);    // the call may remove the object, but not before it returns: see renew, release
    if (!m.trail.empty() || !b.interpreter.sorm.lastTrail().empty()) [[unlikely]] keepTrail(b.interpreter, b.name, m, objc, objv);
}

int answer(Interpreter& i, Tcl_Obj* result) {
    Obj keep(result);
    if (i.closing()) return TCL_ERROR;
    Tcl_SetObjResult(i.interp, result);
    return TCL_OK;
}
int answer(SoBinding& b, Tcl_Obj* result) { return answer(b.interpreter, result); }

// ---- from words to a request, and from its message to a result ----

int configure(SoBinding& b, int objc, Objects objv, RequestForm& request, Message& m) {
    request.method = Method::dbx;
    if (objc == 2) {
        m.words = {"-info", "options"};
        request.answer = RequestForm::Answer::text;
    } else if (objc == 3) {
        m.words = {"-info", "options", toUtf8(objv[2])};
        request.answer = RequestForm::Answer::oneOption;
    } else {
        if (objc % 2 != 0) fail(kPairs, b.name, toUtf8(objv[objc - 1]));
        for (int i = 2; i < objc; ++i) m.words.push_back(toUtf8(objv[i]));
        request.method = Method::ctrl;
        request.answer = RequestForm::Answer::nothing;
    }
    return TCL_OK;
}

// Read the words of a command. TCL_CONTINUE: it is no request, but something between this interpreter and the command.
int readRequest(SoBinding& b, Word word, int objc, Objects objv, RequestForm& request, Message& m) {
    Tcl_Interp* interp = b.interpreter.interp;
    std::span<Tcl_Obj* const> words(objv + 2, std::size_t(objc - 2));
    request.answer = RequestForm::Answer::text;
    request.method = Method::dbx;
    switch (word) {
        case Word::EXEC:
            readParts(b.name, words, m);
            request = {Method::exec, RequestForm::Answer::flat};
            return TCL_OK;
        case Word::exec:
            readOptions(b.name, words, m);
            request = {Method::exec, RequestForm::Answer::dict};
            return TCL_OK;
        case Word::CTRL:
        case Word::DBX:
            for (auto* o : words) m.words.push_back(toUtf8(o));
            request = {word == Word::CTRL ? Method::ctrl : Method::dbx, RequestForm::Answer::flat};
            return TCL_OK;
        case Word::configure:
            return configure(b, objc, objv, request, m);
        case Word::cget:
            if (objc != 3) return Tcl_WrongNumArgs(interp, 2, objv, "-option"), TCL_ERROR;
            m.words = {"-get", toUtf8(objv[2])};
            return TCL_OK;
        case Word::info: {
            if (objc < 3) return Tcl_WrongNumArgs(interp, 2, objv, "what ?option?"), TCL_ERROR;
            std::string_view what = view(objv[2]);
            if (objc == 3 && (what == "location" || what == "name")) return TCL_CONTINUE;
            m.words.emplace_back("-info");
            for (int i = 2; i < objc; ++i) m.words.push_back(toUtf8(objv[i]));
            return TCL_OK;
        }
        default: return TCL_CONTINUE;
    }
}

// so: the object that has answered; null: it was removed meanwhile.
Tcl_Obj* resultOf(const Constants& constants, const std::string& name, Service* so, const RequestForm& request, const Message& m, Tcl_Obj* option) {
    switch (request.answer) {
        case RequestForm::Answer::flat: return flatReply(constants, m);
        case RequestForm::Answer::dict: return dictReply(constants, m);
        case RequestForm::Answer::nothing: return constants.empty;
        case RequestForm::Answer::oneOption: {
            Obj list(newText(m.text));
            auto entries = listElements(list);
            if (entries.size() == 1) return Obj(entries[0]), Tcl_DuplicateObj(entries[0]);
            if (!so) fail(kNoOption, name, toUtf8(option));
            Message again;                                      // fails, and says which options there are
            again.words = {"-get", toUtf8(option)};
            so->invoke(Method::dbx, again);
            return newText(again.text);
        }
        case RequestForm::Answer::text: break;
    }
    return newText(m.text);
}
Tcl_Obj* resultOf(SoBinding& b, const RequestForm& request, const Message& m, Tcl_Obj* option) {
    return resultOf(b.interpreter.constants, b.name, &*b.so, request, m, option);
}

// With ::sorma::so in its namespace path a script finds our dict before Tcl's: what is no request goes on to that.
int tclDict(Tcl_Interp* interp, int objc, Objects objv) {
    std::vector<Tcl_Obj*> words(objv, objv + objc);
    Obj command(Tcl_NewStringObj("::dict", -1));
    words[0] = command;
    return Tcl_EvalObjv(interp, objc, words.data(), TCL_EVAL_NOERR);
}

// Methods that concern only this interpreter and the command.
int ownMethod(SoBinding& b, Word method, int objc, Objects objv) {
    Tcl_Interp* interp = b.interpreter.interp;
    switch (method) {
        case Word::info:
            return answer(b, newText(view(objv[2]) == "name" ? b.name : b.so->location()));
        case Word::destroy:
            if (objc != 2) return Tcl_WrongNumArgs(interp, 2, objv, nullptr), TCL_ERROR;
            if (b.ownsObject) return deleteCommands(b.interpreter, b.name), answer(b, b.interpreter.constants.empty);
            // The name may have been written otherwise than the repository has it: nop@h:0x014.
            b.interpreter.sorm.remove(b.interpreter.sorm.find(b.name) ? b.name : b.so->name(), Permit::owner());
            if (!b.interpreter.closing()) deleteCommands(b.interpreter, b.name);
            return answer(b, b.interpreter.constants.empty);
        default:
            if (b.name == "dict") return tclDict(interp, objc, objv);
            if (makesObject(objv[1]) && b.name == b.so->type().name()) return makeByClass(b.interpreter, b.name, objc, objv);
            badMethod(objv[1]);
    }
}

// A name that leads nowhere, mistyped perhaps, is forgotten again when nobody but the repository and its command has it.
void forgetNowhere(Interpreter& i, const std::string& name, const Trail& trail) {
    auto* cause = trail.cause();
    if (!cause || cause->symbol != "ADDRESS UNRESOLVED" || !cause->daemon.empty()) return;
    i.whenIdle([&i, name] {
        if (i.closing()) return;
        auto* proxy = dynamic_cast<Proxy*>(i.sorm.find(name));
        if (!proxy || proxy->references() > 2 || !proxy->isNowhere()) return;
        i.sorm.remove(name, Permit::owner());
        deleteCommands(i, name);
    });
}

[[gnu::noinline, gnu::cold]] int failed(SoBinding& b, int objc, Objects objv) noexcept {
    Trail trail = trailOfCurrentException(b.name);
    if (b.remote) forgetNowhere(b.interpreter, b.name, trail);
    return b.interpreter.raise(std::move(trail), requestAsTyped(b.name, objc, objv));
}

// ---- answers that come later ----

int answerLater(SoBinding& b, Future future, RequestForm request, int objc, Objects objv) {
    auto pending = std::make_shared<PendingCommand>(b.interpreter, b.name, request, std::move(future), objc, objv);
    return waitThen(b.interpreter, {pending->future()}, true, {}, [pending] { return pending->finish(); });
}

// In a coroutine, what another process answers suspends that coroutine alone.
[[gnu::noinline]] int callRemote(SoBinding& b, const RequestForm& request, Message& m, int objc, Objects objv) {
    Obj coroutine = coroutineName(b.interpreter);
    if (view(coroutine).empty()) {
        invoke(b, request.method, m, objc, objv);
        return answer(b, resultOf(b, request, m, objc > 2 ? objv[2] : nullptr));
    }
    InCoroutine context(b.interpreter, coroutine);
    return answerLater(b, b.so->async(request.method, std::exchange(m, {})), request, objc, objv);
}

// Everything but EXEC of an object of this process.
[[gnu::noinline]] int otherMethod(SoBinding& b, Word method, int objc, Objects objv) {
    SoBinding::Borrowed borrowed(b);
    Message& m = *borrowed;
    RequestForm request;
    int code = readRequest(b, method, objc, objv, request, m);
    if (code == TCL_CONTINUE) return ownMethod(b, method, objc, objv);
    if (code != TCL_OK) return code;
    if (b.remote) return callRemote(b, request, m, objc, objv);
    if (b.so->start(request.method, m)) return answerLater(b, Future(std::exchange(m.later, nullptr)), request, objc, objv);
    if (!m.trail.empty() || !b.interpreter.sorm.lastTrail().empty()) keepTrail(b.interpreter, b.name, m, objc, objv);
    return answer(b, resultOf(b, request, m, objc > 2 ? objv[2] : nullptr));
}

// Speed counts here: no allocation, no clock, no look-up, no text.
int call(SoBinding& b, int objc, Objects objv) noexcept {
    Interpreter& interpreter = b.interpreter;
    Interpreter::Entered entered(interpreter);
    try {
        if (objc < 2) [[unlikely]] {
            Tcl_WrongNumArgs(interpreter.interp, 1, objv, "method ?word ...?");
            return TCL_ERROR;
        }
        if (b.so->gone()) [[unlikely]] b.renew(interpreter.sorm.get(b.name));
        Word method = methodOf(objv[1]);
        if (method != Word::EXEC || b.remote) return otherMethod(b, method, objc, objv);
        SoBinding::Borrowed borrowed(b);
        Message& m = *borrowed;
        if (objc > 2) readParts(b.name, {objv + 2, std::size_t(objc - 2)}, m);
        // The call may remove the object, but not before it returns: see renew, release.
        if (b.so->start(Method::exec, m)) [[unlikely]]
            return answerLater(b, Future(std::exchange(m.later, nullptr)), {Method::exec, RequestForm::Answer::flat}, objc, objv);
        if (!m.trail.empty() || !interpreter.sorm.lastTrail().empty()) [[unlikely]] keepTrail(b.interpreter, b.name, m, objc, objv);
        if (interpreter.ended()) [[unlikely]] return TCL_ERROR;
        if (m.code == 0 && m.floats.empty() && m.text.empty() && m.ints.empty() && m.any.empty() && m.trail.empty()) {
            borrowed.stillClear();
            Tcl_SetObjResult(interpreter.interp, interpreter.constants.ret0);
            return TCL_OK;
        }
        Tcl_SetObjResult(interpreter.interp, flatReply(interpreter.constants, m));
        return TCL_OK;
    } catch (...) {
        return failed(b, objc, objv);
    }
}

int SoNRCmd(ClientData data, Tcl_Interp*, int objc, Objects objv) {
    return call(*static_cast<SoBinding::Command*>(data)->owner, objc, objv);
}

int SoObjCmd(ClientData data, Tcl_Interp* interp, int objc, Objects objv) {
    return Tcl_NRCallObjProc(interp, SoNRCmd, data, objc, objv);
}

void soCommandDeleted(ClientData data) {
    auto* command = static_cast<SoBinding::Command*>(data);
    command->token = nullptr;
    SoBinding& b = *command->owner;
    if (b.ownsObject) b.interpreter.sorm.dismiss(Reference(b.so));
    b.deleteUnused();
}

// ---- from names to commands ----

void makeCommands(SoBinding& b) {
    Interpreter& i = b.interpreter;
    if (b.name.find("::") != std::string::npos) return;     // Tcl would take it for namespaces; unknown serves such names
    auto create = [&](SoBinding::Command& command, const std::string& full) {
        command.token = Tcl_NRCreateCommand(i.interp, full.c_str(), SoObjCmd, SoNRCmd, &command, soCommandDeleted);
    };
    if (!b.commands[0].token) create(b.commands[0], std::string(kSoNamespace) + b.name);
    std::string global = "::" + b.name;
    if (!b.commands[1].token && !Tcl_FindCommand(i.interp, global.c_str(), nullptr, TCL_GLOBAL_ONLY))
        create(b.commands[1], global);
}

// The binding of an object that has no name, by its command; null: the command is none of these.
SoBinding* ownerBinding(Interpreter& i, const std::string& command) {
    Tcl_CmdInfo info;
    if (!Tcl_GetCommandInfo(i.interp, command.c_str(), &info) || info.deleteProc != soCommandDeleted) return nullptr;
    auto* b = static_cast<SoBinding::Command*>(info.objClientData)->owner;
    return b->ownsObject ? b : nullptr;
}

// Never null; the object is made when need be.
SoBinding& bindingFor(Interpreter& i, std::string_view name, Probe probe = Probe::now) {
    std::string key(name);
    if (key.starts_with("::"))
        if (auto* b = ownerBinding(i, key)) return *b;      // by its command: that may have been renamed
    auto known = i.bindings.find(key);
    if (known != i.bindings.end() && !known->second->so->gone()) {
        makeCommands(*known->second);
        return *known->second;
    }
    if (key.starts_with("::"))          // no name, but perhaps a TclOO object that a script has made
        if (std::string label = labelOfObject(i, key); !label.empty()) return *i.bindings.at(label);
    Reference so = i.sorm.get(name, probe);
    known = i.bindings.find(key);       // making it may have bound it
    SoBinding* b;
    if (known != i.bindings.end()) {
        b = known->second;
        b->renew(std::move(so));
    } else {
        b = new SoBinding(i, key, std::move(so));
        b->registered = true;
        i.bindings.emplace(std::move(key), b);
    }
    makeCommands(*b);
    return *b;
}

}  // namespace

PendingCommand::PendingCommand(Interpreter& i, std::string name, RequestForm request, Future future, int objc, Tcl_Obj* const objv[])
    : interpreter_(i), name_(std::move(name)), request_(request), future_(std::move(future)), words_(Tcl_NewListObj(objc, objv)) {}

int PendingCommand::finish() const {
    Interpreter& i = interpreter_;
    Interpreter::Entered entered(i);
    Tcl_Size objc;
    Tcl_Obj** objv;
    Tcl_ListObjGetElements(nullptr, words_, &objc, &objv);
    try {
        Message& m = future_.result();
        if (!m.trail.empty() || !i.sorm.lastTrail().empty()) keepTrail(i, name_, m, int(objc), objv);
        // The object may have been removed; it is not made again for this.
        auto found = i.bindings.find(name_);
        Service* so = found != i.bindings.end() && found->second->so && !found->second->so->gone() ? &*found->second->so : nullptr;
        return answer(i, resultOf(i.constants, name_, so, request_, m, objc > 2 ? objv[2] : nullptr));
    } catch (...) {
        Trail trail = trailOfCurrentException(name_);
        forgetNowhere(i, name_, trail);
        return i.raise(std::move(trail), requestAsTyped(name_, int(objc), objv));
    }
}

std::shared_ptr<PendingCommand> beginCommand(Interpreter& i, std::string_view name, int objc, Tcl_Obj* const objv[], Deadline deadline, const PrincipalPointer& author) {
    if (author && !Name::isElsewhere(name)) i.sorm.get(name, author);       // it may be nobody's to make
    SoBinding& b = bindingFor(i, name, Probe::later);
    if (objc < 2) return Tcl_WrongNumArgs(i.interp, 1, objv, "method ?word ...?"), nullptr;
    Message m;
    RequestForm request;
    int code = readRequest(b, methodOf(objv[1]), objc, objv, request, m);
    if (code == TCL_CONTINUE) failNotAsync(objv[1]);
    if (code != TCL_OK) return nullptr;
    m.author = author;
    return std::make_shared<PendingCommand>(i, b.name, request, b.so->async(request.method, std::move(m), deadline), objc, objv);
}

bool sendOneway(Interpreter& i, std::string_view name, int objc, Tcl_Obj* const objv[]) {
    SoBinding& b = bindingFor(i, name, view(coroutineName(i)).empty() ? Probe::now : Probe::later);
    if (objc < 2) return Tcl_WrongNumArgs(i.interp, 1, objv, "method ?word ...?"), false;
    Message m;
    RequestForm request;
    int code = readRequest(b, methodOf(objv[1]), objc, objv, request, m);
    if (code == TCL_CONTINUE) failNotAsync(objv[1]);
    if (code != TCL_OK) return false;
    b.so->oneway(request.method, std::move(m));
    Tcl_ResetResult(i.interp);
    return true;
}

Reference objectOf(Interpreter& i, std::string_view name) { return bindingFor(i, name, Probe::later).so; }

bool isSoMethod(Tcl_Obj* word) { return methodOf(word) != Word::none; }

int callByName(Interpreter& interpreter, std::string_view name, int objc, Tcl_Obj* const objv[], Probe probe) {
    return call(bindingFor(interpreter, name, probe), objc, objv);
}

std::string commandOf(Interpreter& interpreter, std::string_view name) {
    SoBinding& b = bindingFor(interpreter, name);
    if (b.commands[1].token || !b.commands[0].token) return b.name;
    return std::string(kSoNamespace) + b.name;
}

void bindAnonymous(Interpreter& i, const std::string& label, Reference so, const std::string& command) {
    auto* b = new SoBinding(i, label, std::move(so));
    b->registered = true;
    i.bindings.emplace(label, b);
    if (command.empty()) return;
    b->ownsObject = true;
    b->commands[1].token = Tcl_NRCreateCommand(i.interp, command.c_str(), SoObjCmd, SoNRCmd, &b->commands[1], soCommandDeleted);
}

std::vector<std::pair<std::string, Reference>> anonymousObjects(Interpreter& i) {
    std::vector<std::pair<std::string, Reference>> out;
    for (auto& [label, b] : i.bindings) {
        if (!label.starts_with("::")) continue;
        auto* oo = dynamic_cast<TclService*>(&*b->so);
        Obj command(Tcl_NewObj());
        if (b->commands[1].token) Tcl_GetCommandFullName(i.interp, b->commands[1].token, command);
        out.emplace_back(oo ? oo->command() : toUtf8(command), b->so);
    }
    std::sort(out.begin(), out.end(), [](auto& a, auto& b) { return a.first < b.first; });
    return out;
}

Service* anonymousObject(Interpreter& i, const std::string& command) {
    if (auto* b = ownerBinding(i, command)) return &*b->so;
    return anonymousTclObject(i, command);
}

void releaseAnonymous(Interpreter& i, const std::string& label) {
    auto found = i.bindings.find(label);
    if (found != i.bindings.end()) found->second->deleteUnused();
}

bool isBound(Interpreter& i, const std::string& label) { return i.bindings.contains(label); }

void deleteCommands(Interpreter& interpreter, const std::string& name) {
    auto found = interpreter.bindings.find(name);
    if (found == interpreter.bindings.end()) return;
    SoBinding& b = *found->second;
    Interpreter::Entered entered(interpreter);      // b stays until both are deleted
    for (auto& command : b.commands)
        if (command.token) Tcl_DeleteCommandFromToken(interpreter.interp, command.token);
}

void releaseBindings(Interpreter& interpreter) {
    auto left = std::move(interpreter.bindings);
    interpreter.bindings.clear();
    for (auto& [name, binding] : left) {
        binding->registered = false;
        delete binding;
    }
}

void initSoCommands(Interpreter& i) {
    Tcl_CreateNamespace(i.interp, "::sorma::so", nullptr, nullptr);
    initUnknown(i);
    // In daemons and in scott Tcl's own dict gains EXEC, CTRL and DBX; its bytecode stays as quick as it is.
    Tcl_EvalEx(i.interp, R"tcl(
        proc ::sorma::JoinDict {} {::namespace ensemble configure ::dict -unknown ::sorma::DictRequest}
        proc ::sorma::DictRequest {dict word args} {
            if {$word in {EXEC CTRL DBX}} {::list ::sorma::so::dict $word} else {::list}
        }
    )tcl", -1, TCL_EVAL_GLOBAL);
    for (auto* name : {"sorm", "dict"}) bindingFor(i, name);
    Tcl_ResetResult(i.interp);
}

}  // namespace sorma
