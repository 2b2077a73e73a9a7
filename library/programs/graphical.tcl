# graphical.tcl -- how a program with windows begins: its command line, Tk, and its theme.

package require sorma
package require sorma::options
package require sorma::usage
package provide sorma::graphical 1.0

namespace eval ::sorma::graphical {}

# ::sorma::graphical::begin PROGRAM OPTIONS WORDSVAR CHECK TEXT --
#       Read the command line, and load Tk. --help, and errors, are answered here.
# Arguments:
#       OPTIONS     as sorma::options has them, with --theme, --help and -h
#       WORDSVAR    name of the caller's words, from which options are removed
#       CHECK       prefix that is called with each word that is left; fails if that is no good
#       TEXT        as for display
# Results:
#       {CODE SETTINGS}. CODE: the exit code; empty: go on.
proc ::sorma::graphical::begin {program options wordsVar check text} {
    upvar 1 $wordsVar words
    try {
        set settings [::sorma::options::leading $options words]
        foreach word $words {
            {*}$check $word
        }
    } on error message {
        puts stderr "$program: $message\n[::sorma::usage::program $program]"
        return {2 {}}
    }
    if {[dict get $settings --help] || [dict get $settings -h]} {
        puts [::sorma::usage::program $program]
        return {0 {}}
    }
    return [list [display $program [dict get $settings --theme] $text] $settings]
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
