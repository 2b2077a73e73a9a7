#include "tcl/peerCommands.h"

#include <algorithm>
#include <map>
#include <memory>
#include <system_error>

#include "bus/detached.h"
#include "bus/requestText.h"
#include "comm/comm.h"
#include "comm/errors.h"
#include "comm/rpcbind.h"
#include "comm/runtimeFolder.h"
#include "comm/siblings.h"

namespace sorma {

namespace {

const Prototype kMethod{Severity::error, "REQUEST SYNTAX", 0, "bad method \"{}\": must be ask, cancel, destroy, facts, health, subscribe, or unsubscribe"};
const Prototype kRequest{Severity::error, "REQUEST SYNTAX", 0, "bad request \"{}\": must be CTRL, DBX, or EXEC"};
const Prototype kOption{Severity::error, "REQUEST SYNTAX", 0, "bad option \"{}\": must be {}"};
const Prototype kNumber{Severity::error, "REQUEST SYNTAX", 0, "{} expects a whole number from {}, got \"{}\""};
const Prototype kNoToken{Severity::error, "REQUEST SYNTAX", 0, "\"{}\" is no subscription of this peer"};
const Prototype kWhere{Severity::error, "REQUEST SYNTAX", 0, "sorma::peer open expects what stands after @"};
const Prototype kSelf{Severity::error, "REQUEST SYNTAX", 0, "the peer of this process only subscribes, got \"{}\""};
const Prototype kWord{Severity::error, "REQUEST SYNTAX", 0, "bad word \"{}\": must be names, open, or programs"};
const Prototype kPrograms{Severity::error, "REQUEST SYNTAX", 0, "sorma::peer programs expects a host, and -command prefix"};
const Prototype kThread{Severity::error, "COMM LIMIT", 1, "the rpcbind of {} cannot be asked: {}"};
const Prototype kEnded{Severity::error, "COMM LOST", 1, "{}: the connection to its daemon has ended; the request may have run"};

void put(Tcl_Obj* dict, const char* key, Tcl_Obj* value) { Tcl_DictObjPut(nullptr, dict, Tcl_NewStringObj(key, -1), value); }
void put(Tcl_Obj* dict, const char* key, std::string_view value) { put(dict, key, newText(value)); }

// ---- sorma::resolve ----

const char* toText(Resolution::State state) {
    switch (state) {
        case Resolution::State::here: return "here";
        case Resolution::State::known: return "known";
        case Resolution::State::asking: return "asking";
        case Resolution::State::unresolved: break;
    }
    return "unresolved";
}

// sorma::resolve NAME|@WHERE
int ResolveObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]);

// ---- peers ----

class PeerCommand : public std::enable_shared_from_this<PeerCommand> {
public:
    PeerCommand(Interpreter& i, std::shared_ptr<Connection> line) : interpreter(i), connection(std::move(line)) {}
    ~PeerCommand() {
        subscriptions.clear();
        if (!connection) return;
        connection->changed = nullptr;
        connection->end();
    }

    void ask(int objc, Tcl_Obj* const objv[]);
    bool cancel(Tcl_Obj* given);
    void giveUp();                                      // before it is deleted: whoever asked gets an error
    void subscribe(int objc, Tcl_Obj* const objv[]);
    Tcl_Obj* facts() const;

    Interpreter& interpreter;
    std::shared_ptr<Connection> connection;             // null: this process
    std::map<std::string, std::unique_ptr<Listening>> subscriptions;
    struct Asked {
        Future future;
        std::string name;
        Obj prefix;
    };
    std::map<std::uint64_t, Asked> asked;             // by number: what is under way
    std::uint64_t last = 0;
    Tcl_Command token = nullptr;
};
using PeerPointer = std::shared_ptr<PeerCommand>;

