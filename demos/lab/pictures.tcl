# pictures.tcl WHAT FILE ?THEME? -- a picture of the laboratory for a page, as PNG.
#
# WHAT is scene, as the free camera sees it; or reading, a board and how getBrdSit reads it; or panel, the operator's, while all runs.
#
#     xvfb-run -a -s "-screen 0 1600x1200x24" tclsh8.6 pictures.tcl panel panel.png
#
# It needs a display; the panel's also Tk's package Img, and a runtime folder where no daemon has the name of one of the laboratory's.

package require Tk

namespace eval lab::pictures {
    variable Here [file dirname [file normalize [info script]]]
}
foreach name {lab boards colours ../measure ../picture} {
    source [file join $::lab::pictures::Here $name.tcl]
}

proc lab::pictures::scene file {
    package require sorma::service::simlab
    sorma::create simlab.picture -prefix picture[pid]. -paused 1 -shadows 1
    simlab.picture CTRL -person 0.75 0.1 0.12
    simlab.picture EXEC FMSG 1 0.5
    [image create photo -data [dict get [simlab.picture exec -floats {140 -25 1.9 0.45 0 0.2} view] any]] write $file -format png
    return 0
}

# A board that stands askew, in the middle of a game.
proc lab::pictures::reading file {
    package require sorma::service::simlab
    expr {srand(4)}
    set table $file.hsv
    try {
        lab::colours::learn $table
        lab::boards::prepare $table picture[pid].
        lab::boards::next
        lab::boards::read
        [image create photo -data [dict get [getBrdSit.boards exec debug] any]] write $file -format png
    } finally {
        file delete $table
    }
    return 0
}

proc lab::pictures::panel {file theme} {
    variable Here
    picture begin $theme
    set folder [exec mktemp -d]
    set launch [lab::launch [own $folder]]
    try {
        uplevel #0 [list source [file join $Here panel.tcl]]
        wm geometry . +0+0
        simlab@lab CTRL -speed 0
        pino@robot EXEC power on
        calibrate@robot EXEC
        # Something to see in the charts: the table is felt.
        set push [sorma::async push.down@robot EXEC FMSG 6 0.42 0.22 0.02 0.42 0.22 0.004]
        $push wait
        measure until {[image width [.picture photo]] > 100 && [llength [.chart data z]] > 200 && [.side.guards.lroom cget -foreground] eq [sorma::style::colour good]}
        picture save $file
        return 0
    } finally {
        lab::finish $launch
        file delete -force $folder
    }
}
# The laboratory with buffers of its own. Returns its launch file.
proc lab::pictures::own folder {
    variable Here
    picture copy $folder $Here {lab.launch lab.dict} {demo\.}
    return [file join $folder lab.launch]
}

lassign $argv what file theme
switch -- $what {
    scene { exit [lab::pictures::scene $file] }
    reading { exit [lab::pictures::reading $file] }
    panel { exit [lab::pictures::panel $file $theme] }
    default {
        puts stderr "usage: pictures.tcl scene|reading|panel FILE ?THEME?"
        exit 2
    }
}
