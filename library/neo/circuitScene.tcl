# circuitScene.tcl -- sorma::circuitScene: the drawing of a circuit on a canvas, with zoom and pan. It is told what to draw, and tells what lies
# below the pointer; it knows no bus.

package require Tk
package require snit
package require sorma::circuitLayout
package require sorma::parts
package require sorma::style
package provide sorma::circuitScene 1.0

# ::sorma::circuitScene .w --
#       A canvas. Places are counted in steps of the grid, as circuitLayout has them.
# Methods:
#       show NODES WIRES ?NOTES?    NODES: dict KEY -> {kind ins outs box state}, box: {x y width height}; state: live or one that sorma::style has.
#                           WIRES: list of dicts: way (x1 y1 ...), ends {FROM TO} (KEYs), count of elements (empty: not known), state,
#                           end (1: the value stands at the sink); NOTES: dict KEY -> {kind box text}, kind: note or frame
#       way NUMBER WAY      another way of that wire, with the same ends
#       view                {left top right bottom} of what is seen, in the grid; <<ViewChanged>> says that it is another
#       values TEXTS        a text for each wire, in their order
#       probes DICT         number of a wire -> {kind samples}, as circuitProbes has them
#       select KEYS NUMBERS of nodes and wires
#       hit X Y             what is at a pixel: {node KEY}, also of a note or frame, {corner KEY} of a frame, {pin KEY ins|outs NAME}, {wire NUMBER},
#                           or nothing, as inside of a frame
#       at X Y, pixel X Y   the grid at a pixel of the window; where a place of the grid is
#       zoom ?FACTOR? ?X Y? the scale; times FACTOR, with this pixel staying where it is
#       fit                 all of it in the window;  centre KEY: that node in the middle;  follow DX DY: pan by pixels
#       grey BOOL           are the values old: boxes have a dashed rim, and all is grey
#       size KEY WIDTH HEIGHT   of a frame, until the next show
#       shift KEYS DX DY    these nodes, so many steps from where they are; until the next show. Wires follow without regard to boxes
#       rubber ?X1 Y1 X2 Y2 WHY?    a wire that is drawn, in pixels; WHY it does not fit, or nothing
#       band ?X1 Y1 X2 Y2?  a rectangle
#       save FILE           the picture, as parts::picture takes names
snit::widgetadaptor ::sorma::circuitScene {
    delegate method * to hull
    delegate option * to hull
    variable nodes {}
    variable wires {}
    variable notes {}
    variable texts {}
    variable outlines {}        ;# dict: number of a node -> the item of its outline
    variable written {}         ;# dict: number of a wire -> the item of its value
    variable drawn {}           ;# {ZOOM NODES WIRES NOTES}, as they stand on the canvas; nothing: draw all anew
    variable shifted {}         ;# keys of nodes that shift has moved since
    variable probes {}
    variable hung {}            ;# dict: number of a wire -> where its probe hangs, as circuitLayout has it
    variable chosen {{} {}}     ;# keys, numbers
    variable zoom 1.0
    variable old 0
    variable moving {0 0}       ;# steps by which nodes are shifted
    variable sized {0 0}        ;# width and height of the window when all was fitted
    variable fitted 1           ;# all is shown as large as it fits, until somebody zooms
    variable keys {}            ;# dict: number of a node, as in tags -> KEY; those of notes follow
    typevariable Old {box {surface ground edge off} dot {surface ground quiet off} wire {quiet off} value {text stale}}   ;# what is another token when values are old
    typevariable Least 0.08
    typevariable Most 4.0

    constructor args {
        installhull using canvas -highlightthickness 1 -takefocus 1 -width 400 -height 300 -confine 0
        $self configurelist $args
        foreach kind {plain strong small} {
            ::font create sorma-scene$win-$kind
        }
        bind $win <<ThemeChanged>> [mymethod Anew]
        bind $win <Configure> [mymethod Shown 1]
    }
    destructor {
        foreach kind {plain strong small} {
            catch {::font delete sorma-scene$win-$kind}
        }
    }

    # ---- what programs say ----

    method show {given ways {remarks {}}} {
        set nodes $given
        set notes $remarks
        set wires $ways
        set hung {}
        $self Shown 0
    }
    # Boxes stay where somebody has put them, while all is in the window. A line of text that comes below the picture moves nothing, either. A circuit
    # that comes is fitted.
    method Shown resized {
        lassign $sized width height
        set same [expr {abs([winfo width $win] - $width) + abs([winfo height $win] - $height) < [::sorma::style pixels 60]}]
        set comes [expr {$drawn eq {} || [dict size [lindex $drawn 1]] == 0 && [dict size $nodes] > 1}]
        if {$fitted && !$comes && (!$resized || $same) && [$self Inside]} {
            $self Draw
            event generate $win <<ViewChanged>>
        } else {
            $self Sized
        }
    }
    method way {number way} {
        set step [$self Step]
        lset wires $number [dict replace [lindex $wires $number] way $way]
        set hung {}
        $hull coords w$number&&wire [lmap c $way {expr {$c * $step}}]
        if {[llength $drawn] > 0} {
            lset drawn 2 $wires
        }
    }
    method save file {
        set edge [::sorma::style pixels 8]
        lassign [$hull bbox all] left top right bottom
        ::sorma::parts::picture $win $file [if {$bottom ne {}} {list [expr {$left - $edge}] [expr {$top - $edge}] [expr {$right + $edge}] [expr {$bottom + $edge}]}]
    }
    method view {} {
        return [concat [$self at 0 0] [$self at [winfo width $win] [winfo height $win]]]
    }
    method values given {
        set n -1
        foreach text $given before $texts {
            incr n
            if {$text ne $before && [dict exists $written $n]} {
                $hull itemconfigure [dict get $written $n] -text $text
            }
        }
        set texts $given
    }
    # Are values written at this zoom?
    method writes {} {
        return [expr {$zoom >= 0.45}]
    }
    method probes given {
        set probes $given
        $self DrawProbes
    }
    method select {these numbers} {
        if {$chosen ne [list $these $numbers]} {
            set chosen [list $these $numbers]
            $self Tint
        }
    }
    method grey bool {
        if {$old != $bool} {
            set old $bool
            $self Tint
        }
    }
    method zoom {{factor {}} {x {}} {y {}}} {
        if {$factor eq {}} {
            return $zoom
        }
        if {$x eq {}} {
            set x [expr {[winfo width $win] / 2}]
            set y [expr {[winfo height $win] / 2}]
        }
        lassign [$self at $x $y] column row
        set fitted 0
        set zoom [expr {max($Least, min($Most, $zoom * $factor))}]
        $self Draw
        $self Move $column $row $x $y
    }
    method fit {} {
        set fitted 1
        $self Sized
    }
    method centre key {
        lassign [dict get [dict merge $nodes $notes] $key box] x y width height
        set fitted 0
        $self Move [expr {$x + $width / 2.0}] [expr {$y + $height / 2.0}] [expr {[winfo width $win] / 2}] [expr {[winfo height $win] / 2}]
    }
    method follow {dx dy} {
        set fitted 0
        $hull scan mark 0 0
        $hull scan dragto $dx $dy 1
        event generate $win <<ViewChanged>>
    }
    method at {x y} {
        set step [$self Step]
        return [list [expr {[$hull canvasx $x] / $step}] [expr {[$hull canvasy $y] / $step}]]
    }
    method pixel {x y} {
        set step [$self Step]
        return [list [expr {round($x * $step - [$hull canvasx 0])}] [expr {round($y * $step - [$hull canvasy 0])}]]
    }
    method hit {x y} {
        set X [$hull canvasx $x]
        set Y [$hull canvasy $y]
        set halo [::sorma::style pixels 5]
        set found {}
        foreach item [$hull find overlapping [expr {$X - $halo}] [expr {$Y - $halo}] [expr {$X + $halo}] [expr {$Y + $halo}]] {
            set tags [$hull gettags $item]
            lassign $tags kind number side name
            switch -- $kind {
                pin { set found [list pin [dict get $keys $number] $side $name] }
                corner { if {[lindex $found 0] ne "pin"} {set found [list corner [dict get $keys $number]]} }
                node { if {[lindex $found 0] ni {pin corner}} {set found [list node [dict get $keys $number]]} }
                wire - probe { if {$found eq {} || [lindex $found 0] eq "wire"} {set found [list wire $number]} }
            }
        }
        return $found
    }

    method shift {moved dx dy} {
        set step [$self Step]
        lassign $moving X Y
        set n -1
        dict for {key node} [dict merge $nodes $notes] {
            incr n
            if {$key in $moved} {
                $hull move n$n [expr {($dx - $X) * $step}] [expr {($dy - $Y) * $step}]
            }
        }
        set moving [list $dx $dy]
        set shifted $moved
        set n -1
        foreach wire $wires {
            incr n
            lassign [lmap key [dict get $wire ends] {expr {$key in $moved}}] from to
            if {!$from && !$to} continue
            set way [dict get $wire way]
            lassign [list [expr {[lindex $way 0] + $from * $dx}] [expr {[lindex $way 1] + $from * $dy}] \
                [expr {[lindex $way end-1] + $to * $dx}] [expr {[lindex $way end] + $to * $dy}]] x y a b
            $hull coords w$n&&wire [lmap c [list $x $y [expr {($x + $a) / 2.0}] $y [expr {($x + $a) / 2.0}] $b $a $b] {expr {$c * $step}}]
            $hull itemconfigure v$n -text {}
            $hull delete p$n
        }
    }
    method rubber args {
        $hull delete rubber
        if {$args eq {}} return
        lassign $args x1 y1 x2 y2 why
        lassign [lmap c [list $x1 $x2] {$hull canvasx $c}] x1 x2
        lassign [lmap c [list $y1 $y2] {$hull canvasy $c}] y1 y2
        set colour [::sorma::style token [expr {$why eq {} ? "accent" : "error"}]]
        $hull create line $x1 $y1 $x2 $y2 -fill $colour -width [::sorma::style pixels 2] -tags rubber
        set text [$hull create text [expr {$x2 + [::sorma::style pixels 12]}] [expr {$y2 + [::sorma::style pixels 12]}] -anchor nw -text $why -fill $colour \
            -width [::sorma::style pixels 260] -font TkDefaultFont -tags rubber]
        if {$why ne {}} {
            lassign [$hull bbox $text] left top right bottom
            set pad [::sorma::style pixels 4]
            $hull create rectangle [expr {$left - $pad}] [expr {$top - $pad}] [expr {$right + $pad}] [expr {$bottom + $pad}] -fill [::sorma::style token surface] -outline $colour -tags {rubber ground}
            $hull raise $text
        }
    }
    method band args {
        $hull delete band
        if {$args eq {}} return
        lassign $args x1 y1 x2 y2
        $hull create rectangle [$hull canvasx $x1] [$hull canvasy $y1] [$hull canvasx $x2] [$hull canvasy $y2] -dash {4 3} \
            -outline [::sorma::style token accent] -tags band
    }

    # ---- drawing ----

    method Step {} {
        return [expr {[::sorma::style pixels 800] / 100.0 * $zoom}]
    }
    # Put a place of the grid at a pixel of the window.
    method Move {column row x y} {
        set step [$self Step]
        $hull scan mark 0 0
        $hull scan dragto [expr {round($x - ($column * $step - [$hull canvasx 0]))}] [expr {round($y - ($row * $step - [$hull canvasy 0]))}] 1
        event generate $win <<ViewChanged>>
    }
    # {left top right bottom} of all, in the grid.
    method Extent {} {
        set left [set top 1000000000]
        set right [set bottom -1000000000]
        dict for {key node} [dict merge $nodes $notes] {
            lassign [dict get $node box] x y width height
            set left [expr {min($left, $x)}]
            set top [expr {min($top, $y)}]
            set right [expr {max($right, $x + $width)}]
            set bottom [expr {max($bottom, $y + $height)}]
        }
        foreach wire $wires {
            foreach {x y} [dict get $wire way] {
                set top [expr {min($top, $y)}]
                set bottom [expr {max($bottom, $y)}]
            }
        }
        return [if {$right < $left} {list 0 0 1 1} else {list $left $top $right $bottom}]
    }
    method Inside {} {
        lassign [$self view] x1 y1 x2 y2
        lassign [$self Extent] left top right bottom
        return [expr {$left >= $x1 && $top >= $y1 && $right <= $x2 && $bottom <= $y2}]
    }
    method Sized {} {
        if {!$fitted} {
            $self Draw
            event generate $win <<ViewChanged>>
            return
        }
        set sized [list [winfo width $win] [winfo height $win]]
        lassign [$self Extent] left top right bottom
        set step [expr {[$self Step] / $zoom}]
        set width [expr {max(1, [winfo width $win] - [::sorma::style pixels 40])}]
        set height [expr {max(1, [winfo height $win] - [::sorma::style pixels 40])}]
        set zoom [expr {max($Least, min(1.0, $width / (($right - $left) * $step), $height / (($bottom - $top) * $step)))}]
        $self Draw
        $self Move [expr {($left + $right) / 2.0}] [expr {($top + $bottom) / 2.0}] [expr {[winfo width $win] / 2}] [expr {[winfo height $win] / 2}]
    }
    method Anew {} {
        set drawn {}
        $self Draw
    }
    # Few that differ from what stands there are drawn again, at the same zoom; else all.
    method Draw {} {
        if {![$self Patch]} {
            $self DrawAll
        }
        set moving {0 0}
        set shifted {}
        set drawn [list $zoom $nodes $wires $notes]
        $self Tint
    }
    method Patch {} {
        lassign $drawn size stood led noted
        if {[llength $drawn] == 0 || $size != $zoom || $noted ne $notes || [llength $led] != [llength $wires] || [dict keys $stood] ne [dict keys $nodes]} {
            return 0
        }
        set n -1
        set boxes [set lines {}]
        dict for {key node} $nodes {
            incr n
            if {$key in $shifted || $node ne [dict get $stood $key]} {
                lappend boxes $n $key $node
            }
        }
        set n -1
        foreach wire $wires before $led {
            incr n
            if {$wire ne $before || $shifted ne {} && ([lindex [dict get $wire ends] 0] in $shifted || [lindex [dict get $wire ends] 1] in $shifted)} {
                lappend lines $n $wire
            }
        }
        if {[llength $boxes] + [llength $lines] > 300 || [lsearch -exact $shifted {note *}] >= 0} {
            return 0
        }
        foreach {n wire} $lines {
            $hull delete w$n v$n
            $self DrawWire $n $wire
            $hull lower w$n box
            $hull lower v$n box
        }
        foreach {n key node} $boxes {
            $hull delete n$n
            $self DrawNode $n $key $node
        }
        return 1
    }
    method DrawAll {} {
        $hull delete all
        set written {}
        foreach {kind font weight} {plain TkDefaultFont normal strong TkDefaultFont bold small TkSmallCaptionFont normal} {
            set size [expr {max(1, round([::font metrics $font -ascent] * 1.05 * $zoom))}]
            ::font configure sorma-scene$win-$kind {*}[::font actual $font] -size -$size -weight $weight
        }
        $hull configure -background [::sorma::style token ground] -highlightbackground [::sorma::style token line] -highlightcolor [::sorma::style token accent]
        set keys {}
        set n [expr {[dict size $nodes] - 1}]
        dict for {key note} $notes {
            dict set keys [incr n] $key
            $self Draw[dict get {note Note frame Frame} [dict get $note kind]] $n $note
        }
        set n -1
        foreach wire $wires {
            $self DrawWire [incr n] $wire
        }
        set n -1
        dict for {key node} $nodes {
            dict set keys [incr n] $key
            $self DrawNode $n $key $node
        }
    }
    method DrawWire {n wire} {
        set step [$self Step]
        set way [dict get $wire way]
        set count [dict get $wire count]
        set thick [expr {max(1, round([::sorma::style pixels [expr {$count ne {} && $count > 1 ? 3 : 2}]] * min(1.0, $zoom)))}]
        set dash [if {[dict get $wire state] ni {live {}}} {list -dash [list [expr {3 * $thick}] [expr {2 * $thick}]]}]
        $hull create line [lmap c $way {expr {$c * $step}}] -width $thick -tags [list wire $n w$n] -joinstyle round {*}$dash
        if {$zoom < 0.45} return
        lassign [if {[dict get $wire end]} {list {*}[lrange $way end-1 end] se -0.6} else {list {*}[lrange $way 0 1] sw 0.6}] x y anchor shift
        dict set written $n [$hull create text [expr {($x + $shift) * $step}] [expr {$y * $step - $thick}] -anchor $anchor -tags [list value $n v$n] \
            -font sorma-scene$win-small -text [lindex $texts $n]]
    }
    method DrawNode {n key node} {
        set step [$self Step]
        lassign [dict get $node box] x y width height
        set kind [dict get $node kind]
        lassign [lmap c [list $x $y [expr {$x + $width}] [expr {$y + $height}]] {expr {$c * $step}}] left top right bottom
        set tags [list node $n n$n]
        if {$kind eq "unit"} {
            dict set outlines $n [$hull create polygon [Round $left $top $right $bottom [expr {0.8 * $step}]] -smooth 1 -tags [concat $tags box]]
        } else {
            # A flag that points with the signal.
            set tip [expr {1.6 * $step}]
            dict set outlines $n [$hull create polygon $left $top [expr {$right - $tip}] $top $right [expr {($top + $bottom) / 2}] \
                [expr {$right - $tip}] $bottom $left $bottom -tags [concat $tags box]]
        }
        if {$zoom < 0.2} return
        set title [lindex $key 1]
        if {[dict get $node state] ne "live"} {
            set title "[::sorma::style mark [dict get $node state]] $title"
        }
        if {$kind ne "unit"} {
            $hull create text [expr {$left + 1.5 * $step}] [expr {($top + $bottom) / 2}] -anchor w -font sorma-scene$win-plain \
                -text [$self Fit $title plain [expr {$right - $left - 3 * $step}]] -tags [concat $tags title]
        } else {
            # A mark before the name may need more room than the box has for it.
            set width [expr {$right - $left - 0.6 * $step}]
            set font [lindex [concat [lmap font {strong plain small} {if {[::font measure sorma-scene$win-$font $title] > $width} continue; set font}] small] 0]
            $hull create text [expr {($left + $right) / 2}] [expr {$top + 1.6 * $step}] -font sorma-scene$win-$font \
                -text [$self Fit $title $font $width] -tags [concat $tags title]
        }
        foreach {side edge anchor shift} [list ins $left w 1 outs $right e -1] {
            foreach pin [dict get $node $side] {
                $self DrawPin $n $node $side $pin $edge [expr {($y + [::sorma::circuitLayout pin $node $side $pin]) * $step}] $anchor $shift
            }
        }
    }
    # A frame lies below all else. Its edge, title and corner can be taken; what is inside is ground.
    method DrawFrame {n note} {
        set step [$self Step]
        lassign [dict get $note box] x y width height
        lassign [lmap c [list $x $y [expr {$x + $width}] [expr {$y + $height}]] {expr {$c * $step}}] left top right bottom
        set tags [list node $n n$n]
        $hull create rectangle $left $top $right $bottom -tags [list ground n$n face]
        $hull create line $left $top $right $top $right $bottom $left $bottom $left $top -tags [concat $tags rim]
        set r [expr {min(1.5, $width, $height) * $step}]
        $hull create polygon $right [expr {$bottom - $r}] $right $bottom [expr {$right - $r}] $bottom -tags [list corner $n n$n grip]
        if {$zoom < 0.2} return
        $hull create text [expr {$left + $step}] [expr {$top + 1.6 * $step}] -anchor w -font sorma-scene$win-strong \
            -text [$self Fit [dict get $note text] strong [expr {$right - $left - 2 * $step}]] -tags [concat $tags remark]
    }
    method size {key width height} {
        set n [lsearch -exact [dict keys [dict merge $nodes $notes]] $key]
        $hull delete n$n
        $self DrawFrame $n [dict replace [dict get $notes $key] box [concat [lrange [dict get $notes $key box] 0 1] $width $height]]
        $hull lower n$n
        $self Tint
    }
    method DrawNote {n note} {
        set step [$self Step]
        lassign [dict get $note box] x y width height
        lassign [lmap c [list $x $y [expr {$x + $width}] [expr {$y + $height}]] {expr {$c * $step}}] left top right bottom
        set tags [list node $n n$n]
        $hull create rectangle $left $top $right $bottom -width 0 -tags [concat $tags face]
        $hull create line $left $top $left $bottom -width [expr {0.4 * $step}] -tags [concat $tags side]
        if {$zoom < 0.2} return
        set row [expr {$top + 1.5 * $step}]
        foreach line [split [dict get $note text] \n] {
            $hull create text [expr {$left + $step}] $row -anchor w -font sorma-scene$win-plain \
                -text [$self Fit $line plain [expr {$right - $left - 1.5 * $step}]] -tags [concat $tags remark]
            set row [expr {$row + 2 * $step}]
        }
    }
    method DrawPin {n node side pin x y anchor shift} {
        set step [$self Step]
        set tags [list pin $n $side $pin n$n]
        set r [expr {max(1.5, 0.45 * $step)}]
        $hull create oval [expr {$x - $r}] [expr {$y - $r}] [expr {$x + $r}] [expr {$y + $r}] -tags [concat $tags dot]
        if {$zoom >= 0.45 && [dict get $node kind] eq "unit"} {
            $hull create text [expr {$x + 0.9 * $shift * $step}] $y -anchor $anchor -text $pin -font sorma-scene$win-small -tags [concat $tags name]
        }
    }
    method Fit {text kind width} {
        if {[::font measure sorma-scene$win-$kind $text] <= $width} {
            return $text
        }
        while {[string length $text] > 1 && [::font measure sorma-scene$win-$kind $text\u2026] > $width} {
            set text [string range $text 0 end-1]
        }
        return $text\u2026
    }
    proc Round {left top right bottom r} {
        return [list $left $top [expr {$left + $r}] $top [expr {$left + $r}] $top [expr {$right - $r}] $top [expr {$right - $r}] $top $right $top \
            $right [expr {$top + $r}] $right [expr {$top + $r}] $right [expr {$bottom - $r}] $right [expr {$bottom - $r}] $right $bottom \
            [expr {$right - $r}] $bottom [expr {$right - $r}] $bottom [expr {$left + $r}] $bottom [expr {$left + $r}] $bottom $left $bottom \
            $left [expr {$bottom - $r}] $left [expr {$bottom - $r}] $left [expr {$top + $r}] $left [expr {$top + $r}]]
    }

    # Give all its colours: old values are grey, chosen boxes and wires have the accent.
    method Tint {} {
        set line [expr {max(1, round([::sorma::style pixels 1] * min(1.0, $zoom)))}]
        foreach {tag options} [list box {-fill surface -outline edge} title {-fill text} dot {-fill surface -outline quiet} name {-fill quiet} \
                wire {-fill quiet} value {-fill text} face {-fill surface -outline line} side {-fill quiet} rim {-fill line} grip {-fill edge} remark {-fill text}] {
            $hull itemconfigure $tag {*}[concat {*}[lmap {option token} $options {
                list $option [::sorma::style token [if {$old && [dict exists $Old $tag $token]} {dict get $Old $tag $token} else {set token}]]
            }]]
        }
        $hull itemconfigure box -width $line -dash [if {$old} {list [expr {3 * $line}] [expr {3 * $line}]}]
        foreach key [lindex $chosen 0] {
            if {[dict exists $notes $key]} {
                set n [expr {[dict size $nodes] + [lsearch -exact [dict keys $notes] $key]}]
                foreach part {side rim grip} {
                    $hull itemconfigure n$n&&$part -fill [::sorma::style token accent]
                }
                $hull itemconfigure n$n&&face -fill [::sorma::style token tint]
            }
        }
        set n -1
        set these {}
        foreach key [lindex $chosen 0] {
            dict set these $key 1
        }
        dict for {key node} $nodes {
            incr n
            set state [dict get $node state]
            if {$state ne "live"} {
                $hull itemconfigure [dict get $outlines $n] -outline [::sorma::style colour $state]
            }
            if {[dict exists $these $key]} {
                $hull itemconfigure [dict get $outlines $n] -outline [::sorma::style token accent] -fill [::sorma::style token tint] -width [expr {2 * $line}]
            }
        }
        set n -1
        foreach wire $wires {
            incr n
            set state [dict get $wire state]
            if {$state ni {live {}}} {
                $hull itemconfigure w$n -fill [::sorma::style colour $state]
                if {$state eq "refused"} {
                    $hull itemconfigure v$n -fill [::sorma::style colour $state]
                }
            }
            if {$n in [lindex $chosen 1]} {
                $hull itemconfigure w$n -fill [::sorma::style token accent]
                $hull raise w$n wire
            }
        }
        $self DrawProbes
    }

    # ---- probes: each hangs at a level piece of its wire, the longest one that has room for it ----

    method DrawProbes {} {
        $hull delete probe
        if {$zoom < 0.45} return
        set shown [dict filter $probes script {n -} {expr {$n < [llength $wires]}}]
        if {[dict keys $hung] ne [dict keys $shown]} {
            $self Hang [dict keys $shown]
        }
        set step [$self Step]
        dict for {n probe} $shown {
            lassign [dict get $hung $n] x y width - end
            if {$end ne {}} {
                $hull create line [lmap c [list {*}$end $x $y] {expr {$c * $step}}] -fill [::sorma::style token edge] -tags [list probe $n p$n]
            }
            $self Draw[dict get {chart Chart lamp Lamp} [dict get $probe kind]] $n [dict get $probe samples] {*}[lmap c [list $x $y $width] {expr {$c * $step}}]
        }
    }
    method Hang numbers {
        set hung {}
        set taken [lmap node [dict values $nodes] {dict get $node box}]
        foreach n $numbers {
            dict set hung $n [::sorma::circuitLayout probe [dict get [lindex $wires $n] way] {*}[dict get {chart {10 4} lamp {2 2}} [dict get $probes $n kind]] $taken]
            lassign [dict get $hung $n] x y width height
            lappend taken [list [expr {$x - $width / 2.0}] $y $width $height]
        }
    }
    method DrawChart {n samples x y width} {
        set step [$self Step]
        lassign [list [expr {$x - $width / 2}] [expr {$y + 4 * $step}] [expr {$width / 100.0}]] left bottom wide
        $hull create rectangle $left $y [expr {$left + $width}] $bottom -fill [::sorma::style token surface] -outline [::sorma::style token edge] -tags [list probe $n p$n frame]
        set all [lmap number [concat {*}$samples] {if {![Finite $number]} continue; set number}]
        if {$all eq {}} return
        set low [tcl::mathfunc::min {*}$all]
        set range [expr {[tcl::mathfunc::max {*}$all] - $low}]
        foreach element {0 1 2} colour {accent text quiet} {
            # The newest sample is at the right edge.
            set points {}
            set at [expr {$left + (99 - [llength $samples]) * $wide}]
            foreach sample $samples {
                set at [expr {$at + $wide}]
                set number [lindex $sample $element]
                if {[Finite $number]} {
                    lappend points $at [expr {$bottom - $step * (0.5 + ($range > 0 ? 3 * ($number - $low) / double($range) : 1.5))}]
                }
            }
            if {[llength $points] >= 4} {
                $hull create line $points -fill [$self Ink $colour] -width [::sorma::style pixels 1] -tags [list probe $n p$n]
            }
        }
    }
    # Filled: the first element is not 0.
    method DrawLamp {n samples x y -} {
        set r [$self Step]
        set number [lindex $samples end 0]
        set lit [expr {[Finite $number] && $number != 0}]
        $hull create oval [expr {$x - $r}] $y [expr {$x + $r}] [expr {$y + 2 * $r}] -width [::sorma::style pixels 2] -outline [$self Ink accent] \
            -fill [if {$lit} {$self Ink accent} else {::sorma::style token surface}] -tags [list probe $n p$n]
    }
    proc Finite number {
        return [expr {[string is double -strict $number] && ![string match -nocase {*[in]*} $number]}]
    }
    # Old values are grey.
    method Ink token {
        return [::sorma::style token [expr {$old ? "off" : $token}]]
    }
}
