# incidents.tcl ?-speed N? ?-folder F? ?-only NAMES? ?-short? ?-json FILE? -- acts of people beside playing, in physics.
#
# For each: does the robot name it, and does the game go on?
#
# One game; this script moves the person's tokens. A row for each incident: its name, what was said of it, and whether all went as it
# should. Exit code 0: everything did. -short: one that needs no long wait.

source [file join [file dirname [file normalize [info script]]] session.tcl]
package require sorma::service::drycarry
package require checkers::game

namespace eval checkers::incidents {
    variable Position {W:W21,22,23,24,29,30,31,32:B1,2,3,4,9,10,11,12}
    variable Told {}            ;# what the plot has told since the last look: dicts
    variable Spoken {}          ;# what was said since then
    variable Then {}            ;# state of the plot -> script, once
}

proc checkers::incidents::Watch told {
    variable Told
    variable Then
    lappend Told $told
    set state [dict get $told state]
    if {[dict exists $Then $state]} {
        set script [dict get $Then $state]
        dict unset Then $state
        namespace eval ::checkers::incidents $script
    }
}
proc checkers::incidents::Said event {
    variable Spoken
    if {[dict get $event event] eq "said"} {
        lappend Spoken [dict get $event text]
    }
}
# Wait until a condition holds, for two minutes of wall time at most.
proc checkers::incidents::until {what condition} {
    uplevel 1 [list measure until $condition -within 120 -else "in two minutes it did not happen: $what"]
}
# Something was said that looks so.
proc checkers::incidents::Heard pattern {
    variable Spoken
    return [lsearch -inline -glob $Spoken $pattern]
}
proc checkers::incidents::heard pattern {
    until "something like \"$pattern\" is said" {[Heard $pattern] ne {}}
    return [Heard $pattern]
}

# ---- the person's tokens ----

# The game as the robot has it.
proc checkers::incidents::Learn {} {
    set state [dict get [checkers@player exec state] text]
    draughts.incidents exec -text [dict get $state pdn] pdn
}
# A legal move of the person, at once; then the robot has answered, and waits again.
proc checkers::incidents::go {} {
    Learn
    set move [lindex [dict get [draughts.incidents exec legal] text] 0]
    lassign [Path $move] stops victims
    set places [lmap square $stops {::checkers::tokens place 8 $square}]
    drycarry.incidents exec -floats [concat [lindex $places 0] 0 [lindex $places end] 0]
    foreach square $victims {
        simlab@lab CTRL -steal [At {*}[::checkers::tokens place 8 $square]]
    }
}
proc checkers::incidents::Path move {
    set came [dict get [draughts.incidents exec path $move] ints]
    return [list [lrange $came 1 [lindex $came 0]] [lrange $came [lindex $came 0]+1 end]]
}
proc checkers::incidents::At {file rank} {
    foreach token [::checkers::tokens seen [simlab@lab exec tokens]] {
        lassign $token name f r
        if {abs($f - $file) < 0.3 && abs($r - $rank) < 0.3} {
            return $name
        }
    }
}
proc checkers::incidents::answered {} {
    variable Told
    until "the robot has played" {[lsearch -glob $Told "*state played*"] >= 0}
    until "it waits for the person" {[dict get [lindex $Told end] state] in {person ponder}}
    # The judge's own line from the robot may be slower than ours.
    set look [judge@judge exec -text [lindex $Told end] look]
    if {[lindex [dict get $look ints] 0] > 0} {
        return -code error -errorcode {CHECKERS INCIDENT} "the tokens do not lie as the game says: [dict get $look text]"
    }
}

# ---- what happens ----

