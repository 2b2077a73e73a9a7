# layers.tcl -- where the boxes of a graph stand when nobody has moved them: in columns, from left to right. It knows no window.
#
# The layout depends on the graph alone: the same keys and edges in the same order give the same picture. The steps:
#     1. Edges that lead back are set aside. They are found depth first, in the order of the keys.
#     2. Each box stands in the column behind the last one that leads to it.
#     3. The order in a column is that of the boxes that it is joined to, on average (Sugiyama, Tagawa, Toda 1981).
#     4. A box stands where its middle edge is straight, if there is room.
#
# KEYS      of boxes, each once
# EDGES     list of {FROM TO ROW1 ROW2}: from a row of one box to a row of another; both are among the keys
#
# All is counted in steps of a grid, as in ways.tcl. A place is the upper left corner of a box.

package provide sorma::layers 1.0

namespace eval ::sorma::layers {
    variable gap 10             ;# steps between columns, at least
    variable room 3             ;# steps between the boxes of a column
}

# ::sorma::layers::columns KEYS EDGES ?FIRST? ?LAST? -- a list of columns, each a list of keys from above. FIRST: keys that stand before all
# others; LAST: keys that stand in the last column.
proc ::sorma::layers::columns {keys edges {first {}} {last {}}} {
    set forward [Forward $keys $edges]
    return [lsearch -all -inline -not -exact [Order $keys $forward [Columns $keys $forward $first $last]] {}]
}

# A dict FROM -> {TO ...}, each once, without those that lead back.
proc ::sorma::layers::Forward {keys edges} {
    set next [set into {}]
    foreach edge $edges {
        lassign $edge from to
        if {$from ne $to} {
            dict set next $from $to 1
            dict set into $to 1
        }
    }
    # First from those that nothing leads to; no recursion, since a chain may be long.
    set state [set forward {}]
    foreach root [concat [lmap key $keys {if {[dict exists $into $key]} continue; set key}] $keys] {
        if {[dict exists $state $root]} continue
        dict set state $root open
        set stack [list $root]
        set todo [list [if {[dict exists $next $root]} {dict keys [dict get $next $root]}]]
        while {[llength $stack] > 0} {
            set key [lindex $stack end]
            set rest [lassign [lindex $todo end] to]
            if {$to eq {}} {
                dict set state $key done
                set stack [lrange $stack 0 end-1]
                set todo [lrange $todo 0 end-1]
                continue
            }
            lset todo end $rest
            if {[dict exists $state $to] && [dict get $state $to] eq "open"} continue
            dict lappend forward $key $to
            if {![dict exists $state $to]} {
                dict set state $to open
                lappend stack $to
                lappend todo [if {[dict exists $next $to]} {dict keys [dict get $next $to]}]
            }
        }
    }
    return $forward
}

# A dict KEY -> column: the longest way from the left. A box that nothing leads to stands just before the first that it leads to.
proc ::sorma::layers::Columns {keys forward first last} {
    set missing {}
    set column {}
    foreach key $keys {
        dict set missing $key 0
        dict set column $key 1
    }
    foreach key $first {
        dict set column $key 0
    }
    foreach list [dict values $forward] {
        foreach to $list {
            dict incr missing $to
        }
    }
    set sources [set ready [lmap key $keys {if {[dict get $missing $key] > 0} continue; set key}]]
    for {set i 0} {$i < [llength $ready]} {incr i} {
        set key [lindex $ready $i]
        if {![dict exists $forward $key]} continue
        foreach to [dict get $forward $key] {
            dict set column $to [expr {max([dict get $column $to], [dict get $column $key] + 1)}]
            if {[dict incr missing $to -1; dict get $missing $to] == 0} {
                lappend ready $to
            }
        }
    }
    foreach key $sources {
        if {[dict get $column $key] > 0 && [dict exists $forward $key]} {
            dict set column $key [expr {[tcl::mathfunc::min {*}[lmap to [dict get $forward $key] {dict get $column $to}]] - 1}]
        }
    }
    set end [tcl::mathfunc::max 1 {*}[dict values $column]]
    foreach key $last {
        dict set column $key $end
    }
    return $column
}

