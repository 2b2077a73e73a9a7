# neo.tcl -- the program sorma-neo: circuits as pictures, each in a window.

package require sorma
package require sorma::graphical
package require sorma::options
package require sorma::text
package require sorma::world
package provide sorma::neo 1.0

namespace eval ::sorma::neo {
    variable Options {--theme {{word {light, dark, auto, or a theme of ttk}}} --readonly flag --help flag -h flag}
}

# ::sorma::neo::main WORDS -- run the program: the exit code, once all its windows are closed.
proc ::sorma::neo::main words {
    ::sorma::options::suggest ::sorma::DidYouMean
    variable Options
    if {[lindex $words 0] eq "--complete"} {
        foreach word [Complete [lrange $words 1 end]] {
            puts $word
        }
        return 0
    }
    lassign [::sorma::graphical::begin sorma-neo $Options words ::sorma::resolve "there is no display to open a window on (%s); set DISPLAY"] code settings
    if {$code ne {}} {
        return $code
    }
    package require sorma::window
    wm withdraw .
    Windows $words [expr {[dict get $settings --readonly] ? "readonly" : "normal"}]
    return 0
}
proc ::sorma::neo::Windows {names state} {
    foreach name $names {
        Open $state $name
    }
    if {$names eq {}} {
        package require sorma::circuitChooser
        ::sorma::window open circuits Circuits ::sorma::circuitChooser -command [list ::sorma::neo::Open $state]
    }
    while {[dict size [::sorma::window all]] > 0} {
        tkwait window [lindex [dict keys [::sorma::window all]] 0]
    }
}
proc ::sorma::neo::Open {state name} {
    package require sorma::circuitEditor
    ::sorma::window open [list circuit -name $name] $name ::sorma::circuitEditor $name -state $state
}

# Candidates for the last word of a command line: see library/scott.bash.
proc ::sorma::neo::Complete words {
    variable Options
    set word [lindex $words end]
    if {[lindex $words end-1] eq "--theme"} {
        set found {auto dark light}
    } elseif {[regexp {^(.*@)} $word -> name]} {
        set found [lmap daemon [::sorma::world names] {string cat $name$daemon}]
    } else {
        set found [concat [dict keys $Options --*] circuit. [lsearch -all -inline -glob [::sorma::names] circuit*]]
    }
    return [lsort -unique [lsearch -all -inline -glob $found [::sorma::text::escape $word]*]]
}
