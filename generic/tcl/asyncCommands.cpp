#include "bus/nearest.h"
#include "tcl/asyncCommands.h"

#include <algorithm>
#include <map>
#include <memory>
#include <optional>

#include "bus/client.h"
#include "bus/requestText.h"
#include "comm/proxy.h"
#include "tcl/pendingCommand.h"
#include "tcl/soCommand.h"
#include "tcl/tclService.h"
#include "tcl/waiting.h"

namespace sorma {

namespace {

const Prototype kOption{Severity::error, "REQUEST SYNTAX", 0, "bad option \"{}\"{}: must be {}"};
const Prototype kValue{Severity::error, "REQUEST SYNTAX", 0, "{} needs a value"};
const Prototype kMilliseconds{Severity::error, "REQUEST SYNTAX", 0, "-timeout expects a number of ms, 0 for none, got \"{}\""};
const Prototype kQueue{Severity::error, "REQUEST SYNTAX", 0, "-queue expects a whole number from 1 to 1000000, got \"{}\""};
const Prototype kOnewayAs{Severity::error, "REQUEST SYNTAX", 0, "-oneway and -as cannot be combined"};
const Prototype kCommand{Severity::error, "REQUEST SYNTAX", 0, "-command is missing: it must name the command that gets each event"};
const Prototype kBadMethod{Severity::error, "REQUEST SYNTAX", 0, "bad method \"{}\": must be cancel, destroy, done, request, result, take, or wait"};
const Prototype kNoFuture{Severity::error, "REQUEST SYNTAX", 0, "\"{}\" is no future of this interpreter"};
const Prototype kNoSubscription{Severity::error, "REQUEST SYNTAX", 0, "\"{}\" is no subscription of this interpreter"};
const Prototype kLocalDaemon{Severity::error, "REQUEST SYNTAX", 0, "\"{}\" is this interpreter itself, not a daemon elsewhere"};
const Prototype kStep{Severity::error, "PIPE STEP", 1, "step {}, \"{}\": expected NAME EXEC ?word ...?"};
const Prototype kApart{Severity::error, "PIPE ELSEWHERE", 1,
                       "step {}, \"{}\", is at {}, and the first step at {}; all steps of a pipe are at one daemon: ask this one for itself"};
const Prototype kTooLate{Severity::error, "COMM TIMEOUT", 1, "{}: not done in the time given to this command; the calls go on"};

// A deadline from now, in milliseconds; 0 is none, which is said by one that never comes.
Deadline deadlineOf(Tcl_Obj* o) {
    std::int64_t ms = 0;
    if (!parseNumber(toUtf8(o), ms) || ms < 0) fail(kMilliseconds, toUtf8(o));
    return ms == 0 ? Deadline::at(INT64_MAX) : Deadline::in(ms);
}

// ---- futures ----

class FutureCommand {
public:
    FutureCommand(Interpreter& i, std::shared_ptr<PendingCommand> p) : interpreter(i), pending(std::move(p)) {}
    Interpreter& interpreter;
    std::shared_ptr<PendingCommand> pending;
    Tcl_Command token = nullptr;
    Obj name;
    Obj prefix;                         // -command
};

void futureDeleted(ClientData data);

// nullptr: there is none of that name, perhaps since it has been destroyed meanwhile.
FutureCommand* findFuture(Interpreter& i, Tcl_Obj* name) {
    Tcl_CmdInfo info;
    bool found = Tcl_GetCommandInfo(i.interp, Tcl_GetString(name), &info) && info.deleteProc == futureDeleted;
    return found ? static_cast<FutureCommand*>(info.objClientData) : nullptr;
}

int FutureNRCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto* f = static_cast<FutureCommand*>(data);
    Interpreter& i = f->interpreter;
    return guarded(i, objc, objv, [&] {
        if (objc < 2) return Tcl_WrongNumArgs(interp, 1, objv, "method ?-timeout ms?"), TCL_ERROR;
        std::string_view method = view(objv[1]);
        auto pending = f->pending;
        bool take = method == "take", wait = take || method == "wait";
        if (objc != 2 && !(wait && objc == 4)) return Tcl_WrongNumArgs(interp, 2, objv, wait ? "?-timeout ms?" : nullptr), TCL_ERROR;
        if (wait) {
            Deadline deadline;
            if (objc == 4) {
                if (view(objv[2]) != "-timeout") fail(kOption, toUtf8(objv[2]), didYouMean(toUtf8(objv[2]), {"-timeout"}), "-timeout");
                deadline = deadlineOf(objv[3]);
            }
            return waitThen(i, {pending->future()}, true, deadline, [pending, &i, name = take ? f->name : Obj()] {
                if (pending->future().done()) {
                    int code = pending->finish();
                    if (auto* own = name ? findFuture(i, name) : nullptr) Tcl_DeleteCommandFromToken(i.interp, own->token);
                    return code;
                }
                return i.raise(Error(makeEntry(kTooLate, {MessageArg::of(pending->name())})).trail, {});
            });
        }
        if (method == "done") return Tcl_SetObjResult(interp, i.constants.integer(pending->future().done())), TCL_OK;
        if (method == "result") return pending->finish();
        if (method == "request")
            return Tcl_SetObjResult(interp, Tcl_NewWideIntObj(Tcl_WideInt(pending->future().pending()->number()))), TCL_OK;
        if (method == "cancel") return Tcl_SetObjResult(interp, i.constants.integer(pending->future().cancel())), TCL_OK;
        if (method == "destroy") return Tcl_DeleteCommandFromToken(interp, f->token), TCL_OK;
        fail(kBadMethod, std::string(method));
    });
}

int FutureObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    return Tcl_NRCallObjProc(interp, FutureNRCmd, data, objc, objv);
}

