# figures.tcl -- the tracker's table, each row for a minute and more; and daemons killed while the arm follows. Options as those of tracker.tcl,
# and -rows {NAME ...}: these alone.

source [file join [file dirname [file normalize [info script]]] tracker.tcl]

namespace eval tracker {
    # name: what counts it. The control task's figures begin anew when its interval changes: so `quick` comes first.
    variable Rows {
        sine {rows::sine 60}
        quick {rows::quick 60}
        unpredicted {rows::unpredicted 60}
        clocks {rows::clocks 60}
        rest {rows::rest 60}
        jumps {rows::jumps 30}
        hidden {rows::hidden 28}
        lost {rows::lost 10}
        push {rows::push 18}
        press {rows::press 5}
        distractors {rows::distractors 10000}
        cameras {rows::cameras 30}
        kills {rows::kill {argus sight camera} 200}
        interrupted {rows::interrupted 27}
        calls {rows::calls 10}
        idle {rows::idle 600}
    }
}

proc tracker::figures {} {
    variable Rows
    variable Options
    set wanted [dict get $Options -rows]
    dict for {name script} $Rows {
        if {$wanted eq {} || $name in $wanted} {
            {*}$script
        }
    }
}

set tracker::Only {-rows {any {}}}
exit [tracker::run tracker::figures]
