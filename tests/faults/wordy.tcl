# wordy.tcl ?seconds? -- a stranger sends requests with as many words as fit into 8 MB, and as many as a request may have. The owner
# calls each 2 ms meanwhile. Printed: how long he waits, and how long the daemon computes before it answers him. See fairness.tcl.
#
# In less than 2 s times are not judged.

source [file join [file dirname [file normalize [info script]]] faults.tcl]

attack {
    set seconds [expr {$argc > 0 ? [lindex $argv 0] : 5}]
    set d [serve {package require sorma::service::nop} {package require sorma::service::echo}]
    nop@$d EXEC
    echo@$d EXEC
    # So many words of so many letters.
    proc words {count letters} {
        return [rpc::text {}][binary format III 0 0 0][binary format I $count][string repeat [rpc::text [string repeat x $letters]] $count]
    }
    foreach {what record} [list \
        "8 MB of empty words" [rpc::call 1 echo 0 [words 2000000 0]] \
        "8 MB in words of 1000 letters" [rpc::call 1 echo 0 [words 8000 1000]] \
        "a name of 8 MB" [rpc::call 1 [string repeat n 8000000] 0] \
        "65 536 words, which it may have" [rpc::call 1 echo 0 [words 65536 12]] \
        "the same as words of CTRL" [rpc::call 1 echo 1 [words 65536 12]] \
        "a name of 64 kB, which it may have" [rpc::call 1 [string repeat n 65536] 0] \
        "a word of 1 MB, which it may have" [rpc::call 1 echo 1 [words 1 1048000]]] {
        unset -nocomplain waits
        set stranger [flooder [daemon info $d port] stranger $record]
        set owner [caller [daemon info $d socket] [daemon info $d pid] nop]
        set before [replies $stranger]
        set end [expr {[clock milliseconds] + int(1000 * $seconds)}]
        waitFor {[clock milliseconds] >= $end && [replies $stranger] >= $before + 3} 120000
        set count [expr {[replies $stranger] - $before}]
        endCaller $owner waits
        close $stranger
        puts [format "%-36s %6d requests; the owner waits \[ms\] %s; the daemon computed %s" $what $count [quantiles $waits(all)] [quantiles $waits(computed)]]
        promise "$what: requests are answered, and the owner goes on" [expr {$count >= 3 && [llength $waits(all)] > 0}]
        if {$seconds >= 2 && $order eq "first"} {
            promise "$what: the daemon computes less than 20 ms before it answers the owner" [expr {[quantile $waits(computed) 1] < 20000}]
        }
    }
}
