# postscript.tcl -- what is on a canvas, as PostScript.

package require Tk
package provide sorma::postscript 1.0

namespace eval ::sorma::postscript {}

# ::sorma::postscript::of CANVAS ?REGION? -- the text of the file. REGION: {left top right bottom}, default the box of all items.
# The fonts are those that each printer and each viewer has. Tk would name those of the screen: ghostscript makes bars of the letters of some, and
# Courier of others. Tk leaves the ground out, too: on paper, a dark theme would have light letters on white.
proc ::sorma::postscript::of {canvas {region {}}} {
    lassign [concat [if {$region ne {}} {set region} else {$canvas bbox all}] {0 0 1 1}] left top right bottom
    foreach item [$canvas find all] {
        if {[$canvas type $item] eq "text"} {
            set font [$canvas itemcget $item -font]
            set fonts($font) [Standard $font]
        }
    }
    set ground [$canvas create rectangle $left $top $right $bottom -outline {} -fill [$canvas cget -background]]
    try {
        $canvas lower $ground
        return [$canvas postscript -colormode color -fontmap fonts -x $left -y $top -width [expr {$right - $left}] -height [expr {$bottom - $top}]]
    } finally {
        $canvas delete $ground
    }
}
# {NAME POINTS} of the standard font that is most like this one.
proc ::sorma::postscript::Standard font {
    set is [::font actual $font]
    set size [dict get $is -size]
    return [list [expr {[::font metrics $font -fixed] ? "Courier" : "Helvetica"}][expr {[dict get $is -weight] eq "bold" ? "-Bold" : {}}] \
        [expr {$size < 0 ? -$size / [tk scaling] : $size}]]
}
