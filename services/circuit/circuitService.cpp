// circuit -- service objects wired to each other, executed as one: by a request, or tick after tick by a cycle.
//
//     circuit.loop CTRL -wires {
//         target[0]       -> sum.error.in1
//         delay.plant.out -> sum.error.in2
//         sum.error.out   -> gain.p.in
//         gain.p.out      -> delay.plant.in
//         delay.plant.out -> position
//     }
//     circuit.loop EXEC FMSG 1 0.5        -> FMSG 1 position
//
// wires.h says how wires are written, network.h what they mean. A circuit has pins as every object: circuits nest.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <optional>

#include <sorma.h>

#include "bus/incident.h"

#include "network.h"

namespace {

using circuit::Network;
using sorma::Message;
using sorma::Prototype;
using sorma::Severity;

const Prototype kFloats{Severity::error, "REQUEST SIGNATURE", 1, "{}: EXEC expects {} floats{}, got {}"};
const Prototype kBusy{Severity::error, "CIRCUIT BUSY", 1, "{}: it is in the middle of an EXEC, and cannot {} before that has ended"};
const Prototype kInputs{Severity::error, "CIRCUIT INPUTS", 2,
                        "{}: {} would break the cycle that runs it: each tick sends it {}, and it would read {}; stop the cycle first"};
const Prototype kPins{Severity::error, "CIRCUIT PINS", 2,
                      "{}: {} would break the wires of a circuit that runs in a cycle with this one inside; stop the cycle first"};
const Prototype kPart{Severity::error, "CIRCUIT PART", 2, "{}: its wires no longer fit the pins of its unit {}; mend the wires, or the unit"};

std::string floatsText(std::size_t n) { return std::to_string(n) + (n == 1 ? " float" : " floats"); }

// The first pin that differs, in words; empty: none.
std::string differenceOf(const std::vector<sorma::Pin>& old, const std::vector<sorma::Pin>& fresh, bool inputsAlone) {
    auto find = [](const std::vector<sorma::Pin>& pins, const sorma::Pin& pin) {
        return std::find_if(pins.begin(), pins.end(), [&](auto& p) { return p.name == pin.name && p.input == pin.input; });
    };
    auto text = [](const char* what, const sorma::Pin& pin) { return what + std::string(pin.input ? " input " : " output ") + pin.name; };
    for (auto& pin : old)
        if ((pin.input || !inputsAlone) && find(fresh, pin) == fresh.end()) return text("to remove", pin);
    for (auto& pin : fresh) {
        if (!pin.input && inputsAlone) continue;
        auto before = find(old, pin);
        if (before == old.end()) return text("the new", pin);
        if (before->length != pin.length) return text("another length of", pin);
        if (before->at != pin.at && !inputsAlone) return text("another place of", pin);
    }
    return {};
}

class Circuit : public sorma::Service, public sorma::HasIncidents {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        auto c = sorma::Class::of<Circuit>("circuit", "executes service objects that are wired to each other");
        c.text("-wires", &Circuit::wires_,
               {.help = "source -> sink; ...    a.out[0:2] -> b.in, 0.5 -> b.in[3], in -> a.in, b.out -> out"})
            .text("-inputs", &Circuit::inputs_,
                  {.help = "its own inputs, in order: name ?length? ?unit?; ...    others follow as wired"})
            .text("-outputs", &Circuit::outputs_, {.help = "its own outputs, likewise"})
            .text("-places", &Circuit::places_,
                  {.help = "where an editor draws its boxes: unit NAME x y; pin NAME x y; ...    nothing else reads it"})
            .real("-period", &Circuit::period_, {.unit = "s", .low = 0, .high = 3600,
                                                 .help = "time step of its units when no cycle drives it; 0: they need their own"})
            .action({"-rewire", "", "find units and lengths again, after units were replaced or changed", 0, 0,
                     [](sorma::Service& s, sorma::Args, Message&) { static_cast<Circuit&>(s).rewire(); }, sorma::Right::configure, true})
            .action("-reset", &Circuit::resetAction, "", "-reset of all units of this process that have it, and time from 0 again")
            .inspection(list("-units", "name class location floats-in floats-out step|loop", &Network::listUnits))
            .inspection(list("-wires", "source -> sink length unit, as resolved", &Network::listWires))
            .inspection(list("-order", "ask|exec name, in the order of execution", &Network::listOrder))
            .inspection(list("-live", "pin in|out length unit number..., of every pin", &Network::listLive))
            .inspection(list("-ticks", "circuit ticks seconds; then unit times-executed, of every unit", &Network::listTicks))
            .reads(floats, {}, "", "its inputs, one pin after another; see DBX -pins")
            .writes(floats, {}, "", "its outputs")
            .realtime()
            .example("circuit EXEC");
        return c;
    }

