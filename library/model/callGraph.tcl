# callGraph.tcl -- who calls whom, from the events monitor.reply of all daemons: rates, and the places of boxes and lines of a picture.
# It knows no window.
#
# A box is a process with the objects that are called there. The picture reads from left to right, and equal calls give an equal picture, whatever came
# first (layers.tcl). A line goes around the boxes (ways.tcl); those of one caller share their way.

package require sorma::layers
package require sorma::options
package require sorma::ways
package require sorma::world
package provide sorma::callGraph 1.0

namespace eval ::sorma::callGraph {
    variable Smooth 0.5         ;# part of the newest second in a rate
}

# ::sorma::callGraph::new ?-most n? ?-as WHO? -- a command. -most: so many objects are drawn, the first ones. -as: by these rights daemons tell;
# default: yours. Its methods:
#       begin, end                  listen to all daemons; nothing is told before, and nothing after
#       passed KEY EVENT            a monitor.reply of that daemon
#       measure                     rates since the last time; clear: all
#       edges                       list of {CALLER OBJECT RATE LATENCY}, in 1/s and us
#       sums                        dict: OBJECT -> {RATE LATENCY}, of all its callers
#       arrange WIDTH ROOM LEAST    places anew, in steps of a grid. WIDTH is called with a process and its objects, and returns the steps that they need.
#                                   They get them as far as all columns are in ROOM steps then, but LEAST at least
#       stale                       does something stand nowhere yet?
#       boxes                       dict PROCESS -> {x y width height OBJECT ...}
#       ways                        dict {CALLER OBJECT} -> x1 y1 x2 y2 ... of its line
#       own OBJECT                  its name in the box of its daemon
#       said                        what there is, in a line; refused: does it say why something is missing?
proc ::sorma::callGraph::new args {
    return [Graph new {*}$args]
}

# ::sorma::callGraph::figures RATE LATENCY -- as people read them: {12/s} {34 us}.
proc ::sorma::callGraph::figures {rate latency} {
    return [list [format [expr {$rate < 10 ? "%.1f/s" : "%.0f/s"}] $rate] \
        [if {$latency < 1000} {format "%.0f us" $latency} else {format "%.3g ms" [expr {$latency / 1000}]}]]
}

