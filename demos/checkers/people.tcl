# people.tcl -- human: a person who plays against the robot. He sees the tokens, thinks with an engine of his own, and moves tokens with his
# hand, slowly; with -faults he also does what people do who do not know the rules.
#
#     human.sim EXEC play         until his game is over
#
# He waits while the arm is over the board. All that he does to the laboratory are requests to simlab.

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
    sorma::option -robot string -default {} -help "what it says he hears (event said of class checkers); none: he is told nothing"
    sorma::option -variant enum -choices {braz engl intl} -default braz -help "of a new game"
    sorma::option -colour enum -choices {white black} -default white -help "what he plays"
    sorma::option -position string -default {} -help "FEN with which a new game begins; empty: as usual"
    sorma::option -level int -range {1 10} -default 3 -help "how well he plays"
    sorma::option -seed int -range {0 1000000000} -default 1 -help "of all that he does at random"
    sorma::option -faults double -range {0 1} -default 0 -help "before so many of his moves he does something wrong"
    sorma::option -kinds string -default {illegal nudged two back stolen turned} -help "what he does wrong"
    sorma::option -file string -kind file -default {} -help "his memory of the game; empty: none"
    sorma::option -mouse flag -default 0 -help "he only sets out the tokens: a real person plays"
    sorma::words "play|state"
    sorma::conduct concurrent
    sorma::action -new {} "give up this game" {if {$Player ne {}} {$Player order new}} -right call
    sorma::action -setOut {} "put the tokens where his game says that they lie" {if {$Player ne {}} {my SetOut [$Game lies]}} -right call
    sorma::writes text * "" "play: the result; state: idle, begin (he sets out the tokens), or play"
    sorma::example "human EXEC state"

    variable Player Game    ;# objects; Player empty: he does not play
    variable State          ;# idle, begin, play
    variable Hears          ;# subscription of what the robot tells; empty: none
    method born {} {
        set Player [set Hears {}]
        set State idle
    }
    destructor {
        my Deaf
    }
    method Deaf {} {
        if {$Hears ne {}} {
            sorma::unsubscribe $Hears
            set Hears {}
        }
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
        expr {srand([my cget -seed] + 1)}
        set Player [::checkers::person new $Game [my cget -lab] [my cget -faults] [my cget -kinds] -robot [my cget -colour] -engine $engine \
            -carry [my cget -hand] -sight [my cget -eye] -still 2 -look 20 -watch [namespace code {my Watch}]]
        set State begin
        try {
            set Hears [expr {[my cget -robot] eq {} ? {} : [sorma::subscribe [my cget -robot] -event * -queue 1000 -command [namespace code {my Heard}]]}]
            if {![$Game resume] || [$Game over]} {
                draughts.$suffix configure -variant [my cget -variant]
                $Game begin [my cget -position] [::checkers::tokens spares [$Game width]]
                my SetOut [$Game lies]
            }
            # He may have had a token in his hand.
            if {[my Missing [$Game lies]]} {
                my SetOut [$Game lies]
            }
            catch {[my cget -lab] CTRL -person away}
            set State play
            if {[my cget -mouse]} {
                return {text *}
            }
            set result [$Player play]
            $Game forget
            return [dict create text $result]
        } trap {CHECKERS ORDER} {} {
            $Game forget
            return {text *}
        } finally {
            $Player destroy
            $Game destroy
            set Player {}
            set State idle
            my Deaf
        }
    }
    method Heard event {
        if {$Player eq {}} {
            return
        }
        switch [dict get $event event] {
            said {
                if {[string match "*a person must reset it*" [dict get $event text]]} {
                    [my cget -lab] CTRL -reset
                }
                if {[dict get $event words] eq "trouble"} {
                    $Player heard [dict get $event text]
                }
            }
            plot { $Player robot [dict get $event text state] }
        }
    }
    method Watch {what facts} {
        my publish person -text [dict merge [list state $what] $facts]
    }

    # Are there fewer tokens on the board and its heaps than there should be?
    method Missing lies {
        set there [llength [lsearch -all -regexp [my Tokens] {^\S+ (-0\.4|\d\.)\d* \d\.}]]
        return [expr {$there < [llength [concat {*}[dict values $lies]]]}]
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
