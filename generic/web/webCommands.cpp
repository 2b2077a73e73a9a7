// webCommands.cpp -- the package sorma::webServer, as library/web/web.tcl uses it.
//
//     sorma::WebServer open -port n -command prefix ?-host address? ?-keys pem? ?-authority pem? ?-connections n? ?-each n? ?-body bytes?
//         ?-held bytes? ?-rate n? ?-patience s?               its port
//     sorma::WebServer answer number status headers body      headers: a list of names and values; the body is bytes
//     sorma::WebServer stream number status headers           the answer goes on: write and end
//     sorma::WebServer write number bytes
//     sorma::WebServer end number
//     sorma::WebServer waiting number                         bytes of a stream that the client has not taken
//     sorma::WebServer close
//     sorma::WebServer crypt password hash                    the hash of a password as crypt(3) makes it, with the salt of another one
//
// prefix is called with request NUMBER DICT (method path query headers body from certificate, all of it bytes), drained NUMBER, and ended NUMBER. Its
// errors are background errors. answer, stream, write and end return 0 when the client has gone. One server an interpreter.
#include <crypt.h>

#include <algorithm>
#include <map>
#include <memory>
#include <stdexcept>

#include "tcl/tclShim.h"
#include "web/webServer.h"

namespace {

using namespace sorma;
using sorma::web::Pairs;
using sorma::web::Request;
using sorma::web::Server;

struct Package {
    Tcl_Interp* interp;
    Obj prefix;
    std::unique_ptr<Server> server;
    Tcl_TimerToken timer = nullptr;
    bool turning = false, closing = false;

