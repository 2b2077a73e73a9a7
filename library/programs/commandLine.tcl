# commandLine.tcl -- how a program begins: its command line is read; --help, wrong words, and the shell that completes words are answered.

package require sorma
package require sorma::options
package require sorma::text
package require sorma::usage
package provide sorma::commandLine 1.0

namespace eval ::sorma::commandLine {
    variable Help {-help flag --help flag -h flag}      ;# of all programs
}

# ::sorma::commandLine::run --
#       Run a program.
# Arguments:
#       program     its name, as the manual has it
#       options     as options.tcl has them; without those that ask for help
#       words       its command line
#       runCmd      called with a dict of the options and a list of the other words; returns the exit code, or nothing: 0
#       args        -check CMD      called with the same before: fails when they are of no use
#                   -complete CMD   called with the beginning of a command line: what its last word may be (library/scott.bash)
#                   -leading BOOL   options stand before all other words
# Results:
#       The exit code: 1 when it has failed, 2 when the words are wrong. Both have been told; a mistake in the program with its stack.
proc ::sorma::commandLine::run {program options words runCmd args} {
    variable Help
    set how [dict merge {-check list -complete list -leading 0} $args]
    ::sorma::options::suggest ::sorma::DidYouMean
    if {[lindex $words 0] eq "--complete"} {
        set words [lrange $words 1 end]
        foreach word [lsort -unique [lsearch -all -inline -glob [{*}[dict get $how -complete] $words] [::sorma::text::escape [lindex $words end]]*]] {
            puts $word
        }
        return 0
    }
    set table [dict merge $options $Help]
    try {
        set settings [if {[dict get $how -leading]} {::sorma::options::leading $table words} else {::sorma::options::parse $table $words words}]
        set asked [expr {1 in [dict values [dict filter $settings key -help --help -h]]}]
        if {!$asked} {
            {*}[dict get $how -check] $settings $words
        }
    } on error message {
        puts stderr [::sorma::usage::refused $program $message]
        return 2
    }
    try {
        set code [if {$asked} {puts [::sorma::usage::program $program]} else {{*}$runCmd $settings $words}]
    } on error {message how} {
        # An error of Tcl itself is a mistake in the program: the stack, which begins with the message, is for its report.
        puts stderr "$program: [if {[lindex [dict get $how -errorcode] 0] in {TCL ARITH}} {dict get $how -errorinfo} else {set message}]"
        return 1
    }
    return [expr {$code eq {} ? 0 : $code}]
}