    void born() override { rewire(); }

    // All or nothing: what is there goes on when anything is wrong with what shall come, and until it is ready.
    sorma::Commit prepare(const sorma::Change& change) override {
        bool wired = change.concerns("-wires") || change.concerns("-inputs") || change.concerns("-outputs");
        return wired ? wiredAnew(change.get<std::string>("-wires"), change.get<std::string>("-inputs"),
                                 change.get<std::string>("-outputs"), change.author("-wires"))
                     : nullptr;
    }

    void changed(std::span<const sorma::Option* const>) override {
        anchor();
        tellAround();
    }

    void exec(Message& m) override {
        if (broken_) [[unlikely]] throw *broken_;
        // Relaxed: it orders nothing, a change is compared with ticks that have been.
        if (sorma::RealtimeOwner::current()) given_.store(m.floats.size(), std::memory_order_relaxed);
        if (m.floats.size() != network_->inputs()) [[unlikely]] failFloats(m.floats.size());
        if (running_) [[unlikely]] fail(kBusy, name(), "begin another one");
        Running running(running_);
        m.text.clear();
        m.ints.clear();
        m.any.clear();
        if (period_ == 0 || sorma::Tick::current()) return network_->run(m);
        tick_.period = period_;
        tick_.time = nextTime();
        sorma::Tick::Scope scope(tick_);
        network_->run(m);
        ++tick_.number;
    }

    std::vector<sorma::Pin> pins(std::string_view, std::size_t) const override { return network_->pins(); }
    std::vector<sorma::Reference> parts() const override {
        return network_ ? network_->units() : std::vector<sorma::Reference>();
    }

    // Its wires name them, all in one author's words.
    std::vector<NamedPart> namedParts() const override {
        std::vector<NamedPart> out;
        if (auto& by = author("-wires"); by && network_)
            for (auto& unit : network_->units()) out.push_back({unit->name(), by});
        return out;
    }

    void tellIncidents(sorma::Incidents& out) const override {
        for (auto& unit : parts()) sorma::tellIncidents(*unit, out);
    }

    std::string selftest() override {
        for (auto& unit : network_->units())
            if (unit->gone()) return "unit " + unit->name() + " has been removed: CTRL -rewire";
        if (broken_) throw *broken_;
        return "ok: " + std::to_string(network_->units().size()) + " units, " + std::to_string(network_->wires().size()) + " wires";
    }

    void dumpState(std::string& out) const override {
        if (!network_) return;
        auto add = [&](const char* what, void (Network::*list)(std::string&) const) {
            std::string lines;
            ((*network_).*list)(lines);
            for (std::size_t i = 0; i < lines.size();) {
                auto end = std::min(lines.find('\n', i), lines.size());
                out += std::string("# ") + what + " " + lines.substr(i, end - i) + "\n";
                i = end + 1;
            }
        };
        add("unit", &Network::listUnits);
        add("wire", &Network::listWires);
        add("order", &Network::listOrder);
        add("live", &Network::listLive);
    }

private:
    struct Running {
        bool& flag;
        explicit Running(bool& f) : flag(f) { flag = true; }
        ~Running() { flag = false; }
    };

    static sorma::Action list(const char* name, const char* help, void (Network::*what)(std::string&) const) {
        return {name, "", help, 0, 0, [what](sorma::Service& s, sorma::Args, Message& reply) {
                    std::string lines;
                    ((*static_cast<Circuit&>(s).network_).*what)(lines);
                    if (!reply.text.empty() && !lines.empty()) reply.text += '\n';
                    reply.text += lines;
                }};
    }

    sorma::Commit wiredAnew(const std::string& wires, const std::string& inputs, const std::string& outputs,
                            const sorma::PrincipalPointer& author) {
        circuit::Description description{circuit::parseWires(name(), wires), circuit::parsePins(name(), "-inputs", inputs),
                                         circuit::parsePins(name(), "-outputs", outputs), author};
        auto made = std::make_shared<Network>(*this, description);
        if (realtimeOwner()) needFit(*made);
        return [this, fresh = std::move(made)]() mutable {
            if (running_) fail(kBusy, name(), "be wired again");
            std::swap(network_, fresh);
            broken_.reset();
        };
    }

