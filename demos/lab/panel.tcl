# panel.tcl -- the operator's panel of the laboratory, in the main window. Nothing in it waits: a daemon that stands still shows as
# stale, and the emergency stop goes to the hardware by itself.

package require Tk
package require sorma::panel
package require sorma::chart
package require sorma::image
package require sorma::notice
package require sorma::theme
package require sorma::trailview
package require sorma::world

namespace eval lab::panel {
    variable Jogging {}                 ;# the request of the button that is held down
    variable Said {}                    ;# what the last one has said
    variable Watched {}                 ;# values that are told while there is a window
}

# A request whose answer is shown in the line at the bottom.
proc lab::panel::send {name args} {
    return [sorma::async -command [list ::lab::panel::Answered $name] $name {*}$args]
}
proc lab::panel::Answered {name future} {
    variable Said
    catch {$future take} Said
    set Said [string map {\n { }} $Said]
}

proc lab::panel::Ignored future {
    catch {$future take}
}

# A button that runs a request as long as it is held down.
proc lab::panel::hold {w text name args} {
    ttk::button $w -text $text -width 4
    bind $w <ButtonPress-1> [list ::lab::panel::Begin $name $args]
    bind $w <KeyPress-space> [list ::lab::panel::Begin $name $args]
    foreach event {<ButtonRelease-1> <KeyRelease-space> <Leave> <FocusOut>} {
        bind $w $event [list ::lab::panel::End $name]
    }
    return $w
}
proc lab::panel::Begin {name words} {
    variable Jogging
    if {$Jogging eq {}} {
        set Jogging [sorma::async -command [list ::lab::panel::Jogged $name] $name EXEC {*}$words]
    }
}
proc lab::panel::Jogged {name future} {
    variable Jogging
    set Jogging {}
    Answered $name $future
}
proc lab::panel::End name {
    variable Jogging
    if {$Jogging ne {}} {
        sorma::async -command ::lab::panel::Ignored $name CTRL -stop
    }
}

# The forces at the hand as traces, and the tool's place, as the arm tells them.
proc lab::panel::Felt {- - told} {
    variable Place
    dict for {- value} $told {
        if {[dict get $value state] ne "live"} {
            set Place "no news of the arm"      ;# why, the top says
            continue
        }
        if {![dict exists $value value floats]} {
            set Place [dict get $value value text]
            continue
        }
        set floats [dict get $value value floats]
        foreach axis {x y z} force [lrange $floats 13 15] {
            .chart sample $axis $force
        }
        lassign $floats x y z
        set Place [format {tool at %.3f %.3f %.3f m} $x $y $z]
    }
}

# Lamps of guards: all is as it must be, or not, or nobody knows.
proc lab::panel::Guarded {lamp guard - - told} {
    dict for {- value} $told {
        set holds [expr {[dict get $value state] eq "live" && [dict exists $value value ints] ? [lindex [dict get $value value ints] 0] : {}}]
        Lamp $lamp $guard [expr {$holds eq {} ? "gone" : $holds ? "good" : "alarm"}]
    }
}
proc lab::panel::Lamp {lamp guard state} {
    $lamp configure -text "[sorma::style::mark $state] wspc.$guard" -foreground [sorma::style::colour $state]
}

# ---- the window ----