# A list: the keys of each column, from above.
proc ::sorma::layers::Order {keys forward column} {
    set columns [lrepeat [expr {[tcl::mathfunc::max 0 {*}[dict values $column]] + 1}] {}]
    foreach key $keys {
        set n [dict get $column $key]
        lset columns $n [list {*}[lindex $columns $n] $key]
    }
    set backward {}
    dict for {from list} $forward {
        foreach to $list {
            dict lappend backward $to $from
        }
    }
    for {set sweep 0} {$sweep < 6} {incr sweep} {
        set rank {}
        foreach list $columns {
            set i 0
            foreach key $list {
                dict set rank $key [expr {(0.5 + $i) / [llength $list]}]
                incr i
            }
        }
        set near [expr {$sweep % 2 ? $forward : $backward}]
        for {set n 0} {$n < [llength $columns]} {incr n} {
            set c [expr {$sweep % 2 ? [llength $columns] - 1 - $n : $n}]
            set list [lmap item [lsort -real -index 0 [lmap key [lindex $columns $c] {list [Mean $key $near $rank] $key}]] {lindex $item 1}]
            lset columns $c $list
            set i 0
            foreach key $list {
                dict set rank $key [expr {(0.5 + $i) / [llength $list]}]
                incr i
            }
        }
    }
    return $columns
}
proc ::sorma::layers::Mean {key near rank} {
    if {![dict exists $near $key]} {
        return [dict get $rank $key]
    }
    set list [dict get $near $key]
    return [expr {[tcl::mathop::+ {*}[lmap other $list {dict get $rank $other}]] / [llength $list]}]
}

# ::sorma::layers::places COLUMNS SIZES EDGES -- a dict KEY -> {x y} of all boxes in COLUMNS. SIZES: a dict KEY -> {width height}.
proc ::sorma::layers::places {columns sizes edges} {
    variable gap
    set into {}                         ;# dict: KEY -> edges that lead to it
    set lanes {}                        ;# dict: KEY -> rows that edges leave or enter there, as {KEY ROW} of the one they leave
    foreach edge $edges {
        lassign $edge from to row
        dict lappend into $to $edge
        foreach key [list $from $to] {
            dict set lanes $key [list $from $row] 1
        }
    }
    set x 0
    set places {}
    foreach list $columns next [lrange $columns 1 end] {
        set wanted [lmap key $list {list $key [Wanted $key $into $places] [lindex [dict get $sizes $key] 1]}]
        foreach {key y} [Stack $wanted] {
            dict set places $key [list $x $y]
        }
        # Each edge between two columns needs a step of its own there; those that leave in the same row share it.
        set between [dict size [dict merge {*}[lmap key [concat $list $next] {if {![dict exists $lanes $key]} continue; dict get $lanes $key}]]]
        incr x [expr {[tcl::mathfunc::max {*}[lmap key $list {lindex [dict get $sizes $key] 0}]] + $gap + max(0, min(24, $between - 6))}]
    }
    set top [tcl::mathfunc::min 0 {*}[lmap place [dict values $places] {lindex $place 1}]]
    return [dict map {key place} $places {list [lindex $place 0] [expr {[lindex $place 1] - $top}]}]
}
# The row at which the middle one of the edges from boxes that have a place would be straight; empty: there is none.
proc ::sorma::layers::Wanted {key into places} {
    set rows {}
    foreach edge [if {[dict exists $into $key]} {dict get $into $key}] {
        lassign $edge from to out in
        if {[dict exists $places $from]} {
            lappend rows [expr {[lindex [dict get $places $from] 1] + $out - $in}]
        }
    }
    return [if {$rows ne {}} {lindex [lsort -integer $rows] [expr {([llength $rows] - 1) / 2}]}]
}
# Rows for boxes in this order, {KEY WANTED HEIGHT}, near to what they want and none over another: pushed down, pushed up, the mean.
proc ::sorma::layers::Stack wanted {
    variable room
    set y 0
    set wanted [lmap item $wanted {
        lassign $item key want height
        set want [expr {$want eq {} ? $y : $want}]
        set y [expr {$want + $height + $room}]
        list $key $want $height
    }]
    set down [set up {}]
    set y -1000000000
    foreach item $wanted {
        lassign $item key want height
        set y [expr {max($want, $y)}]
        lappend down $y
        incr y [expr {$height + $room}]
    }
    set y 1000000000
    foreach item [lreverse $wanted] {
        lassign $item key want height
        set y [expr {min($want, $y - $height - $room)}]
        lappend up $y
    }
    set y -1000000000
    return [concat {*}[lmap item $wanted low $down high [lreverse $up] {
        set at [expr {max($y, ($low + $high) >> 1)}]
        set y [expr {$at + [lindex $item 2] + $room}]
        list [lindex $item 0] $at
    }]]
}
