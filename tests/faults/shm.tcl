# shm.tcl ?KILLS? ?CHANGES? ?LINES? ?SEED? -- kills, lies and silence on lines by shared memory.
#
# Callers are killed at any instant. For 100 of them a daemon is killed under its callers, too. A client changes the memory anywhere.
# Many lines say nothing. The script judges what is left: descriptors, memory, connections, names in /dev/shm.

source [file join [file dirname [file normalize [info script]]] faults.tcl]
source [file join $supportFolder smaps.tcl]

proc descriptors d { return [llength [glob -nocomplain -directory /proc/[daemon info $d pid]/fd *]] }
proc names {} { return [lsort [glob -nocomplain -directory /dev/shm *]] }
# A process that calls by memory without an end. It says ready first, and how many calls ended with an error that was none of COMM.
proc caller {where} {
    set pipe [open [list | [info nameofexecutable] << [string map [list WHERE [list $where]] {
        package require sorma
        sorma::configure -transport shm -timeout 2000
        set wrong 0
        echo@WHERE EXEC TMSG first
        puts ready
        flush stdout
        while 1 {
            if {[catch {echo@WHERE EXEC TMSG [string repeat x [expr {int(300000 * rand() ** 8)}]]} message how] && [lrange [dict get $how -errorcode] 0 1] ne {SORMA COMM}} {
                puts "wrong: $message"
                flush stdout
            }
        }
    }] 2>@stderr] r]
    gets $pipe
    return $pipe
}

attack {
    lassign [concat $argv [lrange {10000 100000000 1000 4711} [llength $argv] end]] kills changes lines seed
    expr {srand($seed)}
    set rings [file join $env(SORMA_BUILD) rings]
    set before [names]
    set d [serve {}]
    nop@$d EXEC
    exec $rings killed [daemon info $d socket] 100 $seed
    waitFor {[dict get [sorma::health $d] connections] <= 1}
    set descriptors [descriptors $d]
    set memory [memoryOf $d]

    puts [exec $rings killed [daemon info $d socket] $kills $seed]
    waitFor {[dict get [sorma::health $d] connections] <= 1}
    promise "callers that are killed leave no descriptor" [expr {[descriptors $d] <= $descriptors}]
    promise "nor memory ([expr {([memoryOf $d] - $memory) / 1024}] kB more)" [expr {[memoryOf $d] < $memory + 4 * 1024 * 1024 && [shared [daemon info $d pid]] <= 16}]

    puts [exec $rings hostile [daemon info $d socket] 1 $changes $seed]
    promise "whoever changes the memory anywhere ends its own line alone" [expr {[nop@$d EXEC] eq {RET 0}}]
    waitFor {[dict get [sorma::health $d] connections] <= 1}
    promise "and leaves no descriptor" [expr {[descriptors $d] <= $descriptors}]
    promise "nor memory ([expr {([memoryOf $d] - $memory) / 1024}] kB more)" [expr {[memoryOf $d] < $memory + 8 * 1024 * 1024}]

    # Daemons are killed and come again at the same place, while two clients call.
    set victim [daemon start]
    set socket [daemon info $victim socket]
    set callers [list [caller $socket] [caller $socket]]
    for {set n 0} {$n < $kills / 100} {incr n} {
        after [expr {int(20 * rand())}]
        daemon kill $victim
        set victim [daemon start -socket $socket]
    }
    puts "$n daemons killed"
    promise "their callers go on with the next one" [expr {[nop@$socket EXEC] eq {RET 0}}]
    waitFor {[dict get [sorma::health $socket] connections] >= 3}
    set said {}
    foreach pipe $callers {
        fconfigure $pipe -blocking 0
        append said [read $pipe]
        exec kill -KILL [pid $pipe]
        catch {close $pipe}
    }
    promise "an error says that the connection was lost, and nothing else $said" [expr {$said eq {}}]
    promise "nothing is left in /dev/shm" [expr {[names] eq $before}]

    set clients {}
    set began [memoryOf $d]
    for {set i 0} {$i < $lines} {incr i} {
        set client [interp create]
        $client eval {package require sorma; sorma::configure -transport shm}
        $client eval [list nop@$d EXEC]
        lappend clients $client
    }
    promise "$lines lines by memory" [expr {[dict get [sorma::health $d] connections] >= $lines}]
    promise "each keeps [expr {double([shared [daemon info $d pid]]) / $lines}] kB of it" [expr {[shared [daemon info $d pid]] <= 16 * $lines}]
    puts "and [expr {([memoryOf $d] - $began) / $lines}] bytes of the daemon's own"
    foreach client $clients {
        interp delete $client
    }
}
