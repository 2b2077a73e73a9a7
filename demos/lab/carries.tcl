# carries.tcl ?-carries N? ?-heaps H? ?-faults M? ?-cancels K? ?-seed S? ?-speed F? ?-table FILE? ?-short? ?-json FILE? 
#
# Measures how well tokens are carried in the laboratory. First fields, boards, light and shadows are random. Then tokens come from heaps;
# then something goes wrong; then carries are cancelled at random moments. The daemons of lab.launch must run.
#
# A fault is well when it is healed (the token lies where it should) or named: the error says what it was. Exit code 0: all were.

package require sorma
foreach file {colours.tcl ../measure.tcl} {
    source [file join [file dirname [file normalize [info script]]] $file]
}

namespace eval lab::carries {
    variable Place {0 0 0}              ;# of the board: by how much it has been moved
    variable Inject {}                  ;# phase of carry -> script, when it has ended
    variable Peak 0                     ;# [N] at the hand
    variable Room {}                    ;# of the tool, as the arm's guard has it [m]
    variable Outside 0                  ;# by how much the tool was outside of that [m]
    variable Off {0 0 0}                ;# most by which a marker was wrong [m], the board's yaw [rad], a token before it is looked at [m]
    # The faults, and the names that they may get; placed: it is healed.
    variable Faults {
        shifted   {placed EARLY EMPTY LOST}
        stolen    {UNSEEN}
        lost      {LOST}
        board     {placed SHIFTED}
        occupied  {OCCUPIED}
        dark      {EYE UNSEEN}
        hand      {placed AWAY}
        vision    {placed AWAY}
    }
}

# ---- the laboratory ----

proc lab::carries::prepare {table speed} {
    set own [expr {$table eq {}}]
    if {$own} {
        set table [file join [file dirname [dict get [lindex [sorma::daemons] 0] socket]] board.hsv]
        lab::colours::learn $table
    }
    foreach looker {findbrdmarker@eye getbrdsit@eye getdisk@eye} {
        $looker CTRL -table $table
    }
    if {$own} {
        file delete $table
    }
    simlab@lab CTRL -speed $speed
    simlab@lab EXEC step FMSG 1 0.2
    Power
    manus@hand EXEC release
    transform@transform CTRL -dump
    scene
    # A token under the open sky teaches what one looks like beside the tool.
    simlab@lab CTRL -move red_1 4 4
    puts "correction learned: [dict get [transform@transform exec -floats {4 4 0} learnGrasp] text]"
    sorma::create shmem_r.force -key demo.tool.force
    sorma::create shmem_r.place -key demo.tool.pose
    variable Room [wspc.room@robot cget -inside]
    sorma::subscribe carry@robot -event phase -command lab::carries::Phase
    carry@robot CTRL -patience 30
}

