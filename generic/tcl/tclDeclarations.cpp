#include "bus/nearest.h"
#include "tcl/tclServiceParts.h"

#include <algorithm>

#include "bus/requestText.h"

namespace sorma {

using namespace tcloo;

namespace {

const Prototype kDeclaration{Severity::error, "CLASS TABLE", 0, "{}: {}"};
const Prototype kOutside{Severity::error, "CLASS TABLE", 0,
                         "{} declares a service class: use it in the body of a class, after \"superclass sorma::Service\""};

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
        if (!c->concurrency.empty())
            made.concurrency(c->concurrency == "concurrent" ? Concurrency::concurrent : c->concurrency == "exclusive" ? Concurrency::exclusive : Concurrency::serial);
        if (!c->flavors.empty()) made.flavors(c->flavors == "dictionary" ? Flavors::dictionary : Flavors::any);
        if (c->testedAtBirth > 0) made.testedAtBirth(c->testedAtBirth);
        if (!c->file.empty()) made.declaredAt(c->file, c->line);
        for (auto& d : c->options) {
            std::size_t index = made.options().size();
            Option o = d.option;
            o.get = [index](const Service& s) { return static_cast<const TclService&>(s).value(index); };
            if (!d.measured) o.set = [index](Service& s, const Value& v) { static_cast<TclService&>(s).setValue(index, v); };
            if (o.type == Type::service)
                o.refer = [index](Service& s, Reference r) { static_cast<TclService&>(s).setService(index, std::move(r)); };
            made.option(std::move(o));
        }
        for (auto& word : c->wordKinds) made.untypedWord(word.verb, word.at, word.kind);
        for (auto& a : c->actions) made.action(a);
        for (auto& a : c->inspections) made.inspection(a, a.right);
        for (auto& [danger, words] : c->dangers) made.execDanger(danger, words);
        for (auto& words : c->repeatables) made.repeatable(words);
        for (auto& p : c->reads) made.reads(p.field, p.count, p.unit, p.help, p.low, p.high);
        for (auto& p : c->writes) made.writes(p.field, p.count, p.unit, p.help);
    }
    return made;
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

// After a declaration, which returns nothing: what the SORM knows of the class is out of date, also for classes derived from it.
void declared(Interpreter& i, TclClass& c) {
    i.sorm.forget(c.service);
    for (auto& name : tclClasses(i)) {
        if (!i.sorm.findClass(serviceName(name))) continue;
        auto line = lineage(i, name);
        if (std::find(line.begin(), line.end(), &c) != line.end()) i.sorm.forget(serviceName(name));
    }
    Tcl_ResetResult(i.interp);      // where the class was looked for, its name stands
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

// The end of an error about an unknown word: the near one, and all that there are.
std::string nearAndOneOf(Tcl_Obj* word, const std::vector<std::string>& words) {
    return "\"" + toUtf8(word) + "\"" + didYouMean(toUtf8(word), words) + ": must be " + oneOf(words);
}

Danger danger(Tcl_Obj* command, const std::string& word, Tcl_Obj* value) {
    Danger out = Danger::none;
    if (!fromText(view(value), out))
        bad(command, word + ": bad danger " + nearAndOneOf(value, {"fire", "move", "power", "stop"}));
    return out;
}

// Take a word after the type, such as -unit m/s.
void takeFact(Tcl_Obj* command, Tcl_Obj* key, Tcl_Obj* value, OptionDeclaration& d) {
    Option& o = d.option;
    std::string_view word = view(key);
    if (word == "-unit") {
        o.spec.unit = toUtf8(value);
    } else if (word == "-help") {
        o.spec.help = toUtf8(value);
    } else if (word == "-fixed") {
        o.spec.fixed = toBoolean(value);
    } else if (word == "-measured") {
        d.measured = toBoolean(value);
    } else if (word == "-choices") {
        o.choices = listStrings(value);
    } else if (word == "-length") {
        Count n = count(command, value);
        o.spec.minLength = n.low;
        o.spec.maxLength = n.high;
    } else if (word == "-range" || word == "-warn" || word == "-alarm") {
        auto ends = listElements(value);
        if (ends.size() != 2) bad(command, o.name + ": " + toUtf8(key) + " must be {low high}");
        Limits l{bound(ends[0], -kInfinity), bound(ends[1], kInfinity)};
        if (word == "-range") o.spec.low = l.low, o.spec.high = l.high;
        else (word == "-warn" ? o.spec.warn : o.spec.alarm) = l;
    } else if (word == "-kind") {
        if (!fromText(view(value), o.spec.kind))
            bad(command, o.name + ": bad kind \"" + toUtf8(value) + "\": must be " + oneOf({"address", "colour", "file", "folder", "program", "segment", "time"}));
    } else if (word == "-danger") {
        o.spec.danger = danger(command, o.name, value);
    } else if (word == "-names") {
        o.spec.names = listStrings(value);
    } else if (word == "-group") {
        o.spec.group = toUtf8(value);
    } else if (word == "-expert") {
        o.spec.expert = toBoolean(value);
    } else if (word == "-secret") {
        o.spec.secret = toBoolean(value);
    } else {
        bad(command, "unknown word " + nearAndOneOf(key, {"-alarm", "-choices", "-danger", "-default", "-expert", "-fixed", "-group", "-help", "-kind", "-length", "-measured", "-names", "-range",
                                "-secret", "-unit", "-warn"}));
    }
}

// The default of an option that declares none: nothing, or the number nearest to 0.
Value usualDefault(const Option& o) {
    const double nearest = std::clamp(0.0, o.spec.low, o.spec.high);
    switch (o.type) {
        case Type::flag: return false;
        case Type::integer: return std::int64_t(nearest);
        case Type::real: return nearest;
        case Type::choice: return o.choices[0];
        case Type::vector: return std::vector<double>(o.spec.minLength, nearest);
        default: return std::string();
    }
}

int OptionObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        if (objc < 3 || objc % 2 == 0)
            return wrongArgs(interp, objv, "-name type ?-unit u? ?-range {low high}? ?-choices list? ?-length n? ?-default value? "
                                           "?-fixed boolean? ?-measured boolean? ?-warn {low high}? ?-alarm {low high}? ?-kind address|file|folder|segment|program|colour|time? "
                                           "?-names list? ?-group name? ?-expert boolean? ?-danger move|power|fire? ?-secret boolean? ?-help text?");
        TclClass& c = target(i, objv[0]);
        OptionDeclaration d;
        Option& o = d.option;
        o.name = toUtf8(objv[1]);
        if (o.name.size() < 2 || o.name[0] != '-') bad(objv[0], "bad name \"" + o.name + "\": must begin with a dash");
        for (auto* ancestor : lineage(i, objectName(interp, Tcl_GetClassAsObject(c.tcl))))
            for (auto& known : ancestor->options)
                if (known.option.name == o.name) bad(objv[0], o.name + " is declared twice");
        if (!fromText(view(objv[2]), o.type))
            bad(objv[0], "bad type " + nearAndOneOf(objv[2], {"double", "enum", "flag", "int", "service", "string", "vector"}));
        Tcl_Obj* initial = nullptr;
        for (int k = 3; k < objc; k += 2) {
            if (view(objv[k]) == "-default") initial = objv[k + 1];
            else takeFact(objv[0], objv[k], objv[k + 1], d);
        }
        if (o.type == Type::choice && o.choices.empty()) bad(objv[0], o.name + ": an enum needs -choices");
        if (auto m = o.misfit(); !m.empty()) bad(objv[0], o.name + ' ' + m);
        if (d.measured && o.type == Type::service) bad(objv[0], o.name + " of type service cannot be measured");
        d.initial = initial ? o.parse(c.service, toUtf8(initial)) : usualDefault(o);
        c.options.push_back(std::move(d));
        declared(i, c);
        return TCL_OK;
    });
}

