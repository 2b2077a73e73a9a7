# figures.tcl -- the tracker's table, each row for a minute and more; and daemons killed while the arm follows. Options as those of tracker.tcl,
# and -rows {NAME ...}: these alone. Exit code 0: each row met its target.

source [file join [file dirname [file normalize [info script]]] tracker.tcl]

namespace eval tracker {
    # As tracker::count wants them. The control task's figures begin anew when its interval changes: so `quick` comes first.
    variable Rows {
        sine {lab sine 60 5}
        quick {runs quick 60 5}
        unpredicted {lab unpredicted 60 5}
        clocks {lab clocks 60 9}
        rest {lab rest 60 2}
        jumps {lab jumps 30 2}
        hidden {lab hidden 28 1}
        lost {lab lost 10 1}
        push {lab push 18 1}
        press {runs press 5 1}
        distractors {lab distractors 10000 500}
        cameras {lab cameras 30 5}
        kills {wall {kill {argus sight camera}} 200 3}
        interrupted {runs interrupted 27 2}
        calls {wall calls 10 3}
        idle {runs idle 600 5}
    }
}

proc tracker::figures {} {
    variable Rows
    variable Options
    set wanted [dict get $Options -rows]
    foreach name $wanted {
        if {![dict exists $Rows $name]} {
            error "there is no row $name: it must be one of [join [dict keys $Rows] {, }]"
        }
    }
    count [dict filter $Rows script {name -} {expr {$wanted eq {} || $name in $wanted}}]
}

set tracker::Only {-rows {any {}}}
exit [tracker::run tracker::figures]
