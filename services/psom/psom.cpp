#include "psom.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Core>

namespace psom {

namespace {

using Four = Eigen::Array4d;
using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, int(kMostAxes), int(kMostAxes)>;
using Column = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, int(kMostAxes), 1>;

// In the innermost loops: a call would take longer than what it does.
[[gnu::always_inline]] inline Four load(const double* p) { return Eigen::Map<const Four>(p); }
[[gnu::always_inline]] inline void store(double* p, const Four& v) { Eigen::Map<Four>{p} = v; }

double scaleOf(const double* nodes, std::size_t n, std::size_t i) {
    double product = 1;
    for (std::size_t j = 0; j < n; ++j)
        if (j != i) product *= nodes[i] - nodes[j];
    return 1 / product;
}

// Contracts the last axis of fields of blocks: the value with l and with l', slopes on later axes with l.
// N: its nodes, or 0 when only n tells.
template <std::size_t N>
void fold(const double* in, std::size_t n, std::size_t rest, std::size_t slopes, bool own, const double* l, const double* dl,
          double* out) {
    if (N) n = N;
    const std::size_t field = 4 * rest;
    for (std::size_t r = 0; r < rest; ++r, in += 4 * n, out += 4) {
        Four first = load(in), value = l[0] * first, slope = dl[0] * first;
        for (std::size_t i = 1; i < n; ++i) {
            Four next = load(in + 4 * i);
            value += l[i] * next;
            slope += dl[i] * next;
        }
        store(out, value);
        if (own) store(out + field, slope);
    }
    out += field;
    for (std::size_t r = 0; r < slopes * rest; ++r, in += 4 * n, out += 4) {
        Four value = l[0] * load(in);
        for (std::size_t i = 1; i < n; ++i) value += l[i] * load(in + 4 * i);
        store(out, value);
    }
}

// Solves (b + lambda 1) x = y in place, for the symmetric b of size n. False when b + lambda 1 is not safely positive definite.
bool solve(const double (*b)[kMostAxes], double lambda, std::size_t n, double* x) {
    double l[kMostAxes][kMostAxes], d[kMostAxes];
    for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t j = 0; j < i; ++j) {
            double sum = b[i][j];
            for (std::size_t k = 0; k < j; ++k) sum -= l[i][k] * d[k] * l[j][k];
            l[i][j] = sum / d[j];
        }
        d[i] = b[i][i] + lambda;
        const double whole = d[i];
        for (std::size_t k = 0; k < i; ++k) d[i] -= l[i][k] * l[i][k] * d[k];
        if (!(d[i] > 1e-15 * whole)) return false;
    }
    for (std::size_t i = 0; i < n; ++i)
        for (std::size_t k = 0; k < i; ++k) x[i] -= l[i][k] * x[k];
    for (std::size_t i = n; i-- > 0;) {
        x[i] /= d[i];
        for (std::size_t k = i + 1; k < n; ++k) x[i] -= l[k][i] * x[k];
    }
    return true;
}

}  // namespace

std::vector<double> chebyshev(std::size_t n, double low, double high) {
    std::vector<double> out;
    for (std::size_t j = n; j-- > 0;)
        out.push_back((low + high) / 2 + (high - low) / 2 * std::cos(std::numbers::pi * double(2 * j + 1) / double(2 * n)));
    if (n % 2) out[n / 2] = (low + high) / 2;
    return out;
}

std::vector<double> equidistant(std::size_t n, double low, double high) {
    std::vector<double> out;
    for (std::size_t j = 0; j < n; ++j) out.push_back(low + (high - low) * double(j) / double(n - 1));
    return out;
}

Basis basis(std::span<const double> nodes, double s) {
    const std::size_t n = nodes.size();
    struct Poly {
        double p = 1, d = 0, dd = 0;
        Poly times(double t) const { return {p * t, d * t + p, dd * t + 2 * d}; }
    };
    std::vector<Poly> before(n + 1), after(n + 1);
    for (std::size_t j = 0; j < n; ++j) before[j + 1] = before[j].times(s - nodes[j]);
    for (std::size_t j = n; j-- > 0;) after[j] = after[j + 1].times(s - nodes[j]);
    Basis out;
    for (std::size_t i = 0; i < n; ++i) {
        const Poly &p = before[i], &q = after[i + 1];
        const double c = scaleOf(nodes.data(), n, i);
        out.l.push_back(c * p.p * q.p);
        out.dl.push_back(c * (p.d * q.p + p.p * q.d));
        out.ddl.push_back(c * (p.dd * q.p + 2 * p.d * q.d + p.p * q.dd));
    }
    return out;
}

