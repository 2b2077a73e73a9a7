# record.tcl ?KILLS? ?SEED? -- a process that records its own requests, killed by SIGKILL at random instants.
#
# Each file must be read without an error up to its last records. These must be all requests from the first one on. How much is missing at
# the end is judged: at most 100 ms by its own log of the same requests.

source [file join [file dirname [file normalize [info script]]] faults.tcl]
package require sorma::service::recorder

attack {
    lassign [concat $argv [lrange {20 4711} [llength $argv] end]] kills seed
    expr {srand($seed)}
    set file [file join $env(SORMA_RUNTIME_DIR) killed.rec]
    set log [file join $env(SORMA_RUNTIME_DIR) killed.log]
    set script [file join $env(SORMA_RUNTIME_DIR) killed.tcl]
    set f [open $script w]
    puts $f "set file $file; set log $log"
    puts $f {
        package require sorma
        package require sorma::service::recorder
        sorma::create recorder.own -file $file -requests echo
        recorder.own CTRL -record
        set f [open $log w]
        fconfigure $f -buffering line
        puts begun
        flush stdout
        for {set n 1} 1 {incr n} {
            echo EXEC IMSG 1 $n
            puts $f "$n [clock microseconds]"
        }
    }
    close $f
    set worst 0
    for {set kill 1} {$kill <= $kills} {incr kill} {
        file delete $file $log
        set pipe [open [list | [info nameofexecutable] $script 2>@stderr] r]
        gets $pipe
        after [expr {int(1 + 300 * rand())}]
        exec kill -KILL [lindex [pid $pipe] 0]
        catch {close $pipe}
        set f [open $log]
        set done [lrange [split [read $f] \n] 0 end-1]
        close $f
        sorma::create recorder.killed -file $file
        set numbers {}
        set stream [sorma::stream {recorder.killed EXEC records}]
        while {[$stream next piece]} {
            foreach record [dict get $piece text] {
                if {[dict get $record kind] eq "request"} {
                    lappend numbers [lindex [dict get $record text] end]
                }
            }
        }
        $stream close
        sorma::remove recorder.killed
        set n 0
        foreach number $numbers {
            if {$number != [incr n]} {
                puts stderr "kill $kill: request $number where $n was expected"
                incr failures
                break
            }
        }
        # From the first request that is missing to the last one that was made.
        set missing [lindex $done $n]
        set lost [expr {$missing eq {} ? 0 : ([lindex $done end 1] - [lindex $missing 1]) / 1000}]
        set worst [expr {max($worst, $lost)}]
    }
    puts "kills $kills worst_lost_ms $worst"
    incr failures [expr {$worst > 100}]
}
