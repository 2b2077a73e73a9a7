#include "tcl/commCommands.h"

#include <unistd.h>

#include <climits>
#include <cstring>
#include <memory>
#include <vector>

#include "bus/nearest.h"
#include "bus/requestText.h"
#include "comm/comm.h"
#include "comm/runtimeFolder.h"
#include "comm/tls.h"
#include "comm/visitor.h"
#include "tcl/eventSource.h"
#include "tcl/peerCommands.h"

namespace sorma {

namespace {

constexpr std::string_view kSharing[] = {"auto", "shm", "unix"};      // in the order of Sharing
const Prototype kBadSharing{Severity::error, "OPTION VALUE", 1, "-transport expects auto, shm or unix, got \"{}\""};
const Prototype kServeOption{Severity::error, "REQUEST SYNTAX", 0, "bad option \"{}\"{}: must be {}"};
const Prototype kServeValue{Severity::error, "REQUEST SYNTAX", 0, "{} expects {}, got \"{}\""};
const Prototype kServeConnection{Severity::error, "REQUEST SYNTAX", 0, "{} does not go with -connection: that is served, and nothing listened to"};
const Prototype kServeStandby{Severity::error, "REQUEST SYNTAX", 0, "-standby does not go with {}: a standby daemon listens nowhere until it owns its name"};
const Prototype kServeOwned{Severity::error, "REQUEST SYNTAX", 0, "-owned needs -directory or -standby: without a claim there is no owner"};
const Prototype kServeName{Severity::error, "REQUEST SYNTAX", 0, "sorma::serve expects the name of the daemon first, got \"{}\""};
const Prototype kServeMissing{Severity::error, "REQUEST SYNTAX", 0, "{} needs a value"};

constexpr char kKey[] = "sorma::comm";

// The COMM of an interpreter. The event source is deleted first: so no request comes in while the rest is deleted.
struct InterpreterComm {
    explicit InterpreterComm(Interpreter& i) : sorm(i.sorm), comm(i.sorm), source(i, comm) { Tcl_CreateExitHandler(exits, this); }
    ~InterpreterComm() { Tcl_DeleteExitHandler(exits, this); }
    // `exit` and the end of a script do not delete interpreters, so clients are told and sockets closed here. Not in a child
    // that has forked from us.
    static void exits(ClientData data) {
        auto& own = *static_cast<InterpreterComm*>(data);
        if (getpid() != own.process) return;
        while (!own.comm.servers().empty()) own.comm.unserve(own.comm.servers().begin()->first, "the program has ended");
        own.comm.finish();
        own.sorm.processEnds();
    }
    const pid_t process = getpid();
    Sorm& sorm;
    Comm comm;
    EventSource source;
};

std::int64_t wholeNumber(const std::string& option, const std::string& text, std::int64_t low, std::int64_t high) {
    std::string digits = text;
    std::int64_t value = 0;
    bool good = false;
    if (text.starts_with("0x")) {
        char* end = nullptr;
        value = std::strtoll(text.c_str(), &end, 16);
        good = *end == 0 && text.size() > 2;
    } else {
        good = parseNumber(text, value);
    }
    if (!good || value < low || value > high)
        fail(kServeValue, option, "a whole number from " + std::to_string(low) + " to " + std::to_string(high), text);
    return value;
}

void put(Tcl_Obj* dict, const char* key, const std::string& value) {
    Tcl_DictObjPut(nullptr, dict, Tcl_NewStringObj(key, -1), newText(value));
}

std::string offsetText(std::uint32_t program) {
    if (program == 0) return {};
    char text[16];
    std::snprintf(text, sizeof text, "0x%x", program);
    return text;
}

Tcl_Obj* describe(const Server& server) {
    Tcl_Obj* dict = Tcl_NewDictObj();
    put(dict, "name", server.name());
    put(dict, "port", server.port() > 0 ? std::to_string(server.port()) : std::string());
    put(dict, "socket", server.socket());
    put(dict, "program", offsetText(server.program()));
    return dict;
}

std::vector<int> descriptors(const std::string& option, Tcl_Obj* list) {
    Tcl_Size count = 0;
    Tcl_Obj** items = nullptr;
    if (Tcl_ListObjGetElements(nullptr, list, &count, &items) != TCL_OK) fail(kServeValue, option, "a list of descriptors", toUtf8(list));
    std::vector<int> out;
    for (Tcl_Size k = 0; k < count; ++k) out.push_back(int(wholeNumber(option, toUtf8(items[k]), 0, INT_MAX)));
    return out;
}

Server::Wanted::Tls tlsOf(const std::string& value) {
    using Tls = Server::Wanted::Tls;
    if (value == "no") return Tls::no;
    if (value == "yes") return Tls::yes;
    if (value != "only") fail(kServeValue, "-tls", "no, yes or only", value);
    return Tls::only;
}

// A turn of the event loop. False: the interpreter is deleted, and COMM with it; or its script was cancelled.
bool turn(Interpreter& i, std::int64_t until) {
    Tcl_Interp* const interp = i.interp;
    i.turn(until);
    return !Tcl_InterpDeleted(interp) && Tcl_Canceled(interp, TCL_LEAVE_ERR_MSG) == TCL_OK;
}

// Run the event loop until the daemon owns its name. Null: as turn.
Server* serveLater(Interpreter& i, Comm& comm, const Server::Wanted& wanted) {
    constexpr std::int64_t kLongest = 500'000'000;      // [ns] until it looks again
    Tcl_Interp* const interp = i.interp;
    comm.await(wanted);
    for (;;) {
        if (Server* server = comm.serveIfFree(wanted)) return server;
        if (turn(i, monotonicNow() + kLongest)) continue;
        if (!Tcl_InterpDeleted(interp)) comm.unserve(wanted.name, {});
        return nullptr;
    }
}

// Run the event loop until unserve: at tclsh's own prompt none runs. False: as turn.
bool waitForEnd(Interpreter& i, Comm& comm, const std::string& name) {
    while (comm.findServer(name))
        if (!turn(i, INT64_MAX)) return false;
    return true;
}

// The words after sorma::serve's name.
struct ServeWords {
    Server::Wanted wanted;
    std::string address;                                // the last option that says where to listen
    std::vector<std::string> lines;                     // of the policy
    std::string policy;
    bool open = false, host = false, standby = false, wait = false;
};
struct ServeOption {
    std::string_view name, value;                       // value: for the usage; empty: it has none
    bool listens;                                       // it says how to listen, so it does not go with -connection
    void (*take)(ServeWords& to, const std::string& option, Tcl_Obj* value);
};
constexpr ServeOption kServeOptions[] = {
    {"-port", "number", true, [](auto& to, auto& option, Tcl_Obj* v) {
        const std::string value = toUtf8(v);
        to.wanted.port = value.empty() ? -1 : int(wholeNumber(option, value, 0, 65535));
    }},
    {"-host", "name", true, [](auto& to, auto&, Tcl_Obj* v) { to.wanted.host = toUtf8(v), to.host = true; }},
    {"-socket", "path", true, [](auto& to, auto&, Tcl_Obj* v) { to.wanted.socket = toUtf8(v); }},
    {"-rpcbind", "boolean", true, [](auto& to, auto&, Tcl_Obj* v) { to.wanted.rpcbind = toBoolean(v); }},
    {"-program", "number", true, [](auto& to, auto& option, Tcl_Obj* v) { to.wanted.program = std::uint32_t(wholeNumber(option, toUtf8(v), 1, 0x1fffffff)); }},
    {"-listen", "descriptors", true, [](auto& to, auto& option, Tcl_Obj* v) { to.wanted.listen = descriptors(option, v); }},
    {"-connection", "descriptor", false, [](auto& to, auto& option, Tcl_Obj* v) { to.wanted.connection = int(wholeNumber(option, toUtf8(v), 0, INT_MAX)); }},
    {"-allow", "line", false, [](auto& to, auto&, Tcl_Obj* v) { to.lines.push_back(toUtf8(v)); }},
    {"-policy", "file", false, [](auto& to, auto&, Tcl_Obj* v) { to.policy = toUtf8(v); }},
    {"-open", "boolean", false, [](auto& to, auto&, Tcl_Obj* v) { to.open = toBoolean(v); }},
    {"-share", "boolean", true, [](auto& to, auto&, Tcl_Obj* v) { to.wanted.share = toBoolean(v); }},
    {"-tls", "no|yes|only", true, [](auto& to, auto&, Tcl_Obj* v) { to.wanted.tls = tlsOf(toUtf8(v)); }},
    {"-directory", "boolean", true, [](auto& to, auto&, Tcl_Obj* v) { to.wanted.directory = toBoolean(v); }},
    {"-standby", "boolean", true, [](auto& to, auto&, Tcl_Obj* v) { to.standby = toBoolean(v); }},
    {"-owned", "pattern", true, [](auto& to, auto&, Tcl_Obj* v) { to.wanted.owned.push_back(toUtf8(v)); }},
    {"-wait", "", false, [](auto& to, auto&, Tcl_Obj*) { to.wait = true; }},
};

std::string serveUsage() {
    std::string out = "name";
    for (auto& option : kServeOptions) out += " ?" + std::string(option.name) + (option.value.empty() ? "" : " ") + std::string(option.value) + '?';
    return out;
}

const ServeOption& serveOption(const std::string& name) {
    std::vector<std::string> names;
    for (auto& option : kServeOptions) {
        if (option.name == name) return option;
        names.emplace_back(option.name);
    }
    fail(kServeOption, name, didYouMean(name, names), oneOf(names));
}

// sorma::serve name ?OPTION VALUE ...?, as kServeOptions says
int ServeObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        if (objc < 2) {
            Tcl_WrongNumArgs(interp, 1, objv, serveUsage().c_str());
            return TCL_ERROR;
        }
        ServeWords words;
        auto& [wanted, address, lines, policy, open, host, standby, wait] = words;
        wanted.name = toUtf8(objv[1]);
        if (wanted.name.starts_with('-')) fail(kServeName, wanted.name);    // a forgotten name, else the value is taken for an option
        for (int at = 2; at < objc; ++at) {
            const std::string name = toUtf8(objv[at]);
            const ServeOption& option = serveOption(name);
            if (!option.value.empty() && ++at == objc) fail(kServeMissing, name);
            option.take(words, name, objv[at]);
            if (option.listens) address = name;
        }
        if (wanted.connection >= 0 && !address.empty()) fail(kServeConnection, address);
        if (standby && (wanted.connection >= 0 || !wanted.listen.empty())) fail(kServeStandby, wanted.connection >= 0 ? "-connection" : "-listen");
        wanted.directory = wanted.directory || standby;
        if (!wanted.owned.empty() && !wanted.directory) fail(kServeOwned);
        // The policy is the interpreter's: what one daemon of it is told holds for all.
        auto& access = i.sorm.access;
        if (policy.empty()) access.loadDefault();
        else access.load(policy);
        for (auto& line : lines) access.add(line, "-allow");
        if (open) access.setOpen(true);
        auto& comm = commOf(i);
        // Other hosts are to find it there, so it listens for them.
        if (wanted.directory && comm.directory().remote()) {
            if (wanted.port < 0) wanted.port = 0;
            if (!host) wanted.host = "0.0.0.0";
        }
        Server* const server = standby ? serveLater(i, comm, wanted) : &comm.serve(wanted);
        if (!server) return TCL_ERROR;
        Obj served(describe(*server));
        if (wait && !waitForEnd(i, comm, wanted.name)) return TCL_ERROR;
        Tcl_SetObjResult(interp, served);
        return TCL_OK;
    });
}

