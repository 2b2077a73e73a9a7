# figures.tcl ?-OPTION N ...? -- what the simulated laboratory and its robot hold: random motions, lines, descents, and faults at random
# moments, counted and measured. Prints a table; exit code 0: nothing was outside what it must hold.
#
#     -lines N -motions N -descents N -faults N    how many of each; of the motions a fifth leads through forbidden space, a tenth is
#                                                  cancelled, a tenth is stopped; of faults N of each kind
#     -kind PATTERN   of faults: only those whose name fits
#     -minutes N      at first so long in real time, with 20 pictures a second: on a machine that does nothing else. Default: 0
#     -speed N        of lab time; 0: as fast as it goes, in lockstep, so nothing is lost
#     -seed N, -short, -json FILE                  as for all that measures (demos/README.md)
#
# Daemons and buffers are its own: it may run beside another laboratory.

package require sorma
package require sorma::service::shmem
source [file join [file dirname [file normalize [info script]]] .. measure.tcl]

namespace eval lab::figures {
    variable Prefix figures[pid].
    variable Down {0 1 0 0}                         ;# the tool points at the table
    variable Room {0.25 0.85 -0.5 0.5 -0.02 0.9}    ;# where the tool may be: the guard
    variable Running {}                             ;# dict: daemon -> its pipe
    variable Stopped {}                             ;# of the last event `stopped`: how long it took [s], how far the tool came [m]
    variable Poses {}                               ;# records of tool.pose that nobody has looked at
    variable Unseen 0                               ;# records of it that were overwritten before
}

# ---- daemons ----

# launch DAEMON CLASS RECIPES -- of a class's package, under a name of its own; here it is DAEMON. It ends with this script, however that ends.
proc lab::figures::launch {daemon class recipes} {
    variable Running
    close [file tempfile dict]
    try {
        fileutil::writeFile $dict $recipes
        set pipe [open [list | sormad -name $daemon[pid] -package sorma::service::$class -dict $dict -until-eof 2>@stderr] r+]
        if {![regexp {^ready .* unix=(\S+)} [gets $pipe] -> socket]} {
            return -code error "sormad -name $daemon[pid] did not start"
        }
        sorma::so::dict CTRL -add @$daemon $socket
        dict set Running $daemon $pipe
    } finally {
        file delete $dict
    }
}
proc lab::figures::signal {daemon name} {
    variable Running
    exec kill -$name {*}[pid [dict get $Running $daemon]]
    if {$name in {KILL TERM}} {
        catch {close [dict get $Running $daemon]}
        dict unset Running $daemon
    }
}
proc lab::figures::startLab {{recipe {}}} {
    variable Prefix
    variable Settings
    if {$recipe eq {}} {
        set recipe "-lockstep arm.set -speed [dict get $Settings -speed]"
    }
    launch lab simlab "simlab -prefix $Prefix -seed [dict get $Settings -seed] $recipe"
    simlab@lab CTRL -dump
}
proc lab::figures::startRobot {} {
    variable Prefix
    variable Room
    launch robot robot [string map [list %prefix $Prefix %room $Room] {
        wspc.room -inside {%room}
        pino -prefix %prefix -labTime -guards wspc.room
        mvpos.joints -as pose -move joints -jointSpeed 0.8
        mvpos.line -as pose -move line
        push -approachSpeed 0.03 -contactForce 2
    }]
    pino@robot CTRL -start
}
proc lab::figures::powerOn {} {
    pino@robot EXEC power on
}

# ---- what is random ----

proc lab::figures::uniform {low high} {
    return [expr {$low + rand() * ($high - $low)}]
}
# A place above the table that the tool reaches, pointing down.
proc lab::figures::place {{low 0.08} {high 0.35}} {
    variable Down
    return [list [uniform 0.42 0.66] [uniform -0.22 0.22] [uniform $low $high] {*}$Down]
}
# x y beside the board, on the side without spare tokens: the table is bare there.
proc lab::figures::beside {} {
    return [list [uniform 0.40 0.66] [uniform -0.24 -0.2]]
}
# Beside the guard's room, or in the table.
proc lab::figures::forbidden {} {
    variable Down
    if {rand() < 0.5} {
        return [list [uniform 0.42 0.66] [uniform -0.22 0.22] [uniform -0.2 -0.03] {*}$Down]
    }
    return [list [uniform 0.35 0.45] [expr {(rand() < 0.5 ? -1 : 1) * [uniform 0.52 0.57]}] [uniform 0.1 0.3] {*}$Down]
}

# ---- what is measured ----

