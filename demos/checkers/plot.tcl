# plot.tcl -- checkers: the game as a service object. Who plays is player.tcl, with the parts that the options name; what happens is told
# by events, and kept in a file.
#
#     checkers EXEC play              until the game is over; a game that was interrupted goes on
#     checkers CTRL -new              give up this game, and begin another one

package require sorma
package require sorma::service::draughts
package require checkers::player

oo::class create ::sorma::service::checkers {
    superclass sorma::Service
    sorma::purpose "plays draughts against a person, with arm, hand, eye and voice"
    sorma::option -variant enum -choices {braz engl intl} -default braz -help "of a new game"
    sorma::option -robot enum -choices {black white} -default black -help "what the robot plays"
    sorma::option -position string -default {} -help "FEN with which a new game begins; empty: as usual"
    sorma::option -file string -kind file -default {} -help "where the game is kept; empty: nowhere"
    sorma::option -still int -range {1 99} -default 3 -help "so many equal looks are believed"
    sorma::option -look int -unit ms -range {0 10000} -default 100 -help "between two looks"
    sorma::option -patience int -range {1 1000} -default 10 -help "what is wrong so often in a row is told"
    sorma::option -carry service -default porter -help "carries tokens (class porter)"
    sorma::option -sight service -default sight -help "sees the board (class sight)"
    sorma::option -board service -help "says whether the board has been moved (class sight); none: nobody"
    sorma::option -game service -default draughts.game -help "keeps the game (class draughts, in this process)"
    sorma::option -engine service -default draughts.engine -help "finds the robot's moves (class draughts)"
    sorma::option -speaker service -help "says what happens (class speaker); none: nobody"
    sorma::words "play|state"
    sorma::conduct concurrent
    sorma::action -new {} "give up this game and begin another one" {my Order new} -right call
    sorma::action -resign {} "the person gives up" {my Order resign} -right call
    sorma::writes text * "" "play: the result; state: a dict, as event plot tells it"
    sorma::example "checkers EXEC state"

    variable Game Player    ;# objects; empty: none
    variable State          ;# dict: state, what the last event of the plot has told
    variable Waiting        ;# coroutines that wait for the result

    method born {} {
        set Game [set Player {}]
        set State {state idle}
        set Waiting {}
    }

    method exec message {
        switch [dict get $message words] {
            play {
                if {[dict exists $State result]} {
                    return [my Result]
                }
                if {$Player eq {}} {
                    return [my Play]
                }
                lappend Waiting [info coroutine]
                yield
                return [my Result]
            }
            state { return [dict create text $State] }
        }
        sorma::fail [list CHECKERS WORD] "[my name]: bad word \"[dict get $message words]\": must be play, or state"
    }
    method dump {} {
        return [join [lmap {key value} $State {string cat $key { } $value}] \n]
    }

    method Play {} {
        set Game [::checkers::game new [my cget -game] [my cget -file]]
        set Player [::checkers::player new $Game -robot [my cget -robot] -still [my cget -still] -look [my cget -look] -patience [my cget -patience] \
            -carry [my cget -carry] -sight [my cget -sight] -engine [my cget -engine] -board [expr {[my cget -board] eq {} ? {} : [namespace code {my Moved}]}] \
            -say [namespace code {my Say}] -watch [namespace code {my Watch}]]
        [my cget -game] configure -colours yr
        try {
            if {![$Game resume] || [$Game over]} {
                my Begin
            }
            while 1 {
                try {
                    set result [$Player play]
                    break
                } trap {CHECKERS ORDER new} {} {
                    my Begin
                } trap {CHECKERS ORDER resign} {} {
                    set result [expr {[my cget -robot] eq "black" ? "0-1" : "1-0"}]
                    my Say "You resign. Thank you for the game."
                    my Watch over [list result $result reason "the person has resigned"]
                    break
                }
            }
            $Game forget
            return [my Result]
        } finally {
            $Player destroy
            $Game destroy
            set Game [set Player {}]
            foreach one $Waiting {
                after 0 $one
            }
            set Waiting {}
        }
    }
    method Result {} {
        return [dict create text [dict get $State result]]
    }
    method Begin {} {
        [my cget -game] configure -variant [my cget -variant]
        $Game begin [my cget -position] [::checkers::tokens spares [$Game width]]
        my Watch begin {}
        my Say "A new game. [expr {[$Game side] eq [my cget -robot] ? "I begin." : "It is your turn."}]"
    }
    method Order word {
        if {$Player ne {}} {
            $Player order $word
        } else {
            set State {state idle}
        }
    }

    # What the player tells.
    method Watch {what facts} {
        set State [dict merge [list state $what position [$Game position] pdn [$Game pdn] side [$Game side]] $facts]
        my publish plot -text $State
    }
    method Say text {
        my publish said -text $text [dict get $State state]
        if {[my cget -speaker] ne {}} {
            sorma::async -command [list ::checkers::spoken] [my cget -speaker] exec -text $text
        }
    }
    method Moved {} {
        return [lindex [dict get [[my cget -board] exec board] floats] 0]
    }
}

# No voice, no harm: what is said is in the event, too.
proc ::checkers::spoken future {
    catch {$future result}
    $future destroy
}

package provide sorma::service::checkers 1.0
