# panelFigures.tcl -- what panels cost, measured: for the notes of an issue, and not run by the tests, which judge nothing by time.
#
#     build/env tclsh tests/support/panelFigures.tcl          on $DISPLAY; best an Xvfb of its own
#
# Prints a line for each figure. A share is that of one core, of this process alone; that of the X server stands beside it when its process
# is given as env(XSERVER).

package require Tk
package require sorma
package require sorma::panel
package require sorma::chart
package require sorma::image
source [file join [file dirname [file normalize [info script]]] daemon.tcl]
source [file join [file dirname [file normalize [info script]]] wait.tcl]

set script {
    package require sorma
    oo::class create dials {
        superclass sorma::Service
        for {set i 0} {$i < 40} {incr i} {
            sorma::option -dial$i double -range {0 100} -unit mm -default 1
        }
        method exec message {
            set out {}
            for {set i 0} {$i < 40} {incr i} {
                lappend out -dial$i [expr {rand() * 100}]
            }
            [my name] CTRL {*}$out
            return {}
        }
    }
    oo::class create eye {
        superclass sorma::Service
        variable n
        method exec message {
            incr n
            return [list any "P5\n500 500\n255\n[string repeat [binary format c [expr {$n % 256}]] 250000]"]
        }
    }
}
namespace eval tcltest {proc temporaryDirectory {} {return /tmp}; namespace export *}

# pause MS -- the event loop runs meanwhile.
proc pause ms {
    after $ms {set ::over 1}
    vwait ::over
}
proc until condition {
    while {![uplevel #0 [list expr $condition]]} {
        pause 5
    }
}
# shares MS -- of this process and of the X server, in percent of a core.
proc shares ms {
    set pids [list [pid] {*}[if {[info exists ::env(XSERVER)]} {set ::env(XSERVER)}]]
    set before [lmap pid $pids {daemon processor $pid}]
    set began [clock milliseconds]
    pause $ms
    set took [expr {[clock milliseconds] - $began}]
    return [lmap pid $pids b $before {format %.1f%% [expr {([daemon processor $pid] - $b) * 100000.0 / $took}]}]
}
proc tell {what value} {
    puts [format "%-70s %s" $what $value]
    flush stdout
}

set file /tmp/panelFigures[pid].tcl
set channel [open $file w]
puts $channel $script
close $channel
set d [daemon start -script $file]
file delete $file
dials.a@$d EXEC
eye.a@$d CTRL -dump
set subject [sorma::subject of dials.a@$d]
until {[$subject table] ne {} && [dict get [$subject get -dial1] state] eq "live"}

# The machine may be busy with other things: the least of several is what it costs.
set opened {}
foreach turn {1 2 3 4 5 6} {
    destroy .p
    update
    set began [clock microseconds]
    pack [sorma::panel .p dials.a@$d -live 0] -fill both -expand 1
    update
    lappend opened [expr {([clock microseconds] - $began) / 1000}]
}
tell "40 options opened, to the last pixel: the first, the least of 5 \[ms]" "[lindex $opened 0] [tcl::mathfunc::min {*}[lrange $opened 1 end]]"

tell "at rest: share of a core (client, X server)" [shares 2000]
# They change in the daemon by a process of its own, so that the client alone is measured.
set turner [open |[list [info nameofexecutable] << [string map [list @D $d] {
    package require sorma
    proc turn {} {after 33 turn; sorma::async -command {apply {f {$f destroy}}} dials.a@@D EXEC}
    turn
    after 30000 exit
    vwait forever
}] 2> /dev/null] r]
pause 1000
tell "40 options changing at 30 Hz (client, X server)" [shares 4000]
catch {exec kill {*}[pid $turner]}
catch {close $turner}
pause 500

# A second panel in a process of its own, and scott as third; each says when it shows what scott has set.
set other [open |[list [info nameofexecutable] << [string map [list @D $d] {
    package require Tk
    package require sorma
    pack [sorma::panel .p dials.a@@D -live 0] -fill both -expand 1
    set last {}
    proc look {} {
        after 1 look
        catch {
            set shown [[.p field -dial3].entry.entry get]
            if {$shown ne $::last} {
                set ::last $shown
                puts "$shown [clock milliseconds]"
                flush stdout
            }
        }
    }
    look
    vwait forever
}] 2> /dev/null] r]
fconfigure $other -blocking 0
proc heard value {
    while {[gets $::other line] >= 0} {
        lassign $line shown at
        if {$shown eq $value} {
            set ::shownThere $at
        }
    }
    return [info exists ::shownThere]
}
pause 2000
set scott [open |scott r+]
fconfigure $scott -blocking 0 -buffering line
set worst 0
for {set i 1} {$i <= 20} {incr i} {
    unset -nocomplain shownThere
    set value $i.5
    puts $scott "dials.a@$d CTRL -dial3 $value"
    until {[gets $::scott line] >= 0}
    set answered [clock milliseconds]
    until {[[.p field -dial3].entry.entry get] eq $::value}
    set here [clock milliseconds]
    until {[heard $::value]}
    set worst [expr {max($worst, $here - $answered, $shownThere - $answered)}]
}
tell "scott sets it: both of two panels show it, the longest of 20 \[ms]" $worst
catch {exec kill {*}[pid $scott]}
catch {close $scott}
catch {exec kill {*}[pid $other]}
catch {close $other}

set daemonPid [daemon info $d pid]
exec kill -STOP $daemonPid
set began [clock milliseconds]
pause 20
set clicked [clock microseconds]
.p.head.readonly invoke
.p.head.readonly invoke
[.p field -dial3].entry.entry insert end 5
event generate .p.apply.apply <Enter>
event generate .p.apply.apply <ButtonPress-1>
event generate .p.apply.apply <ButtonRelease-1>
update
tell "daemon stopped: clicks answered in \[ms]" [expr {([clock microseconds] - $clicked) / 1000}]
until {[dict get [$subject get -dial1] state] eq "stale"}
tell "daemon stopped: fields are stale after \[ms]" [expr {[clock milliseconds] - $began}]
exec kill -CONT $daemonPid
set began [clock milliseconds]
until {[dict get [$subject get -dial1] state] eq "live"}
tell "daemon goes on: fields are live after \[ms]" [expr {[clock milliseconds] - $began}]
destroy .p

pack [sorma::image .i -name eye.a@$d -every 50 -width 500 -height 500]
until {[.i answer] eq "ok"}
tell "a picture of 500x500 at 20 Hz (client, X server)" [shares 4000]
destroy .i

pack [sorma::stripchart .c -span 60 -low -1 -high 1 -width 600]
for {set i 0} {$i < 2000} {incr i} {
    foreach trace {a b c d} {
        .c sample $trace [expr {sin($i / 50.0 + [scan $trace %c])}] [expr {-60 + $i * 0.03}]
    }
}
proc feed {} {
    foreach trace {a b c d} {
        .c sample $trace [expr {sin([clock milliseconds] / 1000.0 + [scan $trace %c])}]
    }
    set ::feeding [after 33 feed]
}
feed
pause 500
tell "a chart of 4 x 2000 points at 30 Hz (client, X server)" [shares 4000]
after cancel $feeding
destroy .c

$subject release
sorma::remove dials.a@$d
sorma::remove eye.a@$d
daemon stop $d
exit
