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
}

# A program whose lines are shown as they come; at its end lab::Heard says how. Programs are in sessions of their own: Ctrl-C is for this
# one, which ends them. A launcher ends also when this program has been killed: its standard input ends then.
proc lab::start args {
    fconfigure stdout -buffering line
    set pipe [open [list | setsid {*}$args 2>@1] r+]
    fconfigure $pipe -blocking 0
    fileevent $pipe readable [list lab::Read $pipe]
    return $pipe
}
proc lab::Read pipe {
    variable Heard
    while {[gets $pipe line] >= 0} {
        puts $line
        if {[string match "*| ready: *" $line]} {
            set Heard ready
        }
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

# The launcher is in a session of its own, so Ctrl-C and SIGTERM do not reach it: they end it and then this program. Once a process.
proc lab::untilSignal pipe {
    sorma::atSignal [list lab::Signalled $pipe]
}
proc lab::Signalled pipe {
    finish $pipe
    exit 1
}

proc lab::run {} {
    variable Here
    variable Heard
    set options [sorma::options::parse {-speed {any 1} -carries {any 10} -once flag} $::argv]
    set launch [start sorma-launch --until-eof [file join $Here lab.launch]]
    untilSignal $launch
    try {
        vwait ::lab::Heard
        if {$Heard ne "ready"} {
            return 1
        }
        set windows [expr {[info exists ::env(DISPLAY)] && ![catch {package require Tk}]}]
        if {$windows} {
            uplevel #0 [list source [file join $Here panel.tcl]]
        } else {
            puts "no display: the operator's panel is left out"
        }
        set code 0
        foreach words [list [list programme.tcl [dict get $options -speed]] \
                [list carries.tcl -speed [dict get $options -speed] -carries [dict get $options -carries] -faults 0 -cancels 0]] {
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
