# flood.tcl ?seconds? -- one client sends requests without waiting for any reply, as fast as the daemon takes them. How long
# does another client wait for each of its calls, and how much memory does the daemon need?
#
# The times depend on the machine: they are printed, not judged.

source [file join [file dirname [file normalize [info script]]] faults.tcl]

# Times of calls [us] for so many seconds.
proc callFor {name seconds} {
    set times {}
    set end [expr {[clock microseconds] + int($seconds * 1e6)}]
    while {[set start [clock microseconds]] < $end} {
        $name EXEC
        lappend times [expr {[clock microseconds] - $start}]
    }
    return $times
}

attack {
    set seconds [expr {$argc > 0 ? [lindex $argv 0] : 5}]
    set d [daemon start -tcp 1]
    nop@$d EXEC
    set before [memoryOf $d]
    set quiet [callFor nop@$d $seconds]
    set flooder [open [list | [file join $env(SORMA_BUILD) flooder] [daemon info $d port] nop 2>@stderr] r+]
    fconfigure $flooder -blocking 0
    # It is at work when the daemon has served more than our own calls.
    waitFor {[regexp -line {from 127\S* .* (\d+) calls} [sorm@$d CTRL -connections] -> calls] && $calls > 1000}
    set flooded [callFor nop@$d $seconds]
    set more [expr {[memoryOf $d] - $before}]
    regexp -line {from 127\S* .* (\d+) calls} [sorm@$d CTRL -connections] -> calls
    close $flooder
    foreach {what times} [list quiet $quiet "beside the flood" $flooded] {
        puts [format "%-18s %7d calls, p50 %8.0f us, p99 %8.0f us" $what [llength $times] [quantile $times 0.5] [quantile $times 0.99]]
    }
    puts "the flood            $calls calls, memory of the daemon + [megabytes $more]"
    promise "the other client is served" [expr {[llength $flooded] > 10}]
    promise "the flood costs less than 16 MB" [expr {$more < 16000000}]
}
