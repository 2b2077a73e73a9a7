# rows.tcl -- the rows of the tracker's table: each makes the ball do something while the arm follows, and measures how well that went.
#
# The daemons of tracker.launch must run. What counts is the laboratory's truth: where the ball is, and where the arm is.

package require sorma

namespace eval rows {
    variable Lab simlab@lab
    variable Follow follow.ball@robot
    variable Ball {0.56 0 0.12}         ;# where it rests
    variable Above 0.3                  ;# [m] the tool above the ball
    variable Down {0 1 0 0}             ;# the tool points at the table
    variable Sine 0.4                   ;# [Hz]
    variable Task {}                    ;# the request that follows
    variable Table {}                   ;# what, measured, target, whether it is met
    variable Usual inf                  ;# [m] rms on the sine, with all as it should be
    variable Records {}                 ;# all samples: t, ball 3, tool 3
}
foreach {name key} {pose tool.pose rel target.rel} {
    sorma::so::dict CTRL -add shmem_r.$name [list -key tracker.$key]
}

# ---- the laboratory ----

proc rows::prepare speed {
    variable Lab
    variable Ball
    variable Above
    variable Down
    $Lab CTRL -speed $speed
    ball still {*}$Ball
    pino@robot EXEC power on
    lassign $Ball x y z
    mvpos.learn@robot EXEC FMSG 7 $x $y [expr {$z + $Above}] {*}$Down
}
proc rows::ball args {
    variable Lab
    $Lab CTRL -ball {*}$args
}
# Learn the map, or take it as it was learned before.
proc rows::learn again {
    if {!$again && ![catch {sight.ball@sight EXEC FMSG 9 0 249.5 262.5 1150 19 0 0 0 0}]} {
        puts "the map has been learned before"
        return
    }
    puts "the arm shows itself where a ball is: 27 places, then 8 between them"
    set told [sorma::subscribe sight.ball@sight -event progress -command {apply {event {puts "  [dict get $event text]"}}}]
    try {
        set task [sorma::async -timeout 0 sight.ball@sight EXEC learn]
        while {![$task done]} {
            nap 100
        }
        wait $task
    } finally {
        sorma::unsubscribe $told
    }
}
proc rows::wait future {
    try {
        return [$future wait]
    } finally {
        $future destroy
    }
}
proc rows::follow {} {
    variable Task
    variable Follow
    set Task [sorma::async -timeout 0 $Follow EXEC]
}
# Fails with what has ended it, if something has.
proc rows::unfollow {} {
    variable Task
    variable Follow
    if {$Task eq {}} {
        return
    }
    $Follow CTRL -stop
    set task $Task
    set Task {}
    try {
        wait $task
    } trap {SORMA ROBOT STOPPED} {} {}
}
proc rows::nap ms {
    after $ms {set ::rows::Napped 1}
    vwait ::rows::Napped
}

# ---- samples ----

# Where the ball is, and when: x y z t.
proc rows::truth {} {
    variable Lab
    set reply [$Lab DBX -ball]
    return [list {*}[lindex $reply 3] [lindex $reply end]]
}

# Sample for so many seconds of lab time; the script is run before each sample and may read its time, now. Returns lists
# t ball(3) tool(3).
proc rows::sample {seconds {script {}}} {
    variable Task
    variable Records
    shmem_r.pose exec since
    set poses {}
    set balls {}
    lassign [truth] - - - begin
    for {set now $begin} {$now < $begin + $seconds} {} {
        eval $script
        lassign [truth] x y z now
        lappend balls [list $now $x $y $z]
        set news [shmem_r.pose exec since]
        if {[dict exists $news floats]} {
            lappend poses {*}[dict get $news floats]
        }
        if {[$Task done]} {
            wait [set task $Task][set Task {}]
        }
        nap 15
    }
    set samples [Meet $poses $balls]
    lappend Records {*}$samples
    return $samples
}
# The tool's place at the times of the ball's.
proc rows::Meet {poses balls} {
    set samples {}
    set last {}
    set queue $balls
    foreach {t x y z - - - - - - - - - -} $poses {
        while {[llength $queue] > 0 && $last ne {} && [lindex $queue 0 0] <= $t} {
            set queue [lassign $queue ball]
            lassign $last t0 x0 y0 z0
            set part [expr {$t > $t0 ? ([lindex $ball 0] - $t0) / ($t - $t0) : 1}]
            if {$part >= 0} {
                lappend samples [list {*}$ball [expr {$x0 + $part * ($x - $x0)}] [expr {$y0 + $part * ($y - $y0)}] [expr {$z0 + $part * ($z - $z0)}]]
            }
        }
        set last [list $t $x $y $z]
    }
    return $samples
}

