// windows.cpp -- what windows cost: opening a panel, the browser and a dashboard, showing one value that changes, drawing an hour of a chart.
//
// They are drawn on an X server of the benchmark's own (Xvfb). A time ends when the server has answered that all is drawn. Where Tk, snit or Xvfb
// are missing, these rows are left out, and a line on stderr says so.
#include "rows.h"

#include <cstdio>
#include <ctime>
#include <string>
#include <vector>

#include "interpreter.h"
#include "process.h"

namespace bench {

namespace {

struct Row {
    Case of;
    const char *row, *floor;        // procedures of kScript
    bool computed;                  // processor time of this process, else time
};

const std::vector<Row> kRows = {
    {{"PANEL_open", "a panel of 40 options, until it is drawn", "40 labels, entries, scales and units", 6, 0, 0, 1, 1, 5}, "panel", "widgets", false},
    {{"PANEL_change", "one of its values changes and is shown, CPU", "an entry's text is set", 20, 0, 0, 1, 2'000'000, 10}, "value", "typed", true},
    {{"BROWSER_open", "the browser with 40 objects, until it is drawn", "a tree of 40 rows, 11 tabs with a text", 6, 0, 0, 1, 1, 5}, "browser", "tabs", false},
    {{"DASHBOARD_open", "a dashboard of 8 parts, until it is drawn", "8 frames with a label and a canvas", 30, 0, 0, 1, 1, 5}, "board", "frames", false},
    {{"DASHBOARD_change", "a value changes, shown as number, bar and chart, CPU", "three labels are set", 40, 0, 0, 1, 2'000'000, 10}, "shown", "labels", true},
    {{"CHART_hour", "an hour at 1 kHz is drawn, 1280 wide, CPU", "its line alone, as many points", 0, 20'000'000, 0, 1, 1, 5}, "chart", "line", true},
};

const char* const kScript = R"(
    package require Tk
    package require sorma::browser
    package require sorma::dashboard
    package require sorma::theme
    sorma::theme use light
    wm geometry . 1280x800+0+0
    oo::class create dials {
        superclass sorma::Service
        for {set i 0} {$i < 40} {incr i} {
            sorma::option -dial$i double -range {0 100} -unit mm -default 1 -group "Group [expr {$i / 10}]"
        }
        method exec message {return {}}
    }
    sorma::create dials.a
    for {set i 0} {$i < 40} {incr i} {
        sorma::create nop.o$i
    }
    set n 0
    # All is drawn when the server answers.
    proc drawn {} {
        update
        winfo pointerx .
    }
    proc until condition {
        set timer [after 10000 {set ::late 1}]
        set ::late 0
        while {!$::late && ![uplevel #0 [list expr $condition]]} {
            after 1 {set ::turn 1}
            vwait ::turn
        }
        after cancel $timer
        if {$::late} {
            error "waited in vain for $condition"
        }
    }
    proc only {} {
        destroy {*}[lmap child [winfo children .] {if {[winfo class $child] eq "Menu"} continue; set child}]
    }
    set subject [sorma::subject of dials.a]
    until {[$::subject table] ne {}}

    proc panel {} {
        only
        pack [sorma::panel .p dials.a -live 0] -fill both -expand 1
        drawn
    }
    proc widgets {} {
        only
        pack [frame .p] -fill both -expand 1
        for {set i 0} {$i < 40} {incr i} {
            grid [ttk::label .p.l$i -text dial$i] [ttk::entry .p.e$i -width 10] [ttk::label .p.u$i -text mm] [ttk::scale .p.s$i] -sticky ew
            .p.e$i insert 0 1
        }
        drawn
    }
    proc value {} {
        if {![winfo exists .p.head]} panel
        set ::wanted [expr {[incr ::n] % 100}].5
        dials.a CTRL -dial0 $::wanted
        until {[[.p field -dial0].entry.entry get] eq $::wanted}
        drawn
    }
    proc typed {} {
        if {![winfo exists .text]} {
            toplevel .text
            pack [ttk::entry .text.e]
        }
        .text.e delete 0 end
        .text.e insert 0 [incr ::n]
        drawn
    }
    proc browser {} {
        only
        pack [sorma::browser .b] -fill both -expand 1
        until {[llength [lsearch -all -glob [.b tree keys] nop.o*]] == 40}
        drawn
    }
    proc tabs {} {
        only
        pack [ttk::treeview .t] -side left -fill y
        pack [ttk::notebook .n] -fill both -expand 1
        for {set i 0} {$i < 11} {incr i} {
            .n add [frame .n.f$i] -text tab$i
            pack [text .n.f$i.t] -fill both -expand 1
        }
        for {set i 0} {$i < 40} {incr i} {
            .t insert {} end -text nop.o$i
        }
        drawn
    }
    proc board {} {
        only
        pack [sorma::dashboard .d] -fill both -expand 1
        .d read {
            text -text Dials -at "0 0 24 1"
            display -name dials.a -option -dial0 -at "0 1 6 4"
            stripchart -plot "dials.a -dial0" -span 30 -at "6 1 18 7"
            led -name dials.a -option -dial1 -at "0 5 6 3"
            meter -name dials.a -option -dial0 -at "0 8 9 2"
            button -name dials.a -request EXEC -at "9 8 9 2"
            status -name dials.a -at "0 10 6 2"
            reading -name nop.o1 -part text -at "6 10 18 2"
        }
        drawn
    }
    proc frames {} {
        only
        for {set i 0} {$i < 8} {incr i} {
            place [ttk::frame .f$i] -relx [expr {$i % 4 / 4.0}] -rely [expr {$i / 4 / 2.0}] -relwidth 0.25 -relheight 0.5
            pack [ttk::label .f$i.l -text part] [canvas .f$i.c]
        }
        drawn
    }
    proc shown {} {
        if {![winfo exists .d]} board
        set ::wanted [expr {[incr ::n] % 100}].5
        dials.a CTRL -dial0 $::wanted
        until {[lindex [[.d window 2] shows] 1] eq $::wanted}
        drawn
    }
    proc labels {} {
        if {![winfo exists .three]} {
            toplevel .three
            pack [ttk::label .three.a] [ttk::label .three.b] [ttk::label .three.c]
        }
        incr ::n
        foreach w {a b c} {
            .three.$w configure -text $::n
        }
        drawn
    }
    proc chart {} {
        if {![winfo exists .c]} {
            only
            pack [sorma::stripchart .c -span 3600] -fill both -expand 1
            update
            .c pause 1
            for {set i 0} {$i < 3600000} {incr i} {
                .c sample force [expr {sin($i / 50000.0) + ($i % 7) / 50.0}] [expr {$i / 1000.0 - 3600}]
            }
            .c pause 0
            drawn
        }
        .c zoom [expr {[incr ::n] % 2 ? 0.99 : 1 / 0.99}]
        drawn
    }
    proc line {} {
        if {![winfo exists .l]} {
            toplevel .l
            wm geometry .l 1280x800
            pack [canvas .l.c] -fill both -expand 1
            set ::points {}
            for {set i 0} {$i < 2440} {incr i} {
                lappend ::points [expr {$i / 2.0}] [expr {400 + 300 * sin($i / 80.0) + $i % 2 * 30}]
            }
            drawn
        }
        .l.c delete all
        .l.c create line $::points
        drawn
    }
)";

// An X server and what shows windows on it; both end with it. Empty: something is missing, and why.
class Screen {
public:
    Screen() {
        why = program.eval(R"(
            set missing {}
            foreach name {Tk snit} {
                catch {package require no.such.package}
                if {[package versions $name] eq {}} {
                    set missing "there is no package $name"
                }
            }
            if {[auto_execok Xvfb] eq {}} {
                set missing "there is no Xvfb"
            }
            if {$missing eq {}} {
                # It ends when its last window goes: also when this program is killed.
                set server [open |[list Xvfb -displayfd 1 -screen 0 1600x1200x24 -nolisten tcp -terminate 2> /dev/null] r]
                set env(DISPLAY) :[gets $server]
            }
            set missing
        )");
        if (why.empty()) program.eval(kScript);
    }
    ~Screen() {
        try {
            program.eval("catch {destroy .}; if {[info exists server]} {catch {exec kill {*}[pid $server]}; catch {close $server}}");
        } catch (...) {
        }
    }
    Interpreter program;
    std::string why;
};

Body calls(Screen& screen, const char* procedure, bool computed) {
    return [&screen, name = std::string(procedure), computed](std::int64_t count) {
        auto used = [computed] {
            timespec t{};
            clock_gettime(computed ? CLOCK_PROCESS_CPUTIME_ID : CLOCK_MONOTONIC, &t);
            return std::int64_t(t.tv_sec) * 1'000'000'000 + t.tv_nsec;
        };
        screen.program.eval(name);          // what the other side of the row has removed is there again
        const std::int64_t start = used();
        for (; count > 0; --count) screen.program.eval(name);
        return used() - start;
    };
}

}  // namespace

void windows(Table& table) {
    bool wanted = false;
    for (const auto& row : kRows) wanted |= table.wants(row.of.row);
    if (!wanted) return;
    Folder folder;              // daemons of others are not to be seen
    Screen screen;
    if (!screen.why.empty()) {
        std::fprintf(stderr, "bench: no rows of windows: %s\n", screen.why.c_str());
        return;
    }
    for (const auto& row : kRows) {
        if (!table.wants(row.of.row)) continue;
        screen.program.eval("only");
        table.measure(row.of, calls(screen, row.row, row.computed), calls(screen, row.floor, row.computed));
    }
}

}  // namespace bench
