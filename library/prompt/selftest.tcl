# selftest.tcl -- objects test themselves, one after another.

package provide sorma::selftest 1.0         ;# before what needs it in turn
package require sorma::inspect

namespace eval ::sorma::inspect {
    dict set Topics selftest {whether objects pass their self-tests, one after another}
}
namespace eval ::sorma::inspect::selftest {}

# ::sorma::inspect::selftest ?pattern? ?@daemon? ?-within seconds? ?-data? --
#       Have objects test themselves (CTRL -selftest): those here and at each daemon, at one with @daemon, here only with @. Each has so
#       long for it (default 10 s); one that does not answer does not keep the others from their tests.
# Results:
#       How many have passed. Each has a line as soon as it has answered. With -data a list of dicts: where (empty: here), name, passed (1 or
#       0), seconds, text (what it says); or where and error.
proc ::sorma::inspect::selftest args {
    lassign [Parse $args {pattern *} 1 {-within {{seconds 0.01 86400} 10}}] pattern wheres data within
    set tests {}
    foreach {where key error} [Counted $wheres] {
        if {$error ne {}} {
            lappend tests [dict create where $where error $error]
            continue
        }
        foreach name [Names $key] {
            if {[string match $pattern $name] && $name ni {sorm dict}} {
                lappend tests [dict create where $where name $name]
            }
        }
    }
    set items {}
    set passed 0
    foreach test $tests {
        if {![dict exists $test error]} {
            set test [dict merge $test [selftest::Outcome [dict get $test name] [dict get $test where] $within]]
            incr passed [dict get $test passed]
        }
        lappend items $test
        if {!$data} {
            Print [::sorma::listing tested $test]
        }
    }
    if {$data} {
        return $items
    }
    NeedPlaces $wheres $items
    set failed [expr {[llength $items] - $passed}]
    return "$passed passed[if {$failed > 0} {string cat ", $failed failed"}]"
}

# The answer of an object: passed seconds text.
proc ::sorma::inspect::selftest::Outcome {name where seconds} {
    set begun [clock microseconds]
    set passed [expr {![catch {::sorma::await answer $where [list $name CTRL -selftest] [expr {round(1000 * $seconds)}]} text]}]
    return [dict create passed $passed seconds [expr {([clock microseconds] - $begun) / 1e6}] text [regsub {^daemon \S+: } $text {}]]
}
