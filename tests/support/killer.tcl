# killer.tcl NAME SCRIPT COUNT SEED ?MOST? -- starts a daemon again and again, and kills it at random moments with SIGKILL.
#
# Each lives for up to MOST ms (25); when MOST is given, "ready MICROSECONDS" is printed for each. The last one is left alive
# until standard input ends. Prints "killed N" when it has killed COUNT daemons.

lassign $argv name script count seed most
set tells [expr {$most ne {}}]
set most [expr {$tells ? $most : 25}]
expr {srand($seed)}

proc start {name script} {
    set pipe [open [list | sormad -name $name -script $script 2>@stderr] r+]
    if {![string match "ready *" [gets $pipe]]} {
        puts "the daemon did not start"
        exit 1
    }
    if {$::tells} {
        puts "ready [clock microseconds]"
        flush stdout
    }
    return $pipe
}

for {set i 0} {$i < $count} {incr i} {
    set pipe [start $name $script]
    after [expr {int(rand() * $most)}]
    exec sh -c {kill "$@"} kill -KILL [pid $pipe]
    catch {close $pipe}
}
set pipe [start $name $script]
puts "killed $i"
flush stdout
gets stdin
exec sh -c {kill "$@"} kill -TERM [pid $pipe]
catch {close $pipe}