proc checkers::incidents::never {} {
    return [heard "It is your turn."]
}
proc checkers::incidents::covered {} {
    simlab@lab CTRL -occluder 0.615 0 0.47
    set said [heard "*"]
    simlab@lab CTRL -occluder away
    go
    answered
    return $said
}
proc checkers::incidents::many {} {
    set added {}
    foreach {colour file rank} {yellow 1 5 yellow 3 5 yellow 5 5 yellow 7 5 red 2 4 red 4 4 red 6 4 red 8 4 yellow 2 6} {
        if {[At $file $rank] eq {}} {
            lappend added [lindex [simlab@lab CTRL -add $colour $file $rank] 3]
        }
    }
    set said [heard "*come to*"]
    foreach name $added {
        simlab@lab CTRL -steal $name
    }
    go
    answered
    return "$said ([expr {16 + [llength $added]}] tokens)"
}
# The arm is pushed when it carries.
proc checkers::incidents::touched {} {
    dict set ::checkers::incidents::Then carry { after 400 {simlab@lab CTRL -push 0 100 0 0.3} }
    go
    set said [heard "Something has touched my arm*"]
    answered
    return $said
}
# A token of the person's is moved while the robot carries.
proc checkers::incidents::moved {} {
    dict set ::checkers::incidents::Then carry {drycarry.incidents exec -floats {7 1 0 8 5 0}}
    go
    set said [heard "The board is not as it should be*"]
    drycarry.incidents exec -floats {8 5 0 7 1 0}
    answered
    return $said
}
# The laboratory is killed while the arm carries: no token is where it was until the person has set them out.
proc checkers::incidents::killed {} {
    dict set ::checkers::incidents::Then carry { after 400 {checkers::session::kill lab} }
    go
    until "the laboratory is new" {$::checkers::session::Forgotten}
    until "the tokens have been set out" {!$::checkers::session::Forgotten}
    answered
    return [lindex $::checkers::incidents::Spoken end]
}
# The laser points at a token on a wrong field. A picture with this field in its middle must have the spot in the middle.
proc checkers::incidents::laser {} {
    set name [At 1 1]
    lassign [lsearch -inline -index 0 [::checkers::tokens seen [simlab@lab exec tokens]] $name] - - - x y z
    laser@laser CTRL -blinks 0
    simlab@lab CTRL -steal $name
    until "the laser is on" {[lindex [dict get [laser@laser exec status] floats] 0] == 1}
    simlab@lab exec -floats 0.05 step
    set lit [View $x $y]
    set seen [dict get [simlab@lab exec camera] any]
    laser@laser EXEC off
    simlab@lab exec -floats 0.05 step
    set off [Spot $lit [View $x $y]]
    set camera [Spot $seen [dict get [simlab@lab exec camera] any]]
    simlab@lab CTRL -move $name 1 1
    lassign $off dx dy pixels
    if {$pixels == 0 || hypot($dx, $dy) > 4} {
        return -code error -errorcode {CHECKERS INCIDENT} "the spot is $off pixels from the middle of the picture"
    }
    go
    answered
    return [format "the spot is %.1f %.1f pixels from the middle of the field, %d pixels large; in the camera's picture %d" $dx $dy $pixels [lindex $camera 2]]
}
# From the side, since the arm is above.
proc checkers::incidents::View {x y} {
    return [dict get [simlab@lab exec -floats [list 200 -40 0.35 $x $y 0] view] any]
}
# Where two pictures (PPM) differ: the middle of what is redder in the first, from the picture's middle, and how many pixels.
proc checkers::incidents::Spot {a b} {
    lassign [Pixels $a] width height first
    lassign [Pixels $b] - - second
    set n [set sx [set sy 0]]
    for {set i 0} {$i < [llength $first]} {incr i 3} {
        if {[lindex $first $i] - [lindex $second $i] > 60} {
            incr n
            incr sx [expr {$i / 3 % $width}]
            incr sy [expr {$i / 3 / $width}]
        }
    }
    return [list [expr {$n ? double($sx) / $n - ($width - 1) / 2.0 : 0}] [expr {$n ? double($sy) / $n - ($height - 1) / 2.0 : 0}] $n]
}
proc checkers::incidents::Pixels picture {
    regexp -indices {^P6\s+(\d+)\s+(\d+)\s+\d+\s} $picture head width height
    binary scan [string range $picture [lindex $head 1]+1 end] cu* bytes
    return [list [string range $picture {*}$width] [string range $picture {*}$height] $bytes]
}

proc checkers::incidents::run given {
    variable Position
    variable Told
    variable Spoken
    dict with given {}
    set folder [expr {${-folder} eq {} ? [file join [pwd] checkersIncidents] : ${-folder}}]
    file delete [file join $folder checkers.game] [file join $folder human.game]
    set settings [dict merge [checkers::session::settings [list -position $Position -look 10 -remind 40 -show 15000] {-level 1} 0] [dict create human.sim [list -position $Position -mouse 1]]]
    try {
        checkers::session::begin $folder $settings ${-speed}
        set ::checkers::session::Watch checkers::incidents::Watch
        sorma::subscribe checkers@player -event said -queue 10000 -command checkers::incidents::Said
        checkers::session::ready
        judge@judge exec begin
        drycarry.incidents configure -lab simlab@lab
        draughts.incidents configure -variant braz -colours yr
        sorma::async -timeout 0 checkers@player exec play
        until "the game begins" {[dict exists [dict get [checkers@player exec state] text] position]}
        foreach name ${-only} {
            set Told [list [dict get [checkers@player exec state] text]]
            set Spoken {}
            measure row $name -error {} -body $name
        }
    } finally {
        checkers::session::end
    }
}

if {[file normalize $argv0] eq [file normalize [info script]]} {
    exit [measure run {-speed {any 0} -folder any -only {any {never covered many laser touched moved killed}}} {-only touched} $argv checkers::incidents::run]
}
