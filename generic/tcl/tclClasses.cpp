#include "tcl/tclServiceParts.h"

#include <cctype>
#include <fstream>
#include <iterator>

#include "tcl/commandFrame.h"
#include "tcl/errorPlace.h"

namespace sorma {

namespace tcloo {

namespace {

const Prototype kStack{Severity::verbose, "SERVICE STACK", 1, "{}: {}"};

void classDeleted(ClientData data) {
    auto* handle = static_cast<ClassHandle*>(data);
    TclClass& c = **handle;
    c.tcl = nullptr;
    if (!c.interpreter->closing() && !c.service.empty()) c.interpreter->sorm.forget(c.service);
    delete handle;
}
void objectDeleted(ClientData data) { static_cast<TclService*>(data)->objectDeleted(); }

// oo::copy. Without these the copy would have the same pointer. A class keeps its declarations; declarationsOf gives it its name.
int classCopied(Tcl_Interp*, ClientData from, ClientData* to) {
    auto made = std::make_shared<TclClass>(**static_cast<ClassHandle*>(from));
    made->tcl = nullptr;
    made->service.clear();
    *to = new ClassHandle(made);
    return TCL_OK;
}
int objectCopied(Tcl_Interp*, ClientData, ClientData* to) {
    *to = nullptr;          // its first request makes it a service object of its own
    return TCL_OK;
}

std::string lower(std::string text) {
    for (char& c : text) c = char(std::tolower(static_cast<unsigned char>(c)));
    return text;
}

std::string tailOf(const std::string& path) {
    auto slash = path.rfind('/');
    return slash == std::string::npos ? path : path.substr(slash + 1);
}

}  // namespace

const Tcl_ObjectMetadataType kClassData = {TCL_OO_METADATA_VERSION_CURRENT, "sorma::Class", classDeleted, classCopied};
const Tcl_ObjectMetadataType kObjectData = {TCL_OO_METADATA_VERSION_CURRENT, "sorma::Object", objectDeleted, objectCopied};

// A class of Tcl may be called anything; what no name of SORMA may hold becomes a _.
std::string serviceName(std::string_view tclClass) {
    auto at = tclClass.rfind("::");
    std::string name = lower(std::string(at == std::string_view::npos ? tclClass : tclClass.substr(at + 2)));
    for (char& c : name)
        if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
    return name;
}

std::string objectName(Tcl_Interp* interp, Tcl_Object object) { return toUtf8(Tcl_GetObjectName(interp, object)); }

TclClass& declarationsOf(Interpreter& i, Tcl_Class type) {
    auto* known = static_cast<ClassHandle*>(Tcl_ClassGetMetadata(type, &kClassData));
    if (known && (*known)->tcl) return **known;
    auto made = known ? *known : std::make_shared<TclClass>();
    made->interpreter = &i;
    made->tcl = type;
    made->service = serviceName(objectName(i.interp, Tcl_GetClassAsObject(type)));
    if (!known) Tcl_ClassSetMetadata(type, &kClassData, new ClassHandle(made));
    answerRequests(i, Tcl_GetClassAsObject(type));
    return *made;
}

// ---- small evaluations ----

bool eval(Interpreter& i, std::initializer_list<Tcl_Obj*> words, int flags) {
    std::vector<Obj> keep(words.begin(), words.end());
    std::vector<Tcl_Obj*> objv(words);
    return Tcl_EvalObjv(i.interp, int(objv.size()), objv.data(), flags) == TCL_OK;
}

std::string whereAmI(Interpreter& i, std::string& file, int& line, bool resumed) {
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

namespace {

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

}  // namespace

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
    // A code of the class's own, or of a library. Tcl's own codes for a fault in a script do not count.
    bool foreign = !ours && !words.empty() && words[0] != "NONE" && words[0] != "TCL" && words[0] != "ARITH" && words[0] != "SORMA";
    if (ours || foreign) {
        // Raised by one of our own commands below: its trail says more than a Tcl error can.
        const Trail& last = i.sorm.lastTrail();
        if (const Entry* cause = last.cause(); cause && cause->severity == Severity::error && cause->text == text) {
            Obj lastCode(errorCode(*cause));
            if (view(lastCode) == view(errorCodeValue)) return last;
        }
    }
    Entry e = ours ? Entry{} : makeEntry(foreign ? kForeignCode : kTcl, {MessageArg::of(so), MessageArg::of(text)});
    if (ours) {
        e.symbol = words[1] + " " + words[2];
        e.details.assign(words.begin() + 3, words.end());
        e.text = text;
        e.time = makeEntry(kTcl, {}).time;
    }
    if (foreign) e.details.insert(e.details.end(), words.begin(), words.end());
    e.so = so;
    e.file = type.file();
    e.line = type.line();
    Trail trail;
    std::string info = ours ? std::string() : errorInfoOf(options);
    if (info.empty()) {
        trail.add(std::move(e));
        return trail;
    }
    // The stack trace is an entry after the error, so that it reaches callers in other processes, too.
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

std::vector<std::string> tclClasses(Interpreter& i) {
    if (Tcl_EvalEx(i.interp, "::sorma::tcloo::Classes", -1, TCL_EVAL_GLOBAL) != TCL_OK) return {};
    Obj list(Tcl_GetObjResult(i.interp));
    return listStrings(list);
}

}  // namespace tcloo

}  // namespace sorma