Kind kindOf(Tcl_Obj* command, const std::string& where, Tcl_Obj* o) {
    Kind kind = Kind::plain;
    if (!fromText(view(o), kind) || !carriesRight(kind))
        bad(command, where + ": bad kind \"" + toUtf8(o) + "\": must be address, file, folder, program, or segment");
    return kind;
}

// {argument kind ...} of an action. The kind of args holds for all words that it takes.
template <class Parameters, class Kinds>
std::vector<Kind> kindsOf(Tcl_Obj* command, const Action& a, const Parameters& parameters, const Kinds& kinds) {
    if (kinds.size() % 2) bad(command, a.name + ": -kinds must be {argument kind ...}");
    std::vector<Kind> out(parameters.size() + (a.maxArgs == Action::kRest ? 0 : 1), Kind::plain);
    for (std::size_t k = 0; k < kinds.size(); k += 2) {
        auto at = std::find_if(parameters.begin(), parameters.end(), [&](Tcl_Obj* p) { return view(listElements(p)[0]) == view(kinds[k]); });
        if (at == parameters.end()) bad(command, a.name + ": -kinds: there is no argument \"" + toUtf8(kinds[k]) + "\"");
        out[std::size_t(at - parameters.begin())] = kindOf(command, a.name, kinds[k + 1]);
    }
    return out;
}