// A future whose command is deleted is cancelled.
void futureDeleted(ClientData data) {
    auto* f = static_cast<FutureCommand*>(data);
    auto pending = f->pending;
    delete f;
    if (!pending->future().done()) pending->future().cancel();
}

FutureCommand& futureOf(Interpreter& i, Tcl_Obj* name) {
    auto* f = findFuture(i, name);
    if (!f) fail(kNoFuture, toUtf8(name));
    return *f;
}

// Data of one interpreter.
struct Async {
    explicit Async(Interpreter& i) : interpreter(i) {}
    Interpreter& interpreter;
    std::uint64_t lastFuture = 0, lastSubscription = 0;
    struct Subscription {
        std::string object, pattern;
        std::unique_ptr<Listening> listening;
    };
    std::map<std::string, Subscription> subscriptions;
    // The author of the last request that had one. To look up a user reads files, and a line of SCPI has the same one each time.
    struct Author {
        std::string text, known;
        PrincipalPointer principal;
    } author;
};

const Async::Author& authorOf(Async& a, std::string text) {
    // The groups of a user may change.
    if (a.author.text != text || !a.author.principal || a.author.principal->kind() == Principal::Kind::user) {
        a.author.principal = Principal::parse(text);
        a.author.known = a.author.principal ? a.author.principal->toText() : std::string();
        a.author.text = std::move(text);
    }
    return a.author;
}

// A client for one request: it holds nothing beyond that.
ClientPointer clientOf(const Async::Author& author) {
    Caller caller;
    caller.known = author.known;
    return std::make_shared<Client>(std::move(caller), author.principal);
}

