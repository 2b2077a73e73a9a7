# player.tcl -- the plot of a game between the robot and a person.
#
#     checkers::player create p GAME -carry porter -sight sight -engine draughts.engine -say command
#     p play
#
# see -> validate -> answer -> carry -> verify -> and again, until the game is over. play suspends the coroutine in which it runs.
# Whatever is told or decided is an entry for -watch: a command that gets a state and a dict.

package require sorma
package require sorma::await
package require sorma::options
package require checkers::game
package provide checkers::player 1.0

oo::class create ::checkers::player {
    # -carry: who puts tokens from place to place; -sight: who says what stands on the board; -engine: who finds a move; -robot: the
    # colour that it plays. -still: so many equal looks are believed; -look: pause between two [ms]; -patience: after so many times
    # -still looks at the same wrong board it is told. -board: a command that says by how many mm the board has been moved.
    constructor {game args} {
        my variable Game Settings State Told Order
        set Game $game
        set State begin
        set Told [set Order {}]
        set Settings [sorma::options::parse {
            -carry {any carry} -sight {any getbrdsit} -engine {any draughts.engine}
            -robot {any black} -still {any 3} -look {any 300} -patience {any 6} -say {any {}} -watch {any {}} -board {any {}}
        } $args]
    }

    method Setting name { my variable Settings; return [dict get $Settings $name] }
    method state {} { my variable State; return $State }

    # End play, as soon as nothing is in the hand, with the error {CHECKERS ORDER word}.
    method order word { my variable Order; set Order $word }
    method Obey {} {
        my variable Order
        if {$Order ne {}} {
            set word $Order
            set Order {}
            throw [list CHECKERS ORDER $word] "the game is interrupted: $word"
        }
    }

    # The plot is there now; whoever watches hears it.
    method Enter {state args} {
        my variable State
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
    # What is wrong is told once, as long as it stays the same.
    method Trouble {text args} {
        my variable Told
        if {$Told ne $text} {
            set Told $text
            my Note trouble text $text {*}$args
            my Say $text
        }
    }
    method Well {} {
        my variable Told
        set Told {}
    }

    # Play until the game is over. Returns its result.
    method play {} {
        my variable Game
        while {![$Game over]} {
            if {[$Game side] eq [my Setting -robot]} {
                try {
                    my Answer
                } trap {CHECKERS BACK} {} {
                    $Game back
                    my Note back
                    my Say "You take back your move. It is your turn."
                }
            } else {
                my Await
            }
        }
        set result [$Game state result]
        my Enter over result $result reason [$Game state reason]
        my Say "The game is over: $result, [$Game state reason]."
        return $result
    }

    # ---- the eye ----

    # What is seen when it has been the same so often in a row: the sight, or nothing and what the eye says instead.
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
            # What a person over the board does not explain is told at once.
            if {$failed && [lrange $now 1 2] ni {{VISION BOARD} {VISION MARKERS}}} {
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

    # ---- the person's turn ----

    # Until the board shows a legal move, and shows it -still times.
    method Await {} {
        my variable Game
        my Enter person
        my Well
        set strange {}
        set times 0
        while 1 {
            lassign [my Still] sight text
            if {[string match {*[?]*} $sight]} {
                set text "I cannot see clearly what stands on [my Unclear $sight]. Please put each token into the middle of its field."
            } elseif {$sight ne {}} {
                set reply [[$Game draughts] exec -text $sight explain]
                set text [expr {[dict exists $reply text] ? [dict get $reply text] : {}}]
                if {[dict get $reply code] == 0} {
                    my Enter validate move $text
                    lassign [$Game plan $text] - lies
                    my Say "You play [my Spelled $text]."
                    $Game play $text $lies
                    return
                }
                if {[dict get $reply code] == 1} {
                    set text {}
                    my Well
                } elseif {$text ne {}} {
                    append text ". You may play [my Legal]."
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

    # A move as people say it: origin and target.
    method Spelled move {
        my variable Game
        lassign [regexp -inline {^(\d+)([-x])(\d+)} $move] - from sign to
        return [my Field {*}[::checkers::tokens place [$Game width] $from]]$sign[my Field {*}[::checkers::tokens place [$Game width] $to]]
    }
    method Field {file rank} {
        return [string index abcdefghij [expr {$file - 1}]]$rank
    }
    method Legal {} {
        my variable Game
        set moves [lmap move [dict get [[$Game draughts] exec legal] text] {my Spelled $move}]
        return [join [lrange $moves 0 5] ", "][expr {[llength $moves] > 6 ? ", and others" : ""}]
    }

    # ---- the robot's turn ----

    method Answer {} {
        my variable Game
        my Well
        set again [expr {[$Game intended] ne {}}]
        if {!$again} {
            my Enter think
            $Game intend [my Think]
        }
        set move [$Game intended]
        my Enter answer move $move
        my Say [expr {$again ? "I go on with [my Spelled $move]." : "I play [my Spelled $move]."}]
        if {$again} {
            my Load
            [my Setting -engine] exec play $move
        }
        my Shifted
        set transfers [lindex [$Game plan $move] 0]
        set lies [my Stages $transfers]
        set stages [lmap one $lies {$Game sight $one}]
        # Somebody has begun this move already: the board says how far he came.
        set done [expr {$again ? [my Found $stages] : 0}]
        while {$done < [llength $transfers]} {
            my Obey
            if {[my Carry [lindex $transfers $done] [lindex $lies $done]]} {
                incr done
                my Enter verify stage $done
                if {[lindex [my Still 1] 0] eq [lindex $stages $done]} {
                    my Well
                    continue
                }
            }
            set done [my Found $stages $done]
        }
        $Game play $move [lindex $lies end]
        my Note played move $move
    }
    # After it the engine is ahead of the game by the robot's move.
    method Think {} {
        my Load
        set came [[my Setting -engine] exec go]
        my Note thought move [dict get $came text] score [lindex [dict get $came floats] 0] seconds [lindex [dict get $came floats] 1]
        return [dict get $came text]
    }
    method Load {} {
        my variable Game
        set draughts [$Game draughts]
        [my Setting -engine] configure -variant [$draughts cget -variant] -colours [$draughts cget -colours]
        [my Setting -engine] exec -text [$Game pdn] pdn
    }
    method Shifted {} {
        if {[my Setting -board] eq {}} {
            return
        }
        if {[catch {{*}[my Setting -board]} moved]} {
            my Trouble $moved
        } elseif {$moved > 5} {
            my Note shifted mm $moved
            my Say "The board has been moved by [format %.0f $moved] millimetres. I know where it is."
        }
    }

    # How many transfers are done, as the board looks; waits until it looks as after one of them. Two stages may look the same when a
    # token comes from the heap, or goes there: NEAR is meant then, which was the last that is known.
    method Found {stages {near 0}} {
        my variable Game
        while 1 {
            lassign [my Still] sight text
            if {$sight ne {} && $sight eq [lindex $stages $near]} {
                return $near
            }
            set seen [lsearch -exact $stages $sight]
            if {$seen >= 0} {
                return $seen
            }
            if {$near == 0 && [$Game before] ne {} && $sight eq [$Game sight [$Game before]]} {
                throw {CHECKERS BACK} "the person has taken back the move"
            }
            # The person is quick, and has answered the move already.
            if {$sight ne {} && [dict get [[my Setting -engine] exec -text $sight explain] code] == 0} {
                return [expr {[llength $stages] - 1}]
            }
            my Trouble [expr {$sight eq {} ? $text
                : "The board is not as it should be. Please put it in order: [my Difference $sight [lindex $stages $near]]."}] \
                sight $sight expected [lindex $stages $near]
            sorma::await sleep [my Setting -look]
        }
    }

    # What lies where before the first transfer, and after each.
    method Stages transfers {
        my variable Game
        set lies [$Game lies]
        set stages [list $lies]
        foreach transfer $transfers {
            lappend stages [set lies [::checkers::tokens after $lies $transfer]]
        }
        return $stages
    }

    # Has it been carried?
    method Carry {transfer lies} {
        my Enter carry transfer $transfer
        set stack [lrange [dict get $lies [lrange $transfer 0 1]] [lindex $transfer 2] end]
        if {[catch {[my Setting -carry] exec -floats $transfer -ints [llength $stack] -text [lindex $stack end]} message how]} {
            my Trouble $message code [dict get $how -errorcode]
            sorma::await sleep [my Setting -look]
            return 0
        }
        my Note carried transfer $transfer lies [::checkers::tokens after $lies $transfer]
        return 1
    }

    # Fields of which the eye is not certain.
    method Unclear sight {
        my variable Game
        set width [$Game width]
        return [join [lmap i [lsearch -all [split $sight {}] {[?]}] {my Field [expr {$i % $width + 1}] [expr {$width - $i / $width}]}] ", "]
    }

    # Fields that differ, in words.
    method Difference {seen expected} {
        my variable Game
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
