# browserGraph.tcl -- sorma::browserGraph: who calls whom, drawn: processes at the left, the objects that they call at the right.
#
# Daemons tell of requests as they pass (monitor.reply), while the graph can be seen and never else. What was seen once keeps its
# row: nothing moves when something new comes. A line is as thick as calls are frequent.

package require Tk
package require snit
package require sorma::parts
package require sorma::style
package require sorma::text
package require sorma::timer
package require sorma::world
package provide sorma::browserGraph 1.0

# ::sorma::browserGraph .w ?-every ms? ?-most n? --
#       -every: between two drawings; -most: objects that are drawn, those seen first
# Methods:
#       passed KEY EVENT: a monitor.reply of that daemon; edges: list of {CALLER OBJECT RATE LATENCY}, in 1/s and us; rows: dict of what
#       is drawn -> its place from above; text: the edges, a line each; save FILE: .png, .pdf, .ps, else as text; clear
snit::widget ::sorma::browserGraph {
    hulltype ttk::frame
    option -every -default 1000 -readonly 1
    option -most -default 100 -readonly 1
    component canvas
    variable tokens {}          ;# dict: KEY of a daemon -> token of what passes there
    variable rows {}            ;# dict: {caller NAME} or {object NAME} -> its row, for good
    variable counts {}          ;# dict: {CALLER OBJECT} -> {calls us}, since the last drawing
    variable rates {}           ;# dict: {CALLER OBJECT} -> {rate latency}, smoothed
    variable processes {}       ;# dict: caller -> the daemon it is, or what it says of itself
    variable refused {}         ;# dict: KEY -> why it tells nothing
    variable watch {}
    variable timer {}
    variable drawn 0            ;# ms, of the last drawing
    typevariable Smooth 0.5     ;# part of the newest second in a rate

    constructor args {
        $self configurelist $args
        install canvas using canvas $win.canvas -highlightthickness 1 -takefocus 1 -width 100 -height 100 \
            -background [ttk::style lookup TEntry -fieldbackground {} white] -yscrollcommand [list $win.bar set]
        ttk::scrollbar $win.bar -style [::sorma::style own Vertical.TScrollbar] -command [list $canvas yview]
        ttk::label $win.said -padding [::sorma::style pixels 4]
        pack $win.said -side bottom -fill x
        pack $win.bar -side right -fill y
        pack $canvas -side left -fill both -expand 1
        foreach {key amount unit} {Up -2 units Down 2 units Prior -1 pages Next 1 pages} {
            bind $canvas <$key> [list $canvas yview scroll $amount $unit]
        }
        bind $canvas <ButtonPress-1> {focus %W}
        ::sorma::style bindWheel $canvas $canvas
        bind $win <Map> [mymethod Begin]
        bind $win <Unmap> [mymethod End]
        bind $canvas <Configure> [mymethod Draw]
        bind $win <Destroy> +[mymethod Ended %W]
    }
    method Ended window {
        if {$window eq $win} {
            $self End
        }
    }

    # ---- what passes ----

    method Begin {} {
        if {$watch ne {}} return
        set drawn [clock milliseconds]
        set watch [::sorma::world watch * -events daemon.* -command [mymethod Daemon]]
        set timer [after $options(-every) [mymethod Tick]]
    }
    method End {} {
        after cancel $timer
        foreach token [list {*}$watch {*}[dict values $tokens]] {
            ::sorma::world unwatch $token
        }
        set watch {}
        set tokens {}
    }
    method Daemon {event key daemon} {
        if {$event ne "daemon.changed"} {
            set processes {}
        }
        if {$event ne "daemon.gone" && $key ne "self" && ![dict exists $tokens $key]} {
            dict set tokens $key [::sorma::world listen sorm@$key -event monitor.reply -command [mymethod passed $key]]
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
        set edge [list [$self Process $caller] [string range $object 0 200]@$key]
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

    # ---- what programs say ----

    method edges {} {
        return [lmap {edge facts} $rates {concat $edge $facts}]
    }
    method rows {} {
        return $rows
    }
    method clear {} {
        foreach name {rows counts rates} {
            set $name {}
        }
        $self Draw
    }
    method text {} {
        return [join [lmap edge [lsort -real -decreasing -index 2 [$self edges]] {
            lassign $edge caller object rate latency
            format "%-30s %-30s %10s %10s" $caller $object {*}[split [$self Figures $rate $latency] ,]
        }] \n]
    }
    method save file {
        if {[string tolower [file extension $file]] in {.png .pdf .ps}} {
            ::sorma::parts::picture $canvas $file
        } else {
            ::sorma::text::writeFile $file [$self text]\n
        }
    }

    # ---- drawing ----

    method Tick {} {
        set timer [after $options(-every) [mymethod Tick]]
        $self Measure
        $self Draw
    }
    # Rates since the last time.
    method Measure {} {
        set now [clock milliseconds]
        set seconds [expr {max($now - $drawn, 1) / 1000.0}]
        set drawn $now
        foreach edge [dict keys $counts] {
            lassign $edge caller object
            foreach node [list [list caller $caller] [list object $object]] {
                if {![dict exists $rows $node] && [llength [dict keys $rows "[lindex $node 0] *"]] < $options(-most)} {
                    dict set rows $node [llength [dict keys $rows "[lindex $node 0] *"]]
                }
            }
        }
        foreach edge [dict keys [dict merge $rates $counts]] {
            lassign [if {[dict exists $counts $edge]} {dict get $counts $edge} else {list 0 0}] calls us
            lassign [if {[dict exists $rates $edge]} {dict get $rates $edge} else {list {} 0}] rate latency
            set fresh [expr {$calls / $seconds}]
            set rate [expr {$rate eq {} ? $fresh : $Smooth * $fresh + (1 - $Smooth) * $rate}]
            dict set rates $edge [list [expr {$rate < 0.05 ? 0.0 : $rate}] [expr {$calls > 0 ? 1.0 * $us / $calls : $latency}]]
        }
        set counts {}
    }
    method Figures {rate latency} {
        return "[format [expr {$rate < 10 ? "%.1f/s" : "%.0f/s"}] $rate],[if {$latency < 1000} {format "%.0f us" $latency} else {format "%.3g ms" [expr {$latency / 1000}]}]"
    }
    method Draw {} {
        $canvas delete all
        set line [expr {[font metrics [::sorma::style font plain] -linespace] + [::sorma::style pixels 4]}]
        set callers [dict keys $rows {caller *}]
        set objects [dict keys $rows {object *}]
        set width [winfo width $canvas]
        set pad [::sorma::style pixels 8]
        # Names get the room that they need, as far as there is room for lines between them.
        set room [font measure [::sorma::style font plain] "0000/s  0000 us"]
        set left [expr {2 * $pad + min([$self Widest $callers], round($width * 0.28))}]
        set right [expr {$width - $room - 3 * $pad - min([$self Widest $objects], round($width * 0.4))}]
        set right [expr {max(min($right, round($width * 0.6)), $left + [::sorma::style pixels 60])}]
        set ink [ttk::style lookup . -foreground {} black]
        set grey [::sorma::style colour asking]
        set top [expr {$line * 1.5}]
        foreach {x text} [list $pad "calls from" $right "to" [expr {$width - $pad}] "calls, mean time"] anchor {w w e} {
            $canvas create text $x [expr {$line * 0.7}] -anchor $anchor -text $text -fill $grey -font [::sorma::style font small]
        }
        set place {}
        set total {}
        foreach {edge facts} $rates {
            lassign $edge caller object
            lassign $facts rate latency
            dict lappend total [list object $object] $rate $latency
            dict lappend total [list caller $caller] $rate $latency
        }
        foreach {node row} $rows {
            dict set place $node [expr {$top + ($row + 0.5) * $line * ([lindex $node 0] eq "caller" ? 2 : 1)}]
        }
        # The busiest lie on top.
        foreach edge [lsort -real -index 2 [$self edges]] {
            lassign $edge caller object rate
            if {![dict exists $place [list caller $caller]] || ![dict exists $place [list object $object]]} continue
            set from [dict get $place [list caller $caller]]
            set to [dict get $place [list object $object]]
            set bend [expr {($right - $left) * 0.4}]
            $canvas create line $left $from [expr {$left + $bend}] $from [expr {$right - $bend}] $to [expr {$right - $pad}] $to -smooth 1 -arrow last \
                -width [expr {$rate > 0 ? [::sorma::style pixels [expr {1 + 1.4 * log10(1 + $rate) ** 1.5}]] : 1}] \
                -fill [if {$rate > 0} {::sorma::style colour mine} else {set grey}]
        }
        foreach {node y} $place {
            lassign $node kind name
            set rate 0.0
            set time 0.0
            foreach {calls us} [if {[dict exists $total $node]} {dict get $total $node}] {
                set rate [expr {$rate + $calls}]
                set time [expr {$time + $calls * $us}]
            }
            set colour [expr {$rate > 0 ? $ink : $grey}]
            set shown [::sorma::text::clean [string map {\n { }} $name]]
            if {$kind eq "caller"} {
                $canvas create text [expr {$left - $pad}] $y -anchor e -text [$self Fit $shown [expr {$left - 2 * $pad}]] -fill $colour \
                    -font [::sorma::style font plain]
            } else {
                set figures [if {$rate > 0} {string map {, {  }} [$self Figures $rate [expr {$time / $rate}]]}]
                $canvas create text $right $y -anchor w -text [$self Fit $shown [expr {$width - $right - $room - 2 * $pad}]] -fill $colour \
                    -font [::sorma::style font plain]
                $canvas create text [expr {$width - $pad}] $y -anchor e -text $figures -fill $colour -font [::sorma::style font plain]
            }
        }
        set bottom [expr {max([winfo height $canvas], 2 * $pad + [tcl::mathfunc::max 0 {*}[dict values $place]] + $line)}]
        $canvas configure -scrollregion [list 0 0 $width $bottom]
        $win.said configure -text [::sorma::text::cut [::sorma::text::clean [if {[dict size $refused] > 0} {
            string cat "[::sorma::style mark refused] [lindex $refused 1]"
        } elseif {[dict size $rows] == 0} {
            string cat "Nobody has called anything since this is watched."
        } else {
            string cat "[llength $objects] objects, [llength $callers] callers[if {[llength $objects] >= $options(-most)} {string cat {; more are not drawn}}]"
        }]] 300]
    }
    method Widest nodes {
        return [tcl::mathfunc::max 0 {*}[lmap node $nodes {font measure [::sorma::style font plain] [lindex $node 1]}]]
    }
    method Fit {text width} {
        while {[font measure [::sorma::style font plain] $text] > $width && [string length $text] > 4} {
            set text [string range $text 0 end-2]\u2026
        }
        return $text
    }
}
