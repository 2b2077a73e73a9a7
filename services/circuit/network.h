// network.h -- the units of a circuit and the wires between them: checked and sorted when it is made, then only executed.
//
// A run is one tick. The units are executed in an order in which each finds all that it reads; where wires form a loop,
// a unit without feedthrough in it is asked first, by an EXEC with empty floats, what it is going to write, and executed
// when its own inputs are there. So a loop delays nothing beyond what its units do, and a tick is
// y[k] = output(state[k]), state[k+1] = next(state[k], u[k]) for all such units at once.
// One that does not know its width yet may answer with a single float, which then stands for all.
//
// Lengths: those that classes tell by themselves are spread along the wires, and to other pins of a unit as its class says
// (Service::pins), until nothing new comes. A pin whose length is then still open has as many elements as the highest
// index that is wired; a unit may write more than an output of that kind has.
//
// Threads:   made and let go by the SORM's thread, while another one runs the network before it; run by whom the circuit belongs to.
// Allocates: run() does not once warmed up, when its units do not.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include <sorma.h>

#include "wires.h"

namespace circuit {

struct Description {
    std::vector<Wire> wires;
    std::vector<OwnPin> inputs, outputs;
    sorma::PrincipalPointer author;     // who has written the wires
};

// A wire as it was resolved, for those who draw, print and record circuits.
struct ResolvedWire {
    std::string source, sink;       // with their slices: gain.k.out[0:2]
    std::size_t length = 0;
    std::string unit;               // of measurement
};

class Network {
public:
    // Finds the units through the owner's SORM, and makes those that are not there yet; when the circuit is executed in ticks,
    // they come to its real-time owner. This may take long, and ticks go on.
    // Fails with what that fails with, or with CIRCUIT PIN, LENGTH, UNIT, DRIVEN, DANGLING, LOOP, OPEN; SERVICE CYCLE.
    Network(sorma::Service& owner, const Description& description);
    Network(const Network&) = delete;
    Network& operator=(const Network&) = delete;

    // One tick: floats hold the circuit's inputs, then its outputs. What units warn of goes to the message's trail.
    // Fails with the trail of the unit that failed, and CIRCUIT STEP at its end; units before it have done their work.
    void run(sorma::Message& m);

    const std::vector<sorma::Pin>& pins() const { return pins_; }       // the circuit's own
    std::size_t inputs() const { return inputCount_; }                  // floats that run() reads
    std::vector<sorma::Reference> units() const;
    const std::vector<ResolvedWire>& wires() const { return resolved_; }

    // A line for each, of words that requestText.h can read:
    void listUnits(std::string& out) const;     // name class location floats-in floats-out step|loop
    void listWires(std::string& out) const;     // source -> sink length unit
    void listOrder(std::string& out) const;     // ask|exec name
    void listLive(std::string& out) const;      // pin in|out length unit number...    of each pin, the circuit's own first

private:
    friend class Wiring;

    struct Copy {
        const std::vector<double>* from;
        std::uint32_t at, to, count;
    };
    // A unit in its place of the order. Its message holds what it wrote last, for those who come later.
    struct Step {
        sorma::Reference unit;
        sorma::Message message;
        std::vector<double> held;       // of a unit that closes a loop: what it writes in this tick
        std::uint32_t in = 0, out = 0;  // floats that it reads, and writes
        const Copy *firstCopy = nullptr, *lastCopy = nullptr;
        bool exact = true;              // it must write so many; else at least
        bool onlyFloats = false;        // it writes no other part of a message
        bool loop = false;
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
    Step* current_ = nullptr;           // in a register it would be in the way of all the others
    std::vector<Step*> loops_;          // those that are asked before
    std::vector<Copy> copies_;          // of all steps, one after another
    std::vector<Copy> outputs_;         // to the circuit's outputs
    std::vector<double> constants_, inputs_;
    std::size_t inputCount_ = 0, outputCount_ = 0;
    std::vector<sorma::Pin> pins_;
    std::vector<ResolvedWire> resolved_;
};

}  // namespace circuit
