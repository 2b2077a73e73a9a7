# cuts.tcl ?CUTS? ?SEED? -- calls through a tunnel that breaks at any byte, the first ones included, and now and then refuses.
#
# Blocking and asynchronous calls, each with a number of its own. Each must be answered, with its own number, and be executed
# once: the daemon lives all the time. Prints a line: cuts N calls N failed N wrong N twice N unexecuted N.
package require sorma
set support [file join [file dirname [file normalize [info script]]] .. support]
lassign [concat $argv [lrange {200 4711} [llength $argv] end]] cuts seed
expr {srand($seed)}

set folder [exec mktemp -d]
set daemon [open |[list sormad -name cuts[pid] -socket $folder/cuts.sock -port 0 -script [file join $support ledger.tcl] 2>@stderr] r]
regexp {tcp=(\d+)} [gets $daemon] -> port
set tunnel [open |[list [info nameofexecutable] [file join $support tunnel.tcl] $port $seed 1 3000 10 2>@stderr] r+]
fconfigure $tunnel -buffering line
lassign [gets $tunnel] - through

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
regexp {executed (\d+) twice (\d+)} [ledger@$folder/cuts.sock DBX -counts] -> executed twice
puts "cuts $done calls $number failed $failed wrong $wrong twice $twice unexecuted [expr {$number - $executed}]"
close $tunnel
exec kill [pid $daemon]
catch {close $daemon}
file delete -force $folder
