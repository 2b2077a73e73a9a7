# body.tcl -- the eye and the hand of a simulated person: humaneye sees the tokens as they are, humanhand moves them, slowly. Both are requests
# to simlab.

package require sorma
package require sorma::await
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

# His hand goes to a token, closes, and opens where the token shall be.
oo::class create ::sorma::service::humanhand {
    superclass ::sorma::service::drycarry
    sorma::purpose "puts tokens from field to field as a person does, with the hand in the picture"
    sorma::option -seconds double -unit s -range {0.05 10} -default 0.5 -help "for each way: to the token, with it, and away"
    sorma::option -stay flag -default 0 -help "the hand stays over the board, since there is more to do"
    sorma::option -away vector -unit m -length 3 -default {1.2 0.2 0.3} -help "where the hand comes from"

    method Put {names file rank above} {
        set lab [my cget -lab]
        set tokens [my Tokens]
        set line [lsearch -inline -index 0 $tokens [lindex $names 0]]
        lassign $line - - - x y z
        lassign [my World $tokens $file $rank] u v
        set seconds [my cget -seconds]
        my Reach [list $x $y [expr {$z + 0.03}]] $seconds
        # In his fist nobody sees them.
        foreach name $names {
            $lab CTRL -steal $name
        }
        my Reach [list $u $v 0.08] $seconds
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

package provide sorma::service::humaneye 1.0
package provide sorma::service::humanhand 1.0