# ---- what is made of them ----

# [m] How far the tool is from where it should be.
proc rows::off sample {
    variable Above
    lassign $sample - bx by bz x y z
    return [expr {sqrt(($x - $bx) ** 2 + ($y - $by) ** 2 + ($z - $bz - $Above) ** 2)}]
}
proc rows::rms numbers {
    set sum 0.0
    foreach x $numbers {
        set sum [expr {$sum + $x * $x}]
    }
    return [expr {sqrt($sum / max(1, [llength $numbers]))}]
}
proc rows::most numbers { return [::tcl::mathfunc::max {*}$numbers] }
proc rows::quantile {numbers q} { return [lindex [lsort -real $numbers] [expr {int($q * ([llength $numbers] - 1) + 0.5)}]] }
# The tool's, between samples that are at least 40 ms apart: when [s], in the middle between them, and how fast [m/s].
proc rows::speeds samples {
    set speeds {}
    set from [lindex $samples 0]
    foreach to $samples {
        set dt [expr {[lindex $to 0] - [lindex $from 0]}]
        if {$dt >= 0.04} {
            lappend speeds [list [expr {[lindex $to 0] - $dt / 2}] [expr {sqrt([::tcl::mathop::+ {*}[lmap a [lrange $from 4 6] b [lrange $to 4 6] {expr {($b - $a) ** 2}}]]) / $dt}]]
            set from $to
        }
    }
    return $speeds
}
# [s] How far the tool's motion along y is behind the ball's, by the phase of the sine.
proc rows::lag {samples frequency} {
    set w [expr {8 * atan(1) * $frequency}]
    foreach sums {a b c d} {
        set $sums 0.0
    }
    foreach sample $samples {
        lassign $sample t - by - - y
        set a [expr {$a + $by * cos($w * $t)}]
        set b [expr {$b + $by * sin($w * $t)}]
        set c [expr {$c + $y * cos($w * $t)}]
        set d [expr {$d + $y * sin($w * $t)}]
    }
    return [expr {atan2($a * $d - $b * $c, $a * $c + $b * $d) / $w}]
}
# When the tool was near and slow first, and remained so for 0.2 s: [s] after `begin`; none: never.
proc rows::locked {samples begin {near 0.003} {slow 0.010}} {
    set moments [lmap s $samples {list [lindex $s 0] [expr {[off $s] < $near}]}]
    foreach speed [speeds $samples] {
        lappend moments [list [lindex $speed 0] [expr {[lindex $speed 1] < $slow}]]
    }
    set since {}
    foreach moment [lsort -real -index 0 $moments] {
        lassign $moment time good
        if {!$good || $time < $begin} {
            set since {}
        } elseif {$since eq {}} {
            set since $time
        } elseif {$time >= $since + 0.2} {
            return [expr {$since - $begin}]
        }
    }
    return {}
}

# ---- the table ----

proc rows::row {what measured target met} {
    variable Table
    lappend Table [list $what $measured $target $met]
    puts [format {%-34s %-44s %-36s %s} $what $measured $target [expr {$met ? "yes" : "NO"}]]
}
proc rows::mm x { return [format %.2f [expr {1e3 * $x}]] }
proc rows::ms x { return [expr {$x eq {} ? "never" : [format %.0f [expr {1e3 * $x}]]}] }

