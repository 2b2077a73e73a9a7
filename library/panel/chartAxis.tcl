# chartAxis.tcl -- what stands around the lines of a chart: axes with units and times, names, and values below the pointer.

package require snit
package require sorma::style
package provide sorma::chartAxis 1.0

namespace eval ::sorma::chartAxis {
    # between two marks of a time axis [s]
    variable Steps {0.01 0.02 0.05 0.1 0.2 0.5 1 2 5 10 15 30 60 120 300 600 900 1800 3600 7200 14400 21600 43200 86400}
    variable Dashes {{} {7 3} {2 3} {7 3 2 3} {12 4} {4 4}}
}

# ::sorma::chartAxis::isNumber V -- can it be drawn?
proc ::sorma::chartAxis::isNumber v {
    return [expr {$v > -1e300 && $v < 1e300}]
}

# ::sorma::chartAxis::dash N -- of the N-th line, from 0.
proc ::sorma::chartAxis::dash n {
    variable Dashes
    return [lindex $Dashes [expr {$n % [llength $Dashes]}]]
}

# ::sorma::chartAxis::range VALUES LOW HIGH -- {LOW HIGH} of an axis, in steps of 1, 2, 5; an empty limit is as the values need it.
proc ::sorma::chartAxis::range {all low high} {
    if {[llength $all] == 0} {
        lappend all 0 1
    }
    set least [tcl::mathfunc::min {*}$all]
    set most [tcl::mathfunc::max {*}$all]
    if {$most - $least <= 1e-9 * abs($most)} {      ;# a constant lies in the middle
        set beside [expr {$most == 0 ? 1 : 0.1 * abs($most)}]
        set least [expr {$least - $beside}]
        set most [expr {$most + $beside}]
    }
    set step [::sorma::style step [expr {max($most - $least, 1e-12 + 1e-9 * abs($most))}]]
    if {$low eq {}} {
        set low [expr {floor($least / $step) * $step}]
    }
    if {$high eq {}} {
        set high [expr {ceil($most / $step) * $step}]
    }
    return [list $low [expr {$high > $low ? $high : $low + $step}]]
}

# ::sorma::chartAxis::step SPAN MOST -- between two marks of a time axis, for at most so many.
proc ::sorma::chartAxis::step {span most} {
    variable Steps
    foreach step $Steps {
        if {$span <= $step * $most} break
    }
    return $step
}

# ::sorma::chartAxis::ago SECONDS -- how long ago: -20 s, -5 min, now. at SECONDS STEP -- a time of the day, as fine as the steps; SECONDS since 1970.
proc ::sorma::chartAxis::ago seconds {
    if {$seconds == 0} {
        return [::msgcat::mc "now"]
    }
    foreach {unit size} {h 3600 min 60 s 1} {
        if {fmod($seconds, $size) == 0 || $size == 1} {
            return "-[format %g [expr {$seconds / double($size)}]] $unit"
        }
    }
}
proc ::sorma::chartAxis::at {seconds step} {
    set whole [expr {int(floor($seconds + 0.0005))}]
    set text [clock format $whole -format [expr {$step < 60 ? "%H:%M:%S" : "%H:%M"}]]
    if {$step < 1} {
        append text [format .%03d [expr {max(0, round(1000 * ($seconds - $whole)))}]]
    }
    return $text
}

