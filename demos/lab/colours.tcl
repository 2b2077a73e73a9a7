# colours.tcl -- the colours of the laboratory's things, learned from painted swatches in more and less light.
#
#     source colours.tcl;  lab::colours::learn board.hsv

package require sorma

namespace eval lab::colours {
    # Label of hsvtable -> red green blue, in usual light.
    variable Things {
        0 {64 107 64   226 219 195   150 146 138   255 255 255   40 40 40   90 90 95   0 0 0}
        1 {204 15 10}
        2 {242 204 13}
        3 {128 13 191}
    }
    variable Side 6             ;# of a swatch [pixels]
}

# Learn a table and write it to a file.
proc lab::colours::learn file {
    variable Things
    variable Side
    expr {srand(1)}
    set rgb {}
    set labels {}
    set rows 0
    foreach light {0.55 0.65 0.75 0.85 0.95 1.05 1.15 1.25} {
        dict for {label things} $Things {
            foreach {r g b} $things {
                for {set i 0} {$i < $Side * $Side} {incr i} {
                    foreach c [list $r $g $b] {
                        lappend rgb [expr {int(min(255, max(0, $light * $c + 8 * rand() - 4)))}]
                    }
                    lappend labels $label
                }
                incr rows $Side
            }
        }
    }
    hsvtable.colours exec -floats [list 0 $Side $rows] -any [binary format cu*cu* $rgb $labels] train
    hsvtable.colours CTRL -learn
    hsvtable.colours CTRL -save $file
    sorma::remove hsvtable.colours
}
