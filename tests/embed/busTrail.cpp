// busTrail.cpp -- checks of trails, and of the catalogue of errors.
#include <cmath>

#include "busText.h"
#include "bus/catalogue.h"
#include "bus/deadline.h"
#include "bus/message.h"
#include "bus/trailText.h"

using namespace sorma;

namespace {

Entry entry(Severity severity, const std::string& t) {
    Entry e;
    e.severity = severity;
    e.symbol = "TEST ENTRY";
    e.text = t;
    return e;
}

std::string texts(const Trail& trail) {
    std::string out;
    for (auto& e : trail.entries()) out += e.text + ' ';
    return out + std::to_string(trail.dropped());
}

void testTrail() {
    Severity s{};
    CHECK(fromText("warning", s) && s == Severity::warning);
    CHECK(!fromText("Warning", s) && s == Severity::warning);
    EQUAL(toText(Severity::verbose), "verbose");

    Trail t;
    CHECK(t.empty() && !t.cause());
    EQUAL(t.toText(), "");
    t.add(entry(Severity::verbose, "v1"));
    CHECK(t.cause() && t.cause()->text == "v1");
    t.add(entry(Severity::error, "e1"));
    t.add(entry(Severity::error, "e2"));
    EQUAL(t.cause()->text, "e1");

    Trail::setLimit(4);
    t.add(entry(Severity::warning, "w1"));
    t.add(entry(Severity::verbose, "v2"));
    EQUAL(texts(t), "e1 e2 w1 v2 1");
    t.add(entry(Severity::warning, "w2"));
    EQUAL(texts(t), "e1 e2 w1 w2 2");
    t.add(entry(Severity::verbose, "v3"));              // the oldest verbose entry is this one itself
    EQUAL(texts(t), "e1 e2 w1 w2 3");
    t.add(entry(Severity::error, "e3"));
    t.add(entry(Severity::error, "e4"));
    EQUAL(texts(t), "e1 e2 e3 e4 5");
    t.add(entry(Severity::error, "e5"));                // the cause stays
    EQUAL(texts(t), "e1 e3 e4 e5 6");
    Trail other;
    other.setDropped(10);
    other.add(entry(Severity::warning, "w3"));
    other.append(t);
    EQUAL(texts(other), "e1 e3 e4 e5 17");
    Trail::setLimit(1);
    t.add(entry(Severity::error, "e6"));
    EQUAL(texts(t), "e1 10");
    Trail::setLimit(0);
    EQUAL(Trail::limit(), 1u);
    Trail::setLimit(Trail::kDefaultLimit);
    other.append(other);
    EQUAL(other.entries().size(), 8u);

    setenv("TZ", "UTC", 1);
    Entry e = entry(Severity::error, "carry.slow: -transferSpeed 7 is\noutside");
    e.symbol = "OPTION RANGE";
    e.so = "carry.slow";
    e.daemon = "robot";
    e.file = "carry.cpp";
    e.line = 31;
    e.time = std::int64_t{10 * 3600 + 31 * 60 + 2} * 1'000'000 + 123'456;
    Trail people;
    people.add(e);
    EQUAL(people.toText(), "error SORMA OPTION RANGE: carry.slow: -transferSpeed 7 is outside  (carry.slow@robot, carry.cpp:31, 10:31:02.123)");
    people.setDropped(3);
    e.so = e.daemon = e.file = "";
    e.severity = Severity::warning;
    e.time = -1;
    people.add(e);
    CHECK(people.toText().starts_with("3 older messages were dropped\nerror SORMA"));
    CHECK(people.toText().ends_with("\nwarning SORMA OPTION RANGE: carry.slow: -transferSpeed 7 is outside  (23:59:59.999)"));

    // A peer's trail of any length costs one pass.
    std::string line = "verbose {{A B}} t so d f 1 2 {}\n", big;
    for (int i = 0; i < 100'000; ++i) big += line;
    Trail read = trailFromWord(big);
    EQUAL(read.entries().size(), Trail::kDefaultLimit);
    EQUAL(read.dropped(), 100'000 - Trail::kDefaultLimit);
}

const Prototype kRange{Severity::error, "TEST RANGE", 2, "{}: {} {} is outside {} .. {} {}"};
const Prototype kNumbers{Severity::error, "TEST NUMBERS", 0, "{:.3f}, {:03}, {}, {}, {}"};
const Prototype kBroken{Severity::warning, "TEST BROKEN", 1, "{} {} {"};

void testCatalogue() {
    try {
        fail(kRange, "carry", std::string("-speed"), 7, 0.01, 1.5, std::string_view("m/s"));
    } catch (const Error& e) {
        EQUAL(e.what(), "carry: -speed 7 is outside 0.01 .. 1.5 m/s");
        EQUAL(brackets(e.code()), "[TEST][RANGE][carry][-speed]");
        CHECK(e.is("TEST RANGE") && !e.is("TEST"));
        const Entry& entry = *e.trail.cause();
        EQUAL(entry.file, "busTrail.cpp");
        CHECK(entry.line > kRange.line);
        CHECK(std::abs(entry.time - wallNow()) < 60'000'000);
    }
    // Text from outside is never a format.
    FAILS(fail(kRange, "{}", "{0}%n", "{", "}", "{:>999999999}", ""), "TEST RANGE", "{}: {0}%n { is outside } .. {:>999999999} ");
    Message m;
    m.warn(kBroken, "a", true);
    EQUAL(m.trail.entries()[0].text, "{} {} { a true");
    EQUAL(brackets(m.trail.entries()[0].details), "[a]");

    // Numbers may be formatted; without a format they are as people write them.
    FAILS(fail(kNumbers, 2.0 / 3, 7, 1000.0, 1e6, 1e300), "TEST NUMBERS", "0.667, 007, 1000, 1000000, 1e+300");
    // What was warned of before the result is made stays.
    m.text = "old";
    m.clear();
    EQUAL(m.trail.entries().size(), 1u);
    EQUAL(m.text, "");
    m.reset();
    CHECK(m.trail.empty());

    auto count = [](std::string_view symbol) {
        int n = 0;
        for (auto* p : catalogue()) n += p->symbol == symbol;
        return n;
    };
    EQUAL(count("TEST RANGE"), 1);
    {
        Prototype first{Severity::verbose, "TEST PASSING", 0, ""}, second{Severity::verbose, "TEST PASSING", 0, ""};
        EQUAL(count("TEST PASSING"), 2);
        EQUAL(first.file, "busTrail.cpp");
    }
    EQUAL(count("TEST PASSING"), 0);
    auto all = catalogue();
    bool sorted = true;
    for (std::size_t i = 1; i < all.size(); ++i) sorted = sorted && std::strcmp(all[i - 1]->symbol, all[i]->symbol) <= 0;
    CHECK(sorted);

    auto trailOf = [](auto thrown) {
        try {
            throw thrown;
        } catch (...) {
            return trailOfCurrentException("carry");
        }
    };
    EQUAL(trailOf(std::runtime_error("100% {}")).cause()->text, "carry: 100% {}");
    EQUAL(trailOf(std::runtime_error("x")).cause()->symbol, "SERVICE FAILED");
    EQUAL(trailOf(std::bad_alloc()).cause()->text, "carry: out of memory");
    EQUAL(trailOf(7).cause()->text, "carry: an exception of unknown type");
    Trail t = trailOf(Error(entry(Severity::error, "e")));
    EQUAL(t.cause()->so, "carry");
    EQUAL(trailOf(Error(Trail())).entries().size(), 0u);
    EQUAL(Error(Trail()).what(), "unknown error");
}

}  // namespace

const std::vector<Group> kTrailGroups{
    {"trail", testTrail}, {"catalogue", testCatalogue},
};
