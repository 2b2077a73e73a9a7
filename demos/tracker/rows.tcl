# rows.tcl -- the rows of the tracker's table: each makes the ball do something while the arm follows, and measures how well that went.
#
# The daemons of tracker.launch must run. What counts is the laboratory's truth: where the ball is, and where the arm is.

package require sorma

namespace eval tracker::rows {
    variable Lab simlab@lab
    variable Follow follow.ball@robot
    variable Ball {0.56 0 0.12}         ;# where it rests
    variable Above 0.3                  ;# [m] the tool above the ball
    variable Down {0 1 0 0}             ;# the tool points at the table
    variable Sine 0.4                   ;# [Hz]
    variable Task {}                    ;# the request that follows
    variable Missed {}                  ;# what has missed its target: names of rows
    variable Usual inf                  ;# [m] rms on the sine, with all as it should be
    variable Records {}                 ;# all samples: t, ball 3, tool 3
    variable Learning {}                ;# the request that is given up
    variable Patience 20                ;# [s] of wall time, for a daemon to be another process
    variable Ends {}                    ;# of rows in it: how many records there were, which row
    variable Stepped 0                  ;# lab time goes on only when a row lets it
    variable Ahead {0 0}                ;# of the camera's clock: offset [s], drift [1]
}
foreach {name key} {pose tool.pose rel target.rel table table.state image camera.image} {
    sorma::so::dict CTRL -add shmem_r.$name [list -key tracker.$key]
}

# ---- the laboratory ----

