# circuitKeys.tcl -- ::sorma::circuitKeys: what keys do in the circuit editor.

package require snit
package require sorma::style
package provide sorma::circuitKeys 1.0

snit::macro ::sorma::circuitKeys {} {
    variable kept {}            ;# keys of boxes that stay selected when n or p goes on

    method BindKeys {} {
        bind $win <FocusIn> [mymethod Focused]
        foreach {event method} {
            <Delete> Remove <BackSpace> Remove <Control-z> undo <Control-y> redo <Control-l> tidy <Control-a> All <Escape> Escape
            <Control-c> copy <Control-x> cut <Control-v> paste <Control-p> Print <Control-g> nest <Control-u> unnest <Control-s> SaveAs <Key-d> compare <Control-r> Record <Control-b> LookBack
            <Control-Left> {align left} <Control-Right> {align right} <Control-Up> {align top} <Control-Down> {align bottom}
            <Left> {Arrow -1 0} <Right> {Arrow 1 0} <Up> {Arrow 0 -1} <Down> {Arrow 0 1}
            <Shift-Left> {Grow -1 0} <Shift-Right> {Grow 1 0} <Shift-Up> {Grow 0 -1} <Shift-Down> {Grow 0 1} <Key-c> Comment <Key-f> Frame
            <plus> {Zoom 1.25} <minus> {Zoom 0.8} <Key-0> {Zoom fit} <Key-n> {Next 1} <Key-p> {Next -1} <Key-N> {NextWire 1} <Key-P> {NextWire -1} <space> Keep
            <Return> Line <Key-o> LookInside <Key-v> Flip <Key-r> FlipRates <Key-w> Probe <Key-s> step
        } {
            # The window around has keys of its own, as the browser has Ctrl-R. Here, a letter is one without Control and Alt.
            set script "[mymethod {*}$method]; break"
            bind $scene $event [if {[string match <Control-* $event]} {set script} else {string cat "if {!(%s & 12)} {" $script "}"}]
        }
    }
    # The picture takes the keys that are given to the editor. Tk tells that to the windows around one, too.
    method Focused {} {
        if {[focus -displayof $win] eq $win} {
            focus $scene
        }
    }
    method Remove {} {
        if {$chosenKeys ne {} || $chosenWires ne {}} {
            $self delete $chosenKeys $chosenWires
        }
    }
    method All {} {
        set chosenKeys [concat [dict keys $places] [dict keys $notes]]
        $self Selected
    }
    # What was begun ends, a look back and a comparison, too.
    method Escape {} {
        set drag [set chosenKeys [set chosenWires {}]]
        $scene rubber
        $scene band
        destroy $win.diff
        if {$moment ne {}} {
            $self present
        }
        $self Arrange
    }
    method Arrow {dx dy} {
        if {$chosenKeys ne {}} {
            $self move $chosenKeys $dx $dy
        } else {
            $scene follow [expr {-$dx * [::sorma::style pixels 40]}] [expr {-$dy * [::sorma::style pixels 40]}]
        }
    }
    # The next box, comment or frame, beside those that are kept.
    method Next step {
        set all [concat [dict keys $places] [dict keys $notes]]
        if {$all ne {}} {
            set at [lsearch -exact $all [lindex $chosenKeys end]]
            set key [lindex $all [expr {($at + ($at < 0 && $step < 0 ? 0 : $step)) % [llength $all]}]]
            set chosenKeys [concat [lsearch -all -inline -exact -not $kept $key] [list $key]]
            set chosenWires {}
            set hint [Named [list $key]]
            $self Selected
            $self See [list $key]
        }
    }
    method Keep {} {
        set kept $chosenKeys
    }
    # The next wire; from a box, its first one.
    method NextWire step {
        set count [llength $ends]
        if {$count == 0 || [dict get $graph wires] eq {}} return
        set at [lindex $chosenWires 0]
        set mine [lmap end $ends {expr {[lindex $end 1] in $chosenKeys || [lindex $end 2] in $chosenKeys}}]
        set number [expr {$at ne {} ? ($at + $step) % $count : max(0, [lsearch -exact $mine 1])}]
        set chosenKeys {}
        set chosenWires [list $number]
        set hint [$self WireText $number]
        $self Selected
        $self See [lrange [lindex $ends $number] 1 2]
    }
    # Move the picture if none of these boxes is in the window.
    method See keys {
        lassign [$scene view] left top right bottom
        foreach key $keys {
            if {$key eq {}} continue
            lassign [$self box $key] x y width height
            if {$x < $right && $x + $width > $left && $y < $bottom && $y + $height > $top} return
            set last $key
        }
        $scene centre $last
    }
    # As a double click does.
    method LookInside {} {
        if {[lindex $chosenKeys end 0] eq "unit"} {
            $self OpenUnit [lindex $chosenKeys end 1]
        } elseif {$chosenWires ne {} || [dict exists $notes [lindex $chosenKeys end]]} {
            $self Line
        }
    }
    method Flip {} {
        set shown [expr {!$shown}]
        $self Values
    }
}
