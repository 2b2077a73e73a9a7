#include "network.h"

#include <algorithm>

namespace circuit {

namespace {

using sorma::Message;
using sorma::Prototype;
using sorma::Severity;

const Prototype kStep{Severity::error, "CIRCUIT STEP", 2, "{}: its unit {} has failed"};
const Prototype kWritten{Severity::error, "CIRCUIT LENGTH", 2,
                         "{}: {} has written {} floats, and the wires expect {}; when its options have changed, CTRL -rewire"};

}  // namespace

// Ask a unit for its output of this tick, before its inputs are known.
inline void Network::ask(Step& step, sorma::RealtimeOwner* here) const {
    Message& m = step.message;
    m.floats.clear();
    step.unit.step(m, here);
    if (m.floats.size() == 1 && step.out > 1) m.floats.resize(step.out, m.floats[0]);
    if (m.floats.size() != step.out) [[unlikely]]
        if (step.exact || m.floats.size() < step.out) fail(kWritten, owner_.name(), step.unit->name(), m.floats.size(), step.out);
    std::swap(m.floats, step.held);
}

inline void Network::execute(Step& step, sorma::RealtimeOwner* here) const {
    Message& m = step.message;
    if (m.floats.size() != step.in) m.floats.resize(step.in);
    gather(step.firstCopy, step.lastCopy, m.floats.data());
    step.unit.step(m, here);
    if (m.floats.size() != step.out) [[unlikely]]
        if (step.exact || m.floats.size() < step.out) fail(kWritten, owner_.name(), step.unit->name(), m.floats.size(), step.out);
}

void Network::handOn(sorma::Trail& from, sorma::Trail& to) const {
    to.append(from);
    from.clear();
}

// Nothing that a unit has written beside its floats is its next request.
inline void Network::tidy(Step& step, Message& m) const {
    Message& own = step.message;
    if (!own.trail.empty()) [[unlikely]] handOn(own.trail, m.trail);
    own.code = 0;
    if (step.onlyFloats) [[likely]] return;
    own.text.clear();
    own.ints.clear();
    own.any.clear();
    own.words.clear();
}

void Network::failStep(Step& step, Message& m) const {
    sorma::Trail trail = m.trail;
    trail.append(sorma::trailOfCurrentException(step.unit->name()));
    trail.add(sorma::makeEntry(kStep, {sorma::MessageArg::of(owner_.name()), sorma::MessageArg::of(step.unit->name())}));
    step.message.reset();
    throw sorma::Error(std::move(trail));
}

void Network::run(Message& m) {
    sorma::RealtimeOwner* here = sorma::RealtimeOwner::current();
    std::swap(m.floats, inputs_);
    ++begun_;
    try {
        for (Step* s : loops_) {
            current_ = s;
            ask(*s, here);
            tidy(*s, m);
        }
        for (Step *s = steps_.data(), *end = s + steps_.size(); s != end; ++s) {
            current_ = s;
            execute(*s, here);
            ++s->done;
            tidy(*s, m);
        }
    } catch (...) {
        failStep(*current_, m);
    }
    m.floats.resize(outputCount_);
    gather(outputs_.data(), outputs_.data() + outputs_.size(), m.floats.data());
}

std::vector<sorma::Reference> Network::units() const {
    std::vector<sorma::Reference> out;
    for (auto& s : steps_) out.push_back(s.unit);
    return out;
}

const std::vector<sorma::Pin>* Network::pinsOf(const sorma::Service& unit) const {
    auto at = places_.find(&unit);
    return at == places_.end() ? nullptr : &steps_[at->second].pins;
}

void Network::retire(const sorma::Service& unit) {
    auto& step = steps_[places_.at(&unit)];
    step.pins = unit.pins();
    step.in = 0;
    step.firstCopy = step.lastCopy;
    step.message.floats.clear();
    step.held.clear();
}

// ---- for those who look at it ----

namespace {

void appendLine(std::string& out, const std::vector<std::string>& words) {
    if (!out.empty()) out += '\n';
    std::string line;
    for (auto& word : words) sorma::appendWord(line, word);
    out += line;
}

}  // namespace

void Network::listUnits(std::string& out) const {
    for (auto& s : steps_)
        appendLine(out, {s.unit->name(), s.unit->type().name(), s.unit->location(), std::to_string(s.in), std::to_string(s.out),
                         s.loop ? "loop" : "step"});
}

void Network::listWires(std::string& out) const {
    for (auto& w : resolved_) appendLine(out, {w.source, "->", w.sink, std::to_string(w.length), w.unit});
}

void Network::listOrder(std::string& out) const {
    for (auto* s : loops_) appendLine(out, {"ask", s->unit->name()});
    for (auto& s : steps_) appendLine(out, {"exec", s.unit->name()});
}

void Network::listLive(std::string& out) const {
    auto line = [&](const std::string& owner, const sorma::Pin& pin, const std::vector<double>& floats) {
        std::vector<std::string> words = {owner + pin.name, pin.input ? "in" : "out",
                                          pin.length == sorma::Pin::kOpen ? "open" : std::to_string(pin.length), pin.unit};
        for (std::size_t i = pin.at; i < pin.at + pin.length && i < floats.size(); ++i) words.push_back(sorma::numberText(floats[i]));
        appendLine(out, words);
    };
    std::vector<double> read;
    auto gathered = [&](const Copy* first, const Copy* last, std::size_t count) -> const std::vector<double>& {
        read.assign(count, 0);
        for (auto* c = first; c != last; ++c)
            if (c->from->size() < c->at + c->count) return read.clear(), read;      // it has not run yet
        gather(first, last, read.data());
        return read;
    };
    for (auto& pin : pins_)
        line("", pin, pin.input ? inputs_ : gathered(outputs_.data(), outputs_.data() + outputs_.size(), outputCount_));
    for (auto& s : steps_)
        for (auto& pin : s.pins)
            line(s.unit->name() + ".", pin,
                 pin.input ? gathered(s.firstCopy, s.lastCopy, s.in)
                           : s.loop ? s.held : s.message.floats);
}

void Network::listTicks(std::string& out) const {
    appendLine(out, {owner_.name(), std::to_string(begun_), sorma::numberText(double(sorma::monotonicNow()) * 1e-9)});
    for (auto& s : steps_) appendLine(out, {s.unit->name(), std::to_string(s.done)});
}

}  // namespace circuit