    void close() {
        if (turning) {
            closing = true;
            return;
        }
        if (timer) Tcl_DeleteTimerHandler(timer);
        timer = nullptr;
        if (server) Tcl_DeleteFileHandler(server->descriptor());
        server.reset();
    }
};

Tcl_Obj* bytesOf(const std::string& text) {
    return Tcl_NewByteArrayObj(reinterpret_cast<const unsigned char*>(text.data()), Tcl_Size(text.size()));
}

Tcl_Obj* pairsOf(const Pairs& pairs) {
    Tcl_Obj* list = Tcl_NewListObj(0, nullptr);
    for (auto& [name, value] : pairs) {
        Tcl_ListObjAppendElement(nullptr, list, bytesOf(name));
        Tcl_ListObjAppendElement(nullptr, list, bytesOf(value));
    }
    return list;
}

void put(Tcl_Obj* dict, const char* key, Tcl_Obj* value) { Tcl_DictObjPut(nullptr, dict, Tcl_NewStringObj(key, -1), value); }

// The server calls this within a turn, and never destroys itself by it.
void tell(Package& p, Server::What what, std::int64_t number, const Request* request) {
    Obj command(Tcl_DuplicateObj(p.prefix));
    const char* word = what == Server::What::request ? "request" : what == Server::What::drained ? "drained" : "ended";
    Tcl_ListObjAppendElement(nullptr, command, Tcl_NewStringObj(word, -1));
    Tcl_ListObjAppendElement(nullptr, command, Tcl_NewWideIntObj(number));
    if (request) {
        Tcl_Obj* dict = Tcl_NewDictObj();
        put(dict, "method", bytesOf(request->method));
        put(dict, "path", bytesOf(request->path));
        put(dict, "query", pairsOf(request->query));
        put(dict, "headers", pairsOf(request->headers));
        put(dict, "body", bytesOf(request->body));
        put(dict, "from", bytesOf(request->from));
        put(dict, "certificate", bytesOf(request->certificate));
        Tcl_ListObjAppendElement(nullptr, command, dict);
    }
    if (Tcl_InterpDeleted(p.interp)) return;
    if (Tcl_EvalObjEx(p.interp, command, TCL_EVAL_GLOBAL | TCL_EVAL_DIRECT) != TCL_OK) {
        Tcl_BackgroundException(p.interp, TCL_ERROR);
        static const std::string sorry = "an error of the server\n";
        if (request) p.server->answer(number, 500, {{"Content-Type", "text/plain"}}, sorry);
    }
    Tcl_ResetResult(p.interp);
}

void turn(ClientData data);
void readable(ClientData data, int) { turn(data); }
void turn(ClientData data) {
    auto& p = *static_cast<Package*>(data);
    if (p.turning || !p.server) return;     // a callback runs the event loop: the turn below on the stack goes on afterwards
    if (p.timer) Tcl_DeleteTimerHandler(p.timer);
    p.timer = nullptr;
    Tcl_Preserve(p.interp);
    Tcl_Interp* interp = p.interp;
    p.turning = true;
    const int wait = p.server->turn();
    p.turning = false;
    if (p.closing) p.close();
    else if (wait >= 0) p.timer = Tcl_CreateTimerHandler(wait, turn, &p);
    Tcl_Release(interp);
}

// The answer goes out in a turn of its own.
void soon(Package& p) {
    if (p.turning) return;
    if (p.timer) Tcl_DeleteTimerHandler(p.timer);
    p.timer = Tcl_CreateTimerHandler(0, turn, &p);
}

int failWith(Tcl_Interp* interp, const char* symbol, const std::string& message) {
    Tcl_SetObjResult(interp, Tcl_NewStringObj(message.data(), Tcl_Size(message.size())));
    Tcl_SetErrorCode(interp, "SORMA", "WEB", symbol, nullptr);
    return TCL_ERROR;
}

int takeBytes(Tcl_Interp* interp, Tcl_Obj* o, std::string& out) {
    Tcl_Size n = 0;
    const unsigned char* bytes = Tcl_GetByteArrayFromObj(o, &n);
    if (!bytes) return failWith(interp, "BYTES", "an answer is bytes: use encoding convertto");
    out.assign(reinterpret_cast<const char*>(bytes), std::size_t(n));
    return TCL_OK;
}

int takePairs(Tcl_Interp* interp, Tcl_Obj* o, Pairs& out) {
    Tcl_Size n = 0;
    Tcl_Obj** words = nullptr;
    if (Tcl_ListObjGetElements(interp, o, &n, &words) != TCL_OK) return TCL_ERROR;
    for (Tcl_Size k = 0; k + 1 < n; k += 2) out.emplace_back(view(words[k]), view(words[k + 1]));
    return TCL_OK;
}

int OpenCmd(Package& p, int objc, Tcl_Obj* const objv[]) {
    static const char* const options[] = {"-authority", "-body", "-command", "-connections", "-each", "-held", "-host", "-keys", "-patience", "-port", "-rate", nullptr};
    enum { authorityOption, bodyOption, commandOption, connectionsOption, eachOption, heldOption, hostOption, keysOption, patienceOption, portOption, rateOption };
    web::Limits limits;
    web::Place place;
    int body = int(limits.body), connections = int(limits.connections), each = 0, held = int(limits.held), patience = int(limits.patience), rate = int(limits.rate);
    std::map<int, int*> numbers{{bodyOption, &body}, {connectionsOption, &connections}, {eachOption, &each}, {heldOption, &held}, {patienceOption, &patience}, {portOption, &place.port}, {rateOption, &rate}};
    std::map<int, std::string*> texts{{authorityOption, &place.authority}, {hostOption, &place.host}, {keysOption, &place.keys}};
    if (objc % 2 != 0) return Tcl_WrongNumArgs(p.interp, 2, objv, "?-option value ...?"), TCL_ERROR;
    for (int k = 2; k < objc; k += 2) {
        int option;
        if (Tcl_GetIndexFromObj(p.interp, objv[k], options, "option", 0, &option) != TCL_OK) return TCL_ERROR;
        if (option == commandOption) p.prefix = objv[k + 1];
        else if (texts.contains(option)) *texts[option] = view(objv[k + 1]);
        else if (Tcl_GetIntFromObj(p.interp, objv[k + 1], numbers[option]) != TCL_OK) return TCL_ERROR;
    }
    if (p.server) return failWith(p.interp, "BUSY", "this interpreter has a server of the web already");
    limits.body = std::size_t(std::max(body, 0));
    limits.connections = unsigned(std::max(connections, 1));
    limits.each = unsigned(std::max(each, 0));
    limits.held = std::size_t(std::max(held, 0));
    limits.patience = unsigned(std::max(patience, 1));
    limits.rate = unsigned(std::max(rate, 1));
    try {
        p.server = std::make_unique<Server>(place, limits, [&p](auto what, auto number, auto* request) { tell(p, what, number, request); });
    } catch (const std::exception& error) {
        return failWith(p.interp, "PORT", error.what());
    }
    Tcl_CreateFileHandler(p.server->descriptor(), TCL_READABLE, readable, &p);
    Tcl_SetObjResult(p.interp, Tcl_NewWideIntObj(p.server->port()));
    return TCL_OK;
}

int WebServerObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& p = *static_cast<Package*>(data);
    static const char* const words[] = {"answer", "close", "crypt", "end", "open", "stream", "waiting", "write", nullptr};
    enum { answerWord, closeWord, cryptWord, endWord, openWord, streamWord, waitingWord, writeWord };
    static const int counts[] = {6, 2, 4, 3, 0, 5, 3, 4};
    static const char* const usages[] = {"number status headers body", nullptr, "password hash", "number", nullptr, "number status headers", "number", "number bytes"};
    int word, status = 0;
    Tcl_WideInt number = 0;
    if (objc < 2) return Tcl_WrongNumArgs(interp, 1, objv, "subcommand ?arg ...?"), TCL_ERROR;
    if (Tcl_GetIndexFromObj(interp, objv[1], words, "subcommand", 0, &word) != TCL_OK) return TCL_ERROR;
    if (word == openWord) return OpenCmd(p, objc, objv);
    if (objc != counts[word]) return Tcl_WrongNumArgs(interp, 2, objv, usages[word]), TCL_ERROR;
    if (word == closeWord) return p.close(), TCL_OK;
    if (word == cryptWord) {
        auto work = std::make_unique<crypt_data>();
        const char* hash = crypt_r(Tcl_GetString(objv[2]), Tcl_GetString(objv[3]), work.get());
        if (!hash || *hash == '*') return failWith(interp, "HASH", "crypt(3) does not know this kind of hash");
        Tcl_SetObjResult(interp, Tcl_NewStringObj(hash, -1));
        return TCL_OK;
    }
    if (Tcl_GetWideIntFromObj(interp, objv[2], &number) != TCL_OK) return TCL_ERROR;
    Tcl_WideInt result = 0;
    Pairs headers;
    std::string bytes;
    if (word == answerWord || word == streamWord) {
        if (Tcl_GetIntFromObj(interp, objv[3], &status) != TCL_OK || takePairs(interp, objv[4], headers) != TCL_OK) return TCL_ERROR;
        if (status < 200 || status > 599) return failWith(interp, "STATUS", "a status is from 200 to 599");
    }
    if ((word == answerWord || word == writeWord) && takeBytes(interp, objv[objc - 1], bytes) != TCL_OK) return TCL_ERROR;
    try {
        if (!p.server) result = 0;
        else if (word == answerWord) result = p.server->answer(number, unsigned(status), headers, bytes);
        else if (word == streamWord) result = p.server->stream(number, unsigned(status), headers);
        else if (word == writeWord) result = p.server->write(number, bytes);
        else if (word == endWord) result = p.server->end(number);
        else result = Tcl_WideInt(p.server->waiting(number));
    } catch (const std::exception& error) {
        return failWith(interp, "MEMORY", error.what());
    }
    if (result && word != waitingWord) soon(p);
    Tcl_SetObjResult(interp, Tcl_NewWideIntObj(result));
    return TCL_OK;
}

void deleted(ClientData data) {
    auto* p = static_cast<Package*>(data);
    if (p->turning) return;                 // it stands below on the stack, and is left to the end of the process
    p->close();
    delete p;
}

}  // namespace

extern "C" DLLEXPORT int Sormaweb_Init(Tcl_Interp* interp) {
    if (!Tcl_InitStubs(interp, "8.6-", 0)) return TCL_ERROR;
    if (!Tcl_FindNamespace(interp, "::sorma", nullptr, 0)) Tcl_CreateNamespace(interp, "::sorma", nullptr, nullptr);
    Tcl_CreateObjCommand(interp, "::sorma::WebServer", WebServerObjCmd, new Package{interp, {}, nullptr}, deleted);
    return Tcl_PkgProvideEx(interp, "sorma::webServer", "1.0", nullptr);
}