// sorma::async ?-timeout ms? ?-command prefix? ?-as who? ?-oneway? name method ?word ...?
int AsyncObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& a = *static_cast<Async*>(data);
    Interpreter& i = a.interpreter;
    return guarded(i, objc, objv, [&] {
        Deadline deadline;
        Obj prefix;
        bool oneway = false;
        Async::Author by;
        int at = 1;
        for (; at < objc && view(objv[at]).starts_with('-'); ++at) {
            std::string_view option = view(objv[at]);
            if (option == "-oneway") {
                oneway = true;
                continue;
            }
            if (option != "-timeout" && option != "-command" && option != "-as")
                fail(kOption, option, didYouMean(option, {"-as", "-command", "-oneway", "-timeout"}), "-as, -command, -oneway, or -timeout");
            if (at + 1 >= objc) fail(kValue, std::string(option));
            ++at;
            if (option == "-timeout") deadline = deadlineOf(objv[at]);
            else if (option == "-as") by = authorOf(a, toUtf8(objv[at]));
            else prefix = Obj(objv[at]);
        }
        const PrincipalPointer& author = by.principal;
        if (oneway && author) fail(kOnewayAs);
        if (objc - at < 2)
            return Tcl_WrongNumArgs(interp, 1, objv, "?-timeout ms? ?-command prefix? ?-as who? ?-oneway? name method ?word ...?"), TCL_ERROR;
        std::string name = toUtf8(objv[at]);
        Obj coroutine = coroutineName(i);
        if (oneway) {
            InCoroutine context(i, coroutine);
            return sendOneway(i, name, objc - at, objv + at) ? TCL_OK : TCL_ERROR;
        }
        auto pending = [&] {
            std::optional<CallContext> as;              // its audit, account and leases are those of whoever asks
            if (author) as.emplace(std::make_shared<KeptCall>(clientOf(by), deadline, CallContext::newRequest(), std::string()));
            InCoroutine context(i, coroutine);
            return beginCommand(i, name, objc - at, objv + at, deadline, author);
        }();
        if (!pending) return TCL_ERROR;
        auto* f = new FutureCommand(i, std::move(pending));
        std::string command = "::sorma::future::f" + std::to_string(++a.lastFuture);
        f->name = newText(command);
        f->token = Tcl_NRCreateCommand(interp, command.c_str(), FutureObjCmd, FutureNRCmd, f, futureDeleted);
        if (prefix) {
            f->prefix = prefix;
            f->pending->future().then([&i, name = f->name](Future) {
                if (i.closing()) return;
                auto* own = findFuture(i, name);
                if (!own) return;
                Obj call = own->prefix;
                callBack(i, call, {name});
            });
        }
        Tcl_SetObjResult(interp, f->name);
        return TCL_OK;
    });
}

// sorma::all ?-timeout ms? future ...: results, in order.   sorma::any ?-timeout ms? future ...: the first that is done
int several(Async& a, int objc, Tcl_Obj* const objv[], bool all) {
    Interpreter& i = a.interpreter;
    return guarded(i, objc, objv, [&] {
        Deadline deadline;
        int at = 1;
        if (objc > 2 && view(objv[1]) == "-timeout") {
            deadline = deadlineOf(objv[2]);
            at = 3;
        }
        if (at >= objc && !all) return Tcl_WrongNumArgs(i.interp, 1, objv, "?-timeout ms? future ?future ...?"), TCL_ERROR;
        std::vector<Future> futures;
        std::vector<std::shared_ptr<PendingCommand>> pending;
        std::vector<Obj> names;
        for (; at < objc; ++at) {
            auto& f = futureOf(i, objv[at]);
            pending.push_back(f.pending);
            futures.push_back(f.pending->future());
            names.push_back(f.name);
        }
        auto finish = [&i, pending, names, all] {
            Obj list(Tcl_NewListObj(0, nullptr));
            for (std::size_t k = 0; k < pending.size(); ++k) {
                bool done = pending[k]->future().done();
                if (all && !done) return i.raise(Error(makeEntry(kTooLate, {MessageArg::of(pending[k]->name())})).trail, {});
                if (!all && done) return Tcl_SetObjResult(i.interp, names[k]), TCL_OK;
            }
            if (!all) return i.raise(Error(makeEntry(kTooLate, {MessageArg::of("sorma::any")})).trail, {});
            for (auto& p : pending) {
                if (p->finish() != TCL_OK) return TCL_ERROR;
                Tcl_ListObjAppendElement(nullptr, list, Tcl_GetObjResult(i.interp));
            }
            Tcl_SetObjResult(i.interp, list);
            return TCL_OK;
        };
        if (futures.empty()) return finish();
        return waitThen(i, std::move(futures), all, deadline, finish);
    });
}

int AllNRCmd(ClientData data, Tcl_Interp*, int objc, Tcl_Obj* const objv[]) {
    return several(*static_cast<Async*>(data), objc, objv, true);
}
int AllObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    return Tcl_NRCallObjProc(interp, AllNRCmd, data, objc, objv);
}
int AnyNRCmd(ClientData data, Tcl_Interp*, int objc, Tcl_Obj* const objv[]) {
    return several(*static_cast<Async*>(data), objc, objv, false);
}
int AnyObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    return Tcl_NRCallObjProc(interp, AnyNRCmd, data, objc, objv);
}

