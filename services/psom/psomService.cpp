// psom -- a parameterized self-organizing map: learns from few examples, answers in every direction.
//
//     psom.ball CTRL -axes {{-1 0 1} {-1 0 1}} -dimension 4 -metric {0 0 1 1}
//     psom.ball EXEC train FMSG 36 ...                what was seen at each node of the grid
//     psom.ball EXEC complete FMSG 4 0 0 250 315      components 3 and 4 are known: what are 1 and 2?
//
// As a unit of a circuit it completes. doc/psom.man tells all.
#include <cmath>
#include <cstring>

#include <sorma.h>

#include "axes.h"
#include "mapFile.h"
#include "psom.h"

namespace {

using psom::Map;
using sorma::Message;
using sorma::Severity;
using MapPointer = std::shared_ptr<Map>;
using MapFile = sorma::Named<sorma::Kind::file>;

const sorma::Prototype kWord{Severity::error, "PSOM WORD", 2,
                             "{}: bad word \"{}\": must be one of adapt, basis, complete, demonstrate, evaluate, jacobian, nodes, or train"};
const sorma::Prototype kFloats{Severity::error, "PSOM FLOATS", 1, "{}: {} expects {} floats ({}), got {}"};
const sorma::Prototype kValue{Severity::error, "PSOM VALUE", 1, "{}: float {} is {}; all must be finite numbers"};
const sorma::Prototype kShape{Severity::error, "PSOM SHAPE", 1,
                              "{}: the map has no shape yet: set -axes and -dimension, or load one by -map"};
const sorma::Prototype kFileShape{Severity::error, "PSOM SHAPE", 1,
                                  "{}: -map {} has other axes or another dimension than -axes and -dimension say; leave these empty and 0"};
const sorma::Prototype kUntrained{Severity::error, "PSOM UNTRAINED", 1, "{}: the map has learned nothing yet: EXEC train, demonstrate, or -map"};
const sorma::Prototype kMetric{Severity::error, "PSOM METRIC", 1, "{}: -metric has {} weights, the map's vectors have {} components"};
const sorma::Prototype kInputs{Severity::error, "PSOM INPUTS", 1, "{}: no component is an input: set -metric, above 0 for those that are known"};
const sorma::Prototype kSingular{Severity::error, "PSOM SINGULAR", 1,
                                 "{}: the {} inputs do not determine the {} parameters there; give others weight, or another point"};
const sorma::Prototype kSize{Severity::error, "OPTION VALUE", 2, "{}: {}: {}"};
const sorma::Prototype kParts{Severity::error, "PSOM DEMONSTRATION", 1, "{}: {} is not set; it must name {}"};
const sorma::Prototype kRead{Severity::error, "PSOM DEMONSTRATION", 1,
                             "{}: at node {} of {} {} answered {} floats; it must be {} (the vector), or {} (the vector without the node's place)"};
const sorma::Prototype kAtNode{Severity::warning, "PSOM DEMONSTRATION", 1, "{}: at node {} of {}; nothing has been learned"};
const sorma::Prototype kChanged{Severity::error, "PSOM DEMONSTRATION", 1, "{}: the map has been given another shape meanwhile"};

enum Task { adapt, basis, complete, demonstrate, evaluate, jacobian, nodes, train };
constexpr const char* kTasks[] = {"adapt", "basis", "complete", "demonstrate", "evaluate", "jacobian", "nodes", "train"};

class Psom : public sorma::Service {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return sorma::Class::of<Psom>("psom", "a map that learns from few examples and is read in every direction")
            .text("-axes", &Psom::axes_, {.help = "nodes of each axis of the grid, {-1 0 1} {0 1}, or {chebyshev n low high}, {equidistant n low high}"})
            .integer("-dimension", &Psom::dimension_, {.unit = "1", .low = 0, .high = double(psom::kMostDimension),
                                                       .help = "components of a vector; 0: as the file of -map has it"})
            .named("-map", &Psom::file_, {.help = "file to take the map from, as CTRL -save has written it; empty: none"})
            .vector("-metric", &Psom::metric_, {.low = 0, .high = 1e300, .help = "weights of the components: above 0 are inputs"})
            .flag("-scale", &Psom::scale_, {.help = "divide each weight by the square of its component's range over the nodes"})
            .integer("-local", &Psom::local_, {.unit = "nodes", .low = 0, .high = double(psom::kMostNodes),
                                               .help = "use so many nodes of each axis, around the nearest one; 0: all"})
            .real("-margin", &Psom::margin_, {.unit = "1", .low = 0, .high = 10,
                                              .help = "how far parameters may leave the nodes in use, of their range; beyond is \"outside\""})
            .integer("-steps", &Psom::steps_, {.unit = "1", .low = 1, .high = 100'000, .help = "steps of a search, at most"})
            .real("-tolerance", &Psom::tolerance_, {.unit = "1", .low = 0, .high = 1, .help = "a step that is smaller, of the axis, is the last one"})
            .real("-lambda", &Psom::lambda_, {.low = 1e-12, .high = 1e12, .help = "Levenberg-Marquardt term at the start of a search"})
            .integer("-starts", &Psom::starts_, {.unit = "1", .low = 1, .high = 100'000,
                                                 .help = "searches at most: from the nearest node, the next one ..."})
            .real("-threshold", &Psom::threshold_, {.low = 0, .high = 1e300, .help = "... until the error is not above this"})
            .flag("-follow", &Psom::follow_, {.help = "begin each search where the last one ended, for inputs that change little"})
            .real("-rate", &Psom::rate_, {.unit = "1", .low = 0, .high = 1, .help = "of learning by EXEC adapt"})
            .service("-mover", &Psom::mover_, {.help = "demonstrate: gets the place of a node (m floats) and goes there", .part = false})
            .service("-reader", &Psom::reader_, {.help = "demonstrate: answers what there is (the vector, d floats, or d-m: without the place)", .part = false})
            .action("-save", &Psom::save, "file", "write the map to a file, for -map", 1, sorma::Right::inspect, true)
            .inspection({"-match", "", "how the last search went: error, steps, starts, node where it began, converged, outside", 0, 0,
                         [](sorma::Service& s, sorma::Args, Message& m) { static_cast<Psom&>(s).tellMatch(m); }})
            .words("?adapt|basis|complete|demonstrate|evaluate|jacobian|nodes|train?")
            .reads(floats, {}, "", "adapt, complete, jacobian: components (d); evaluate, basis: parameters (m); train: all vectors, last axis fastest")
            .writes(floats, {}, "", "complete: nearest vector of the map (d), then its parameters (m); evaluate: vector (d); jacobian: dw/dx, d rows, "
                                    "a column for each input; adapt: error before (d); nodes: places to train at; basis: of each axis l, l', l''")
            .writes(ints, sorma::between(0, 2), "1", "complete: steps, converged; demonstrate: nodes")
            .writes(text, {}, "", "complete, jacobian, evaluate: \"outside\" or \"not converged\" when it is so")
            .realtime()
            .repeatable({"basis", "evaluate", "jacobian", "nodes"})
            .example("psom CTRL -axes {{0 1}} -dimension 2 -metric {1 0}");
    }

    void born() override {
        auto first = shaped(axes_, std::size_t(dimension_), file_, true);
        weigh(*first, metric_, scale_, local_);
        map_ = first;
        given_ = roomFor(*first);
        ints_.reserve(2);
    }

    // Make a new map while a cycle may use the old one; exchange them between two ticks.
    sorma::Commit prepare(const sorma::Change& change) override {
        bool concerned = false;
        for (auto* option : {"-axes", "-dimension", "-map", "-metric", "-scale", "-local"}) concerned |= change.concerns(option);
        if (!concerned) return nullptr;
        auto next = shaped(change.get<std::string>("-axes"), std::size_t(change.get<std::int64_t>("-dimension")),
                           change.named<sorma::Kind::file>("-map"), change.concerns("-map"));
        weigh(*next, change.get<std::vector<double>>("-metric"), change.get<bool>("-scale"), change.get<std::int64_t>("-local"));
        return [this, next, given = roomFor(*next)]() mutable {
            std::swap(map_, next);
            std::swap(given_, given);
        };
    }

    void exec(Message& m) override {
        if (m.words.empty()) return answer(m);
        Task task = taskOf(m.words[0]);
        if (task == Task(-1) || m.words.size() > 1) fail(kWord, name(), m.words[m.words.size() > 1 ? 1 : 0]);
        switch (task) {
        case complete: return answer(m);
        case train: return doTrain(m);
        case evaluate: return doEvaluate(m);
        case jacobian: return doJacobian(m);
        case adapt: return doAdapt(m);
        case basis: return doBasis(m);
        case nodes: return tellNodes(m);
        case demonstrate: return doDemonstrate(m);
        }
    }

    std::vector<sorma::Pin> pins(std::string_view, std::size_t) const override {
        const std::size_t d = map_->dimension(), m = map_->axes().size();
        if (d == 0) return {{"in", true, 0, sorma::Pin::kOpen, {}, {}}, {"out", false, 0, sorma::Pin::kOpen, {}, {}}};
        return {{"in", true, 0, d, {}, "components; those without weight do not matter"},
                {"out", false, 0, d, {}, "nearest vector of the map"},
                {"s", false, d, m, {}, "its parameters"}};
    }

    void dumpState(std::string& out) const override {
        out += "# nodes " + std::to_string(map_->dimension() ? map_->nodes() : 0) + "\n# trained " + (map_->trained() ? "1" : "0") +
               "\n# inputs " + std::to_string(map_->inputs()) + "\n";
    }

    std::string selftest() override {
        if (map_->dimension() == 0) return "ok: no shape yet";
        if (!map_->trained()) return "ok: not trained yet";
        auto vectors = map_->vectors();
        std::vector<double> w(map_->dimension());
        for (std::size_t a = 0; a < map_->nodes(); ++a) {
            map_->evaluate(map_->place(a), margin_, w);
            for (std::size_t k = 0; k < w.size(); ++k)
                if (!(std::abs(w[k] - vectors[a * w.size() + k]) <= 1e-9 * (1 + std::abs(w[k])))) return "node " + std::to_string(a + 1) + " is not on the map";
        }
        return "ok: the map goes through all " + std::to_string(map_->nodes()) + " nodes";
    }

private:
    static Task taskOf(std::string_view word) {
        for (std::size_t i = 0; i < std::size(kTasks); ++i)
            if (word == kTasks[i]) return Task(i);
        return Task(-1);
    }

    // ---- shape ----

    // The map for these options: what it has learned stays as long as the shape stays.
    MapPointer shaped(const std::string& axesText, std::size_t dimension, const MapFile& file, bool again) {
        auto axes = psom::parseAxes(name(), axesText);
        const bool open = axes.empty() && dimension == 0;
        if (!file.empty() && again) {
            auto loaded = psom::load(name(), file.use(*this));
            if (!open && (axes != loaded->axes() || dimension != loaded->dimension())) fail(kFileShape, name(), file.get(sorma::Permit::owner()));
            return loaded;
        }
        if (open && !file.empty()) return copied();
        if (axes.empty()) dimension = 0;
        if (auto wrong = psom::checkAxes(axes, dimension); !wrong.empty()) fail(kSize, name(), "-dimension", wrong);
        if (map_ && map_->dimension() == dimension && map_->axes() == axes) return copied();
        if (!file.empty()) fail(kFileShape, name(), file.get(sorma::Permit::owner()));
        if (dimension == 0) axes.clear();
        return std::make_shared<Map>(axes, dimension);
    }

    // The map with what it has learned. A tick may be using its scratch memory meanwhile, which is left alone.
    MapPointer copied() const {
        auto map = std::make_shared<Map>(map_->axes(), map_->dimension());
        if (map_->trained()) map->train(map_->vectors());
        return map;
    }

    // Memory for what EXEC is given: no tick takes any.
    static std::vector<double> roomFor(const Map& map) {
        std::vector<double> out;
        out.reserve(map.dimension() + psom::kMostAxes);
        return out;
    }

    void weigh(Map& map, const std::vector<double>& metric, bool scale, std::int64_t local) const {
        if (map.dimension() == 0) return;
        if (!metric.empty() && metric.size() != map.dimension()) fail(kMetric, name(), metric.size(), map.dimension());
        map.setLocal(std::size_t(local));
        map.setWeights(metric.empty() ? std::vector<double>(map.dimension(), 0.0) : metric, scale);
    }

    // ---- what EXEC does ----

    void need(const Message& m, const char* task, std::size_t count, const char* what) const {
        if (map_->dimension() == 0) [[unlikely]] fail(kShape, name());
        if (m.floats.size() != count) [[unlikely]] fail(kFloats, name(), task, count, what, m.floats.size());
        for (std::size_t i = 0; i < count; ++i)
            if (!std::isfinite(m.floats[i])) [[unlikely]] fail(kValue, name(), i + 1, m.floats[i]);
    }
    void needMap(bool inputs) const {
        if (!map_->trained()) [[unlikely]] fail(kUntrained, name());
        if (inputs && map_->inputs() == 0) [[unlikely]] fail(kInputs, name());
    }
    void needComponents(Message& m, const char* task) const {
        if (map_->dimension() == 0) [[unlikely]] fail(kShape, name());
        need(m, task, map_->dimension(), "components");
        needMap(true);
    }
    psom::Search search() const {
        return {lambda_, tolerance_, int(steps_), margin_, int(starts_), threshold_, follow_};
    }

    // Moves x out of the message, and leaves there the answer of the search: w, then s.
    void searchFor(Message& m) {
        const std::size_t d = map_->dimension(), axes = map_->axes().size();
        given_.assign(m.floats.begin(), m.floats.end());
        m.clear();
        m.floats.resize(d + axes);
        match_ = map_->complete(given_, search(), std::span(m.floats.data(), d), std::span(m.floats.data() + d, axes));
        if (match_.outside) [[unlikely]] m.text = "outside";
        else if (!match_.converged) [[unlikely]] m.text = "not converged";
    }

    void answer(Message& m) {
        needComponents(m, "complete");
        searchFor(m);
        if (m.ints.capacity() < 2) m.ints.swap(ints_);      // memory from before the first tick
        m.ints.assign({match_.steps, match_.converged});
    }

    void doTrain(Message& m) {
        const std::size_t count = map_->nodes() * map_->dimension();
        need(m, "train", count, "a vector for each node, the last axis fastest");
        map_->train(m.floats);
        m.clear();
    }

    void doEvaluate(Message& m) {
        need(m, "evaluate", map_->axes().size(), "parameters");
        needMap(false);
        given_.assign(m.floats.begin(), m.floats.end());
        m.clear();
        m.floats.resize(map_->dimension());
        if (!map_->evaluate(given_, margin_, m.floats)) m.text = "outside";
    }

    void doJacobian(Message& m) {
        needComponents(m, "jacobian");
        searchFor(m);
        m.floats.resize(map_->dimension() * map_->inputs());
        if (!map_->jacobian(m.floats)) fail(kSingular, name(), map_->inputs(), map_->axes().size());
    }

    void doAdapt(Message& m) {
        needComponents(m, "adapt");
        given_.assign(m.floats.begin(), m.floats.end());
        m.clear();
        m.floats.resize(map_->dimension());
        match_ = map_->adapt(given_, rate_, search(), m.floats);
    }

    void doBasis(Message& m) {
        need(m, "basis", map_->axes().size(), "parameters");
        given_.assign(m.floats.begin(), m.floats.end());
        m.clear();
        for (std::size_t v = 0; v < given_.size(); ++v) {
            auto b = psom::basis(map_->axes()[v], given_[v]);
            for (auto* list : {&b.l, &b.dl, &b.ddl}) m.floats.insert(m.floats.end(), list->begin(), list->end());
        }
    }

    void tellNodes(Message& m) const {
        need(m, "nodes", 0, "none");
        m.clear();
        for (std::size_t a = 0; a < map_->nodes(); ++a)
            for (double s : map_->place(a)) m.floats.push_back(s);
    }

    // ---- demonstration: move to each node, read what is there ----

    struct Demonstration {
        sorma::Reply reply;
        MapPointer map;                 // shape
        sorma::Reference mover, reader;
        std::size_t node = 0;
        std::vector<double> vectors;
    };
    using DemonstrationPointer = std::shared_ptr<Demonstration>;

    void doDemonstrate(Message& m) {
        need(m, "demonstrate", 0, "none");
        if (!mover_) fail(kParts, name(), "-mover", "an object that goes to the place it gets");
        if (!reader_) fail(kParts, name(), "-reader", "an object that answers what there is");
        auto demo = std::make_shared<Demonstration>();
        demo->map = copied();
        demo->mover = mover_, demo->reader = reader_;
        demo->reply = later(m);
        move(demo);
    }

    void move(const DemonstrationPointer& demo) {
        if (demo->reply.cancelled()) return demo->reply.complete();
        Message to;
        to.floats = demo->map->place(demo->node);
        using sorma::MessageArg;
        const sorma::Trail here(sorma::makeEntry(kAtNode, {MessageArg::of(name()), MessageArg::of(demo->node + 1), MessageArg::of(demo->map->nodes())}));
        demo->reply.ask(demo->mover, std::move(to), [this, demo, here](const Message&) {
            demo->reply.ask(demo->reader, Message(), [this, demo](const Message& seen) { take(demo, seen); }, here);
        }, here);
    }

    void take(const DemonstrationPointer& demo, const Message& seen) {
        const std::size_t d = demo->map->dimension(), m = demo->map->axes().size(), n = demo->map->nodes();
        const auto& w = seen.floats;
        if (w.size() != d && w.size() + m != d)
            fail(kRead, name(), demo->node + 1, n, demo->reader->name(), w.size(), d, d > m ? d - m : 0);
        for (std::size_t i = 0; i < w.size(); ++i)
            if (!std::isfinite(w[i])) fail(kValue, name(), i + 1, w[i]);
        if (w.size() != d)
            for (double s : demo->map->place(demo->node)) demo->vectors.push_back(s);
        demo->vectors.insert(demo->vectors.end(), w.begin(), w.end());
        event_.ints.assign({std::int64_t(++demo->node), std::int64_t(n)});
        publish("node", event_);
        if (demo->node < n) return move(demo);
        if (map_->axes() != demo->map->axes() || map_->dimension() != d) fail(kChanged, name());
        {
            sorma::BetweenTicks between(*this);
            map_->train(demo->vectors);
        }
        demo->reply.message().clear();
        demo->reply.message().ints.assign(1, std::int64_t(n));
        demo->reply.complete();
    }

    // ---- words of CTRL and DBX ----

    void save(Message&, const MapFile& file) {
        needMap(false);
        psom::save(name(), file.use(*this), *map_);
    }

    void tellMatch(Message& m) const {
        auto line = [&](const char* word, double value) {
            if (!m.text.empty()) m.text += '\n';
            m.text += word;
            m.text += ' ';
            sorma::appendNumber(m.text, value);
        };
        line("error", match_.error);
        line("steps", match_.steps);
        line("starts", match_.starts);
        line("node", double(match_.node + 1));
        line("converged", match_.converged);
        line("outside", match_.outside);
    }

    MapPointer map_ = std::make_shared<Map>(std::vector<std::vector<double>>(), 0);
    std::string axes_;
    MapFile file_;
    std::int64_t dimension_ = 0, local_ = 0, steps_ = 50, starts_ = 1;
    std::vector<double> metric_, given_;
    std::vector<std::int64_t> ints_;    // memory for the ints of the first answer
    bool scale_ = false, follow_ = false;
    double margin_ = 0.15, tolerance_ = 1e-10, lambda_ = 0.01, threshold_ = 0, rate_ = 0.5;
    sorma::Reference mover_, reader_;
    psom::Match match_;                 // of the last search
    Message event_;
};

}  // namespace

extern "C" SORMA_EXPORT int Psom_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::psom", "1.0", {Psom::describe()});
}
