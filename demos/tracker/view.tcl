# view.tcl -- where ball and tool are: from above, and from the side, with the way of the last seconds.
#
#     tracker::view::build .view
#     tracker::view::show TOOL BALL         {x y z} each [m], of the table; an empty ball is not seen
#
# Both views have the way across the table from left to right, so that they stand side by side.

package require Tk
package require sorma::style

namespace eval ::tracker::view {
    variable Canvas
    variable Ways {tool {} ball {}}     ;# places of the last seconds, the newest last; an empty one is a gap
    variable Kept 80
    # title, which coordinate goes upwards, and what is shown of it [m]
    variable Views {0 {"From above" x 0 0.36 0.76} 1 {"From the side" z 2 0 0.5}}
    variable Across {-0.22 0.22}
}

proc ::tracker::view::build canvas {
    variable Canvas $canvas
    canvas $canvas -highlightthickness 0 -width [sorma::style pixels 400] -height [sorma::style pixels 200]
    bind $canvas <Configure> ::tracker::view::Draw
    bind $canvas <<ThemeChanged>> ::tracker::view::Draw
    return $canvas
}
proc ::tracker::view::show {tool ball} {
    variable Ways
    variable Kept
    foreach {name place} [list tool $tool ball $ball] {
        dict set Ways $name [lrange [linsert [dict get $Ways $name] end $place] end-[expr {$Kept - 1}] end]
    }
    Draw
}

proc ::tracker::view::Draw {} {
    variable Canvas
    variable Views
    $Canvas delete all
    $Canvas configure -background [ttk::style lookup . -background]
    set width [expr {[winfo width $Canvas] / 2}]
    dict for {n view} $Views {
        One $n $view [expr {$n * $width}] $width
    }
}
# One view, in a part of the canvas.
proc ::tracker::view::One {n view left width} {
    variable Canvas
    variable Across
    variable Ways
    lassign $view title letter index low high
    lassign $Across from to
    set font [sorma::style font small]
    set line [font metrics $font -linespace]
    set gap [sorma::style pixels 4]
    set x0 [expr {$left + [font measure $font 0.000] + 2 * $gap}]
    set room [expr {$left + $width - 3 * $gap - $x0}]
    set y0 [expr {$line + $gap}]
    set tall [expr {[winfo height $Canvas] - $y0 - $line - 2 * $gap}]
    # A metre is as long in both directions.
    set metre [expr {min($room / ($to - $from), $tall / ($high - $low))}]
    if {$metre <= 10} return
    set x0 [expr {$x0 + ($room - $metre * ($to - $from)) / 2}]
    set right [expr {$x0 + $metre * ($to - $from)}]
    set bottom [expr {$y0 + $metre * ($high - $low)}]
    set quiet [sorma::style colour asking]
    $Canvas create text $x0 0 -anchor nw -text $title -font $font -fill [ttk::style lookup . -foreground]
    $Canvas create text $right 0 -anchor ne -text "m" -font $font -fill $quiet
    for {set i [expr {round(ceil($low * 10))}]} {$i <= 10 * $high + 1e-9} {incr i} {
        set y [expr {$bottom - $metre * ($i / 10.0 - $low)}]
        $Canvas create line $x0 $y $right $y -fill [sorma::style token line]
        $Canvas create text [expr {$x0 - $gap}] $y -anchor e -text [format "$letter %.1f" [expr {$i / 10.0}]] -font $font -fill $quiet
    }
    for {set i -2} {$i <= 2} {incr i} {
        set x [expr {$x0 + $metre * ($i / 10.0 - $from)}]
        $Canvas create line $x $y0 $x $bottom -fill [sorma::style token line]
        if {$i % 2 == 0} {
            $Canvas create text $x [expr {$bottom + $gap}] -anchor n -text [format "y %.1f" [expr {-$i / 10.0}]] -font $font -fill $quiet
        }
    }
    foreach {name number radius side anchor} {tool 0 7 -1 s ball 1 5 1 n} {
        set colour [sorma::style series $number]
        set part {}
        foreach place [concat [dict get $Ways $name] {{}}] {
            if {$place ne {}} {
                # y goes to the left, as the arm sees it.
                lappend part [expr {$x0 + $metre * (-[lindex $place 1] - $from)}] [expr {$bottom - $metre * ([lindex $place $index] - $low)}]
                continue
            }
            if {[llength $part] >= 4} {
                $Canvas create line $part -fill $colour -width [sorma::style pixels 1] -tags way
            }
            set part {}
        }
        set place [lindex [dict get $Ways $name] end]
        if {$place eq {}} continue
        set x [expr {$x0 + $metre * (-[lindex $place 1] - $from)}]
        set y [expr {$bottom - $metre * ([lindex $place $index] - $low)}]
        set r [sorma::style pixels $radius]
        $Canvas create oval [expr {$x - $r}] [expr {$y - $r}] [expr {$x + $r}] [expr {$y + $r}] -outline $colour -width [sorma::style pixels 2] \
            -fill [if {$name eq "ball"} {set colour}] -tags $name
        $Canvas create text $x [expr {$y + $side * ($r + $gap)}] -anchor $anchor -text $name -font $font -fill $colour
    }
}