if {![info object isa object ::sorma::callGraph::Graph]} {oo::class create ::sorma::callGraph::Graph}
oo::define ::sorma::callGraph::Graph {
    variable most who
    variable watch tokens       ;# tokens: dict: KEY of a daemon -> token of what passes there
    variable keyOf              ;# dict: OBJECT that is drawn -> KEY of its daemon
    variable boxes ways stale
    variable counts             ;# dict: {CALLER OBJECT} -> {calls us}, since rates were measured
    variable rates              ;# dict: {CALLER OBJECT} -> {rate latency}, smoothed
    variable processes          ;# dict: caller -> the daemon it is, or what it says of itself
    variable refused            ;# dict: KEY -> why it tells nothing
    variable measured           ;# ms, when rates were

    constructor args {
        set settings [::sorma::options::parse {-most {{whole 1 {}} 100} -as any} $args]
        set most [dict get $settings -most]
        set who [dict get $settings -as]
        set watch [set tokens [set processes [set refused {}]]]
        set measured [clock milliseconds]
        my clear
    }
    destructor {
        my end
    }

    # ---- what passes ----

    method begin {} {
        if {$watch ne {}} return
        set measured [clock milliseconds]
        set watch [::sorma::world watch * -events daemon.* -command [list [self] Daemon]]
    }
    method end {} {
        foreach token [list {*}$watch {*}[dict values $tokens]] {
            ::sorma::world unwatch $token
        }
        set watch [set tokens {}]
    }
    method Daemon {event key daemon} {
        if {$event ne "daemon.changed"} {
            set processes {}
        }
        if {$event ne "daemon.gone" && $key ne "self" && ![dict exists $tokens $key]} {
            dict set tokens $key [::sorma::world listen sorm@$key -event monitor.reply -as $who -command [list [self] passed $key]]
        } elseif {$event eq "daemon.gone" && [dict exists $tokens $key]} {
            ::sorma::world unwatch [dict get $tokens $key]
            dict unset tokens $key
            dict unset refused $key
        }
    }
    method passed {key event} {
        if {[dict get $event event] eq "sorma.refused"} {
            dict set refused $key [dict get $event text]
            return
        }
        if {[dict get $event event] ne "monitor.reply" || [catch {lassign [dict get $event words] object method caller}]} return
        if {[string match "*@[info hostname] *\\\[[pid]\\\]" $caller] || $object eq "sorm"} return         ;# our own, and those who look
        set us [lindex [dict get $event ints] 0]
        if {![string is double -strict $us]} return
        set name [string range $object 0 200]@$key
        if {![dict exists $keyOf $name]} {
            if {[dict size $keyOf] >= $most} return
            dict set keyOf $name $key
        }
        set edge [list [my Process $caller] $name]
        lassign [if {[dict exists $counts $edge]} {dict get $counts $edge} else {list 0 0}] calls sum
        dict set counts $edge [list [expr {$calls + 1 + [dict get $event lost]}] [expr {$sum + $us}]]
    }
    # The daemon that has this pid, else what the caller says of itself.
    method Process caller {
        if {![dict exists $processes $caller]} {
            if {[dict size $processes] > 10000} {
                set processes {}
            }
            set found [string range $caller 0 200]
            foreach key [if {[regexp {^\S*@(\S+) .*\[(\d+)\]$} $caller -> host pid]} {::sorma::world keys}] {
                set daemon [::sorma::world get $key]
                if {$key ne "self" && [dict get $daemon host] eq $host && [dict get $daemon pid] eq $pid} {
                    set found $key
                }
            }
            dict set processes $caller $found
        }
        return [dict get $processes $caller]
    }

    # ---- numbers ----

    method measure {} {
        set now [clock milliseconds]
        set seconds [expr {max($now - $measured, 1) / 1000.0}]
        set measured $now
        set before $rates
        foreach edge [dict keys [dict merge $rates $counts]] {
            lassign [if {[dict exists $counts $edge]} {dict get $counts $edge} else {list 0 0}] calls us
            lassign [if {[dict exists $rates $edge]} {dict get $rates $edge} else {list {} 0}] rate latency
            set fresh [expr {$calls / $seconds}]
            set rate [expr {$rate eq {} ? $fresh : $::sorma::callGraph::Smooth * $fresh + (1 - $::sorma::callGraph::Smooth) * $rate}]
            dict set rates $edge [list [expr {$rate < 0.05 ? 0.0 : $rate}] [expr {$calls > 0 ? 1.0 * $us / $calls : $latency}]]
        }
        if {[dict size [dict remove $counts {*}[dict keys $before]]] > 0} {
            set stale 1
        }
        set counts {}
    }
    method clear {} {
        set keyOf [set boxes [set ways [set counts [set rates {}]]]]
        set stale 0
    }
    method edges {} {
        return [lmap {edge facts} $rates {concat $edge $facts}]
    }
    method sums {} {
        set sums {}
        foreach {edge facts} $rates {
            lassign $facts rate latency
            lassign [if {[dict exists $sums [lindex $edge 1]]} {dict get $sums [lindex $edge 1]} else {list 0.0 0.0}] all time
            dict set sums [lindex $edge 1] [list [expr {$all + $rate}] [expr {$time + $rate * $latency}]]
        }
        return [dict map {object pair} $sums {
            lassign $pair all time
            list $all [expr {$all > 0 ? $time / $all : 0.0}]
        }]
    }
    method said {} {
        set objects [dict size $keyOf]
        if {[dict size $refused] > 0} {
            return [lindex $refused 1]
        } elseif {$rates eq {}} {
            return "Nobody has called anything since this is watched."
        }
        return "$objects objects, [llength [lsort -unique [lmap edge [my edges] {lindex $edge 0}]]] callers[expr {$objects >= $most ? "; more are not drawn" : {}}]"
    }
    method refused {} {
        return [expr {[dict size $refused] > 0}]
    }

    # ---- places ----

    # Places of columns, boxes and ways, in steps of the grid. A line of text takes four.
    method arrange {width room least} {
        set boxes [set ways [set objects {}]]
        set calls {}                    ;# {CALLER PROCESS ROW1 ROW2}, and the edge
        foreach edge [lsort -dictionary [dict keys $rates]] {
            lassign $edge caller object
            dict set objects $caller {}
            dict set objects [dict get $keyOf $object] {}
        }
        foreach object [lsort -dictionary [dict keys $keyOf]] {
            if {[dict exists $objects [dict get $keyOf $object]]} {
                dict lappend objects [dict get $keyOf $object] $object
            }
        }
        foreach edge [lsort -dictionary [dict keys $rates]] {
            lassign $edge caller object
            set key [dict get $keyOf $object]
            lappend calls [list $caller $key 2 [expr {7 + 4 * [lsearch -exact [dict get $objects $key] $object]}]]
        }
        set columns [::sorma::layers::columns [lsort -dictionary [dict keys $objects]] $calls]
        set widths [lmap column $columns {
            tcl::mathfunc::max {*}[lmap key $column {{*}$width $key [dict get $objects $key]}]
        }]
        set room [expr {$room - 12 * [llength $columns]}]
        for {set limit 100} {$limit > $least} {incr limit -1} {
            if {[tcl::mathop::+ {*}[lmap one $widths {expr {min($one, $limit)}}]] <= $room} break
        }
        set sizes {}
        foreach column $columns one $widths {
            foreach key $column {
                set count [llength [dict get $objects $key]]
                dict set sizes $key [list [expr {min($one, $limit)}] [expr {$count > 0 ? 6 + 4 * $count : 4}]]
            }
        }
        set places [::sorma::layers::places $columns $sizes $calls]
        foreach key [concat {*}$columns] {
            dict set boxes $key [concat [dict get $places $key] [dict get $sizes $key] [dict get $objects $key]]
        }
        set wires [lmap call $calls {
            lassign $call from to row row2
            lassign [dict get $boxes $from] x y width
            lassign [dict get $boxes $to] x2 y2
            list $from [expr {$x + $width}] [expr {$y + $row}] $x2 [expr {$y2 + $row2}]
        }]
        foreach edge [lsort -dictionary [dict keys $rates]] way [::sorma::ways::of [lmap box [dict values $boxes] {lrange $box 0 3}] $wires] {
            dict set ways $edge $way
        }
        set stale 0
    }
    method stale {} {
        return $stale
    }
    method boxes {} {
        return $boxes
    }
    method ways {} {
        return $ways
    }
    method own object {
        return [string range $object 0 end-[expr {1 + [string length [dict get $keyOf $object]]}]]
    }
    export Daemon
}