// Options before the other words; returns how many words they take.
int takeOptions(int objc, Tcl_Obj* const objv[], int at, std::initializer_list<std::pair<const char*, Obj*>> known) {
    for (; at + 1 < objc && view(objv[at]).starts_with('-'); at += 2) {
        auto found = std::find_if(known.begin(), known.end(), [&](auto& k) { return view(objv[at]) == k.first; });
        if (found == known.end()) {
            std::string names;
            for (auto& k : known) names += (names.empty() ? "" : ", ") + std::string(k.first);
            fail(kOption, toUtf8(objv[at]), names);
        }
        *found->second = Obj(objv[at + 1]);
    }
    return at;
}

std::int64_t number(const char* option, Tcl_Obj* given, std::int64_t otherwise, std::int64_t least) {
    std::int64_t n = otherwise;
    if (given && (!parseNumber(toUtf8(given), n) || n < least)) fail(kNumber, option, least, toUtf8(given));
    return n;
}

// The author that -as names; null: nobody but the owner.
PrincipalPointer authorOf(Tcl_Obj* who) { return who && !view(who).empty() ? Principal::parse(toUtf8(who)) : nullptr; }

// $peer ask ?-timeout ms? ?-command prefix? ?-as who? NAME EXEC|CTRL|DBX ?word ...?: its number; calls prefix STATUS VALUE
void PeerCommand::ask(int objc, Tcl_Obj* const objv[]) {
    Obj timeout, who, prefix(Tcl_NewObj());
    int at = takeOptions(objc, objv, 2, {{"-timeout", &timeout}, {"-command", &prefix}, {"-as", &who}});
    std::int64_t ms = number("-timeout", timeout, 5000, 0);
    std::string method = at + 1 < objc ? toUtf8(objv[at + 1]) : std::string();
    if (method != "EXEC" && method != "CTRL" && method != "DBX") fail(kRequest, method);
    auto pending = std::make_shared<Pending>(interpreter.sorm, ms > 0 ? Deadline::in(ms) : Deadline(), nullptr, nullptr);
    std::span<Tcl_Obj* const> words(objv + at + 2, std::size_t(objc - at - 2));
    if (method == "EXEC") readParts(toUtf8(objv[at]), words, pending->message);
    else
        for (auto* w : words) pending->message.words.push_back(toUtf8(w));
    pending->relayFor = authorOf(who);
    Future future(pending);
    const std::uint64_t itsNumber = pending->number();
    future.then([weak = weak_from_this(), itsNumber, forSomebody = bool(pending->relayFor)](Future f) {
        auto self = weak.lock();
        if (!self || self->interpreter.closing()) return;
        auto request = self->asked.extract(itsNumber);
        if (request.empty()) return;                            // given up
        Interpreter& i = self->interpreter;
        const Obj prefix = request.mapped().prefix;
        try {
            Message& m = f.result();
            callBack(i, prefix, {newText("ok"), dictReply(i.constants, m)});
        } catch (const Error& e) {
            const Entry* cause = e.trail.cause();
            Tcl_Obj* words[] = {newText(cause ? cause->text : std::string(e.what())), cause ? errorCode(*cause) : Tcl_NewObj(), forSomebody ? trailList(e.trail) : nullptr};
            callBack(i, prefix, {newText("error"), Tcl_NewListObj(forSomebody ? 3 : 2, words)});
        }
    });
    asked.emplace(itsNumber, Asked{future, toUtf8(objv[at]), prefix});
    try {
        connection->begin(pending, toUtf8(objv[at]), method == "EXEC" ? Method::exec : method == "CTRL" ? Method::ctrl : Method::dbx);
    } catch (...) {
        asked.erase(itsNumber);
        throw;
    }
    Tcl_SetObjResult(interpreter.interp, Tcl_NewWideIntObj(Tcl_WideInt(itsNumber)));
}

// $peer cancel NUMBER: was it under way? Its prefix is called with COMM CANCELLED, and its service is told
bool PeerCommand::cancel(Tcl_Obj* given) {
    auto found = asked.find(std::uint64_t(number("cancel", given, 0, 0)));
    return found != asked.end() && found->second.future.cancel();
}

