// network.h -- the units of a circuit and the wires between them. They are checked and sorted in the constructor; run() only
// executes them.
//
// run() is one tick. It executes the units in an order in which the inputs of each are complete. A loop of wires has a unit
// without feedthrough. An EXEC with empty floats asks that unit first for its next output; it is executed later, when its
// inputs are complete. So a loop delays nothing beyond its units. A tick is y[k] = output(state[k]), state[k+1] =
// next(state[k], u[k]) for all such units at once. A unit that does not know its width yet may answer with a single float,
// which then stands for all elements.
//
// Lengths: some are given by the classes. They spread along the wires, and to other pins of a unit as its class says
// (Service::pins). A pin without a length after that has as many elements as the highest index in its wires; its unit may
// write more.
//
// Threads:   the SORM's thread makes and deletes it, while another thread may run the network before it. run() is called by
//            the thread to which the circuit belongs.
// Allocates: run() does not after its first calls, if its units do not.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <unordered_map>
#include <vector>

#include <sorma.h>

#include "wires.h"

namespace circuit {

struct Description {
    std::vector<Wire> wires;
    std::vector<OwnPin> inputs, outputs;
    sorma::PrincipalPointer author;     // who wrote the wires; null: the owner
};

// A wire with all that was found out about it, for drawings and lists.
struct ResolvedWire {
    std::string source, sink;       // with their slices: gain.k.out[0:2]
    std::size_t length = 0;
    std::string unit;               // of measurement
};

class Network {
public:
    // Finds the units in the owner's SORM, and makes those that do not exist. If the circuit is executed in ticks, its
    // real-time owner becomes theirs. This may take long, and ticks go on meanwhile. Fails with CIRCUIT PIN, LENGTH, UNIT,
    // DRIVEN, DANGLING, LOOP, OPEN; SERVICE CYCLE; or as Sorm::get.
    Network(sorma::Service& owner, const Description& description);
    Network(const Network&) = delete;
    Network& operator=(const Network&) = delete;

    // One tick. m.floats are the circuit's inputs, and become its outputs. Warnings of units go to m.trail. Fails with the
    // trail of the unit that failed, and CIRCUIT STEP at its end; the units before it have been executed.
    void run(sorma::Message& m);

    const std::vector<sorma::Pin>& pins() const { return pins_; }       // the circuit's own
    std::size_t inputs() const { return inputCount_; }                  // floats that run() reads
    std::vector<sorma::Reference> units() const;
    const std::vector<sorma::Pin>* pinsOf(const sorma::Service& unit) const;    // as they were when it was wired; null: it is no unit
    void retire(const sorma::Service& unit);        // It has other pins: listLive shows these, without numbers. There must be no tick any more.
    const std::vector<ResolvedWire>& wires() const { return resolved_; }

    // A line for each, of words that requestText.h can read:
    void listUnits(std::string& out) const;     // name class location floats-in floats-out step|loop
    void listWires(std::string& out) const;     // source -> sink length unit
    void listOrder(std::string& out) const;     // ask|exec name
    void listLive(std::string& out) const;      // pin in|out length unit number...    of each pin, the circuit's own first
    void listTicks(std::string& out) const;     // circuit ticks-begun seconds, of the monotonic clock; then unit times-executed

private:
    friend class Wiring;

    struct Copy {
        const std::vector<double>* from;
        std::uint32_t at, to, count;
    };
    // A unit, at its place in the order. Its message has its last output, from which the steps after it copy.
    struct Step {
        sorma::Reference unit;
        sorma::Message message;
        std::vector<double> held;       // of a unit that closes a loop: its output in this tick
        std::uint32_t in = 0, out = 0;  // floats that it reads, and writes
        const Copy *firstCopy = nullptr, *lastCopy = nullptr;      // that fill its inputs
        bool exact = true;              // it must write exactly `out` floats; else at least
        bool onlyFloats = false;        // it writes no other part of a message
        bool loop = false;
        std::uint64_t done = 0;         // ticks in which it has been executed
        std::vector<sorma::Pin> pins;
    };

    void gather(const Copy* first, const Copy* last, double* to) const {
        for (; first != last; ++first) {
            const double* from = first->from->data() + first->at;
            if (first->count == 1) {
                to[first->to] = *from;
                continue;
            }
            std::memcpy(to + first->to, from, first->count * sizeof(double));
        }
    }
    void ask(Step& step, sorma::RealtimeOwner* here) const;
    void execute(Step& step, sorma::RealtimeOwner* here) const;
    void tidy(Step& step, sorma::Message& m) const;
    void handOn(sorma::Trail& from, sorma::Trail& to) const;
    [[noreturn]] void failStep(Step& step, sorma::Message& m) const;

    sorma::Service& owner_;
    std::vector<Step> steps_;           // in order
    std::unordered_map<const sorma::Service*, std::size_t> places_;     // of units, among them
    Step* current_ = nullptr;           // being executed, for failStep; a member, so that it takes no register in the loop of run()
    std::vector<Step*> loops_;          // units that close a loop: they are asked first
    std::vector<Copy> copies_;          // of all steps, one after another
    std::vector<Copy> outputs_;         // to the circuit's outputs
    std::vector<double> constants_, inputs_;
    std::size_t inputCount_ = 0, outputCount_ = 0;
    std::uint64_t begun_ = 0;           // ticks; a unit's `done` is less by the ticks that failed before it
    std::vector<sorma::Pin> pins_;
    std::vector<ResolvedWire> resolved_;
};

}  // namespace circuit