Map::Map(std::vector<std::vector<double>> axes, std::size_t dimension, std::size_t local)
    : axes_(std::move(axes)), dimension_(dimension), local_(local) {
    for (auto& axis : axes_) nodes_ *= axis.size();
    allBlocks_ = (dimension_ + kBlock - 1) / kBlock;
    all_.assign(nodes_ * allBlocks_ * kBlock, 0);
    one_.resize(nodes_ * kBlock);
    other_.resize(nodes_ * kBlock);
    distances_.resize(nodes_);
    p_.assign(dimension_, 0);
    pack();
}

std::vector<std::size_t> Map::indexOf(std::size_t node) const {
    std::vector<std::size_t> out(axes_.size());
    for (std::size_t v = axes_.size(); v-- > 0; node /= axes_[v].size()) out[v] = node % axes_[v].size();
    return out;
}

std::vector<double> Map::place(std::size_t node) const {
    auto index = indexOf(node);
    std::vector<double> out;
    for (std::size_t v = 0; v < axes_.size(); ++v) out.push_back(axes_[v][index[v]]);
    return out;
}

void Map::train(std::span<const double> vectors) {
    for (std::size_t a = 0; a < nodes_; ++a)
        for (std::size_t k = 0; k < dimension_; ++k)
            all_[(k / kBlock * nodes_ + a) * kBlock + k % kBlock] = vectors[a * dimension_ + k];
    trained_ = true;
    pack();
}

std::vector<double> Map::vectors() const {
    std::vector<double> out;
    out.reserve(nodes_ * dimension_);
    for (std::size_t a = 0; a < nodes_; ++a)
        for (std::size_t k = 0; k < dimension_; ++k) out.push_back(all_[(k / kBlock * nodes_ + a) * kBlock + k % kBlock]);
    return out;
}

void Map::setLocal(std::size_t local) {
    local_ = local;
    pack();
}

void Map::setWeights(std::span<const double> p, bool scaled) {
    p_.assign(p.begin(), p.end());
    scaled_ = scaled;
    pack();
}

void Map::pack() {
    inputs_.clear();
    for (std::size_t k = 0; k < dimension_; ++k)
        if (p_[k] > 0) inputs_.push_back(k);
    packedBlocks_ = (inputs_.size() + kBlock - 1) / kBlock;
    packed_.assign(nodes_ * packedBlocks_ * kBlock, 0);
    weights_.assign(packedBlocks_ * kBlock, 0);
    goal_.assign(packedBlocks_ * kBlock, 0);
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
        const std::size_t k = inputs_[i];
        double low = std::numeric_limits<double>::infinity(), high = -low;
        for (std::size_t a = 0; a < nodes_; ++a) {
            double w = all_[(k / kBlock * nodes_ + a) * kBlock + k % kBlock];
            packed_[(i / kBlock * nodes_ + a) * kBlock + i % kBlock] = w;
            low = std::min(low, w), high = std::max(high, w);
        }
        weights_[i] = scaled_ && high > low ? p_[k] / ((high - low) * (high - low)) : p_[k];
    }
    bool part = false;
    for (auto& axis : axes_) part |= local_ && local_ < axis.size();
    usedAll_.resize(part ? all_.size() : 0);
    usedPacked_.resize(part ? packed_.size() : 0);
    used_ = 0;
    searched_ = false;
}

