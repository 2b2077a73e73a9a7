# browse.tcl -- the program sorma-browser: the bus in one window, or a dashboard.

package require sorma
package require sorma::graphical
package require sorma::options
package require sorma::text
package require sorma::world
package provide sorma::browse 1.0

namespace eval ::sorma::browse {
    variable Options {--dashboard {{word {a file}}}  --wall flag  --theme {{word {light, dark, auto, or a theme of ttk}}}  --help flag  -h flag}
}

# ::sorma::browse::main WORDS -- run the program: the exit code, once its window is closed.
proc ::sorma::browse::main words {
    ::sorma::options::suggest ::sorma::DidYouMean
    variable Options
    if {[lindex $words 0] eq "--complete"} {
        foreach word [Complete [lrange $words 1 end]] {
            puts $word
        }
        return 0
    }
    lassign [::sorma::graphical::begin sorma-browser $Options words {::sorma::world add} "there is no display to open a window on (%s); set DISPLAY, or look around with scott"] code settings
    if {$code ne {}} {
        return $code
    }
    package require sorma::browser
    package require sorma::window
    wm withdraw .
    if {[dict get $settings --dashboard] eq {}} {
        tkwait window [::sorma::window open browser SORMA ::sorma::browser]
        return 0
    }
    if {[catch {::sorma::window dashboard [dict get $settings --dashboard] [dict get $settings --wall]} top]} {
        puts stderr "sorma-browser: $top"
        return 2
    }
    tkwait window $top
    return 0
}

# Candidates for the last word of a command line: see library/scott.bash.
proc ::sorma::browse::Complete words {
    variable Options
    if {[lindex $words end-1] eq "--dashboard"} return
    if {[lindex $words end-1] eq "--theme"} {
        catch {package require no.such.package}     ;# `package names` knows what has been looked for
        set found [concat {alt auto clam classic dark default light} [lmap name [lsearch -all -inline -glob [package names] ttk::theme::*] {namespace tail $name}]]
    } else {
        set found [concat [dict keys $Options --*] [::sorma::world names]]
    }
    return [lsort -unique [lsearch -all -inline -glob $found [::sorma::text::escape [lindex $words end]]*]]
}
