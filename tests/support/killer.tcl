# killer.tcl NAME SCRIPT COUNT SEED -- starts a daemon again and again, and kills it at random moments with SIGKILL.
#
# The last one is left alive until standard input ends. Prints "killed N" when it has killed COUNT daemons.

lassign $argv name script count seed
expr {srand($seed)}

proc start {name script} {
    set pipe [open [list | sormad -name $name -script $script 2>@stderr] r+]
    if {![string match "ready *" [gets $pipe]]} {
        puts "the daemon did not start"
        exit 1
    }
    return $pipe
}

for {set i 0} {$i < $count} {incr i} {
    set pipe [start $name $script]
    after [expr {int(rand() * 25)}]
    exec sh -c {kill "$@"} kill -KILL [pid $pipe]
    catch {close $pipe}
}
set pipe [start $name $script]
puts "killed $i"
flush stdout
gets stdin
exec sh -c {kill "$@"} kill -TERM [pid $pipe]
catch {close $pipe}