proc rows::rest seconds {
    variable Ball
    ball still {*}$Ball
    sample 2
    set samples [sample $seconds]
    set off [rms [lmap s $samples {off $s}]]
    set speed [rms [lmap s [speeds $samples] {lindex $s 1}]]
    row "ball at rest" "[mm $off] mm rms, [mm $speed] mm/s rms" "0.5 mm, 3 mm/s" [expr {$off <= 0.0005 && $speed <= 0.003}]
}
# The camera's delay varies from 40 to 110 ms.
proc rows::Delay {} {
    variable Lab
    $Lab CTRL -cameraLatency [expr {0.04 + 0.07 * rand()}]
}
# Follow the sine for so long: rms and largest error [m], lag [s].
proc rows::Swing seconds {
    variable Ball
    variable Sine
    variable Lab
    ball sine {*}$Ball 0 0.1 0 $Sine
    sample 4
    set samples [sample $seconds rows::Delay]
    $Lab CTRL -cameraLatency 0.05
    set errors [lmap s $samples {off $s}]
    return [list [rms $errors] [most $errors] [lag $samples $Sine]]
}
proc rows::sine {seconds {name "varying delay"}} {
    variable Sine
    variable Usual
    lassign [Swing $seconds] off most lag
    set Usual $off
    row "sine 0.1 m, $Sine Hz, $name" "[mm $off] mm rms, [mm $most] mm at most, lag [ms $lag] ms" "6.5 mm, 12 mm, -30 .. 30 ms" \
        [expr {$off <= 0.0065 && $most <= 0.012 && abs($lag) <= 0.03}]
}
# The same, where the tool goes to the filtered position: what it was at the newest picture, at rest.
proc rows::unpredicted seconds {
    variable Usual
    set wires [circuit.tracker@robot cget -wires]
    set still $wires
    foreach i {1 4 7} sink {7 8 9} {
        set still [string map [list "track.ball.out\[$i\] -> shmem_w.target.in\[$sink\]" "0 -> shmem_w.target.in\[$sink\]"] $still]
    }
    try {
        circuit.tracker@robot CTRL -wires $still
        track.ball@robot CTRL -predict 0
        lassign [Swing $seconds] off most lag
    } finally {
        track.ball@robot CTRL -predict 1
        circuit.tracker@robot CTRL -wires $wires
    }
    row "the same without prediction" "[mm $off] mm rms, lag [ms $lag] ms: [format %.1f [expr {$off / $Usual}]] times" "4 times" [expr {$off >= 4 * $Usual}]
}
# The camera's clock is 3 s ahead and runs 50 ppm faster; its pictures' times are turned into the robot's.
proc rows::clocks seconds {
    variable Lab
    variable Usual
    try {
        clock.camera@argus CTRL -offset 3 -drift 5e-5
        $Lab CTRL -cameraClock {3 5e-5}
        sight.ball@sight CTRL -clock clock.sight
        lassign [Swing $seconds] off most lag
    } finally {
        sight.ball@sight CTRL -clock {}
        $Lab CTRL -cameraClock {0 0}
    }
    row "clocks 3 s and 50 ppm apart" "[mm $off] mm rms, [mm $most] mm at most, lag [ms $lag] ms" "5 % above the same clock" [expr {$off <= 1.05 * $Usual}]
}
# Cameras that are slow and quick, and a quicker control task.
proc rows::cameras seconds {
    variable Lab
    foreach rate {2 60} {
        $Lab CTRL -cameraRate $rate
        try {
            lassign [Swing $seconds] off most lag
        } finally {
            $Lab CTRL -cameraRate 14
        }
        row "sine, a camera with $rate Hz" "[mm $off] mm rms, [mm $most] mm at most" "goes on, within its limits" 1
    }
}
proc rows::quick seconds {
    unfollow
    try {
        pino@robot CTRL -interval 0.004
        follow
        sine $seconds "ticks of 4 ms"
    } finally {
        unfollow
        pino@robot CTRL -interval 0.015
        follow
    }
}
proc rows::jumps count {
    variable Ball
    lassign $Ball x y z
    set times {}
    set over 0
    ball still $x [expr {$y - 0.05}] $z
    sample 3
    set side 1
    for {set k 0} {$k < $count} {incr k} {
        lassign [truth] - - - begin
        set goal [expr {$y + $side * 0.05}]
        ball still $x $goal $z
        set samples [sample 2]
        lappend times [locked $samples $begin]
        set over [most [list $over {*}[lmap s $samples {expr {$side * ([lindex $s 5] - $goal)}}]]]
        set side [expr {-$side}]
    }
    set reached [lsearch -all -inline -not -exact $times {}]
    set median [expr {[llength $reached] < $count ? {} : [quantile $times 0.5]}]
    set late [expr {$median eq {} ? {} : [quantile $times 0.95]}]
    row "jump of 0.1 m, $count times" "locked on in [ms $median] ms, p95 [ms $late] ms, over [mm $over] mm" "597 ms, 647 ms, 5 mm" \
        [expr {$median ne {} && $median <= 0.597 && $late <= 0.647 && $over < 0.005}]
}
proc rows::hidden count {
    variable Ball
    variable Sine
    variable Lab
    ball sine {*}$Ball 0 0.1 0 $Sine
    sample 4
    set worst 0
    for {set k 0} {$k < $count} {incr k} {
        $Lab CTRL -lamp 0
        set samples [sample 0.3]
        $Lab CTRL -lamp 1
        lappend samples {*}[sample 1.5]
        set worst [most [list $worst {*}[lmap s $samples {off $s}]]]
        sample 0.4
    }
    row "hidden for 0.3 s on the sine" "[mm $worst] mm at most" "45 mm" [expr {$worst <= 0.045}]
}
# The ball stops where it is hidden, and waits there.
proc rows::lost count {
    variable Ball
    variable Sine
    variable Lab
    set found {}
    set creep 0
    for {set k 0} {$k < $count} {incr k} {
        ball sine {*}$Ball 0 0.1 0 $Sine
        sample [expr {3 + rand()}]
        lassign [truth] x y z
        $Lab CTRL -lamp 0
        ball still $x $y $z
        sample 1.7
        set creep [most [list $creep {*}[lmap s [speeds [sample 0.3]] {lindex $s 1}]]]
        set before [lindex [shmem_r.rel EXEC] end-2]
        $Lab CTRL -lamp 1
        lassign [truth] - - - begin
        lappend found [locked [sample 2.5] $begin]
    }
    set never [llength [lsearch -all -exact $found {}]]
    set late [expr {$never ? {} : [most $found]}]
    row "hidden for 2 s, $count times" "[mm $creep] mm/s then; locked on again in [ms $late] ms" "5 mm/s, 1000 ms" \
        [expr {$creep <= 0.005 && !$never && $late <= 1}]
}
# What may be taken for the ball: a second one, half of it, something at the border, nothing. Counts what was told as valid and is wrong.
proc rows::distractors seconds {
    variable Ball
    variable Sine
    variable Lab
    lassign $Ball x y z
    ball sine {*}$Ball 0 0.1 0 $Sine
    sample 3
    set told 0
    set valid 0
    set wrong {}
    for {set begin [clock seconds]} {[clock seconds] < $begin + $seconds} {} {
        set near [list [expr {$x + 0.3 * (rand() - 0.5)}] [expr {$y + 0.3 * (rand() - 0.5)}] [expr {$z + 0.1 * (rand() - 0.5)}]]
        switch [expr {int(rand() * 4)}] {
            0 { $Lab CTRL -secondBall {*}$near }
            1 { $Lab CTRL -occluder {*}[lrange $near 0 1] [expr {$z + 0.06}] 0.3 }
            2 { $Lab CTRL -lamp 0 }
            3 { ball still $x [expr {$y + 0.25}] $z }
        }
        shmem_r.rel exec since
        set samples [sample 0.6]
        $Lab CTRL -secondBall away -occluder away -lamp 1
        foreach {t rx ry rz residual code} [News shmem_r.rel] {
            incr told
            if {$code == 0} {
                incr valid
                set at [lindex $samples [lsearch -bisect -real -index 0 $samples $t]]
                if {$at ne {} && $t > [lindex $samples 0 0] && $t < [lindex $samples end 0]} {
                    set next [lindex $samples [expr {[lsearch -bisect -real -index 0 $samples $t] + 1}]]
                    set part [expr {($t - [lindex $at 0]) / ([lindex $next 0] - [lindex $at 0])}]
                    lassign [lmap a $at b $next {expr {$a + $part * ($b - $a)}}] - bx by bz tx ty tz
                    set off [expr {sqrt(($tx + $rx - $bx) ** 2 + ($ty - $ry - $by) ** 2 + ($tz - $rz - $bz) ** 2)}]
                    if {$off > 0.006} {
                        lappend wrong $off
                    }
                }
            }
        }
        ball sine {*}$Ball 0 0.1 0 $Sine
        sample 0.6
    }
    row "distractors" "[llength $wrong] wrong of $told pictures, $valid valid" "0 wrong (more than 6 mm off)" [expr {[llength $wrong] == 0}]
}
proc rows::News buffer {
    set news [$buffer exec since]
    return [expr {[dict exists $news floats] ? [dict get $news floats] : {}}]
}
# A daemon, one of those named, is killed while the ball moves; the launcher starts it again.
proc rows::kill {names count} {
    variable Ball
    variable Sine
    ball sine {*}$Ball 0 0.1 0 $Sine
    sample 3
    set back {}
    set fastest 0
    for {set k 0} {$k < $count} {incr k} {
        set name [lindex $names [expr {int(rand() * [llength $names])}]]
        foreach d [sorma::daemons] {
            if {[dict get $d name] eq $name && [dict get $d state] eq "alive"} {
                exec kill -KILL [regexp -inline {\d+(?=\]$)} [dict get $d identity]]
            }
        }
        lassign [truth] - - - begin
        set samples [sample [expr {2.5 + rand()}]]
        set late $begin
        foreach s $samples {
            if {[off $s] > 0.015} {
                set late [lindex $s 0]
            }
        }
        set fastest [most [list $fastest {*}[lmap s [speeds $samples] {lindex $s 1}]]]
        lappend back [expr {$late >= [lindex $samples end 0] - 0.2 ? {} : $late - $begin}]
    }
    set reached [lsearch -all -inline -not -exact $back {}]
    row "[join $names { or }] killed, $count times" "back within 15 mm in [ms [quantile $reached 0.5]] ms, [llength $reached] of $count;\
        [mm $fastest] mm/s at most" "each time; 500 mm/s" [expr {[llength $reached] == $count && $fastest <= 0.51}]
}
# Somebody pushes the hand while the ball rests: the tool gives way as a spring does, beyond the null radius of 2 N.
proc rows::push {} {
    variable Ball
    variable Lab
    ball still {*}$Ball
    sample 2
    set stiffness {}
    foreach force {10 20} {
        $Lab CTRL -push 0 $force 0 2
        sample 1.5
        set away [quantile [lmap s [sample 0.4] {expr {[lindex $s 5] - [lindex $s 2]}}] 0.5]
        lappend stiffness [expr {($force - 2) / max(1e-6, $away)}]
        sample 1.5
    }
    set back [most [lmap s [sample 0.5] {off $s}]]
    row "hand pushed with 10 and 20 N" "[join [lmap k $stiffness {format %.0f $k}] {, }] N/m, then [mm $back] mm off" "270 .. 330 N/m, 3 mm" \
        [expr {abs([lindex $stiffness 0] - 300) <= 30 && abs([lindex $stiffness 1] - 300) <= 30 && $back < 0.003}]
}
# Somebody presses the hand down with more than the spring bears: the tool stays above what clip.z allows, and the table bears nothing.
proc rows::press {} {
    variable Ball
    variable Lab
    ball still {*}$Ball
    sample 2
    $Lab CTRL -push 0 0 -30 2
    set lowest [::tcl::mathfunc::min {*}[lmap s [sample 2] {lindex $s 6}]]
    sample 2
    row "hand pressed down with 30 N" "tool [mm $lowest] mm above the ground" "300 mm" [expr {$lowest > 0.3}]
}
# Learning is given up at each of these places: the map that was there counts again.
proc rows::interrupted places {
    variable Ball
    ball still {*}$Ball
    sample 3
    unfollow
    set kept 0
    foreach place $places {
        set task [sorma::async -timeout 0 sight.ball@sight EXEC learn]
        set told [sorma::subscribe sight.ball@sight -event progress -command [list apply {{task place event} {
            if {[string match "node $place of *" [dict get $event text]]} {
                $task cancel
            }
        }} $task $place]]
        set ended [catch {wait $task}]
        sorma::unsubscribe $told
        # It ends at the next place, and goes back first.
        for {set end [expr {[clock seconds] + 30}]} {$ended && [clock seconds] < $end} {nap 200} {
            if {![catch {sight.ball@sight EXEC FMSG 9 0 249.5 262.5 1150 19 0 0 0 0}]} {
                incr kept
                break
            }
        }
    }
    follow
    row "learning given up, [llength $places] times" "the map that was known counts again: $kept" "each time" [expr {$kept == [llength $places]}]
}
# The control task: ticks, and what was skipped.
proc rows::ticks {} {
    set text [lindex [cycle.pino@robot DBX -stats] 3]
    regexp {ticks (\d+) skipped (\d+)} $text - ticks skipped
    regexp {jitter of the beginning: (.*?), longest} $text - jitter
    row "control tick" "$skipped of $ticks skipped; begins late $jitter" "0" [expr {$skipped == 0}]
}
proc rows::save file {
    variable Records
    set channel [open $file w]
    puts $channel "time,ballX,ballY,ballZ,toolX,toolY,toolZ"
    foreach record $Records {
        puts $channel [join $record ,]
    }
    close $channel
}
