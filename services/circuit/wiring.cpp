#include "wiring.h"

#include <algorithm>

namespace circuit {

namespace {

using sorma::Pin;
using sorma::Prototype;
using sorma::Severity;
using sorma::shown;

const Prototype kObject{Severity::error, "CIRCUIT OBJECT", 2, "{}: unit {} of wire {} {} cannot be made"};
const Prototype kPin{Severity::error, "CIRCUIT PIN", 2, "{}: wire {} {}: {} has no {} {}: it has {}"};
const Prototype kBoth{Severity::error, "CIRCUIT PIN", 2, "{}: wire {} {}: {} is an {} of the circuit itself, and cannot be its {} too"};
const Prototype kLength{Severity::error, "CIRCUIT LENGTH", 1, "{}: wire {} {}: {} {}, but {} {}"};
const Prototype kSlice{Severity::error, "CIRCUIT LENGTH", 1, "{}: wire {} {}: {} has {}, there is no {}"};
const Prototype kUnitLength{Severity::error, "CIRCUIT LENGTH", 1, "{}: with {} elements at {}, {} would have {} instead of {}"};
const Prototype kTotal{Severity::error, "CIRCUIT LENGTH", 1, "{}: {} would have more than {} elements"};
const Prototype kUnit{Severity::error, "CIRCUIT UNIT", 1, "{}: wire {} {}: {} is in {}, but {} in {}"};
const Prototype kDriven{Severity::error, "CIRCUIT DRIVEN", 1, "{}: {} is driven twice, by wire {} {} and by wire {} {}"};
const Prototype kDangling{Severity::error, "CIRCUIT DANGLING", 2, "{}: nothing drives {}"};
const Prototype kIdle{Severity::error, "CIRCUIT OPEN", 1, "{}: input {} is declared without a length, and wired to nothing"};
const Prototype kOpen{Severity::error, "CIRCUIT OPEN", 1,
                      "{}: wire {} {}: nothing says how many elements it has; write a slice, such as {} -> {}"};
const Prototype kLoop{Severity::error, "CIRCUIT LOOP", 1,
                      "{}: every unit of this loop needs the output of the one before it: {}; put a unit without feedthrough into it, such as "
                      "delay or integrator"};
const Prototype kCycle{Severity::error, "SERVICE CYCLE", 1, "{}: a circuit inside itself: {}"};

std::string elements(std::size_t n) { return std::to_string(n) + (n == 1 ? " element" : " elements"); }

std::string pinNames(const std::vector<Pin>& pins, bool input) {
    std::string out;
    for (auto& p : pins)
        if (p.input == input) out += (out.empty() ? "" : ", ") + p.name;
    return out;
}

}  // namespace

Wiring::Wiring(Network& network, sorma::Service& owner, const Description& description)
    : network_(network), owner_(owner), description_(description), who_(owner.name()), nodes_(2) {}

void Wiring::run() {
    declare();
    connect();
    refuseRecursion();
    spread();
    check();
    drive();
    findLoops();
    sort();
    assemble();
}

// ---- who is there ----

void Wiring::declare() {
    auto add = [&](int node, const std::vector<OwnPin>& pins) {
        for (auto& p : pins)
            nodes_[std::size_t(node)].pins.push_back({p.name, node == kInputs, 0, p.length ? p.length : Pin::kOpen, p.unit, {}});
    };
    add(kInputs, description_.inputs);
    add(kOutputs, description_.outputs);
}

// A unit by its name. The author of the wires needs the right to call it. One that the real-time owner of the circuit cannot
// have is refused before it is asked for anything, which could take long.
sorma::Reference Wiring::unitNamed(const std::string& object) {
    sorma::Reference unit = sorma::subService(owner_, object, description_.author);
    if (auto* owner = owner_.realtimeOwner()) owner->adopt(*unit);
    return unit;
}

// A unit may take memory for a length that it is asked for.
std::vector<Pin> Wiring::pinsOf(sorma::Service& unit, std::string_view pin, std::size_t length) {
    sorma::BetweenTicks between(unit);
    return unit.pins(pin, length);
}

int Wiring::nodeOf(const std::string& object) {
    auto [at, fresh] = byName_.try_emplace(object, int(nodes_.size()));
    if (!fresh) return at->second;
    sorma::Reference unit = unitNamed(object);
    // One object may have two names: it is one unit.
    auto [known, first] = byObject_.try_emplace(unit.get(), int(nodes_.size()));
    if (!first) return at->second = known->second;
    Node node;
    node.name = object;
    node.unit = unit;
    node.pins = pinsOf(*unit);
    nodes_.push_back(std::move(node));
    return at->second;
}

// A pin of the circuit itself is what stands first on one side of a wire. Its direction is the circuit's: what it reads
// is a source inside.
std::size_t Wiring::ownPin(const Wire& wire, const End& end, bool sink) {
    auto& pins = nodes_[sink ? kOutputs : kInputs].pins;
    for (std::size_t i = 0; i < pins.size(); ++i)
        if (pins[i].name == end.pin) return i;
    for (auto& other : nodes_[sink ? kInputs : kOutputs].pins)
        if (other.name == end.pin)
            fail(kBoth, who_, wire.number, shown(wire.text), end.pin, sink ? "input" : "output", sink ? "output" : "input");
    pins.push_back({end.pin, !sink, 0, Pin::kOpen, {}, {}});
    return pins.size() - 1;
}

Wiring::Terminal Wiring::terminal(const Wire& wire, const End& end, bool sink) {
    if (end.constant()) {
        Terminal t{kConstants, network_.constants_.size()};
        network_.constants_.insert(network_.constants_.end(), end.constants.begin(), end.constants.end());
        return t;
    }
    if (end.object.empty()) return {sink ? kOutputs : kInputs, ownPin(wire, end, sink)};
    Terminal t;
    try {
        t.node = nodeOf(end.object);
    } catch (...) {
        sorma::Trail trail = sorma::trailOfCurrentException(who_);
        trail.add(sorma::makeEntry(kObject, {sorma::MessageArg::of(who_), sorma::MessageArg::of(end.object),
                                             sorma::MessageArg::of(wire.number), sorma::MessageArg::of(shown(wire.text))}));
        throw sorma::Error(std::move(trail));
    }
    auto& pins = nodes_[std::size_t(t.node)].pins;
    for (t.pin = 0; t.pin < pins.size(); ++t.pin)
        if (pins[t.pin].name == end.pin && pins[t.pin].input == sink) return t;
    std::string there = pinNames(pins, sink);
    const char* what = sink ? "input" : "output";
    fail(kPin, who_, wire.number, shown(wire.text), end.object, what, end.pin,
         there.empty() ? std::string("no ") + what + "s" : there);
}

void Wiring::connect() {
    for (auto& wire : description_.wires) {
        Connection c{&wire, terminal(wire, wire.source, false), terminal(wire, wire.sink, true)};
        connections_.push_back(c);
    }
    for (auto& node : nodes_) {
        node.wires.resize(node.pins.size());
        node.needed.resize(node.pins.size());
        node.guessed.resize(node.pins.size());
    }
    for (std::size_t i = 0; i < connections_.size(); ++i) {
        auto& c = connections_[i];
        auto note = [&](const Terminal& t, const End& end) {
            if (t.node == kConstants) return;
            auto& node = nodes_[std::size_t(t.node)];
            node.wires[t.pin].push_back(i);
            if (!end.whole) node.needed[t.pin] = std::max(node.needed[t.pin], end.last + 1);
        };
        note(c.source, c.wire->source);
        note(c.sink, c.wire->sink);
    }
}

// ---- lengths ----

std::size_t Wiring::lengthOf(const Connection& c, bool sink) const {
    auto& end = sink ? c.wire->sink : c.wire->source;
    if (end.constant()) return end.constants.size();
    if (!end.whole) return end.last - end.first + 1;
    return pin(sink ? c.sink : c.source).length;
}

// The length of a pin has been found: ask its unit what follows from that.
void Wiring::setLength(const Terminal& t, std::size_t length) {
    auto& node = nodes_[std::size_t(t.node)];
    auto& found = node.pins[t.pin];
    if (length > kMaxElements) fail(kTotal, who_, found.name, kMaxElements);
    found.length = length;
    auto follow = [&](std::size_t p) { todo_.insert(todo_.end(), node.wires[p].begin(), node.wires[p].end()); };
    follow(t.pin);
    if (!node.unit) return;
    std::string from = node.name + "." + found.name;
    for (auto& told : pinsOf(*node.unit, found.name, length))
        for (auto& known : node.pins) {
            if (known.name != told.name || known.input != told.input) continue;
            if (told.length == Pin::kOpen) continue;
            if (known.length != Pin::kOpen && known.length != told.length)
                fail(kUnitLength, who_, length, from, node.name + "." + known.name, told.length, known.length);
            if (known.length == Pin::kOpen) follow(std::size_t(&known - node.pins.data()));
            known.length = told.length;
            known.at = told.at;
        }
}

void Wiring::passLengths() {
    while (!todo_.empty()) {
        auto& c = connections_[todo_.front()];
        todo_.pop_front();
        std::size_t source = lengthOf(c, false), sink = lengthOf(c, true);
        if (source == Pin::kOpen && sink != Pin::kOpen) setLength(c.source, sink);
        if (sink == Pin::kOpen && source != Pin::kOpen) setLength(c.sink, source);
    }
}

void Wiring::spread() {
    for (std::size_t i = 0; i < connections_.size(); ++i) todo_.push_back(i);
    passLengths();
    // A reader has no use for elements that nobody drives, so there the highest index says all. Others may read only a part of an
    // output, so outputs come last.
    for (bool outputs : {false, true})
        for (std::size_t n = 0; n < nodes_.size(); ++n)
            for (std::size_t p = 0; p < nodes_[n].pins.size(); ++p) {
                auto& node = nodes_[n];
                bool late = n > kOutputs && !node.pins[p].input;
                if (late != outputs || node.pins[p].length != Pin::kOpen || node.needed[p] == 0) continue;
                node.guessed[p] = true;
                setLength({int(n), p}, node.needed[p]);
                passLengths();
            }
    for (int n : {kInputs, kOutputs}) {
        std::size_t at = 0;
        for (auto& p : nodes_[std::size_t(n)].pins) {
            p.at = at;
            if (p.length != Pin::kOpen) at += p.length;
        }
        if (at > kMaxElements) fail(kTotal, who_, n == kInputs ? "the circuit's input" : "the circuit's output", kMaxElements);
    }
}

// ---- is it right? ----

void Wiring::checkEnd(const Connection& c, bool sink) const {
    auto& end = sink ? c.wire->sink : c.wire->source;
    if (end.constant() || end.whole) return;
    auto& p = pin(sink ? c.sink : c.source);
    if (end.last < p.length) return;
    fail(kSlice, who_, c.wire->number, shown(c.wire->text), end.pinText(), elements(p.length),
         sliceText(end.pin, end.last, 1));
}

void Wiring::check() {
    for (auto& c : connections_) {
        auto& w = *c.wire;
        std::size_t source = lengthOf(c, false), sink = lengthOf(c, true);
        if (source == Pin::kOpen || sink == Pin::kOpen)
            fail(kOpen, who_, w.number, shown(w.text), sliceText(w.source.pinText(), 0, 3), w.sink.toText());
        checkEnd(c, false);
        checkEnd(c, true);
        if (source != sink)
            fail(kLength, who_, w.number, shown(w.text), w.source.toText(), "has " + elements(source), w.sink.toText(),
                 "has " + std::to_string(sink));
        c.length = source;
        c.from = c.source.node == kConstants ? c.source.pin : pin(c.source).at + w.source.first;
        c.to = pin(c.sink).at + w.sink.first;
        if (c.source.node == kConstants) continue;
        auto &from = pin(c.source).unit, &to = pin(c.sink).unit;
        if (!from.empty() && !to.empty() && from != to)
            fail(kUnit, who_, w.number, shown(w.text), w.source.toText(), from, w.sink.toText(), to);
    }
    // A pin of the circuit's own has the unit of all that it is wired to, when that is one.
    for (int n : {kInputs, kOutputs})
        for (std::size_t p = 0; p < nodes_[std::size_t(n)].pins.size(); ++p) {
            auto& own = nodes_[std::size_t(n)].pins[p];
            if (!own.unit.empty()) continue;
            std::set<std::string> units;
            for (auto w : nodes_[std::size_t(n)].wires[p]) {
                auto& there = n == kInputs ? connections_[w].sink : connections_[w].source;
                if (there.node != kConstants) units.insert(pin(there).unit);
            }
            if (units.size() == 1) own.unit = *units.begin();
        }
}

// "gain.k.in[1]": an element of what a node reads, by the narrowest pin that has it.
std::string Wiring::elementText(const Node& node, std::size_t element) const {
    const Pin* best = nullptr;
    for (auto& p : node.pins) {
        bool has = p.length != Pin::kOpen && element >= p.at && element < p.at + p.length && (p.input || !node.unit);
        if (has && (!best || p.length < best->length)) best = &p;
    }
    std::string prefix = node.unit ? node.name + "." : std::string();
    return best ? sliceText(prefix + best->name, element - best->at, 1) : prefix + "floats[" + std::to_string(element) + "]";
}

// Each element that is read has one wire that drives it.
void Wiring::drive() {
    std::size_t total = 0;
    drivers_.resize(nodes_.size());
    for (std::size_t n = 0; n < nodes_.size(); ++n) {
        auto& node = nodes_[n];
        for (std::size_t p = 0; p < node.pins.size(); ++p) {
            auto& pin = node.pins[p];
            bool reads = n == kInputs ? false : n == kOutputs ? true : pin.input;
            if (pin.length == Pin::kOpen) {
                if (reads) fail(kDangling, who_, node.unit ? node.name + "." + pin.name : pin.name);
                if (n == kInputs) fail(kIdle, who_, pin.name);
                node.exact = false;
                continue;
            }
            auto& floats = reads ? node.in : node.out;
            floats = std::max(floats, pin.at + pin.length);
            if (!reads && node.guessed[p]) node.exact = false;
        }
        if (node.out == 0) node.exact = false;
        total += node.in + node.out;
        if (node.in > kMaxElements || node.out > kMaxElements) fail(kTotal, who_, node.name, kMaxElements);
        if (total > kMaxFloats) fail(kTotal, who_, "all units together", kMaxFloats);
        drivers_[n].resize(node.in);
    }
    for (auto& c : connections_) {
        auto& node = nodes_[std::size_t(c.sink.node)];
        for (std::size_t i = c.to; i < c.to + c.length; ++i) {
            auto& driver = drivers_[std::size_t(c.sink.node)][i];
            if (driver) {
                auto& other = *connections_[driver - 1].wire;
                fail(kDriven, who_, elementText(node, i), other.number, shown(other.text), c.wire->number, shown(c.wire->text));
            }
            driver = std::size_t(&c - connections_.data()) + 1;
        }
    }
    for (std::size_t n = 0; n < nodes_.size(); ++n)
        for (std::size_t i = 0; i < drivers_[n].size(); ++i)
            if (!drivers_[n][i]) fail(kDangling, who_, elementText(nodes_[n], i));
}

void Wiring::refuseRecursion() {
    std::set<sorma::Service*> seen;
    std::string chain = who_;
    auto visit = [&](auto& self, sorma::Service& s) -> void {
        std::size_t length = chain.size();
        chain += " -> " + s.name();
        if (&s == &owner_) fail(kCycle, who_, chain);
        if (seen.insert(&s).second)
            for (auto& part : s.parts()) self(self, *part);
        chain.resize(length);
    };
    for (auto& node : nodes_)
        if (node.unit) visit(visit, *node.unit);
}

// ---- in which order? ----

template <class Use> void Wiring::eachEdge(Use use) const {
    for (auto& c : connections_)
        if (c.source.node > kOutputs && c.sink.node > kOutputs) use(std::size_t(c.source.node), std::size_t(c.sink.node));
}

// Take away units without a wire to them, and those without a wire from them, again and again. Loops remain, and the units between
// them. Units without feedthrough among these are asked first.
void Wiring::findLoops() {
    std::size_t count = nodes_.size();
    std::vector<bool> left(count, true);
    for (bool forward : {true, false}) {
        std::vector<std::size_t> degree(count);
        std::vector<std::vector<std::size_t>> next(count);
        eachEdge([&](std::size_t from, std::size_t to) {
            if (!forward) std::swap(from, to);
            if (!left[from] || !left[to]) return;
            ++degree[to];
            next[from].push_back(to);
        });
        std::vector<std::size_t> free;
        for (std::size_t n = 0; n < count; ++n)
            if (left[n] && degree[n] == 0) free.push_back(n);
        while (!free.empty()) {
            auto n = free.back();
            free.pop_back();
            left[n] = false;
            for (auto to : next[n])
                if (--degree[to] == 0) free.push_back(to);
        }
    }
    for (std::size_t n = 2; n < count; ++n) nodes_[n].loop = left[n] && !nodes_[n].unit->type().hasFeedthrough();
}

// Each unit comes after those that it needs. Among several that could be next, the wires name the first one.
void Wiring::sort() {
    std::vector<std::size_t> degree(nodes_.size());
    std::vector<std::vector<std::size_t>> next(nodes_.size());
    eachEdge([&](std::size_t from, std::size_t to) {
        if (nodes_[from].loop) return;
        ++degree[to];
        next[from].push_back(to);
    });
    std::set<std::size_t> free;
    for (std::size_t n = 2; n < nodes_.size(); ++n)
        if (degree[n] == 0) free.insert(n);
    std::vector<bool> left(nodes_.size(), true);
    while (!free.empty()) {
        auto n = *free.begin();
        free.erase(free.begin());
        left[n] = false;
        nodes_[n].place = order_.size();
        order_.push_back(int(n));
        for (auto to : next[n])
            if (--degree[to] == 0) free.insert(to);
    }
    if (order_.size() + 2 < nodes_.size()) failLoop(left);
}

// Backwards from a unit that could not be placed: each of them has one before it, so sooner or later one comes again.
void Wiring::failLoop(const std::vector<bool>& left) const {
    std::vector<std::size_t> before(nodes_.size());
    eachEdge([&](std::size_t from, std::size_t to) {
        if (left[from] && left[to] && !nodes_[from].loop) before[to] = from;
    });
    std::size_t n = 2;
    while (!left[n]) ++n;
    std::vector<std::size_t> way;
    while (std::find(way.begin(), way.end(), n) == way.end()) {
        way.push_back(n);
        n = before[n];
    }
    way.erase(way.begin(), std::find(way.begin(), way.end(), n));
    way.push_back(n);
    std::reverse(way.begin(), way.end());
    std::string chain;
    for (auto w : way) chain += (chain.empty() ? "" : " -> ") + nodes_[w].name;
    fail(kLoop, who_, chain);
}

// ---- what is executed ----

void Wiring::assemble() {
    auto& net = network_;
    net.steps_ = std::vector<Network::Step>(order_.size());
    auto storage = [&](const Terminal& t) -> const std::vector<double>* {
        if (t.node == kConstants) return &net.constants_;
        if (t.node == kInputs) return &net.inputs_;
        auto& node = nodes_[std::size_t(t.node)];
        auto& step = net.steps_[node.place];
        return node.loop ? &step.held : &step.message.floats;
    };
    // The copies to the inputs of a node, in order; elements that are adjacent at both ends are one copy.
    auto gather = [&](std::size_t n, std::vector<Network::Copy>& copies) {
        std::size_t begin = copies.size();
        auto& drivers = drivers_[n];
        for (std::size_t i = 0; i < drivers.size();) {
            auto& c = connections_[drivers[i] - 1];
            Network::Copy copy{storage(c.source), std::uint32_t(c.from), std::uint32_t(c.to), std::uint32_t(c.length)};
            i = c.to + c.length;
            if (copies.size() > begin) {
                auto& last = copies.back();
                if (last.from == copy.from && last.at + last.count == copy.at) {
                    last.count += copy.count;
                    continue;
                }
            }
            copies.push_back(copy);
        }
    };
    std::vector<std::size_t> begins;        // of each step's copies
    for (int n : order_) {
        auto& node = nodes_[std::size_t(n)];
        auto& step = net.steps_[node.place];
        step.unit = node.unit;
        net.places_.emplace(node.unit.get(), node.place);
        step.in = std::uint32_t(node.in);
        step.out = std::uint32_t(node.out);
        step.exact = node.exact;
        step.loop = node.loop;
        step.pins = node.pins;
        auto& writes = node.unit->type().writes();
        step.onlyFloats = !writes.empty() && std::all_of(writes.begin(), writes.end(),
                                                         [](auto& part) { return part.field == sorma::Field::floats; });
        step.message.floats.reserve(std::max(node.in, node.out));
        step.held.reserve(std::max(node.in, node.out));     // the two change places
        begins.push_back(net.copies_.size());
        gather(std::size_t(n), net.copies_);
        if (node.loop) net.loops_.push_back(&step);
    }
    begins.push_back(net.copies_.size());
    for (std::size_t i = 0; i < net.steps_.size(); ++i) {
        net.steps_[i].firstCopy = net.copies_.data() + begins[i];
        net.steps_[i].lastCopy = net.copies_.data() + begins[i + 1];
    }
    gather(kOutputs, net.outputs_);
    net.inputCount_ = 0;
    for (auto& p : nodes_[kInputs].pins) net.inputCount_ = std::max(net.inputCount_, p.at + p.length);
    net.outputCount_ = drivers_[kOutputs].size();
    net.inputs_.reserve(std::max(net.inputCount_, net.outputCount_));
    for (int n : {kInputs, kOutputs})
        net.pins_.insert(net.pins_.end(), nodes_[std::size_t(n)].pins.begin(), nodes_[std::size_t(n)].pins.end());
    for (auto& c : connections_) {
        auto text = [&](const End& end) {
            if (end.constant() || !end.whole) return end.toText();
            return sliceText(end.pinText(), 0, c.length);
        };
        auto& to = pin(c.sink);
        auto unit = c.source.node == kConstants || pin(c.source).unit.empty() ? to.unit : pin(c.source).unit;
        net.resolved_.push_back({text(c.wire->source), text(c.wire->sink), c.length, unit});
    }
}

Network::Network(sorma::Service& owner, const Description& description) : owner_(owner) {
    Wiring(*this, owner, description).run();
}

}  // namespace circuit
