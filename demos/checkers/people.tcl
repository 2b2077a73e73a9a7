# people.tcl -- human: a person who plays against the robot. He sees the tokens, thinks with an engine of his own, and moves tokens with his
# hand, slowly; with -faults he also does what people do who do not know the rules.
#
#     human.sim EXEC play         until his game is over
#
# He waits while the arm is over the board. All that he does to the laboratory are requests to simlab.

package require sorma
package require sorma::service::draughts
package require checkers::player
package require sorma::service::drycarry

# His eye sees the tokens as they are, when the arm is away.
oo::class create ::sorma::service::humaneye {
    superclass ::sorma::service::drysight
    sorma::purpose "says what stands on the board when the arm is away from it"
    sorma::option -pose service -default {} -help "answers where the tool is: floats lab time, position; none: there is no arm"
    sorma::option -high double -unit m -range {0 2} -default 0.45 -help "higher than that the arm is away"
    method exec message {
        while {[my cget -pose] ne {} && [lindex [dict get [[my cget -pose] exec] floats] 3] < [my cget -high]} {
            sorma::await sleep 20
        }
        return [next $message]
    }
}

# His hand takes tokens along a path above the others.
oo::class create ::sorma::service::humanhand {
    superclass ::sorma::service::drycarry
    sorma::purpose "puts tokens from field to field as a person does, with the hand in the picture"
    sorma::option -seconds double -unit s -range {0.05 10} -default 0.5 -help "for each way: to the token, with it, and away"
    sorma::option -step double -unit s -range {0.01 1} -default 0.04 -help "between two places of the token on its way"
    sorma::option -height double -range {1 20} -default 5 -help "so many tokens high it is taken over the others"
    sorma::option -stay flag -default 0 -help "the hand stays over the board, since there is more to do"
    sorma::option -away vector -unit m -length 3 -default {1.2 0.2 0.3} -help "where the hand comes from"

    method Put {names file rank above} {
        set lab [my cget -lab]
        set tokens [my Tokens]
        set line [lsearch -inline -index 0 $tokens [lindex $names 0]]
        lassign $line - fromFile fromRank x y z
        lassign [my World $tokens $file $rank] u v
        set seconds [my cget -seconds]
        my Reach [list $x $y [expr {$z + 0.03}]] $seconds
        set steps [expr {max(1, int($seconds / [my cget -step]))}]
        for {set k 1} {$k < $steps} {incr k} {
            set part [expr {double($k) / $steps}]
            set h [my cget -height]
            foreach name $names {
                $lab CTRL -move $name [expr {$fromFile + $part * ($file - $fromFile)}] [expr {$fromRank + $part * ($rank - $fromRank)}] $h
                set h [expr {$h + 1}]
            }
            my Reach [list [expr {$x + $part * ($u - $x)}] [expr {$y + $part * ($v - $y)}] 0.08] [my cget -step]
        }
        next $names $file $rank $above
        if {![my cget -stay]} {
            my Reach [my cget -away] $seconds
            $lab CTRL -person away
        }
    }
    # The hand goes there meanwhile.
    method Reach {place seconds} {
        [my cget -lab] CTRL -person {*}$place $seconds
        [my cget -lab] exec -floats $seconds step
    }
    # Where a field is in the world: two tokens that are far from each other say how the board lies.
    method World {tokens file rank} {
        lassign [lindex $tokens 0] - f0 r0 x0 y0
        set far 0
        foreach token $tokens {
            lassign $token - f r x y
            set square [expr {($f - $f0) ** 2 + ($r - $r0) ** 2}]
            if {$square > $far} {
                set far $square
                lassign $token - f1 r1 x1 y1
            }
        }
        # As complex numbers: place = place0 + scale * (field - field0), a field is -rank + i file.
        set a [expr {$r0 - $r1}]
        set b [expr {$f1 - $f0}]
        set c [expr {(($x1 - $x0) * $a + ($y1 - $y0) * $b) / $far}]
        set s [expr {(($y1 - $y0) * $a - ($x1 - $x0) * $b) / $far}]
        set a [expr {$r0 - $rank}]
        set b [expr {$file - $f0}]
        return [list [expr {$x0 + $c * $a - $s * $b}] [expr {$y0 + $s * $a + $c * $b}]]
    }
}

