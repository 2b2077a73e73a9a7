# pictures.tcl FILE ?THEME? ?OPTION VALUE ...? -- a picture of the window for a page, PNG: a game in the laboratory after some moves. Options
# are those of checkers.tcl.
#
#     xvfb-run -a -s "-screen 0 1920x1200x24" tclsh8.6 pictures.tcl checkers.png
#
# It needs a display, Tk's package Img, and a runtime folder where no daemon has the name of one of the game's.

package require Tk
set argv [lassign $argv picture theme]
set picture [file normalize $picture]         ;# the game goes to a folder of its own
source [file join [file dirname [file dirname [file normalize [info script]]]] picture.tcl]
picture begin $theme
# A copy of the demo whose buffers have names of their own.
proc own folder {
    set demos [file dirname [file dirname [file normalize [info script]]]]
    foreach name {measure.tcl lab checkers} {
        file copy [file join $demos $name] $folder
    }
    picture copy [file join $folder checkers] [file join $demos checkers] checkers.dict {((?:-prefix|-key) )checkers\.}
}
set folder [exec mktemp -d]
own $folder
set argv [list -once -speed 0 -level 1 -personLevel 1 -folder [file join $folder game] {*}$argv]
source [file join $folder checkers checkers.tcl]

# When the person's fourth turn begins, the laboratory stands still. The camera was above the board then. Its picture and moving parts of
# the window get a moment to be shown.
proc photograph args {
    if {$::checkers::window::State ni {person ponder} || ![regexp {3\. \S+ \S+ } [dict get $::checkers::window::Last pdn]]} {
        return
    }
    trace remove variable ::checkers::window::State write photograph
    simlab@lab CTRL -paused 1
    after 1500 develop
}
proc develop {} {
    wm geometry . +0+0
    try {
        picture save $::picture
    } finally {
        simlab@lab CTRL -paused 0
        checkers::program::Closed .
    }
}
# Nobody sees a dialog here.
proc bgerror text {
    puts stderr $::errorInfo
}
source [file join $::checkers::session::Here window.tcl]
trace add variable ::checkers::window::State write photograph
try {
    checkers::program::run
} finally {
    file delete -force $folder
}
exit [expr {![file exists $picture]}]
