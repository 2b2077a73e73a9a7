# svg.tcl -- what is on a canvas, as SVG: lines, polygons, ovals, rectangles and text, in their order and colours.

package require Tk
package provide sorma::svg 1.0

namespace eval ::sorma::svg {}

# ::sorma::svg::of CANVAS ?REGION? -- the text of the file. REGION: {left top right bottom}, default the box of all items.
proc ::sorma::svg::of {canvas {region {}}} {
    lassign [concat [if {$region ne {}} {set region} else {$canvas bbox all}] {0 0 1 1}] left top right bottom
    set width [expr {$right - $left}]
    set height [expr {$bottom - $top}]
    set out [list "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"$width\" height=\"$height\" viewBox=\"$left $top $width $height\">" \
        "<rect x=\"$left\" y=\"$top\" width=\"$width\" height=\"$height\" fill=\"[Colour $canvas [$canvas cget -background]]\"/>"]
    foreach item [$canvas find all] {
        set type [$canvas type $item]
        if {$type in {line polygon oval rectangle text} && [$canvas itemcget $item -state] ne "hidden"
                && ($type ne "text" || [$canvas itemcget $item -text] ne {})} {
            set shape [dict get {line Line polygon Polygon oval Oval rectangle Rectangle text Text} $type]
            lappend out [$shape $canvas $item [$canvas coords $item]]
        }
    }
    return [join [concat $out [list </svg>]] \n]\n
}
proc ::sorma::svg::Line {canvas item coords} {
    return "<polyline points=\"[join $coords]\" fill=\"none\"[Stroke $canvas $item -fill]/>"
}
# A smooth one goes through the middle of each side, with its corners as control points.
proc ::sorma::svg::Polygon {canvas item coords} {
    set look "fill=\"[Colour $canvas [$canvas itemcget $item -fill]]\"[Stroke $canvas $item -outline]"
    if {[$canvas itemcget $item -smooth] in {0 {}}} {
        return "<polygon points=\"[join $coords]\" $look/>"
    }
    set path {}
    foreach {x y} $coords {X Y} [concat [lrange $coords 2 end] [lrange $coords 0 1]] {
        set middle "[expr {($x + $X) / 2}] [expr {($y + $Y) / 2}]"
        append path [if {$path eq {}} {string cat "M $middle"} else {string cat " Q $x $y $middle"}]
    }
    lassign $coords x y X Y
    return "<path d=\"$path Q $x $y [expr {($x + $X) / 2}] [expr {($y + $Y) / 2}] Z\" $look/>"
}
proc ::sorma::svg::Oval {canvas item coords} {
    lassign $coords x y X Y
    return "<ellipse cx=\"[expr {($x + $X) / 2}]\" cy=\"[expr {($y + $Y) / 2}]\" rx=\"[expr {($X - $x) / 2}]\" ry=\"[expr {($Y - $y) / 2}]\"\
        fill=\"[Colour $canvas [$canvas itemcget $item -fill]]\"[Stroke $canvas $item -outline]/>"
}
proc ::sorma::svg::Rectangle {canvas item coords} {
    lassign $coords x y X Y
    return "<rect x=\"$x\" y=\"$y\" width=\"[expr {$X - $x}]\" height=\"[expr {$Y - $y}]\"\
        fill=\"[Colour $canvas [$canvas itemcget $item -fill]]\"[Stroke $canvas $item -outline]/>"
}
# Each line of it, where the canvas has it, and as wide as there: another font that a viewer may take would go beyond its box.
proc ::sorma::svg::Text {canvas item coords} {
    set font [$canvas itemcget $item -font]
    lassign [$canvas bbox $item] x y
    set y [expr {$y + [::font metrics $font -ascent]}]
    set size [::font actual $font -size]
    set size [expr {$size < 0 ? -$size : round($size * [tk scaling])}]
    set out {}
    foreach line [split [$canvas itemcget $item -text] \n] {
        if {$line ne {}} {
            lappend out "<text x=\"[expr {$x + 1}]\" y=\"$y\" textLength=\"[::font measure $font -displayof $canvas $line]\" lengthAdjust=\"spacingAndGlyphs\"\
                font-family=\"[string map {& &amp; < &lt; \" &quot;} [::font actual $font -family]], sans-serif\" font-size=\"$size\" font-weight=\"[::font actual $font -weight]\"\
                fill=\"[Colour $canvas [$canvas itemcget $item -fill]]\">[string map {& &amp; < &lt; > &gt;} $line]</text>"
        }
        incr y [::font metrics $font -linespace]
    }
    return [join $out \n]
}
# The stroke has the colour of that option.
proc ::sorma::svg::Stroke {canvas item option} {
    set dash [$canvas itemcget $item -dash]
    return " stroke=\"[Colour $canvas [$canvas itemcget $item $option]]\" stroke-width=\"[$canvas itemcget $item -width]\"[if {$dash ne {}} {string cat " stroke-dasharray=\"[join $dash]\""}]"
}
proc ::sorma::svg::Colour {canvas colour} {
    if {$colour eq {}} {
        return none
    }
    return [format #%02x%02x%02x {*}[lmap part [winfo rgb $canvas $colour] {expr {$part >> 8}}]]
}
