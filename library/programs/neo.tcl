# neo.tcl -- the program sorma-neo: circuits as pictures, each in a window.

package require sorma
package require sorma::commandLine
package require sorma::graphical
package require sorma::world
package provide sorma::neo 1.0

namespace eval ::sorma::neo {
    variable Options {--theme {{word {light, dark, auto, or a theme of ttk}}} --readonly flag}
}

# ::sorma::neo::main WORDS -- run the program: the exit code, once all its windows are closed.
proc ::sorma::neo::main words {
    variable Options
    return [::sorma::commandLine::run sorma-neo $Options $words ::sorma::neo::Run -check ::sorma::neo::Check -complete ::sorma::neo::Complete]
}
proc ::sorma::neo::Check {settings names} {
    foreach name $names {
        ::sorma::resolve $name
    }
}
proc ::sorma::neo::Run {settings names} {
    set code [::sorma::graphical::display sorma-neo [dict get $settings --theme] "there is no display to open a window on (%s); set DISPLAY"]
    if {$code ne {}} {
        return $code
    }
    package require sorma::window
    wm withdraw .
    set state [expr {[dict get $settings --readonly] ? "readonly" : "normal"}]
    foreach name $names {
        Open $state $name
    }
    if {$names eq {}} {
        package require sorma::circuitChooser
        focus [::sorma::window open circuits Circuits ::sorma::circuitChooser -command [list ::sorma::neo::Open $state]].w.list.tree
    }
    while {[dict size [::sorma::window all]] > 0} {
        tkwait window [lindex [dict keys [::sorma::window all]] 0]
    }
}
proc ::sorma::neo::Open {state name} {
    package require sorma::circuitEditor
    set top [::sorma::window open [list circuit -name $name] $name ::sorma::circuitEditor $name -state $state]
    focus $top.w
    # The window keeps its size when its contents change. That is its size of before, or has room for a circuit.
    update idletasks
    set natural [winfo reqwidth $top]x[winfo reqheight $top]
    regexp {^\d+x\d+} [wm geometry $top] size
    wm geometry $top [expr {$size ni [list 1x1 $natural] ? $size : "[::sorma::style pixels 1000]x[::sorma::style pixels 680]"}]
}

proc ::sorma::neo::Complete words {
    variable Options
    if {[lindex $words end-1] eq "--theme"} {
        return [::sorma::graphical::themes]
    } elseif {[regexp {^(.*@)} [lindex $words end] -> name]} {
        return [lmap daemon [::sorma::world names] {string cat $name$daemon}]
    }
    return [concat [dict keys $Options] --help circuit. [lsearch -all -inline -glob [::sorma::names] circuit*]]
}