# Where the tool has been since the last call: time, x y z, quaternion, 6 joint angles of each tick.
proc lab::figures::poses {} {
    variable Poses
    collect
    set all $Poses
    set Poses {}
    return $all
}
proc lab::figures::collect {} {
    variable Poses
    variable Unseen
    if {![catch {shmem_r.pose exec since} reply] && [dict exists $reply floats]} {
        lappend Poses {*}[dict get $reply floats]
        incr Unseen [lindex [dict get $reply ints] 0]
    }
    return 1
}
# How far [m] a place is outside the room; 0: inside.
proc lab::figures::outside {x y z} {
    variable Room
    lassign $Room x1 x2 y1 y2 z1 z2
    return [expr {max(0, $x1 - $x, $x - $x2, $y1 - $y, $y - $y2, $z1 - $z, $z - $z2)}]
}
proc lab::figures::distance {a b} {
    return [expr {sqrt([tcl::mathop::+ {*}[lmap x [lrange $a 0 2] y [lrange $b 0 2] {expr {($x - $y) ** 2}}]])}]
}
# The distance of a point from the line between two.
proc lab::figures::fromLine {p a b} {
    set along 0
    set square 0
    foreach x [lrange $p 0 2] u [lrange $a 0 2] v [lrange $b 0 2] {
        set along [expr {$along + ($x - $u) * ($v - $u)}]
        set square [expr {$square + ($v - $u) ** 2}]
    }
    set part [expr {min(1, max(0, $along / $square))}]
    return [distance $p [lmap u [lrange $a 0 2] v [lrange $b 0 2] {expr {$u + $part * ($v - $u)}}]]
}
proc lab::figures::tool {} {
    # While the robot hears nothing of its hardware it does not know.
    waitUntil {[dict exists [set reply [pino@robot exec]] floats]}
    return [lrange [dict get $reply floats] 0 6]
}
proc lab::figures::waitUntil condition {
    uplevel 1 [list measure until "\[lab::figures::collect\] && ($condition)" -every 2]
}
# A motion that must succeed.
proc lab::figures::go {mover args} {
    set future [sorma::async $mover EXEC {*}[if {[llength $args] > 0} {list FMSG [llength $args]}] {*}$args]
    waitUntil {[$future done]}
    return [$future take]
}
# Wait for a request; returns the symbol of its error, or "done".
proc lab::figures::outcome future {
    try {
        waitUntil {[$future done]}
        $future take
        return done
    } on error {- options} {
        return [lindex [dict get $options -errorcode] 2]
    }
}
proc lab::figures::millimetres metres { return [format %.2f [expr {1e3 * $metres}]] }

# ---- the sections of the table ----

proc lab::figures::lines n {
    set worst [set sum [set samples 0]]
    go mvpos.line@robot {*}[place]
    for {set i 0} {$i < $n} {incr i} {
        set from [tool]
        poses
        set to [place]
        mvpos.line@robot CTRL -speed [uniform 0.05 0.5]
        go mvpos.line@robot {*}$to
        foreach {t x y z - - - - - - - - - -} [poses] {
            set off [fromLine [list $x $y $z] $from $to]
            set worst [expr {max($worst, $off)}]
            set sum [expr {$sum + $off}]
            incr samples
        }
    }
    mvpos.line@robot CTRL -speed 0.2
    measure row "$n Cartesian lines, 0.05 to 0.5 m/s" -wanted "off the line <= 0.5 mm" -target {$worst <= 0.5e-3} \
        -measured "at most [millimetres $worst] mm, mean [millimetres [expr {$sum / max(1, $samples)}]] mm of $samples places"
}

proc lab::figures::motions n {
    set worst 0
    set outcomes {}
    set wrong 0
    go mvpos.line@robot {*}[place]
    poses
    for {set i 0} {$i < $n} {incr i} {
        # Ten motions: two through forbidden space, one cancelled, one stopped.
        set kind [lindex {forbidden forbidden cancelled stopped plain plain plain plain plain plain} [expr {$i % 10}]]
        set mover mvpos.[expr {rand() < 0.5 ? "line" : "joints"}]@robot
        set to [expr {$kind eq "forbidden" ? [forbidden] : [place]}]
        set from [tool]
        set future [sorma::async $mover EXEC FMSG 7 {*}$to]
        if {$kind in {cancelled stopped}} {
            set part [uniform 0.05 0.9]
            set way [distance $from $to]
            waitUntil {[distance [tool] $from] > $part * $way || [$future done]}
        }
        switch -- $kind {
            cancelled { $future cancel; $future destroy; set came cancelled }
            stopped { $mover CTRL -stop; set came [outcome $future] }
            default { set came [outcome $future] }
        }
        if {$kind eq "cancelled"} {
            waitUntil {[lindex [dict get [pino@robot exec] ints] 2] == 0}
        }
        dict incr outcomes "$kind: $came"
        # A motion may be over before it is stopped. Forbidden ones are refused with their reason, and nothing moves.
        if {![string match [dict get {forbidden GUARD plain done cancelled cancelled stopped {[Sd]*}} $kind] $came]} {
            incr wrong
            puts "motion [expr {$i + 1}], $kind, to [lrange $to 0 2]: $came"
        }
        if {$kind eq "forbidden" && [distance $from [tool]] > 1e-3} {
            incr wrong
            puts "motion [expr {$i + 1}] was refused, and moved"
        }
        foreach {t x y z - - - - - - - - - -} [poses] {
            set worst [expr {max($worst, [outside $x $y $z])}]
        }
    }
    measure row "$n random motions with guards" -wanted "none outside, refusals named" -target {$worst < 1e-3 && $wrong == 0} \
        -measured "outside by [millimetres $worst] mm; [join [lmap {k v} [lsort -stride 2 $outcomes] {set - "$v $k"}] {, }]"
}

