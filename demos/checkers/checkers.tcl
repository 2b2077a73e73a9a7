# checkers.tcl -- a game of the robot against a person, in the laboratory.
#
#     ./bootstrap run checkers        the daemons end with it; exit code 0: the game was ended by the rules
#
# -speed N: of lab time, 0 is as fast as the machine can; default: 1 with a window, else 0. -variant braz|engl. -level N: the robot's.
# -personLevel N, -faults F, -seed N: of the person. -human mouse: you play, in the window. -go: go on with the game that was interrupted.
# -folder F: where its files are. -position FEN: it begins so. -once: it ends with the game, even when there is a window.

source [file join [file dirname [file normalize [info script]]] session.tcl]
package require sorma::options

namespace eval checkersGame {}

proc checkersGame::Show {windows told} {
    if {$windows} {
        checkersWindow::plot $told
    }
    switch [dict get $told state] {
        validate - answer {
            puts "[dict get $told state] [dict get $told move]"
        }
    }
}

proc checkersGame::folder {} {
    set base [expr {[info exists ::env(XDG_STATE_HOME)] ? $::env(XDG_STATE_HOME) : [file join $::env(HOME) .local state]}]
    return [file join $base sorma checkers]
}

proc checkersGame::run {} {
    set o [sorma::options::parse {-speed any -variant {{choice braz engl} braz} -level {any 5} -personLevel {any 3} -faults {any 0} -seed {any 1}
        -human {{choice sim mouse} sim} -go flag -folder any -position any -once flag} $::argv]
    dict with o {}
    fconfigure stdout -buffering line
    set windows [expr {[info exists ::env(DISPLAY)] && ![catch {package require Tk}]}]
    set folder [expr {${-folder} eq {} ? [folder] : ${-folder}}]
    set go [expr {${-go} && [file exists [file join $folder checkers.game]]}]
    if {$go} {
        session::remember $folder
    } else {
        file delete [file join $folder checkers.game] [file join $folder human.game]
    }
    set speed [expr {${-speed} ne {} ? ${-speed} : $windows}]
    set settings [dict create \
        checkers [list -variant ${-variant} -position ${-position} -look [expr {$speed == 0 ? 10 : 100}]] \
        draughts.engine [list -level ${-level}] \
        human.sim [list -variant ${-variant} -position ${-position} -level ${-personLevel} -faults ${-faults} -seed ${-seed} -mouse [expr {${-human} eq "mouse"}]]]
    try {
        session::begin $folder $settings $speed
        if {$go} {
            # A simulated laboratory begins as for a new game.
            $::session::Human CTRL -setOut
        }
        if {$windows} {
            uplevel #0 [list source [file join $::session::Here window.tcl]]
            set ::checkersWindow::Speed $speed
            checkersWindow::build [expr {${-human} eq "mouse"}] 8
        } else {
            puts "no display: the window is left out"
        }
        set ::session::Watch [list checkersGame::Show $windows]
        # The plot may have begun before somebody watched.
        set now [dict get [$::session::Checkers exec state] text]
        if {[dict exists $now position]} {
            Show $windows $now
        }
        set figures [session::play]
        dict for {name value} $figures {
            puts "$name [join $value]"
        }
        if {$windows && !${-once}} {
            puts "The window is yours; close it to end."
            tkwait window .
        }
        return [expr {[lindex [dict get $figures result] 0] ni {1-0 0-1 1/2-1/2} || [lindex [dict get $figures wrong_readings_accepted] 0] > 0}]
    } finally {
        session::end
    }
}

if {[file normalize $argv0] eq [file normalize [info script]]} {
    exit [checkersGame::run]
}
