// wiring.h -- makes a network from its description: finds the units, computes lengths, checks every wire, sorts.
//
// Make it, call run() once, and delete it. Errors and threads are as in network.h.
#pragma once

#include <deque>
#include <set>
#include <unordered_map>

#include "network.h"

namespace circuit {

class Wiring {
public:
    Wiring(Network& network, sorma::Service& owner, const Description& description);
    void run();

private:
    static constexpr int kInputs = 0, kOutputs = 1;     // nodes: the circuit's own pins, then the units
    static constexpr int kConstants = -1;

    struct Node {
        std::string name;               // empty: the circuit itself
        sorma::Reference unit;
        std::vector<sorma::Pin> pins;
        // By pin:
        std::vector<std::vector<std::size_t>> wires;    // wires that end there
        std::vector<std::size_t> needed;                // highest index in a slice, plus 1
        std::vector<bool> guessed;                      // its length is `needed`, since nothing else is known
        std::size_t in = 0, out = 0;    // floats
        bool exact = true, loop = false;
        std::size_t place = 0;          // in the order
    };
    struct Terminal {
        int node = kConstants;
        std::size_t pin = 0;            // of the node; of constants: where they begin
    };
    struct Connection {
        const Wire* wire;
        Terminal source, sink;
        std::size_t length = 0, from = 0, to = 0;       // elements; where in the floats of source and sink
    };

    // In this order:
    void declare();
    void connect();
    void refuseRecursion();
    void spread();
    void check();
    void drive();
    void findLoops();
    void sort();
    void assemble();

    sorma::Reference unitNamed(const std::string& object);
    std::vector<sorma::Pin> pinsOf(sorma::Service& unit, std::string_view pin = {}, std::size_t length = sorma::Pin::kOpen);
    int nodeOf(const std::string& object);
    Terminal terminal(const Wire& wire, const End& end, bool sink);
    std::size_t ownPin(const Wire& wire, const End& end, bool sink);
    std::size_t lengthOf(const Connection& c, bool sink) const;
    const sorma::Pin& pin(const Terminal& t) const { return nodes_[std::size_t(t.node)].pins[t.pin]; }
    sorma::Pin& pin(const Terminal& t) { return nodes_[std::size_t(t.node)].pins[t.pin]; }
    void setLength(const Terminal& t, std::size_t length);
    void passLengths();
    void checkEnd(const Connection& c, bool sink) const;
    std::string elementText(const Node& node, std::size_t element) const;
    [[noreturn]] void failLoop(const std::vector<bool>& left) const;
    template <class Use> void eachEdge(Use use) const;      // use(from, to): `to` reads the output of `from`

    Network& network_;
    sorma::Service& owner_;
    const Description& description_;
    const std::string& who_;
    std::deque<Node> nodes_;
    std::vector<Connection> connections_;
    std::unordered_map<std::string, int> byName_;
    std::unordered_map<const sorma::Service*, int> byObject_;
    std::deque<std::size_t> todo_;          // wires along which a length may spread
    std::vector<std::vector<std::size_t>> drivers_;     // by node and element it reads: the wire, from 1
    std::vector<int> order_;
};

}  // namespace circuit