proc lab::figures::descents n {
    variable Down
    set heights {}
    set peak 0
    # The hand is weighed where there is room for its turns.
    go mvpos.line@robot 0.55 0 0.3 {*}$Down
    go calibrate@robot
    for {set i 0} {$i < $n} {incr i} {
        lassign [beside] x y
        go mvpos.line@robot $x $y 0.03 {*}$Down
        set floats [lrange [go push@robot $x $y 0.0155 $x $y 0.0035] end-4 end]
        lappend heights [lindex $floats 2]
        set peak [expr {max($peak, [lindex $floats 4])}]
    }
    set sorted [lsort -real $heights]
    set off [tcl::mathfunc::max {*}[lmap z $heights {expr {abs($z - 0.005)}}]]
    measure row "$n guarded descents at 0.03 m/s" -wanted "within 0.5 mm, peak <= 15 N" -target {$off <= 0.5e-3 && $peak <= 15} \
        -measured "contact at [millimetres [lindex $sorted 0]] to [millimetres [lindex $sorted end]] mm (true 5.00), peak [format %.1f $peak] N"
}

# ---- real time: nothing waits for the arm ----

proc lab::figures::minutes n {
    variable Prefix
    startLab {-speed 1 -cameraRate 20}
    startRobot
    powerOn
    set before [skipped]
    cycle.pino@robot CTRL -reset
    set end [expr {[clock seconds] + 60 * $n}]
    while {[clock seconds] < $end} {
        go mvpos.joints@robot {*}[place]
    }
    set told [cycle.pino@robot DBX -stats]
    lassign [lrange $told end-1 end] ticks skipped
    set late "[format %.2g [expr {1e3 * [lindex $told 8]}]] ms at most"
    set lost [expr {[skipped] - $before}]
    measure row "$n min in real time, 20 pictures/s" -wanted "0 skipped ticks" -target {$skipped == 0} \
        -measured "$skipped of $ticks ticks, [format %.3f $lost] s of lab time; [dict get [simlab@lab exec time] ints] pictures; ticks late by $late"
    # How fast it can go, alone: the robot has no power.
    pino@robot EXEC power off
    foreach {what rate} {"with 20 pictures/s" 20 "without pictures" 0} {
        simlab@lab CTRL -speed 0 -cameraRate $rate
        set microseconds [lindex [time {simlab@lab EXEC FMSG 1 5}] 0]
        measure row "as fast as it goes, $what" -wanted factor -target 1 -measured [format %.1f [expr {5e6 / $microseconds}]]
    }
    foreach daemon [list robot lab] {
        signal $daemon TERM
    }
}
# [s] of lab time.
proc lab::figures::skipped {} {
    return [lindex [dict get [simlab@lab exec time] floats] 1]
}

# ---- faults: in a random motion, at a random moment, the arm must come to rest by itself, and not move again before a person's reset ----

proc lab::figures::Heard event {
    variable Stopped
    # Also told: that the subscription has found the laboratory again.
    if {[dict get $event floats] ne {}} {
        set Stopped [dict get $event floats]
    }
}
proc lab::figures::waitStopped {} {
    variable Stopped
    waitUntil {$Stopped ne {}}
}

# Power is refused until the hardware has been reset.
proc lab::figures::resetFirst {} {
    waitStopped
    set before [tool]
    if {![catch {powerOn} message options]} {
        return -code error "power came without a reset"
    }
    if {[lindex [dict get $options -errorcode] 2] ne "POWER"} {
        return -code error "without a reset: $message"
    }
    if {[distance [tool] $before] > 1e-3} {
        return -code error "the arm moved by [millimetres [distance [tool] $before]] mm without a reset"
    }
    simlab@lab CTRL -reset
    pino@robot EXEC reset
    powerOn
}

