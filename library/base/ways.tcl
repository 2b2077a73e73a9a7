# ways.tcl -- the ways of wires between boxes: along a grid, around all boxes, and beside each other. It knows no window.
#
# A wire leaves its box to the right and enters the other one from the left. Ways are tried from the simple to the long: straight, one
# step, two steps through a free row. A way that touches no box and has least company of other wires is taken. Wires from the same pin may
# share their way.

package provide sorma::ways 1.0

namespace eval ::sorma::ways {
    variable Tries 14           ;# places of a step that are compared
    variable Far 400            ;# rows, as far as a free one is looked for
    variable Many 600           ;# wires; more of them get simple ways only: a window must not wait
    variable Most 4000          ;# wires; more of them go straight to their ends, through boxes
}

# ::sorma::ways::of BOXES WIRES ?KEPT? ?COUNT? -- a list: x1 y1 x2 y2 ... of each wire.
# Arguments:
#       BOXES   list of {x y width height}
#       WIRES   list of {NET x1 y1 x2 y2}: from where to where; those of one NET may lie on each other
#       KEPT    list of {NET way}: of wires that stay as they are
#       COUNT   of all wires, of which these are a part that shall look like the others; default: that of WIRES
proc ::sorma::ways::of {boxes wires {kept {}} {count {}}} {
    variable Most
    set count [expr {$count eq {} ? [llength $wires] : $count}]
    if {$count > $Most} {
        return [lmap wire $wires {
            lassign $wire net x1 y1 x2 y2
            Direct $x1 $y1 $x2 $y2
        }]
    }
    set map [dict create rows [Blocked $boxes 1 3 0 2] columns [Blocked $boxes 0 2 1 3]]
    array set rows {}
    array set columns {}
    if {[simple $count]} {
        return [lmap wire $wires {Way $map {*}$wire 1}]
    }
    foreach item $kept {
        Take {*}$item
    }
    # Short ones first: they have the least choice. Their order in the answer is that in which they came.
    set n -1
    set sorted [lsort -integer -index 0 [lmap wire $wires {
        lassign $wire net x1 y1 x2 y2
        list [expr {abs($x2 - $x1) + abs($y2 - $y1)}] [incr n] $wire
    }]]
    set out [lrepeat [expr {max(1, [llength $wires])}] {}]
    foreach item $sorted {
        lassign $item - number wire
        set way [Way $map {*}$wire]
        Take [lindex $wire 0] $way
        lset out $number $way
    }
    return [lrange $out 0 [llength $wires]-1]
}

# ::sorma::ways::simple COUNT -- are these so many wires that `of` does not look for the best way of each? They may then go through boxes, and lie on
# each other. Ask again for those few that somebody looks at.
proc ::sorma::ways::simple count {
    variable Many
    return [expr {$count > $Many}]
}

# The stretches that boxes block, as a dict line -> {starts ends}, sorted, none touching another. ACROSS, SIZE, ALONG, LENGTH: indices into a
# box; 1 3 0 2 for rows, 0 2 1 3 for columns.
proc ::sorma::ways::Blocked {boxes across size along length} {
    set lines {}
    foreach box [lsort -integer -index $along $boxes] {
        set from [lindex $box $along]
        set to [expr {$from + [lindex $box $length]}]
        set last [expr {[lindex $box $across] + [lindex $box $size]}]
        for {set n [lindex $box $across]} {$n <= $last} {incr n} {
            lassign [if {[dict exists $lines $n]} {dict get $lines $n}] starts ends
            if {$starts ne {} && [lindex $ends end] >= $from} {
                lset ends end [expr {max([lindex $ends end], $to)}]
            } else {
                lappend starts $from
                lappend ends $to
            }
            dict set lines $n [list $starts $ends]
        }
    }
    return $lines
}
# Is a box between FROM and TO in this line?
proc ::sorma::ways::Hits {lines n from to} {
    if {![dict exists $lines $n]} {
        return 0
    }
    lassign [dict get $lines $n] starts ends
    set i [lsearch -integer -bisect $starts [expr {max($from, $to)}]]
    return [expr {$i >= 0 && [lindex $ends $i] >= min($from, $to)}]
}

