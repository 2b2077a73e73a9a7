# disc.tcl -- round spots with smooth edges: Tk's own ovals have steps. Each is drawn once, and kept.

package require Tk
package require sorma::colours
package provide sorma::disc 1.0

namespace eval ::sorma::disc {
    namespace export of
    namespace ensemble create
    variable Images {}          ;# dict: {SIZE FILL EDGE} -> picture
    variable Most 200           ;# pictures; beyond it those are deleted that nobody shows
}

# ::sorma::disc of SIZE FILL EDGE -- a picture, so many pixels wide. An empty FILL: a ring. Colours are #rrggbb.
proc ::sorma::disc::of {size fill edge} {
    variable Images
    variable Most
    set key [list $size $fill $edge]
    if {![dict exists $Images $key]} {
        if {[dict size $Images] >= $Most} {
            Tidy
        }
        dict set Images $key [Draw $size $fill $edge]
    }
    return [dict get $Images $key]
}

proc ::sorma::disc::Tidy {} {
    variable Images
    dict for {key image} $Images {
        if {![image inuse $image]} {
            image delete $image
            dict unset Images $key
        }
    }
}

# A pixel at the rim is covered in part: the picture cannot be half transparent in Tk 8.6, so it is put as PNG with an alpha channel.
proc ::sorma::disc::Draw {size fill edge} {
    scan $edge #%2x%2x%2x r g b
    set middle [expr {$size / 2.0}]
    set radius [expr {$middle - 0.5}]
    set thick [expr {max(1.0, $size / 10.0)}]
    set rows {}
    for {set y 0} {$y < $size} {incr y} {
        append rows \0
        for {set x 0} {$x < $size} {incr x} {
            set d [expr {hypot($x + 0.5 - $middle, $y + 0.5 - $middle)}]
            set part [expr {min(1.0, max(0.0, $radius - $d + 0.5))}]
            if {$fill eq {}} {
                set part [expr {min($part, max(0.0, min(1.0, $d - $radius + $thick + 0.5)))}]
            }
            append rows [binary format c4 [list $r $g $b [expr {round(255 * $part)}]]]
        }
    }
    set head [binary format IIccccc $size $size 8 6 0 0 0]
    set data "\x89PNG\r\n\x1a\n"
    foreach {name content} [list IHDR $head IDAT [zlib compress $rows] IEND {}] {
        append data [binary format I [string length $content]] $name $content [binary format I [zlib crc32 $name$content]]
    }
    return [image create photo -data $data -format png]
}
