# boardview.tcl -- a draughts board, drawn: fields, men and queens, and how certain an eye is of each.
#
#     checkers::boardview create b .canvas -width 8 -drop command
#     b lie {{3 3} yellow {4 8} {red red}}        place -> stack
#     b travel {3 3} {4 4}                        the token there goes there, in view
#     b certain {0.98 1 ...}                      of each field, the last rank first
#
# -drop: a command that gets two places when a person has dragged a token; empty: nobody can.

package require Tk
package require sorma::options
package provide checkers::boardview 1.0

oo::class create ::checkers::boardview {
    constructor {canvas args} {
        my variable Canvas Settings Lies Certain Dragged
        set Settings [sorma::options::parse {-width {any 8} -drop any -size {any 400}} $args]
        set Canvas [canvas $canvas -width [dict get $Settings -size] -height [dict get $Settings -size] -highlightthickness 0 -takefocus 0 -background [ttk::style lookup TFrame -background]]
        set Lies [set Certain [set Dragged {}]]
        bind $canvas <Configure> [list [self] draw]
        if {[dict get $Settings -drop] ne {}} {
            bind $canvas <ButtonPress-1> [list [self] take %x %y]
            bind $canvas <B1-Motion> [list [self] drag %x %y]
            bind $canvas <ButtonRelease-1> [list [self] drop %x %y]
        }
    }
    destructor {
        my variable Canvas
        if {[winfo exists $Canvas]} {
            bind $Canvas <Configure> {}
        }
    }
    method path {} { my variable Canvas; return $Canvas }

    method lie lies { my variable Lies; set Lies $lies; my draw }
    method certain values { my variable Certain; set Certain $values; my draw }

    # ---- where things are: around the board is room for the letters ----

    method Width {} { my variable Settings; return [dict get $Settings -width] }
    method Field {} {
        my variable Canvas
        return [expr {min([winfo width $Canvas], [winfo height $Canvas]) / ([my Width] + 1.2)}]
    }
    # The middle of a place, in pixels.
    method At {file rank} {
        my variable Canvas
        set field [my Field]
        set width [my Width]
        return [list [expr {[winfo width $Canvas] / 2.0 + ($file - ($width + 1) / 2.0) * $field}] \
            [expr {[winfo height $Canvas] / 2.0 - ($rank - ($width + 1) / 2.0) * $field}]]
    }
    method PlaceOf {x y} {
        lassign [my At 0 0] x0 y0
        return [list [expr {round(($x - $x0) / [my Field])}] [expr {round(($y0 - $y) / [my Field])}]]
    }

    # ---- drawing ----

    method draw {} {
        my variable Canvas Lies Certain
        $Canvas delete all
        set field [my Field]
        if {$field < 4} {
            return
        }
        set width [my Width]
        set h [expr {$field / 2}]
        lassign [my At 0.5 0.5] left bottom
        lassign [my At [expr {$width + 0.5}] [expr {$width + 0.5}]] right top
        set rim [expr {$field * 0.42}]
        my Rounded [expr {$left - $rim}] [expr {$top - $rim}] [expr {$right + $rim}] [expr {$bottom + $rim}] [expr {$field * 0.25}] #4a3020
        my Rounded [expr {$left - $rim * 0.9}] [expr {$top - $rim * 0.9}] [expr {$right + $rim * 0.9}] [expr {$bottom + $rim * 0.9}] [expr {$field * 0.22}] #6b4a30
        set i 0
        for {set rank $width} {$rank >= 1} {incr rank -1} {
            for {set file 1} {$file <= $width} {incr file} {
                lassign [my At $file $rank] x y
                set dark [expr {($file + $rank) % 2 == 0}]
                $Canvas create rectangle [expr {$x - $h}] [expr {$y - $h}] [expr {$x + $h}] [expr {$y + $h}] -width 0 -fill [expr {$dark ? "#40704c" : "#ece4ca"}]
                if {[llength $Certain] == $width * $width} {
                    my Bar $x $y $field [lindex $Certain $i]
                }
                incr i
            }
        }
        set font [list TkDefaultFont [expr {-int(max(7, $field * 0.24))}]]
        for {set n 1} {$n <= $width} {incr n} {
            lassign [my At $n 0.5] x y
            $Canvas create text $x [expr {$y + $rim / 2}] -text [string index abcdefghij [expr {$n - 1}]] -fill #e8d8b8 -font $font
            lassign [my At 0.5 $n] x y
            $Canvas create text [expr {$x - $rim / 2}] $y -text $n -fill #e8d8b8 -font $font
        }
        dict for {place stack} $Lies {
            my Token $place $stack
        }
    }
    method Rounded {x1 y1 x2 y2 r colour} {
        my variable Canvas
        $Canvas create polygon [expr {$x1 + $r}] $y1 [expr {$x2 - $r}] $y1 $x2 $y1 $x2 [expr {$y1 + $r}] $x2 [expr {$y2 - $r}] $x2 $y2 \
            [expr {$x2 - $r}] $y2 [expr {$x1 + $r}] $y2 $x1 $y2 $x1 [expr {$y2 - $r}] $x1 [expr {$y1 + $r}] $x1 $y1 -smooth 1 -fill $colour
    }
    # Less than certain: a bar at the field's bottom, shorter and redder.
    method Bar {x y field value} {
        my variable Canvas
        set value [expr {max(0, min(1, $value))}]
        set length [expr {$field * 0.8 * $value}]
        set y [expr {$y + $field * 0.43}]
        $Canvas create line [expr {$x - $field * 0.4}] $y [expr {$x - $field * 0.4 + $length}] $y -width [expr {max(1, $field * 0.05)}] \
            -fill [expr {$value >= 0.8 ? "#7fd08a" : $value >= 0.6 ? "#e8c050" : "#e05040"}]
    }
    method Token {place stack} {
        my variable Canvas
        set tag [my Tag $place]
        set r [expr {[my Field] * 0.39}]
        lassign [my At {*}$place] x y
        set level 0
        foreach colour $stack {
            lassign [expr {$colour eq "red" ? {#c8322a #7c1712 #e2605a} : {#f0c838 #94761a #fbe48c}}] face edge light
            set z [expr {$level * $r * 0.22}]
            $Canvas create oval [expr {$x - $r}] [expr {$y - $r + $r * 0.14 - $z}] [expr {$x + $r}] [expr {$y + $r + $r * 0.14 - $z}] -fill $edge -width 0 -tags $tag
            $Canvas create oval [expr {$x - $r}] [expr {$y - $r - $z}] [expr {$x + $r}] [expr {$y + $r - $z}] -fill $face -outline $edge -tags $tag
            foreach part {0.78 0.5} {
                set q [expr {$r * $part}]
                $Canvas create oval [expr {$x - $q}] [expr {$y - $q - $z}] [expr {$x + $q}] [expr {$y + $q - $z}] -outline $edge -tags $tag
                $Canvas create arc [expr {$x - $q}] [expr {$y - $q - $z}] [expr {$x + $q}] [expr {$y + $q - $z}] -start 60 -extent 120 -style arc -outline $light \
                    -width [expr {max(1, $r * 0.06)}] -tags $tag
            }
            incr level
        }
        # A queen wears a crown.
        if {$level == 2 && [lindex $place 0] >= 1 && [lindex $place 0] <= [my Width]} {
            set q [expr {$r * 0.4}]
            set y [expr {$y - $r * 0.22}]
            set points {}
            foreach {a b} {-1 0.7 -1 -0.5 -0.5 0.1 0 -0.8 0.5 0.1 1 -0.5 1 0.7} {
                lappend points [expr {$x + $a * $q}] [expr {$y + $b * $q}]
            }
            $Canvas create polygon $points -fill [expr {$colour eq "red" ? "#ffe9b0" : "#7a4a08"}] -outline $edge -tags $tag
        }
    }
    method Tag place { return "t[join $place _]" }

    # ---- a token on its way ----

    method travel {from to {steps 12}} {
        my variable Canvas
        lassign [my At {*}$from] x y
        lassign [my At {*}$to] u v
        $Canvas raise [my Tag $from]
        my Step [my Tag $from] [expr {($u - $x) / $steps}] [expr {($v - $y) / $steps}] $steps
    }
    method Step {tag dx dy steps} {
        my variable Canvas
        if {[winfo exists $Canvas] && $steps > 0} {
            $Canvas move $tag $dx $dy
            after 25 [list catch [list [namespace which my] Step $tag $dx $dy [expr {$steps - 1}]]]
        }
    }

    # ---- a person's mouse ----

    method take {x y} {
        my variable Lies Dragged Canvas
        set place [my PlaceOf $x $y]
        set Dragged [expr {[dict exists $Lies $place] ? [list $place $x $y] : {}}]
        if {$Dragged ne {}} {
            $Canvas raise [my Tag $place]
        }
    }
    method drag {x y} {
        my variable Dragged Canvas
        if {$Dragged ne {}} {
            lassign $Dragged place u v
            $Canvas move [my Tag $place] [expr {$x - $u}] [expr {$y - $v}]
            set Dragged [list $place $x $y]
        }
    }
    method drop {x y} {
        my variable Dragged Settings
        if {$Dragged ne {}} {
            set from [lindex $Dragged 0]
            set Dragged {}
            set to [my PlaceOf $x $y]
            if {$from ne $to} {
                {*}[dict get $Settings -drop] $from $to
            }
            my draw
        }
    }
}