# Another scene: the board moved, tokens on random fields, other light. Returns the fields: dict {file rank} -> token.
proc lab::carries::scene {{count 8}} {
    variable Place
    set free [fields]
    set tokens {}
    clear
    set place [list [uniform 0.02] [uniform 0.03] [uniform 0.2]]
    simlab@lab CTRL -board {*}[lmap to $place from $Place {expr {$to - $from}}]
    set Place $place
    simlab@lab CTRL -light [expr {1 + [uniform 0.2]}] -shadows [expr {rand() < 0.5}]
    foreach colour {red yellow} {
        for {set i 1} {$i <= $count} {incr i} {
            set field [taken free]
            simlab@lab CTRL -move ${colour}_$i {*}[lmap x $field {expr {$x + [uniform 0.04]}}]
            dict set tokens $field ${colour}_$i
        }
    }
    transform@transform EXEC learnBoard
    Compare
    return $tokens
}
# The places of tokens on the board and of markers, once as transform gives them and once as they are.
proc lab::carries::Compare {} {
    variable Off
    set places {}
    dict for {name place} [Tokens] {
        lassign $place file rank x y
        if {$file < 0.5 || $file >= 9 || $rank < 0.5} continue
        lassign [World $file $rank] u v
        lappend places [list [expr {$rank + 0.1 * $file}] $x $y $u $v]
    }
    # The yaw: from the nearest to the farthest one.
    set places [lsort -real -index 0 $places]
    lassign [lindex $places 0] - x0 y0 u0 v0
    lassign [lindex $places end] - x y u v
    set turn [expr {atan2($y - $y0, $x - $x0) - atan2($v - $v0, $u - $u0)}]
    set tokens [lmap place $places {lassign $place - x y u v; expr {hypot($x - $u, $y - $v)}}]
    # Where the markers are: as far off as that yaw and the nearest token say.
    lassign [transform@transform cget -markers] behind aside
    set field [transform@transform cget -field]
    set middle [expr {([transform@transform cget -fields] + 1) / 2.0}]
    set markers [lmap side {1 -1} {
        lassign [World [expr {$middle + $side * $aside / $field}] [expr {$middle + $behind / $field}]] u v
        set x [expr {$x0 + cos($turn) * ($u - $u0) - sin($turn) * ($v - $v0)}]
        set y [expr {$y0 + sin($turn) * ($u - $u0) + cos($turn) * ($v - $v0)}]
        expr {hypot($x - $u, $y - $v)}
    }]
    lassign $Off most mostYaw mostToken
    set Off [list [tcl::mathfunc::max $most {*}$markers] [expr {max($mostYaw, abs(atan2(sin($turn), cos($turn))))}] \
        [tcl::mathfunc::max $mostToken {*}$tokens]]
}
proc lab::carries::World {file rank} {
    return [lrange [dict get [transform@transform exec -floats [list $file $rank 0] boardToWorld] floats] 0 1]
}
proc lab::carries::clear {} {
    foreach colour {red yellow} {
        for {set i 1} {$i <= 14} {incr i} {
            simlab@lab CTRL -steal ${colour}_$i
        }
    }
}
# All tokens as at the beginning of a game.
proc lab::carries::game {} {
    clear
    set red [set yellow 0]
    foreach field [fields] {
        lassign $field file rank
        if {$rank > 5} {
            simlab@lab CTRL -move red_[incr red] $file $rank
        } elseif {$rank < 4} {
            simlab@lab CTRL -move yellow_[incr yellow] $file $rank
        }
    }
    simlab@lab CTRL -light 1 -shadows 0
}
proc lab::carries::fields {} {
    set dark {}
    foreach file {1 2 3 4 5 6 7 8} {
        foreach rank {1 2 3 4 5 6 7 8} {
            if {($file + $rank) % 2 == 0} {
                lappend dark [list $file $rank]
            }
        }
    }
    return $dark
}
proc lab::carries::uniform most {
    return [expr {$most * (2 * rand() - 1)}]
}
# One of a list, taken out of it.
proc lab::carries::taken listVar {
    upvar 1 $listVar list
    set k [expr {int(rand() * [llength $list])}]
    set one [lindex $list $k]
    set list [lreplace $list $k $k]
    return $one
}
proc lab::carries::oneOf list {
    return [taken list]
}
# A field without a token.
proc lab::carries::empty tokens {
    return [oneOf [lmap field [fields] {expr {[dict exists $tokens $field] ? [continue] : $field}}]]
}
# How far a token is from a field [m].
proc lab::carries::away {token field} {
    lassign [concat [dict get [Tokens] $token] $field] file rank - - - wantedFile wantedRank
    return [expr {0.045 * hypot($file - $wantedFile, $rank - $wantedRank)}]
}
# Where the tokens are in the laboratory: dict name -> file rank x y z [m].
proc lab::carries::Tokens {} {
    set seen [simlab@lab exec tokens]
    set places {}
    foreach name [dict get $seen text] {file rank x y z} [dict get $seen floats] {
        dict set places $name [list $file $rank $x $y $z]
    }
    return $places
}

# ---- one carry ----

proc lab::carries::Phase event {
    variable Inject
    set phase [dict get $event text]
    if {[dict exists $Inject $phase]} {
        set script [dict get $Inject $phase]
        set Inject {}
        uplevel #0 $script
    }
}
# Returns a dict: outcome (placed, or the error's symbol), text, off [m] of the field, seconds of lab time.
proc lab::carries::carry {token from to} {
    set call [sorma::async carry@robot exec -floats [concat $from 0 $to 0]]
    measure until {[Feel] eq {} && [$call done]} -within 600 -every 50
    set failed [catch {$call take} result how]
    Feel
    set off [away $token $to]
    if {$failed} {
        set code [dict get $how -errorcode]
        set outcome [expr {[lindex $code 1] eq "CARRY" ? [lindex $code 2] : [join [lrange $code 1 2]]}]
        return [dict create outcome $outcome text $result off $off seconds 0]
    }
    return [dict create outcome placed text {} off $off seconds [lindex [dict get $result floats] 2]]
}
# Returns nothing.
proc lab::carries::Feel {} {
    variable Peak
    variable Room
    variable Outside
    foreach {- x y z - - -} [News shmem_r.force] {
        set Peak [expr {max($Peak, sqrt($x * $x + $y * $y + $z * $z))}]
    }
    foreach {- x y z - - - - - - - - - -} [News shmem_r.place] {
        foreach at [list $x $y $z] {low high} $Room {
            set Outside [expr {max($Outside, $low - $at, $at - $high)}]
        }
    }
}
proc lab::carries::News reader {
    set reply [$reader exec since]
    return [expr {[dict exists $reply floats] ? [dict get $reply floats] : {}}]
}
proc lab::carries::Power {} {
    catch {simlab@lab CTRL -reset}
    Until {pino@robot EXEC power on}
}
# Try until it goes well, for a minute at most.
proc lab::carries::Until script {
    measure until {![catch {uplevel 1 $script} text]} -within 60 -every 200 -else {$text}
}
# Before the next one: an arm with power, an open hand.
proc lab::carries::recover {} {
    Power
    Until {manus@hand EXEC release}
    carry@robot CTRL -released
}

