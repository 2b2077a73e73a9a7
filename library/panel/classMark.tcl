# classMark.tcl -- a small picture that stands for a class, so that the eye finds its objects again. It is made of the name alone: the same class has
# the same mark in each window, on each computer. The left half is mirrored to the right; the colour is one of those of charts.

package require Tk
package require sorma::style
package provide sorma::classMark 1.0

namespace eval ::sorma::classMark {
    namespace export of cells
    namespace ensemble create
    variable Images {}          ;# dict: class -> picture
    variable Most 400           ;# pictures: a daemon can invent classes without end. Those that come later have an empty one
}

# ::sorma::classMark of CLASS -- a picture, 16 pixels wide at 96 dots per inch, and room at its right; it follows the theme.
proc ::sorma::classMark::of class {
    variable Images
    variable Most
    if {$Images eq {}} {
        bind . <<ThemeChanged>> {+::sorma::classMark::Repaint}
    }
    if {![dict exists $Images $class] && [dict size $Images] >= $Most} {
        set class {}
    }
    if {![dict exists $Images $class]} {
        dict set Images $class [image create photo -width [expr {5 * [::sorma::style pixels 3] + [::sorma::style pixels 6]}] -height [expr {5 * [::sorma::style pixels 3]}]]
        Paint $class
    }
    return [dict get $Images $class]
}

# ::sorma::classMark cells CLASS -- the number of its colour, then the column and row of each cell that has it, in a square of five by five.
proc ::sorma::classMark::cells class {
    if {$class eq {}} {
        return 0
    }
    set number [zlib crc32 [encoding convertto utf-8 $class]]
    set cells {}
    for {set i 0} {$i < 15} {incr i} {
        if {($number >> $i) & 1} {
            set x [expr {$i % 3}]
            lappend cells {*}[concat {*}[lmap column [lsort -unique [list $x [expr {4 - $x}]]] {list $column [expr {$i / 3}]}]]
        }
    }
    return [list [expr {($number >> 15) % 6}] {*}$cells]
}

proc ::sorma::classMark::Paint class {
    variable Images
    set size [::sorma::style pixels 3]
    set cells [lassign [cells $class] colour]
    set image [dict get $Images $class]
    $image blank
    foreach {x y} $cells {
        $image put [::sorma::style series $colour] -to [expr {$x * $size}] [expr {$y * $size}] [expr {($x + 1) * $size}] [expr {($y + 1) * $size}]
    }
}
proc ::sorma::classMark::Repaint {} {
    variable Images
    foreach class [dict keys $Images] {
        Paint $class
    }
}
