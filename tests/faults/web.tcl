# web.tcl ?seconds? -- strangers at a sorma-web: each asks as fast as it takes, or keeps connections. Meanwhile the owner asks by new connections, and
# looks at a stream. Printed: how long he waits; what the strangers have got; the memory of sorma-web.
#
# Times depend on the machine: they are printed, not judged.

source [file join [file dirname [file normalize [info script]]] faults.tcl]
source [file join $supportFolder web.tcl]

# Ask as the owner for so many seconds, and longer when he was served less than that: a list of times [us], and how many requests have failed.
proc ownerFor {w d s seconds least} {
    set times {}
    set failed 0
    set n 0
    set end [expr {[clock milliseconds] + int(1000 * $seconds)}]
    while {[clock milliseconds] < $end || [llength $times] < $least && [clock milliseconds] < $end + 30000} {
        set begin [clock microseconds]
        if {[lindex [web::ask $w GET /api/foo.a@$d] 0] == 200} {
            lappend times [expr {[clock microseconds] - $begin}]
        } else {
            incr failed
        }
        update
    }
    return [list $times $failed]
}

attack {
    set seconds [expr {$argc > 0 ? [lindex $argv 0] : 5}]
    set d [daemon start -make foo.a]
    set w [web::start]
    waitFor {[lindex [web::ask $w GET /api/foo.a@$d] 0] == 200}
    set s [web::events $w /live/object?name=foo.a@$d]
    waitFor {[web::item $s -where] ne {}}
    set least [expr {$seconds < 2 ? 1 : 10}]
    ownerFor $w $d $s 0.5 $least
    set before [memoryOfProcess [dict get $w pid]]
    foreach {kind connections} {stranger 20 forged 20 origin 20 upgrade 20 huge 20 half 100 idle 100} {
        set flooder [open [list | [info nameofexecutable] [file join $supportFolder webFlooder.tcl] [dict get $w port] $kind $connections 2>@stderr] r+]
        fconfigure $flooder -buffering line
        puts $flooder count
        gets $flooder
        lassign [ownerFor $w $d $s $seconds $least] times failed
        foo.a@$d CTRL -where $kind
        set seen [expr {![catch {waitFor {[web::item $s -where] eq $kind}}]}]
        puts $flooder count
        lassign [gets $flooder] sent answered good closed
        close $flooder
        set more [expr {[memoryOfProcess [dict get $w pid]] - $before}]
        puts [format "%-9s %8d sent, %8d answered; the owner: %6d served, %d not; p50 %8.2f ms, p99 %8.2f ms; memory + %s" $kind $sent $answered [llength $times] $failed \
            {*}[expr {[llength $times] ? [lmap part {0.5 0.99} {expr {[quantile $times $part] / 1000.0}}] : {0 0}}] [megabytes $more]]
        promise "$kind: the owner is served" [expr {[llength $times] >= $least}]
        promise "$kind: his stream goes on" $seen
        promise "$kind: nothing is read or done" [expr {$good == 0}]
        promise "$kind: less than 16 MB" [expr {$more < 16000000}]
    }
    web::hangUp $s
    web::stop $w
}
