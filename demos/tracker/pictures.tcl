# pictures.tcl WHAT FILE ?THEME? ?PLOT? -- a picture of the tracker for a page.
#
# WHAT is circuit, circuit.tracker as the circuit editor draws it, all of it in an SVG file, or its window as PNG. Or WHAT is window, the demo's, as PNG
# while all runs. Then the file PLOT gets the places of ball and tool on the sine.
#
#     xvfb-run -a -s "-screen 0 1600x1200x24" tclsh8.6 pictures.tcl circuit circuit.svg dark
#
# It needs a display, and for PNG Tk's package Img; for window a runtime folder where no daemon has the name of one of the tracker's.

package require Tk
package require sorma
package require sorma::style

namespace eval tracker::pictures {
    variable Here [file dirname [file normalize [info script]]]
}
source [file join $::tracker::pictures::Here .. picture.tcl]

# A copy of the demo whose buffers have names of their own. Returns its folder.
proc tracker::pictures::own folder {
    variable Here
    picture copy $folder $Here [glob -tails -directory $Here *] {tracker\.(?!tcl|launch|dict)}
    return $folder
}

# ---- the circuit, as the circuit editor draws it ----

proc tracker::pictures::circuit {file folder} {
    package require sorma::circuitEditor
    sorma::so::dict CTRL -load [file join [own $folder] tracker.dict]
    foreach name {robot shmem} {
        package require sorma::service::$name
    }
    circuit.tracker DBX -units
    wm geometry . [sorma::style pixels 1240]x[sorma::style pixels 760]
    pack [sorma::circuitEditor .w circuit.tracker -state readonly] -fill both -expand 1
    set end [expr {[clock milliseconds] + 20000}]
    set pins [split [lindex [circuit.tracker DBX -live] 3] \n]
    while {[set missing [Missing $pins [dict get [.w graph] nodes]]] ne {}} {
        if {[clock milliseconds] > $end} {
            error "the picture has no $missing: [.w said]"
        }
        # Events of the window, too.
        after 20 {set ::tracker::pictures::tick 1}
        vwait ::tracker::pictures::tick
    }
    update
    if {[file extension $file] eq ".svg"} {
        .w save $file
    } else {
        picture save $file
    }
    return 0
}

# Pins of units that the picture does not have yet.
proc tracker::pictures::Missing {pins nodes} {
    return [lmap line $pins {
        lassign $line pin way
        set dot [string last . $pin]
        set key [list unit [string range $pin 0 $dot-1]]
        if {[dict exists $nodes $key] && [string range $pin $dot+1 end] in [dict get $nodes $key ${way}s]} continue
        set pin
    }]
}

# ---- the window ----

proc tracker::pictures::window {file folder} {
    set folder [own $folder]
    foreach name [list {*}[lmap part {measure lab/lab} {file join $::tracker::pictures::Here .. $part.tcl}] [file join $folder rows.tcl]] {
        uplevel #0 [list source $name]
    }
    set launch [lab::launch [file join $folder tracker.launch]]
    try {
        tracker::rows::prepare 0
        tracker::rows::learn 1
        tracker::rows::follow
        uplevel #0 [list source [file join $folder window.tcl]]
        ::tracker::window::build
        wm geometry . +0+0
        simlab@lab CTRL -speed 1
        tracker::rows::ball sine 0.56 0 0.12 0 0.1 0 0.4
        sorma::await sleep 9000
        simlab@lab CTRL -push 0 15 0 1
        sorma::await sleep 2500
        picture save $file
        if {$::plot ne {}} {
            set samples [tracker::rows::sample 5]
            destroy {*}[winfo children .]
            Plot $samples
            picture save $::plot
        }
        tracker::rows::unfollow
        return 0
    } finally {
        lab::finish $launch
    }
}

# The parts across the table of samples {t ball 3 tool 3}: of the ball, and of the tool that follows it.
proc tracker::pictures::Plot samples {
    set px sorma::style::pixels
    set font [sorma::style font small]
    wm geometry . {}
    wm minsize . 1 1
    set width [$px 620]
    set height [$px 240]
    set left [$px 45]
    pack [canvas .c -background white -highlightthickness 0 -width [expr {$width + 2 * $left}] -height [expr {$height + [$px 40]}]]
    set begin [lindex $samples 0 0]
    set span [expr {[lindex $samples end 0] - $begin}]
    foreach mm {-100 -50 0 50 100} {
        set y [expr {(0.5 - $mm / 260.0) * $height}]
        .c create line $left $y [expr {$left + $width}] $y -fill #d0d0d0
        .c create text [expr {$left - [$px 4]}] $y -anchor e -text $mm -font $font
    }
    for {set s 0} {$s <= $span} {incr s} {
        .c create text [expr {$left + $s / $span * $width}] [expr {$height + [$px 4]}] -anchor n -text $s -font $font
    }
    .c create text [expr {$left + $width}] [expr {$height + [$px 20]}] -anchor ne -text "time \[s\]; across the table \[mm\]" -font $font
    foreach {index colour name at} {2 #e08000 ball 0 5 #1a5fb4 tool 60} {
        .c create line [concat {*}[lmap sample $samples {
            list [expr {$left + ([lindex $sample 0] - $begin) / $span * $width}] [expr {(0.5 - 1000 * [lindex $sample $index] / 260.0) * $height}]
        }]] -fill $colour -width [$px 1]
        .c create text [expr {$left + [$px $at]}] [expr {$height + [$px 20]}] -anchor nw -text $name -font $font -fill $colour
    }
}

lassign $argv what file theme plot
if {$what ni {circuit window}} {
    puts stderr "usage: pictures.tcl circuit|window FILE ?THEME? ?PLOT?"
    exit 2
}
picture begin $theme
set folder [exec mktemp -d]
try {
    set code [tracker::pictures::$what $file $folder]
} finally {
    file delete -force $folder
}
exit $code