# ::sorma::chartAxis -- methods of a chart for that. It has canvas, options, traces, scale, shown and origin.
snit::macro ::sorma::chartAxis {} {
    variable area {0 0 1 1}     ;# left, top, right, bottom of what the lines are drawn in
    variable cursor {}          ;# {x y} of the pointer; empty: elsewhere
    variable names {}           ;# rows of the legend: {name name ...}

    method Small {} {
        return [if {$options(-font) ne {}} {set options(-font)} else {::sorma::style font small}]
    }
    method Wide {} {
        return [expr {max(1, [lindex $area 2] - [lindex $area 0])}]
    }
    # Where between the edges a pixel is, 0 to 1.
    method Part x {
        return [expr {($x - [lindex $area 0]) / double([$self Wide])}]
    }
    method X t {
        return [expr {[lindex $area 2] - ($shown - $t) * [$self Wide] / double($options(-span))}]
    }
    method Y v {
        lassign $scale low high
        lassign $area - top - bottom
        return [expr {$bottom - ($v - $low) * ($bottom - $top) / double($high - $low)}]
    }
    method Ink {} {
        return [expr {[$self Enabled] ? [ttk::style lookup . -foreground {} black] : [::sorma::style colour asking]}]
    }
    method Number v {
        return [format %.6g $v]
    }
    # Values with a mark on the axis.
    method Levels {} {
        lassign $scale low high
        set step [::sorma::style step [expr {$high - $low}]]
        set levels {}
        for {set v [expr {ceil($low / $step - 1e-9) * $step}]} {$v <= $high + 1e-9 * $step} {set v [expr {$v + $step}]} {
            lappend levels [expr {abs($v) < 1e-9 * $step ? 0 : $v}]
        }
        return $levels
    }
    # The unit of the axis: that of all its traces.
    method Unit {} {
        set units [lsort -unique [lmap trace [dict values $traces] {dict get $trace unit}]]
        return [if {[llength $units] == 1} {lindex $units 0}]
    }
    # Names from the left to the right, in as many rows as they need; then what room is left. Charts below one another mostly begin at one edge.
    method Areas {} {
        set font [$self Small]
        set line [font metrics $font -linespace]
        set gap [::sorma::style pixels 4]
        set width [winfo width $canvas]
        set left [expr {[tcl::mathfunc::max [font measure $font 00000] {*}[lmap v [$self Levels] {font measure $font [$self Number $v]}]] + 2 * $gap}]
        set x [set begin [expr {max($left, 3 * $gap + [font measure $font [$self Unit]])}]]
        set names {}
        set row {}
        foreach name [dict keys $traces] {
            set needs [expr {7 * $gap + [font measure $font [$self Text $name]]}]
            if {$row ne {} && $x + $needs > $width} {
                lappend names $row
                set row {}
                set x $begin
            }
            lappend row $name
            incr x $needs
        }
        lappend names $row
        set top [expr {$gap + [llength $names] * ($line + $gap / 2) + $gap}]
        set area [list $left $top $width [expr {max($top + 10, [winfo height $canvas] - $line - 2 * $gap)}]]
    }
    method Grid {} {
        lassign $area left - right
        set colour [::sorma::style token line]
        foreach v [$self Levels] {
            set y [$self Y $v]
            $canvas create line $left $y $right $y -fill $colour -tags grid
        }
        foreach {x text} [$self Times] {
            $canvas create line $x [lindex $area 1] $x [lindex $area 3] -fill $colour -tags grid
        }
    }
    # Marks of the time axis: x and text. They stand still while the lines move below them; while these rest, they are times of the day.
    method Times {} {
        set most [expr {max(1, int([$self Wide] / (2 * [font measure [$self Small] "00:00:00"])))}]
        set step [::sorma::chartAxis::step $options(-span) $most]
        set marks {}
        if {!$options(-paused)} {
            for {set ago 0} {$ago <= $options(-span)} {set ago [expr {$ago + $step}]} {
                lappend marks [$self X [expr {$shown - $ago}]] [::sorma::chartAxis::ago $ago]
            }
            return $marks
        }
        set began [expr {$origin / 1000.0}]
        set first [expr {ceil(($began + $shown - $options(-span)) / $step)}]
        set last [expr {floor(($began + $shown) / $step)}]
        for {set i $first} {$i <= $last} {set i [expr {$i + 1}]} {
            lappend marks [$self X [expr {$i * $step - $began}]] [::sorma::chartAxis::at [expr {$i * $step}] $step]
        }
        return $marks
    }
    # Lines end at the edges.
    method Masks {} {
        lassign $area left top right bottom
        set ground [$canvas cget -background]
        set far [expr {max([winfo width $canvas], [winfo height $canvas]) + 10}]
        foreach place [list [list 0 0 $left $far] [list 0 0 $far $top] [list 0 [expr {$bottom + 1}] $far $far]] {
            $canvas create rectangle $place -fill $ground -outline $ground -width 0 -tags mask
        }
        $canvas create line $left $bottom $right $bottom -fill [::sorma::style colour asking] -tags frame
    }
    method Texts {} {
        lassign $area left top right bottom
        set gap [::sorma::style pixels 4]
        set font [$self Small]
        set quiet [::sorma::style colour asking]
        foreach v [$self Levels] {
            $canvas create text [expr {$left - $gap}] [$self Y $v] -anchor e -text [$self Number $v] -font $font -fill $quiet
        }
        $canvas create text $gap $gap -anchor nw -text [$self Unit] -font $font -fill $quiet -tags unit
        foreach {x text} [$self Times] {
            set half [expr {[font measure $font $text] / 2}]
            set x [expr {min($x, $right - $half - 1)}]
            if {$x - $half >= 0} {
                $canvas create text $x [expr {$bottom + $gap}] -anchor n -text $text -font $font -fill $quiet -tags time
            }
        }
        set middle [expr {($left + $right) / 2}]
        if {$traces eq {}} {
            $canvas create text $middle [expr {($top + $bottom) / 2}] -fill $quiet \
                -text [::msgcat::mc "nothing is plotted yet: \"Plot this\" in the menu of a field"] -font $font
        }
        if {$options(-paused)} {
            $canvas create text $middle [expr {$top + $gap}] -anchor n -text [::msgcat::mc "paused"] -fill [$self Ink] -font $font
        }
    }
    method Legend {} {
        set gap [::sorma::style pixels 4]
        set font [$self Small]
        set line [font metrics $font -linespace]
        set begin [expr {max([lindex $area 0], 3 * $gap + [font measure $font [$self Unit]])}]
        set y $gap
        foreach row $names {
            set x $begin
            foreach name $row {
                set trace [dict get $traces $name]
                set number [dict get $trace number]
                set middle [expr {$y + $line / 2}]
                set colour [expr {[dict get $trace hidden] ? [::sorma::style colour asking] : [$self Colour $name]}]
                $canvas create line $x $middle [expr {$x + 4 * $gap}] $middle -fill $colour -width [::sorma::style pixels 2] \
                    -dash [::sorma::chartAxis::dash $number] -tags [list legend key$number]
                set id [$canvas create text [expr {$x + 5 * $gap}] $y -anchor nw -text [$self Text $name] -fill $colour -font $font \
                    -tags [list legend text$number]]
                set x [expr {[lindex [$canvas bbox $id] 2] + 2 * $gap}]
            }
            incr y [expr {$line + $gap / 2}]
        }
    }
    # The pointer is there: what the lines have at that time.
    method Point {x y} {
        set cursor [if {$x ne {}} {list $x $y}]
        $canvas delete cursor
        lassign $area left top right bottom
        if {$x eq {} || $traces eq {} || $x < $left || $x > $right || $y < 0} return
        set time [expr {$shown - $options(-span) * (1 - [$self Part $x])}]
        set rows [list [list [::sorma::chartAxis::at [expr {$origin / 1000.0 + $time}] [expr {$options(-span) / 100.0}]] [$self Ink]]]
        dict for {name trace} $traces {
            lassign [[dict get $trace series] at $time] - v
            if {[dict get $trace hidden] || $v eq {} || ![::sorma::chartAxis::isNumber $v]} continue
            lappend rows [list [string trimright "[dict get $trace text]  [$self Number $v] [dict get $trace unit]"] [$self Colour $name]]
            set r [::sorma::style pixels 3]
            set h [$self Y $v]
            $canvas create oval [expr {$x - $r}] [expr {$h - $r}] [expr {$x + $r}] [expr {$h + $r}] -fill [$self Colour $name] -width 0 -tags cursor
        }
        $canvas create line $x $top $x $bottom -fill [::sorma::style colour asking] -tags cursor
        $self Box $x $rows
    }
    # Beside the pointer, where there is more room.
    method Box {x rows} {
        lassign $area left top right
        set gap [::sorma::style pixels 4]
        set font [$self Small]
        set line [font metrics $font -linespace]
        set wide [expr {[tcl::mathfunc::max {*}[lmap row $rows {font measure $font [lindex $row 0]}]] + 4 * $gap}]
        set from [expr {$x + 2 * $gap + $wide < $right ? $x + 2 * $gap : $x - 2 * $gap - $wide}]
        $canvas create rectangle $from [expr {$top + $gap}] [expr {$from + $wide}] [expr {$top + 3 * $gap + [llength $rows] * $line}] \
            -fill [::sorma::style token hover] -outline [::sorma::style token line] -tags cursor
        set y [expr {$top + 2 * $gap}]
        foreach row $rows {
            $canvas create text [expr {$from + 2 * $gap}] $y -anchor nw -text [lindex $row 0] -fill [lindex $row 1] -font $font -tags {cursor value}
            incr y $line
        }
    }
}
