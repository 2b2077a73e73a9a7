# player.tcl -- the plot of a game between the robot and a person.
#
#     checkers::player create p GAME -carry porter -sight boardsight -engine draughts.engine -say command
#     p play
#
# see -> validate -> answer -> carry -> verify -> and again, until the game is over. play suspends the coroutine in which it runs.
# Each message and each decision is an entry for -watch: a command that gets a state and a dict.

package require sorma
package require sorma::await
package require sorma::options
package require checkers::game
package require checkers::hands
package require checkers::ponder
package require checkers::clock
package provide checkers::player 1.0

oo::class create ::checkers::player {
    superclass ::checkers::hands ::checkers::ponder ::checkers::clock

    variable Game Settings
    variable State              ;# of the plot
    variable Told Since         ;# the trouble that was told last, and when [s]
    variable Trouble            ;# since when there is trouble [s]; empty: there is none
    variable Order              ;# as a person has given it; empty: none
    variable Score Level        ;# [men] the robot's last judgement; for so many moves nobody has been ahead
    variable Offered            ;# the robot has offered a draw
    variable Thought            ;# [men] what the engine has said last
    variable Stages Transfers   ;# of the move that is carried: what lies where before and after each transfer

    # -carry, -sight, -engine    objects that carry tokens, see the board, and find a move
    # -robot       the colour that it plays
    # -still       so many equal looks are believed
    # -look        pause between two looks [ms]
    # -patience    after so many times -still looks at the same wrong board it is told
    # -remind      it is told again after that [s], as is a person who does not move
    # -tidy        after that it puts the board in order itself [s]; 0: when it is asked to
    # -board       a command that says by how many mm the board has been moved
    # -point       a command that gets file and rank of a field that is wrong
    # -ponder      an engine that thinks on the person's time
    # -feel        is a token on the last row really a queen?
    constructor {game args} {
        set Game $game
        set State begin
        set Told [set Order [set Since [set Trouble {}]]]
        set Score [set Level [set Offered 0]]
        set Settings [sorma::options::parse {
            -carry {any carry} -sight {any getbrdsit} -engine {any draughts.engine}
            -robot {any black} -still {any 3} -look {any 300} -patience {any 6} -say {any {}} -watch {any {}} -board {any {}}
            -point {any {}} -tidy {any 0} -remind {any 60} -ponder {any {}} -feel {any 0} -drawAfter {any 40}
        } $args]
        if {[$game robot] ne {}} {
            dict set Settings -robot [$game robot]
        }
    }
    destructor {
        my Unponder
    }

    method Setting name { return [dict get $Settings $name] }
    method state {} { return $State }
    method robot {} { return [my Setting -robot] }

    # Gives the player an order. new, resign and draw end play with the error {CHECKERS ORDER word} as soon as the hand is
    # empty. So does time, when a side has no time left. sides changes sides when nobody has begun a move. order puts the board
    # in order.
    method order word { set Order $word }
    method Obey {} {
        my Late
        if {$Order eq "draw"} {
            set Order {}
            my Asked
        } elseif {$Order in {new resign}} {
            my Interrupt
        }
    }
    # Nobody has begun a move: sides may be changed.
    method Quiet {} {
        if {$Order eq "sides"} {
            my Interrupt
        }
    }
    method Interrupt {} {
        set word $Order
        set Order {}
        throw [list CHECKERS ORDER $word] "the game is interrupted: $word"
    }

    # The plot is there now; whoever watches hears it.
    method Enter {state args} {
        my Tick
        set State $state
        my Note $state {*}$args
    }
    method Note {what args} {
        if {[my Setting -watch] ne {}} {
            {*}[my Setting -watch] $what $args
        }
    }
    method Say text {
        if {[my Setting -say] ne {}} {
            {*}[my Setting -say] $text
        }
    }
    # Trouble is told once, as long as it stays the same, and after -remind again. The field that is named first is pointed at.
    method Trouble {text args} {
        set now [clock seconds]
        if {$Trouble eq {}} {
            set Trouble $now
        }
        if {$Told ne $text || ([my Setting -remind] > 0 && $now - $Since >= [my Setting -remind])} {
            set Told $text
            set Since $now
            my Note trouble text $text {*}$args
            my Say $text
            if {[my Setting -point] ne {} && [regexp {\m([a-j])(\d+)\M} $text -> file rank]} {
                set file [expr {[string first $file abcdefghij] + 1}]
                if {[catch {my Moved; {*}[my Setting -point] $file $rank} said]} {
                    my Note unlit text $said
                } else {
                    my Note pointed place [list $file $rank]
                }
            }
        }
    }
    # An error of a part, as people say it. CODE: its error code.
    method Plain {text code} {
        if {"OVERLOAD" in $code} {
            return "Something has touched my arm, and I have stopped. Please keep your hands away; I go on."
        }
        return $text
    }
    method Well {} {
        my Tick
        if {$Told ne {}} {
            my Note well
        }
        set Told [set Trouble {}]
    }
    # Shall the robot put the board in order now?
    method Wanted {} {
        set tidy [my Setting -tidy]
        if {$Order eq "order" || ($tidy > 0 && $Trouble ne {} && [clock seconds] - $Trouble >= $tidy)} {
            set Order {}
            my Well
            return 1
        }
        return 0
    }

    # Play until the game is over. Returns its result.
    method play {} {
        while {![$Game over]} {
            try {
                if {[$Game side] eq [my Setting -robot]} {
                    my Answer
                } else {
                    my Await
                }
            } trap {CHECKERS BACK} {} {
                $Game back
                my Note back
                my Say "You take back your move. It is your turn."
            } trap {CHECKERS ORDER sides} {} {
                my Sides
            } trap {CHECKERS} {text how} {
                return -options $how $text
            } on error {text how} {
                # A part is away, or cannot do it now: both turns begin again with what can be seen.
                my Trouble [my Plain $text [dict get $how -errorcode]] code [dict get $how -errorcode] detail $text
                sorma::await sleep [expr {max(100, [my Setting -look])}]
            }
        }
        return [my end [$Game state result] [$Game state reason]]
    }
    # The game is over, by the rules or by agreement. Returns its result.
    method end {result reason} {
        my Unponder
        $Game end $result
        my Enter over result $result reason $reason
        my Say "The game is over: $result, $reason."
        return $result
    }
    # For a new game.
    method sides colour {
        my Unclock
        set Score [set Level [set Offered 0]]
        dict set Settings -robot $colour
    }
    # The players change colours.
    method Sides {} {
        my Unponder
        set colour [expr {[my Setting -robot] eq "black" ? "white" : "black"}]
        dict set Settings -robot $colour
        $Game robot $colour
        $Game exchange
        set Score [expr {-$Score}]
        my Note sides robot $colour
        my Say "We change sides. I play [expr {$colour eq "white" ? "White" : "Black"}] now."
        # A person who had begun a move puts it back first.
        while {[$Game side] eq $colour && [set sight [lindex [my Still [expr {5 * [my Setting -still]}]] 0]] ne [$Game sight [$Game lies]]} {
            if {$sight ne {}} {
                my Trouble "Please put the board in order: [my Difference $sight [$Game sight [$Game lies]]]."
            }
            sorma::await sleep [my Setting -look]
        }
    }

    # ---- a draw ----

    # The person offers a draw, or accepts the robot's offer.
    method Asked {} {
        if {$Offered || $Score < -0.3 || ($Score <= 0.3 && [$Game state moves] >= [my Setting -drawAfter])} {
            throw {CHECKERS ORDER draw} "the players have agreed on a draw"
        }
        my Note declined score $Score
        my Say [expr {$Score > 0.3 ? [format "No, thank you: I think that I am ahead by %.1f men." $Score]
            : "No, thank you: it is too early. Ask me again after move [expr {[my Setting -drawAfter] / 2}]."}]
    }
    # After a while in which nobody is ahead the robot offers one; once in 20 moves of both.
    method Offer score {
        set Score $score
        set Level [expr {abs($score) <= 0.1 ? $Level + 1 : 0}]
        set Offered 0
        if {$Level >= 10 && [$Game state moves] >= [my Setting -drawAfter]} {
            set Level 0
            set Offered 1
            my Note offer score $score
            my Say "I offer a draw."
        }
    }

    # ---- the eye ----

    # The view that has been the same for so many looks in a row: the sight, or nothing and the eye's message.
    method Still {{times {}}} {
        if {$times eq {}} {
            set times [my Setting -still]
        }
        set last {}
        set same 0
        while 1 {
            my Obey
            set failed [catch {dict get [[my Setting -sight] exec] text} text how]
            set now [expr {$failed ? [dict get $how -errorcode] : $text}]
            # Trouble that a person over the board does not explain is told at once.
            if {$failed && [lrange $now 1 2] ni {{VISION BOARD} {VISION MARKERS}}} {
                set text [my Plain $text $now]
                my Trouble $text
                return [list {} $text]
            }
            set same [expr {$now eq $last ? $same + 1 : 1}]
            set last $now
            if {$same >= $times} {
                return [expr {$failed ? [list {} $text] : [list $text {}]}]
            }
            sorma::await sleep [my Setting -look]
        }
    }

    # A position that was set up by hand, as FEN: the eye sees the pieces, and the hand feels the queens. SIDE moves first.
    method survey side {
        my Enter survey
        my Say "I look at what lies on the board."
        while 1 {
            lassign [my Still] sight text
            if {$sight ne {} && ![string match {*[?]*} $sight]} {
                break
            }
            my Trouble [expr {$sight eq {} ? $text : "I cannot see clearly what stands on [my Unclear $sight]."}]
            sorma::await sleep [my Setting -look]
        }
        my Well
        set width [$Game width]
        if {$sight eq [$Game sight [$Game lies]]} {
            return [$Game position]
        }
        set pieces {yellow {} red {}}
        dict for {place stack} [::checkers::repair seen $width $sight {}] {
            dict lappend pieces $stack "[expr {[my Height $place] > 1 ? "K" : ""}][::checkers::tokens square $width {*}$place]"
        }
        return "[string toupper [string index $side 0]]:W[join [dict get $pieces yellow] ,]:B[join [dict get $pieces red] ,]"
    }

    # ---- the person's turn ----

    # Until the board shows a legal move, and shows it -still times.
    method Await {} {
        my Enter person
        my Well
        my Ponder
        set strange {}
        set times 0
        set quiet [clock seconds]
        set patience [my Setting -remind]
        while 1 {
            lassign [my Still] sight text
            if {[string match {*[?]*} $sight]} {
                set text "I cannot see clearly what stands on [my Unclear $sight]. Please put each token into the middle of its field."
            } elseif {$sight ne {}} {
                set reply [[$Game draughts] exec -text $sight explain]
                set text [expr {[dict exists $reply text] ? [dict get $reply text] : {}}]
                if {[dict get $reply code] == 0 && [my Believed $text]} {
                    return
                }
                if {[dict get $reply code] in {0 1}} {
                    set text {}
                    if {[dict get $reply code] == 1} {
                        my Well
                        my Quiet
                        # Nothing has been moved; he is reminded after longer and longer pauses.
                        if {$patience > 0 && [clock seconds] - $quiet >= $patience} {
                            my Say "It is your turn."
                            set patience [expr {2 * $patience}]
                            set quiet [clock seconds]
                        }
                    }
                } elseif {$text ne {}} {
                    append text ". You may play [my Legal]."
                }
                if {[my Wanted]} {
                    $Game correct [my Tidy $sight [$Game lies]]
                }
            }
            # Perhaps he is not ready.
            set times [expr {$text eq $strange ? $times + 1 : 0}]
            set strange $text
            if {$text ne {} && $times >= [my Setting -patience]} {
                my Trouble $text sight $sight
            }
            sorma::await sleep [my Setting -look]
        }
    }
    # The person's move is played, unless it must be crowned first.
    method Believed move {
        if {[catch {$Game plan $move} planned how]} {
            if {[lindex [dict get $how -errorcode] 1] ni {SPARE HEAP}} {
                return -options $how $planned
            }
            # There are fewer tokens beside the board than the game says, or more: he has found one, or a place.
            set planned [list {} [$Game after $move]]
        }
        set lies [lindex $planned 1]
        set end [$Game goal $move]
        if {[my Setting -feel] && [my Tokens $lies $end] == 2 && [my Tokens [$Game lies] [$Game origin $move]] == 1} {
            if {[catch {my Height $end} there] || $there != 2} {
                my Trouble [expr {[string is integer -strict $there] ? "Your piece on [my Field {*}$end] has reached the last row: it becomes a queen.\
                    I feel [my Count $there] there; please make it two." : $there}] place $end
                return 0
            }
        }
        my Enter validate move $move
        my Say "You play [my Spelled $move]."
        $Game play $move $lies
        my Guessed $move
        return 1
    }

    # A move as people say it: origin and target.
    method Spelled move {
        lassign [regexp -inline {^(\d+)([-x])(\d+)} $move] - from sign to
        return [my Field {*}[::checkers::tokens place [$Game width] $from]]$sign[my Field {*}[::checkers::tokens place [$Game width] $to]]
    }
    method Field {file rank} {
        return [string index abcdefghij [expr {$file - 1}]]$rank
    }
    method Legal {} {
        set moves [lmap move [dict get [[$Game draughts] exec legal] text] {my Spelled $move}]
        return [join [lrange $moves 0 5] ", "][expr {[llength $moves] > 6 ? ", and others" : ""}]
    }

    # ---- the robot's turn ----

    method Answer {} {
        my Well
        my Obey
        set again [expr {[$Game intended] ne {}}]
        if {!$again} {
            my Quiet
            my Enter think
            $Game intend [my Think]
        }
        set move [$Game intended]
        my Enter answer move $move again $again
        my Say [expr {$again ? "I go on with [my Spelled $move]." : "I play [my Spelled $move]."}]
        if {$again} {
            my Load [my Setting -engine]
            [my Setting -engine] exec play $move
        }
        my Shifted
        set Transfers [my Planned $move]
        set Stages [my StagesOf [$Game lies] $Transfers]
        # Somebody has begun this move already: the board says how far he came.
        set done [expr {$again ? [my Found [$Game step] 1] : 0}]
        while {$done < [llength $Transfers]} {
            my Obey
            $Game begun $done
            if {[my Carry [lindex $Transfers $done] [lindex $Stages $done]]} {
                incr done
                my Enter verify stage $done
                if {[lindex [my Still 1] 0] eq [$Game sight [lindex $Stages $done]]} {
                    my Well
                } else {
                    set done [my Found $done 0]
                }
            } else {
                set done [my Found $done 1]
                # Perhaps it failed because the board has been moved.
                my Shifted
            }
        }
        my Well
        $Game play $move [lindex $Stages end]
        my Note played move $move
        my Offer [my Judged]
    }
    # The transfers for a move. When there is no token for a queen, or no room on the heap, it is told, and felt until there is.
    method Planned move {
        while 1 {
            try {
                return [lindex [$Game plan $move] 0]
            } trap {CHECKERS SPARE} {text how} {
                my Obey
                set colour [lindex [dict get $how -errorcode] 2]
                set place [::checkers::tokens heapPlace [$Game width] $colour]
                my Trouble "I need a second $colour token to make a queen. Please put one to [my Named $place]." place $place
                sorma::await sleep [my Setting -look]
                if {![catch {my Height $place} there] && $there > 0} {
                    $Game correct [dict replace [$Game lies] $place [lrepeat $there $colour]]
                }
            }
        }
    }
    # After it the engine is ahead of the game by the robot's move.
    method Think {} {
        my Load [my Setting -engine]
        lassign [my Foreseen] move score seconds
        if {$move ne {} && ![catch {[my Setting -engine] exec play $move}]} {
            my Note foreseen move $move
        } else {
            set came [[my Setting -engine] exec go]
            set move [dict get $came text]
            lassign [dict get $came floats] score seconds
        }
        set Thought $score
        my Note thought move $move score $score seconds $seconds
        return $move
    }
    # The robot's last judgement of its position, in men.
    method Judged {} {
        return [expr {[info exists Thought] ? $Thought : $Score}]
    }
    method Load engine {
        set draughts [$Game draughts]
        $engine configure -variant [$draughts cget -variant] -colours [$draughts cget -colours]
        $engine exec -text [$Game pdn] pdn
    }
    method Shifted {} {
        if {[catch {my Moved} text how]} {
            my Trouble [my Plain $text [dict get $how -errorcode]]
        }
    }
    # Where the board lies is learned anew; if it has been moved, it is told.
    method Moved {} {
        if {[my Setting -board] eq {}} {
            return
        }
        set moved [{*}[my Setting -board]]
        if {$moved > 5} {
            my Note shifted mm $moved
            my Say "The board has been moved by [format %.0f $moved] millimetres. I know where it is."
        }
    }

    # How many transfers are done, as the board looks; waits until it looks as after one of them. NEAR was the last that is known. DOUBT:
    # the next one may have been begun. Then what the hand holds is put down, and what the camera cannot know is felt.
    method Found {near doubt} {
        set finish $doubt
        while 1 {
            if {$finish && $near < [llength $Transfers]} {
                set finish [catch {my Finish [lindex $Transfers $near]} text]
                if {$finish} {
                    my Trouble $text
                }
            }
            lassign [my Still] sight text
            set fits [my Fits $sight]
            if {!$doubt && $near in $fits} {
                return $near
            }
            if {$fits ne {}} {
                # Transfers that were seen done before are not in doubt.
                set later [lmap n $fits {expr {$n >= $near ? $n : [continue]}}]
                if {$later ne {}} {
                    set fits $later
                }
                set felt [my Felt [expr {min($near, [llength $Transfers] - 1)}] $fits]
                if {$felt ne {}} {
                    return $felt
                }
                sorma::await sleep [my Setting -look]
                continue
            }
            if {$near == 0 && [$Game before] ne {} && $sight eq [$Game sight [$Game before]]} {
                throw {CHECKERS BACK} "the person has taken back the move"
            }
            # The person is quick, and has answered the move already.
            if {$sight ne {} && [dict get [[my Setting -engine] exec -text $sight explain] code] == 0} {
                return [llength $Transfers]
            }
            if {$sight ne {} && [my Wanted]} {
                set lies [my Tidy $sight [lindex $Stages $near]]
                set Transfers [concat [lrange $Transfers 0 $near-1] [lindex [::checkers::repair anew [$Game width] $lies [lrange $Transfers $near end]] 0]]
                set Stages [concat [lrange $Stages 0 $near-1] [my StagesOf $lies [lrange $Transfers $near end]]]
                continue
            }
            my Trouble [expr {$sight eq {} ? $text
                : "The board is not as it should be. Please put it in order: [my Difference $sight [$Game sight [lindex $Stages $near]]]."}] \
                sight $sight expected [$Game sight [lindex $Stages $near]]
            sorma::await sleep [my Setting -look]
        }
    }
    # The stages that look so, by their numbers.
    method Fits sight {
        set n -1
        return [lmap lies $Stages {
            incr n
            expr {[$Game sight $lies] eq $sight ? $n : [continue]}
        }]
    }

    # The tokens' places before the first transfer, and after each.
    method StagesOf {lies transfers} {
        set stages [list $lies]
        foreach transfer $transfers {
            lappend stages [set lies [::checkers::tokens after $lies $transfer]]
        }
        return $stages
    }

    # Fields of which the eye is not certain.
    method Unclear sight {
        set width [$Game width]
        return [join [lmap i [lsearch -all [split $sight {}] {[?]}] {my Field [expr {$i % $width + 1}] [expr {$width - $i / $width}]}] ", "]
    }

    # Fields that differ, in words.
    method Difference {seen expected} {
        set width [$Game width]
        set fields {}
        for {set i 0} {$i < $width * $width} {incr i} {
            set should [string index $expected $i]
            if {[string index $seen $i] ne $should} {
                set name [my Field [expr {$i % $width + 1}] [expr {$width - $i / $width}]]
                lappend fields "$name should [expr {$should eq "." ? "be empty" : $should eq "r" ? "have a red token" : "have a yellow token"}]"
            }
        }
        return [join $fields ", "]
    }
}
