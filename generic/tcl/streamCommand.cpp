#include "tcl/streamCommand.h"

#include <memory>
#include <string>
#include <utility>

#include "bus/nearest.h"
#include "bus/pieces.h"
#include "bus/requestText.h"
#include "tcl/soCommand.h"
#include "tcl/tclService.h"
#include "tcl/waiting.h"

namespace sorma {

namespace {

const Prototype kRequest{Severity::error, "REQUEST SYNTAX", 0, "bad request \"{}\": must be {{NAME EXEC ?word ...?}} or {{NAME exec ?-text text ...?}}"};
const Prototype kOption{Severity::error, "REQUEST SYNTAX", 0, "bad option \"{}\"{}: must be {}"};
const Prototype kNumber{Severity::error, "REQUEST SYNTAX", 0, "{} expects a whole number from {} to {}, got \"{}\""};
const Prototype kBoth{Severity::error, "REQUEST SYNTAX", 0, "-to and -command exclude each other"};
const Prototype kBadMethod{Severity::error, "REQUEST SYNTAX", 0, "bad method \"{}\"{}: must be close or next"};
const Prototype kTooLate{Severity::error, "COMM TIMEOUT", 1, "{}: no piece in the time given by -timeout; the stream goes on"};

// A stream as a command.
struct StreamCommand {
    Interpreter& interpreter;
    const std::string object, request;      // request: for messages
    const std::int64_t timeout;             // [ms] for each piece; 0: none
    const Obj prefix;                       // -command
    const std::shared_ptr<Reading> reading;
    Tcl_Command token = nullptr;
    Obj name = {};
    bool armed = false;                     // the prefix is called when there is a piece
};

void streamDeleted(ClientData data) {
    std::unique_ptr<StreamCommand> s(static_cast<StreamCommand*>(data));
    s->reading->close();                    // a coroutine that waits for a piece keeps it
}

StreamCommand* findStream(Interpreter& i, Tcl_Obj* name) {
    Tcl_CmdInfo info;
    const bool found = Tcl_GetCommandInfo(i.interp, Tcl_GetString(name), &info) && info.deleteProc == streamDeleted;
    return found ? static_cast<StreamCommand*>(info.objClientData) : nullptr;
}

// Call the prefix once, when a piece, the end or an error is there.
void arm(StreamCommand& s) {
    if (!s.prefix || s.armed || s.reading->ended()) return;
    s.armed = true;
    auto look = [&i = s.interpreter, name = s.name] {
        auto* s = i.closing() ? nullptr : findStream(i, name);
        if (!s) return;
        s->armed = false;
        if (!s->reading->ready()) return arm(*s);
        Obj prefix = s->prefix;
        callBack(i, prefix, {name});
    };
    if (s.reading->ready()) s.interpreter.sorm.mailbox()->post(look);
    else s.reading->coming().then([look](const Future&) { look(); });
}

// Put the next piece into a variable, and return whether there was one; later, when it is not there yet.
int take(Interpreter& i, Tcl_Obj* stream, const std::shared_ptr<Reading>& reading, Obj variable, const std::string& request, Deadline deadline) {
    Interpreter::Entered entered(i);
    try {
        Message piece;
        const auto taken = reading->take(piece);
        if (taken == Reading::Taken::notYet) {
            auto again = [&i, stream = Obj(stream), reading, variable, request, deadline] {
                if (!deadline.passed() || reading->ready()) return take(i, stream, reading, variable, request, deadline);
                return i.raise(Error(makeEntry(kTooLate, {MessageArg::of(request)})).trail, request);
            };
            return waitThen(i, {reading->coming()}, true, deadline, again, true);
        }
        if (taken == Reading::Taken::piece) {
            Obj dict(dictReply(i.constants, piece));
            if (!Tcl_ObjSetVar2(i.interp, variable, nullptr, dict, TCL_LEAVE_ERR_MSG)) return TCL_ERROR;
        }
        if (auto* own = findStream(i, stream)) arm(*own);
        Tcl_SetObjResult(i.interp, i.constants.integer(taken == Reading::Taken::piece));
        return TCL_OK;
    } catch (...) {
        return i.raise(trailOfCurrentException({}), request);
    }
}

int StreamNRCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto* s = static_cast<StreamCommand*>(data);
    Interpreter& i = s->interpreter;
    return guarded(i, objc, objv, [&] {
        if (objc < 2) return Tcl_WrongNumArgs(interp, 1, objv, "method ?varName?"), TCL_ERROR;
        const std::string_view method = view(objv[1]);
        if (method == "next") {
            if (objc != 3) return Tcl_WrongNumArgs(interp, 2, objv, "varName"), TCL_ERROR;
            return take(i, s->name, s->reading, Obj(objv[2]), s->request, s->timeout > 0 ? Deadline::in(s->timeout) : Deadline());
        }
        if (method != "close") fail(kBadMethod, method, didYouMean(std::string(method), {"close", "next"}));
        if (objc != 2) return Tcl_WrongNumArgs(interp, 2, objv, nullptr), TCL_ERROR;
        Tcl_DeleteCommandFromToken(interp, s->token);
        return TCL_OK;
    });
}

int StreamObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    return Tcl_NRCallObjProc(interp, StreamNRCmd, data, objc, objv);
}

