# window.tcl -- the game in a window: the board as the game has it, the board as the camera sees it, its picture, what is said, the moves,
# the plot, the daemons. Nothing in it waits: all requests are asynchronous.
#
#     checkersWindow::build -mouse 0

package require Tk
package require sorma::image
package require sorma::style
source [file join [file dirname [file normalize [info script]]] packages.tcl]
package require checkers::tokens
package require checkers::boardview

namespace eval checkersWindow {
    variable Plot {person "the person's turn" validate "a move is accepted" think "the robot thinks" answer "the robot has decided" carry "the arm carries"
        carried "the arm carries" verify "the eye looks" trouble "something is wrong" over "the game is over" begin "a new game" idle "no game" shifted "the board was moved"
        thought "the robot thinks" played "the robot has moved"}
    variable Daemons {player eye robot hand transform voice lab human}
    variable State idle
    variable Clock {white 0 black 0}    ;# [s] that each side has thought, and moved
    variable Side {}                    ;# whose clock runs
    variable Thoughts {}
    variable Speed 1
    variable Voice 0
}

proc checkersWindow::send {name args} {
    sorma::async -timeout 0 -command [list checkersWindow::Answered $name] $name {*}$args
}
# What fails is shown with what is said.
proc checkersWindow::Answered {name future} {
    if {[catch {$future result} text] && [winfo exists .said]} {
        Write .said "$text\n" wrong
    }
    $future destroy
}

proc checkersWindow::build {mouse width} {
    wm title . "Draughts with a robot"
    if {[ttk::style theme use] eq "default"} {
        ttk::style theme use clam
    }
    set back [ttk::style lookup TFrame -background]
    . configure -background $back
    set gap [sorma::style pixels 6]
    set size [sorma::style pixels 400]
    pack [ttk::frame .f -padding $gap] -fill both -expand 1
    ttk::label .title -textvariable ::checkersWindow::Head -font TkHeadingFont
    foreach {w text} {game "The game" eye "What the eye sees, and how certain"} {
        ttk::labelframe .$w -text $text
    }
    checkers::boardview create gameBoard .game.board -width $width -size $size {*}[if {$mouse} {list -drop checkersWindow::Drop}]
    checkers::boardview create eyeBoard .eye.board -width $width -size $size
    pack .game.board .eye.board -fill both -expand 1
    ttk::labelframe .camera -text "The camera in the hand"
    sorma::image .camera.picture -name getbrdsit@eye -request {EXEC debug} -every 1000 -width 500 -height 500
    pack .camera.picture -fill both -expand 1

    ttk::labelframe .moves -text "Moves"
    foreach {option element} {background -fieldbackground foreground -foreground} {
        set colour [ttk::style lookup TEntry $element]
        if {$colour ne {}} {
            option add *Text.$option $colour
        }
    }
    text .moves.text -width 24 -height 9 -wrap word -state disabled -takefocus 0
    pack .moves.text -fill both -expand 1
    ttk::labelframe .talk -text "What is said"
    text .said -width 50 -height 9 -wrap word -state disabled -takefocus 0
    .said tag configure wrong -foreground #d04030
    .said tag configure thought -foreground #808890
    pack .said -in .talk -fill both -expand 1
    Settings $gap
    Lamps
    # The emergency stop stands above all else.
    button .stop -text "EMERGENCY STOP" -background #c03028 -activebackground #e04038 -foreground white -activeforeground white -font TkHeadingFont \
        -pady 10 -command {checkersWindow::send simlab@lab CTRL -emergencyStop} -takefocus 1
    grid .stop -in .f -row 0 -column 2 -sticky ew -padx $gap
    grid .title -in .f -row 0 -column 0 -columnspan 2 -sticky w
    grid .game -in .f -row 1 -column 0 -sticky nsew -padx $gap -pady $gap
    grid .eye -in .f -row 1 -column 1 -sticky nsew -padx $gap -pady $gap
    grid .camera -in .f -row 1 -column 2 -sticky nsew -padx $gap -pady $gap
    grid .moves -in .f -row 2 -column 0 -sticky nsew -padx $gap
    grid .talk -in .f -row 2 -column 1 -sticky nsew -padx $gap
    grid .settings -in .f -row 2 -column 2 -sticky nsew -padx $gap
    grid .lamps -in .f -row 3 -column 0 -columnspan 3 -sticky ew -pady $gap -padx $gap
    grid columnconfigure .f {0 1} -weight 2
    grid columnconfigure .f 2 -weight 1
    grid rowconfigure .f 1 -weight 1
    bind . <Escape> {.stop invoke}
    bind . <Control-n> {.settings.new invoke}
    bind . <Control-r> {.settings.resign invoke}
    sorma::subscribe sight@player -event seen -latest -command checkersWindow::Seen
    sorma::subscribe checkers@player -event said -queue 1000 -command checkersWindow::Said
    Tick
    update idletasks
    wm minsize . [winfo reqwidth .stop] [winfo reqheight .stop]
}