// sorma::unserve name ?reason?
int UnserveObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        if (objc != 2 && objc != 3) {
            Tcl_WrongNumArgs(interp, 1, objv, "name ?reason?");
            return TCL_ERROR;
        }
        std::string name = toUtf8(objv[1]);
        commOf(i).unserve(name, objc == 3 ? toUtf8(objv[2]) : "daemon " + name + " has ended its service");
        Tcl_ResetResult(interp);
        return TCL_OK;
    });
}

// sorma::daemons: list of dicts  name state identity process what socket
int DaemonsObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        if (objc != 1) {
            Tcl_WrongNumArgs(interp, 1, objv, nullptr);
            return TCL_ERROR;
        }
        Obj list(Tcl_NewListObj(0, nullptr));
        for (auto& d : commOf(i).daemons()) {
            Tcl_Obj* dict = Tcl_NewDictObj();
            put(dict, "name", d.name);
            put(dict, "state", d.state);
            put(dict, "identity", d.identity);
            put(dict, "process", std::to_string(d.process));
            put(dict, "what", d.what);
            put(dict, "socket", d.socket);
            Tcl_ListObjAppendElement(nullptr, list, dict);
        }
        Tcl_SetObjResult(interp, list);
        return TCL_OK;
    });
}

// sorma::RuntimeSocket name: where a daemon of that name listens on this host.
int RuntimeSocketObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        if (objc != 2) {
            Tcl_WrongNumArgs(interp, 1, objv, "name");
            return TCL_ERROR;
        }
        Tcl_SetObjResult(interp, newText(runtimeSocket(toUtf8(objv[1]))));
        return TCL_OK;
    });
}

