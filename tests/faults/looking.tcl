# looking.tcl ?seconds? ?daemons? -- a client looks at daemons that do not answer, and keeps running.
#
# So many daemons are stopped, as many hang in their interpreter, one host never answers, and one is unknown. Does the client's event loop go on, and are all told as they are?
#
# How late a timer of 5 ms is depends on the machine, too: it is printed, and judged as the manual says, with 50 ms.

source [file join [file dirname [file normalize [info script]]] faults.tcl]

proc tick {} {
    set now [clock microseconds]
    lappend ::late [expr {$now - $::due}]
    set ::due [expr {$now + 5000}]
    after 5 tick
}

proc states pattern {
    return [lsort -unique [lmap key [sorma::world keys $pattern] {dict get [sorma::world get $key] state}]]
}

attack {
    set seconds [expr {$argc > 0 ? [lindex $argv 0] : 10}]
    set many [expr {$argc > 1 ? [lindex $argv 1] : 10}]
    set script [::tcltest::makeFile {after 1000 {after 1000000}} hang.tcl]
    for {set n 0} {$n < $many} {incr n} {
        daemon start -name stopped$n
        daemon start -name hanging$n -script $script
        exec kill -STOP [daemon info stopped$n pid]
    }
    set server [socket -server {lappend ::kept} -myaddr 127.0.0.1 0]
    sorma::so::dict CTRL -add @mute 127.0.0.1:[lindex [fconfigure $server -sockname] 2]
    sorma::so::dict CTRL -add @nowhere there.is.no.such.host.invalid:7014
    package require sorma::world
    set late {}
    set due [expr {[clock microseconds] + 5000}]
    after 5 tick
    foreach pattern {* *@*} {
        sorma::world watch $pattern -command list
    }
    after [expr {1000 * $seconds}] {set over 1}
    vwait over
    set late [lsort -integer $late]
    puts "timer of 5 ms, [llength $late] times: half at most [quantile $late 0.5] us late, all but 1 % [quantile $late 0.99] us, all [lindex $late end] us"
    promise "the event loop is never held up for 50 ms" [expr {[lindex $late end] < 50000}]
    promise "who is stopped is silent" [expr {[states stopped*] eq "silent"}]
    promise "who hangs is busy" [expr {[states hanging*] eq "busy"}]
    promise "the host that says nothing is silent, the other one leads nowhere" [expr {[states mute] eq "silent" && [states nowhere] eq "unresolved"}]
    for {set n 0} {$n < $many} {incr n} {
        exec kill -CONT [daemon info stopped$n pid]
    }
    waitFor {[states stopped*] eq "alive"}
    promise "who goes on is alive again" 1
}