proc checkersWindow::Settings gap {
    ttk::labelframe .settings -text "Settings"
    ttk::button .settings.new -text "New game (Ctrl-N)" -command checkersWindow::New
    ttk::button .settings.resign -text "Resign (Ctrl-R)" -command {checkersWindow::send checkers@player CTRL -resign}
    ttk::button .settings.reset -text "Power: reset" -command {checkersWindow::send simlab@lab CTRL -reset}
    ttk::label .settings.tlevel -text "Level"
    ttk::spinbox .settings.level -from 1 -to 10 -width 4 -command {checkersWindow::send draughts.engine@player CTRL -level [.settings.level get]}
    .settings.level set 5
    ttk::label .settings.tspeed -text "Speed (0: all it can)"
    ttk::spinbox .settings.speed -from 0 -to 20 -width 4 -textvariable ::checkersWindow::Speed \
        -command {checkersWindow::send simlab@lab CTRL -speed $::checkersWindow::Speed}
    ttk::checkbutton .settings.voice -text "Speak aloud" -variable ::checkersWindow::Voice \
        -command {checkersWindow::send speaker@voice CTRL -output [expr {$::checkersWindow::Voice ? "sound" : "log"}]}
    grid .settings.new .settings.resign -sticky ew -padx 2 -pady 2
    grid .settings.reset .settings.voice -sticky ew -padx 2 -pady 2
    grid .settings.tlevel .settings.level -sticky w -padx 2 -pady 2
    grid .settings.tspeed .settings.speed -sticky w -padx 2 -pady 2
    grid columnconfigure .settings {0 1} -weight 1
    grid [ttk::label .settings.thoughts -textvariable ::checkersWindow::Thoughts -wraplength [sorma::style pixels 320]] -columnspan 2 -sticky w -pady $gap
}

# Both give up their game, and begin another one.
proc checkersWindow::New {} {
    foreach name {human.sim@human checkers@player} {
        send $name CTRL -new
        send $name EXEC play
    }
}

# ---- daemons ----