// From the event loop: this may be called in the midst of what the asker does.
void PeerCommand::giveUp() {
    for (auto& [number, request] : std::exchange(asked, {}))
        interpreter.sorm.mailbox()->post([&i = interpreter, name = request.name, prefix = request.prefix] {
            if (i.closing()) return;
            const Entry entry = makeEntry(kEnded, {MessageArg::of(name)});
            Tcl_Obj* words[] = {newText(entry.text), errorCode(entry)};
            callBack(i, prefix, {newText("error"), Tcl_NewListObj(2, words)});
        });
}

// $peer subscribe ?-event pattern? ?-queue n? ?-command prefix? ?-as who? NAME: a token; while it is connected. Only if there is such an object
void PeerCommand::subscribe(int objc, Tcl_Obj* const objv[]) {
    Obj pattern(newText("*")), queue, who, prefix(Tcl_NewObj());
    int at = takeOptions(objc, objv, 2, {{"-event", &pattern}, {"-queue", &queue}, {"-command", &prefix}, {"-as", &who}});
    std::int64_t keep = number("-queue", queue, 10'000, 1);
    if (at + 1 != objc) fail(kRequest, "subscribe");
    std::string name = "s" + std::to_string(++last), so = toUtf8(objv[at]);
    auto listener = [weak = weak_from_this(), prefix](Received& e) {
        auto self = weak.lock();
        if (self && !self->interpreter.closing()) callBack(self->interpreter, prefix, {eventDict(self->interpreter.constants, e)});
    };
    if (connection) {
        subscriptions[name] = connection->listenLater(so, toUtf8(pattern), std::size_t(keep), listener, true, authorOf(who));
    } else {
        auto* here = interpreter.sorm.find(so);
        if (!here) fail(errors::kNoObject, so);
        subscriptions[name] = here->listen(toUtf8(pattern), std::size_t(keep), listener);
    }
    Tcl_SetObjResult(interpreter.interp, newText(name));
}

Tcl_Obj* PeerCommand::facts() const {
    Tcl_Obj* dict = Tcl_NewDictObj();
    auto& d = connection->daemon();
    put(dict, "connected", Tcl_NewIntObj(connection->connected()));
    put(dict, "name", d.name);
    put(dict, "user", d.user);
    put(dict, "host", d.host);
    put(dict, "program", d.program);
    put(dict, "pid", Tcl_NewWideIntObj(d.process));
    put(dict, "boot", std::to_string(d.boot));
    return dict;
}

int PeerObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    PeerPointer self = *static_cast<PeerPointer*>(data);
    Interpreter& i = self->interpreter;
    return guarded(i, objc, objv, [&] {
        if (objc < 2) return Tcl_WrongNumArgs(interp, 1, objv, "method ?word ...?"), TCL_ERROR;
        std::string_view method = view(objv[1]);
        Tcl_ResetResult(interp);
        if (!self->connection && method != "subscribe" && method != "unsubscribe" && method != "destroy") fail(kSelf, std::string(method));
        if (method == "ask") return self->ask(objc, objv), TCL_OK;
        if (method == "subscribe") return self->subscribe(objc, objv), TCL_OK;
        if (method == "cancel") {
            if (objc != 3) return Tcl_WrongNumArgs(interp, 2, objv, "number"), TCL_ERROR;
            return Tcl_SetObjResult(interp, i.constants.integer(self->cancel(objv[2]))), TCL_OK;
        }
        if (method == "facts") return Tcl_SetObjResult(interp, self->facts()), TCL_OK;
        if (method == "destroy") return self->giveUp(), Tcl_DeleteCommandFromToken(interp, self->token), TCL_OK;
        if (method == "unsubscribe") {
            if (objc != 3) return Tcl_WrongNumArgs(interp, 2, objv, "subscription"), TCL_ERROR;
            auto found = self->subscriptions.find(toUtf8(objv[2]));
            if (found == self->subscriptions.end()) fail(kNoToken, toUtf8(objv[2]));
            auto leaving = std::move(found->second);
            self->subscriptions.erase(found);
            return TCL_OK;
        }
        if (method == "health") {
            if (objc != 3) return Tcl_WrongNumArgs(interp, 2, objv, "prefix"), TCL_ERROR;
            self->connection->askHealth([weak = std::weak_ptr(self), prefix = Obj(objv[2])](const wire::Health& h) {
                auto peer = weak.lock();
                if (!peer || peer->interpreter.closing()) return;
                Tcl_Obj* dict = Tcl_NewDictObj();
                put(dict, "state", h.busy ? "busy" : "alive");
                put(dict, "what", h.what);
                put(dict, "since", Tcl_NewWideIntObj(Tcl_WideInt(h.since / 1000)));
                put(dict, "underway", Tcl_NewWideIntObj(h.underway));
                put(dict, "connections", Tcl_NewWideIntObj(h.connections));
                callBack(peer->interpreter, prefix, {dict});
            });
            return TCL_OK;
        }
        fail(kMethod, std::string(method));
    });
}

