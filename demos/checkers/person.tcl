# person.tcl -- how a simulated person plays: as the robot's player does, on the other side; and what he does wrong.

package require checkers::player
package provide checkers::person 1.0

# Before some of his moves he does something wrong.
oo::class create ::checkers::person {
    superclass ::checkers::player
    variable Game Order         ;# of the player
    variable Lab Faults Kinds
    variable Heard              ;# what the robot has said since he erred
    variable Runs               ;# whose clock runs: white or black; empty: it is not known
    variable Carried            ;# transfers of this move
    variable Erring             ;# he is about to do something wrong
    variable Turned             ;# how he has turned the board last, 1 or -1

    # faults: how often, 0 to 1; kinds: which; lab: the laboratory
    constructor {game lab faults kinds args} {
        set Erring 0
        set Runs [set Carried {}]
        set Lab $lab
        set Faults $faults
        set Kinds $kinds
        set Heard {}
        next $game {*}$args
    }
    # The robot has said that something is wrong.
    method heard text { lappend Heard $text }

    # Whose clock runs: white or black.
    method clock side { set Runs $side }

    # The tokens' places after a move that the robot has said, as people spell it; empty: there is no such move.
    method meant spelled {
        if {[$Game side] eq [my Setting -robot] || [$Game over]} {
            return
        }
        foreach move [dict get [[$Game draughts] exec legal] text] {
            if {[my Spelled $move] eq $spelled && ![catch {$Game plan $move} planned]} {
                return [lindex $planned 1]
            }
        }
    }

    # Sides are changed when the robot says so. It has seen no move: one that he has begun he takes back.
    method Obey {} {
        next
        if {$Order eq "sides"} {
            if {[$Game intended] ne {}} {
                my Note withdrawn move [$Game intended] transfers $Carried
                foreach transfer [lreverse $Carried] {
                    [my Setting -carry] exec -floats [concat [lrange $transfer 3 5] [lrange $transfer 0 2]]
                }
                $Game intend {}
            }
            my Interrupt
        }
    }
    method Carry {transfer lies} {
        set done [next $transfer $lies]
        if {$done} {
            lappend Carried $transfer
        }
        return $done
    }
    # The robot offers a draw. Does he want one, as he thought of his position last?
    method agrees {} { return [expr {[my Judged] <= 0.3}] }

    # A real person plays: until another game is wanted.
    method watch {} {
        while 1 {
            my Obey
            sorma::await sleep 50
        }
    }

    method Answer {} {
        set Carried {}
        # The robot looks once more before it presses its clock.
        set end [expr {[clock milliseconds] + 20000}]
        while {$Runs ni [list {} [my Setting -robot]] && [clock milliseconds] < $end} {
            sorma::await sleep 20
        }
        if {[$Game intended] eq {} && rand() < $Faults} {
            set kind [lindex $Kinds [expr {int(rand() * [llength $Kinds])}]]
            set Erring 1
            try {
                my Fault$kind
            } finally {
                set Erring 0
            }
        }
        next
    }
    # He is about to do something wrong, and knows it.
    method errs {} { return $Erring }

    # He does it now. Later messages are about that. PLACES: the fields of which one should be named.
    method Doing {kind places {state fault}} {
        set Heard {}
        my Note $state kind $kind fields [lmap place $places {my Field {*}$place}]
    }
    # Until he has been told what is wrong; for so long he insists.
    method Listen {} {
        set end [expr {[clock milliseconds] + 180000}]
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
        set colour [expr {[my Setting -robot] eq "white" ? "yellow" : "red"}]
        set own [dict keys [dict filter [$Game lies] script {place stack} {expr {[my OnBoard $place] && $stack eq $colour}}]]
        return [lindex $own [expr {int(rand() * [llength $own])}]]
    }
    method Empty {} {
        while 1 {
            set place [list [expr {1 + int(rand() * [$Game width])}] [expr {1 + int(rand() * [$Game width])}]]
            if {[tcl::mathop::+ {*}$place] % 2 == 0 && ![dict exists [$Game lies] $place]} {
                return $place
            }
        }
    }
    # A displacement does not look like a legal move.
    method Wrong {from to} {
        set lies [::checkers::tokens after [$Game lies] [list {*}$from 0 {*}$to 0]]
        return [expr {[dict get [[$Game draughts] exec -text [$Game sight $lies] explain] code] == 3}]
    }
    method Faultillegal {} {
        for {set try 0} {$try < 50} {incr try} {
            set from [my Own]
            set to [my Empty]
            if {$from ne {} && [my Wrong $from $to]} {
                my Doing illegal [list $from $to]
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
        set beside [list [expr {[lindex $from 0] + ([lindex $from 0] > [$Game width] / 2 ? -0.55 : 0.55)}] [lindex $from 1]]
        my Doing nudged [list $from]
        my Move $from $beside
        my Listen
        my Move $beside $from
    }
    method Faulttwo {} {
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
        my Doing two [list {*}$first {*}$second]
        my Move {*}$first 1
        my Move {*}$second
        my Listen
        my Move {*}[lreverse $second] 1
        my Move {*}[lreverse $first]
    }
    # He moves, and takes it back before anybody believes it.
    method Faultback {} {
        set move [lindex [dict get [[$Game draughts] exec legal] text] 0]
        if {![regexp {^(\d+)-(\d+)$} $move -> from to]} return
        set from [::checkers::tokens place [$Game width] $from]
        set to [::checkers::tokens place [$Game width] $to]
        if {[llength [dict get [$Game lies] $from]] == 1} {
            my Doing back {} harmless
            my Move $from $to 1
            my Move $to $from
        }
    }
    # A token of the robot's disappears, and comes back when he is told.
    method Faultstolen {} {
        set other [expr {[my Setting -robot] eq "white" ? "red" : "yellow"}]
        set tokens [::checkers::tokens seen [$Lab exec tokens]]
        set first [expr {int(rand() * [llength $tokens])}]
        foreach token [concat [lrange $tokens $first end] [lrange $tokens 0 $first-1]] {
            lassign $token name file rank - - z
            set place [list [expr {round($file)}] [expr {round($rank)}]]
            if {[string match ${other}_* $name] && $z < 0.007 && [my OnBoard $place] && [my Tokens [$Game lies] $place] == 1} {
                my Doing stolen [list $place]
                $Lab CTRL -steal $name
                my Listen
                # In a restarted laboratory all tokens have been set out again, and this name may mean another token.
                if {[my Stolen $name]} {
                    $Lab CTRL -move $name {*}$place
                }
                return
            }
        }
    }
    # Does a token lie neither on the board nor on a heap?
    method Stolen name {
        lassign [lsearch -inline -index 0 [::checkers::tokens seen [$Lab exec tokens]] $name] - file rank
        return [expr {![::checkers::tokens there [$Game width] $file $rank]}]
    }
    method Faultturned {} {
        my Doing turned {} harmless
        set Turned [expr {[info exists Turned] ? -$Turned : 1}]
        ::checkers::moveBoard $Lab 0 [expr {0.012 * $Turned}] [expr {0.05 * $Turned}] [$Game width]
    }
}