proc checkersWindow::Lamps {} {
    variable Daemons
    ttk::frame .lamps
    foreach name $Daemons {
        canvas .lamps.c$name -width 14 -height 14 -highlightthickness 0 -background [ttk::style lookup TFrame -background]
        .lamps.c$name create oval 2 2 12 12 -fill #909090 -outline #505050 -tags lamp
        pack .lamps.c$name [ttk::label .lamps.l$name -text "$name  "] -side left
    }
}
proc checkersWindow::Tick {} {
    variable Daemons
    variable Clock
    variable Side
    if {![winfo exists .lamps]} {
        return
    }
    set states {}
    foreach d [sorma::daemons] {
        dict set states [dict get $d name] [dict get $d state]
    }
    foreach name $Daemons {
        set state [expr {[dict exists $states $name] ? [dict get $states $name] : "gone"}]
        .lamps.c$name itemconfigure lamp -fill [switch $state {alive {string cat #38b048} busy {string cat #e0b030} default {string cat #d03020}}]
    }
    if {$Side ne {}} {
        dict incr Clock $Side
    }
    Head
    after 1000 checkersWindow::Tick
}
proc checkersWindow::Head {} {
    variable Clock
    variable State
    variable Plot
    variable Head
    set Head "[expr {[dict exists $Plot $State] ? [dict get $Plot $State] : $State}]      White (person) [Minutes [dict get $Clock white]]      Black (robot) [Minutes [dict get $Clock black]]"
}
proc checkersWindow::Minutes seconds {
    return [format %d:%02d [expr {$seconds / 60}] [expr {$seconds % 60}]]
}

# ---- what is told ----

# The plot: a dict with state, position, pdn.
proc checkersWindow::plot told {
    variable State
    variable Side
    variable Clock
    variable Lies
    variable Thoughts
    if {![winfo exists .moves]} {
        return
    }
    set State [dict get $told state]
    set Side [expr {$State eq "over" ? {} : [dict get $told side]}]
    set width [::checkers::tokens width [dict get $told pdn]]
    switch $State {
        begin { set Clock {white 0 black 0} }
        thought { set Thoughts "I think: [dict get $told move], [format %+.1f [dict get $told score]] men, [format %.1f [dict get $told seconds]] s" }
        carry {
            lassign [dict get $told transfer] file rank - toFile toRank
            gameBoard travel [list $file $rank] [list $toFile $toRank]
        }
        carried {
            catch {set Lies [::checkers::tokens after $Lies [dict get $told transfer]]}
            gameBoard lie $Lies
        }
    }
    if {$State in {begin person validate think answer played over trouble} && ($State ne "trouble" || ![info exists Lies])} {
        set Lies [::checkers::tokens lie $width [dict get $told position]]
        gameBoard lie $Lies
    }
    .moves.text configure -state normal
    .moves.text delete 1.0 end
    .moves.text insert end [string trim [lindex [split [string map [list \n\n \x01] [dict get $told pdn]] \x01] 1]]
    .moves.text see end
    .moves.text configure -state disabled
    Head
}
proc checkersWindow::Said event {
    if {[dict get $event event] eq "said" && [winfo exists .said]} {
        Write .said "[dict get $event text]\n"
    }
}
proc checkersWindow::Write {w text {tag {}}} {
    $w configure -state normal
    $w insert end $text $tag
    $w see end
    $w configure -state disabled
}
proc checkersWindow::Seen event {
    if {[dict get $event event] ne "seen" || ![winfo exists .eye.board]} {
        return
    }
    set seen [dict get $event text]
    set width [expr {round(sqrt([string length $seen]))}]
    set lies {}
    for {set i 0} {$i < [string length $seen]} {incr i} {
        set colour [dict get {. {} r red y yellow ? {}} [string index $seen $i]]
        if {$colour ne {}} {
            dict set lies [list [expr {$i % $width + 1}] [expr {$width - $i / $width}]] $colour
        }
    }
    eyeBoard lie $lies
    eyeBoard certain [dict get $event floats]
}

# ---- a person with a mouse: his hand moves the token ----

proc checkersWindow::Drop {from to} {
    variable Lies
    set colour [lindex [dict get $Lies $from] 0]
    lassign $to file rank
    set width 8
    if {$file < 1 || $file > $width || $rank < 1 || $rank > $width} {
        set to [lrange [::checkers::tokens heap $width $Lies $colour [llength [dict get $Lies $from]]] 0 1]
    }
    set above [expr {[dict exists $Lies $to] ? [llength [dict get $Lies $to]] : 0}]
    set transfer [list {*}$from 0 {*}$to $above]
    set Lies [::checkers::tokens after $Lies $transfer]
    gameBoard lie $Lies
    send humanhand@human EXEC FMSG 6 {*}$transfer
}