// The nodes in use: all, or those around an index on each axis. Their blocks are brought together.
void Map::use(const std::size_t* centre, double margin) {
    bool same = used_ != 0;
    std::size_t count = 1;
    for (std::size_t v = 0; v < axes_.size(); ++v) {
        auto& axis = axes_[v];
        auto& part = parts_[v];
        const std::size_t n = axis.size(), m = local_ ? std::min(local_, n) : n, before = (m - 1) / 2;
        const std::size_t first = m == n || centre[v] < before ? 0 : std::min(centre[v] - before, n - m);
        if (!same || part.first != first || part.count != m) {
            same = false;
            part.first = first, part.count = m;
            for (std::size_t i = 0; i < m; ++i) part.scale[i] = scaleOf(&axis[first], m, i);
        }
        const double range = axis[first + m - 1] - axis[first];
        part.low = axis[first] - margin * range, part.high = axis[first + m - 1] + margin * range;
        count *= m;
    }
    if (same) return;
    used_ = count;
    if (usedAll_.empty()) return;
    std::size_t index[kMostAxes] = {};
    for (std::size_t to = 0; to < used_; ++to) {
        std::size_t from = 0;
        for (std::size_t v = 0; v < axes_.size(); ++v) from = from * axes_[v].size() + parts_[v].first + index[v];
        auto copy = [&](const std::vector<double>& in, std::vector<double>& out, std::size_t blocks) {
            for (std::size_t b = 0; b < blocks; ++b)
                std::copy_n(&in[(b * nodes_ + from) * kBlock], kBlock, &out[(b * used_ + to) * kBlock]);
        };
        copy(all_, usedAll_, allBlocks_);
        copy(packed_, usedPacked_, packedBlocks_);
        for (std::size_t v = axes_.size(); v-- > 0 && ++index[v] == parts_[v].count;) index[v] = 0;
    }
}

void Map::measure() {
    for (std::size_t a = 0; a < nodes_; ++a) {
        Four sum = Four::Zero();
        for (std::size_t b = 0; b < packedBlocks_; ++b) {
            Four d = load(&goal_[b * kBlock]) - load(&packed_[(b * nodes_ + a) * kBlock]);
            sum += load(&weights_[b * kBlock]) * d * d;
        }
        distances_[a] = sum.sum();
    }
}

// The node that comes after one at that distance in the order of distances; of those at one distance the lower one first.
std::size_t Map::nearest(double& distance, std::size_t after, double least) const {
    std::size_t best = nodes_;
    distance = std::numeric_limits<double>::infinity();
    for (std::size_t a = 0; a < nodes_; ++a) {
        const double d = distances_[a];
        if (d < distance && (d > least || (d == least && a > after))) distance = d, best = a;
    }
    return best;
}

void Map::polynomials(const double* s) {
    for (std::size_t v = 0; v < axes_.size(); ++v) {
        auto& part = parts_[v];
        const double* nodes = &axes_[v][part.first];
        const std::size_t n = part.count;
        double p = 1, dp = 0;
        for (std::size_t i = 0; i < n; ++i) {           // from the left: value and slope of the factors before node i
            const double t = s[v] - nodes[i];
            part.l[i] = p, part.dl[i] = dp;
            dp = dp * t + p;
            p *= t;
        }
        double q = 1, dq = 0;
        for (std::size_t i = n; i-- > 0;) {             // and those behind it from the right
            const double t = s[v] - nodes[i];
            part.dl[i] = (part.dl[i] * q + part.l[i] * dq) * part.scale[i];
            part.l[i] *= q * part.scale[i];
            dq = dq * t + q;
            q *= t;
        }
    }
}

// Value, then with slopes the derivatives by axis, of a block, at the point of polynomials().
const double* Map::contract(const double* data, bool slopes) {
    std::size_t rest = used_;
    const double* in = data;
    double* out = one_.data();
    std::size_t fields = 0;
    for (std::size_t v = axes_.size(); v-- > 0;) {
        auto& part = parts_[v];
        rest /= part.count;
        auto* folder = part.count == 3 ? fold<3> : part.count == 2 ? fold<2> : part.count == 4 ? fold<4> : fold<0>;
        folder(in, part.count, rest, fields, slopes, part.l, part.dl, out);
        if (slopes) ++fields;
        in = out;
        out = out == one_.data() ? other_.data() : one_.data();
    }
    return in;
}

// Error, gradient and Gauss-Newton's matrix of the inputs at point.s (4.27, and the first term of 4.28).
void Map::look(Point& point) {
    const std::size_t m = axes_.size();
    polynomials(point.s);
    point.error = 0;
    for (std::size_t u = 0; u < m; ++u) {
        point.gradient[u] = 0;
        std::fill_n(point.hessian[u], u + 1, 0.0);
    }
    const double* data = usedPacked_.empty() ? packed_.data() : usedPacked_.data();
    for (std::size_t b = 0; b < packedBlocks_; ++b) {
        const double* fields = contract(data + b * used_ * kBlock, true);
        const Four p = load(&weights_[b * kBlock]), residual = load(&goal_[b * kBlock]) - load(fields);
        point.error += 0.5 * (p * residual * residual).sum();
        for (std::size_t u = 0; u < m; ++u) {
            const Four slope = p * load(fields + kBlock * (u + 1));
            point.gradient[u] -= (slope * residual).sum();
            for (std::size_t t = 0; t <= u; ++t) point.hessian[u][t] += (slope * load(fields + kBlock * (t + 1))).sum();
        }
    }
}

