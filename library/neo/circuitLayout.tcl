# circuitLayout.tcl -- where the boxes of a circuit stand when nobody has moved them: from left to right, as signals flow (layers.tcl). It knows
# no window. The same text gives the same picture.
#
# All is counted in steps of a grid, 8 pixels at 96 dots per inch and zoom 1. A place is the upper left corner of a box.
# node      a dict as circuitText has it: kind, ins, outs; key: {unit NAME} or {pin NAME}

package require sorma::circuitText
package require sorma::layers
package provide sorma::circuitLayout 1.0

namespace eval ::sorma::circuitLayout {
    namespace export size note pin place free probe
    namespace ensemble create
    variable Gap $::sorma::layers::gap
    variable Room $::sorma::layers::room
    variable Pitch 3            ;# rows from pin to pin
}

# ::sorma::circuitLayout size KEY NODE -- {width height} of a box.
proc ::sorma::circuitLayout::size {key node} {
    variable Pitch
    set title [string length [lindex $key 1]]
    if {[dict get $node kind] ne "unit"} {
        return [list [expr {min(30, max(6, ($title * 9 + 9) / 10 + 4))}] 4]
    }
    foreach side {ins outs} {
        set $side [tcl::mathfunc::max 0 {*}[lmap pin [dict get $node $side] {string length $pin}]]
    }
    set rows [expr {max(1, [llength [dict get $node ins]], [llength [dict get $node outs]])}]
    return [list [expr {min(36, max(10, ($title * 9 + 9) / 10 + 3, (($ins + $outs) * 9 + 9) / 10 + 4))}] [expr {3 + $Pitch * $rows}]]
}

# ::sorma::circuitLayout note TEXT -- {width height} of a comment.
proc ::sorma::circuitLayout::note text {
    set lines [split $text \n]
    return [list [expr {max(6, ([tcl::mathfunc::max {*}[lmap line $lines {string length $line}]] * 9 + 9) / 10 + 3)}] [expr {1 + 2 * [llength $lines]}]]
}

# ::sorma::circuitLayout pin NODE SIDE NAME -- the row of a pin in its box. SIDE: ins or outs.
proc ::sorma::circuitLayout::pin {node side name} {
    variable Pitch
    if {[dict get $node kind] ne "unit"} {
        return 2
    }
    return [expr {4 + $Pitch * max(0, [lsearch -exact [dict get $node $side] $name])}]
}

# ::sorma::circuitLayout place GRAPH ?FIXED? -- a dict KEY -> {x y} of all nodes. FIXED: those that have a place.
proc ::sorma::circuitLayout::place {graph {fixed {}}} {
    set nodes [dict get $graph nodes]
    set fixed [dict filter $fixed script {key -} {dict exists $nodes $key}]
    if {[dict size $fixed] == [dict size $nodes]} {
        return $fixed
    }
    set edges [Edges $graph]
    if {[dict size $fixed] > 0} {
        return [Fit $nodes $edges $fixed]
    }
    # Own inputs stand in the first column, own outputs in the last one.
    foreach kind {in out} {
        set $kind [dict keys [dict filter $nodes script {- node} {expr {[dict get $node kind] eq $kind}}]]
    }
    return [::sorma::layers::places [::sorma::layers::columns [dict keys $nodes] $edges $in $out] [dict map {key node} $nodes {size $key $node}] $edges]
}

# {FROM TO ROW1 ROW2} of each wire between two boxes; rows: of its pins.
proc ::sorma::circuitLayout::Edges graph {
    set nodes [dict get $graph nodes]
    return [lmap wire [dict get $graph wires] {
        lassign $wire - source sink
        if {[lindex $source 1] eq {}} continue
        set from [::sorma::circuitText::node $source]
        set to [::sorma::circuitText::node $sink]
        list $from $to [pin [dict get $nodes $from] outs [lindex $source 1]] [pin [dict get $nodes $to] ins [lindex $sink 1]]
    }]
}

