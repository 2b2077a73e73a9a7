# plot.tcl -- checkers: the game as a service object. player.tcl plays, with the parts that the options name. The plot publishes
# events, and is kept in a file.
#
#     checkers EXEC play              until the game is over; a game that was interrupted goes on
#     checkers CTRL -new              give up this game, and begin another one
#     checkers CTRL -draw             the person offers a draw, or accepts one
#     checkers CTRL -sides            who played White plays Black
#     checkers CTRL -order            the robot puts the board in order
#     checkers CTRL -limit 600        of the next game: ten minutes for each side

package require sorma
package require sorma::service::draughts
package require checkers::player

oo::class create ::sorma::service::checkers {
    superclass sorma::Service
    sorma::purpose "plays draughts against a person, with arm, hand, eye and voice"
    sorma::option -variant enum -choices {braz engl intl} -default braz -help "of a new game"
    sorma::option -robot enum -choices {black white} -default black -help "what the robot plays"
    sorma::option -position string -default {} -help "FEN with which a new game begins; empty: as usual; seen: with what lies there"
    sorma::option -begins enum -choices {white black} -default white -help "who moves first when -position is seen"
    sorma::option -file string -kind file -default {} -help "where the game is kept; empty: nowhere"
    sorma::option -still int -range {1 99} -default 3 -help "so many equal looks are believed"
    sorma::option -look int -unit ms -range {0 10000} -default 100 -help "between two looks"
    sorma::option -patience int -range {1 1000} -default 10 -help "what is wrong so often in a row is told"
    sorma::option -carry service -default porter -help "carries tokens (class porter)"
    sorma::option -sight service -default boardsight -help "sees the board (class boardsight)"
    sorma::option -board service -help "says whether the board has been moved (class boardsight); none: nobody"
    sorma::option -game service -default draughts.game -help "keeps the game (class draughts, in this process)"
    sorma::option -engine service -default draughts.engine -help "finds the robot's moves (class draughts)"
    sorma::option -ponder string -default {} -help "thinks on the person's time (class draughts); empty: nobody"
    sorma::option -feel flag -default 0 -help "feel whether a man on the last row has been made a queen"
    sorma::option -drawAfter int -range {0 1000} -default 40 -help "moves of both sides before the robot agrees on a draw in a level game"
    sorma::option -tidy int -unit s -range {0 3600} -default 0 -help "after so long the robot puts a wrong board in order; 0: when it is asked to"
    sorma::option -remind int -unit s -range {0 3600} -default 60 -help "after so long what is still wrong is told again; 0: never"
    sorma::option -laser service -help "points at a field that is wrong (class laser); none: nobody"
    sorma::option -transform service -help "knows where fields are (class transform), for -laser; none: nobody"
    sorma::option -show int -unit ms -range {0 60000} -default 1500 -help "how long the laser points"
    sorma::option -limit int -unit s -range {0 100000} -default 0 -help "time of each side, of a new game: who has none left loses; 0: no limit"
    sorma::option -speaker service -help "says what happens (class speaker); none: nobody"
    sorma::words "play|state"
    sorma::concurrency concurrent
    sorma::action -new {} "give up this game and begin another one" {my Order new} -right call
    sorma::action -resign {} "the person gives up" {my Order resign} -right call
    sorma::action -draw {} "the person offers a draw, or accepts the robot's offer" {my Order draw} -right call
    sorma::action -sides {} "who played White plays Black, as soon as nobody is about to move" {my Order sides} -right call
    sorma::action -order {} "put the board in order" {my Order order} -right call
    sorma::writes text * "" "play: the result; state: a dict, as event plot tells it"
    sorma::example "checkers EXEC state"

    variable Game Player    ;# objects; empty: none
    variable State          ;# dict: state, what the last event of the plot has told
    variable Waiting        ;# coroutines that wait for the result
    variable Runs           ;# whose clock runs, as it was told last; empty: it has not been told
    variable Silent         ;# why the speaker has not spoken; empty: it has not failed

    method born {} {
        set Game [set Player {}]
        set State {state idle}
        set Waiting [set Silent [set Runs {}]]
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
            -point [expr {[my cget -laser] eq {} ? {} : [namespace code {my Point}]}] {*}[concat {*}[lmap option {-ponder -feel -drawAfter -tidy -remind} {
                list $option [my cget $option]
            }]] \
            -say [namespace code {my Say}] -watch [namespace code {my Watch}]]
        [my cget -game] configure -colours yr
        try {
            set begun [expr {[$Game resume] && ![$Game over]}]
            while 1 {
                try {
                    if {!$begun} {
                        my Begin
                        set begun 1
                    }
                    $Player play
                    break
                } trap {CHECKERS ORDER new} {} {
                    set begun 0
                } trap {CHECKERS ORDER resign} {} {
                    my Watch agreed {}
                    $Player end [expr {[$Player robot] eq "black" ? "0-1" : "1-0"}] "you have resigned"
                    break
                } trap {CHECKERS ORDER draw} {} {
                    my Watch agreed {}
                    $Player end 1/2-1/2 "we have agreed on a draw"
                    break
                } trap {CHECKERS ORDER time} {} {
                    my Watch agreed {}
                    set white [expr {[$Game late] eq "white"}]
                    $Player end [expr {$white ? "0-1" : "1-0"}] "[expr {$white ? "White" : "Black"}] is out of time"
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
        if {![dict exists $State result]} {
            sorma::fail [list CHECKERS INTERRUPTED] "[my name]: the game was interrupted; EXEC play goes on with it"
        }
        return [dict create text [dict get $State result]]
    }
    method Begin {} {
        [my cget -game] configure -variant [my cget -variant]
        $Player sides [my cget -robot]
        set spares [::checkers::tokens spares [$Game width]]
        if {[my cget -position] eq "seen"} {
            $Game begin {} $spares
            $Game begin [$Player survey [my cget -begins]] $spares
        } else {
            $Game begin [my cget -position] $spares
        }
        $Game limit [my cget -limit]
        my Watch begin {}
        my Say "A new game. [expr {[$Game side] eq [$Player robot] ? "I begin." : "It is your turn."}]"
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
        set State [dict merge [list state $what position [$Game position] pdn [$Game pdn] side [$Game side] \
            robot [$Player robot] lies [$Game lies] clock [$Game clock]] $facts]
        my publish plot -text $State
        # Everybody sees the clock.
        if {[dict get $State side] ne $Runs} {
            set Runs [dict get $State side]
            my publish clock -text $Runs
        }
    }
    method Say text {
        my publish said -text $text [dict get $State state]
        if {[my cget -speaker] ne {}} {
            sorma::async -command [list ::checkers::spoken [namespace code {my Mute}]] [my cget -speaker] exec -text $text
        }
    }
    # A failure of the speaker is shown to people, with its reason; once, as long as it is the same.
    method Mute text {
        if {$text ne $Silent} {
            set Silent $text
            my publish said -text "The voice is silent: $text" mute
        }
    }
    # The arm points at a field; then the light is off, since the eye takes it for a token.
    method Point {file rank} {
        set laser [my cget -laser]
        set place [lrange [dict get [[my cget -transform] exec -floats [list $file $rank 0] boardToWorld] floats] 0 2]
        $laser exec -floats $place point
        try {
            sorma::await sleep [my cget -show]
        } finally {
            $laser exec off
        }
    }
    method Moved {} {
        return [lindex [dict get [[my cget -board] exec board] floats] 0]
    }
}

# No voice, no harm: what is said is in the event, too. TELL gets the reason.
proc ::checkers::spoken {tell future} {
    if {[catch {$future take} text]} {
        catch {{*}$tell $text}
    }
}

package provide sorma::service::checkers 1.0
