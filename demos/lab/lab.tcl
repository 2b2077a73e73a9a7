# lab.tcl -- the laboratory: its daemons, the operator's panel where there is a display, a programme of motions, and ten tokens carried.
#
#     ./bootstrap run lab          the daemons end with it; exit code 0: all went as it should
#
# -speed N: of lab time, 0 is as fast as the machine can. -carries N: so many tokens. -once: it ends then, even when there is a panel.

package require sorma
package require sorma::options

namespace eval lab {
    variable Here [file dirname [file normalize [info script]]]
    variable Heard {}           ;# what has come of a program: ready, or how it ended
    variable Runs {}            ;# pipes of all that were started
}

# The daemons of a launch file. Returns when all are ready, and fails when they have ended instead. A launcher ends also when this program has
# been killed: its standard input ends then.
proc lab::launch file {
    variable Heard
    set pipe [Start {set ::lab::Heard} sorma-launch --until-eof --ready $file 2>@stderr]
    vwait ::lab::Heard
    if {$Heard ne "ready"} {
        return -code error -errorcode {LAB LAUNCH} "the daemons of [file tail $file] could not be started; what they said stands above"
    }
    return $pipe
}
# A program whose lines are shown as they come; at its end lab::Heard says how.
proc lab::start args {
    return [Start puts {*}$args 2>@1]
}
# Programs are in sessions of their own: Ctrl-C and SIGTERM are for this one, which ends them, and then itself.
proc lab::Start {lineCmd args} {
    variable Runs
    fconfigure stdout -buffering line
    catch {sorma::atSignal lab::Signalled}      ;# once a process
    set pipe [open [list | setsid {*}$args] r+]
    lappend Runs $pipe
    fconfigure $pipe -blocking 0
    fileevent $pipe readable [list lab::Read $pipe $lineCmd]
    return $pipe
}
proc lab::Read {pipe lineCmd} {
    variable Heard
    while {[gets $pipe line] >= 0} {
        {*}$lineCmd $line
    }
    if {[eof $pipe]} {
        set Heard [End $pipe]
    }
}
proc lab::End pipe {
    fconfigure $pipe -blocking 1
    return [expr {[catch {close $pipe}] ? "failed" : "ended"}]
}

# End one that runs still, and wait for that.
proc lab::finish pipe {
    if {$pipe in [chan names]} {
        exec kill -TERM {*}[pid $pipe]
        fileevent $pipe readable {}
        End $pipe
    }
}

proc lab::Signalled {} {
    variable Runs
    foreach pipe [lreverse $Runs] {
        finish $pipe
    }
    exit 1
}

proc lab::run {} {
    variable Here
    variable Heard
    set options [sorma::options::parse {-speed {any 1} -carries {any 10} -once flag} $::argv]
    set launch [launch [file join $Here lab.launch]]
    try {
        set windows [expr {[info exists ::env(DISPLAY)] && ![catch {package require Tk}]}]
        if {$windows} {
            uplevel #0 [list source [file join $Here panel.tcl]]
        } else {
            puts "no display: the operator's panel is left out"
        }
        set code 0
        foreach words [list [list programme.tcl -speed [dict get $options -speed]] \
                [list carries.tcl -speed [dict get $options -speed] -carries [dict get $options -carries] -heaps 0 -faults 0 -cancels 0]] {
            start [info nameofexecutable] [file join $Here [lindex $words 0]] {*}[lrange $words 1 end]
            vwait ::lab::Heard
            set code [expr {$code || $Heard ne "ended"}]
        }
        if {$windows && ![dict get $options -once]} {
            puts "The panel is yours; close it to end."
            tkwait window .
        }
        return $code
    } finally {
        finish $launch
    }
}

if {[file normalize $argv0] eq [file normalize [info script]]} {
    exit [lab::run]
}
