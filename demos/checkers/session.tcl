# session.tcl -- the daemons of checkers.launch, and games in them that are watched and counted.
#
#     session::begin FOLDER SETTINGS SPEED        files of the game and its daemons are in the folder
#     session::play                               until the game is over; a dict of figures
#     session::end

package require sorma
foreach file {lab/lab lab/colours checkers/packages} {
    source [file join [file dirname [file dirname [file normalize [info script]]]] $file.tcl]
}
package require checkers::tokens

namespace eval session {
    variable Here [file dirname [file normalize [info script]]]
    variable Lab simlab@lab
    variable Checkers checkers@player
    variable Human human.sim@human
    variable Sight sight@player
    variable Launch {}          ;# pipe of the launcher
    variable Watch {}           ;# command that gets what the plot tells: a dict
    variable Wrong 0            ;# readings that were believed and are not so
    variable Lost 0             ;# carries after which tokens lay elsewhere than the robot believes
    variable Counts {}          ;# state of the plot -> how often it was entered, in this game
    variable Faults 0           ;# of the person
    variable Named 0            ;# those of which he was told
}

# ::session::settle FOLDER SETTINGS -- a folder with a table of colours, and what the daemons read: dict, object -> options.
proc session::settle {folder settings} {
    file mkdir $folder
    cd $folder
    if {![file exists board.hsv]} {
        colours::learn board.hsv
    }
    set out [open settings w]
    puts $out $settings
    close $out
}

proc session::begin {folder settings speed} {
    variable Here
    variable Lab
    variable Launch
    variable Checkers
    variable Human
    settle $folder $settings
    set Launch [lab::start sorma-launch [file join $Here checkers.launch]]
    lab::untilSignal $Launch
    vwait ::lab::Heard
    if {$::lab::Heard ne "ready"} {
        return -code error -errorcode {CHECKERS LAUNCH} "the daemons of checkers.launch could not be started; what they said stands above"
    }
    $Lab CTRL -speed $speed
    sorma::subscribe $Checkers -event plot -queue 10000 -command session::Plot
    sorma::subscribe $Checkers -event said -queue 10000 -command session::Said
    sorma::subscribe $Human -event person -queue 10000 -command session::Person
}
# Another game with the same daemons.
proc session::again settings {
    variable Human
    variable Checkers
    variable Sight
    settle [pwd] $settings
    $Human configure {*}[dict get $settings human.sim]
    $Human CTRL -new
    $Checkers CTRL -new
    # The person waits as long as the arm is low over the board.
    catch {$Sight exec}
    Until idle
    sorma::async -timeout 0 -command session::Played $Human exec play
    ready
}
proc session::Played future {
    if {[catch {$future result} text how] && [lindex [dict get $how -errorcode] 1] ne "COMM"} {
        puts stderr "the person does not play: $text"
    }
    $future destroy
}
# Until the person has set out the tokens. Before that nobody else may move any, nor the board.
proc session::ready {} {
    Until play
}
# His daemon may be killed, and be back soon.
proc session::Until state {
    variable Human
    set end [expr {[clock milliseconds] + 120000}]
    while {[catch {dict get [$Human exec state] text} is] || $is ne $state} {
        if {[clock milliseconds] > $end} {
            return -code error -errorcode {CHECKERS PERSON} "the person should be in state $state, and for two minutes it was: $is"
        }
        after 50 {set ::session::Tick 1}
        vwait ::session::Tick
    }
}
# Before begin: the person remembers the game as the robot does.
proc session::remember folder {
    set in [open [file join $folder checkers.game]]
    set kept [read $in]
    close $in
    set out [open [file join $folder human.game] w]
    puts $out [dict replace $kept intended {}]
    close $out
}
proc session::end {} {
    variable Launch
    lab::finish $Launch
}

# ---- one game ----

