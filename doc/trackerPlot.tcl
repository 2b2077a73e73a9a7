# trackerPlot.tcl CSV SVG -- a recording of the tracker (demos/tracker/tracker.tcl -csv) as a drawing.
#
# It has the places of ball and tool, and the distance of the tool from its right place. In each column of pixels the mean of a place, and the largest error.

package require Tcl 8.6-
source -encoding utf-8 [file join [file dirname [file dirname [file normalize [info script]]]] library base colours.tcl]

namespace eval trackerPlot {
    variable Width 900
    variable Left 50
    variable Colours {ball series2 tool series1 error error}     ;# of library/base/colours.tcl
    variable Above 0.3          ;# [m] the tool above the ball
}

# Dicts: column of pixels -> number; and where rows begin: {column name ...}. They are empty where nothing was recorded.
proc trackerPlot::columns records {
    variable Width
    variable Left
    variable Above
    set begin [lindex $records 0 0]
    set scale [expr {($Width - $Left - 1) / double([lindex $records end 0] - $begin)}]
    set rows {}
    set sums {}
    set errors {}
    foreach record $records {
        lassign $record time bx by bz x y z row
        set column [expr {int($Left + ($time - $begin) * $scale)}]
        if {$row ne [lindex $rows end]} {
            lappend rows $column $row
        }
        lassign [if {[dict exists $sums $column]} {dict get $sums $column} else {list 0 0.0 0.0}] n ball tool
        dict set sums $column [list [incr n] [expr {$ball + $by}] [expr {$tool + $y}]]
        set error [expr {1e3 * sqrt(($x - $bx) ** 2 + ($y - $by) ** 2 + ($z - $bz - $Above) ** 2)}]
        dict set errors $column [expr {max($error, [if {[dict exists $errors $column]} {dict get $errors $column} else {expr 0}])}]
    }
    set balls {}
    set tools {}
    dict for {column sum} $sums {
        lassign $sum n ball tool
        dict set balls $column [expr {$ball / $n}]
        dict set tools $column [expr {$tool / $n}]
    }
    return [list $balls $tools $errors $rows $scale]
}

# A line through numbers by column, in a box between the heights top and bottom, for numbers from low to high.
proc trackerPlot::Line {numbers what top bottom low high} {
    variable Colours
    set points [lmap {column number} $numbers {
        string cat $column , [format %.1f [expr {$bottom - ($bottom - $top) * (min($high, max($low, $number)) - $low) / double($high - $low)}]]
    }]
    return "<polyline fill=\"none\" stroke=\"var(--[dict get $Colours $what])\" stroke-width=\"1.2\" points=\"$points\"/>"
}
proc trackerPlot::Text {x y text {anchor start} {colour text}} {
    return "<text x=\"$x\" y=\"$y\" text-anchor=\"$anchor\" fill=\"var(--$colour)\">[string map {& &amp; < &lt;} $text]</text>"
}
# The box with lines at some numbers.
proc trackerPlot::Box {top bottom low high numbers unit} {
    variable Width
    variable Left
    set out {}
    foreach number $numbers {
        set y [expr {$bottom - ($bottom - $top) * ($number - $low) / double($high - $low)}]
        append out "<line x1=\"$Left\" x2=\"$Width\" y1=\"$y\" y2=\"$y\" stroke=\"var(--line)\"/>[Text [expr {$Left - 5}] [expr {$y + 4}] $number end]\n"
    }
    return $out[Text 2 [expr {$top - 8}] $unit]
}

proc trackerPlot::draw records {
    variable Width
    variable Left
    variable Colours
    lassign [columns $records] balls tools errors rows scale
    set out "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 [expr {$Width + 10}] 460\" font-family=\"sans-serif\" font-size=\"11\">\n<style>[::sorma::colours::css]</style>\n"
    append out "<rect width=\"100%\" height=\"100%\" fill=\"var(--surface)\"/>\n"
    append out [Box 60 260 -0.2 0.2 {-0.2 -0.1 0 0.1 0.2} "y \[m\]"] [Box 300 430 0 50 {0 10 20 30 40 50} "error \[mm\], at most 50 shown"]
    set level 0
    foreach {column row} $rows {
        append out "<line x1=\"$column\" x2=\"$column\" y1=\"60\" y2=\"430\" stroke=\"var(--edge)\" stroke-dasharray=\"3 3\"/>"
        set height [expr {12 + 15 * ($level % 3)}]
        append out [if {$column < 0.75 * $Width} {Text [expr {$column + 3}] $height $row} else {Text $Width $height $row end}]\n
        incr level
    }
    append out [Text 200 290 ball start [dict get $Colours ball]] [Text 240 290 tool start [dict get $Colours tool]]\n
    append out [Line $balls ball 60 260 -0.2 0.2] \n [Line $tools tool 60 260 -0.2 0.2] \n [Line $errors error 300 430 0 50] \n
    for {set second 0} {$Left + $second * $scale <= $Width} {incr second 10} {
        append out [Text [expr {$Left + $second * $scale}] 448 "$second s" middle]
    }
    return "$out\n</svg>"
}

proc trackerPlot::make {csv svg} {
    set file [open $csv]
    gets $file
    set records [lmap line [split [string trim [read $file]] \n] {
        regexp {^(.*),"(.*)"$} $line - numbers row
        list {*}[split $numbers ,] $row
    }]
    close $file
    set file [open $svg w]
    puts $file [draw $records]
    close $file
}

trackerPlot::make {*}$argv
