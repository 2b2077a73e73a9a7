# browse.tcl -- the program sorma-browser: the bus in one window, or a dashboard.

package require sorma
package require sorma::options
package require sorma::text
package require sorma::usage
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
    try {
        set settings [::sorma::options::leading $Options words]
        foreach address $words {
            ::sorma::world add $address
        }
    } on error message {
        puts stderr "sorma-browser: $message\n[::sorma::usage::program sorma-browser]"
        return 2
    }
    if {[dict get $settings --help] || [dict get $settings -h]} {
        puts [::sorma::usage::program sorma-browser]
        return 0
    }
    # Tk would take words that are ours.
    set ::argv {}
    set ::argc 0
    if {[catch {package require Tk} message]} {
        puts stderr "sorma-browser: there is no display to open a window on ($message); set DISPLAY, or look around with scott"
        return 1
    }
    package require sorma::theme
    if {[catch {::sorma::theme program [dict get $settings --theme]} message]} {
        puts stderr "sorma-browser: --theme: $message"
        return 2
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
