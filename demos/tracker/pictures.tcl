# pictures.tcl WHAT FILE ?THEME? ?PLOT? -- a picture of the tracker for a page, as PNG.
#
# WHAT is circuit, the units and wires of circuit.tracker as they are resolved; or window, the demo's, while all runs. Then the file PLOT
# gets the places of ball and tool on the sine.
#
#     xvfb-run -a -s "-screen 0 1600x1200x24" tclsh8.6 pictures.tcl circuit circuit.png
#
# It needs a display and Tk's package Img; for window a runtime folder where no daemon has the name of one of the tracker's.

package require Tk
package require sorma
package require sorma::style

namespace eval tracker::pictures {
    variable Here [file dirname [file normalize [info script]]]
}
source [file join $::tracker::pictures::Here .. picture.tcl]

# A copy of the demo whose buffers have names of their own: another one may run. Returns its folder.
proc tracker::pictures::own folder {
    variable Here
    foreach name [glob -tails -directory $Here *] {
        set in [open [file join $Here $name]]
        set out [open [file join $folder $name] w]
        puts -nonewline $out [regsub -all {tracker\.(?!tcl|launch|dict)} [read $in] picture[pid].]
        close $in
        close $out
    }
    return $folder
}

# ---- a circuit: units in columns, each behind all that it reads ----

proc tracker::pictures::circuit {file folder} {
    sorma::so::dict CTRL -load [file join [own $folder] tracker.dict]
    foreach name {robot shmem} {
        package require sorma::service::$name
    }
    set links {}                ;# dict: {FROM TO} -> pins of FROM
    set constants {}            ;# dict: unit -> numbers
    set column {}               ;# dict: unit -> its column
    foreach line [split [lindex [circuit.tracker DBX -order] 3] \n] {
        dict set column [lindex $line 1] 0
    }
    foreach line [split [lindex [circuit.tracker DBX -wires] 3] \n] {
        set arrow [lsearch -exact $line ->]
        set to [Unit [lindex $line $arrow+1] $column]
        if {$arrow > 1 || [set from [Unit [lindex $line 0] $column]] eq {}} {
            dict lappend constants $to [concat {*}[lrange $line 0 $arrow-1]]
            continue
        }
        dict lappend links [list $from $to] [regsub -all {\[.*} [string range [lindex $line 0] [string length $from]+1 end] {}]
    }
    # In the order of execution, so that what a unit reads has its column already.
    dict for {unit -} $column {
        dict for {ends -} $links {
            if {[lindex $ends 1] eq $unit} {
                dict set column $unit [expr {max([dict get $column $unit], [dict get $column [lindex $ends 0]] + 1)}]
            }
        }
    }
    # A unit that is read late stands beside its reader.
    foreach unit [lreverse [dict keys $column]] {
        set readers [lmap ends [dict keys $links] {if {[lindex $ends 0] ne $unit} continue; dict get $column [lindex $ends 1]}]
        if {$readers ne {}} {
            dict set column $unit [expr {[::tcl::mathfunc::min {*}$readers] - 1}]
        }
    }
    Draw $column $links $constants
    picture save $file
    return 0
}
# The unit that a pin belongs to; none: it is a number.
proc tracker::pictures::Unit {pin units} {
    foreach unit [dict keys $units] {
        if {[string match $unit.* $pin]} {
            return $unit
        }
    }
}
proc tracker::pictures::Draw {column links constants} {
    set px sorma::style::pixels
    set font [sorma::style font small]
    set width [expr {[::tcl::mathfunc::max {*}[lmap unit [dict keys $column] {font measure $font $unit}]] + [$px 12]}]
    set height [expr {2 * [font metrics $font -linespace]}]
    set across [expr {$width + [$px 42]}]
    set down [expr {$height + [$px 26]}]
    foreach unit [dict keys $column] {
        dict lappend columns [dict get $column $unit] $unit
    }
    set most [::tcl::mathfunc::max {*}[lmap units [dict values $columns] {llength $units}]]
    pack [canvas .c -background white -highlightthickness 0 -width [expr {[dict size $columns] * $across}] -height [expr {$most * $down}]]
    dict for {x units} $columns {
        set y [expr {($most - [llength $units]) * $down / 2.0 + $down / 2.0}]
        foreach unit $units {
            dict set at $unit [list [expr {$x * $across + $across / 2.0}] $y]
            set y [expr {$y + $down}]
        }
    }
    dict for {ends pins} $links {
        lassign [dict get $at [lindex $ends 0]] x y
        lassign [dict get $at [lindex $ends 1]] u v
        set begin [expr {$x + $width / 2.0}]
        set end [expr {$u - $width / 2.0}]
        # Past other columns it goes between their rows.
        set between [expr {[dict get $column [lindex $ends 1]] > [dict get $column [lindex $ends 0]] + 1 ? [list [expr {$begin + [$px 20]}] [expr {$y + $down / 2.0}] \
            [expr {$end - [$px 20]}] [expr {$y + $down / 2.0}]] : {}}]
        .c create line [concat $begin $y $between $end $v] -arrow last -fill #1a5fb4
        # Beside its begin, where lines of one unit have not parted yet.
        .c create text [expr {$x + $width / 2.0 + [$px 3]}] [expr {$y + ($v < $y ? -1 : 1) * [$px 2]}] -anchor [expr {$v < $y ? "sw" : "nw"}] \
            -text [join [lsort -unique $pins] ", "] -font $font -fill #606060
    }
    dict for {unit place} $at {
        lassign $place x y
        .c create rectangle [expr {$x - $width / 2.0}] [expr {$y - $height / 2.0}] [expr {$x + $width / 2.0}] [expr {$y + $height / 2.0}] -fill #f4f4f2
        .c create text $x $y -text $unit -font $font
        if {[dict exists $constants $unit]} {
            .c create text $x [expr {$y + $height / 2.0}] -anchor n -text [join [lmap numbers [dict get $constants $unit] {join $numbers}] "; "] -font $font -fill #606060
        }
    }
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
