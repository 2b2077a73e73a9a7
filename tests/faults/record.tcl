# record.tcl ?KILLS? ?SEED? -- recorders killed by SIGKILL at random instants while requests and events pass.
#
# By turns it kills a process that records itself, sorma-record, and the daemon that sorma-record records beside an idle one. Each file must be read without a
# damage before its end. It must have all requests and events from the first one on, and when a daemon was killed, that it was. A
# journal of the same requests, which another process writes, says how much is missing at the end: at most 100 ms.

source [file join [file dirname [file normalize [info script]]] faults.tcl]
package require sorma::service::recorder

# The object that is asked publishes an event each time.
set bell {
    package require sorma
    oo::class create bell {
        superclass sorma::Service
        method exec message {
            my publish rung -ints [dict get $message ints]
            return {}
        }
    }
}
# Bursts of requests, and a journal: number, and the us when it was answered.
set asks {
    set n 0
    set journal [open $log w]
    fconfigure $journal -buffering line
    proc burst {} {
        for {set i 0} {$i < 20} {incr i} {
            # When the daemon is killed, that was all.
            if {[catch {$::bell EXEC IMSG 1 [incr ::n]}]} return
            puts $::journal "$::n [clock microseconds]"
        }
        after 5 burst
    }
    burst
}

proc start command {
    set pipe [open [list | {*}$command 2>@stderr] r]
    gets $pipe
    return $pipe
}
proc tcl {name args} {
    set file [file join $::env(SORMA_RUNTIME_DIR) $name]
    set f [open $file w]
    puts $f [join $args \n]
    close $f
    return $file
}
# The shell sends the signal without a new process. The us at which all descriptors of the process are closed.
proc killed {pipe pid} {
    puts $::shell "kill -KILL $pid"
    flush $::shell
    read $pipe
    set now [clock microseconds]
    catch {close $pipe}
    return $now
}

# The records of a file: a dict of numbers, by kind.
proc recorded file {
    set found [dict create request {} event {} loss {} note {}]
    sorma::create recorder.killed -file $file
    set stream [sorma::stream {recorder.killed EXEC records}]
    try {
        while {[$stream next piece]} {
            foreach record [dict get $piece text] {
                set kind [dict get $record kind]
                if {$kind eq "note"} {
                    dict lappend found note [dict get $record word]
                } elseif {$kind eq "loss"} {
                    dict lappend found loss "[dict get $record number] [dict get $record word]"
                } elseif {$kind in {request event} && [regexp {IMSG 1 (\d+)$} [dict get $record text] -> n]} {
                    dict lappend found $kind $n
                }
            }
        }
        set damages [dict get [lindex [recorder.killed EXEC about] 3] damages]
    } finally {
        $stream close
        sorma::remove recorder.killed
    }
    if {[llength [dict get $found loss]] > 0} {
        complain "$file has losses: [dict get $found loss]"
    }
    # Where the process was in the middle of a write, the end is cut.
    foreach damage $damages {
        if {![regexp {byte (\d+)} $damage -> at] || $at < [file size $file] - 1000000} {
            complain "$file: $damage"
        }
        incr ::cut
    }
    return $found
}
proc complain what {
    puts stderr "kill $::kill: $what"
    incr ::failures
}

# How many us before `dead` did the first one happen that is not in the file?
proc lost {numbers log dead} {
    set n 0
    foreach number $numbers {
        if {$number != [incr n]} {
            complain "number $number where $n was expected"
            break
        }
    }
    set f [open $log]
    set lines [lrange [split [read $f] \n] 0 end-1]
    close $f
    set missing [lindex $lines $n]      ;# they begin with 1
    return [expr {$missing eq {} ? 0 : max(0, $dead - [lindex $missing 1])}]
}

attack {
    lassign [concat $argv [lrange {21 4711} [llength $argv] end]] kills seed
    expr {srand($seed)}
    set folder $env(SORMA_RUNTIME_DIR)
    set file [file join $folder killed.rec]
    set log [file join $folder killed.log]
    set record [file join $env(SORMA_BUILD) sorma-record]
    set tclsh [info nameofexecutable]
    set shell [open "| sh" w]
    set idle [serve $bell]
    set own [tcl own.tcl "set file $file; set log $log; set bell bell.a" $bell {
        package require sorma::service::recorder
        sorma::create recorder.own -file $file -requests bell.* -events bell.*
        recorder.own CTRL -record
        puts begun
        flush stdout
    } $asks {vwait forever}]
    set cut 0
    foreach how {own program daemon} {
        set worst($how) 0
        set all($how) {}
    }
    for {set kill 0} {$kill < $kills} {incr kill} {
        set how [lindex {own program daemon} [expr {$kill % 3}]]
        set instant [expr {int(1 + 900 * rand())}]
        file delete $file $log
        if {$how eq "own"} {
            set pipe [start [list $tclsh $own]]
            after $instant
            set dead [killed $pipe [pid $pipe]]
        } else {
            set d [serve $bell]
            bell.a@$d EXEC
            set recorder [start [list $record -o $file -daemon $d $idle -requests bell.* -events bell.*]]
            set client [tcl client.tcl "set log $log; set bell bell.a@$d" {package require sorma; puts begun; flush stdout} $asks {vwait forever}]
            set client [start [list $tclsh $client]]
            after $instant
            if {$how eq "program"} {
                set dead [killed $recorder [pid $recorder]]
            } else {
                set dead [clock microseconds]
                puts $shell "kill -KILL [daemon info $d pid]"
                flush $shell
                # It is written that the daemon was lost.
                waitFor {[catch {exec grep -c lost $file} n] == 0}
                puts $shell "kill -INT [pid $recorder]"
                flush $shell
                read $recorder
                close $recorder
            }
            catch {exec kill -KILL [pid $client]}
            catch {close $client}
            catch {daemon stop $d}
        }
        set found [recorded $file]
        # A client may be answered a little after the signal.
        if {$how eq "daemon"} {
            set dead [::tcl::mathfunc::max $dead {*}[lindex [exec tail -n 1 $log] 1]]
        }
        foreach kind {request event} {
            set us [lost [dict get $found $kind] $log $dead]
            lappend all($how) $us
            set worst($how) [expr {max($worst($how), $us)}]
        }
        if {$how eq "daemon" && "lost" ni [dict get $found note]} {
            complain "it does not say that the daemon was lost"
        }
    }
    close $shell
    daemon stop $idle
    foreach how {own program daemon} {
        if {$all($how) eq {}} continue
        puts "$how kills [expr {[llength $all($how)] / 2}] median_lost_ms [format %.1f [expr {[quantile $all($how) 0.5] / 1000.0}]] worst_lost_ms [format %.1f [expr {$worst($how) / 1000.0}]]"
        incr failures [expr {$worst($how) > 100000}]
    }
    puts "kills $kills cut_ends $cut failures $failures"
}
