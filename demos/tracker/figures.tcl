# figures.tcl -- the tracker's table, each row for a minute and more; and daemons killed while the arm follows. Options as those of tracker.tcl,
# and -rows {NAME ...}: these alone. Exit code 0: each row met its target.

package require fileutil
source [file join [file dirname [file normalize [info script]]] tracker.tcl]

namespace eval tracker {
    # As tracker::count wants them. The control task's figures begin anew when its interval changes: so `quick` comes first.
    variable Rows {
        sine {lab sine 60 5}
        quick {runs quick 60 5}
        unpredicted {lab unpredicted 60 5}
        clocks {lab clocks 60 9}
        rest {lab rest 60 2}
        jumps {lab jumps 30 2}
        hidden {lab hidden 28 1}
        lost {lab lost 10 1}
        push {lab push 18 1}
        press {runs press 5 1}
        distractors {lab distractors 10000 500}
        cameras {lab cameras 30 5}
        kills {wall {kill {argus sight camera}} 200 3}
        interrupted {runs interrupted 27 2}
        calls {wall calls 10 3}
        idle {runs idle 600 5}
    }
}

# ---- the rows that are counted here alone ----

# The same, where the tool goes to the filtered position: what it was at the newest picture, at rest.
proc tracker::rows::unpredicted seconds {
    variable Usual
    set wires [circuit.tracker@robot cget -wires]
    set still $wires
    foreach i {1 4 7} sink {7 8 9} {
        set still [string map [list "track.ball.out\[$i\] -> shmem_w.target.in\[$sink\]" "0 -> shmem_w.target.in\[$sink\]"] $still]
    }
    try {
        circuit.tracker@robot CTRL -wires $still
        track.ball@robot CTRL -predict 0
        lassign [Figures [Swing $seconds]] off most lag
    } finally {
        track.ball@robot CTRL -predict 1
        circuit.tracker@robot CTRL -wires $wires
    }
    row "the same without prediction" -measured "[mm $off] mm rms, lag [ms $lag] ms: [format %.1f [expr {$off / $Usual}]] times" \
        -wanted "4 times" -target {$off >= 4 * $Usual}
}
# The camera's clock is 3 s ahead and runs 50 ppm faster; its pictures' times are turned into the robot's. Both ways in turns, with the
# same delays: what differs then is the clock.
proc tracker::rows::clocks seconds {
    set samples {same {} other {}}
    try {
        for {set k 0} {$k < 3} {incr k} {
            foreach clock {same other} {
                Clock [expr {$clock eq "other"}]
                dict lappend samples $clock {*}[Swing [expr {$seconds / 3.0}]]
            }
        }
    } finally {
        Clock 0
    }
    lassign [Figures [dict get $samples same]] usual
    lassign [Figures [dict get $samples other]] off most lag
    row "clocks 3 s and 50 ppm apart" -measured "[mm $off] mm rms, [mm $most] mm at most, lag [ms $lag] ms; same clock [mm $usual] mm" \
        -wanted "5 % above the same clock" -target {$off <= 1.05 * $usual}
}
proc tracker::rows::Clock differs {
    variable Ahead
    if {$differs} {
        clock.camera@argus CTRL -offset 3 -drift 5e-5
    }
    set Ahead [expr {$differs ? {3 5e-5} : {0 0}}]
    simlab@lab CTRL -cameraClock $Ahead
    sight.ball@sight CTRL -clock [expr {$differs ? "clock.sight" : {}}]
}
# Cameras that are slow and quick, and a quicker control task.
proc tracker::rows::cameras seconds {
    foreach rate {2 60} {
        simlab@lab CTRL -cameraRate $rate
        try {
            set samples [Swing $seconds]
        } finally {
            simlab@lab CTRL -cameraRate 14
        }
        lassign [Figures $samples] off most
        lassign [Motion $samples] speed acceleration outside
        row "sine, a camera with $rate Hz" -wanted "500 mm/s, 2 m/s2, 0" -target {$speed <= 0.51 && $acceleration <= 2.2 && $outside == 0} \
            -measured "[mm $off] mm rms, [mm $most] mm at most; [mm $speed] mm/s, [format %.2f $acceleration] m/s2, $outside outside of the guard"
    }
}
proc tracker::rows::quick seconds {
    unfollow
    try {
        pino@robot CTRL -interval 0.004
        follow
        lab sine $seconds "ticks of 4 ms"
    } finally {
        unfollow
        pino@robot CTRL -interval 0.015
        follow
    }
}
# Things that may be taken for the ball: a second one, also when the ball then goes out; half of it; something at the border;
# nothing. Counts what was told as valid and is wrong, in so many pictures.
proc tracker::rows::distractors pictures {
    variable Ball
    lassign $Ball x y z
    simlab@lab CTRL -cameraRate 60
    swings
    sample 3
    set told 0
    set valid 0
    set wrong {}
    try {
        for {set k 0} {$told < $pictures} {incr k} {
            set kind [lindex {second covered dark border replaced} [expr {$k % 5}]]
            set beside [list [expr {$x + (rand() < 0.5 ? -1 : 1) * (0.1 + 0.08 * rand())}] [expr {$y + 0.3 * (rand() - 0.5)}] [expr {$z + 0.1 * (rand() - 0.5)}]]
            shmem_r.rel exec since
            switch $kind {
                second - replaced { simlab@lab CTRL -secondBall {*}$beside }
                covered { simlab@lab CTRL -occluder {*}[lmap at [lrange [truth] 0 2] by [list [expr {0.06 * (rand() - 0.5)}] [expr {0.06 * (rand() - 0.5)}] 0.06] {expr {$at + $by}}] 0 }
                dark { simlab@lab CTRL -lamp 0 }
                border { ball still $x [expr {$y + 0.2 + 0.1 * rand()}] $z }
            }
            # The buffer holds the answers of a second.
            set samples [sample 0.4]
            set answers [News shmem_r.rel]
            if {$kind eq "replaced"} {
                simlab@lab CTRL -lamp 0
            }
            lappend samples {*}[sample 0.5]
            lappend answers {*}[News shmem_r.rel]
            simlab@lab CTRL -lamp 1
            lappend samples {*}[sample 0.05]
            simlab@lab CTRL -secondBall away -occluder away
            swings
            lappend samples {*}[sample 0.8]
            lappend answers {*}[News shmem_r.rel]
            foreach {t rx ry rz residual code} $answers {
                incr told
                if {$code == 0} {
                    incr valid
                    set off [Wrong $samples $t $rx $ry $rz]
                    if {$off > 0.006} {
                        dict incr wrong $kind
                    }
                }
            }
        }
    } finally {
        simlab@lab CTRL -cameraRate 14 -lamp 1 -secondBall away -occluder away
    }
    # A ball that lights up where the other one went out is a ball that has jumped, for whoever sees it: counted, and no fault.
    set replaced [if {[dict exists $wrong replaced]} {dict get $wrong replaced} else {string cat 0}]
    dict unset wrong replaced
    row "distractors" -wanted "0 wrong (more than 6 mm off)" -target {$wrong eq {}} \
        -measured "[tcl::mathop::+ {*}[dict values $wrong]] wrong of $told pictures, $valid valid[expr {$wrong eq {} ? {} : ": $wrong"}]; another ball instead of it: $replaced"
}
# [m] distance of a ball at r in the tool's frame from the true ball; 0 when it is unknown (before the first sample, or in a
# jump).
proc tracker::rows::Wrong {samples t rx ry rz} {
    set k [lsearch -bisect -real -index 0 $samples $t]
    if {$k < 0 || $k + 1 >= [llength $samples]} {
        return 0
    }
    set at [lindex $samples $k]
    set next [lindex $samples [expr {$k + 1}]]
    if {[rms [lmap a [lrange $at 1 3] b [lrange $next 1 3] {expr {$b - $a}}]] > 0.01} {
        return 0
    }
    set part [expr {($t - [lindex $at 0]) / ([lindex $next 0] - [lindex $at 0])}]
    lassign [lmap a $at b $next {expr {$a + $part * ($b - $a)}}] - bx by bz tx ty tz
    # The tool points down.
    return [expr {sqrt(($tx + $rx - $bx) ** 2 + ($ty - $ry - $by) ** 2 + ($tz - $rz - $bz) ** 2)}]
}
# While the ball moves, one of the named daemons is killed, and the launcher starts it again. The camera is a part of the
# laboratory: it only stops its pictures for as long. The next one is killed as soon as the arm follows again. Meanwhile all
# poses of the arm must be within its limits: what the laboratory's own arm has done, not what it was told to do.
proc tracker::rows::kill {names count} {
    swings
    sample 3
    set back {}
    set samples {}
    set late {}
    set unkilled {}
    for {set k 0} {$k < $count} {incr k} {
        lassign [truth] - - - begin
        set name [lindex $names [expr {int(rand() * [llength $names])}]]
        if {$name eq "camera"} {
            simlab@lab CTRL -cameraRate 0
            lappend samples {*}[sample [expr {0.2 + 0.6 * rand()}]]
            simlab@lab CTRL -cameraRate 14
        } else {
            set process [Kill $name]
        }
        # It was away when something went wrong, or a second has passed; it is back when all was well for 0.3 s.
        set well {}
        for {set now $begin} {$now < $begin + 20 && ($now < $begin + 1 || $well eq {} || $now < $well + 0.3)} {} {
            set news [sample 0.1]
            lappend samples {*}$news
            foreach s $news {
                set now [lindex $s 0]
                if {[off $s] > 0.015} {
                    set well {}
                } elseif {$well eq {}} {
                    set well $now
                }
            }
        }
        if {$well eq {} || $now < $well + 0.3} {
            lappend late "$name never"
        } else {
            lappend back [expr {$well - $begin}]
            if {$well - $begin > 3} {
                lappend late "$name [ms [expr {$well - $begin}]]"
            }
        }
        # It was killed when it is another process now.
        if {$name ne "camera" && ![measure renewed $name $process]} {
            lappend unkilled $name
        }
    }
    lassign [Motion $samples] speed acceleration outside
    set n [llength $back]
    set times [expr {$n ? "[ms [quantile $back 0.5]] ms, at most [ms [most $back]] ms" : "never"}]
    row "[join $names { or }] away, $count times" -wanted "each time; 500 mm/s, 2 m/s2, 0" \
        -measured "back within 15 mm in $times, $n of $count; [mm $speed] mm/s, [format %.2f $acceleration] m/s2, $outside outside of the guard[expr {
            $late eq {} ? {} : "; later than 3 s: [join $late {, }]"}][expr {$unkilled eq {} ? {} : "; still the same process: [join $unkilled {, }]"}]" \
        -target {$n == $count && $unkilled eq {} && $speed <= 0.51 && $acceleration <= 2.2 && $outside == 0}
}
# Kill a daemon: the process that it was; 0: it was away.
proc tracker::rows::Kill name {
    set process [measure process $name]
    if {$process} {
        exec kill -KILL $process
    }
    return $process
}
# The tool's largest speed [m/s] and acceleration [m/s2], over 0.06 s, and the number of poses outside of the guard.
proc tracker::rows::Motion samples {
    set fastest 0
    set hardest 0
    set outside 0
    lassign [wspc.room@robot cget -inside] x0 x1 y0 y1 z0 z1
    set last {}
    set from {}
    foreach s $samples {
        lassign $s t - - - x y z
        incr outside [expr {$x < $x0 || $x > $x1 || $y < $y0 || $y > $y1 || $z < $z0 || $z > $z1}]
        if {$from ne {} && $t - [lindex $from 0] < 0.06} {
            continue
        }
        # Where nobody has looked for long, nothing can be said.
        if {$from ne {} && $t - [lindex $from 0] < 0.12} {
            set dt [expr {$t - [lindex $from 0]}]
            set velocity [lmap a [lrange $from 4 6] b [list $x $y $z] {expr {($b - $a) / $dt}}]
            set fastest [expr {max($fastest, sqrt([::tcl::mathop::+ {*}[lmap v $velocity {expr {$v * $v}}]]))}]
            set middle [expr {$t - $dt / 2}]
            if {$last ne {}} {
                set hardest [expr {max($hardest, sqrt([::tcl::mathop::+ {*}[lmap a [lrange $last 1 3] b $velocity {expr {($b - $a) ** 2}}]]) / ($middle - [lindex $last 0]))}]
            }
            set last [list $middle {*}$velocity]
        } else {
            set last {}
        }
        set from $s
    }
    return [list $fastest $hardest $outside]
}
# The tool is led against the table: the ball is hidden, and where the tool shall be goes to 50 mm below the table, with 0.1 m/s. It gives way when it
# touches, as when somebody pushes it. The load on the table counts. Fingers and table give way by 1 mm for 8 N, and the arm
# brakes with 2 m/s2. At a touch with 0.1 m/s the table would bear 45 N even without any delay. Therefore follow.ball goes
# slowly below its -floor.
proc tracker::rows::press {count {slow 0.1}} {
    variable Ball
    lassign $Ball x y z
    set highest 0
    set rest {}
    set touched 0
    set wires [circuit.tracker@robot cget -wires]
    set low [clip.z@robot cget -low]
    set inside [wspc.room@robot cget -inside]
    set speed [follow.ball@robot cget -speed]
    try {
        wspc.room@robot CTRL -inside [lreplace $inside 4 4 -0.1]
        clip.z@robot CTRL -low -0.05
        for {set k 0} {$k < $count} {incr k} {
            ball still $x [expr {$y + 0.05}] $z
            sample 2
            simlab@lab CTRL -lamp 0
            sample 1
            ball still $x [expr {$y + 0.25}] $z
            circuit.tracker@robot CTRL -wires [Above -0.09 $wires]
            sample 2
            follow.ball@robot CTRL -speed $slow
            circuit.tracker@robot CTRL -wires [Above -0.17 $wires]
            set loads [Loads [expr {0.04 / $slow + 6}]]
            set highest [most [list $highest {*}$loads]]
            lappend rest [quantile [lrange $loads end-500 end] 0.5]
            incr touched [expr {[most $loads] > 2}]
            follow.ball@robot CTRL -speed $speed
            circuit.tracker@robot CTRL -wires $wires
            sample 2
            simlab@lab CTRL -lamp 1
        }
        rests
        sample 2
    } finally {
        simlab@lab CTRL -lamp 1
        follow.ball@robot CTRL -speed $speed
        circuit.tracker@robot CTRL -wires $wires
        clip.z@robot CTRL -low $low
        wspc.room@robot CTRL -inside $inside
    }
    row "pressed on the table, $count times" -measured "at most [format %.1f $highest] N at $slow m/s, then [format %.1f [quantile $rest 0.5]] N" \
        -wanted "30 N at 0.1 m/s or less" -target {$touched == $count && $highest <= 30}
}
# The circuit's wires, with the tool so far above the ball.
proc tracker::rows::Above {height wires} {
    return [string map [list "0 0 0.3 -> sum.goal.in2" "0 0 $height -> sum.goal.in2"] $wires]
}
# The load on the table [N], in so many seconds of lab time: all records.
proc tracker::rows::Loads seconds {
    set loads {}
    lassign [truth] - - - begin
    shmem_r.table exec since
    for {set now $begin} {$now < $begin + $seconds} {lassign [truth] - - - now} {
        sorma::await sleep 15
        foreach {t a b c d tripped} [News shmem_r.table] {
            lappend loads [expr {$a + $b + $c + $d}]
        }
    }
    return $loads
}
# Learning is given up at each of its places in turn, and during its check. Each time the tool must go back, and the previous
# map must count again. Lab time goes as fast as it can, with few pictures and quick moves.
proc tracker::rows::interrupted places {
    rests
    sample 3
    unfollow
    set usual {}
    foreach {so options} {simlab@lab {-speed 0 -cameraRate 5} sight.ball@sight {-samples 1 -rest 0} mvpos.learn@robot {-speed 0.5 -acceleration 2}} {
        dict for {option value} $options {
            lappend usual $so $option [$so cget $option]
        }
        $so CTRL {*}$options
    }
    set before [Known]
    set begin [lrange [dict get [pino@robot exec] floats] 0 2]
    set kept 0
    set unkept {}
    set whats {"check 1 of *" "check 8 of *"}
    for {set k $places} {$k > 0} {incr k -1} {
        set whats [linsert $whats 0 "node $k of *"]
    }
    try {
        foreach what $whats {
            set problem [GiveUp $what $begin]
            if {$problem eq {} && [Known] eq $before} {
                incr kept
            } else {
                lappend unkept "$what $problem"
            }
        }
    } finally {
        foreach {so option value} $usual {
            $so CTRL $option $value
        }
        follow
    }
    set count [llength $whats]
    row "learning given up, at $places places" -wanted "each time" -target {$kept == $count} \
        -measured "the map that was known counts again: $kept of $count[expr {$unkept eq {} ? {} : ", not at [join $unkept {; }]"}]"
}
# Learn until it tells that it is at a place, and give it up: what was wrong then; the tool is where it began again when it returns.
proc tracker::rows::GiveUp {what begin} {
    variable Learning
    set told [sorma::subscribe sight.ball@sight -event progress -command [list apply {{what event} {
        if {[string match $what [dict get $event text]]} {
            $::tracker::rows::Learning cancel
        }
    }} $what]]
    try {
        set Learning [sorma::async -timeout 0 sight.ball@sight EXEC learn]
        # Events come while nothing waits.
        measure until {[$Learning done]} -within 600 -every 5
        $Learning take
        return "it was learned"
    } trap {SORMA COMM CANCELLED} {} {
    } trap {SORMA SIGHT CANCELLED} {} {
    } on error text {
        return "it failed: $text"
    } finally {
        sorma::unsubscribe $told
    }
    # The daemon ends it at its next place, and goes back first.
    set back [catch {measure until {[lindex [dict get [set now [pino@robot exec]] ints] 2] == 0 && [rms [lmap a $begin b [lrange [dict get $now floats] 0 2] {
        expr {$b - $a}}]] < 0.001} -within 60 -every 50}]
    return [expr {$back ? "the tool did not go back" : {}}]
}
# The map's result for a ball that is seen so; nothing while there is no map.
proc tracker::rows::Known {} {
    return [expr {[catch {dict get [sight.ball@sight exec -floats {0 249.5 262.5 1150 19 0 0 0 0}] floats} known] ? {} : [lmap x $known {format %.6f $x}]}]
}
# The system calls of the control task's thread, as strace sees them; reading the clock is none. A bell that wakes other threads, and the sleep
# until the next tick, are futexes. That sleep waits for the laboratory's clock, a buffer. So it begins with a membarrier
# (shmem::Reader::sleep; nothing else has one). strace slows the thread down so much that ticks are skipped.
proc tracker::rows::calls seconds {
    if {[auto_execok strace] eq {}} {
        return [row "system calls in the tick" -measured "strace is not installed" -wanted "futex alone" -target 0]
    }
    swings
    sample 3
    set ticks [Ticked]
    # It ends with `timeout`, and tells its own end on stderr.
    set log [exec mktemp]
    try {
        set watch [open [list | timeout $seconds strace -qq -o $log -p [Thread robot sorma-cycle] 2>@1]]
        sample $seconds
        catch {close $watch}
        set ticks [expr {[Ticked] - $ticks}]
        set counts {}
        set else 0
        foreach line [split [fileutil::cat $log] \n] {
            if {[regexp {^(\w+)\((?:[^,]*, (FUTEX_WAIT|FUTEX_WAKE))?} $line - call kind]} {
                dict incr counts [expr {$kind eq {} ? $call : $kind}]
                incr else [expr {$call ni {futex membarrier restart_syscall}}]
            }
        }
    } finally {
        file delete $log
    }
    row "system calls in $ticks ticks" -measured "$else other ones; [join [lmap {call count} $counts {string cat "$call: $count"}] ", "]" \
        -wanted "futex; membarrier for a sleep" -target {$ticks > 0 && $counts ne {} && $else == 0}
}
proc tracker::rows::Ticked {} {
    return [lindex [cycle.pino@robot DBX -stats] end-1]
}
# The thread of that name in a daemon.
proc tracker::rows::Thread {daemon name} {
    foreach comm [glob /proc/[measure process $daemon]/task/*/comm] {
        set channel [open $comm]
        set is [gets $channel]
        close $channel
        if {$is eq $name} {
            return [file tail [file dirname $comm]]
        }
    }
    error "daemon $daemon has no thread $name"
}
# For so long nothing is done beside the control task's work; what came of it, tracker::rows::ticks says.
proc tracker::rows::idle seconds {
    swings
    sorma::await sleep [expr {1000 * $seconds}]
}

proc tracker::figures {} {
    variable Rows
    variable Options
    set wanted [dict get $Options -rows]
    foreach name $wanted {
        if {![dict exists $Rows $name]} {
            error "there is no row $name: it must be one of [join [dict keys $Rows] {, }]"
        }
    }
    count [dict filter $Rows script {name -} {expr {$wanted eq {} || $name in $wanted}}]
}

exit [tracker::run tracker::figures {-rows {any {}}}]
