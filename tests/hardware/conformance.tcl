# conformance.tcl -- does the other side of the robot's buffers do what doc/hardware.man says?
#
#     conformance.tcl ?-prefix TEXT? ?-reset SCRIPT? ?-period SECONDS? ?-- COMMAND ...?
#
# Starts COMMAND as the other side, or talks to one that is there. The arm moves by up to 0.1 rad about its first joint: keep away.
# SCRIPT is what a person does to reset the other side after it has cut the power; to a COMMAND it is the line "reset".
# Prints a line for each thing that is right, or wrong; exits with 0 when all is right.

package require sorma
package require sorma::service::shmem

set settings [dict create -prefix {} -reset {puts $otherSide reset} -period 0.05]
while {[llength $argv] > 0} {
    set argv [lassign $argv word]
    if {$word eq "--"} break
    if {![dict exists $settings $word] || [llength $argv] == 0} {
        puts stderr "usage: conformance.tcl ?-prefix text? ?-reset script? ?-period seconds? ?-- command ...?"
        exit 2
    }
    set argv [lassign $argv value]
    dict set settings $word $value
}
set prefix [dict get $settings -prefix]
set period [dict get $settings -period]
if {[llength $argv] > 0} {
    set otherSide [open |[concat $argv 2>@stderr] r+]
    fconfigure $otherSide -buffering line
    gets $otherSide
}
sorma::create shmem_r.state -key ${prefix}arm.state
set wrong 0

# The newest record of arm.state, as a dictionary.
proc state {} {
    set f [dict get [shmem_r.state exec] floats]
    return [dict create time [lindex $f 0] q [lrange $f 1 6] qdot [lrange $f 7 12] power [lindex $f 19] cause [lindex $f 20] \
        counter [lindex $f 21] all $f]
}
proc get what { return [dict get [state] $what] }

# By the clock of the other side, which may be slower than the wall clock. When it stands still, the pause lasts ten times as long.
proc pause seconds {
    set until [expr {[get time] + $seconds}]
    set end [expr {[clock milliseconds] + 10000 * $seconds}]
    while {[get time] < $until && [clock milliseconds] < $end} {
        after 5 {set ::paused 1}
        vwait ::paused
    }
}

# A set-point that is due after one period.
proc send {q qdot mode} {
    shmem_w.set EXEC FMSG 14 [expr {[get time] + $::period}] {*}$q {*}$qdot $mode
}
proc zeros {} { return [lrepeat 6 0.0] }
proc moved {q by} { return [lreplace $q 0 0 [expr {[lindex $q 0] + $by}]] }

# Set-points that hold a posture, until a condition is true, or for at most 5 s.
proc holdUntil {q mode condition} {
    for {set n 0} {$n * $::period < 5} {incr n} {
        send $q [zeros] $mode
        pause $::period
        if {[uplevel 1 [list expr $condition]]} {
            return 1
        }
    }
    return 0
}

# Joint 1 goes on from a posture with a speed [rad/s], for a time [s]. Returns where it has been sent.
proc drive {q speed seconds} {
    for {set n 1} {$n * $::period <= $seconds} {incr n} {
        set q [moved $q [expr {$speed * $::period}]]
        send $q [lreplace [zeros] 0 0 $speed] 2
        pause $::period
    }
    return $q
}

# Wait without any set-points.
proc silentUntil condition {
    for {set n 0} {$n < 250} {incr n} {
        if {[uplevel 1 [list expr $condition]]} {
            return 1
        }
        pause 0.02
    }
    return 0
}

proc powerOn {} {
    for {set n 0} {$n < 3} {incr n} {
        send [get q] [zeros] 0
        pause $::period
    }
    set q [get q]
    return [holdUntil $q 1 {[get power] == 1}]
}
proc reset {} {
    global otherSide
    uplevel #0 [dict get $::settings -reset]
}
proc still {} { return [expr {[tcl::mathfunc::max {*}[lmap v [get qdot] {expr {abs($v)}}]] < 1e-3}] }

# check TITLE SCRIPT: the script returns whether it is so. After a failure the other checks are tried all the same.
proc check {title script} {
    if {[catch {uplevel #0 $script} result]} {
        puts "wrong: $title: $result"
        incr ::wrong
    } elseif {!$result} {
        puts "wrong: $title: [catch {state} now] $now"
        incr ::wrong
    } else {
        puts "right: $title"
    }
    flush stdout
}

check "arm.state has 22 finite floats, and comes again and again, with a time that goes on" {
    set before [get time]
    pause 0.1
    set f [get all]
    expr {[llength $f] == 22 && [get time] > $before && ![regexp -nocase {nan|inf} $f]}
}
sorma::create shmem_w.set -key ${prefix}arm.set -floats 14
set home [get q]
check "without a set-point there is no power" { expr {[get power] == 0} }
check "power comes when \"hold\" follows \"off\"" { powerOn }
check "the counter is that of the set-point in use" {
    sorma::create shmem_r.sent -key ${prefix}arm.set
    holdUntil [get q] 1 {[get counter] == [lindex [dict get [shmem_r.sent exec] ints] 0]}
}
check "set-points are followed, on the way and at its end" {
    set home [get q]
    set q [drive $home 0.1 1]
    set behind [expr {abs([lindex $q 0] - [lindex [get q] 0])}]
    expr {[holdUntil $q 1 {abs([lindex $q 0] - [lindex [get q] 0]) < 0.003}] && $behind < 0.05}
}
check "\"stop\" brings it to rest" {
    drive $q -0.1 0.3
    send [get q] [zeros] 3
    silentUntil {[still]}
}
check "\"off\" takes the power" {
    reset
    powerOn
    send [get q] [zeros] 0
    silentUntil {[get power] == 0}
}
check "when set-points stay away it comes to rest by itself, without power, and says why" {
    reset
    powerOn
    drive [get q] 0.1 0.5
    silentUntil {[still] && [get power] == 0 && [get cause] == 4}
}
check "then no set-point gives it power" {
    set there [get q]
    powerOn
    expr {[get power] == 0 && abs([lindex $there 0] - [lindex [get q] 0]) < 1e-3}
}
check "a person's reset and \"off\" before \"hold\" do" {
    reset
    powerOn
}
check "a set-point that is no number is none" {
    set there [get q]
    for {set n 0} {$n < 5} {incr n} {
        send [lrepeat 6 NaN] [zeros] 2
        pause $period
    }
    silentUntil {[still] && abs([lindex $there 0] - [lindex [get q] 0]) < 0.01}
}
check "a set-point far away from the arm is refused: it comes to rest near where it was, without power" {
    reset
    powerOn
    set there [get q]
    send [moved $there 1] [zeros] 2
    expr {[silentUntil {[still] && [get power] == 0}] && abs([lindex $there 0] - [lindex [get q] 0]) < 0.3}
}
check "another writer of arm.set is followed as the first one was" {
    sorma::remove shmem_w.set
    sorma::create shmem_w.set -key ${prefix}arm.set -floats 14
    reset
    powerOn
}
send [get q] [zeros] 0
pause $period
if {[info exists otherSide]} {
    close $otherSide
}
exit [expr {$wrong > 0}]
