# checkers.tcl -- a game of the robot against a person, in the laboratory.
#
#     ./bootstrap run checkers        the daemons end with it; exit code 0: the game was ended by the rules
#
# -speed N               of lab time, 0 is as fast as the machine can; default: 1 with a window, else 0
# -variant V             braz, engl or intl
# -level N               the robot's
# -robot black|white     its colour
# -dry                   without arm, hand and eye
# -tidy S                after S seconds it puts a wrong board in order
# -personLevel N, -faults F, -seed N    of the person
# -human mouse           you play, in the window
# -go                    go on with the game that was interrupted
# -folder F              of its files
# -position FEN          it begins so; seen: with the tokens on the board
# -once                  it ends with the game, even when there is a window
# -limit S               time of each side; a side without time loses

source [file join [file dirname [file normalize [info script]]] session.tcl]
package require sorma::options

namespace eval checkers::program {}

proc checkers::program::Show {windows told} {
    if {$windows} {
        checkers::window::plot $told
    }
    switch [dict get $told state] {
        validate - answer {
            puts "[dict get $told state] [dict get $told move]"
        }
    }
}

proc checkers::program::folder {} {
    set base [expr {[info exists ::env(XDG_STATE_HOME)] ? $::env(XDG_STATE_HOME) : [file join $::env(HOME) .local state]}]
    return [file join $base sorma checkers]
}

# Begin with these options: the daemons, and the game that was interrupted or a new one. Files of an earlier game are removed.
proc checkers::program::Begin {o folder go windows} {
    dict with o {}
    if {$go} {
        checkers::session::remember $folder
    } else {
        file delete [file join $folder checkers.game] [file join $folder human.game]
    }
    # A simulated person sets out the tokens as usual before the robot looks at them.
    set begin [expr {${-position} eq "seen" ? {} : ${-position}}]
    set settings [dict merge [checkers::session::settings [list -variant ${-variant} -robot ${-robot} -tidy ${-tidy} -position ${-position} -limit ${-limit} \
        -look [expr {${-speed} == 0 ? 10 : 100}]] [list -level ${-level}] ${-dry}] [dict create human.sim [list -variant ${-variant} -position $begin \
        -colour [expr {${-robot} eq "black" ? "white" : "black"}] -level ${-personLevel} -faults ${-faults} -seed ${-seed} -mouse [expr {${-human} eq "mouse"}]]]]
    checkers::session::begin $folder $settings ${-speed} -intl [expr {${-variant} eq "intl"}] -dry ${-dry}
    if {$go} {
        # A simulated laboratory begins as for a new game.
        checkers::session::ready
        human.sim@human CTRL -setOut
    }
    if {$windows} {
        checkers::window::begin
    }
    set ::checkers::session::Watch [list checkers::program::Show $windows]
    # The plot may have begun before somebody watched.
    set now [dict get [checkers@player exec state] text]
    if {[dict exists $now position]} {
        Show $windows $now
    }
    # The robot may move first.
    checkers::session::ready
}

# Has the robot believed what is not so? Against a simulated person also: has it lost a token, or has he put all tokens where they belong?
proc checkers::program::Failed {figures simulated} {
    set names [list wrong_readings_accepted {*}[expr {$simulated ? {tokens_lost_unnoticed put_in_order} : {}}]]
    return [expr {[tcl::mathop::+ {*}[lmap name $names {lindex [dict get $figures $name] 0}]] > 0}]
}

# The window asks for another game with these options, with other daemons or with the same.
proc checkers::program::Restart chosen {
    variable Wants $chosen
    checkers::session::interrupt
}
proc checkers::program::Again {} {
    variable Playing
    if {!$Playing} {
        variable Wants again
    }
}
proc checkers::program::Closed window {
    if {$window eq "."} {
        variable Wants end
        checkers::session::interrupt
    }
}

proc checkers::program::run {} {
    variable Wants
    variable Playing
    set o [sorma::options::parse {-speed any -variant {{choice braz engl intl} braz} -level {any 5} -personLevel {any 3} -faults {any 0} -seed {any 1}
        -human {{choice sim mouse} sim} -go flag -folder any -position any -once flag -dry flag -robot {{choice black white} black} -tidy {any 60}
        -most {any 0} -limit {{whole 0 100000} 0}} $::argv]
    fconfigure stdout -buffering line
    set windows [expr {[info exists ::env(DISPLAY)] && ![catch {package require Tk}]}]
    if {[dict get $o -speed] eq {}} {
        dict set o -speed $windows
    }
    set folder [expr {[dict get $o -folder] eq {} ? [folder] : [dict get $o -folder]}]
    set file [file join $folder checkers.game]
    set go [expr {[dict get $o -go] && [file exists $file]}]
    if {$go} {
        # The rules, and so the size of the board, are those of the game.
        dict set o -variant [dict get [fileutil::cat -encoding utf-8 $file] variant]
    }
    if {$windows} {
        uplevel #0 [list source [file join $::checkers::session::Here window.tcl]]
        checkers::window::build [dict merge [dict filter $o script {option -} {expr {$option in {-variant -dry -limit}}}] [list -mouse [expr {[dict get $o -human] eq "mouse"}] \
            -restart checkers::program::Restart -again checkers::program::Again]]
        bind . <Destroy> {+checkers::program::Closed %W}
    } else {
        puts "no display: the window is left out, the moves are printed"
    }
    set code 0
    set Wants {}
    set Playing 1
    try {
        Begin $o $folder $go $windows
        while 1 {
            if {$Wants eq {}} {
                set figures [checkers::session::play [dict get $o -most]]
            }
            set Playing 0
            if {$Wants eq {}} {
                dict for {name value} $figures {
                    puts "$name [join $value]"
                }
                set code [expr {[lindex [dict get $figures result] 0] ni {1-0 0-1 1/2-1/2} || [Failed $figures [expr {[dict get $o -human] eq "sim"}]]}]
                if {!$windows || [dict get $o -once]} {
                    return $code
                }
                puts "The window is yours; close it to end."
                vwait ::checkers::program::Wants
            }
            set wants $Wants
            set Playing 1
            set Wants {}
            switch $wants {
                end { return $code }
                again {}
                default {
                    checkers::session::end
                    set o [dict merge $o [dict remove $wants -mouse] [list -position {} -human [expr {[dict get $wants -mouse] ? "mouse" : "sim"}]]]
                    Begin $o $folder 0 $windows
                }
            }
        }
    } finally {
        checkers::session::end
    }
}

if {[file normalize $argv0] eq [file normalize [info script]]} {
    exit [checkers::program::run]
}