// Gauss-Newton with a Levenberg-Marquardt term (4.13), within the limits of the parts: an axis whose step leads out of them is
// left out of the step.
Match Map::descend(Point& start, const Search& search) {
    const std::size_t m = axes_.size();
    Match match;
    Point spare, *here = &start, *there = &spare;
    double lambda = search.lambda;
    look(start);
    while (match.steps < search.steps && !match.converged) {
        Point &point = *here, &next = *there;
        double b[kMostAxes][kMostAxes], x[kMostAxes];
        std::size_t axis[kMostAxes], n = 0;
        for (std::size_t u = 0; u < m; ++u) {
            const double g = point.gradient[u];
            if ((point.s[u] <= parts_[u].low && g > 0) || (point.s[u] >= parts_[u].high && g < 0)) continue;
            axis[n] = u;
            x[n] = -g;
            for (std::size_t t = 0; t <= n; ++t) b[n][t] = point.hessian[u][axis[t]];
            ++n;
        }
        ++match.steps;
        if (!solve(b, lambda, n, x)) {
            lambda = std::max(10 * lambda, 1e-12);
            continue;
        }
        std::copy_n(point.s, m, next.s);
        double length = 0;
        for (std::size_t i = 0; i < n; ++i) {
            const Part& part = parts_[axis[i]];
            double& s = next.s[axis[i]];
            s = std::clamp(s + x[i], part.low, part.high);
            const double step = (s - point.s[axis[i]]) / (part.high - part.low);
            length += step * step;
        }
        if (!(length > search.tolerance * search.tolerance)) {
            std::copy_n(next.s, m, point.s);
            match.converged = !std::isnan(length);
            break;
        }
        look(next);
        if (next.error <= point.error * (1 + 1e-12)) {
            std::swap(here, there);
            lambda /= 10;
        } else {
            lambda *= 10;
        }
    }
    if (here != &start) std::copy_n(here->s, m, start.s);
    for (std::size_t u = 0; u < m; ++u) match.outside |= start.s[u] <= parts_[u].low || start.s[u] >= parts_[u].high;
    match.error = here->error;
    return match;
}

void Map::read(const double* s, std::span<double> w) {
    polynomials(s);
    const double* data = usedAll_.empty() ? all_.data() : usedAll_.data();
    for (std::size_t b = 0; b < allBlocks_; ++b) {
        const double* value = contract(data + b * used_ * kBlock, false);
        std::copy_n(value, std::min(kBlock, dimension_ - b * kBlock), &w[b * kBlock]);
    }
}

Match Map::complete(std::span<const double> x, const Search& search, std::span<double> w, std::span<double> s) {
    const std::size_t m = axes_.size();
    for (std::size_t i = 0; i < inputs_.size(); ++i) goal_[i] = x[inputs_[i]];
    measure();
    Match best;
    double distance = -1;
    std::size_t node = nodes_;
    std::size_t centre[kMostAxes], bestCentre[kMostAxes] = {};
    bool following = search.follow && searched_;
    int starts = 0;
    while (starts < search.starts) {
        Point point;
        if (following) {
            node = 0;
            for (std::size_t v = 0; v < m; ++v) {
                auto& axis = axes_[v];
                std::size_t at = 0;
                for (std::size_t i = 1; i < axis.size(); ++i)
                    if (std::abs(axis[i] - lastS_[v]) < std::abs(axis[at] - lastS_[v])) at = i;
                centre[v] = at;
                node = node * axis.size() + at;
                point.s[v] = lastS_[v];
            }
        } else {
            const std::size_t next = nearest(distance, node, distance);
            if (next == nodes_) break;
            node = next;
            for (std::size_t v = m, rest = node; v-- > 0; rest /= axes_[v].size()) {
                centre[v] = rest % axes_[v].size();
                point.s[v] = axes_[v][centre[v]];
            }
        }
        use(centre, search.margin);
        Match match = descend(point, search);
        match.node = node;
        if (starts++ == 0 || match.error < best.error) {
            best = match;
            std::copy_n(point.s, m, s.begin());
            std::copy_n(centre, m, bestCentre);
        }
        if (match.error <= search.threshold) break;
        if (std::exchange(following, false)) node = nodes_;
    }
    best.starts = starts;
    if (starts == 0) {                                  // no distance is a number
        for (std::size_t v = 0; v < m; ++v) s[v] = axes_[v][0];
        best.error = std::numeric_limits<double>::infinity();
    }
    use(bestCentre, search.margin);
    read(s.data(), w);
    std::copy_n(s.begin(), m, lastS_);
    searched_ = starts > 0;
    return best;
}