proc tracker::rows::prepare speed {
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
proc tracker::rows::ball args {
    variable Lab
    $Lab CTRL -ball {*}$args
}
# Learn the map, or take it as it was learned before.
proc tracker::rows::learn again {
    if {!$again && ![catch {sight.ball@sight EXEC FMSG 9 0 249.5 262.5 1150 19 0 0 0 0}]} {
        puts "the map has been learned before"
        return
    }
    puts "the arm shows itself where a ball is: 27 places, then 8 between them"
    variable Lab
    set speed [$Lab cget -speed]
    set told [sorma::subscribe sight.ball@sight -event progress -command {apply {event {puts "  [dict get $event text]"}}}]
    try {
        # Nothing is measured meanwhile: lab time goes as fast as it can.
        $Lab CTRL -speed 0
        set task [sorma::async -timeout 0 sight.ball@sight EXEC learn]
        while {![$task done]} {
            nap 100
        }
        $task take
    } finally {
        $Lab CTRL -speed $speed
        sorma::unsubscribe $told
    }
}
proc tracker::rows::follow {} {
    variable Task
    variable Follow
    set Task [sorma::async -timeout 0 $Follow EXEC]
}
# Fails with what has ended it, if something has.
proc tracker::rows::unfollow {} {
    variable Task
    variable Follow
    if {$Task eq {}} {
        return
    }
    $Follow CTRL -stop
    set task $Task
    set Task {}
    try {
        $task take
    } trap {SORMA ROBOT STOPPED} {} {}
}
proc tracker::rows::nap ms {
    after $ms {set ::tracker::rows::Napped 1}
    vwait ::tracker::rows::Napped
}

# ---- samples ----

# Where the ball is, and when: x y z t.
proc tracker::rows::truth {} {
    variable Lab
    set reply [$Lab DBX -ball]
    return [list {*}[lindex $reply 3] [lindex $reply end]]
}

# Lab time goes on by a control tick, and stands again; before it goes on next, the robot has been told what the newest picture shows. So nothing
# happens between two samples but what the row does, and what it measures in lab time does not depend on how busy this machine is.
proc tracker::rows::pass {} {
    variable Lab
    variable Stepped
    if {!$Stepped} {
        nap 15
        return
    }
    set now [lindex [dict get [$Lab exec -floats 0.015] floats] 0]
    Answered $now
    nap 0
}
# When the newest picture was taken, by the camera's clock.
proc tracker::rows::Pictured {} {
    return [lindex [dict get [shmem_r.image exec] floats] 0]
}
proc tracker::rows::Answered now {
    variable Ahead
    variable Patience
    lassign $Ahead offset drift
    set taken [expr {([Pictured] - $offset) / (1 + $drift)}]
    # A picture of later than now was stamped before the camera's clock was set.
    for {set end [expr {[clock seconds] + $Patience}]} {$taken <= $now && [lindex [dict get [shmem_r.rel exec] floats] 0] < $taken - 0.005} {nap 1} {
        if {[clock seconds] > $end} {
            error "what the picture of $taken s shows has not been told to the robot in $Patience s: is argus or sight away?"
        }
    }
}

# Sample for so many seconds of lab time; the script is run before each sample and may read its time, now. Returns lists
# t ball(3) tool(3).
proc tracker::rows::sample {seconds {script {}}} {
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
        if {$Task ne {} && [$Task done]} {
            [set task $Task][set Task {}] take
        }
        pass
    }
    set samples [Meet $poses $balls]
    lappend Records {*}$samples
    return $samples
}
# The tool's place at the times of the ball's.
proc tracker::rows::Meet {poses balls} {
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
proc tracker::rows::off sample {
    variable Above
    lassign $sample - bx by bz x y z
    return [expr {sqrt(($x - $bx) ** 2 + ($y - $by) ** 2 + ($z - $bz - $Above) ** 2)}]
}
proc tracker::rows::rms numbers {
    set sum 0.0
    foreach x $numbers {
        set sum [expr {$sum + $x * $x}]
    }
    return [expr {sqrt($sum / max(1, [llength $numbers]))}]
}
proc tracker::rows::most numbers { return [::tcl::mathfunc::max {*}$numbers] }
proc tracker::rows::quantile {numbers q} { return [lindex [lsort -real $numbers] [expr {int($q * ([llength $numbers] - 1) + 0.5)}]] }
# The tool's, between samples that are at least 40 ms apart: when [s], in the middle between them, and how fast [m/s].
proc tracker::rows::speeds samples {
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
proc tracker::rows::lag {samples frequency} {
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
proc tracker::rows::locked {samples begin {near 0.003} {slow 0.010}} {
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

proc tracker::rows::row {what measured target met} {
    variable Missed
    variable Records
    variable Ends
    lappend Ends [llength $Records] $what
    puts [format {%-34s %-44s %-36s %s} $what $measured $target [expr {$met ? "yes" : "NO"}]]
    if {!$met} {
        lappend Missed $what
    }
}
# A row in lab time, which stands but for its samples.
proc tracker::rows::lab args {
    variable Lab
    variable Stepped
    $Lab CTRL -paused 1
    set Stepped 1
    try {
        # It begins as a picture comes: when that is, after lab time was stopped, is chance, and a jump is seen up to 70 ms later.
        set last [Pictured]
        for {set k 0} {$k < 100 && [Pictured] == $last} {incr k} {
            pass
        }
        {*}$args
    } finally {
        set Stepped 0
        $Lab CTRL -paused 0
    }
}
# A row in wall time: other programs of this machine may spoil it. So it has three tries, which are all printed; it is missed when each one is.
proc tracker::rows::wall args {
    variable Missed
    set before $Missed
    for {set try 1} 1 {incr try} {
        {*}$args
        if {$Missed eq $before} {
            return
        }
        puts "    (in wall time: try $try of 3 has missed)"
        if {$try == 3} {
            return
        }
        set Missed $before
    }
}
# What has missed its target is said once more; returns whether something has.
proc tracker::rows::missed {} {
    variable Missed
    if {$Missed ne {}} {
        puts "missed: [join $Missed {; }]"
    }
    return [expr {$Missed ne {}}]
}
proc tracker::rows::mm x { return [format %.2f [expr {1e3 * $x}]] }
proc tracker::rows::ms x { return [expr {$x eq {} ? "never" : [format %.0f [expr {1e3 * $x}]]}] }

proc tracker::rows::rest seconds {
    variable Ball
    ball still {*}$Ball
    sample 2
    set samples [sample $seconds]
    set off [rms [lmap s $samples {off $s}]]
    set speed [rms [lmap s [speeds $samples] {lindex $s 1}]]
    row "ball at rest" "[mm $off] mm rms, [mm $speed] mm/s rms" "0.5 mm, 3 mm/s" [expr {$off <= 0.0005 && $speed <= 0.003}]
}
# The camera's delay varies from 40 to 110 ms, for each picture: at random, but in each row the same.
proc tracker::rows::Delay {begin now} {
    variable Lab
    set k [expr {int(($now - $begin) * 14)}]
    $Lab CTRL -cameraLatency [expr {0.04 + 0.07 * fmod(abs(43758.5453 * sin(12.9898 * $k)), 1)}]
}
# Follow the sine for so long: the samples.
proc tracker::rows::Swing seconds {
    variable Ball
    variable Sine
    variable Lab
    ball sine {*}$Ball 0 0.1 0 $Sine
    sample 3
    set samples [sample $seconds {Delay $begin $now}]
    $Lab CTRL -cameraLatency 0.05
    return $samples
}
# rms and largest error [m], lag [s].
proc tracker::rows::Figures samples {
    variable Sine
    set errors [lmap s $samples {off $s}]
    return [list [rms $errors] [most $errors] [lag $samples $Sine]]
}
proc tracker::rows::sine {seconds {name "varying delay"}} {
    variable Sine
    variable Usual
    lassign [Figures [Swing $seconds]] off most lag
    set Usual $off
    row "sine 0.1 m, $Sine Hz, $name" "[mm $off] mm rms, [mm $most] mm at most, lag [ms $lag] ms" "6.5 mm, 12 mm, -30 .. 30 ms" \
        [expr {$off <= 0.0065 && $most <= 0.012 && abs($lag) <= 0.03}]
}
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
    row "the same without prediction" "[mm $off] mm rms, lag [ms $lag] ms: [format %.1f [expr {$off / $Usual}]] times" "4 times" [expr {$off >= 4 * $Usual}]
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
    row "clocks 3 s and 50 ppm apart" "[mm $off] mm rms, [mm $most] mm at most, lag [ms $lag] ms; same clock [mm $usual] mm" \
        "5 % above the same clock" [expr {$off <= 1.05 * $usual}]
}
proc tracker::rows::Clock differs {
    variable Lab
    variable Ahead
    if {$differs} {
        clock.camera@argus CTRL -offset 3 -drift 5e-5
    }
    set Ahead [expr {$differs ? {3 5e-5} : {0 0}}]
    $Lab CTRL -cameraClock $Ahead
    sight.ball@sight CTRL -clock [expr {$differs ? "clock.sight" : {}}]
}
# Cameras that are slow and quick, and a quicker control task.
proc tracker::rows::cameras seconds {
    variable Lab
    foreach rate {2 60} {
        $Lab CTRL -cameraRate $rate
        try {
            set samples [Swing $seconds]
        } finally {
            $Lab CTRL -cameraRate 14
        }
        lassign [Figures $samples] off most
        lassign [Motion $samples] speed acceleration outside
        row "sine, a camera with $rate Hz" "[mm $off] mm rms, [mm $most] mm at most; [mm $speed] mm/s, [format %.2f $acceleration] m/s2, $outside outside of the guard" \
            "500 mm/s, 2 m/s2, 0" [expr {$speed <= 0.51 && $acceleration <= 2.2 && $outside == 0}]
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
proc tracker::rows::jumps count {
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
    # A median of a few says little: fewer than ten are judged by the latest.
    set reached [lsearch -all -inline -not -exact $times {}]
    set median [expr {[llength $reached] < $count ? {} : [quantile $times 0.5]}]
    set late [expr {$median eq {} ? {} : [quantile $times 0.95]}]
    row "jump of 0.1 m, $count times" "locked on in [ms $median] ms, p95 [ms $late] ms, over [mm $over] mm" "[expr {$count < 10 ? {} : "597 ms, "}]647 ms, 5 mm" \
        [expr {$median ne {} && ($count < 10 || $median <= 0.597) && $late <= 0.647 && $over < 0.005}]
}
proc tracker::rows::hidden count {
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
proc tracker::rows::lost count {
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
# What may be taken for the ball: a second one, also when the ball goes out then; half of it; something at the border; nothing. Counts what
# was told as valid and is wrong, in so many pictures.
proc tracker::rows::distractors pictures {
    variable Ball
    variable Sine
    variable Lab
    lassign $Ball x y z
    $Lab CTRL -cameraRate 60
    ball sine {*}$Ball 0 0.1 0 $Sine
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
                second - replaced { $Lab CTRL -secondBall {*}$beside }
                covered { $Lab CTRL -occluder {*}[lmap at [lrange [truth] 0 2] by [list [expr {0.06 * (rand() - 0.5)}] [expr {0.06 * (rand() - 0.5)}] 0.06] {expr {$at + $by}}] 0 }
                dark { $Lab CTRL -lamp 0 }
                border { ball still $x [expr {$y + 0.2 + 0.1 * rand()}] $z }
            }
            # The buffer holds the answers of a second.
            set samples [sample 0.4]
            set answers [News shmem_r.rel]
            if {$kind eq "replaced"} {
                $Lab CTRL -lamp 0
            }
            lappend samples {*}[sample 0.5]
            lappend answers {*}[News shmem_r.rel]
            $Lab CTRL -lamp 1
            lappend samples {*}[sample 0.05]
            $Lab CTRL -secondBall away -occluder away
            ball sine {*}$Ball 0 0.1 0 $Sine
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
        $Lab CTRL -cameraRate 14 -lamp 1 -secondBall away -occluder away
    }
    # A ball that lights up where the other one went out is a ball that has jumped, for whoever sees it: counted, and no fault.
    set replaced [if {[dict exists $wrong replaced]} {dict get $wrong replaced} else {string cat 0}]
    dict unset wrong replaced
    row "distractors" "[expr [join [linsert [dict values $wrong] 0 0] +]] wrong of $told pictures, $valid valid[expr {$wrong eq {} ? {} : ": $wrong"}]; another ball instead of\
        it: $replaced" "0 wrong (more than 6 mm off)" [expr {$wrong eq {}}]
}
# [m] how far a ball at r in the tool's frame was from the true one; 0 when that is not known: before the first sample, or in a jump.
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
proc tracker::rows::News buffer {
    set news [$buffer exec since]
    return [expr {[dict exists $news floats] ? [dict get $news floats] : {}}]
}
# While the ball moves, one of those named is killed, and the launcher starts it again; the camera, which is a part of the laboratory, gives no
# pictures for as long as that. The next one is killed as soon as the arm follows again. Meanwhile all poses of the arm must be within its
# limits: what the laboratory's own arm has done, not what it was told to do.
proc tracker::rows::kill {names count} {
    variable Ball
    variable Sine
    variable Lab
    ball sine {*}$Ball 0 0.1 0 $Sine
    sample 3
    set back {}
    set samples {}
    set late {}
    set unkilled {}
    for {set k 0} {$k < $count} {incr k} {
        lassign [truth] - - - begin
        set name [lindex $names [expr {int(rand() * [llength $names])}]]
        if {$name eq "camera"} {
            $Lab CTRL -cameraRate 0
            lappend samples {*}[sample [expr {0.2 + 0.6 * rand()}]]
            $Lab CTRL -cameraRate 14
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
        if {$name ne "camera" && ![Anew $name $process]} {
            lappend unkilled $name
        }
    }
    lassign [Motion $samples] speed acceleration outside
    set n [llength $back]
    set times [expr {$n ? "[ms [quantile $back 0.5]] ms, at most [ms [most $back]] ms" : "never"}]
    row "[join $names { or }] away, $count times" "back within 15 mm in $times, $n of $count;\
        [mm $speed] mm/s, [format %.2f $acceleration] m/s2, $outside outside of the guard[expr {$late eq {} ? {} : "; later than 3 s: [join $late {, }]"}][expr {$unkilled eq {} ? {} : "; still the same process: [join $unkilled {, }]"}]" "each time; 500 mm/s, 2 m/s2, 0" \
        [expr {$n == $count && $unkilled eq {} && $speed <= 0.51 && $acceleration <= 2.2 && $outside == 0}]
}
# Kill a daemon: the process that it was.
proc tracker::rows::Kill name {
    set process [Process $name]
    if {$process ne {}} {
        exec kill -KILL $process
    }
    return $process
}
# Is it another process than that, in time?
proc tracker::rows::Anew {name process} {
    variable Patience
    for {set end [expr {[clock seconds] + $Patience}]} {[clock seconds] < $end} {nap 50} {
        if {$process ne {} && [Process $name] ni [list {} $process]} {
            return 1
        }
    }
    return 0
}
# Of the tool: the largest speed [m/s] and acceleration [m/s2], over 0.06 s, and how many poses were outside of the guard.
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
# Somebody pushes the hand while the ball rests, again and again, to each side in turn: the tool gives way as a spring does, beyond the null
# radius of 2 N, and returns.
# How far the tool is from the ball, to this side [m]: the median of 0.3 s.
proc tracker::rows::Aside side {
    return [quantile [lmap s [sample 0.3] {expr {$side * ([lindex $s 5] - [lindex $s 2])}}] 0.5]
}
proc tracker::rows::push count {
    variable Ball
    variable Lab
    ball still {*}$Ball
    sample 2
    set ways {}                 ;# dict: force -> how far the tool has moved away, each time
    set back 0
    for {set k 0} {$k < $count} {incr k} {
        set force [expr {5 + 5 * (($k + 1) % 4)}]        ;# 10 N first: of 5 N a single push says little
        set side [expr {$k % 2 ? 1 : -1}]
        # From where it has rested: how far that is from the ball is another row.
        set rest [Aside $side]
        $Lab CTRL -push 0 [expr {$side * $force}] 0 1.8
        sample 1.4
        dict lappend ways $force [expr {[Aside $side] - $rest}]
        sample 1.3
        set back [most [list $back {*}[lmap s [sample 0.3] {off $s}]]]
    }
    # Of each force the mean: the tool rests within half a millimetre, and 5 N move it by 10.
    set stiffness [lmap {force away} $ways {expr {($force - 2) * [llength $away] / max(1e-6, [::tcl::mathop::+ {*}$away])}}]
    set least [::tcl::mathfunc::min {*}$stiffness]
    row "hand pushed with 5 to 20 N, $count times" "[format %.0f $least] to [format %.0f [most $stiffness]] N/m, then [mm $back] mm off" "270 .. 330 N/m, 3 mm" \
        [expr {$least >= 270 && [most $stiffness] <= 330 && $back < 0.003}]
}
# The tool is led against the table: the ball is hidden, and where the tool shall be goes to 50 mm below the table, with 0.1 m/s. It gives way when it
# touches, as when somebody pushes it. What counts is what the table bears. Fingers and table give way by 1 mm for 8 N, and the arm brakes with
# 2 m/s2, so touched with 0.1 m/s the table would bear 45 N even without any delay: therefore follow.ball goes slowly below its -floor.
proc tracker::rows::press {count {slow 0.1}} {
    variable Ball
    variable Lab
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
            $Lab CTRL -lamp 0
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
            $Lab CTRL -lamp 1
        }
        ball still {*}$Ball
        sample 2
    } finally {
        $Lab CTRL -lamp 1
        follow.ball@robot CTRL -speed $speed
        circuit.tracker@robot CTRL -wires $wires
        clip.z@robot CTRL -low $low
        wspc.room@robot CTRL -inside $inside
    }
    row "pressed on the table, $count times" "at most [format %.1f $highest] N at $slow m/s, then [format %.1f [quantile $rest 0.5]] N" "30 N at 0.1 m/s or less" \
        [expr {$touched == $count && $highest <= 30}]
}
# The circuit's wires, with the tool so far above the ball.
proc tracker::rows::Above {height wires} {
    return [string map [list "0 0 0.3 -> sum.goal.in2" "0 0 $height -> sum.goal.in2"] $wires]
}
# What the table bears [N], in so many seconds of lab time: all records.
proc tracker::rows::Loads seconds {
    set loads {}
    lassign [truth] - - - begin
    shmem_r.table exec since
    for {set now $begin} {$now < $begin + $seconds} {lassign [truth] - - - now} {
        nap 15
        foreach {t a b c d tripped} [News shmem_r.table] {
            lappend loads [expr {$a + $b + $c + $d}]
        }
    }
    return $loads
}
# Learning is given up at each of its places in turn, from the first one on, and when it is checked: each time the tool must go back, and the map
# that was there must count again. Lab time goes as fast as it can, with few pictures and quick moves.
proc tracker::rows::interrupted places {
    variable Ball
    variable Lab
    ball still {*}$Ball
    sample 3
    unfollow
    set usual {}
    foreach {so options} [list $Lab {-speed 0 -cameraRate 5} sight.ball@sight {-samples 1 -rest 0} mvpos.learn@robot {-speed 0.5 -acceleration 2}] {
        dict for {option value} $options {
            lappend usual $so $option [$so cget $option]
        }
        $so CTRL {*}$options
    }
    set before [Known]
    set begin [lrange [dict get [pino@robot exec] floats] 0 2]
    set kept 0
    set unkept {}
    set whats [list {*}[lmap k [Range 1 $places] {string cat "node $k of *"}] "check 1 of *" "check 8 of *"]
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
    row "learning given up, at $places places" "the map that was known counts again: $kept of $count[expr {$unkept eq {} ? {} : ", not at [join $unkept {; }]"}]" \
        "each time" [expr {$kept == $count}]
}
proc tracker::rows::Range {low high} {
    set range {}
    for {set k $low} {$k <= $high} {incr k} {
        lappend range $k
    }
    return $range
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
        while {![$Learning done]} {
            nap 5
        }
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
    for {set end [expr {[clock seconds] + 60}]} {[clock seconds] < $end} {nap 50} {
        if {![string match "*moved by*" [pino@robot EXEC status]] &&
                [rms [lmap a $begin b [lrange [dict get [pino@robot exec] floats] 0 2] {expr {$b - $a}}]] < 0.001} {
            return {}
        }
    }
    return "the tool did not go back"
}
# What the map says of a ball, seen so; nothing while there is no map.
proc tracker::rows::Known {} {
    return [expr {[catch {dict get [sight.ball@sight exec -floats {0 249.5 262.5 1150 19 0 0 0 0}] floats} known] ? {} : [lmap x $known {format %.6f $x}]}]
}
# The control task: ticks, and what was skipped, until now; a further try counts ten seconds.
proc tracker::rows::ticks {} {
    variable Ticks
    if {[info exists Ticks]} {
        sample 10
    } else {
        set Ticks {0 0}
    }
    set told [cycle.pino@robot DBX -stats]
    lassign [lrange $told end-1 end] ticks skipped
    lassign $Ticks ticksBefore skippedBefore
    set Ticks [list $ticks $skipped]
    incr ticks -$ticksBefore
    incr skipped -$skippedBefore
    lassign [lmap s [lrange $told 7 8] {format "%.3g ms" [expr {1e3 * $s}]}] late longest
    set lost "[lindex [dict get [simlab@lab exec time] floats] 1] s"
    row "control tick" "$skipped of $ticks skipped; late $late (p99), $longest at most; lab time lost $lost" "0" [expr {$ticks > 0 && $skipped == 0}]
}
# The system calls of the control task's thread, as strace sees them; reading the clock is none. A bell that wakes other threads, and the sleep
# until the next tick, are futexes. That sleep is for the laboratory's clock, a buffer: so it begins with a membarrier (shmem::Reader::sleep;
# nothing else has one). strace makes the thread so slow that ticks are skipped.
proc tracker::rows::calls seconds {
    variable Ball
    variable Sine
    if {[auto_execok strace] eq {}} {
        return [row "system calls in the tick" "strace is not installed" "futex alone" 0]
    }
    ball sine {*}$Ball 0 0.1 0 $Sine
    sample 3
    set ticks [Ticked]
    # It ends with `timeout`, and tells its own end on stderr.
    set log [exec mktemp]
    try {
        set watch [open [list | timeout $seconds strace -qq -o $log -p [Thread robot sorma-cycle] 2>@1]]
        sample $seconds
        catch {close $watch}
        set ticks [expr {[Ticked] - $ticks}]
        set channel [open $log]
        set counts {}
        set else 0
        foreach line [split [read $channel] \n] {
            if {[regexp {^(\w+)\((?:[^,]*, (FUTEX_WAIT|FUTEX_WAKE))?} $line - call kind]} {
                dict incr counts [expr {$kind eq {} ? $call : $kind}]
                incr else [expr {$call ni {futex membarrier restart_syscall}}]
            }
        }
        close $channel
    } finally {
        file delete $log
    }
    row "system calls in $ticks ticks" "$else other ones; [join [lmap {call count} $counts {string cat "$call: $count"}] ", "]" \
        "futex; membarrier for a sleep" [expr {$ticks > 0 && $counts ne {} && $else == 0}]
}
proc tracker::rows::Ticked {} {
    set ticks [lindex [cycle.pino@robot DBX -stats] end-1]
    return $ticks
}
proc tracker::rows::Process name {
    foreach d [sorma::daemons] {
        if {[dict get $d name] eq $name && [dict get $d state] eq "alive"} {
            return [regexp -inline {\d+(?=\]$)} [dict get $d identity]]
        }
    }
}
# The thread of that name in a daemon.
proc tracker::rows::Thread {daemon name} {
    foreach comm [glob /proc/[Process $daemon]/task/*/comm] {
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
    variable Ball
    variable Sine
    ball sine {*}$Ball 0 0.1 0 $Sine
    nap [expr {1000 * $seconds}]
}
# All samples, to 0.1 mm, with the row in which they were taken.
proc tracker::rows::save file {
    variable Records
    variable Ends
    set channel [open $file w]
    puts $channel "time,ballX,ballY,ballZ,toolX,toolY,toolZ,row"
    set k 0
    foreach {end what} $Ends {
        foreach record [lrange $Records $k $end-1] {
            puts $channel [join [list [format %.3f [lindex $record 0]] {*}[lmap x [lrange $record 1 end] {format %.4f $x}] "\"$what\""] ,]
        }
        set k $end
    }
    close $channel
}