// sorma::SweepSocket name: remove the socket of a daemon of that name that has died. Was there one?
int SweepSocketObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        if (objc != 2) return Tcl_WrongNumArgs(interp, 1, objv, "name"), TCL_ERROR;
        i.sorm.access.need(nullptr, Right::reach, "*", "daemons");
        Tcl_SetObjResult(interp, Tcl_NewWideIntObj(sweepSocket(runtimeSocket(toUtf8(objv[1])))));
        return TCL_OK;
    });
}

// sorma::CheckKeys name: may the key and the certificate of that name be shown now? An error says why not.
int CheckKeysObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    return guarded(*static_cast<Interpreter*>(data), objc, objv, [&] {
        if (objc != 2) return Tcl_WrongNumArgs(interp, 1, objv, "name"), TCL_ERROR;
        tls::check(toUtf8(objv[1]));
        return TCL_OK;
    });
}

// sorma::Visitor certificate: the name in a certificate (DER) that a client has shown. An error says what is wrong with it.
int VisitorObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    return guarded(*static_cast<Interpreter*>(data), objc, objv, [&] {
        if (objc != 2) return Tcl_WrongNumArgs(interp, 1, objv, "certificate"), TCL_ERROR;
        Tcl_Size n = 0;
        const unsigned char* bytes = Tcl_GetByteArrayFromObj(objv[1], &n);
        Tcl_SetObjResult(interp, newText(tls::visitor({reinterpret_cast<const char*>(bytes), bytes ? std::size_t(n) : 0}, "a login by certificate")));
        return TCL_OK;
    });
}

}  // namespace