// The options of sorma::stream.
struct Options {
    Reading::How how;
    std::int64_t timeout = 25'000;
    Obj prefix, channel;
};

Options optionsOf(int objc, Tcl_Obj* const objv[]) {
    static const std::vector<std::string> known{"-ahead", "-command", "-piece", "-timeout", "-to"};
    Options o;
    for (int at = 2; at + 1 < objc; at += 2) {
        const std::string option = toUtf8(objv[at]);
        auto number = [&](std::int64_t low, std::int64_t high) {
            std::int64_t n = 0;
            const std::string value = toUtf8(objv[at + 1]);
            if (!parseNumber(value, n) || n < low || n > high) fail(kNumber, option, low, high, value);
            return n;
        };
        if (option == "-command") o.prefix = Obj(objv[at + 1]);
        else if (option == "-to") o.channel = Obj(objv[at + 1]);
        else if (option == "-piece") o.how.most = std::size_t(number(1024, Reading::kMostPiece));
        else if (option == "-ahead") o.how.ahead = std::size_t(number(1, Reading::kMostAhead));
        else if (option == "-timeout") o.timeout = number(0, 1'000'000'000);
        else fail(kOption, option, didYouMean(option, known), oneOf(known));
    }
    if (o.prefix && o.channel) fail(kBoth);
    return o;
}

struct Streams {
    Interpreter& interpreter;
    std::uint64_t last = 0;
};

// sorma::stream request ?-piece bytes? ?-ahead n? ?-timeout ms? ?-to channel? ?-command prefix?
int OpenNRCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& streams = *static_cast<Streams*>(data);
    Interpreter& i = streams.interpreter;
    return guarded(i, objc, objv, [&] {
        if (objc < 2 || objc % 2 != 0)
            return Tcl_WrongNumArgs(interp, 1, objv, "request ?-piece bytes? ?-ahead n? ?-timeout ms? ?-to channel? ?-command prefix?"), TCL_ERROR;
        const Options o = optionsOf(objc, objv);
        if (o.channel && !Tcl_GetChannel(interp, Tcl_GetString(o.channel), nullptr)) return TCL_ERROR;
        const auto words = listElements(objv[1]);
        const std::string_view method = words.size() > 1 ? view(words[1]) : std::string_view();
        const std::string text = toUtf8(objv[1]);
        if (method != "EXEC" && method != "exec") fail(kRequest, text);
        const std::string object = toUtf8(words[0]);
        Message request;
        if (method == "EXEC") readParts(object, words.subspan(2), request);
        else readOptions(object, words.subspan(2), request);
        Reference so = objectOf(i, object);
        std::shared_ptr<Reading> reading;
        {
            InCoroutine context(i, coroutineName(i));
            reading = std::make_shared<Reading>(std::move(so), request, o.how);
        }
        auto* s = new StreamCommand{i, object, text, o.timeout, o.prefix, std::move(reading)};
        const std::string command = "::sorma::streams::s" + std::to_string(++streams.last);
        s->name = newText(command);
        s->token = Tcl_NRCreateCommand(interp, command.c_str(), StreamObjCmd, StreamNRCmd, s, streamDeleted);
        Obj name = s->name;
        if (o.channel) {
            Obj call(Tcl_NewListObj(0, nullptr));
            for (Tcl_Obj* word : {newText("::sorma::tcloo::StreamTo"), static_cast<Tcl_Obj*>(name), static_cast<Tcl_Obj*>(o.channel)})
                Tcl_ListObjAppendElement(nullptr, call, word);
            return Tcl_NREvalObj(interp, call, 0);
        }
        arm(*s);
        Tcl_SetObjResult(interp, name);
        return TCL_OK;
    });
}

int OpenObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    return Tcl_NRCallObjProc(interp, OpenNRCmd, data, objc, objv);
}

}  // namespace

void initStreamCommand(Interpreter& i) {
    auto own = std::make_shared<Streams>(Streams{i});
    Tcl_CreateNamespace(i.interp, "::sorma::streams", nullptr, nullptr);
    Tcl_NRCreateCommand(i.interp, "::sorma::stream", OpenObjCmd, OpenNRCmd, own.get(), nullptr);
    Tcl_Export(i.interp, Tcl_FindNamespace(i.interp, "::sorma", nullptr, 0), "stream", 0);
    Tcl_Export(i.interp, Tcl_FindNamespace(i.interp, "::sorma", nullptr, 0), "piece", 0);
    i.addInteger("-streamtime", "s", "how long a stream of this process stays open that nobody reads", 1, 1'000'000,
                 [&i] { return i.sorm.streamTime; }, [&i](std::int64_t s) { i.sorm.streamTime = s; });
    i.atEnd([own]() mutable { own.reset(); });
}

}  // namespace sorma
