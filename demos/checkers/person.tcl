# person.tcl -- how a simulated person plays: as the robot's player does, on the other side; and what he does wrong.

package require checkers::player
package provide checkers::person 1.0

# Before some of his moves he does something wrong.
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
