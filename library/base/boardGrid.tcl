# boardGrid.tcl -- where the parts of a dashboard stand: a grid of columns and rows, on which none lies on another. It knows no window.
#
# A place is a list of column, row, width and height, in steps of the grid. Parts are a dict: number -> place.

package provide sorma::boardGrid 1.0

namespace eval ::sorma::boardGrid {
    variable columns 24
    variable Rows 12            ;# at least, however few parts there are
}

# ::sorma::boardGrid::overlap A B -- do two places have something in common?
proc ::sorma::boardGrid::overlap {a b} {
    lassign $a x y width height
    lassign $b X Y Width Height
    return [expr {$x < $X + $Width && $X < $x + $width && $y < $Y + $Height && $Y < $y + $height}]
}

# ::sorma::boardGrid::inside PLACE -- the place next to it that lies in the columns.
proc ::sorma::boardGrid::inside place {
    variable columns
    lassign $place x y width height
    set width [expr {max(1, min($columns, $width))}]
    return [list [expr {max(0, min($columns - $width, $x))}] [expr {max(0, $y)}] $width [expr {max(1, $height)}]]
}

# ::sorma::boardGrid::changed PLACE DX DY DWIDTH DHEIGHT -- moved, or made larger to the right and below, as far as the columns reach.
proc ::sorma::boardGrid::changed {place dx dy dw dh} {
    variable columns
    lassign $place x y width height
    set x [expr {$x + $dx}]
    return [inside [list $x [expr {$y + $dy}] [expr {$dw > 0 ? min($columns - $x, $width + $dw) : $width + $dw}] [expr {$height + $dh}]]]
}

# ::sorma::boardGrid::settle PARTS NUMBER -- that part stays where it is; those below it give way downwards, and those below these.
proc ::sorma::boardGrid::settle {parts number} {
    set order [lsort -command ::sorma::boardGrid::Before [dict values [dict map {n place} [dict remove $parts $number] {concat [inside $place] $n}]]]
    set settled [dict create $number [inside [dict get $parts $number]]]
    foreach item $order {
        set place [lrange $item 0 3]
        set moved 1
        while {$moved} {
            set moved 0
            dict for {n other} $settled {
                if {[overlap $place $other]} {
                    lset place 1 [expr {[lindex $other 1] + [lindex $other 3]}]
                    set moved 1
                }
            }
        }
        dict set settled [lindex $item 4] $place
    }
    return $settled
}
proc ::sorma::boardGrid::Before {a b} {
    foreach i {1 0 4} {
        set difference [expr {[lindex $a $i] - [lindex $b $i]}]
        if {$difference} break
    }
    return $difference
}

# ::sorma::boardGrid::free PARTS WIDTH HEIGHT -- the first place of that size where nothing is, row by row.
proc ::sorma::boardGrid::free {parts width height} {
    variable columns
    for {set y 0} 1 {incr y} {
        for {set x 0} {$x + $width <= $columns} {incr x} {
            set place [list $x $y $width $height]
            set taken 0
            foreach other [dict values $parts] {
                set taken [expr {$taken || [overlap $place $other]}]
            }
            if {!$taken} {
                return $place
            }
        }
    }
}

# ::sorma::boardGrid::rows PARTS -- how many rows it takes to show them.
proc ::sorma::boardGrid::rows parts {
    variable Rows
    return [tcl::mathfunc::max $Rows {*}[lmap place [dict values $parts] {expr {[lindex $place 1] + [lindex $place 3]}}]]
}

# ::sorma::boardGrid::pixels PLACE ROWS WIDTH HEIGHT GAP -- x, y, width and height in a window of that size, with a gap between two parts.
proc ::sorma::boardGrid::pixels {place rows width height gap} {
    variable columns
    lassign $place x y w h
    set left [expr {round($x * ($width - $gap) / double($columns)) + $gap}]
    set top [expr {round($y * ($height - $gap) / double($rows)) + $gap}]
    set right [expr {round(($x + $w) * ($width - $gap) / double($columns))}]
    set bottom [expr {round(($y + $h) * ($height - $gap) / double($rows))}]
    return [list $left $top [expr {max(1, $right - $left)}] [expr {max(1, $bottom - $top)}]]
}

# ::sorma::boardGrid::steps X Y ROWS WIDTH HEIGHT GAP -- so many pixels as columns and rows, with fractions.
proc ::sorma::boardGrid::steps {x y rows width height gap} {
    variable columns
    return [list [expr {$x * $columns / double($width - $gap)}] [expr {$y * $rows / double($height - $gap)}]]
}

# ::sorma::boardGrid::part NAME WHAT FACTS -- what shows an option best: {KIND SETTINGS WIDTH HEIGHT}. FACTS as a subject has them.
proc ::sorma::boardGrid::part {name what facts} {
    set settings [list -name $name -option $what]
    return [switch -- [dict get $facts type] {
        flag { list led $settings 4 2 }
        vector { list stripchart [list -plot [list [list $name $what -index 0]]] 8 4 }
        default { list display $settings 4 3 }
    }]
}
