# circuitClip.tcl -- ::sorma::circuitClip: copy and paste in the circuit editor, and aligned boxes.
#
# The clipboard has text: a dict of -wires and -places, as a circuit has them. So a selection can be pasted into another circuit, or a mail.

package require snit
package require sorma::circuitLayout
package require sorma::circuitText
package require sorma::table
package provide sorma::circuitClip 1.0

snit::macro ::sorma::circuitClip {} {
    # copy ?KEYS? -- these units, with their constants and the wires between them; default: those that are selected. Returns what was copied.
    method copy {{keys {}}} {
        set keys [lmap key [if {$keys ne {}} {set keys} else {set chosenKeys}] {if {[lindex $key 0] ne "unit"} continue; set key}]
        if {$keys eq {}} {
            set hint "[::sorma::style mark refused] copy: select units first"
            return
        }
        set lines [lmap wire [dict get $graph wires] {
            lassign [$self Ends $wire] - from to
            if {$to ni $keys || $from ne {} && $from ni $keys} continue
            lindex [dict get $graph pieces] [lindex $wire 0]
        }]
        clipboard clear -displayof $win
        clipboard append -displayof $win -- [list -wires [join $lines \n] -places [join [lmap key $keys {concat $key [dict get $places $key]}] \n]]
        set hint "copied: [join [lmap key $keys {lindex $key 1}] {, }]"
        return $keys
    }
    # cut -- what the clipboard has not taken, as a comment, stays.
    method cut {} {
        set keys [$self copy]
        if {$keys ne {}} {
            $self delete $keys {}
        }
    }
    # paste -- what was copied, as new units below the old ones. Returns their names.
    method paste {} {
        if {[catch {
            set text [clipboard get -displayof $win]
            set fixed [::sorma::circuitText places [dict get $text -places]]
            set wires [dict get [::sorma::circuitText graph [dict get $text -wires]] wires]
        }] || $fixed eq {}} {
            set hint "[::sorma::style mark refused] paste: the clipboard has no units of a circuit"
            return
        }
        if {![$self Editable paste]} return
        set names {}
        dict for {key -} $fixed {
            regexp {^([^.@]+)[^@]*(@.*)?$} [lindex $key 1] -> class where
            dict set names [lindex $key 1] [$self FreeName $class $where [dict values $names]]
        }
        # All of them so far below the old ones that each is on free ground.
        for {set down 0; set before {}} {$down ne $before} {} {
            set before $down
            dict for {key place} $fixed {
                lassign $place x y
                lassign [if {[dict exists $boxes $key]} {lrange [dict get $boxes $key] 2 3} else {list 12 9}] width height
                set down [expr {[lindex [::sorma::circuitLayout free [list $x [expr {$y + $down}]] $width $height [dict values $boxes]] 1] - $y}]
            }
        }
        set moved {}
        dict for {key place} $fixed {
            dict set moved [list unit [dict get $names [lindex $key 1]]] [list [lindex $place 0] [expr {[lindex $place 1] + $down}]]
        }
        set text [dict get $recipe -wires]
        foreach wire $wires {
            lassign [lmap end [lrange $wire 1 2] {
                ::sorma::circuitText write [if {[dict exists $names [lindex $end 0]]} {lreplace $end 0 0 [dict get $names [lindex $end 0]]} else {set end}]
            }] source sink
            set text [::sorma::circuitText add $text $source $sink]
        }
        foreach name [dict values $names] {
            $self AskPins $name 1
        }
        $self Edit "paste [join [dict values $names] {, }]" [dict create -wires $text -places [::sorma::circuitText place [dict get $recipe -places] $moved]]
        set chosenKeys [dict keys $moved]
        $self Selected
        return [dict values $names]
    }
    # A name of this class that no unit and no object has, WHERE it is: @PLACE, or nothing.
    method FreeName {class where {taken {}}} {
        set there [::sorma::table objects [expr {$where ne {} ? [string range $where 1 end] : [lindex [::sorma::table locate [$subject name]] 1]}]]
        for {set n 1} {[dict exists $graph nodes [list unit $class.$n$where]] || "$class.$n" in $there || "$class.$n$where" in $taken} {incr n} {}
        return $class.$n$where
    }
    # align SIDE ?KEYS? -- these boxes at the left, right, top or bottom edge of all of them.
    method align {side {keys {}}} {
        set keys [lmap key [if {$keys ne {}} {set keys} else {set chosenKeys}] {if {![dict exists $boxes $key]} continue; set key}]
        if {[llength $keys] < 2} return
        set at [dict get {left 0 right 0 top 1 bottom 1} $side]
        set far [expr {$side in {right bottom}}]
        set edges [lmap key $keys {expr {[lindex [dict get $boxes $key] $at] + $far * [lindex [dict get $boxes $key] $at+2]}}]
        set edge [expr {$far ? [tcl::mathfunc::max {*}$edges] : [tcl::mathfunc::min {*}$edges]}]
        set moved {}
        foreach key $keys {
            dict set moved $key [lreplace [dict get $places $key] $at $at [expr {$edge - $far * [lindex [dict get $boxes $key] $at+2]}]]
        }
        $self Edit "align $side" [dict create -places [::sorma::circuitText place [dict get $recipe -places] $moved]]
    }
}