bool Map::evaluate(std::span<const double> s, double margin, std::span<double> w) {
    std::size_t centre[kMostAxes];
    double held[kMostAxes];
    bool inside = true;
    for (std::size_t v = 0; v < axes_.size(); ++v) {
        auto& axis = axes_[v];
        centre[v] = 0;
        for (std::size_t i = 1; i < axis.size(); ++i)
            if (std::abs(axis[i] - s[v]) < std::abs(axis[centre[v]] - s[v])) centre[v] = i;
    }
    use(centre, margin);
    for (std::size_t v = 0; v < axes_.size(); ++v) {
        held[v] = std::clamp(s[v], parts_[v].low, parts_[v].high);
        inside &= held[v] == s[v];
    }
    read(held, w);
    return inside;
}

bool Map::jacobian(std::span<double> out) {
    const std::size_t m = axes_.size(), n = inputs_.size();
    polynomials(lastS_);
    const double* data = usedAll_.empty() ? all_.data() : usedAll_.data();
    Square b = Square::Zero(Eigen::Index(m), Eigen::Index(m));
    auto slope = [&](std::size_t k, double* row) {
        const double* fields = contract(data + k / kBlock * used_ * kBlock, true);
        for (std::size_t u = 0; u < m; ++u) row[u] = fields[kBlock * (u + 1) + k % kBlock];
    };
    double row[kMostAxes];
    for (std::size_t i = 0; i < n; ++i) {
        slope(inputs_[i], row);
        for (std::size_t u = 0; u < m; ++u)
            for (std::size_t t = 0; t < m; ++t) b(Eigen::Index(u), Eigen::Index(t)) += weights_[i] * row[u] * row[t];
    }
    const Eigen::LDLT<Square> solver(b);
    const auto diagonal = solver.vectorD();
    if (!(diagonal.minCoeff() > 1e-12 * diagonal.maxCoeff())) return false;
    for (std::size_t i = 0; i < n; ++i) {
        slope(inputs_[i], row);
        const Column x = solver.solve(Eigen::Map<const Column>(row, Eigen::Index(m)) * weights_[i]);
        for (std::size_t k = 0; k < dimension_; ++k) {
            double of[kMostAxes];
            slope(k, of);
            out[k * n + i] = Eigen::Map<const Column>(of, Eigen::Index(m)).dot(x);
        }
    }
    return true;
}

Match Map::adapt(std::span<const double> x, double rate, const Search& search, std::span<double> residual) {
    const std::size_t m = axes_.size();
    double s[kMostAxes];
    Match match = complete(x, search, residual, std::span(s, m));
    for (std::size_t k = 0; k < dimension_; ++k) residual[k] = x[k] - residual[k];
    std::size_t index[kMostAxes] = {};
    for (std::size_t n = 0; n < used_; ++n) {
        double h = rate;
        std::size_t a = 0;
        for (std::size_t v = 0; v < m; ++v) {
            h *= parts_[v].l[index[v]];
            a = a * axes_[v].size() + parts_[v].first + index[v];
        }
        for (std::size_t k = 0; k < dimension_; ++k) all_[(k / kBlock * nodes_ + a) * kBlock + k % kBlock] += h * residual[k];
        for (std::size_t i = 0; i < inputs_.size(); ++i)
            packed_[(i / kBlock * nodes_ + a) * kBlock + i % kBlock] += h * residual[inputs_[i]];
        for (std::size_t v = m; v-- > 0 && ++index[v] == parts_[v].count;) index[v] = 0;
    }
    used_ = 0;                                          // the vectors have changed
    return match;
}

}  // namespace psom