# Places where some have one. The others follow in the order of the text. Each stands right of what it reads, else left of its reader, else
# below all; then as far below as there is room.
proc ::sorma::circuitLayout::Fit {nodes edges fixed} {
    variable Gap
    variable Room
    set places $fixed
    set sizes [dict map {key node} $nodes {size $key $node}]
    set beside {}               ;# dict: KEY without a place -> its edges
    foreach edge $edges {
        foreach key [lsort -unique [lrange $edge 0 1]] {
            if {![dict exists $places $key]} {
                dict lappend beside $key $edge
            }
        }
    }
    foreach key [dict keys $nodes] {
        if {[dict exists $places $key]} continue
        lassign [dict get $sizes $key] width height
        set at {}
        foreach edge [if {[dict exists $beside $key]} {dict get $beside $key}] {
            lassign $edge from to out in
            if {$to eq $key && [dict exists $places $from]} {
                lassign [dict get $places $from] x y
                set at [list [expr {$x + [lindex [dict get $sizes $from] 0] + $Gap}] [expr {$y + $out - $in}]]
                break
            } elseif {$from eq $key && $at eq {} && [dict exists $places $to]} {
                lassign [dict get $places $to] x y
                set at [list [expr {$x - $width - $Gap}] [expr {$y + $in - $out}]]
            }
        }
        if {$at eq {}} {
            set at [list [tcl::mathfunc::min {*}[lmap place [dict values $places] {lindex $place 0}]] \
                [tcl::mathfunc::max {*}[lmap {other place} $places {expr {[lindex $place 1] + [lindex [dict get $sizes $other] 1] + $Room}}]]]
        }
        dict set places $key [free $at $width $height [lmap {other place} $places {concat $place [dict get $sizes $other]}]]
    }
    return $places
}

# ::sorma::circuitLayout free PLACE WIDTH HEIGHT BOXES -- the next place below this one where such a box is on none of BOXES, {x y width height}.
proc ::sorma::circuitLayout::free {place width height boxes} {
    variable Room
    lassign $place x y
    # From above, so that one pass is enough.
    foreach box [lsort -integer -index 1 $boxes] {
        if {[Near [list $x $y $width $height] $box $Room]} {
            set y [expr {[lindex $box 1] + [lindex $box 3] + $Room}]
        }
    }
    return [list $x $y]
}

# ::sorma::circuitLayout probe WAY WIDTH HEIGHT BOXES -- where a probe of a wire hangs that is on none of BOXES: {X Y WIDTH HEIGHT END}. X, Y: the middle of
# its upper edge. It is below a level piece of WAY, or above it, of the longest one that has room. Where none has, it is farther below, and END is the
# place on the wire to which a line leads. A chart on a short piece is narrow.
proc ::sorma::circuitLayout::probe {way width height boxes} {
    set pieces [lsort -decreasing -real -index 0 [lmap {x y} [lrange $way 0 end-2] {X Y} [lrange $way 2 end] {
        if {$y != $Y} continue
        list [expr {abs($X - $x)}] [expr {($x + $X) / 2.0}] $y
    }]]
    lassign [concat [lindex $pieces 0] 0 [lrange $way 0 1]] length x y
    set width [expr {min($width, max(5, $length - 2))}]
    foreach piece $pieces {
        lassign $piece - middle row
        foreach top [list [expr {$row + 0.6}] [expr {$row - 0.6 - $height}]] {
            if {![Covers $boxes $middle $top $width $height]} {
                return [list $middle $top $width $height {}]
            }
        }
    }
    for {set top [expr {$y + 1.6}]} {[Covers $boxes $x $top $width $height]} {set top [expr {$top + 1}]} {}
    return [list $x $top $width $height [list $x $y]]
}
# Is a rectangle on one of the boxes? X Y: the middle of its upper edge.
proc ::sorma::circuitLayout::Covers {boxes x y width height} {
    set own [list [expr {$x - $width / 2.0}] $y $width $height]
    foreach box $boxes {
        if {[Near $own $box 0]} {
            return 1
        }
    }
    return 0
}
# Are two boxes nearer to each other than ROOM?
proc ::sorma::circuitLayout::Near {one two room} {
    lassign $one x y width height
    lassign $two left top wide high
    return [expr {$x < $left + $wide + $room && $x + $width + $room > $left && $y < $top + $high + $room && $y + $height + $room > $top}]
}