# One that is given up at a random moment. Returns by how much the arm still moves [m] from 0.3 s on after nobody wants it any more, in
# as much time; empty: the carry was over before.
proc lab::carries::givenUp {from to} {
    set call [sorma::async carry@robot exec -floats [concat $from 0 $to 0]]
    set until [expr {[now] + 0.1 + 6 * rand()}]
    measure until {[$call done] || [now] >= $until} -within 600 -every 2
    if {[$call done]} {
        $call destroy
        return {}
    }
    $call cancel
    $call destroy
    measure until {[lindex [carry@robot DBX -phase] 3] eq {}}
    # As fast as it goes, lab time passes while the stop is under way.
    set places {}
    foreach wait {1 0.3} {
        set until [expr {[now] + $wait}]
        measure until {[now] >= $until} -every 2
        lappend places [lrange [dict get [shmem_r.place exec] floats] 1 3]
    }
    Feel
    lassign [concat {*}$places] x y z u v w
    return [expr {sqrt(($x - $u) ** 2 + ($y - $v) ** 2 + ($z - $w) ** 2)}]
}
proc lab::carries::now {} {
    return [lindex [dict get [shmem_r.place exec] floats] 0]
}

# ---- faults: each returns the phase of carry behind which it strikes ({}: before), and what it does ----

proc lab::carries::Strike {fault token from to tokens} {
    variable Place
    switch $fault {
        shifted {
            set angle [uniform 3.1416]
            set at [list [expr {[lindex $from 0] + 0.006 / 0.045 * cos($angle)}] [expr {[lindex $from 1] + 0.006 / 0.045 * sin($angle)}]]
            return [list look [list simlab@lab CTRL -move $token {*}$at]]
        }
        stolen {
            return [list {} [list simlab@lab CTRL -steal $token]]
        }
        lost {
            return [list lift [list simlab@lab CTRL -steal $token]]
        }
        board {
            set by [list [expr {rand() < 0.5 ? 0.012 : -0.012}] [uniform 0.01] [uniform 0.02]]
            set Place [lmap a $Place b $by {expr {$a + $b}}]
            return [list {} [list simlab@lab CTRL -board {*}$by]]
        }
        occupied {
            set other [lindex [lmap {- name} $tokens {expr {$name eq $token ? [continue] : $name}}] 0]
            return [list {} [list simlab@lab CTRL -move $other {*}$to]]
        }
        dark {
            return [list {} [list simlab@lab CTRL -light 0.02]]
        }
        hand {
            return [list [lindex {preshape lift} [expr {int(2 * rand())}]] [list exec kill -KILL [measure process hand]]]
        }
        vision {
            variable Stopped [measure process eye]
            return [list preshape [list exec kill -STOP $Stopped]]
        }
    }
}
proc lab::carries::Undo fault {
    switch $fault {
        dark {
            simlab@lab CTRL -light 1
        }
        vision {
            variable Stopped
            exec kill -CONT $Stopped
        }
    }
}
# ---- the table ----

# Lab time is judged at speed 1 only: when it goes faster, what the machine needs for itself counts many times.
proc lab::carries::Well {count speed} {
    set placed [set unnoticed [set worst [set slowest 0]]]
    for {set i 1} {$i <= $count} {incr i} {
        set tokens [scene]
        set from [oneOf [dict keys $tokens]]
        set to [empty $tokens]
        set one [carry [dict get $tokens $from] $from $to]
        set off [dict get $one off]
        if {[dict get $one outcome] ne "placed"} {
            puts "$i: [dict get $one text]"
            recover
        } elseif {$off <= 0.002} {
            incr placed
            set worst [expr {max($worst, $off)}]
        } else {
            puts [format {%d: {%s} to {%s}: placed %.1f mm from the middle} $i $from $to [expr {1e3 * $off}]]
            incr unnoticed [expr {$off > 0.01}]
        }
        set slowest [expr {max($slowest, [dict get $one seconds])}]
    }
    measure row "$count carries, placed within 2 mm" -measured "$placed, at most [format %.2f [expr {1e3 * $worst}]] mm" -wanted all -target {$placed == $count}
    measure row "drops unnoticed" -measured $unnoticed -wanted 0 -target {$unnoticed == 0}
    measure row "lab time of a carry, at most" -measured [format {%.2f s} $slowest] -wanted "8 s at speed 1" -target {$speed != 1 || $slowest <= 8}
}