// ---- pipes ----

// sorma::pipe step ?step ...?: the steps as EXEC of class pipe at the daemon that serves all of them
int PipeNRCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& a = *static_cast<Async*>(data);
    Interpreter& i = a.interpreter;
    return guarded(i, objc, objv, [&] {
        if (objc < 2) return Tcl_WrongNumArgs(interp, 1, objv, "step ?step ...?"), TCL_ERROR;
        std::vector<Obj> words{newText("pipe"), newText("EXEC")};
        const Connection* line = nullptr;
        std::string place;
        for (int k = 1; k < objc; ++k) {
            Tcl_Obj** parts;
            Tcl_Size n;
            if (Tcl_ListObjGetElements(interp, objv[k], &n, &parts) != TCL_OK) return TCL_ERROR;
            if (n < 2) fail(kStep, std::int64_t(k), toUtf8(objv[k]));
            const std::string name = toUtf8(parts[0]);
            Reference so = Name::isElsewhere(name) ? i.sorm.get(name, Probe::later) : Reference(i.sorm.find(name));
            auto* proxy = dynamic_cast<Proxy*>(so.get());
            const Connection* here = proxy ? &proxy->connection() : nullptr;
            if (k == 1) {
                line = here;
                place = proxy ? so->location() : "this process";
                if (proxy) words[0] = newText("pipe@" + whereOf(Name::parse(so->name()), i.sorm.dictionary()));
            } else if (here != line) {
                fail(kApart, std::int64_t(k), toUtf8(objv[k]), proxy ? so->location() : "this process", place);
            }
            std::vector<std::string> step{proxy ? proxy->target() : name};
            for (Tcl_Size p = 1; p < n; ++p) step.push_back(toUtf8(parts[p]));
            words.push_back(newText(joinWords(step)));
        }
        std::vector<Tcl_Obj*> call(words.begin(), words.end());
        return callByName(i, toUtf8(call[0]), int(call.size()), call.data());
    });
}
int PipeObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    return Tcl_NRCallObjProc(interp, PipeNRCmd, data, objc, objv);
}

// ---- subscriptions ----

// sorma::subscribe name ?-event pattern? ?-latest? ?-queue n? -command prefix
int SubscribeObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& a = *static_cast<Async*>(data);
    Interpreter& i = a.interpreter;
    return guarded(i, objc, objv, [&] {
        if (objc < 2) return Tcl_WrongNumArgs(interp, 1, objv, "name ?-event pattern? ?-latest? ?-queue n? -command prefix"), TCL_ERROR;
        std::string name = toUtf8(objv[1]), pattern = "*";
        std::int64_t keep = 100;
        Obj prefix;
        for (int at = 2; at < objc; ++at) {
            std::string option = toUtf8(objv[at]);
            if (option == "-latest") {
                keep = 1;
                continue;
            }
            if (option != "-event" && option != "-queue" && option != "-command") fail(kOption, option, didYouMean(option, {"-command", "-event", "-latest", "-queue"}), "-command, -event, -latest, or -queue");
            if (++at >= objc) fail(kValue, option);
            if (option == "-event") pattern = toUtf8(objv[at]);
            else if (option == "-command") prefix = Obj(objv[at]);
            else if (!parseNumber(toUtf8(objv[at]), keep) || keep < 1 || keep > 1'000'000) fail(kQueue, toUtf8(objv[at]));
        }
        if (!prefix) fail(kCommand);
        std::string token = "subscription" + std::to_string(++a.lastSubscription);
        Reference so = i.sorm.get(name);
        auto listening = so->listen(pattern, std::size_t(keep), [&i, prefix](Received& e) {
            if (!i.closing()) callBack(i, prefix, {eventDict(i.constants, e)});
        });
        a.subscriptions.emplace(token, Async::Subscription{name, pattern, std::move(listening)});
        Tcl_SetObjResult(interp, newText(token));
        return TCL_OK;
    });
}

