// psom.h -- a parameterized self-organizing map: a smooth manifold through stored vectors, read in every direction.
//
// A grid of m axes has a vector of d components at each node. Polynomials through all nodes make it a function w(s) of m
// parameters. Some components are inputs, by weights: the search finds the s where w(s) is nearest to them. The answer is
// w(s), the other components included. Training is to store the vectors.
//
// Source:    J. Walter, Rapid Learning in Robotics, 1996, chapters 4 and 6; equation numbers below are his.
// Shapes:    vectors of all nodes in row-major order, the last axis fastest; s: one number an axis.
// Threads:   one map belongs to one thread: it keeps its scratch memory.
// Allocates: when it is made, trained or given other weights; the search, evaluation and learning never.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace psom {

constexpr std::size_t kMostAxes = 8, kMostNodes = 32;       // of a map; of an axis

// n zeros of the Chebyshev polynomial, rising, for the range low .. high, in which they lie (6.3).
std::vector<double> chebyshev(std::size_t n, double low, double high);
std::vector<double> equidistant(std::size_t n, double low, double high);

// The n polynomials of an axis, each 1 at its own node and 0 at the others, with two derivatives (4.18). Division-free: exact at
// nodes, good beyond them.
struct Basis {
    std::vector<double> l, dl, ddl;
};
Basis basis(std::span<const double> nodes, double s);

struct Search {
    double lambda = 0.01;           // Levenberg-Marquardt term to begin with, > 0
    double tolerance = 1e-10;       // converged when a step is smaller, of the range of the axis
    int steps = 50;                 // at most, from each start
    double margin = 0.15;           // how far s may be outside the range of the nodes in use, as a part of that range
    int starts = 1;                 // at most: from the nearest node, the next one ...
    double threshold = 0;           // ... until the error is not above this
    bool follow = false;            // begin where the last search has ended
};

struct Match {
    double error = 0;               // 1/2 sum p_k (x_k - w_k)^2
    int steps = 0;                  // of the search that led there
    int starts = 0;                 // searches
    std::size_t node = 0;           // where it began
    bool converged = false;
    bool outside = false;           // s was held at its limit: the answer is that of the limit
};

class Map {
public:
    // axes: nodes of each, rising; 1 to kMostAxes axes of 2 to kMostNodes nodes.   dimension: d > 0.
    // local: nodes of each axis that are used, near the start of the search; 0: all.
    Map(std::vector<std::vector<double>> axes, std::size_t dimension, std::size_t local = 0);

    const std::vector<std::vector<double>>& axes() const { return axes_; }
    std::size_t dimension() const { return dimension_; }
    std::size_t nodes() const { return nodes_; }
    bool trained() const { return trained_; }
    std::vector<std::size_t> indexOf(std::size_t node) const;       // on each axis, from 0
    std::vector<double> place(std::size_t node) const;              // its s

    void train(std::span<const double> vectors);        // nodes() * dimension()
    std::vector<double> vectors() const;
    void setLocal(std::size_t local);
    // Weights of the components: p > 0 makes one an input. scaled: divide each by the square of its component's range over
    // the nodes.
    void setWeights(std::span<const double> p, bool scaled);
    std::size_t inputs() const { return inputs_.size(); }

    // The point of the manifold that is nearest to x (d) in the inputs (4.4): its w (d) and s (m).
    Match complete(std::span<const double> x, const Search& search, std::span<double> w, std::span<double> s);
    // The point of the manifold at s, which is moved within its limits; false when it was outside.
    bool evaluate(std::span<const double> s, double margin, std::span<double> w);
    // dw_k/dx_i at the point where the last search has ended: d rows, a column for each input. False when the inputs do not
    // determine it there.
    bool jacobian(std::span<double> out);
    // Learn: move the vectors of all nodes so that w, at the s of the inputs of x, comes nearer to x by rate (4.14).
    // residual: x - w before.
    Match adapt(std::span<const double> x, double rate, const Search& search, std::span<double> residual);

private:
    static constexpr std::size_t kBlock = 4;            // components that are computed at a time

    // The polynomials of the nodes in use, on one axis.
    struct Part {
        std::size_t first = 0, count = 0;
        double low = 0, high = 0;                       // limits of s
        double scale[kMostNodes];                       // 1 / product of the differences to the other nodes
        double l[kMostNodes], dl[kMostNodes];
    };
    // A point of the search.
    struct Point {
        double s[kMostAxes], gradient[kMostAxes], hessian[kMostAxes][kMostAxes], error;
    };

    void pack();
    void use(const std::size_t* centre, double margin);
    std::size_t nearest(double& distance, std::size_t after, double least) const;
    void measure();
    void polynomials(const double* s);
    const double* contract(const double* data, bool slopes);
    void look(Point& point);
    Match descend(Point& point, const Search& search);
    void read(const double* s, std::span<double> w);

    std::vector<std::vector<double>> axes_;
    std::size_t dimension_, local_, nodes_ = 1;
    bool trained_ = false;
    std::vector<double> p_;                             // d
    bool scaled_ = false;
    std::vector<std::size_t> inputs_;                   // components
    // Blocks of four components, each [node][4]: all components, and the inputs once more.
    std::vector<double> all_, packed_;
    std::vector<double> weights_, goal_;                // of the inputs, in blocks: p, x
    std::size_t allBlocks_ = 0, packedBlocks_ = 0;

    Part parts_[kMostAxes];
    std::size_t used_ = 0;                              // nodes in use
    std::vector<double> usedAll_, usedPacked_;          // their blocks, when they are not all
    double lastS_[kMostAxes];                           // of the last search
    bool searched_ = false;
    std::vector<double> distances_, one_, other_;
};

}  // namespace psom