Comm& commOf(Interpreter& i) { return static_cast<InterpreterComm*>(Tcl_GetAssocData(i.interp, kKey, nullptr))->comm; }

void initCommCommands(Interpreter& i) {
    auto own = std::make_shared<InterpreterComm>(i);
    Tcl_SetAssocData(i.interp, kKey, nullptr, own.get());
    i.atEnd([own]() mutable { own.reset(); });
    initPeerCommands(i, own->comm);
    i.define("serve", ServeObjCmd);
    i.define("unserve", UnserveObjCmd);
    i.define("daemons", DaemonsObjCmd);
    Tcl_CreateObjCommand(i.interp, "::sorma::SweepSocket", SweepSocketObjCmd, &i, nullptr);
    Tcl_CreateObjCommand(i.interp, "::sorma::RuntimeSocket", RuntimeSocketObjCmd, &i, nullptr);
    Tcl_CreateObjCommand(i.interp, "::sorma::CheckKeys", CheckKeysObjCmd, &i, nullptr);
    Tcl_CreateObjCommand(i.interp, "::sorma::Visitor", VisitorObjCmd, &i, nullptr);

    Settings& s = own->comm.settings;
    auto add = [&](const char* name, const char* unit, const char* help, std::int64_t low, std::int64_t high, std::int64_t& value) {
        i.addInteger(name, unit, help, low, high, [&value] { return value; }, [&value, &s, &sorm = i.sorm](std::int64_t v) {
            value = v;
            Server::setLimits(sorm, s);
        });
    };
    i.add({"-transport", "", "to daemons of this user here: auto, shm (memory that both share), or unix (a socket); for the next connection",
           [&s] { return std::string(kSharing[std::size_t(s.sharing)]); }, [&s](const std::string& value) {
               const auto found = std::find(std::begin(kSharing), std::end(kSharing), value);
               if (found == std::end(kSharing)) fail(kBadSharing, value);
               s.sharing = Sharing(found - std::begin(kSharing));
           }});
    constexpr std::int64_t kDay = 86'400'000, kGigabyte = 1 << 30, kTerabyte = kGigabyte << 10, kMany = 1'000'000;
    add("-timeout", "ms", "deadline of a call to another process, 0 = none", 0, 30 * kDay, s.timeout);
    add("-maxmessage", "bytes", "longest message sent or taken", 1024, kGigabyte, s.maxMessage);
    add("-budget", "bytes", "that each host or user may make a daemon of this interpreter keep, 0 = twice -maxmessage", 0, kTerabyte, s.budget);
    add("-totalbudget", "bytes", "that all clients together may make it keep, 0 = eight times -maxmessage", 0, kTerabyte, s.totalBudget);
    add("-maxconnections", "1", "connections that a daemon of this interpreter takes", 1, kMany, s.maxConnections);
    add("-inflight", "1", "calls of one client that a daemon takes at a time", 1, 65536, s.inFlight);
    add("-grace", "ms", "time that a client which lost its connection has to come back before what it holds is freed", 0, kDay, s.grace);
    add("-maxqueue", "events", "events that a daemon keeps for one subscriber, at most", 1, kMany, s.maxQueue);
    add("-requesttime", "ms", "time for a peer to send the rest of a request", 1, kDay, s.requestTime);
    add("-replytime", "ms", "time for a peer to take some of what waits for it", 1, kDay, s.replyTime);
    add("-keepreply", "bytes", "longest reply kept for a client that lost its connection", 0, kGigabyte, s.keepReply);
    add("-onewayqueue", "bytes", "one-way requests that wait on a connection to be sent", 0, kGigabyte, s.onewayQueue);
    add("-onewaywait", "ms", "time that a one-way request waits for room among them, 0 = it fails at once", 0, kDay, s.onewayWait);
    add("-linger", "us", "time that a daemon waits for the next request before the event loop goes on", 0, 100'000, s.linger);
}

}  // namespace sorma