// sorma::unsubscribe subscription
int UnsubscribeObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& a = *static_cast<Async*>(data);
    return guarded(a.interpreter, objc, objv, [&] {
        if (objc != 2) return Tcl_WrongNumArgs(interp, 1, objv, "subscription"), TCL_ERROR;
        auto found = a.subscriptions.find(toUtf8(objv[1]));
        if (found == a.subscriptions.end()) fail(kNoSubscription, toUtf8(objv[1]));
        auto leaving = std::move(found->second);
        a.subscriptions.erase(found);
        Tcl_ResetResult(interp);
        return TCL_OK;
    });
}

// sorma::subscriptions: list of {subscription object pattern}
int SubscriptionsObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& a = *static_cast<Async*>(data);
    return guarded(a.interpreter, objc, objv, [&] {
        if (objc != 1) return Tcl_WrongNumArgs(interp, 1, objv, nullptr), TCL_ERROR;
        Tcl_Obj* list = Tcl_NewListObj(0, nullptr);
        for (auto& [token, s] : a.subscriptions) {
            Tcl_Obj* fields[] = {newText(token), newText(s.object), newText(s.pattern)};
            Tcl_ListObjAppendElement(nullptr, list, Tcl_NewListObj(3, fields));
        }
        Tcl_SetObjResult(interp, list);
        return TCL_OK;
    });
}

// ---- health ----

// sorma::health daemon ?-timeout ms?: dict  name state what since underway connections started
int HealthObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& a = *static_cast<Async*>(data);
    Interpreter& i = a.interpreter;
    return guarded(i, objc, objv, [&] {
        if (objc != 2 && objc != 4) return Tcl_WrongNumArgs(interp, 1, objv, "daemon ?-timeout ms?"), TCL_ERROR;
        Deadline deadline = Deadline::in(5000);
        if (objc == 4) {
            if (view(objv[2]) != "-timeout") fail(kOption, toUtf8(objv[2]), didYouMean(toUtf8(objv[2]), {"-timeout"}), "-timeout");
            deadline = deadlineOf(objv[3]);
        }
        Reference so = i.sorm.get("sorm@" + toUtf8(objv[1]), Probe::later);
        auto* proxy = dynamic_cast<Proxy*>(so.get());
        if (!proxy) fail(kLocalDaemon, toUtf8(objv[1]));
        wire::Health h = proxy->connection().health(deadline);
        Tcl_Obj* dict = Tcl_NewDictObj();
        auto put = [&](const char* key, Tcl_Obj* value) { Tcl_DictObjPut(nullptr, dict, Tcl_NewStringObj(key, -1), value); };
        put("name", newText(h.name));
        put("state", newText(h.busy ? "busy" : "alive"));
        put("what", newText(h.what));
        put("since", Tcl_NewWideIntObj(Tcl_WideInt(h.since / 1000)));
        put("underway", Tcl_NewWideIntObj(h.underway));
        put("connections", Tcl_NewWideIntObj(h.connections));
        put("started", Tcl_NewWideIntObj(h.started));
        Tcl_SetObjResult(interp, dict);
        return TCL_OK;
    });
}

}  // namespace

void initAsyncCommands(Interpreter& i) {
    auto own = std::make_shared<Async>(i);
    Tcl_CreateNamespace(i.interp, "::sorma::future", nullptr, nullptr);
    struct Command {
        const char* name;
        Tcl_ObjCmdProc *proc, *nrProc;
    };
    for (auto& c : std::initializer_list<Command>{{"async", AsyncObjCmd, nullptr}, {"all", AllObjCmd, AllNRCmd}, {"any", AnyObjCmd, AnyNRCmd}, {"pipe", PipeObjCmd, PipeNRCmd}, {"subscribe", SubscribeObjCmd, nullptr}, {"unsubscribe", UnsubscribeObjCmd, nullptr}, {"subscriptions", SubscriptionsObjCmd, nullptr}, {"health", HealthObjCmd, nullptr}}) {
        std::string full = std::string("::sorma::") + c.name;
        if (c.nrProc) Tcl_NRCreateCommand(i.interp, full.c_str(), c.proc, c.nrProc, own.get(), nullptr);
        else Tcl_CreateObjCommand(i.interp, full.c_str(), c.proc, own.get(), nullptr);
        Tcl_Export(i.interp, Tcl_FindNamespace(i.interp, "::sorma", nullptr, 0), c.name, 0);
    }
    i.atEnd([own]() mutable { own.reset(); });
}

}  // namespace sorma
