# browse.tcl -- the program sorma-browser: the bus in one window, or a dashboard.

package require sorma
package require sorma::commandLine
package require sorma::graphical
package require sorma::world
package provide sorma::browse 1.0

namespace eval ::sorma::browse {
    variable Options {--dashboard {{word {a file}}}  --wall flag  --theme {{word {light, dark, auto, or a theme of ttk}}}}
}

# ::sorma::browse::main WORDS -- run the program: the exit code, once its window is closed.
proc ::sorma::browse::main words {
    variable Options
    return [::sorma::commandLine::run sorma-browser $Options $words ::sorma::browse::Run -check ::sorma::browse::Check -complete ::sorma::browse::Complete]
}
proc ::sorma::browse::Check {settings names} {
    foreach name $names {
        ::sorma::world add $name
    }
}
proc ::sorma::browse::Run {settings names} {
    set code [::sorma::graphical::display sorma-browser [dict get $settings --theme] "there is no display to open a window on (%s); set DISPLAY, or look around with scott"]
    if {$code ne {}} {
        return $code
    }
    package require sorma::browser
    package require sorma::window
    wm withdraw .
    if {[dict get $settings --dashboard] eq {}} {
        tkwait window [::sorma::window open browser SORMA ::sorma::browser]
        return
    }
    if {[catch {::sorma::window dashboard [dict get $settings --dashboard] [dict get $settings --wall]} top]} {
        puts stderr "sorma-browser: $top"
        return 2
    }
    tkwait window $top
}

proc ::sorma::browse::Complete words {
    variable Options
    return [switch -- [lindex $words end-1] {
        --dashboard { list }
        --theme { ::sorma::graphical::themes }
        default { concat [dict keys $Options] --help [::sorma::world names] }
    }]
}