    // A change that would let ticks fail which succeed now is refused.
    void needFit(const Network& fresh) const {
        const std::size_t given = given_.load(std::memory_order_relaxed);
        if (given == kNever || given != network_->inputs()) return;
        const bool inside = isInside();
        const std::string what = differenceOf(network_->pins(), fresh.pins(), !inside);
        if (inside && !what.empty()) fail(kPins, name(), what);
        if (fresh.inputs() != given) fail(kInputs, name(), what, floatsText(given), floatsText(fresh.inputs()));
    }

    // The circuits of this process that have it as a unit.
    std::vector<Circuit*> around() const {
        std::vector<Circuit*> out;
        for (auto& other : sorm().names("circuit*"))
            if (auto* circuit = dynamic_cast<Circuit*>(sorm().find(other)); circuit && circuit->network_ && circuit->network_->pinsOf(*this))
                out.push_back(circuit);
        return out;
    }
    // Does the same cycle run another circuit that has it as a unit?
    bool isInside() const {
        return std::ranges::any_of(around(), [&](Circuit* c) { return c->realtimeOwner() == realtimeOwner(); });
    }

    // The circuits around it take its new pins at once. In a cycle it has none: needFit has refused them.
    void tellAround() {
        if (!network_ || realtimeOwner()) return;
        const auto same = [](const sorma::Pin& a, const sorma::Pin& b) { return a.toText() == b.toText(); };
        for (auto* circuit : around())
            if (circuit->broken_ || !std::ranges::equal(*circuit->network_->pinsOf(*this), network_->pins(), same)) circuit->follow(*this);
    }
    // Without ticks, from now on, if the wires do not fit: they would take numbers of other pins.
    void follow(const Circuit& part) {
        if (running_) return;               // the next tick tells the wrong number of floats
        try {
            rewire();
            tellAround();
        } catch (...) {
            sorma::Trail trail = sorma::trailOfCurrentException(name());
            trail.add(sorma::makeEntry(kPart, {sorma::MessageArg::of(name()), sorma::MessageArg::of(part.name())}));
            broken_.emplace(std::move(trail));
            network_->keepPins(part, part.network_->pins());
        }
    }

    void rewire() {
        auto* owner = realtimeOwner();
        sorma::Commit commit;               // the old network ends after ticks go on
        try {
            commit = wiredAnew(wires_, inputs_, outputs_, author("-wires"));
            sorma::BetweenTicks between(*this);
            commit();
            if (owner) owner->partsChanged();
        } catch (...) {
            if (owner) owner->partsChanged();
            throw;
        }
    }

    void resetAction(sorma::Args, Message&) {
        if (running_) fail(kBusy, name(), "be reset");
        if (!network_) return;              // a recipe says it before birth, when there is nothing to reset
        for (auto& unit : network_->units()) {
            if (!unit->type().findAction("-reset")) continue;
            Message m;
            m.words = {"-reset"};
            unit->invoke(sorma::Method::ctrl, m);
        }
        tick_ = {};
        anchor_ = 0;
        anchorNumber_ = 0;
    }

    // By the number of ticks, so that no rounding adds up.
    std::int64_t nextTime() const {
        return anchor_ + std::int64_t(std::llround(double(tick_.number - anchorNumber_) * tick_.period * 1e9));
    }
    // From here on time runs by the present period: a new one does not move what was.
    void anchor() {
        anchor_ = nextTime();
        anchorNumber_ = tick_.number;
    }

    [[noreturn]] void failFloats(std::size_t got) const {
        std::string pins;
        for (auto& p : network_->pins())
            if (p.input) pins += (pins.empty() ? " (" : ", ") + circuit::sliceText(p.name, 0, p.length);
        if (!pins.empty()) pins += ")";
        fail(kFloats, name(), network_->inputs(), pins, got);
    }

    std::string wires_, inputs_, outputs_, places_;
    double period_ = 0;
    std::shared_ptr<Network> network_;      // from birth on
    std::optional<sorma::Error> broken_;    // why there are no ticks: the pins of a circuit inside are others
    static constexpr std::size_t kNever = std::size_t(-1);
    std::atomic<std::size_t> given_{kNever};        // floats that the last tick of a cycle has sent
    bool running_ = false;                  // a unit may come back to us, or let others do so while it waits
    sorma::Tick tick_;                      // when no cycle drives us: the next one, with the period of the last
    std::int64_t anchor_ = 0;               // [ns] time of tick anchorNumber_
    std::uint64_t anchorNumber_ = 0;
};

}  // namespace

extern "C" SORMA_EXPORT int Circuit_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::circuit", "1.0", {Circuit::describe()});
}
