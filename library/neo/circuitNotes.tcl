# circuitNotes.tcl -- ::sorma::circuitNotes: comments and frames in the picture of a circuit. They stand in -places, and change nothing else.
#
# A frame that is moved takes all along that stands inside of it.

package require snit
package require sorma::circuitLayout
package require sorma::circuitText
package require sorma::style
package provide sorma::circuitNotes 1.0

snit::macro ::sorma::circuitNotes {} {
    variable notes {}           ;# as circuitText has them, each with a box {x y width height}

    method ReadNotes {} {
        set notes [dict map {key note} [::sorma::circuitText notes [dict get $recipe -places]] {
            dict set note box [concat [dict get $note place] \
                [if {[dict get $note size] ne {}} {dict get $note size} else {::sorma::circuitLayout note [dict get $note text]}]]
        }]
    }
    # notes -- comments and frames: a dict KEY -> {kind place size text box}.
    method notes {} {
        return $notes
    }
    # {x y width height} of anything in the picture.
    method box key {
        return [if {[dict exists $notes $key]} {dict get $notes $key box} else {dict get $boxes $key}]
    }
    # The names of these in words.
    proc Named keys {
        return [join [lmap key $keys {if {[lindex $key 0] in {note frame}} {set key} else {lindex $key 1}}] {, }]
    }
    # note X Y TEXT, frame KEYS TEXT: a new one. Returns its key.
    method note {x y text} {
        return [$self AddNote note [list [expr {round($x)}] [expr {round($y)}] [::sorma::circuitText quote $text]]]
    }
    method frame {keys text} {
        return [$self AddNote frame [concat [$self Around $keys] [list [::sorma::circuitText quote $text]]]]
    }
    method AddNote {kind words} {
        for {set n 1} {[dict exists $notes [list $kind $n]]} {incr n} {}
        $self Edit "add $kind $n" [dict create -places [::sorma::circuitText place [dict get $recipe -places] [list [list $kind $n] $words]]]
        return [list $kind $n]
    }
    # The box of a frame around these.
    method Around keys {
        set edges [lmap key $keys {
            lassign [$self box $key] x y width height
            list $x $y [expr {$x + $width}] [expr {$y + $height}]
        }]
        foreach edge {left top right bottom} least {min min max max} at {0 1 2 3} {
            set $edge [tcl::mathfunc::$least {*}[lmap box $edges {lindex $box $at}]]
        }
        return [list [expr {$left - 3}] [expr {$top - 5}] [expr {$right - $left + 6}] [expr {$bottom - $top + 8}]]
    }
    # retext KEY TEXT, resize KEY WIDTH HEIGHT: of one that is there.
    method retext {key text} {
        $self ChangeNote "change [join $key]" $key [dict replace [dict get $notes $key] text $text]
    }
    method resize {key width height} {
        $self ChangeNote "resize [join $key]" $key [dict replace [dict get $notes $key] size [list [expr {max(4, $width)}] [expr {max(4, $height)}]]]
    }
    method ChangeNote {name key note} {
        set words [concat [dict get $note place] [dict get $note size] [list [::sorma::circuitText quote [dict get $note text]]]]
        $self Edit $name [dict create -places [::sorma::circuitText place [dict get $recipe -places] [list $key $words]]]
    }
    # These, and all that stands inside of the frames among them.
    method WithInner keys {
        foreach key $keys {
            if {[lindex $key 0] ne "frame"} continue
            lassign [$self box $key] x y width height
            foreach other [concat [dict keys $boxes] [dict keys $notes]] {
                lassign [$self box $other] X Y wide high
                if {$other ni $keys && $X >= $x && $Y >= $y && $X + $wide <= $x + $width && $Y + $high <= $y + $height} {
                    lappend keys $other
                }
            }
        }
        return $keys
    }
    # Where a comment covers no box, no comment, and no wire: there, or below.
    method FreeForNote {place text} {
        set pieces [concat {*}[lmap way $ways {
            lmap {x y} [lrange $way 0 end-2] {X Y} [lrange $way 2 end] {
                lmap n [list [expr {min($x, $X)}] [expr {min($y, $Y)}] [expr {abs($X - $x)}] [expr {abs($Y - $y)}]] {expr {round($n)}}
            }
        }]]
        set others [lmap {key note} $notes {if {[lindex $key 0] ne "note"} continue; dict get $note box}]
        return [::sorma::circuitLayout free $place {*}[::sorma::circuitLayout note $text] [concat [dict values $boxes] $others $pieces]]
    }
    # The text of a new comment or frame is typed in the line; \n is a line break.
    method Comment {} {
        $self Line [concat {note new} [$self Centre]]
    }
    method Frame {} {
        if {$chosenKeys eq {}} {
            set hint "[::sorma::style mark refused] frame: select boxes first"
            return
        }
        $self Line [list frame new $chosenKeys]
    }
    method NoteTyped text {
        set text [string map {\\n \n} $text]
        switch -- [lrange $lineFor 0 1] {
            {note new} {
                if {$text ne {}} {
                    $self note {*}[$self FreeForNote [lrange $lineFor 2 3] $text] $text
                }
            }
            {frame new} { $self frame [lindex $lineFor 2] $text }
            default {
                if {$text eq {} && [lindex $lineFor 0] eq "note"} {
                    $self delete [list $lineFor] {}
                } elseif {[dict exists $notes $lineFor]} {
                    $self retext $lineFor $text
                }
            }
        }
    }
    # Shift with an arrow key.
    method Grow {dx dy} {
        foreach key $chosenKeys {
            if {[lindex $key 0] eq "frame"} {
                lassign [dict get $notes $key size] width height
                $self resize $key [expr {$width + $dx}] [expr {$height + $dy}]
            }
        }
    }
}
