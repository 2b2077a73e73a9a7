# restarts.tcl ?KILLS? ?SEED? ?MOST? ?TRANSPORT? -- a daemon is killed at random, within MOST ms, and started again.
#
# A client calls it all the time. TRANSPORT: as sorma::configure -transport has it, unix at first.
#
# Each call is answered or reported as LOST, and none executed twice; the books are in a file, so that they outlive daemons.
# An object with a recipe of the client's own must look the same at each daemon (CTRL -dump). How long it took from the daemon's
# "ready" to the first good call is printed, not judged.

source [file join [file dirname [file normalize [info script]]] faults.tcl]

attack {
    lassign [concat $argv [lrange {20 4711 400 unix} [llength $argv] end]] kills seed most transport
    sorma::configure -transport $transport
    set ledger [file join $env(SORMA_RUNTIME_DIR) ledger]
    set env(LEDGER) $ledger
    # Says "ready MICROSECONDS" for each daemon, and at the end "killed N".
    set name restarts[pid]
    set killer [open |[list [info nameofexecutable] [file join $supportFolder killer.tcl] $name [file join $supportFolder ledger.tcl] $kills $seed $most 2>@stderr] r+]
    fconfigure $killer -blocking 0 -buffering line
    waitFor {![catch {nop@$name EXEC}]} 20000
    sorma::so::dict CTRL -add foo.kept@$name -breakfast -tempo presto
    set dump [foo.kept@$name CTRL -dump]
    set differs 0
    set calls 0
    set lost 0
    set other 0
    set answered {}
    set good {}                     ;# [us] of each good call's end
    set ready {}
    while 1 {
        if {[gets $killer line] >= 0} {
            if {[lindex $line 0] eq "killed"} break
            lappend ready [lindex $line 1]
        } elseif {[eof $killer]} {
            break
        }
        try {
            set reply [ledger@$name EXEC IMSG 1 [incr calls]]
            lappend answered $calls
            lappend good [clock microseconds]
            incr differs [expr {[foo.kept@$name CTRL -dump] ne $dump}]
        } trap {SORMA COMM LOST} {} {
            incr lost
        } on error message {
            incr other
            puts stderr $message
        }
    }
    set f [open $ledger]
    set executed [split [string trim [read $f]] \n]
    close $f
    foreach id $executed {
        incr times($id)
    }
    set twice [llength [lsearch -all -not -exact [lmap {- n} [array get times] {set n}] 1]]
    set unexecuted [llength [lmap id $answered {if {[info exists times($id)]} continue; set id}]]
    set waits {}
    set at 0
    foreach moment $ready {
        while {$at < [llength $good] && [lindex $good $at] < $moment} {incr at}
        if {$at < [llength $good]} {
            lappend waits [expr {([lindex $good $at] - $moment) / 1000}]
        }
    }
    puts $killer end
    fconfigure $killer -blocking 1
    catch {close $killer}
    file delete $ledger
    puts "$line calls $calls lost $lost other $other twice $twice unexecuted $unexecuted differs $differs"
    puts "ready to first good call p50 [quantile $waits 0.5] ms p99 [quantile $waits 0.99] ms"
    promise "$kills were killed" [expr {$line eq "killed $kills"}]
    promise "each call is answered or said to be lost" [expr {$other == 0}]
    promise "none is executed twice" [expr {$twice == 0}]
    promise "each that was answered was executed" [expr {$unexecuted == 0}]
    promise "an object with a recipe looks the same at each daemon" [expr {$differs == 0}]
}
