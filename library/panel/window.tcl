# window.tcl -- windows of their own for panels and charts. Each comes back where it was and as large as it was, as far as the screen reaches;
# one that has never been there opens beside the others.

package require Tk
package require sorma::style
package require sorma::text
package provide sorma::window 1.0

namespace eval ::sorma::window {
    namespace export panel chart form dashboard offer open place geometry all file remember timeline recall
    namespace ensemble create
    variable Geometries         ;# dict: toplevel -> {KEY geometry}, as it was last
    variable Last
    if {![info exists Geometries]} {
        set Geometries {}
        set Last 0
    }
}

# ::sorma::window, a window that is opened once:
#       panel NAME                              the panel of an object
#       chart NAME WHAT ?-option value ...?     numbers of it over time, as stripchart plot has them; -index may be several
#       form FILE                               a form
#       timeline FILE, or timeline -name NAME   a recording, or what an object of class recorder has recorded
# It returns the toplevel, the same one when it is open already. The keys of these windows are those that
# arrangement.tcl has for the same.
proc ::sorma::window::panel name {
    package require sorma::panel
    return [open [list panel -name $name] $name ::sorma::panel $name]
}
proc ::sorma::window::chart {name what args} {
    package require sorma::chart
    set plots [list [list $name $what {*}$args]]
    if {[dict exists $args -index] && [llength [dict get $args -index]] > 1} {
        set plots [lmap index [dict get $args -index] {list $name $what {*}[dict replace $args -index $index]}]
    }
    return [open [list stripchart -plot $plots] "$name $what stripchart" ::sorma::stripchart -plot $plots]
}

proc ::sorma::window::form path {
    package require sorma::form
    set path [::file normalize $path]
    return [open [list form -file $path] [::file rootname [::file tail $path]] ::sorma::form -file $path]
}

proc ::sorma::window::timeline {path {name {}}} {
    package require sorma::timeline
    if {$path eq "-name"} {
        return [open [list timeline -name $name] "$name [::msgcat::mc "Time line"]" ::sorma::timeline -name $name]
    }
    set path [::file normalize $path]
    return [open [list timeline -file $path] [::file tail $path] ::sorma::timeline -file $path]
}

# ::sorma::window dashboard ?FILE? ?WALL? -- a window with that dashboard, or with an empty one; WALL 1: full-screen and read-only.
proc ::sorma::window::dashboard {{path {}} {wall 0}} {
    package require sorma::dashboard
    if {$path eq {}} {
        return [open dashboard [::msgcat::mc "Dashboard"] ::sorma::dashboard]
    }
    set path [::file normalize $path]
    return [open [list dashboard -file $path] [::file rootname [::file tail $path]] ::sorma::dashboard -file $path -wall $wall]
}

# ::sorma::window offer NAME -OPTION ?X Y? -- an option for the dashboard at that place of the screen. Without a place, it is for the one that was
# opened last, or a new one. Returns that dashboard; empty: there is none.
proc ::sorma::window::offer {name option {x {}} {y {}}} {
    if {$x eq {}} {
        set last [lindex [dict keys [dict filter [all] script {top key} {expr {[lindex $key 0] eq "dashboard"}}]] end]
        set board [expr {$last ne {} ? $last : [dashboard]}].w
        raise [winfo toplevel $board]
        $board offer $name $option
        return $board
    }
    for {set board [winfo containing $x $y]} {$board ne {}} {set board [winfo parent $board]} {
        if {[winfo class $board] eq "Dashboard"} {
            $board offer $name $option $x $y
            return $board
        }
    }
}

# ::sorma::window open KEY TITLE COMMAND ?ARG ...? -- a window that KEY stands for, filled by COMMAND WINDOW ARG ..., unless it is there.
proc ::sorma::window::open {key title command args} {
    variable Geometries
    variable Last
    foreach {top known} $Geometries {
        if {[lindex $known 0] eq $key} {
            wm deiconify $top
            raise $top
            return $top
        }
    }
    set top [toplevel .sormaWindow[incr Last]]
    wm title $top $title
    try {
        {*}$command $top.w {*}$args
    } on error {message options} {
        destroy $top
        return -options $options $message
    }
    pack $top.w -fill both -expand 1
    place $top $key
    return $top
}

# ::sorma::window place TOPLEVEL KEY -- put it where the window of that key was last, within the screen, or beside those that are open. From now
# on its place is remembered.
proc ::sorma::window::place {top key} {
    variable Geometries
    set remembered [Read]
    if {[dict exists $remembered $key]} {
        geometry $top [dict get $remembered $key]
    } else {
        wm geometry $top [Beside $top [dict keys $Geometries]]
    }
    dict set Geometries $top [list $key {}]
    wm maxsize $top [winfo vrootwidth $top] [winfo vrootheight $top]
    bind $top <Configure> +[list ::sorma::window::Moved %W $top]
    bind $top <Destroy> +[list ::sorma::window::Gone %W $top]
}

# ::sorma::window geometry TOPLEVEL GEOMETRY -- as wm geometry, within the screen.
proc ::sorma::window::geometry {top geometry} {
    wm geometry $top [Inside $top $geometry]
}

# ::sorma::window all -- those that are open: toplevel -> KEY.
proc ::sorma::window::all {} {
    variable Geometries
    return [dict map {top known} $Geometries {lindex $known 0}]
}

