# timelineDraw.tcl -- how a time line is drawn: names at the left, a row for each daemon and object, the axis below.
#
# The recorder makes the outlines, in columns of pixels, so little is drawn however many records there are. A daemon's objects are below it when it
# is unfolded. Failed ones have a colour of their own, and are as high as their row; others are lower.

package require snit
package require sorma::chartAxis
package require sorma::style
package require sorma::text
package require sorma::timelineText
package provide sorma::timelineDraw 1.0

# ::sorma::timelineDraw -- methods of the widget for that. It has canvas, rows, row, top, from, until, folded, shown, selected and facts.
snit::macro ::sorma::timelineDraw {} {
    variable high 24            ;# pixels of a row
    variable left 160           ;# of the names
    variable above 0            ;# of the ring of the focus, over the first row
    variable named {}           ;# what the names were drawn for

    method Measures {} {
        set font [::sorma::style font small]
        set line [font metrics $font -linespace]
        set high [expr {$line + [::sorma::style pixels 8]}]
        set above [$canvas cget -highlightthickness]
        set left [expr {max([font measure $font 00000000000000000000], min([winfo width $canvas] * 3 / 10, [::sorma::style pixels 260]))}]
    }
    method Bottom {} {
        return [expr {[winfo height $canvas] - [font metrics [::sorma::style font small] -linespace] - [::sorma::style pixels 8]}]
    }
    # Pixels of the rows, and how many have room.
    method Wide {} {
        return [expr {max(10, [winfo width $canvas] - $left)}]
    }
    method Room {} {
        return [expr {max(1, ([$self Bottom] - $above) / $high)}]
    }
    method X ns {
        return [expr {$left + double($ns - $from) * [$self Wide] / ($until - $from)}]
    }
    method TimeAt x {
        return [expr {$from + round(double($x - $left) * ($until - $from) / [$self Wide])}]
    }
    method RowAt y {
        set n [expr {$top + ($y - $above) / $high}]
        return [expr {$y < $above || $y >= [$self Bottom] || $n >= [llength $rows] ? -1 : $n}]
    }
    method Visible {} {
        return [lrange $rows $top [expr {$top + [$self Room] - 1}]]
    }
    method Ground {} {
        return [ttk::style lookup TEntry -fieldbackground {} white]
    }
    # answers: of `timeline draw`, one for each of these rows. The answers may be for another view: then they are moved.
    method Paint {which view answers} {
        $canvas delete marks grid none
        set n 0
        foreach item $which answer $answers {
            $self Lane [expr {$above + $n * $high}] $answer
            incr n
        }
        $self Placed $view
        $self Axis
        set needs [list $which $top $row $folded $wanted $left $high [$self Ground]]
        if {$named ne $needs} {
            $self Names $which
            set named $needs
        }
        $canvas raise mask
        $self Select
        if {[llength $rows] == 0} {
            $canvas create text [expr {$left + [$self Wide] / 2}] [expr {[$self Bottom] / 2}] -width [$self Wide] -justify center \
                -fill [::sorma::style token [expr {[$self Trouble] ne {} ? "error" : "quiet"}]] -font [::sorma::style font plain] -tags none \
                -text [expr {[$self Trouble] ne {} ? [$self Trouble] : [dict get $facts done] < 1 ? [::msgcat::mc "It is being read\u2026"] : [::msgcat::mc "There is nothing here."]}]
        }
    }
    method Colour kind {
        return [::sorma::style token [dict get {request accent answer accent open stale event ok sample mine note moves loss error failed error} $kind]]
    }
    method Lane {y answer} {
        set bottom [expr {$y + $high - [::sorma::style pixels 3]}]
        set tall [expr {$high - [::sorma::style pixels 6]}]
        $canvas create line $left [expr {$y + $high - 1}] [winfo width $canvas] [expr {$y + $high - 1}] -fill [::sorma::style token line] -tags grid
        foreach {part kind share} {shape request 0.75 failed failed 1} {
            if {![dict exists $answer $part] || [llength [dict get $answer $part]] < 6} continue
            set colour [$self Colour $kind]
            set id [$canvas create polygon [dict get $answer $part] -fill $colour -outline {} -tags [list marks $kind]]
            $canvas scale $id 0 0 1 [expr {-$tall * $share}]
            $canvas move $id $left $bottom
        }
        if {![dict exists $answer list]} return
        set least [::sorma::style pixels 2]
        foreach {x end kind} [dict get $answer list] {
            set height [expr {$kind in {failed loss} ? $tall : $kind in {event note sample} ? 0.45 * $tall : 0.75 * $tall}]
            set x [expr {$left + $x}]
            set colour [$self Colour $kind]
            $canvas create rectangle $x [expr {$bottom - $height}] [expr {max($left + $end, $x + $least)}] $bottom -fill [expr {$kind eq "open" ? {} : $colour}] \
                -outline [expr {$kind eq "open" ? $colour : {}}] -width [expr {$kind eq "open" ? 1 : 0}] -tags [list marks $kind]
            if {$kind eq "failed"} {
                set s [expr {2 * $least}]
                $canvas create polygon [expr {$x - $s}] [expr {$bottom - $tall}] [expr {$x + $s + $least}] [expr {$bottom - $tall}] \
                    [expr {$x + $least / 2.0}] [expr {$bottom - $tall + 2 * $s}] -fill $colour -outline {} -tags [list marks flag]
            }
        }
    }
    # The drawing of another view moves at once; the fine one comes later.
    method Placed view {
        lassign $view was end
        if {$was == $from && $end == $until} return
        set factor [expr {double($end - $was) / ($until - $from)}]
        if {$factor > 1e4 || $factor < 1e-4} {
            $canvas delete marks
            return
        }
        $canvas scale marks $left 0 $factor 1
        $canvas move marks [expr {double($was - $from) * [$self Wide] / ($until - $from)}] 0
        $canvas raise mask
    }
    method Axis {} {
        $canvas delete axis
        set font [::sorma::style font small]
        set bottom [$self Bottom]
        set right [winfo width $canvas]
        set gap [::sorma::style pixels 4]
        $canvas create rectangle $left $bottom $right [winfo height $canvas] -fill [$self Ground] -outline {} -tags {axis mask}
        $canvas create line $left $bottom $right $bottom -fill [::sorma::style token edge] -tags {axis mask}
        if {[dict get $facts last] <= 0} return         ;# there is no time
        # Fine marks have more digits.
        set step 1000000000
        foreach turn {1 2} {
            set wide [expr {[font measure $font [::sorma::timelineText::at $from $step]] + 6 * $gap}]
            set step [::sorma::timelineText::step [expr {$until - $from}] [expr {max(1, [$self Wide] / $wide)}]]
        }
        set last -1000
        for {set t [expr {($from / $step + 1) * $step}]} {$t < $until} {incr t $step} {
            set x [$self X $t]
            set text [::sorma::timelineText::at $t $step]
            set half [expr {[font measure $font $text] / 2}]
            $canvas create line $x $bottom $x [expr {$bottom + $gap}] -fill [::sorma::style token edge] -tags {axis mask}
            if {$x - $half < max($left, $last) || $x + $half > $right} continue
            set last [expr {$x + $half + $gap}]
            $canvas create text $x [expr {$bottom + $gap}] -anchor n -text $text -font $font -fill [::sorma::style token quiet] -tags {axis mask time}
        }
    }
    method Names which {
        $canvas delete names
        set font [::sorma::style font small]
        set gap [::sorma::style pixels 4]
        $canvas create rectangle 0 0 [expr {$left - 1}] [winfo height $canvas] -fill [$self Ground] -outline {} -tags {names mask}
        $canvas create line [expr {$left - 1}] 0 [expr {$left - 1}] [$self Bottom] -fill [::sorma::style token line] -tags {names mask}
        set y $above
        set n $top
        foreach item $which {
            lassign $item source object marks failed
            if {$n == $row} {
                $canvas create rectangle 0 $y [expr {$left - 2}] [expr {$y + $high - 2}] -fill [::sorma::style token tint] -outline {} -tags {names mask here}
            }
            set middle [expr {$y + $high / 2}]
            set right [expr {$left - 2 * $gap}]
            if {$failed > 0} {
                set id [$canvas create text $right $middle -anchor e -text "[::sorma::style mark refused] $failed" -font $font -fill [::sorma::style token error] -tags {names mask wrong}]
                set right [expr {[lindex [$canvas bbox $id] 0] - $gap}]
            }
            set x [expr {2 * $gap}]
            if {$object eq {}} {
                $canvas create text $x $middle -anchor w -text [expr {$source in $folded && [$self Wanted] eq {} ? "\u25b8" : "\u25be"}] -font $font -fill [::sorma::style token quiet] -tags {names mask}
            }
            incr x [expr {3 * $gap}]
            set text [::sorma::text::clean [expr {$object eq {} ? $source : $object}]]
            $canvas create text [expr {$object eq {} ? $x : $x + 2 * $gap}] $middle -anchor w -font $font -fill [::sorma::style token text] -tags {names mask name} \
                -text [$self Cut $text $font [expr {$right - $x - 2 * $gap}]]
            incr y $high
            incr n
        }
    }
    # As much of a text as has room.
    method Cut {text font room} {
        set text [string range $text 0 200]
        if {[font measure $font $text] <= $room} {
            return $text
        }
        while {$text ne {} && [font measure $font $text\u2026] > $room} {
            set text [string range $text 0 end-1]
        }
        return $text\u2026
    }
    # The mark that is shown below: a line at its time, over its row.
    method Select {} {
        $canvas delete selected
        if {$selected eq {}} return
        lassign $selected source object time
        set n [lsearch -exact [lmap item [$self Visible] {lrange $item 0 1}] [list $source $object]]
        set x [$self X $time]
        if {$n < 0 || $x < $left - 1 || $x > [winfo width $canvas]} return
        set wide [::sorma::style pixels 2]
        $canvas create rectangle [expr {$x - $wide}] [expr {$above + $n * $high}] [expr {$x + 2 * $wide}] [expr {$above + ($n + 1) * $high - 2}] -outline [::sorma::style token text] -width $wide -tags selected
    }
}