proc lab::carries::Faulty count {
    variable Faults
    variable Inject
    set well 0
    for {set i 1} {$i <= $count} {incr i} {
        set fault [lindex [dict keys $Faults] [expr {($i - 1) % [dict size $Faults]}]]
        set tokens [scene]
        set from [oneOf [dict keys $tokens]]
        set to [empty $tokens]
        set token [dict get $tokens $from]
        lassign [Strike $fault $token $from $to $tokens] phase script
        if {$phase eq {}} {
            uplevel #0 $script
        } else {
            set Inject [list $phase $script]
        }
        set one [carry $token $from $to]
        set Inject {}
        Undo $fault
        set outcome [dict get $one outcome]
        if {$outcome in [dict get $Faults $fault] && ($outcome ne "placed" || [dict get $one off] <= 0.002)} {
            incr well
        } else {
            puts [format {%d: %s: %s, %.1f mm from its goal; %s} $i $fault $outcome [expr {1e3 * [dict get $one off]}] [dict get $one text]]
        }
        recover
    }
    measure row "$count carries with a fault, healed or named" -measured $well -wanted all -target {$well == $count}
}

# The uppermost token is taken from one of three heaps beside the board, between which a row is free, as checkers puts them.
proc lab::carries::Heaps count {
    set alone 0
    for {set i 0} {$i < $count} {incr i} {
        clear
        set n 0
        foreach rank {7 5 3} {
            set high [expr {1 + int(4 * rand())}]
            for {set underneath 0} {$underneath < $high} {incr underneath} {
                simlab@lab CTRL -move red_[incr n] [expr {9.4 + [uniform 0.015]}] [expr {$rank + [uniform 0.015]}] $underneath
            }
            set top($rank) [list red_$n [expr {$high - 1}]]
        }
        simlab@lab EXEC step FMSG 1 0.3
        set rank [lindex {7 5 3} [expr {int(3 * rand())}]]
        lassign $top($rank) token underneath
        set before [dict remove [Tokens] $token]
        set failed [catch {carry@robot exec -floats [list 9.4 $rank $underneath 4 4 0]} text]
        set after [Tokens]
        set pushed [lmap {name at} $before {
            lassign [concat $at [dict get $after $name]] - - x y z - - u v w
            expr {hypot($u - $x, $v - $y) > 0.002 || abs($w - $z) > 0.002 ? $name : [continue]}
        }]
        if {!$failed && $pushed eq {}} {
            incr alone
        } else {
            puts "$i: $token from the heap at row $rank: [expr {$failed ? $text : "carried"}]; pushed: [join $pushed {, }]"
        }
        recover
    }
    measure row "$count taken from heaps, others as before" -measured $alone -wanted all -target {$alone == $count}
}
proc lab::carries::GivenUp count {
    set still 0
    for {set i 0} {$i < $count} {} {
        set tokens [scene]
        set moves [givenUp [lindex [dict keys $tokens] 0] [empty $tokens]]
        if {$moves ne {}} {
            incr i
            if {$moves < 3e-4} {
                incr still
            } else {
                puts [format {%d: given up, and the tool still came %.2f mm} $i [expr {1e3 * $moves}]]
            }
        }
        recover
    }
    measure row "$count carries given up, the arm stands" -measured $still -wanted all -target {$still == $count}
}

proc lab::carries::run given {
    variable Off
    variable Peak
    variable Outside
    dict with given {}
    prepare ${-table} ${-speed}
    Well ${-carries} ${-speed}
    Heaps ${-heaps}
    # Parts that are away are given up sooner.
    carry@robot CTRL -patience 8
    Faulty ${-faults}
    carry@robot CTRL -patience 30
    GivenUp ${-cancels}
    game
    lassign $Off most yaw token
    measure row "markers, at most off" -measured [format {%.2f mm, %.2f degrees} [expr {1e3 * $most}] [expr {$yaw * 57.29578}]] \
        -wanted "1 mm, 0.3 degrees" -target {$most <= 1e-3 && $yaw <= 0.3 / 57.29578}
    measure row "tokens, before they are looked at" -measured [format {%.2f mm} [expr {1e3 * $token}]] -wanted "3 mm" -target {$token <= 3e-3}
    measure row "outside of the guards" -measured [format {%.2f mm} [expr {1e3 * $Outside}]] -wanted none -target {$Outside <= 1e-4}
    measure row "largest force on the hand" -measured [format {%.1f N} $Peak] -wanted "15 N" -target {$Peak <= 15}
}

if {[file normalize $argv0] eq [file normalize [info script]]} {
    exit [measure run {-carries {any 200} -heaps {any 40} -faults {any 100} -cancels {any 50} -speed {any 0} -table any} \
        {-carries 2 -faults 8 -cancels 2 -heaps 2} $argv lab::carries::run]
}