// Data of one interpreter.
struct Peers : std::enable_shared_from_this<Peers> {
    Peers(Interpreter& i, Comm& c) : interpreter(i), comm(c) {}
    void watchFolder(const std::string& folder, Obj command) {
        changedCmd = command;
        if (watch && watch->alive() && watch->folder() == folder) return;
        watch = std::make_unique<FolderWatch>(comm.reactor(), folder, ".sock", [this] {
            Obj kept = changedCmd;
            callBack(interpreter, kept, {});
        });
    }

    Interpreter& interpreter;
    Comm& comm;
    std::uint64_t last = 0;
    std::unique_ptr<FolderWatch> watch; // of the runtime folder
    Obj changedCmd;
    std::map<std::string, Obj> programsCmd;         // host -> prefix, while it is asked
};

int ResolveObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& p = *static_cast<Peers*>(data);
    return guarded(p.interpreter, objc, objv, [&] {
        if (objc != 2) return Tcl_WrongNumArgs(interp, 1, objv, "name"), TCL_ERROR;
        Resolution place = p.comm.resolver().find(toUtf8(objv[1]));
        const bool target = place.state == Resolution::State::known || place.state == Resolution::State::here;
        const Address& a = place.target;
        Tcl_Obj* dict = Tcl_NewDictObj();
        put(dict, "service", place.service);
        put(dict, "where", place.where);
        put(dict, "state", toText(place.state));
        put(dict, "address", isHere(place.address) ? std::string() : target ? describe(a) : place.address.toText());
        put(dict, "socket", pathOf(a));
        put(dict, "host", hostOf(a));
        put(dict, "port", portOf(a) > 0 ? std::to_string(portOf(a)) : std::string());
        put(dict, "why", place.why);
        Tcl_SetObjResult(interp, dict);
        return TCL_OK;
    });
}

// sorma::peer names ?-command prefix?: daemons of this user on this host, as their sockets say; prefix is called when there may be others
int names(Peers& p, int objc, Tcl_Obj* const objv[]) {
    Obj command;
    if (takeOptions(objc, objv, 2, {{"-command", &command}}) != objc)
        return Tcl_WrongNumArgs(p.interpreter.interp, 2, objv, "?-command prefix?"), TCL_ERROR;
    std::string folder = runtimeFolder();
    if (command) p.watchFolder(folder, command);
    Obj list(Tcl_NewListObj(0, nullptr));
    for (auto& name : namesIn(folder, kSocketEnding))
        if (Name::isName("sorm@" + name)) Tcl_ListObjAppendElement(nullptr, list, newText(name));
    Tcl_SetObjResult(p.interpreter.interp, list);
    return TCL_OK;
}

