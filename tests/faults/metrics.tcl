# metrics.tcl ?objects? -- a daemon with so many objects (10000) is asked for its figures all the time, while a client calls it. Prints how
# long an answer took, and how long calls took without and with that. Asked for at most: 20 ms, and 2 times.

source [file join [file dirname [file normalize [info script]]] faults.tcl]
source [file join $supportFolder http.tcl]

# Median and the 99th of 100 of so many calls [us].
proc calls {d many} {
    set times {}
    for {set i 0} {$i < $many} {incr i} {
        set begun [clock microseconds]
        nop.0@$d EXEC
        lappend times [expr {[clock microseconds] - $begun}]
    }
    return [list [quantile $times 0.5] [quantile $times 0.99]]
}

attack {
    set objects [expr {$argc > 0 ? [lindex $argv 0] : 10000}]
    set script [::tcltest::makeFile "for {set i 0} {\$i < $objects} {incr i} { sorma::create nop.\$i; nop.\$i EXEC }" many.tcl]
    set d [daemon start -metrics 0 -script $script]
    set port [daemon info $d metrics]
    set answers {}
    for {set i 0} {$i < 50} {incr i} {
        set begun [clock microseconds]
        set text [lindex [http::get 127.0.0.1 $port /metrics] 1]
        lappend answers [expr {[clock microseconds] - $begun}]
        after 110                       ;# an answer is used again for 100 ms
    }
    puts "[lindex [regexp -inline {sorma_objects.class="nop". (\d+)} $text] 1] objects; answers took [quantile $answers 0.5] us, at most [quantile $answers 1] us"
    set alone [calls $d 20000]
    # One connection asks a hundred times a second: a curl for each would cost more than the answers do.
    set asking [open [list | curl -s --rate 100/s "http://127.0.0.1:$port/metrics?\[1-100000\]" -o /dev/null] w]
    set busy [calls $d 20000]
    exec kill [pid $asking]
    catch {close $asking}
    puts "calls, median and 99 of 100: $alone us; while others ask for the figures all the time $busy us"
    promise "an answer takes less than 20 ms" [expr {[quantile $answers 0.5] < 20000}]
    promise "calls are not slower than 2 times" [expr {[lindex $busy 0] < 2 * [lindex $alone 0]}]
}
