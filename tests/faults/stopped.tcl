# stopped.tcl ?rounds? -- a daemon is stopped (SIGSTOP) while it sends a long reply, by TCP and by Unix-domain socket. Printed, not
# judged: how long after its deadline the caller is back. Nobody waits for ever, and the daemon goes on when it may.

source [file join [file dirname [file normalize [info script]]] faults.tcl]

attack {
    set rounds [expr {$argc > 0 ? [lindex $argv 0] : 20}]
    set d [serve {
        oo::class create long {
            superclass sorma::Service
            method exec message {
                return [dict create text [string repeat x 20000000]]
            }
        }
    }]
    set pid [daemon info $d pid]
    foreach {kind where} [list Unix $d TCP 127.0.0.1:[daemon info $d port]] {
        set late {}
        set other 0
        for {set i 0} {$i < $rounds} {incr i} {
            set length [string length [lindex [long@$where EXEC] end]]
            exec sh -c {sleep "$1"; kill -STOP "$2"} stop [expr {0.01 + 0.002 * $i}] $pid &
            set start [clock microseconds]
            sorma::configure -timeout 400
            if {[catch {long@$where EXEC} message options] && [lrange [dict get $options -errorcode] 0 2] eq {SORMA COMM TIMEOUT}} {
                lappend late [expr {([clock microseconds] - $start) / 1000 - 400}]
            } else {
                incr other
                waitFor {[string match "*State:\tT*" [exec cat /proc/$pid/status]]}
            }
            sorma::configure -timeout 25000
            exec kill -CONT $pid
        }
        if {[llength $late] > 0} {
            puts "$kind: $rounds stopped, $other replies were there before; the caller is back [lsort -integer $late] ms after its deadline"
        }
        promise "$kind: callers come back" [expr {[llength $late] + $other == $rounds && [llength $late] > 0}]
        promise "$kind: the daemon goes on" [expr {[string length [lindex [long@$where EXEC] end]] == $length}]
    }
}
