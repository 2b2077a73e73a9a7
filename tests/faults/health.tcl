# health.tcl ?sessions? -- a client leaves sessions with many slots behind. HEALTH must take no longer than before.
#
# With fewer than 100 sessions times are not judged.

source [file join [file dirname [file normalize [info script]]] faults.tcl]

# Times of HEALTH [us], so many, on a channel that blocks.
proc healthTimes {c count} {
    set times {}
    for {set i 0} {$i < $count} {incr i} {
        set start [clock microseconds]
        rpc::send $c [rpc::record [rpc::header $i 4]]
        binary scan [read $c 4] Iu mark
        set record [read $c [expr {$mark & 0x7fffffff}]]
        lappend times [expr {[clock microseconds] - $start}]
        if {[dict get [rpc::reply $record] status] ne "ok"} {
            error "HEALTH was refused"
        }
    }
    return $times
}

attack {
    set sessions [expr {$argc > 0 ? [lindex $argv 0] : 388}]
    set d [daemon start -tcp 1 -package sorma::service::nop]
    set port [daemon info $d port]
    set c [socket 127.0.0.1 $port]
    fconfigure $c -translation binary
    healthTimes $c 100
    set before [quantile [healthTimes $c 500] 0.5]
    set made 0
    for {set i 0} {$i < $sessions} {incr i} {
        set one [rpc::connect $port]
        rpc::send $one [rpc::hello 1 [expr {7000 + $i}]][rpc::call 2 nop 0 {} 1023 1]
        rpc::receive $one
        incr made [expr {[dict get [rpc::result [rpc::receive $one]] code] == 0}]
        rpc::close $one
    }
    set after [quantile [healthTimes $c 500] 0.5]
    close $c
    puts [format "%d sessions of 1024 slots: HEALTH takes %.0f us, before %.0f us: %.2f x" $made $after $before [expr {double($after) / $before}]]
    promise "sessions were made" [expr {$made > 0}]
    if {$sessions >= 100} {
        promise "HEALTH takes less than 1.5 times as long" [expr {$after < 1.5 * $before}]
    }
}
