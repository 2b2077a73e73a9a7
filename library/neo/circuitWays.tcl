# circuitWays.tcl -- ::sorma::circuitWays: the ways of the wires in the circuit editor. A large circuit has simple ones first; good ones come
# where somebody looks.

package require snit
package require sorma::circuitLayout
package require sorma::circuitText
package require sorma::ways
package provide sorma::circuitWays 1.0

snit::macro ::sorma::circuitWays {} {
    variable ways {}            ;# of the wires, in their order
    variable ends {}            ;# {NET FROM TO} of each wire, as Ends has them
    variable rough {}           ;# dict: number of a wire -> 1, whose way is a simple one so far
    variable finer {}           ;# the timer of Finer
    variable viewed {}          ;# that of values, after the picture was moved

    # The ways of all wires; with PART only of those at the boxes MOVED.
    method Arrange {{part 0} {moved {}}} {
        set nodes [dict get $graph nodes]
        set boxes [dict map {key node} $nodes {concat [dict get $places $key] [::sorma::circuitLayout size $key $node]}]
        set all [dict get $graph wires]
        set count [llength $all]
        if {!$part} {
            set ends [lmap wire $all {$self Ends $wire}]
            set ways [lrepeat [expr {max(1, $count)}] {}]
        }
        set asked [set numbers {}]
        set n -1
        foreach wire $all end $ends {
            incr n
            if {!$part || [lindex $end 1] in $moved || [lindex $end 2] in $moved} {
                lappend numbers $n
                lappend asked [$self Asked $wire $end]
            }
        }
        foreach number $numbers way [::sorma::ways::of [if {$asked ne {}} {dict values $boxes}] $asked {} $count] {
            lset ways $number $way
        }
        if {!$part} {
            set rough {}
        }
        if {[::sorma::ways::simple $count]} {
            foreach number $numbers {
                dict set rough $number 1
            }
        }
        $self Show
        $self Looked
    }
    # Values of a large circuit are written where somebody looks. While the picture moves, none are.
    method Viewed {} {
        $self Looked
        if {[::sorma::ways::simple [llength $ends]]} {
            after cancel $viewed
            set viewed [after 50 [mymethod Values]]
        }
    }
    # Simple ways become good ones where somebody looks: those between two boxes in the window, few at a time, while nothing else is to be done.
    method Looked {} {
        after cancel $finer
        set finer [if {[dict size $rough] > 0 && [$scene zoom] >= 0.2} {after 100 [mymethod Finer]}]
    }
    method Finer {} {
        set seen [$self SeenKeys 0]
        dict set seen {} 1
        set numbers {}
        foreach number [dict keys $rough] {
            lassign [lindex $ends $number] - from to
            if {[dict exists $seen $from] && [dict exists $seen $to]} {
                lappend numbers $number
                if {[llength $numbers] == 40} break
            }
        }
        if {$numbers eq {}} return
        set kept {}
        set n -1
        foreach end $ends way $ways {
            if {![dict exists $rough [incr n]]} {
                lappend kept [list [lindex $end 0] $way]
            }
        }
        set asked [lmap number $numbers {$self Asked [lindex [dict get $graph wires] $number] [lindex $ends $number]}]
        # A way does not go further than that.
        set around [lmap key [dict keys [$self SeenKeys 1]] {dict get $boxes $key}]
        foreach number $numbers way [::sorma::ways::of $around $asked $kept] {
            lset ways $number $way
            dict unset rough $number
            $scene way $number $way
        }
        $self Looked
    }
    # Boxes that are in the window, at least in part, as keys of a dict; within so many widths and heights of it.
    method SeenKeys around {
        lassign [$scene view] left top right bottom
        set wide [expr {$around * ($right - $left)}]
        set high [expr {$around * ($bottom - $top)}]
        set seen {}
        dict for {key box} $boxes {
            lassign $box x y width height
            if {$x <= $right + $wide && $x + $width >= $left - $wide && $y <= $bottom + $high && $y + $height >= $top - $high} {
                dict set seen $key 1
            }
        }
        return $seen
    }
    # {NET FROM TO} of a wire; constants have a net of their own, and no box.
    method Ends wire {
        lassign $wire - source sink
        set to [::sorma::circuitText node $sink]
        if {[lindex $source 1] eq {}} {
            return [list $wire {} $to]
        }
        return [list [lrange $source 0 1] [::sorma::circuitText node $source] $to]
    }
    # The wire as the routes take it. Constants stand left of their pin.
    method Asked {wire end} {
        lassign $end net from to
        lassign [dict get $boxes $to] X Y
        set Y [expr {$Y + [::sorma::circuitLayout pin [dict get $graph nodes $to] ins [lindex $wire 2 1]]}]
        if {$from eq {}} {
            return [list $net [expr {$X - 3}] $Y $X $Y]
        }
        lassign [dict get $boxes $from] x y width
        return [list $net [expr {$x + $width}] [expr {$y + [::sorma::circuitLayout pin [dict get $graph nodes $from] outs [lindex $wire 1 1]]}] $X $Y]
    }
}