// sorma::peer programs HOST -command prefix: its rpcbind is asked by a thread; prefix gets a list of numbers, as they stand after host:
int programs(const std::shared_ptr<Peers>& p, int objc, Tcl_Obj* const objv[]) {
    Obj command;
    if (objc < 3 || takeOptions(objc, objv, 3, {{"-command", &command}}) != objc || !command) fail(kPrograms);
    std::string host = toUtf8(objv[2]);
    p->programsCmd[host] = command;         // of the SORM's thread; the other one has only the name
    try {
        startDetached([weak = std::weak_ptr(p), mailbox = p->interpreter.sorm.mailbox(), host] {
            std::vector<std::string> found;
            for (auto offset : rpcbindPrograms(host)) {
                char text[16];
                std::snprintf(text, sizeof text, "0x%x", offset);
                found.emplace_back(text);
            }
            mailbox->post([weak, host, found] {
                auto peers = weak.lock();
                auto told = peers ? peers->programsCmd.extract(host) : std::map<std::string, Obj>::node_type();
                if (!told) return;
                Obj list(Tcl_NewListObj(0, nullptr));
                for (auto& f : found) Tcl_ListObjAppendElement(nullptr, list, newText(f));
                callBack(peers->interpreter, told.mapped(), {list});
            });
        });
    } catch (const std::system_error& e) {
        fail(kThread, host, e.what());
    }
    Tcl_ResetResult(p->interpreter.interp);
    return TCL_OK;
}

// sorma::peer open WHERE ?-command prefix?: a command; prefix is called when the line is there, or lost
int NewPeerObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& p = *static_cast<Peers*>(data);
    Interpreter& i = p.interpreter;
    return guarded(i, objc, objv, [&] {
        if (objc < 2) return Tcl_WrongNumArgs(interp, 1, objv, "names|open ?word ...?"), TCL_ERROR;
        std::string word = toUtf8(objv[1]), where = objc > 2 && word == "open" ? toUtf8(objv[2]) : std::string("*");
        i.sorm.access.need(nullptr, Right::reach, where, "sorma::peer");
        if (word == "names") return names(p, objc, objv);
        if (word == "programs") return programs(p.shared_from_this(), objc, objv);
        if (word != "open") fail(kWord, word);
        Obj command(Tcl_NewObj());
        if (objc < 3 || takeOptions(objc, objv, 3, {{"-command", &command}}) != objc || where.empty()) fail(kWhere);
        Address::parse(where);
        auto peer = std::make_shared<PeerCommand>(i, where == "self" ? nullptr : p.comm.privateLine(where));
        if (peer->connection) peer->connection->changed = [weak = std::weak_ptr(peer), command] {
            if (auto self = weak.lock(); self && !self->interpreter.closing()) callBack(self->interpreter, command, {});
        };
        std::string name = "::sorma::peer::p" + std::to_string(++p.last);
        peer->token = Tcl_CreateObjCommand(interp, name.c_str(), PeerObjCmd, new PeerPointer(peer),
                                           [](ClientData d) { delete static_cast<PeerPointer*>(d); });
        Tcl_SetObjResult(interp, newText(name));
        return TCL_OK;
    });
}

}  // namespace

void initPeerCommands(Interpreter& i, Comm& comm) {
    auto own = std::make_shared<Peers>(i, comm);
    Tcl_CreateNamespace(i.interp, "::sorma::peer", nullptr, nullptr);
    Tcl_CreateObjCommand(i.interp, "::sorma::peer", NewPeerObjCmd, own.get(), nullptr);
    Tcl_CreateObjCommand(i.interp, "::sorma::resolve", ResolveObjCmd, own.get(), nullptr);
    for (auto* name : {"peer", "resolve"}) Tcl_Export(i.interp, Tcl_FindNamespace(i.interp, "::sorma", nullptr, 0), name, 0);
    i.atEnd([own]() mutable { own.reset(); });
}

}  // namespace sorma
