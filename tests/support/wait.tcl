# wait.tcl -- tests wait for facts, never for time.

# waitFor condition ?bound?: run the event loop until the expression is true; an error after bound milliseconds.
proc waitFor {condition {bound 30000}} {
    set end [expr {[clock milliseconds] + $bound}]
    while {![uplevel 1 [list expr $condition]]} {
        if {[clock milliseconds] > $end} {
            return -code error "waited $bound ms in vain for: $condition"
        }
        after 5 [list set ::waitForTick 1]
        vwait ::waitForTick
    }
}
