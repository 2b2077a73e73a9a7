# times.tcl -- for the scripts of this folder: how long a script takes, by the clock and in processor time of this thread.

proc processor {} {
    set f [open /proc/thread-self/schedstat]
    set line [gets $f]
    close $f
    return [lindex $line 0]
}
# ms SCRIPT -- {CLOCK PROCESSOR} in ms; SCRIPT is executed at the top level.
proc ms script {
    set processor [processor]
    set before [clock microseconds]
    uplevel #0 $script
    return [list [expr {([clock microseconds] - $before) / 1000.0}] [expr {([processor] - $processor) / 1e6}]]
}
