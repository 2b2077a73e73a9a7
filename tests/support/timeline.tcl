# timeline.tcl -- recordings for suites of the time line, what class recorder says of them, and a window on the screen.

set folder [makeDirectory timeline[pid]]
set file [file join $folder run.rec]

oo::class create ::lamp {
    superclass sorma::Service
    sorma::option -level int -range {0 100}
    method exec message {
        return [dict create]
    }
}
# Requests at three objects in ten rounds, of which one in each has failed.
proc record {} {
    sorma::create recorder.made -file $::file -requests * -events lamp.*
    recorder.made CTRL -record
    for {set i 0} {$i < 10} {incr i} {
        echo.one EXEC IMSG 1 $i
        lamp.a CTRL -level $i
        catch {lamp.a CTRL -level [expr {1000 + $i}]}
        echo.two EXEC TMSG "text $i"
    }
    recorder.made CTRL -stop
    sorma::remove recorder.made
}
# An hour of 200 objects.
proc recordMany {} {
    set ::many [file join $::folder many.rec]
    if {![file exists $::many]} {
        exec [file join $::env(SORMA_BUILD) bench manyRecords] $::many 40000
    }
}
proc ask args {
    return [lindex [recorder.line EXEC timeline {*}$args] 3]
}
# Ask an object about a file; it has read all of it when this returns.
proc reader which {
    sorma::create recorder.line -file $which
    waitFor {[dict get [ask] done] == 1}
}
proc ns seconds {
    return [sorma::timelineText::ns $seconds]
}
proc seconds ns {
    return [sorma::timelineText::seconds $ns]
}
# Replies of a file, to requests that are in it: a list of {SOURCE OBJECT FROM UNTIL FAILED}.
proc replies {} {
    set out {}
    set begun {}
    set stream [sorma::stream {recorder.line EXEC records}]
    while {[$stream next piece]} {
        foreach record [dict get $piece text] {
            set key [list [dict get $record source] [dict get $record number]]
            if {[dict get $record kind] eq "request"} {
                dict set begun $key [ns [dict get $record time]]
            } elseif {[dict get $record kind] eq "reply" && [dict exists $begun $key]} {
                lappend out [list [dict get $record source] [dict get $record object] [dict get $begun $key] [ns [dict get $record time]] [expr {[dict get $record code] < 0}]]
            }
        }
    }
    $stream close
    return [lsort -integer -index 2 $out]
}

# ---- a window ----

# withLine args script: .t.w, on the screen, all read and drawn.
proc withLine {words script} {
    sorma::theme use light
    toplevel .t
    wm geometry .t 900x600+0+0
    try {
        pack [sorma::timeline .t.w {*}$words] -fill both -expand 1
        set ::c .t.w.panes.line.canvas
        waitFor {[winfo ismapped $::c] && [winfo width $::c] > 700 && [.t.w idle]}
        display::focus $::c
        uplevel 1 $script
    } finally {
        destroy .t
    }
}
proc settled {} {
    update
    waitFor {[.t.w idle]}
    update
}
proc key {name args} {
    event generate $::c <Key> -keysym $name {*}$args
    settled
}
proc wheel {x y {button 4}} {
    event generate $::c <Button-$button> -x $x -y $y
    settled
}
proc names {} {
    return [lmap id [$::c find withtag name] {$::c itemcget $id -text}]
}
# The middle of the mark of that tag that is farthest left.
proc placeOf {tag {row 0}} {
    set boxes [lsort -real -index 0 [lmap id [$::c find withtag $tag] {$::c bbox $id}]]
    lassign [lindex $boxes 0] x y right bottom
    return [list [expr {($x + $right) / 2}] [expr {($y + $bottom) / 2}]]
}
