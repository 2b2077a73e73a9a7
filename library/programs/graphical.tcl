# graphical.tcl -- how a program with windows begins: Tk, and its theme.

package require sorma
package provide sorma::graphical 1.0

namespace eval ::sorma::graphical {}

# ::sorma::graphical::themes -- what may stand behind --theme.
proc ::sorma::graphical::themes {} {
    catch {package require no.such.package}     ;# `package names` knows what has been looked for
    return [concat {alt auto clam classic dark default light} [lmap name [lsearch -all -inline -glob [package names] ttk::theme::*] {namespace tail $name}]]
}

# ::sorma::graphical::display PROGRAM THEME TEXT --
#       Load Tk, and use a theme. TEXT: for people, when there is no display; %s is the reason.
# Results:
#       The exit code; empty: go on.
proc ::sorma::graphical::display {program theme text} {
    # Tk would take words that are ours.
    set ::argv {}
    set ::argc 0
    if {[catch {package require Tk} message]} {
        puts stderr "$program: [format $text $message]"
        return 1
    }
    package require sorma::theme
    if {[catch {::sorma::theme program $theme} message]} {
        puts stderr "$program: --theme: $message"
        return 2
    }
    return
}