proc ::sorma::window::Moved {window top} {
    variable Geometries
    if {$window ne $top || ![dict exists $Geometries $top]} return
    set geometry [wm geometry $top]
    # One that has grown with what is in it, as when the table of an object has come, stays on the screen.
    if {[winfo width $top] == [winfo reqwidth $top] && [winfo height $top] == [winfo reqheight $top]} {
        regexp {\+.*} [Inside $top $geometry] place
        if {![string match *$place $geometry]} {
            wm geometry $top $place
        }
    }
    dict set Geometries $top [lreplace [dict get $Geometries $top] 1 1 $geometry]
}

proc ::sorma::window::Gone {window top} {
    variable Geometries
    if {$window ne $top || ![dict exists $Geometries $top]} {
        return
    }
    lassign [dict get $Geometries $top] key geometry
    dict unset Geometries $top
    if {$geometry ne {}} {
        Write [dict replace [Read] $key $geometry]
    }
}

# A geometry, WIDTHxHEIGHT+X+Y, so that all of the window is on the screen.
proc ::sorma::window::Inside {top geometry} {
    if {![regexp {^(\d+)x(\d+)(?:\+(-?\d+)\+(-?\d+))?$} $geometry -> width height x y]} {
        return {}
    }
    set width [expr {max(50, min($width, [winfo vrootwidth $top]))}]
    set height [expr {max(50, min($height, [winfo vrootheight $top]))}]
    if {$x eq {}} {
        return ${width}x$height
    }
    return ${width}x$height+[join [OnScreen $top $x $y $width $height] +]
}

# Where a window of the size that it wants covers least of the others: beside one of them, or below. If it would hide the most of another one
# everywhere, a little off the last one, so that both can be seen. Empty: there are no others, and the window manager knows best.
proc ::sorma::window::Beside {top others} {
    if {$others eq {}} {
        return {}
    }
    update idletasks
    set width [winfo reqwidth $top]
    set height [winfo reqheight $top]
    set gap [::sorma::style pixels 12]
    set taken [lmap other $others {Area $other}]
    lassign [lindex $taken end] left up
    set least [expr {$width * $height / 2}]
    set best [list [expr {$left + 3 * $gap}] [expr {$up + 3 * $gap}]]
    set beside [lmap area $taken {list [expr {[lindex $area 2] + $gap}] [lindex $area 1]}]
    set below [lmap area $taken {list [lindex $area 0] [expr {[lindex $area 3] + 3 * $gap}]}]       ;# its title stands above a window
    foreach place [concat $beside $below] {
        lassign [OnScreen $top {*}$place $width $height] x y
        set covered [Covered $taken $x $y [expr {$x + $width}] [expr {$y + $height}]]
        if {$covered < $least} {
            set least $covered
            set best [list $x $y]
        }
    }
    lassign [OnScreen $top {*}$best $width $height] x y
    return +$x+$y
}
proc ::sorma::window::Covered {areas left up right down} {
    return [tcl::mathop::+ {*}[lmap area $areas {
        lassign $area l u r d
        expr {max(0, min($right, $r) - max($left, $l)) * max(0, min($down, $d) - max($up, $u))}
    }]]
}
# The place next to x and y where all of a window of that size is on the screen.
proc ::sorma::window::OnScreen {top x y width height} {
    return [list [expr {max(0, min($x, [winfo vrootwidth $top] - $width))}] [expr {max(0, min($y, [winfo vrootheight $top] - $height))}]]
}

# Left, upper, right and lower edge; of one that is not on the screen yet, as it will be.
proc ::sorma::window::Area top {
    if {[winfo ismapped $top]} {
        lassign [list [winfo rootx $top] [winfo rooty $top] [winfo width $top] [winfo height $top]] x y width height
    } else {
        set x [set y 0]
        regexp {([+-]\d+)([+-]\d+)$} [wm geometry $top] -> x y
        set width [winfo reqwidth $top]
        set height [winfo reqheight $top]
    }
    return [list [expr {$x}] [expr {$y}] [expr {$x + $width}] [expr {$y + $height}]]
}
# ::sorma::window remember KEY VALUE -- for the next time, in the same file; recall KEY ?OTHERWISE?
proc ::sorma::window::remember {key value} {
    Write [dict replace [Read] $key $value]
}
proc ::sorma::window::recall {key {otherwise {}}} {
    set known [Read]
    return [if {[dict exists $known $key]} {dict get $known $key} else {set otherwise}]
}

# ::sorma::window file -- where that is remembered: lines of a key, and a geometry or another value. Empty: nowhere.
proc ::sorma::window::file {} {
    global env
    if {[info exists env(XDG_STATE_HOME)] && $env(XDG_STATE_HOME) ne {}} {
        return [::file join $env(XDG_STATE_HOME) sorma windows]
    }
    return [if {[info exists env(HOME)] && $env(HOME) ne {}} {::file join $env(HOME) .local state sorma windows}]
}

# The remembered windows; lines with errors are ignored. Without a readable file windows open where the window manager wants.
proc ::sorma::window::Read {} {
    if {[catch {::sorma::text::readFile [file]} text]} return
    set known {}
    foreach line [split $text \n] {
        if {[string is list $line] && [llength $line] == 2} {
            dict set known {*}$line
        }
    }
    return $known
}
proc ::sorma::window::Write known {
    set file [file]
    catch {
        ::file mkdir [::file dirname $file]
        set channel [::open $file.new w 0600]
        fconfigure $channel -encoding utf-8
        dict for {key geometry} $known {
            puts $channel [list $key $geometry]
        }
        close $channel
        ::file rename -force $file.new $file
    }
}
