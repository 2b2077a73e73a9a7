// wspc -- guards of motions: where the tool may be, how fast, what it may feel, how near to a singularity.
//
//     wspc.noTable CTRL -inside {0.2 0.9 -0.5 0.5 0.02 0.8}
//     mvpos CTRL -guards {wspc.noTable wspc.fragile}
#include "wspc.h"

#include "errors.h"
#include "pino.h"

namespace robot {

sorma::Class Wspc::describe() {
    using enum sorma::Field;
    auto c = sorma::Class::of<Wspc>("wspc", "guards motions of an arm: workspace, speed, forces, singularities");
    c.vector("-inside", &Wspc::inside_, {.unit = "m", .low = -10, .high = 10,
                                         .help = "boxes in one of which the tool must be, each x x y y z z; empty: "
                                                 "anywhere"})
        .vector("-outside", &Wspc::outside_, {.unit = "m", .low = -10, .high = 10,
                                              .help = "boxes in none of which the tool may be"})
        .real("-speed", &Wspc::speed_, {.unit = "m/s", .low = 0.001, .high = Guard::kAny, .help = "of the tool, at most"})
        .real("-force", &Wspc::force_, {.unit = "N", .low = 0.1, .high = Guard::kAny,
                                        .help = "on the hand, in whatever direction, at most"})
        .real("-moment", &Wspc::moment_, {.unit = "N m", .low = 0.01, .high = Guard::kAny, .help = "the same"})
        .vector("-pattern", &Wspc::pattern_, {.unit = "N, N m",
                                              .help = "least and largest force x y z and moment x y z, 12 numbers; empty: "
                                                      "any"})
        .choice("-frame", &Wspc::frame_, {"tool", "world"}, {.help = "axes of the pattern"})
        .vector("-singular", &Wspc::singular_, {.unit = "m, m, 1", .low = 0, .high = 1,
                                                .help = "distances to keep from the singularities of shoulder, elbow and "
                                                        "wrist, as puma EXEC distances says them",
                                                .minLength = 3, .maxLength = 3})
        .service("-arm", &Wspc::arm_, {.help = "the arm that EXEC looks at; empty: pino"})
        .writes(ints, sorma::exactly(1), "", "1: all is as it must be; 0: it would trip")
        .writes(text, {}, "", "what is not as it must be")
        .example("wspc.slow CTRL -speed 0.05");
    return c;
}

Guard Wspc::guard() const {
    Guard g;
    g.name = name();
    g.speed = speed_, g.force = force_, g.moment = moment_;
    g.worldForces = frame_ == "world";
    g.singular = {singular_[0], singular_[1], singular_[2]};
    auto boxes = [&](const char* option, const std::vector<double>& list, std::vector<Box>& out) {
        if (list.size() % 6 != 0) fail(kOrder, name(), option, "a box is 6 numbers, got " + std::to_string(list.size()));
        for (std::size_t i = 0; i < list.size(); i += 6) {
            Box box{{list[i], list[i + 2], list[i + 4]}, {list[i + 1], list[i + 3], list[i + 5]}};
            if ((box.low.array() > box.high.array()).any())
                fail(kOrder, name(), option, "box " + std::to_string(i / 6 + 1) + " must have its lower bound before its "
                     "upper one: x x y y z z");
            out.push_back(box);
        }
    };
    boxes("-inside", inside_, g.inside);
    boxes("-outside", outside_, g.outside);
    if (!pattern_.empty() && pattern_.size() != 12) fail(kOrder, name(), "-pattern",
                                                         "12 numbers, got " + std::to_string(pattern_.size()));
    for (std::size_t i = 0; i < pattern_.size() / 2; ++i) {
        g.low[int(i)] = pattern_[2 * i], g.high[int(i)] = pattern_[2 * i + 1];
        if (!(pattern_[2 * i] <= pattern_[2 * i + 1])) fail(kOrder, name(), "-pattern",
                                                            "the lower bound of component " +
                                                                std::to_string(i + 1) + " is above its upper one");
    }
    return g;
}

// One that is in use has its new settings from the next tick on.
void Wspc::changed(std::span<const sorma::Option* const>) {
    const Guard g = guard();
    for (auto& other : sorm().names("pino*"))
        if (auto* p = dynamic_cast<Pino*>(sorm().find(other))) p->guardChanged(g);
}

void Wspc::exec(sorma::Message& m) {
    auto arm = arm_ ? arm_ : sorm().get("pino");
    auto* p = dynamic_cast<Pino*>(arm.get());
    if (!p) fail(kNotAnArm, name(), "-arm", arm->name(), arm->type().name());
    const Now now = p->now();
    GuardInput view;
    view.tool = now.settings.frames.toolOf(now.state.q);
    view.ahead = view.tool.p;
    view.sensed = now.sensed, view.felt = now.felt;
    view.singular = puma::distances(now.state.q);
    Trip trip;
    m.clear();
    m.ints = {guard().check(view, trip)};
    if (!m.ints[0]) m.text = std::string(trip.what) + " " + number(trip.value) + ", allowed is " + allowed(trip);
}

}  // namespace robot
