# storm.tcl ?RATE? ?SECONDS? ?DAEMONS? -- daemons publish so many events/s in all, more than can be recorded; are all losses counted?
#
# For each daemon the events in the file of sorma-record and the losses that stand in it must be as many as the daemon has published. The
# program must say the same numbers at its end.

source [file join [file dirname [file normalize [info script]]] faults.tcl]
package require sorma::service::recorder

set storm {
    package require sorma
    oo::class create storm {
        superclass sorma::Service
        variable published began until rate
        method exec message {
            lassign [dict get $message ints] rate seconds
            if {$rate ne {}} {
                set published 0
                set began [clock microseconds]
                set until [expr {$began + 1000000 * $seconds}]
                after 0 [list [self namespace]::my Turn]
                return {}
            }
            return [dict create ints [list $published [expr {[clock microseconds] >= $until}]]]
        }
        # As many as are due, but no longer than 50 ms.
        method Turn {} {
            set now [clock microseconds]
            set due [expr {$rate * (min($now, $until) - $began) / 1000000}]
            set end [expr {$now + 50000}]
            while {$published < $due && [clock microseconds] < $end} {
                for {set i 0} {$i < 100} {incr i} {
                    my publish blow -ints $published
                    incr published
                }
            }
            if {$now < $until} {
                after 5 [list [self namespace]::my Turn]
            }
        }
    }
}

attack {
    lassign [concat $argv [lrange {1000000 10 10} [llength $argv] end]] rate seconds daemons
    set file [file join $env(SORMA_RUNTIME_DIR) storm.rec]
    for {set i 0} {$i < $daemons} {incr i} {
        lappend all [serve $storm]
        storm.a@[lindex $all end] EXEC IMSG 2 0 0
    }
    set recorder [open [list | [file join $env(SORMA_BUILD) sorma-record] -o $file -requests {} -events storm.* -daemon {*}$all 2>@stderr] r]
    gets $recorder
    foreach d $all {
        storm.a@$d EXEC IMSG 2 [expr {$rate / $daemons}] $seconds
    }
    after [expr {1000 * $seconds}]
    foreach d $all {
        waitFor {[lindex [set reply [storm.a@$d EXEC]] end] == 1} 60000
        dict set published $d [lindex $reply end-1]
    }
    exec kill -INT [pid $recorder]
    set said [string trim [read $recorder]]
    close $recorder
    set sum [tcl::mathop::+ {*}[dict values $published]]
    puts "published $sum in $seconds s, [expr {$sum / $seconds}]/s; sorma-record: [string map [list $file FILE] $said]"

    foreach d $all {
        dict set found $d {events 0 lost 0}
    }
    sorma::create recorder.storm -file $file
    set stream [sorma::stream {recorder.storm EXEC records}]
    set elsewhere 0
    while {[$stream next piece]} {
        foreach record [dict get $piece text] {
            set source [dict get $record source]
            switch [dict get $record kind] {
                event { dict with found $source {incr events} }
                loss {
                    if {[dict exists $found $source]} {
                        dict with found $source {incr lost [dict get $record number]}
                    } else {
                        incr elsewhere [dict get $record number]
                        puts "lost by $source: [dict get $record number], [dict get $record word]"
                    }
                }
            }
        }
    }
    $stream close
    set allLost $elsewhere
    set allEvents 0
    foreach d $all {
        dict with found $d {}
        incr allLost $lost
        incr allEvents $events
        promise "$d: [dict get $published $d] published are $events in the file and $lost losses" [expr {[dict get $published $d] == $events + $lost}]
    }
    promise "all: $sum published are $allEvents in the file and $allLost losses" [expr {$sum == $allEvents + $allLost}]
    set records [dict get [lindex [recorder.storm EXEC about] 3] records]
    promise "sorma-record says the same" [string match "$records records, $allLost lost, *" $said]
}
