# people.tcl -- human: a person who plays against the robot. He sees the tokens, thinks with an engine of his own, and moves
# tokens with his hand, slowly. With -faults he also makes the errors of people who do not know the rules.
#
#     human.sim EXEC play         until his game is over
#
# He waits while the arm is over the board. All that he does to the laboratory are requests to simlab. He knows the robot's
# words (event said) and whose clock runs (event clock). He never knows its beliefs. Only where a real person plays (-mouse) the
# game is taken from it.

package require fileutil
package require sorma
package require sorma::service::draughts
package require checkers::person
package require sorma::service::humaneye

oo::class create ::sorma::service::human {
    superclass ::checkers::laboratory
    sorma::purpose "a person who plays draughts in the simulated laboratory"
    sorma::option -lab service -default simlab -help "the laboratory"
    sorma::option -eye service -default humaneye -help "sees the tokens"
    sorma::option -hand service -default humanhand -help "moves them"
    sorma::option -robot string -default {} -help "he hears what it says, and sees the clock (class checkers); none: he is told nothing"
    sorma::option -variant enum -choices {braz engl intl} -default braz -help "of a new game"
    sorma::option -colour enum -choices {white black} -default white -help "what he plays"
    sorma::option -position string -default {} -help "FEN with which a new game begins; empty: as usual"
    sorma::option -level int -range {1 10} -default 3 -help "how well he plays"
    sorma::option -seed int -range {0 1000000000} -default 1 -help "of all that he does at random"
    sorma::option -faults double -range {0 1} -default 0 -help "before so many of his moves he does something wrong"
    sorma::option -kinds string -default {illegal nudged two back stolen turned} -help "what he does wrong"
    sorma::option -file string -kind file -default {} -help "his memory of the game; empty: none"
    sorma::option -mouse flag -default 0 -help "he only sets out the tokens: a real person plays (class humanhand moves them)"
    sorma::words "play|state"
    sorma::concurrency concurrent
    sorma::action -new {} "give up this game" {if {$Player ne {}} {$Player order new}} -right call
    sorma::action -setOut {} "put the tokens where his game says that they lie" {if {$Player ne {}} {my SetOut [$Game lies]}} -right call
    sorma::writes text * "" "play: the result; state: idle, begin (he sets out the tokens), or play"
    sorma::example "human EXEC state"

    variable Player Game    ;# objects; Player empty: he does not play
    variable State          ;# idle, begin, play
    variable Asked          ;# what the robot has told last of the board; empty: nothing
    variable Announced      ;# the move that the robot has said it plays, and he has not seen; empty: none
    variable Hears          ;# subscription of what the robot tells; empty: none
    variable Feels          ;# subscription of the laboratory, if that is in another process
    variable Began          ;# when the daemon of the laboratory was started [us]
    method born {} {
        set Player [set Hears [set Asked [set Announced [set Feels [set Began {}]]]]]
        set State idle
    }
    destructor {
        my Deaf
    }
    method Deaf {} {
        foreach subscription $Hears {
            sorma::unsubscribe $subscription
        }
        set Hears {}
        if {$Feels ne {}} {
            sorma::unsubscribe $Feels
            set Feels {}
        }
    }

    # A simulated laboratory that is started anew has forgotten where everything was: he sets out the tokens as the game has them.
    # Returns whether it is another one than when he played last.
    method Attend {} {
        if {![regexp {@(.+)$} [my cget -lab] -> daemon]} {
            return 0
        }
        set Feels [sorma::subscribe [my cget -lab] -event sorma.reconnected -command [namespace code {my Felt}]]
        return [my Another]
    }
    # When it was started is kept beside the memory of the game: both daemons may be killed at the same time.
    method Another {} {
        regexp {@(.+)$} [my cget -lab] -> daemon
        set file [expr {[my cget -file] eq {} ? {} : "[my cget -file].lab"}]
        if {$Began eq {} && $file ne {} && [file exists $file]} {
            set Began [fileutil::cat $file]
        }
        set began [dict get [sorma::health $daemon] started]
        set other [expr {$Began ni [list {} $began]}]
        if {$file ne {} && $Began ne $began} {
            fileutil::writeFile $file $began
        }
        set Began $began
        return $other
    }
    method Felt event {
        if {[dict get $event event] eq "sorma.reconnected" && $Player ne {}} {
            coroutine [self namespace]::Remembers[incr ::checkers::Remembered] [namespace which my] Remember
        }
    }
    method Remember {} {
        if {$State ne "play" || ![my Another]} {
            return
        }
        my SetOut [my Known]
        $Player heard {}
        my publish person -text {state remembered}
    }
    # The tokens' places, as he remembers the game, and after the robot's move that he has heard since.
    method Known {} {
        set lies [expr {$Announced eq {} ? {} : [$Player meant $Announced]}]
        return [expr {$lies eq {} ? [$Game lies] : $lies}]
    }

    method exec message {
        switch [dict get $message words] {
            play { return [my Play] }
            state { return [dict create text $State] }
        }
        sorma::fail [list CHECKERS WORD] "[my name]: bad word \"[dict get $message words]\": must be play, or state"
    }
    method Play {} {
        while {$State ne "idle"} {
            sorma::await sleep 20
        }
        set suffix [string map {. -} [my name]]
        set Game [::checkers::game new draughts.$suffix [my cget -file]]
        draughts.$suffix configure -colours yr
        set engine draughts.$suffix-thinks
        $engine configure -level [my cget -level] -seed [my cget -seed] -endgames 0 -idle 1
        [my cget -eye] configure -width [expr {[my cget -variant] eq "intl" ? 10 : 8}]
        set Player [::checkers::person new $Game [my cget -lab] [my cget -faults] [my cget -kinds] -robot [my cget -colour] -engine $engine \
            -carry [my cget -hand] -sight [my cget -eye] -still 2 -look 20 -watch [namespace code {my Watch}]]
        set State begin
        try {
            set colour [expr {[$Game robot] eq {} ? [my cget -colour] : [$Game robot]}]
            $Player sides $colour
            set another [my Attend]
            set Asked {}
            foreach {event method} [expr {[my cget -robot] eq {} ? {} : [my cget -mouse] ? {plot Told said Reset} : {said Heard clock Pressed}}] {
                lappend Hears [sorma::subscribe [my cget -robot] -event $event -queue 1000 -command [namespace code [list my $method]]]
            }
            set begun [expr {[$Game resume] && ![$Game over]}]
            my Announce [expr {$begun ? [my Kept] : {}}]
            if {!$begun} {
                draughts.$suffix configure -variant [my cget -variant]
                $Game begin [my cget -position] [::checkers::tokens spares [$Game width]]
                my SetOut [$Game lies]
            } elseif {$another} {
                if {[my cget -mouse]} {
                    my Follow
                }
                my SetOut [my Known]
                my publish person -text {state remembered}
            } elseif {[my cget -mouse]} {
                my Follow
                my PutBack [$Game lies]
            } elseif {[$Game intended] ne {}} {
                my PutDown
            } elseif {([$Game side] eq $colour || [$Game state moves] == 0) && ([my Missing [$Game lies]] ne {} || [my Wrong])} {
                # He was about to do something wrong.
                my SetOut [$Game lies]
                my publish person -text {state undid}
            }
            # After a restart he makes other random choices than before.
            expr {srand([my cget -seed] + 1 + 7919 * [$Game state moves])}
            catch {[my cget -lab] CTRL -person away}
            set State play
            set result [if {[my cget -mouse]} {$Player watch} else {$Player play}]
            $Game forget
            my Announce {}
            return [dict create text $result]
        } trap {CHECKERS ORDER} {} {
            $Game forget
            my Announce {}
            return {text *}
        } finally {
            $Player destroy
            $Game destroy
            set Player {}
            set State idle
            my Deaf
        }
    }
    # The move that the robot has said is kept beside the memory of the game.
    method Announce move {
        set Announced $move
        if {[my cget -file] eq {}} {
            return
        }
        if {$move eq {}} {
            file delete [my cget -file].said
        } else {
            fileutil::writeFile [my cget -file].said $move
        }
    }
    method Kept {} {
        set file [my cget -file].said
        return [if {[file exists $file]} {fileutil::cat $file}]
    }
    # What the robot says.
    method Heard event {
        if {$Player eq {} || [dict get $event event] ne "said"} {
            return
        }
        my Reset $event
        set text [dict get $event text]
        switch -glob $text {
            "I play *" - "I go on with *" { my Announce [string trimright [lindex $text end] .] }
            "You play *" - "You take back *" { my Announce {} }
            "We change sides.*" { $Player order sides }
            "I offer a draw." { my Consider }
            "The game is over: *" {
                # He sees for himself when the game ends by the rules.
                if {[regexp {you have resigned|agreed on a draw|out of time} $text]} {
                    $Player order new
                }
            }
        }
        # About the board, as it was seen: a field is named. In the robot's turn it waits, and says what should be there.
        if {[dict get $event words] eq "trouble" && [regexp {\m[a-j]\d+\M} $text] && ![string match "* I feel *" " $text"]} {
            $Player heard $text
            if {![string match "The board is not as it should be.*" $text]} {
                my Asked $text
            }
        }
    }
    method Reset event {
        if {[dict get $event event] eq "said" && [string match "*a person must reset it*" [dict get $event text]]} {
            [my cget -lab] CTRL -reset
        }
    }
    method Pressed event {
        if {$Player ne {} && [dict get $event event] eq "clock"} {
            $Player clock [dict get $event text]
        }
    }
    # A real person plays. He ignores messages about a game by other rules: that game ends now.
    method Told event {
        if {$Player ne {} && $State eq "play" && [dict get $event event] eq "plot"} {
            catch {my Hear [dict get $event text]}
        }
    }
    # A real person plays: where the game stands is known from the robot alone, which may be away.
    method Follow {} {
        if {[my cget -robot] ne {} && ![catch {dict get [[my cget -robot] exec state] text} told]} {
            my Hear $told
        }
    }
    method Hear told {
        if {[dict get $told state] in {over agreed}} {
            $Player order new
        } elseif {[dict exists $told lies]} {
            $Game follow [dict get $told pdn] [dict get $told lies]
        }
    }
    # The robot offers a draw: whoever does not accept plays on.
    method Consider {} {
        set agrees [$Player agrees]
        my Watch considered [list agrees $agrees]
        if {$agrees} {
            sorma::async -command {apply {future {catch {$future take}}}} [my cget -robot] CTRL -draw
        }
    }
    method Watch {what facts} {
        if {$what eq "validate"} {
            my Announce {}
        }
        my publish person -text [dict merge [list state $what] $facts]
    }

    # If the robot repeats a message, he has missed the fault; then he puts all tokens where they belong.
    method Asked text {
        if {$text ne $Asked || [$Player errs] || [$Game intended] ne {}} {
            set Asked $text
            return
        }
        set Asked {}
        my publish person -text {state order}
        coroutine [self namespace]::Orders [namespace which my] Order
    }
    method Order {} {
        [my cget -eye] exec
        if {$Player ne {} && ![$Player errs] && [$Game intended] eq {}} {
            my SetOut [my Known]
        }
    }

    # Tokens that lie neither on the board nor on its heaps, by their names.
    method Nowhere {} {
        return [lmap token [my Tokens] {
            lassign $token name file rank
            expr {[::checkers::tokens there [$Game width] $file $rank] ? [continue] : $name}
        }]
    }
    # Those of them that his game misses.
    method Missing lies {
        set nowhere [my Nowhere]
        set all [lmap token [my Tokens] {lindex $token 0}]
        set missing {}
        foreach colour {red yellow} {
            set away [lsearch -all -inline $nowhere ${colour}_*]
            set there [expr {[llength [lsearch -all $all ${colour}_*]] - [llength $away]}]
            set should [llength [lsearch -all -exact [concat {*}[dict values $lies]] $colour]]
            lappend missing {*}[lrange $away 0 [expr {$should - $there - 1}]]
        }
        return $missing
    }
    # The token in his hand goes to its goal: the robot may have answered since.
    method PutDown {} {
        set transfer [lindex [$Game plan [$Game intended]] 0 [$Game step]]
        lassign $transfer - - - file rank
        foreach name [my Missing [$Game lies]] {
            [my cget -lab] CTRL -move $name $file $rank [llength [my At $file $rank]]
        }
    }

    # Tokens that lie nowhere go to where the game misses them; all others stay where they are.
    method PutBack lies {
        set free [my Nowhere]
        dict for {place stack} $lies {
            set n [llength [my At {*}$place]]
            foreach colour [lrange $stack $n end] {
                set name [lsearch -inline $free ${colour}_*]
                if {$name eq {}} break
                set free [lsearch -all -inline -not -exact $free $name]
                [my cget -lab] CTRL -move $name {*}$place $n
                incr n
            }
        }
    }

    # When the arm is away: does the board look otherwise than his game says?
    method Wrong {} {
        # Without an arm nobody says where it is.
        for {set try 0} {[set failed [catch {dict get [[my cget -eye] exec] text} sight]] && $try < 50} {incr try} {
            sorma::await sleep 100
        }
        return [expr {(!$failed && $sight ne [$Game sight [$Game lies]]) || [my Differs [dict filter [$Game lies] script {place -} {
            expr {[lindex $place 0] >= 1 && [lindex $place 0] <= [$Game width]}
        }]] ne {}}]
    }

    # All tokens are put where they should lie, at once. Somebody else may move tokens meanwhile (the board is shifted): then it is said
    # what is wrong, and he tries again.
    method SetOut lies {
        for {set try 1} 1 {incr try} {
            if {![catch {my Put $lies; my Differs $lies} wrong] && $wrong eq {}} {
                return
            }
            set wrong "[my name]: the tokens could not be set out: $wrong"
            my publish person -text [dict create state setOut try $try text $wrong]
            if {$try >= 10} {
                sorma::fail [list CHECKERS SETOUT [my name]] "$wrong (tried $try times)"
            }
            sorma::await sleep 100
        }
    }
    method Put lies {
        set lab [my cget -lab]
        set free [lmap token [my Tokens] {lindex $token 0}]
        foreach name $free {
            $lab CTRL -steal $name
        }
        dict for {place stack} $lies {
            set n 0
            foreach colour $stack {
                set name [lsearch -inline $free ${colour}_*]
                set free [lsearch -all -inline -not -exact $free $name]
                $lab CTRL -move $name {*}$place $n
                incr n
            }
        }
    }
    # The first place where something else lies than should, in words; empty: none.
    method Differs lies {
        dict for {place stack} $lies {
            set here [lmap token [my At {*}$place] {regsub {_.*} [lindex $token 0] {}}]
            if {$here ne $stack} {
                return "at $place should lie [join $stack {, }], and there lies [expr {$here eq {} ? "nothing" : [join $here {, }]}]"
            }
        }
    }
}

package provide sorma::service::human 1.0
