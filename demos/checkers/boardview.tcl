# boardview.tcl -- a draughts board, drawn: fields, men and queens, and how certain an eye is of each.
#
#     checkers::boardview create b .canvas -width 8 -heaps 1 -drop command
#     b lie {{3 3} yellow {4 8} {red red}}        place -> stack
#     b become {{4 4} yellow {4 8} {red red}}     the same, and what has moved goes there in view
#     b travel {3 3} {4 4}                        the token there goes there, in view
#     b certain {0.98 1 ...}                      of each field, the last rank first
#     b mark {{3 3} {4 4}}                        these fields have a frame: the last move
#     b resize 10                                 files of another board
#
# -drop: a command that gets two places when a person has carried a token with the mouse or the keys; empty: nobody can. Keys:
# the arrows move a cursor, Return or space takes a token and puts it down, Escape puts it back where it was. -goals: a command
# that gets the place of a token and returns its possible goals; they are shown while the token is carried. -heaps: shows the
# heaps beside the board, too.

package require Tk
package require sorma::options
package provide checkers::boardview 1.0

oo::class create ::checkers::boardview {
    variable Canvas Settings
    variable Lies               ;# what is shown: place -> stack
    variable Certain Marked     ;# as they were told last
    variable Dragged            ;# {place x y} of the token that the mouse holds; empty: none
    variable Cursor Lifted      ;# of the keys: {column rank}, and the place of the token that they hold
    variable Flights            ;# number of what is drawn: tokens on their way stop when there is another one
    constructor {canvas args} {
        set Settings [sorma::options::parse {-width {any 8} -drop any -goals any -heaps {boolean 0} -size {any 400}} $args]
        set size [dict get $Settings -size]
        set Canvas [canvas $canvas -height $size -highlightthickness 0 -takefocus 0 -background [ttk::style lookup TFrame -background] \
            -width [expr {round($size * [my Across] / ([dict get $Settings -width] + 1.2))}]]
        set Lies [set Certain [set Dragged [set Marked [set Lifted {}]]]]
        set Flights 0
        set Cursor {3 3}
        bind $canvas <Configure> [list [self] draw]
        bind $canvas <<ThemeChanged>> [list [self] themed]
        if {[dict get $Settings -drop] ne {}} {
            $canvas configure -takefocus 1
            bind $canvas <ButtonPress-1> "focus %W; [list [self] take] %x %y"
            bind $canvas <B1-Motion> [list [self] drag %x %y]
            bind $canvas <ButtonRelease-1> [list [self] drop %x %y]
            foreach {key dx dy} {Left -1 0 Right 1 0 Up 0 1 Down 0 -1} {
                bind $canvas <$key> "[list [self] go $dx $dy]; break"
            }
            foreach key {Return KP_Enter space} {
                bind $canvas <$key> "[list [self] press]; break"
            }
            bind $canvas <Escape> "if {\[[list [self] escape]\]} break"
            foreach event {FocusIn FocusOut} {
                bind $canvas <$event> [list [self] draw]
            }
        }
    }
    destructor {
        if {[winfo exists $Canvas]} {
            foreach event [bind $Canvas] {
                bind $Canvas $event {}
            }
        }
    }
    method path {} { return $Canvas }
    method themed {} { $Canvas configure -background [ttk::style lookup TFrame -background] }

    method lie lies { incr Flights; set Lies $lies; my draw }
    method certain values { set Certain $values; my draw }
    method mark places { set Marked $places; my draw }
    method resize width {
        dict set Settings -width $width
        set Cursor {3 3}
        my escape
        set Marked [set Certain {}]
        my lie {}
    }

    # ---- where things are: around the board is room for the letters, and perhaps for the heaps ----

    method Width {} { return [dict get $Settings -width] }
    method Heaps {} { return [dict get $Settings -heaps] }
    # Fields that have room beside each other.
    method Across {} { return [expr {[my Width] + ([my Heaps] ? 2.9 : 1.2)}] }
    method Field {} {
        return [expr {min([winfo width $Canvas] / [my Across], [winfo height $Canvas] / ([my Width] + 1.2))}]
    }
    # The middle of a place, in pixels.
    method At {file rank} {
        set field [my Field]
        set width [my Width]
        return [list [expr {[winfo width $Canvas] / 2.0 + ($file - ($width + 1) / 2.0) * $field}] \
            [expr {[winfo height $Canvas] / 2.0 - ($rank - ($width + 1) / 2.0) * $field}]]
    }
    method PlaceOf {x y} {
        lassign [my At 0 0] x0 y0
        return [my Place [expr {round(($x - $x0) / [my Field])}] [expr {round(($y0 - $y) / [my Field])}]]
    }
    # The column left of the board, 0, is that of heaps, and so is the one right of it.
    method Place {column rank} {
        set width [my Width]
        return [list [expr {![my Heaps] || ($column >= 1 && $column <= $width) ? $column : $column < 1 ? -0.4 : $width + 1.4}] $rank]
    }

    # ---- drawing ----

    method draw {} {
        if {$Lifted ne {} && ![dict exists $Lies $Lifted]} {
            set Lifted {}
        }
        if {$Dragged ne {}} return          ;# until the person has put it down
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
        foreach place $Marked {
            my Frame $place #e8b84a 0.06 {}
        }
        set font [list TkDefaultFont [expr {-int(max(7, $field * 0.24))}]]
        for {set n 1} {$n <= $width} {incr n} {
            lassign [my At $n 0.5] x y
            $Canvas create text $x [expr {$y + $rim / 2}] -text [string index abcdefghij [expr {$n - 1}]] -fill #e8d8b8 -font $font
            lassign [my At 0.5 $n] x y
            $Canvas create text [expr {$x - $rim / 2}] $y -text $n -fill #e8d8b8 -font $font
        }
        # Tokens in front hide those behind them.
        foreach place [lsort -decreasing -real -index 1 [dict keys $Lies]] {
            if {[my OnBoard $place] || [my Heaps]} {
                my Token $place [dict get $Lies $place]
            }
        }
        my Carried
    }
    method OnBoard place { return [expr {[lindex $place 0] >= 1 && [lindex $place 0] <= [my Width]}] }
    # A frame within a field, as thick as a part of it.
    method Frame {place colour part tag} {
        lassign [my At {*}$place] x y
        set h [expr {[my Field] * (0.5 - $part / 2)}]
        $Canvas create rectangle [expr {$x - $h}] [expr {$y - $h}] [expr {$x + $h}] [expr {$y + $h}] -outline $colour -width [expr {max(1, [my Field] * $part)}] \
            -tags $tag
    }
    # The cursor, what is carried with the keys, and where it may go.
    method Carried {} {
        $Canvas delete cursor goal
        set from [expr {$Dragged ne {} ? [lindex $Dragged 0] : $Lifted}]
        set field [my Field]
        if {$from ne {} && [dict get $Settings -goals] ne {}} {
            foreach place [{*}[dict get $Settings -goals] $from] {
                lassign [my At {*}$place] x y
                set r [expr {$field * 0.13}]
                $Canvas create oval [expr {$x - $r}] [expr {$y - $r}] [expr {$x + $r}] [expr {$y + $r}] -fill #f4e6a0 -outline #4a3020 -tags goal
            }
        }
        if {[dict get $Settings -drop] eq {} || [focus -displayof $Canvas] ne $Canvas || $Dragged ne {}} return
        set place [my Place {*}$Cursor]
        if {$Lifted ne {}} {
            # It hangs above the field of the cursor.
            lassign [my At {*}$Lifted] x y
            lassign [my At {*}$place] u v
            lassign [$Canvas coords [my Tag $Lifted]] x1 y1 x2 y2
            $Canvas raise [my Tag $Lifted]
            $Canvas move [my Tag $Lifted] [expr {$u + $field * 0.08 - ($x1 + $x2) / 2.0}] [expr {$v - $field * 0.08 - ($y1 + $y2) / 2.0}]
        }
        my Frame $place [expr {$Lifted eq {} ? "#2f7fe0" : "#f09020"}] 0.09 cursor
    }
    method Rounded {x1 y1 x2 y2 r colour} {
        $Canvas create polygon [expr {$x1 + $r}] $y1 [expr {$x2 - $r}] $y1 $x2 $y1 $x2 [expr {$y1 + $r}] $x2 [expr {$y2 - $r}] $x2 $y2 \
            [expr {$x2 - $r}] $y2 [expr {$x1 + $r}] $y2 $x1 $y2 $x1 [expr {$y2 - $r}] $x1 [expr {$y1 + $r}] $x1 $y1 -smooth 1 -fill $colour
    }
    # Less than certain: a bar at the field's bottom, shorter and redder.
    method Bar {x y field value} {
        set value [expr {max(0, min(1, $value))}]
        set length [expr {$field * 0.8 * $value}]
        set y [expr {$y + $field * 0.43}]
        $Canvas create line [expr {$x - $field * 0.4}] $y [expr {$x - $field * 0.4 + $length}] $y -width [expr {max(1, $field * 0.05)}] \
            -fill [expr {$value >= 0.8 ? "#7fd08a" : $value >= 0.6 ? "#e8c050" : "#e05040"}]
    }
    method Token {place stack} {
        set tag [my Tag $place]
        set r [expr {[my Field] * 0.39}]
        lassign [my At {*}$place] x y
        set level 0
        set step [expr {[my OnBoard $place] ? 0.22 : 0.12}]
        foreach colour $stack {
            lassign [expr {$colour eq "red" ? {#c8322a #7c1712 #e2605a} : {#f0c838 #94761a #fbe48c}}] face edge light
            set z [expr {$level * $r * $step}]
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
        if {$level > 1 && ![my OnBoard $place]} {
            $Canvas create text $x [expr {$y - $z}] -text $level -fill [expr {$colour eq "red" ? "#ffe9b0" : "#5a3a08"}] -tags $tag \
                -font [list TkDefaultFont [expr {-int(max(7, $r * 0.7))}] bold]
        } elseif {$level == 2} {
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

    # In 25 steps, slower at both ends.
    method travel {from to} {
        lassign [my At {*}$from] x y
        lassign [my At {*}$to] u v
        $Canvas raise [my Tag $from]
        my Step $Flights [my Tag $from] [expr {$u - $x}] [expr {$v - $y}] 1
    }
    # Items that were drawn again meanwhile are at their places.
    method Step {flight tag dx dy n} {
        if {![winfo exists $Canvas] || $flight != $Flights || $n > 25} return
        set part [expr {(cos(($n - 1) * 0.12566370614) - cos($n * 0.12566370614)) / 2}]
        $Canvas move $tag [expr {$dx * $part}] [expr {$dy * $part}]
        after 20 [list catch [list [namespace which my] Step $flight $tag $dx $dy [expr {$n + 1}]]]
    }
    method become lies {
        set pairs [my Moves $Lies $lies]
        # So many at once are a new game.
        if {$pairs eq {} || [llength $pairs] > 8} {
            my lie $lies
            return
        }
        my draw
        incr Flights
        foreach {from to} $pairs {
            my travel $from $to
        }
        set Lies $lies
        after 540 [list catch [list [namespace which my] Landed $Flights]]
    }
    method Landed flight {
        if {$flight == $Flights} {
            my draw
        }
    }
    # Pairs the places that stacks have left with the places of new stacks: the first to leave gets the nearest new place.
    method Moves {before after} {
        set gone {}
        foreach place [dict keys $before] {
            set stack [dict get $before $place]
            set now [expr {[dict exists $after $place] ? [dict get $after $place] : {}}]
            if {[llength $now] < [llength $stack] || ($now ne {} && [lindex $now 0] ne [lindex $stack 0])} {
                lappend gone $place
            }
        }
        set pairs {}
        dict for {place stack} $after {
            set was [expr {[dict exists $before $place] ? [dict get $before $place] : {}}]
            if {[llength $was] >= [llength $stack] && [lindex $was 0] eq [lindex $stack 0]} continue
            set least {}
            foreach from $gone {
                if {[lindex [dict get $before $from] 0] eq [lindex $stack 0] && $from ne $place && $from ni [dict keys $pairs]} {
                    set far [expr {hypot([lindex $from 0] - [lindex $place 0], [lindex $from 1] - [lindex $place 1])}]
                    if {$least eq {} || $far < $least} {
                        set least $far
                        set best $from
                    }
                }
            }
            if {$least ne {}} {
                lappend pairs $best $place
            }
        }
        return $pairs
    }

    # ---- a person's mouse ----

    method take {x y} {
        my escape
        set place [my PlaceOf $x $y]
        set Dragged [expr {[dict exists $Lies $place] ? [list $place $x $y] : {}}]
        set Cursor [my Column $place]
        my Carried
        if {$Dragged ne {}} {
            $Canvas raise [my Tag $place]
        }
    }
    method drag {x y} {
        if {$Dragged ne {}} {
            lassign $Dragged place u v
            $Canvas move [my Tag $place] [expr {$x - $u}] [expr {$y - $v}]
            set Dragged [list $place $x $y]
        }
    }
    method drop {x y} {
        if {$Dragged ne {}} {
            set from [lindex $Dragged 0]
            set Dragged {}
            my Put $from [my PlaceOf $x $y]
        }
    }
    # The token may have been taken away meanwhile.
    method Put {from to} {
        set Cursor [my Column $to]
        if {$from ne $to && [dict exists $Lies $from]} {
            {*}[dict get $Settings -drop] $from $to
        }
        my draw
    }

    # ---- a person's keys ----

    # Column and rank of a place, within what is shown.
    method Column place {
        set width [my Width]
        set edge [expr {[my Heaps] ? 0 : 1}]
        return [list [expr {max($edge, min($width + 1 - $edge, round([lindex $place 0])))}] [expr {max(1, min($width, [lindex $place 1]))}]]
    }
    method cursor {} { return [my Place {*}$Cursor] }
    method lifted {} { return $Lifted }
    method go {dx dy} {
        lassign $Cursor column rank
        set Cursor [my Column [list [expr {$column + $dx}] [expr {$rank + $dy}]]]
        my Carried
    }
    method press {} {
        set place [my cursor]
        if {$Lifted ne {}} {
            set from $Lifted
            set Lifted {}
            my Put $from $place
        } elseif {[dict exists $Lies $place]} {
            set Lifted $place
            my draw
        }
    }
    # Is there something that was put back?
    method escape {} {
        if {$Lifted eq {}} {
            return 0
        }
        set Lifted {}
        my draw
        return 1
    }
}
