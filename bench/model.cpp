// model.cpp -- what sorma::world costs a program that watches much: its event loop, and each change.
#include "rows.h"

#include <ctime>

#include <memory>
#include <string>
#include <vector>

#include "interpreter.h"
#include "process.h"

namespace bench {

namespace {

constexpr int kDaemons = 20, kObjects = 10'000, kValues = 300;

const Case kLate = {"MODEL_late", "lateness of a 5 ms timer; 10 000 objects, 300 values", "ten objects, one value", 0, 0, 0, 1, 1, 3};
const Case kChange = {"MODEL_change", "CTRL told to who watches one of 300 values, CPU", "to the only one", 1.2, 0, 0, 1, 200'000, 10};

std::string crowd(int objects) {
    return "package require sorma\n"
           "oo::class create wide {\n"
           "    superclass sorma::Service\n"
           "    for {set i 0} {$i < " + std::to_string(kValues) + "} {incr i} {sorma::option -o$i double -default 0}\n"
           "    method exec message {return {}}\n"
           "}\n"
           "sorma::create wide.a\n"
           "for {set i 0} {$i < " + std::to_string(objects) + "} {incr i} {sorma::create nop.o$i}\n";
}

// know PATTERN WIDE OBJECTS VALUES: watch until so much is known; how late a timer came meanwhile [us]. change: set one of these values.
const char* const kScript = R"(
    package require sorma::world
    set objects [set values [set latest [set n 0]]]
    proc tick due {
        set now [clock microseconds]
        set ::latest [expr {max($::latest, $now - $due)}]
        set ::ticking [after 5 [list tick [expr {$now + 5000}]]]
    }
    proc told {event args} {
        incr ::objects [expr {$event eq "object.made"}]
    }
    proc valued {what name told} {
        incr ::values [dict size $told]
    }
    proc know {pattern wide objects values} {
        set timer [after 60000 {set ::latest -1}]
        tick [clock microseconds]
        sorma::world watch $pattern -command told
        for {set i 0} {$i < $values} {incr i} {
            sorma::world value $wide -o$i -command valued
        }
        while {$::latest >= 0 && ($::objects < $objects || $::values < $values)} {
            vwait ::latest
        }
        after cancel $timer
        after cancel $::ticking
        return $::latest
    }
    proc change {} {
        wide.a CTRL -o0 [incr ::n]
        vwait ::values
    }
)";

void late(Table& table) {
    if (!table.wants(kLate.row)) return;
    Folder folder;
    const std::string many = folder.file("many.tcl", crowd(kObjects / kDaemons));
    std::vector<std::unique_ptr<Daemon>> daemons;
    for (int i = 0; i < kDaemons; ++i)
        daemons.push_back(std::make_unique<Daemon>("many" + std::to_string(i), cpus().second, std::vector<std::string>{"-script", many}));
    Daemon few("few", cpus().second, {"-script", folder.file("few.tcl", crowd(10))});
    auto knowing = [](const std::string& words) -> Body {
        return [words](std::int64_t count) {
            std::int64_t sum = 0;
            for (std::int64_t i = 0; i < count; ++i) {
                Interpreter program;
                program.eval(kScript);
                const std::int64_t latest = std::stoll(program.eval("know " + words));
                if (latest < 0) throw std::runtime_error("MODEL_late: not all was known after a minute");
                sum += latest * 1000;
            }
            return sum;
        };
    };
    table.measure(kLate, knowing("*@many* wide.a@many0 " + std::to_string(kObjects) + " " + std::to_string(kValues)),
                  knowing("*@few wide.a@few 10 1"));
}

void change(Table& table) {
    if (!table.wants(kChange.row)) return;
    Folder folder;
    Interpreter many, one;
    auto changing = [](Interpreter& program, int objects, int values) -> Body {
        program.eval(kScript + crowd(objects));
        program.eval("know *@self wide.a " + std::to_string(objects) + " " + std::to_string(values));
        return [&program](std::int64_t count) {
            auto used = [] {
                timespec t{};
                clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
                return std::int64_t(t.tv_sec) * 1'000'000'000 + t.tv_nsec;
            };
            const std::int64_t start = used();
            for (; count > 0; --count) program.eval("change");
            return used() - start;
        };
    };
    table.measure(kChange, changing(many, kObjects, kValues), changing(one, 10, 1));
}

}  // namespace

void model(Table& table) {
    late(table);
    change(table);
}

}  // namespace bench