# As the robot's player, on the other side; before some of his moves he does something wrong.
oo::class create ::checkers::person {
    superclass ::checkers::player

    # faults: how often, 0 to 1; kinds: which; lab: the laboratory
    constructor {game lab faults kinds args} {
        my variable Lab Faults Kinds Heard Robot
        set Robot {}
        set Lab $lab
        set Faults $faults
        set Kinds $kinds
        set Heard {}
        next $game {*}$args
    }
    # The robot has said that something is wrong.
    method heard text { my variable Heard; lappend Heard $text }

    # In which state of the plot it is.
    method robot state { my variable Robot; set Robot $state }

    method Answer {} {
        my variable Faults Kinds Game Robot
        # It looks once more before it says that it is his turn.
        set end [expr {[clock milliseconds] + 20000}]
        while {$Robot in {thought answer carry carried verify played} && [clock milliseconds] < $end} {
            sorma::await sleep 20
        }
        if {[$Game intended] eq {} && rand() < $Faults} {
            set kind [lindex $Kinds [expr {int(rand() * [llength $Kinds])}]]
            my Fault$kind
        }
        next
    }
    # He does it now. What he is told from here on is about that.
    method Doing {kind {state fault}} {
        my variable Heard
        set Heard {}
        my Note $state kind $kind
    }
    # Until he has been told what is wrong; for so long he insists.
    method Listen {} {
        my variable Heard
        set end [expr {[clock milliseconds] + 60000}]
        while {$Heard eq {} && [clock milliseconds] < $end} {
            sorma::await sleep 20
        }
        my Note told text [lindex $Heard 0]
    }
    # more: his hand stays over the board, so nobody believes what is seen.
    method Move {from to {more 0}} {
        [my Setting -carry] configure -stay $more
        [my Setting -carry] exec -floats [list {*}$from 0 {*}$to 0]
    }
    # One of his tokens, and a field that is empty, as places.
    method Own {} {
        my variable Game
        set colour [expr {[my Setting -robot] eq "white" ? "yellow" : "red"}]
        set own [dict keys [dict filter [$Game lies] script {place stack} {expr {[lindex $place 0] <= [$Game width] && $stack eq $colour}}]]
        return [lindex $own [expr {int(rand() * [llength $own])}]]
    }
    method Empty {} {
        my variable Game
        while 1 {
            set place [list [expr {1 + int(rand() * [$Game width])}] [expr {1 + int(rand() * [$Game width])}]]
            if {[tcl::mathop::+ {*}$place] % 2 == 0 && ![dict exists [$Game lies] $place]} {
                return $place
            }
        }
    }
    # What the board looks like after a displacement is no legal move.
    method Wrong {from to} {
        my variable Game
        set lies [::checkers::tokens after [$Game lies] [list {*}$from 0 {*}$to 0]]
        return [expr {[dict get [[$Game draughts] exec -text [$Game sight $lies] explain] code] == 3}]
    }
    method Faultillegal {} {
        for {set try 0} {$try < 50} {incr try} {
            set from [my Own]
            set to [my Empty]
            if {$from ne {} && [my Wrong $from $to]} {
                my Doing illegal
                my Move $from $to
                my Listen
                my Move $to $from
                return
            }
        }
    }
    method Faultnudged {} {
        set from [my Own]
        if {$from eq {}} return
        set beside [list [expr {[lindex $from 0] + ([lindex $from 0] > 4 ? -0.55 : 0.55)}] [lindex $from 1]]
        my Doing nudged
        my Move $from $beside
        my Listen
        my Move $beside $from
    }
    method Faulttwo {} {
        my variable Game
        set moves [lrange [dict get [[$Game draughts] exec legal] text] 0 end]
        set width [$Game width]
        set done {}
        foreach move $moves {
            if {![regexp {^(\d+)-(\d+)$} $move -> from to]} continue
            set from [::checkers::tokens place $width $from]
            set to [::checkers::tokens place $width $to]
            if {$from in [concat {*}$done] || $to in [concat {*}$done] || [llength [dict get [$Game lies] $from]] > 1} continue
            lappend done [list $from $to]
            if {[llength $done] == 2} break
        }
        if {[llength $done] < 2} return
        lassign $done first second
        my Doing two
        my Move {*}$first 1
        my Move {*}$second
        my Listen
        my Move {*}[lreverse $second] 1
        my Move {*}[lreverse $first]
    }
    # He moves, and takes it back before anybody believes it.
    method Faultback {} {
        my variable Game
        set move [lindex [dict get [[$Game draughts] exec legal] text] 0]
        if {![regexp {^(\d+)-(\d+)$} $move -> from to]} return
        set from [::checkers::tokens place [$Game width] $from]
        set to [::checkers::tokens place [$Game width] $to]
        if {[llength [dict get [$Game lies] $from]] == 1} {
            my Doing back harmless
            my Move $from $to 1
            my Move $to $from
        }
    }
    # A token of the robot's disappears, and comes back when he is told.
    method Faultstolen {} {
        my variable Game Lab
        set other [expr {[my Setting -robot] eq "white" ? "red" : "yellow"}]
        foreach line [split [lindex [$Lab DBX -tokens] 3] \n] {
            lassign $line name file rank - - z
            if {[string match ${other}_* $name] && $z < 0.007 && [dict exists [$Game lies] [list [expr {round($file)}] [expr {round($rank)}]]]
                    && $file < [$Game width] + 0.5 && [llength [dict get [$Game lies] [list [expr {round($file)}] [expr {round($rank)}]]]] == 1} {
                my Doing stolen
                $Lab CTRL -steal $name
                my Listen
                $Lab CTRL -move $name [expr {round($file)}] [expr {round($rank)}]
                return
            }
        }
    }
    method Faultturned {} {
        my variable Lab Turned
        my Doing turned harmless
        set Turned [expr {[info exists Turned] ? -$Turned : 1}]
        ::checkers::moveBoard $Lab 0 [expr {0.012 * $Turned}] [expr {0.05 * $Turned}]
    }
}

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
    sorma::words "play"
    sorma::conduct concurrent
    sorma::action -new {} "give up this game" {if {$Player ne {}} {$Player order new}} -right call
    sorma::writes text * "" "the result"
    sorma::example "human CTRL -help"

    variable Player
    method born {} {
        set Player {}
    }

    method exec message {
        while {$Player ne {}} {
            sorma::await sleep 20
        }
        set suffix [string map {. -} [my name]]
        set game [::checkers::game new draughts.$suffix [my cget -file]]
        draughts.$suffix configure -colours yr
        set engine draughts.$suffix-thinks
        $engine configure -level [my cget -level] -seed [my cget -seed] -endgames 0 -idle 1
        [my cget -eye] configure -width [expr {[my cget -variant] eq "intl" ? 10 : 8}]
        expr {srand([my cget -seed] + 1)}
        set Player [::checkers::person new $game [my cget -lab] [my cget -faults] [my cget -kinds] -robot [my cget -colour] -engine $engine \
            -carry [my cget -hand] -sight [my cget -eye] -still 2 -look 20 -watch [namespace code {my Watch}]]
        set heard [expr {[my cget -robot] eq {} ? {} : [sorma::subscribe [my cget -robot] -event * -queue 1000 -command [namespace code {my Heard}]]}]
        try {
            if {![$game resume] || [$game over]} {
                draughts.$suffix configure -variant [my cget -variant]
                $game begin [my cget -position] [::checkers::tokens spares [$game width]]
                my SetOut [$game lies]
            }
            if {[my cget -mouse]} {
                return {text *}
            }
            set result [$Player play]
            $game forget
            return [dict create text $result]
        } trap {CHECKERS ORDER} {} {
            $game forget
            return {text *}
        } finally {
            if {$heard ne {}} {
                catch {sorma::unsubscribe $heard}
            }
            $Player destroy
            $game destroy
            set Player {}
        }
    }
    method Heard event {
        if {$Player eq {}} {
            return
        }
        switch [dict get $event event] {
            said {
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

    # Tokens that do not lie as they should are put there, at once.
    method SetOut lies {
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
}

package provide sorma::service::humaneye 1.0
package provide sorma::service::humanhand 1.0
package provide sorma::service::human 1.0
