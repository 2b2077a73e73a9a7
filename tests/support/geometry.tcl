# geometry.tcl -- where the parts of windows stand: do they overlap, is a text cut, do labels stand on the line of their fields.

# The windows in a panel that people look at, with their places: {window left up right down}. Frames and canvases hold others.
# Items that a canvas has scrolled away are left out.
proc placed {top {sight {0 0 10000 10000}}} {
    set found {}
    foreach child [winfo children $top] {
        if {![winfo viewable $child]} continue
        lassign $sight left up right down
        set x [winfo rootx $child]
        set y [winfo rooty $child]
        set area [list [expr {max($left, $x)}] [expr {max($up, $y)}] [expr {min($right, $x + [winfo width $child])}] [expr {min($down, $y + [winfo height $child])}]]
        if {[lindex $area 0] >= [lindex $area 2] || [lindex $area 1] >= [lindex $area 3]} continue
        if {[winfo class $child] ni {Canvas Frame TFrame TLabelframe TNotebook TPanedwindow} && [winfo children $child] eq {}} {
            lappend found [list $child {*}$area]
        }
        # What is packed in a frame beside it is its sibling: those are not cut off by it.
        lappend found {*}[placed $child $area]
    }
    return $found
}
# The part of a widget that another one covers.
proc overlaps places {
    set found {}
    set rest $places
    foreach a $places {
        set rest [lrange $rest 1 end]
        lassign $a window left up right down
        foreach b $rest {
            lassign $b other l u r d
            if {$left < $r && $l < $right && $up < $d && $u < $down} {
                lappend found "[winfo name $window] and [winfo name $other] overlap"
            }
        }
    }
    return $found
}
# Where the line stands on which a text is written; of what has text of one line in its middle.
proc baseline window {
    return [expr {[winfo rooty $window] + [winfo height $window] / 2.0}]
}
# The first part of a field with a text.
proc written field {
    foreach child [list $field {*}[winfo children $field]] {
        if {[winfo class $child] in {TEntry TCombobox TCheckbutton TRadiobutton}} {
            return $child
        }
    }
    foreach child [winfo children $field] {
        if {[winfo children $child] ne {}} {
            return [written $child]
        }
    }
}
# The errors in a panel's geometry.
proc crooked panel {
    set inner $panel.body.canvas.inner
    set found [overlaps [placed $panel]]
    set edges {}
    foreach field [lsearch -all -inline -regexp [winfo children $inner] {\.field\d+$}] {
        regexp {\d+$} $field n
        if {[winfo manager $field] eq {}} continue
        set part [written $field]
        if {$part ne {} && abs([baseline $part] - [baseline $inner.label$n]) > 1} {
            lappend found "[$inner.label$n cget -text]: its label is [expr {[baseline $part] - [baseline $inner.label$n]}] px above its field"
        }
        dict lappend edges field [winfo x $field]
        dict lappend edges label [winfo x $inner.label$n]
    }
    dict for {what columns} $edges {
        if {[llength [lsort -unique $columns]] > 1} {
            lappend found "columns of $what: [lsort -unique $columns]"
        }
    }
    return [concat $found [cut [placed $panel]]]
}
# Texts that have less room than they need. Places: as of placed.
proc cut places {
    set found {}
    foreach place $places {
        lassign $place window left up right down
        set class [winfo class $window]
        # A notice is one line or two, and is shown in full in a tip.
        if {$class ni {TLabel TButton TCheckbutton TRadiobutton Button} || [$window cget -text] eq {} || [string match *say.text $window]} continue
        set font [expr {$class in {TLabel Button} && [$window cget -font] ne {} ? [$window cget -font] : "TkDefaultFont"}]
        set needed [tcl::mathfunc::max {*}[lmap line [split [$window cget -text] \n] {font measure $font $line}]]
        if {$class eq "TLabel" && [$window cget -wraplength] > 0} {
            set needed [winfo reqwidth $window]
        }
        # A part of a canvas may be scrolled out of sight.
        set high [expr {[string match *.canvas.* $window] ? [winfo height $window] : $down - $up}]
        if {$right - $left < $needed || $high < [winfo reqheight $window]} {
            lappend found "[winfo name $window] \"[$window cget -text]\" is cut: [expr {$right - $left}] of $needed px, $high of [winfo reqheight $window]"
        }
    }
    return $found
}
# The same when the window has come to rest, or after 3 s.
proc faults top {
    catch {waitFor {[wrong $top] eq {}} 3000}
    return [wrong $top]
}
# What is wrong in a window: parts that overlap, and texts that are cut. Parts that are scrolled away are left out.
proc wrong top {
    set places [placed $top [list [winfo rootx $top] [winfo rooty $top] [expr {[winfo rootx $top] + [winfo width $top]}] [expr {[winfo rooty $top] + [winfo height $top]}]]]
    return [concat [overlaps $places] [cut $places]]
}
