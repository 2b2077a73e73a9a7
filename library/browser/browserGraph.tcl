# browserGraph.tcl -- sorma::browserGraph: a box for each process with the objects that are called there, and lines from their callers.
#
# Daemons tell of requests as they pass (monitor.reply), while the graph can be seen and never else. It reads from left to right, and equal
# calls give an equal picture, whatever came first (layers.tcl). A line goes around the boxes (ways.tcl) and is as thick as calls are frequent;
# those of one caller share their way.

package require Tk
package require snit
package require sorma::layers
package require sorma::parts
package require sorma::style
package require sorma::text
package require sorma::timer
package require sorma::ways
package require sorma::world
package provide sorma::browserGraph 1.0

# ::sorma::browserGraph .w ?-every ms? ?-most n? --
#       -every: between two drawings; -most: objects that are drawn, those seen first
# Methods:
#       passed KEY EVENT: a monitor.reply of that daemon; edges: list of {CALLER OBJECT RATE LATENCY}, in 1/s and us; boxes: a dict
#       PROCESS -> {x y width height OBJECT ...}, in steps of a grid; text: the edges, a line each; save FILE: .png, .pdf, .ps, else as text; clear
snit::widget ::sorma::browserGraph {
    hulltype ttk::frame
    option -every -default 1000 -readonly 1
    option -most -default 100 -readonly 1
    component canvas
    variable tokens {}          ;# dict: KEY of a daemon -> token of what passes there
    variable keyOf {}           ;# dict: OBJECT that is drawn -> KEY of its daemon
    variable boxes {}           ;# as method boxes gives them
    variable ways {}            ;# dict: {CALLER OBJECT} -> x1 y1 x2 y2 ... of its line, in steps of the grid
    variable stale 0            ;# boxes and ways must be made anew
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
        ttk::scrollbar $win.below -style [::sorma::style own Horizontal.TScrollbar] -orient horizontal -command [list $canvas xview]
        $canvas configure -xscrollcommand [list ::sorma::parts::scrolled $win.below]
        ttk::label $win.said -padding [::sorma::style pixels 4]
        grid $canvas $win.bar -sticky nsew
        grid $win.below -sticky ew
        grid $win.said -columnspan 2 -sticky ew
        grid columnconfigure $win 0 -weight 1
        grid rowconfigure $win 0 -weight 1
        foreach {key view amount unit} {Up y -2 units Down y 2 units Prior y -1 pages Next y 1 pages Left x -2 units Right x 2 units} {
            bind $canvas <$key> [list $canvas ${view}view scroll $amount $unit]
        }
        bind $canvas <ButtonPress-1> {focus %W}
        ::sorma::style bindWheel $canvas $canvas
        bind $win <Map> [mymethod Begin]
        bind $win <Unmap> [mymethod End]
        bind $canvas <Configure> [mymethod Resized]
        bind $win <<ThemeChanged>> [mymethod Resized]
        bind $win <Destroy> +[mymethod Ended %W]
    }
    method Resized {} {
        set stale 1
        $self Draw
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
        set name [string range $object 0 200]@$key
        if {![dict exists $keyOf $name]} {
            if {[dict size $keyOf] >= $options(-most)} return
            dict set keyOf $name $key
        }
        set edge [list [$self Process $caller] $name]
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
    method boxes {} {
        return $boxes
    }
    method clear {} {
        foreach name {keyOf boxes ways counts rates} {
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
        set before $rates
        foreach edge [dict keys [dict merge $rates $counts]] {
            lassign [if {[dict exists $counts $edge]} {dict get $counts $edge} else {list 0 0}] calls us
            lassign [if {[dict exists $rates $edge]} {dict get $rates $edge} else {list {} 0}] rate latency
            set fresh [expr {$calls / $seconds}]
            set rate [expr {$rate eq {} ? $fresh : $Smooth * $fresh + (1 - $Smooth) * $rate}]
            dict set rates $edge [list [expr {$rate < 0.05 ? 0.0 : $rate}] [expr {$calls > 0 ? 1.0 * $us / $calls : $latency}]]
        }
        if {[dict size [dict remove $counts {*}[dict keys $before]]] > 0} {
            set stale 1
        }
        set counts {}
    }
    method Figures {rate latency} {
        return "[format [expr {$rate < 10 ? "%.1f/s" : "%.0f/s"}] $rate],[if {$latency < 1000} {format "%.0f us" $latency} else {format "%.3g ms" [expr {$latency / 1000}]}]"
    }
    # Places of columns, boxes and ways, in steps of the grid. A line of text takes four.
    method Arrange {} {
        set boxes {}
        set ways {}
        set objects {}
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
        set step [$self Step]
        # Names get the room that they need, as far as all columns can be seen then; but some of it at least.
        set widths [lmap column $columns {
            tcl::mathfunc::max {*}[lmap key $column {$self Width $key [dict get $objects $key] $step}]
        }]
        set room [expr {[winfo width $canvas] / $step - 12 * [llength $columns]}]
        for {set most 100} {$most > [::sorma::style pixels 190] / $step} {incr most -1} {
            if {[tcl::mathop::+ {*}[lmap width $widths {expr {min($width, $most)}}]] <= $room} break
        }
        set sizes {}
        foreach column $columns width $widths {
            foreach key $column {
                set count [llength [dict get $objects $key]]
                dict set sizes $key [list [expr {min($width, $most)}] [expr {$count > 0 ? 6 + 4 * $count : 4}]]
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
    # Pixels from one line of the grid to the next.
    method Step {} {
        return [expr {([font metrics [::sorma::style font plain] -linespace] + [::sorma::style pixels 4] + 3) / 4}]
    }
    # Steps that a box needs to show all.
    method Width {process objects step} {
        set font [::sorma::style font plain]
        set room [font measure $font "  0000/s  0000 us"]
        set names [lmap object $objects {expr {$room + [font measure $font [$self Own $object]]}}]
        return [expr {int([tcl::mathfunc::max [font measure [::sorma::style font strong] $process] {*}$names]) / $step + 4}]
    }
    # The name of an object in the box of its daemon.
    method Own object {
        return [string range $object 0 end-[expr {1 + [string length [dict get $keyOf $object]]}]]
    }
    method Draw {} {
        if {$stale} {
            $self Arrange
        }
        $canvas delete all
        set step [$self Step]
        # The busiest lie on top.
        foreach edge [lsort -real -index 2 [$self edges]] {
            lassign $edge caller object rate
            $canvas create line [lmap at [dict get $ways [list $caller $object]] {expr {$at * $step}}] -arrow last -joinstyle round \
                -width [::sorma::style pixels [expr {min(7, 1 + log10(1 + $rate) ** 1.5)}]] \
                -fill [::sorma::style token [expr {$rate > 0 ? "mine" : "line"}]]
        }
        set sums [$self Sums]
        dict for {process box} $boxes {
            $self Box $process $box $step $sums
        }
        set pad [::sorma::style pixels 16]
        lassign [concat [$canvas bbox all] 0 0 0 0] left top right bottom
        $canvas move all [expr {$pad - $left}] [expr {$pad - $top}]
        $canvas configure -scrollregion [list 0 0 [expr {$right - $left + 2 * $pad}] [expr {max($bottom - $top + 2 * $pad, [winfo height $canvas])}]]
        $self Say
    }
    # dict: OBJECT -> {rate latency}, of all its callers.
    method Sums {} {
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
    # A title, and a line for each object.
    method Box {process box step sums} {
        lassign [lmap at [lrange $box 0 3] {expr {$at * $step}}] x y width height
        set right [expr {$x + $width}]
        set pad [::sorma::style pixels 8]
        set token [expr {[::sorma::world get $process] ne {} ? "tint" : "ground"}]
        $canvas create rectangle $x $y $right [expr {$y + $height}] -fill [::sorma::style token surface] -outline [::sorma::style token edge]
        $canvas create rectangle $x $y $right [expr {$y + 4 * $step}] -fill [::sorma::style token $token] -outline [::sorma::style token edge]
        $self Text [expr {$x + $pad}] [expr {$y + 2 * $step}] w $process [expr {$width - 2 * $pad}] text strong
        set middle [expr {$y + 3 * $step}]
        foreach object [lrange $box 4 end] {
            incr middle [expr {4 * $step}]
            lassign [if {[dict exists $sums $object]} {dict get $sums $object} else {list 0 0}] rate latency
            set figures [if {$rate > 0} {string map {, {  }} [$self Figures $rate $latency]}]
            set taken [expr {[font measure [::sorma::style font plain] $figures] + $pad}]
            $self Text [expr {$right - $pad}] $middle e $figures $width quiet plain
            $self Text [expr {$x + $pad}] $middle w [$self Own $object] [expr {$width - 2 * $pad - $taken}] [expr {$rate > 0 ? "text" : "quiet"}] plain
        }
    }
    method Text {x y anchor text width token font} {
        set text [::sorma::text::clean [string map {\n { }} $text]]
        $canvas create text $x $y -anchor $anchor -text [$self Fit $text $width $font] -fill [::sorma::style token $token] -font [::sorma::style font $font]
    }
    method Say {} {
        set objects [dict size $keyOf]
        $win.said configure -text [::sorma::text::cut [::sorma::text::clean [if {[dict size $refused] > 0} {
            string cat "[::sorma::style mark refused] [lindex $refused 1]"
        } elseif {$rates eq {}} {
            string cat "Nobody has called anything since this is watched."
        } else {
            string cat "$objects objects, [llength [lsort -unique [lmap edge [$self edges] {lindex $edge 0}]]] callers[if {$objects >= $options(-most)} {string cat {; more are not drawn}}]"
        }]] 300]
    }
    method Fit {text width font} {
        while {[font measure [::sorma::style font $font] $text] > $width && [string length $text] > 4} {
            set text [string range $text 0 end-2]\u2026
        }
        return $text
    }
}