# Until it is over, whatever happens to the player's daemon. The figures: dict of name -> {value unit}.
proc session::play {} {
    variable Checkers
    variable Wrong 0
    variable Lost 0
    variable Faults 0
    variable Named 0
    variable Counts {}
    set begun [clock milliseconds]
    set labTime [labTime]
    while 1 {
        set call [sorma::async -timeout 0 -command {set ::session::Ended} $Checkers exec play]
        vwait ::session::Ended
        set failed [catch {$call result} came how]
        $call destroy
        if {!$failed} break
        if {[lindex [dict get $how -errorcode] 1] ne "COMM"} {
            return -options $how $came
        }
        after 500 {set ::session::Tick 1}
        vwait ::session::Tick
    }
    set wall [expr {([clock milliseconds] - $begun) / 1e3}]
    set lab [expr {[labTime] - $labTime}]
    lassign [lmap state {carried verify trouble shifted validate} {expr {[dict exists $Counts $state] ? [dict get $Counts $state] : 0}}] \
        carries looks troubles shifts moves
    return [dict create result [list [dict get $came text] {}] moves_of_the_person [list $moves 1] carries [list $carries 1] looks [list $looks 1] \
        troubles [list $troubles 1] board_moved [list $shifts 1] wrong_readings_accepted [list $Wrong 1] tokens_lost_unnoticed [list $Lost 1] \
        faults_of_the_person [list $Faults 1] faults_named [list $Named 1] \
        lab_time [list [format %.0f $lab] s] wall_time [list [format %.0f $wall] s] speed [list [format %.1f [expr {$lab / max(0.001, $wall)}]] 1]]
}
proc session::labTime {} {
    variable Lab
    regexp {# time (\S+) s} [lindex [$Lab CTRL -dump] 3] - time
    return $time
}

proc session::Plot event {
    variable Counts
    variable Watch
    variable Wrong
    variable Lost
    if {[dict get $event event] ne "plot"} {
        return
    }
    set told [dict get $event text]
    dict incr Counts [dict get $told state]
    # Then the person is quiet: the arm is over the board, or about to be.
    set width [::checkers::tokens width [dict get $told pdn]]
    switch [dict get $told state] {
        answer { incr Wrong [Differs $width [::checkers::tokens lie $width [dict get $told position]]] }
        carried { incr Lost [Differs $width [dict get $told lies]] }
    }
    if {$Watch ne {}} {
        {*}$Watch $told
    }
}
# Do the tokens on the board lie otherwise than they should? What is in the person's hand, high above the board, does not count.
proc session::Differs {width should} {
    variable Lab
    set is {}
    foreach line [lsort -real -index 5 [split [lindex [$Lab DBX -tokens] 3] \n]] {
        lassign $line name file rank - - z
        set place [list [expr {round($file)}] [expr {round($rank)}]]
        if {$file > 0.5 && $rank > 0.5 && $file < $width + 0.5 && $rank < $width + 0.5 && $z < 0.03} {
            dict lappend is $place [lindex [split $name _] 0]
        }
    }
    set should [dict filter $should script {place -} {expr {[lindex $place 0] >= 1 && [lindex $place 0] <= $width}}]
    if {[lsort -stride 2 $is] eq [lsort -stride 2 $should]} {
        return 0
    }
    foreach place [lsort -unique [concat [dict keys $is] [dict keys $should]]] {
        set a [expr {[dict exists $is $place] ? [dict get $is $place] : "nothing"}]
        set b [expr {[dict exists $should $place] ? [dict get $should $place] : "nothing"}]
        if {$a ne $b} {
            puts "    (at $place lies $a, the game says $b)"
        }
    }
    return 1
}
proc session::Said event {
    if {[dict get $event event] eq "said"} {
        puts "    \"[dict get $event text]\""
    }
}
proc session::Person event {
    variable Faults
    variable Named
    if {[dict get $event event] ne "person"} {
        return
    }
    set told [dict get $event text]
    switch [dict get $told state] {
        fault - harmless {
            incr Faults [expr {[dict get $told state] eq "fault"}]
            puts "    (the person: [dict get $told kind])"
        }
        told {
            incr Named [expr {[dict get $told text] ne {}}]
        }
    }
}