# What is seen and felt, as large as the window leaves room.
proc lab::panel::View {} {
    set gap [sorma::style pixels 8]
    foreach {w text} {seen "The scene" felt "What the hand feels"} {
        ttk::labelframe .$w -style Page.TLabelframe -text $text -padding $gap
    }
    sorma::image .picture -name simlab@lab -request {EXEC view} -every 200 -brief 1 -zoom fit -width [sorma::style pixels 640] -height [sorma::style pixels 480]
    sorma::stripchart .chart -span 20 -low -15 -high 15 -width 480 -height 140
    # Seen on light and on dark backgrounds.
    foreach {axis colour} {x #e0443c y #2fa04a z #4a86f0} {
        .chart trace $axis -text "force $axis \[N\]" -colour $colour
    }
    pack .picture -in .seen -fill both -expand 1
    pack .chart -in .felt -fill both -expand 1
    raise .picture .seen
    raise .chart .felt
}
# Emergency stop and power.
proc lab::panel::Power {} {
    set gap [sorma::style pixels 8]
    # Never hidden: it stands above all else, and the window is as tall as it at least.
    button .side.stop -text "EMERGENCY STOP" -background #c03028 -activebackground #e04038 -foreground white -activeforeground white \
        -font TkHeadingFont -relief flat -borderwidth 0 -highlightbackground #c03028 -pady [sorma::style pixels 10] -command {lab::panel::send simlab@lab CTRL -emergencyStop} -takefocus 1
    pack .side.stop -fill x
    ttk::frame .side.power -style Page.TFrame
    set column 0
    foreach {text request} {
        Reset {simlab@lab CTRL -reset} "Power on" {pino@robot EXEC power on} "Power off" {pino@robot EXEC power off} Park {pino@robot EXEC park} Stop {pino@robot CTRL -stop}
    } {
        set w .side.power.b[incr column]
        grid [ttk::button $w -text $text -command [list lab::panel::send {*}$request]] -row [expr {($column - 1) / 3}] -column [expr {($column - 1) % 3}] \
            -sticky ew -padx 2 -pady 2
    }
    grid columnconfigure .side.power {0 1 2} -weight 1 -uniform third
    pack .side.power -fill x -pady $gap
}
# Buttons that move the tool along an axis, or one joint.
proc lab::panel::Jog {} {
    set gap [sorma::style pixels 8]
    ttk::labelframe .side.jog -style Page.TLabelframe -padding $gap -text "Jog: as long as you hold it"
    set row 0
    foreach {text place} {x {1 0 0} y {0 1 0} z {0 0 1}} {
        foreach {sign column} {- 1 + 2} {
            set to [lmap c $place {expr {$sign eq "+" ? 0.1 * $c : -0.1 * $c}}]
            grid [hold .side.jog.t$text$column $sign mvpos.jog@robot FMSG 7 {*}$to 1 0 0 0] -row $row -column $column -padx 2 -pady 2
        }
        grid [ttk::label .side.jog.t$text -text "tool $text"] -row $row -column 0 -sticky w -padx $gap
        incr row
    }
    set row 0
    foreach joint {1 2 3 4 5 6} {
        foreach {sign column} {- 4 + 5} {
            set to [lrepeat 6 0]
            lset to $joint-1 ${sign}0.3
            grid [hold .side.jog.j$joint$column $sign mvpos.jogJoint@robot FMSG 6 {*}$to] -row $row -column $column -padx 2 -pady 2
        }
        grid [ttk::label .side.jog.j$joint -text "joint $joint"] -row $row -column 3 -sticky w -padx $gap
        incr row
    }
    pack .side.jog -fill x
}
# Places that the arm was taught.
proc lab::panel::Poses {} {
    set gap [sorma::style pixels 8]
    ttk::labelframe .side.poses -style Page.TLabelframe -padding $gap -text "Poses"
    ttk::entry .side.poses.name
    .side.poses.name insert 0 home
    ttk::button .side.poses.teach -text Teach -command {lab::panel::send mvpos@robot CTRL -teach [.side.poses.name get]}
    ttk::button .side.poses.go -text "Go there" -command {lab::panel::send mvpos.[.side.poses.name get]@robot EXEC}
    grid .side.poses.name .side.poses.teach .side.poses.go -sticky ew -padx 2 -pady 2
    grid columnconfigure .side.poses 0 -weight 1
    pack .side.poses -fill x -pady $gap
}
# A lamp for each guard.
proc lab::panel::Guards {} {
    variable Watched
    set gap [sorma::style pixels 8]
    ttk::labelframe .side.guards -style Page.TLabelframe -padding $gap -text "Guards: does each one hold now?"
    foreach guard {room noTable} {
        set lamp .side.guards.l$guard
        pack [ttk::label $lamp] -anchor w -padx $gap
        Lamp $lamp $guard gone
        lappend Watched [sorma::world value wspc.$guard@robot EXEC -every 500 -command [list ::lab::panel::Guarded $lamp $guard]]
    }
    pack .side.guards -fill x
    # Looking makes nothing: the guards are made here.
    foreach guard {room noTable} {
        sorma::async -command ::lab::panel::Ignored wspc.$guard@robot CTRL -dump
    }
}
proc lab::panel::Arrange {} {
    set gap [sorma::style pixels 8]
    set half [expr {$gap / 2}]
    grid columnconfigure .f 0 -weight 1
    grid rowconfigure .f 0 -weight 1
    grid .seen -in .f -row 0 -column 0 -sticky nsew -padx $half -pady [list 0 $gap]
    grid .felt -in .f -row 1 -column 0 -sticky ew -padx $half -pady [list 0 $gap]
    grid .trail -in .f -row 2 -column 0 -sticky ew -padx [list $half 0]
    grid .side -in .f -row 0 -column 1 -rowspan 3 -sticky ns -padx $half
    # Answers of requests and news of daemons share the last line.
    grid [ttk::label .said -style Page.TLabel -textvariable ::lab::panel::Said -wraplength [sorma::style pixels 760]] -in .f -row 3 -column 0 -sticky w -padx $half
    grid .notice -in .f -row 3 -column 1 -sticky ew -padx $half
    raise .notice .f
}

proc lab::panel::build {} {
    variable Watched
    variable Place "where is the arm?"
    set gap [sorma::style pixels 8]
    wm title . "Laboratory"
    sorma::theme program
    sorma::notice .notice -lines 1 -daemons {lab robot} -style Page.TFrame
    .notice.text configure -style Page.TLabel
    pack [ttk::frame .f -style Page.TFrame -padding [list [expr {$gap / 2}] $gap]] -fill both -expand 1
    sorma::trailview .trail -height 4 -style Page.TFrame
    ttk::frame .side -style Page.TFrame
    Power
    Jog
    Poses
    Guards
    pack [ttk::label .side.place -style Page.TLabel -textvariable ::lab::panel::Place] -anchor w -pady $gap
    View
    Arrange
    lappend Watched [sorma::world value pino@robot {EXEC status} -every 50 -command ::lab::panel::Felt]
    bind .side <Destroy> {foreach token $::lab::panel::Watched {sorma::world unwatch $token}}
    bind . <Escape> {lab::panel::send pino@robot CTRL -stop}
    update idletasks
    wm minsize . [winfo reqwidth .side.power] [winfo reqheight .side.stop]
}
lab::panel::build
