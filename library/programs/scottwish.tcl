# scottwish.tcl -- the program scottwish: scott's prompt in a window, with panels beside it. The same as scott, for who has a display.

package require sorma
package require sorma::commandLine
package require sorma::graphical
package require sorma::shell
package require sorma::usage
package provide sorma::scottwish 1.0

namespace eval ::sorma::scottwish {
    variable Options {-panel {{word {a file}}}  --theme {{word {light, dark, auto, or a theme of ttk}}}  --version flag}
    variable File {}        ;# the arrangement that was opened or saved last
    variable Ended          ;# set when the window is closed
    variable Ready 0        ;# has each daemon said what it has
}

# ::sorma::scottwish::main --
#       Run the program scottwish.
# Arguments:
#       words   command line, as the manual says
# Results:
#       Exit code of the program.
proc ::sorma::scottwish::main words {
    variable Options
    return [::sorma::commandLine::run scottwish $Options $words ::sorma::scottwish::Run -complete ::sorma::scottwish::Complete]
}
proc ::sorma::scottwish::Run {settings names} {
    variable Ended
    if {[dict get $settings --version]} {
        return [puts "scottwish, SORMA [package present sorma], Tcl [info patchlevel]"]
    }
    set code [::sorma::graphical::display scottwish [dict get $settings --theme] "it cannot open a window: %s; scott does the same in a terminal"]
    if {$code ne {}} {
        return $code
    }
    Window
    if {[dict get $settings -panel] ne {}} {
        Open [dict get $settings -panel]
    }
    foreach name $names {
        Try [list panel $name]
    }
    if {![info exists Ended]} {
        vwait ::sorma::scottwish::Ended
    }
    if {[::sorma::shell::records]} {
        ::sorma::record::stop
    }
    destroy .
}

# The shell adds names of files.
proc ::sorma::scottwish::Complete words {
    variable Options
    switch -glob -- [lindex $words end-1],[lindex $words end] {
        -panel,* { return }
        --theme,* { return [::sorma::graphical::themes] }
        *,-* { return [concat [dict keys $Options] --help] }
    }
    package require sorma::complete
    ::sorma::shell::prepare
    return [::sorma::shell::endings [lindex $words end] "::sorma::scottwish::panel "]
}

# The window with the console, and its menu.
proc ::sorma::scottwish::Window {} {
    package require sorma::arrangement
    package require sorma::console
    package require sorma::window
    wm title . scottwish
    wm protocol . WM_DELETE_WINDOW {set ::sorma::scottwish::Ended 1}
    menu .menu -tearoff 0
    menu .menu.file -tearoff 0
    .menu add cascade -label [::msgcat::mc File] -underline 0 -menu .menu.file
    foreach {label key command} {
        "Open arrangement..." Ctrl-O Choose
        "Save arrangement" Ctrl-S Save
        "Save arrangement as..." {} SaveAs
    } {
        .menu.file add command -label [::msgcat::mc $label] -underline [expr {$command eq "SaveAs" ? 17 : 0}] -accelerator $key \
            -command [list ::sorma::scottwish::Try $command]
    }
    .menu.file add separator
    .menu.file add command -label [::msgcat::mc Quit] -underline 0 -accelerator Ctrl-D -command {set ::sorma::scottwish::Ended 1}
    menu .menu.panels -tearoff 0 -postcommand ::sorma::scottwish::Panels
    .menu add cascade -label [::msgcat::mc Panels] -underline 0 -menu .menu.panels
    . configure -menu .menu
    pack [::sorma::console .w -output 1 -command {set ::sorma::scottwish::Ended 1}] -fill both -expand 1
    # Before those of the text, which mean something else.
    bind SormaWish <Control-o> {::sorma::scottwish::Try Choose; break}
    bind SormaWish <Control-s> {::sorma::scottwish::Try Save; break}
    ::sorma::style tag .w SormaWish
    interp bgerror {} ::sorma::scottwish::BackgroundError
    ::sorma::shell::word panel ::sorma::scottwish::panel
    ::sorma::shell::word arrangement ::sorma::scottwish::Arrangement
    ::sorma::arrangement console .
    # As long as there is a watch, the model knows all objects.
    ::sorma::world watch *@* -events {object.made object.removed world.ready} -command ::sorma::scottwish::Heard
    focus .w.text
    update
}

# Objects that are known, those of a daemon together; each opens its panel.
proc ::sorma::scottwish::Panels {} {
    variable Ready
    .menu.panels delete 0 end
    destroy {*}[winfo children .menu.panels]
    set n 0
    foreach daemon [::sorma::world keys] {
        set names [lmap object [::sorma::world objects $daemon] {
            set name [dict get $object name]
            if {[string match sorma::* $name] || $name eq "sorm"} continue
            set name
        }]
        if {$names eq {}} continue
        set menu [menu .menu.panels.daemon[incr n] -tearoff 0]
        .menu.panels add cascade -label [expr {$daemon eq "self" ? "here" : $daemon}] -menu $menu
        foreach name [lrange $names 0 39] {
            set name [expr {$daemon eq "self" ? $name : "$name@$daemon"}]
            $menu add command -label $name -command [list ::sorma::scottwish::Try [list panel $name]]
        }
        if {[llength $names] > 40} {
            $menu add command -label "[expr {[llength $names] - 40}] more; type panel NAME" -state disabled
        }
    }
    if {$n == 0} {
        .menu.panels add command -state disabled \
            -label [expr {$Ready ? "no object is there yet; type panel NAME" : "asking the daemons \u2026"}]
    }
}
# The menu is filled when it opens. If nothing was known then, the first that comes comes into it.
proc ::sorma::scottwish::Heard {event key what} {
    variable Ready
    if {$event eq "world.ready"} {
        set Ready 1
    }
    if {[winfo children .menu.panels] eq {}} {
        Panels
    }
}

# ::sorma::scottwish::panel NAME -- its panel in a window beside the console.
proc ::sorma::scottwish::panel name {
    ::sorma::window panel $name
    return
}

proc ::sorma::scottwish::Arrangement {word file} {
    switch -- $word {
        open { Open $file }
        save { SaveTo $file }
        default { ::sorma::usage::wrong arrangement }
    }
}
proc ::sorma::scottwish::Open file {
    variable File
    try {
        set wrong [::sorma::arrangement open $file]
        set File $file
    } on error message {
        set wrong [list $message]
    }
    foreach message $wrong {
        .w write "scottwish: $message\n" error
    }
}
proc ::sorma::scottwish::SaveTo file {
    variable File
    ::sorma::arrangement save $file
    set File $file
    .w write "saved to $file; scottwish -panel $file opens it again\n"
}

proc ::sorma::scottwish::Choose {} {
    set file [tk_getOpenFile -parent .]
    if {$file ne {}} {
        Open $file
    }
}
proc ::sorma::scottwish::Save {} {
    variable File
    if {$File ne {}} {
        SaveTo $File
    } else {
        SaveAs
    }
}
proc ::sorma::scottwish::SaveAs {} {
    variable File
    set file [tk_getSaveFile -parent . -initialfile [file tail $File]]
    if {$file ne {}} {
        SaveTo $file
    }
}

# Errors are shown in the console, not in a dialog.
proc ::sorma::scottwish::Try script {
    if {[catch $script message]} {
        .w write "scottwish: $message\n" error
    }
}
proc ::sorma::scottwish::BackgroundError {message options} {
    if {[winfo exists .w]} {
        .w write "background error: $message\n" error
    }
}
