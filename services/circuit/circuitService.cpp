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
const Prototype kPins{Severity::error, "CIRCUIT PINS", 2, "{}: {} would break the wires of {}, which a cycle runs; stop the cycle first"};
const Prototype kPart{Severity::error, "CIRCUIT PART", 2, "{}: its wires no longer fit the pins of its unit {}; mend the wires, or the unit"};

std::string floatsText(std::size_t n) { return std::to_string(n) + (n == 1 ? " float" : " floats"); }

using Pins = std::vector<sorma::Pin>;

Pins::const_iterator find(const Pins& pins, const sorma::Pin& pin) {
    return std::ranges::find_if(pins, [&](auto& p) { return p.name == pin.name && p.input == pin.input; });
}

// The pins that a unit has now, with the lengths that the wires give them. Fails as its class does when it cannot have such a length.
Pins pinsNow(const sorma::Service& unit, const Pins& wired) {
    Pins pins = unit.pins();
    for (auto& pin : pins) {
        if (pin.length != sorma::Pin::kOpen) continue;
        auto before = find(wired, pin);
        if (before == wired.end() || before->length == sorma::Pin::kOpen) continue;
        pin.length = before->length;
        for (auto& told : unit.pins(pin.name, before->length))
            for (auto& other : pins)
                if (other.name == told.name && other.input == told.input && told.length != sorma::Pin::kOpen)
                    other.length = told.length, other.at = told.at;
    }
    return pins;
}

// The first pin that wires would miss, in words; empty: none.
std::string differenceOf(const Pins& wired, const Pins& fresh) {
    auto text = [](const char* what, const sorma::Pin& pin) { return what + std::string(pin.input ? " input " : " output ") + pin.name; };
    for (auto& pin : wired)
        if (find(fresh, pin) == fresh.end()) return text("to remove", pin);
    for (auto& pin : fresh) {
        auto before = find(wired, pin);
        if (before == wired.end()) return text("the new", pin);
        if (pin.length == sorma::Pin::kOpen) continue;
        if (before->length != pin.length) return text("another length of", pin);
        if (before->at != pin.at) return text("another place of", pin);
    }
    return {};
}

bool sameUnits(const Pins& wired, const Pins& fresh) {
    return std::ranges::all_of(wired, [&](auto& pin) { return find(fresh, pin)->unit == pin.unit; });
}

Pins inputsOf(const Pins& pins) {
    Pins out;
    std::ranges::copy_if(pins, std::back_inserter(out), &sorma::Pin::input);
    return out;
}

class Circuit : public sorma::Service, public sorma::HasIncidents, public sorma::Dependent {
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
            .action({"-rewire", "", "find units and lengths again, after units were removed, or changed in another process", 0, 0,
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

    ~Circuit() override {
        if (!gone()) removing();
    }
    void removing() override { std::erase(sorm().dependents, this); }

    void born() override {
        rewire();
        sorm().dependents.push_back(this);
    }

    // All or nothing: what is there goes on when anything is wrong with what shall come, and until it is ready.
    sorma::Commit prepare(const sorma::Change& change) override {
        bool wired = change.concerns("-wires") || change.concerns("-inputs") || change.concerns("-outputs");
        return wired ? wiredAnew(change.get<std::string>("-wires"), change.get<std::string>("-inputs"),
                                 change.get<std::string>("-outputs"), change.author("-wires"))
                     : nullptr;
    }

    void changed(std::span<const sorma::Option* const>) override { anchor(); }

    // A unit has other pins: they are taken at once. When the wires do not fit them, there are no ticks from now on, which would
    // take numbers of other pins. In a cycle such a change is refused.
    void follow(sorma::Service& unit) override {
        const Pins* wired = network_->pinsOf(unit);
        if (!wired || running_) return;     // running: the next tick tells the wrong number of floats
        if (realtimeOwner()) {
            if (broken_) return;
            if (auto what = differenceOf(*wired, pinsNow(unit, *wired)); !what.empty()) fail(kPins, unit.name(), what, name());
            return;
        }
        try {
            if (!broken_) {
                const Pins fresh = pinsNow(unit, *wired);
                if (differenceOf(*wired, fresh).empty() && sameUnits(*wired, fresh)) return;
            }
            rewire();
        } catch (...) {
            sorma::Trail trail = sorma::trailOfCurrentException(name());
            trail.add(sorma::makeEntry(kPart, {sorma::MessageArg::of(name()), sorma::MessageArg::of(unit.name())}));
            broken_.emplace(std::move(trail));
            network_->retire(unit);
        }
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
        return [this, fresh = std::move(made), broken = std::optional<sorma::Error>()]() mutable {
            if (running_) fail(kBusy, name(), "be wired again");
            std::swap(network_, fresh);
            std::swap(broken_, broken);
        };
    }

    // A change that would let ticks fail which succeed now is refused.
    void needFit(const Network& fresh) const {
        const std::size_t given = given_.load(std::memory_order_relaxed);
        if (given == kNever || given != network_->inputs() || given == fresh.inputs()) return;
        fail(kInputs, name(), differenceOf(inputsOf(network_->pins()), inputsOf(fresh.pins())), floatsText(given), floatsText(fresh.inputs()));
    }

    void rewire() {
        auto* owner = realtimeOwner();
        sorma::Commit commit;               // the old network ends after ticks go on
        try {
            commit = wiredAnew(wires_, inputs_, outputs_, author("-wires"));
            sorma::BetweenTicks between(*this);
            commit();
            try {
                sorm().tellDependents(*this);
            } catch (...) {
                commit();
                throw;
            }
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
    std::optional<sorma::Error> broken_;    // why there are no ticks: the pins of a unit are others
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