# Note a way, in the arrays rows and columns of `of`: line -> list of {net from to}.
proc ::sorma::ways::Take {net way} {
    upvar 1 rows rows columns columns
    foreach {x y} [lrange $way 0 end-2] {X Y} [lrange $way 2 end] {
        if {$y == $Y} {
            lappend rows($y) [list $net [expr {min($x, $X)}] [expr {max($x, $X)}]]
        } else {
            lappend columns($x) [list $net [expr {min($y, $Y)}] [expr {max($y, $Y)}]]
        }
    }
}
# How much of a stretch lies on other nets.
proc ::sorma::ways::Company {taken net from to} {
    set low [expr {min($from, $to)}]
    set high [expr {max($from, $to)}]
    set sum 0
    foreach item $taken {
        lassign $item other a b
        if {$other ne $net && $a <= $high && $b >= $low} {
            incr sum [expr {1 + min($b, $high) - max($a, $low)}]
        }
    }
    return $sum
}

# QUICK: no search for a free row.
proc ::sorma::ways::Way {map net x1 y1 x2 y2 {quick 0}} {
    variable Tries
    upvar 1 rows rows columns columns
    if {$y1 == $y2 && $x2 > $x1 && ![Hits [dict get $map rows] $y1 [expr {$x1 + 1}] [expr {$x2 - 1}]]} {
        return [list $x1 $y1 $x2 $y2]
    }
    # One step, near the end of the wire: at its beginning stands its value.
    set best {}
    set least 1000000000
    for {set i 0; set x [expr {$x2 - 2}]} {$i < $Tries && $x > $x1} {incr i; incr x -1} {
        if {[Hits [dict get $map columns] $x $y1 $y2] || [Hits [dict get $map rows] $y1 [expr {$x1 + 1}] $x]
                || [Hits [dict get $map rows] $y2 $x [expr {$x2 - 1}]]} continue
        set cost [expr {[info exists columns($x)] ? [Company $columns($x) $net $y1 $y2] : 0}]
        if {$cost < $least} {
            set least $cost
            set best [list $x1 $y1 $x $y1 $x $y2 $x2 $y2]
            if {$cost == 0} break
        }
    }
    if {$best ne {}} {
        return $best
    }
    return [if {$quick} {Direct $x1 $y1 $x2 $y2} else {Detour $map $net $x1 $y1 $x2 $y2}]
}

# Two steps: to a free row, along it, and to the end. If all is full, straight through.
proc ::sorma::ways::Detour {map net x1 y1 x2 y2} {
    variable Far
    upvar 2 rows rows columns columns
    set boxRows [dict get $map rows]
    set boxColumns [dict get $map columns]
    set middle [expr {($y1 + $y2) / 2}]
    set best {}
    set least 1000000000
    set found 0
    for {set i 0} {$i <= 2 * $Far && $found < 6} {incr i} {
        set y [expr {$middle + ($i % 2 ? ($i + 1) / 2 : -$i / 2)}]
        if {$x1 + 2 <= $x2 - 2 && [Hits $boxRows $y [expr {$x1 + 2}] [expr {$x2 - 2}]]} continue
        set a [Step $boxColumns $boxRows columns $net $x1 1 $y1 $y]
        set b [Step $boxColumns $boxRows columns $net $x2 -1 $y2 $y]
        if {$a eq {} || $b eq {} || [Hits $boxRows $y $a $b]} continue
        incr found
        set cost [expr {$i + 2 * ([info exists rows($y)] ? [Company $rows($y) $net $a $b] : 0)}]
        if {$cost < $least} {
            set least $cost
            set best [list $x1 $y1 $a $y1 $a $y $b $y $b $y2 $x2 $y2]
        }
        if {$cost <= $i} break
    }
    return [if {$best ne {}} {set best} else {Direct $x1 $y1 $x2 $y2}]
}
proc ::sorma::ways::Direct {x1 y1 x2 y2} {
    set x [expr {($x1 + $x2) / 2}]
    return [list $x1 $y1 $x $y1 $x $y2 $x2 $y2]
}
# A column beside X, in this direction, that leads from row Y to row FREE: the one with the least company. Empty: none does.
proc ::sorma::ways::Step {boxColumns boxRows columnsVar net x direction y free} {
    variable Tries
    upvar 1 $columnsVar columns
    set best {}
    set least 1000000000
    for {set i 2} {$i < $Tries} {incr i} {
        set at [expr {$x + $direction * $i}]
        if {[Hits $boxRows $y [expr {$x + $direction}] $at]} break
        if {[Hits $boxColumns $at $y $free]} continue
        set cost [expr {[info exists columns($at)] ? [Company $columns($at) $net $y $free] : 0}]
        if {$cost < $least} {
            set least $cost
            set best $at
        }
        if {$cost == 0} break
    }
    return $best
}
