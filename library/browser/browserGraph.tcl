# browserGraph.tcl -- sorma::browserGraph: a box for each process with the objects that are called there, and lines from their callers.
#
# Daemons tell of requests as they pass, while the graph can be seen and never else (callGraph.tcl). A line is as thick as calls are frequent.

package require Tk
package require snit
package require sorma::callGraph
package require sorma::parts
package require sorma::style
package require sorma::text
package require sorma::world
package provide sorma::browserGraph 1.0

# ::sorma::browserGraph .w ?-every ms? ?-most n? --
# Options:
#       -every MS           between two drawings
#       -most N             objects that are drawn, those seen first
# Methods:
#       passed KEY EVENT    a monitor.reply of that daemon
#       edges               list of {CALLER OBJECT RATE LATENCY}, in 1/s and us
#       boxes               a dict PROCESS -> {x y width height OBJECT ...}, in steps of a grid
#       text                the edges, a line each
#       save FILE           .png, .pdf, .ps, else as text
#       clear               forget all edges
snit::widget ::sorma::browserGraph {
    hulltype ttk::frame
    option -every -default 1000 -readonly 1
    option -most -default 100 -readonly 1
    component canvas
    component graph
    delegate method passed to graph
    delegate method edges to graph
    delegate method boxes to graph
    variable stale 0            ;# its window has changed
    variable timer {}

    constructor args {
        $self configurelist $args
        set graph [::sorma::callGraph::new -most $options(-most)]
        install canvas using canvas $win.canvas -highlightthickness 1 -takefocus 1 -width 100 -height 100 \
            -background [ttk::style lookup TEntry -fieldbackground {} white] -yscrollcommand [list $win.bar set]
        ttk::scrollbar $win.bar -style [::sorma::style own Vertical.TScrollbar] -command [list $canvas yview]
        ttk::scrollbar $win.below -style [::sorma::style own Horizontal.TScrollbar] -orient horizontal -command [list $canvas xview]
        $canvas configure -xscrollcommand [list ::sorma::parts::scrolled $win.below]
        ttk::label $win.said -style Quiet.TLabel -padding [list [::sorma::style pixels 16] [::sorma::style pixels 8]]
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
            after cancel $timer
            $graph destroy
        }
    }

    method Begin {} {
        after cancel $timer
        $graph begin
        set timer [after $options(-every) [mymethod Tick]]
    }
    method End {} {
        after cancel $timer
        $graph end
    }

    # ---- what programs say ----

    method clear {} {
        $graph clear
        $self Draw
    }
    method text {} {
        return [join [lmap edge [lsort -real -decreasing -index 2 [$graph edges]] {
            lassign $edge caller object rate latency
            format "%-30s %-30s %10s %10s" $caller $object {*}[::sorma::callGraph::figures $rate $latency]
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
        $graph measure
        $self Draw
    }
    # Pixels from one line of the grid to the next.
    method Step {} {
        return [expr {([font metrics [::sorma::style font plain] -linespace] + [::sorma::style pixels 4] + 3) / 4}]
    }
    # Steps that a box needs to show all.
    method Width {process objects} {
        set font [::sorma::style font plain]
        set room [font measure $font "  0000/s  0000 us"]
        set names [lmap object $objects {expr {$room + [font measure $font [$graph own $object]]}}]
        return [expr {int([tcl::mathfunc::max [font measure [::sorma::style font strong] $process] {*}$names]) / [$self Step] + 4}]
    }
    method Draw {} {
        set step [$self Step]
        if {$stale || [$graph stale]} {
            $graph arrange [mymethod Width] [expr {[winfo width $canvas] / $step}] [expr {[::sorma::style pixels 190] / $step}]
            set stale 0
        }
        $canvas delete all
        set ways [$graph ways]
        # The busiest lie on top.
        foreach edge [lsort -real -index 2 [$graph edges]] {
            lassign $edge caller object rate
            $canvas create line [lmap at [dict get $ways [list $caller $object]] {expr {$at * $step}}] -arrow last -joinstyle round \
                -width [::sorma::style pixels [expr {min(7, 1 + log10(1 + $rate) ** 1.5)}]] \
                -fill [::sorma::style token [expr {$rate > 0 ? "mine" : "line"}]]
        }
        set sums [$graph sums]
        dict for {process box} [$graph boxes] {
            $self Box $process $box $step $sums
        }
        set pad [::sorma::style pixels 16]
        lassign [concat [$canvas bbox all] 0 0 0 0] left top right bottom
        $canvas move all [expr {$pad - $left}] [expr {$pad - $top}]
        $canvas configure -scrollregion [list 0 0 [expr {$right - $left + 2 * $pad}] [expr {max($bottom - $top + 2 * $pad, [winfo height $canvas] - 2)}]]         ;# inside of the edge
        $self Say
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
            set figures [if {$rate > 0} {join [::sorma::callGraph::figures $rate $latency] {  }}]
            set taken [expr {[font measure [::sorma::style font plain] $figures] + $pad}]
            $self Text [expr {$right - $pad}] $middle e $figures $width quiet plain
            $self Text [expr {$x + $pad}] $middle w [$graph own $object] [expr {$width - 2 * $pad - $taken}] [expr {$rate > 0 ? "text" : "quiet"}] plain
        }
    }
    method Text {x y anchor text width token font} {
        set text [::sorma::text::clean [string map {\n { }} $text]]
        $canvas create text $x $y -anchor $anchor -text [$self Fit $text $width $font] -fill [::sorma::style token $token] -font [::sorma::style font $font]
    }
    # What is said of an empty graph stands where the graph would be.
    method Say {} {
        if {[dict size [$graph boxes]] == 0} {
            grid remove $win.said
            $canvas create text [expr {[winfo width $canvas] / 2}] [expr {[winfo height $canvas] / 2}] -text [::sorma::text::cut [::sorma::text::clean [$graph said]] 300] \
                -width [expr {max(100, [winfo width $canvas] * 3 / 4)}] -justify center -fill [::sorma::style token quiet] -font [::sorma::style font plain]
            return
        }
        grid $win.said
        set mark [if {[$graph refused]} {string cat "[::sorma::style mark refused] "}]
        $win.said configure -text [::sorma::text::cut [::sorma::text::clean $mark[$graph said]] 300]
    }
    method Fit {text width font} {
        while {[font measure [::sorma::style font $font] $text] > $width && [string length $text] > 4} {
            set text [string range $text 0 end-2]\u2026
        }
        return $text
    }
}