# Each has a name, the result that it must have, the way the caller hears of it, a script that makes it, and one for afterwards.
proc lab::figures::kinds {} {
    return {
        "-stop" {stops; the arm holds} STOPPED {$Mover CTRL -stop} {}
        "emergency stop" {category 0, measured} POWER {simlab@lab CTRL -emergencyStop} {resetFirst}
        "set-points lost" {category 1, <= 0.25 s} POWER {
            signal robot STOP
            waitStopped
            signal robot CONT
        } {resetFirst}
        "robot daemon killed" {category 1, <= 0.25 s} LOST {signal robot KILL; waitStopped} {startRobot; resetFirst}
        "simlab killed" {brakes; silent is said} SILENT {signal lab KILL} {
            startLab
            if {![catch {go mvpos.line@robot {*}[place]}]} {
                return -code error "the arm moved before it was given power"
            }
            powerOn
        }
        "table force" {category 0, measured} {[PO][OV][WE]*} {} {
            resetFirst
            go mvpos.line@robot {*}[lreplace [tool] 2 2 0.1]
        }
    }
}

proc lab::figures::faults n {
    variable Down
    variable Stopped
    variable Settings
    foreach {what target expected make recover} [kinds] {
        if {![string match [dict get $Settings -kind] $what]} continue
        set ways [set times {}]
        set wrong 0
        for {set i 1} {$i <= $n} {incr i} {
            try {
                go mvpos.line@robot {*}[place 0.15]
                set Stopped {}
                set from [tool]
                if {$what eq "table force"} {
                    go mvpos.line@robot {*}[beside] 0.05 {*}$Down
                    set Mover mvpos.line@robot
                    set to [lreplace [tool] 2 2 -0.015]
                    mvpos.line@robot CTRL -speed [uniform 0.05 0.3]
                } else {
                    set Mover mvpos.joints@robot
                    set to [place 0.15]
                }
                set future [sorma::async $Mover EXEC FMSG 7 {*}$to]
                if {$make ne {}} {
                    set part [uniform 0.05 0.8]
                    set way [distance $from $to]
                    waitUntil {[distance [tool] $from] > $part * $way || [$future done]}
                    if {[$future done]} {       # a short way: another one
                        outcome $future
                        incr i -1
                        continue
                    }
                    eval $make
                }
                set came [outcome $future]
                eval $recover
                mvpos.line@robot CTRL -speed 0.2
                if {$make ne {} && $came eq "done" && [distance [tool] $to] < 1e-3} {       # before anything happened: another one
                    incr i -1
                    continue
                }
                if {![string match $expected $came]} {
                    incr wrong
                    puts "$what $i: the caller heard $came instead of $expected"
                }
                if {$Stopped ne {}} {
                    lappend times [lindex $Stopped 0]
                    lappend ways [lindex $Stopped 1]
                }
            } on error message {
                incr wrong
                puts "$what $i: $message"
                break
            }
        }
        set measured "$wrong wrong"
        if {[llength $ways] > 0} {
            set longest [tcl::mathfunc::max {*}$times]
            append measured "; the tool came at most [millimetres [tcl::mathfunc::max {*}$ways]] mm, in at most [format %.2f $longest] s"
            incr wrong [expr {[string match "category 1*" $target] && $longest > 0.25}]
        }
        measure row "$n x $what" -wanted $target -target {$wrong == 0} -measured $measured
        if {$wrong > 0 && $i <= $n} return
    }
}

proc lab::figures::run settings {
    variable Settings $settings
    variable Prefix
    variable Unseen
    variable Running
    sorma::create shmem_r.pose -key ${Prefix}tool.pose
    try {
        if {[dict get $Settings -minutes] > 0} {
            minutes [dict get $Settings -minutes]
        }
        startLab
        startRobot
        sorma::subscribe simlab@lab -event stopped -command lab::figures::Heard
        powerOn
        foreach section {lines motions descents faults} {
            set n [dict get $Settings -$section]
            if {$n > 0} {
                $section $n
            }
        }
    } finally {
        foreach daemon [dict keys $Running] {
            catch {signal $daemon TERM}
        }
    }
    if {$Unseen > 0} {
        puts "$Unseen places of the tool were not looked at: the machine is busy"
    }
}

exit [measure run {-lines {any 100} -motions {any 1000} -descents {any 100} -faults {any 50} -kind {any *} -minutes {any 0} -speed {any 0}} \
    {-lines 3 -motions 10 -descents 2 -faults 1} $argv lab::figures::run]
