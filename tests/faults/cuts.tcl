# cuts.tcl ?CUTS? ?SEED? -- calls through a tunnel that breaks at any byte, the first ones included, and now and then refuses.
#
# Blocking and asynchronous calls, each with a number of its own. Each must be answered, with its own number, and be executed
# once: the daemon lives all the time.

source [file join [file dirname [file normalize [info script]]] faults.tcl]

proc ask word {
    puts $::tunnel $word
    return [gets $::tunnel]
}
proc note {number script} {
    if {[catch {uplevel 1 $script} reply]} {
        incr ::failed
        puts stderr "$number: $reply"
    } elseif {$reply ne "RET 0 IMSG 1 $number"} {
        incr ::wrong
        puts stderr "$number: $reply"
    }
}

attack {
    lassign [concat $argv [lrange {200 4711} [llength $argv] end]] cuts seed
    expr {srand($seed)}
    set d [daemon start -tcp 1 -script [file join $supportFolder ledger.tcl]]
    set tunnel [open |[list [info nameofexecutable] [file join $supportFolder tunnel.tcl] [daemon info $d port] $seed 1 3000 10 2>@stderr] r+]
    fconfigure $tunnel -buffering line
    lassign [gets $tunnel] - through
    set failed 0
    set wrong 0
    set number 0
    sorma::configure -timeout 60000
    # The first connection may be cut before the daemon is known; then the call has failed at once.
    while {[catch {nop@127.0.0.1:$through EXEC}]} {}
    while {[ask count] < $cuts} {
        note [incr number] {ledger@127.0.0.1:$through EXEC IMSG 1 $number}
        # Some at a time; the last of them is waited for first.
        set futures {}
        for {set i [expr {int(rand() * 8)}]} {$i > 0} {incr i -1} {
            lappend futures [incr number] [sorma::async ledger@127.0.0.1:$through EXEC IMSG 1 $number]
        }
        foreach {future own} [lreverse $futures] {
            note $own {$future wait}
            $future destroy
        }
    }
    set done [ask whole]
    close $tunnel
    regexp {executed (\d+) twice (\d+)} [ledger@$d DBX -counts] -> executed twice
    puts "cuts $done calls $number failed $failed wrong $wrong twice $twice unexecuted [expr {$number - $executed}]"
    promise "each call is answered, with its own number" [expr {$failed + $wrong == 0}]
    promise "each call is executed once" [expr {$twice == 0 && $executed == $number}]
}
