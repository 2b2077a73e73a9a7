# directories.tcl -- processes with a directory, which a test tells what to do: see tests/embed/directories.cpp.
#
# The constraints directories, etcd: such a process can be made, with etcd.
#
# begin                         -> a process; $::line is what the dictionary says
# ask PROCESS WORD ...          its answer
# until PROCESS PATTERN WORD ...    ask until the answer is like that
# leave PROCESS ?SIGNAL?        it ends, by a signal or in order
# signal PROCESS NAME
# leaveAll
# epoch ANSWER                  of one that says owned
# cacheFiles                    in which they keep what etcd has said

source [file join $supportFolder otherHosts.tcl]

set program [file join [expr {[info exists env(SORMA_BUILD)] ? $env(SORMA_BUILD) : {}}] directories]
testConstraint directories [file executable $program]
testConstraint etcd [expr {[testConstraint directories] && [testConstraint etcd]}]

set processes {}
set line {}
proc begin {} {
    set pipe [open [list | $::program {*}$::line 2>@stderr] r+]
    fconfigure $pipe -buffering line
    if {[gets $pipe said] < 0 || $said ne "ready"} {
        error "directories: $said"
    }
    lappend ::processes $pipe
    set ::news($pipe) {}
    return $pipe
}
proc ask {pipe args} {
    puts $pipe $args
    while {[gets $pipe said] >= 0} {
        if {[lindex [split $said] 0] ne "changed"} {
            return $said
        }
        lappend ::news($pipe) [lindex [split $said] 1]
    }
    error "the process has ended"
}
proc until {pipe pattern args} {
    waitFor {[string match $pattern [set ::said [ask $pipe {*}$args]]]}
    return $::said
}
proc leave {pipe {signal {}}} {
    set ::processes [lsearch -all -inline -not -exact $::processes $pipe]
    if {$signal ne {}} {
        exec sh -c {kill "$@"} kill -$signal [pid $pipe]
    }
    catch {close $pipe}
}
proc signal {pipe name} {
    exec sh -c {kill "$@"} kill -$name [pid $pipe]
}
proc leaveAll {} {
    foreach pipe $::processes {
        signal $pipe CONT
        leave $pipe
    }
}
proc epoch said {
    return [lindex $said 1]
}
proc cacheFiles {} {
    return [glob -nocomplain -directory $::env(SORMA_RUNTIME_DIR) directory-*.cache]
}