// sorma::action, sorma::inspection: the body becomes a private method of the class.
int declareAction(Interpreter& i, int objc, Tcl_Obj* const objv[], bool ctrl) {
    return guarded(i, objc, objv, [&] {
        if (objc < 5 || objc % 2 == 0)
            return wrongArgs(i.interp, objv, "-name args help body ?-right right? ?-danger move|power|fire|stop? ?-kinds {argument kind ...}?");
        TclClass& c = target(i, objv[0]);
        Action a;
        a.name = toUtf8(objv[1]);
        if (a.name.size() < 2 || a.name[0] != '-') bad(objv[0], "bad name \"" + a.name + "\": must begin with a dash");
        auto& list = ctrl ? c.actions : c.inspections;
        for (auto& known : list)
            if (known.name == a.name) bad(objv[0], a.name + " is declared twice");
        a.help = toUtf8(objv[3]);
        a.right = ctrl ? Right::configure : Right::inspect;
        Tcl_Obj* kinds = nullptr;
        for (int k = 5; k < objc; k += 2) {
            if (view(objv[k]) == "-danger") {
                a.danger = danger(objv[0], a.name, objv[k + 1]);
                continue;
            }
            if (view(objv[k]) == "-kinds") {
                kinds = objv[k + 1];
                continue;
            }
            if (view(objv[k]) != "-right")
                bad(objv[0], a.name + ": unknown word " + nearAndOneOf(objv[k], {"-danger", "-kinds", "-right"}));
            std::string right = toUtf8(objv[k + 1]), known;
            bool found = false;
            for (Right r : {Right::call, Right::inspect, Right::configure, Right::make, Right::program, Right::operate}) {
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
        auto ofArguments = kinds ? kindsOf(objv[0], a, parameters, listElements(kinds)) : std::vector<Kind>();
        std::string method = (ctrl ? "CTRL" : "DBX") + a.name;
        std::string type = objectName(i.interp, Tcl_GetClassAsObject(c.tcl));
        if (!eval(i, {str("::oo::define"), str(type), str("method"), str(method), objv[2], objv[4]})) return TCL_ERROR;
        a.body = Body::untyped([method](Service& s, Args args, Message& reply) { static_cast<TclService&>(s).act(method, args, reply); },
                               std::move(ofArguments));
        list.push_back(std::move(a));
        declared(i, c);
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
        if (!found) bad(objv[0], "bad part " + nearAndOneOf(objv[1], {"any", "floats", "ints", "text"}));
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
// sorma::danger kind ?word ...?: EXEC does this; with words: an EXEC that begins with one of them.
int DangerObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        if (objc < 2) return wrongArgs(interp, objv, "move|power|fire|stop ?word ...?");
        TclClass& c = target(i, objv[0]);
        std::vector<std::string> words;
        for (int k = 2; k < objc; ++k) words.push_back(toUtf8(objv[k]));
        c.dangers.emplace_back(danger(objv[0], "EXEC", objv[1]), std::move(words));
        declared(i, c);
        return TCL_OK;
    });
}
// sorma::repeatable ?word ...?: such requests may be sent again, see Class::repeatable.
int RepeatableObjCmd(ClientData data, Tcl_Interp*, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        TclClass& c = target(i, objv[0]);
        std::vector<std::string> words;
        for (int k = 1; k < objc; ++k) words.push_back(toUtf8(objv[k]));
        c.repeatables.push_back(std::move(words));
        declared(i, c);
        return TCL_OK;
    });
}
int ConcurrencyObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        if (objc != 2) return wrongArgs(interp, objv, "serial|concurrent|exclusive");
        TclClass& c = target(i, objv[0]);
        std::string concurrency = toUtf8(objv[1]);
        if (concurrency != "serial" && concurrency != "concurrent" && concurrency != "exclusive")
            bad(objv[0], "bad concurrency \"" + concurrency + "\": must be concurrent, exclusive, or serial");
        c.concurrency = concurrency;
        declared(i, c);
        return TCL_OK;
    });
}

int FlavorsObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        if (objc != 2) return wrongArgs(interp, objv, "any|dictionary");
        TclClass& c = target(i, objv[0]);
        std::string flavors = toUtf8(objv[1]);
        if (flavors != "any" && flavors != "dictionary") bad(objv[0], "bad flavors " + nearAndOneOf(objv[1], {"any", "dictionary"}));
        c.flavors = flavors;
        declared(i, c);
        return TCL_OK;
    });
}

int TestedAtBirthObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        if (objc > 2) return wrongArgs(interp, objv, "?seconds?");
        TclClass& c = target(i, objv[0]);
        double seconds = 10;
        if (objc == 2 && (Tcl_GetDoubleFromObj(nullptr, objv[1], &seconds) != TCL_OK || !(seconds > 0 && seconds <= 86400)))
            bad(objv[0], "bad time \"" + toUtf8(objv[1]) + "\": must be seconds, up to 86400");
        c.testedAtBirth = seconds;
        declared(i, c);
        return TCL_OK;
    });
}

// sorma::words usage ?verb at kind ...?
int WordsObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        if (objc < 2 || objc % 3 != 2) return wrongArgs(interp, objv, "usage ?verb place kind ...?");
        TclClass& c = target(i, objv[0]);
        std::vector<Class::Word> kinds;
        for (int k = 2; k < objc; k += 3) {
            std::int64_t at = 0;
            if (!parseNumber(view(objv[k + 1]), at) || at < 0) bad(objv[0], "bad place \"" + toUtf8(objv[k + 1]) + "\": must be a number from 0");
            kinds.push_back({toUtf8(objv[k]), std::size_t(at), kindOf(objv[0], "word " + toUtf8(objv[k + 1]), objv[k + 2])});
        }
        c.words = toUtf8(objv[1]);
        c.wordKinds = std::move(kinds);
        declared(i, c);
        return TCL_OK;
    });
}

constexpr const char* kTextUsage = "text";
constexpr const char* kRequestUsage = "request";
constexpr const char* kVersionUsage = "version";

}  // namespace

std::string tclClassOf(Interpreter& i, const std::string& name) {
    std::string best;
    for (auto& tcl : tclClasses(i)) {
        if (serviceName(tcl) != name) continue;
        if (best.empty() || tcl.rfind("::") == 0) best = tcl;       // the global one first
    }
    return best;
}

bool registerTclClass(Interpreter& i, const std::string& name) {
    const std::string best = tclClassOf(i, name);
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

void tcloo::initDeclarations(Interpreter& i) {
    struct Command {
        const char* name;
        Tcl_ObjCmdProc* proc;
    };
    for (auto& c : std::initializer_list<Command>{
             {"option", OptionObjCmd}, {"action", ActionObjCmd}, {"inspection", InspectionObjCmd},
             {"concurrency", ConcurrencyObjCmd}, {"danger", DangerObjCmd}, {"flavors", FlavorsObjCmd}, {"reads", ReadsObjCmd}, {"repeatable", RepeatableObjCmd},
             {"testedAtBirth", TestedAtBirthObjCmd}, {"writes", WritesObjCmd},
             {"purpose", TextObjCmd<&TclClass::purpose, kTextUsage>}, {"words", WordsObjCmd},
             {"example", TextObjCmd<&TclClass::example, kRequestUsage>},
             {"version", TextObjCmd<&TclClass::version, kVersionUsage>}})
        i.define(c.name, c.proc);
}

}  // namespace sorma
