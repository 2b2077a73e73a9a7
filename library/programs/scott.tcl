# scott.tcl -- the program scott, the inspector: a tclsh with the bus inside.
#
# ::sorma::scott::main reads the command line and does what it says; ::sorma::scott::interact is the prompt alone.
# What is typed, and how it is run and shown, is the business of shell.tcl; here are the command line and the terminal. At the prompt the
# event loop goes on while a request waits, and Ctrl-C can give up the request and not the program. A batch (-c, a file, a pipe) runs as in
# tclsh.

package require sorma
package require sorma::commandLine
package require sorma::line
package require sorma::shell
package require sorma::text
package require sorma::usage
package provide sorma::scott 1.0

namespace eval ::sorma::scott {
    variable Options {-c {{collect {a request}}}  --json flag  --version flag}
    variable Json 0
    variable Outcome        ;# of the command that was typed last, once it is there: list of catch's code, result, options
    variable Waited         ;# set now and then, while a watch goes on
    variable Pending {}     ;# lines of the command that is being typed, before the current one
    variable Editing 0      ;# lines are edited; else they are read as they come
}

# ::sorma::scott::main --
#       Run the program scott.
# Arguments:
#       words   command line, as the manual says
# Results:
#       Exit code of the program.
proc ::sorma::scott::main words {
    variable Options
    return [::sorma::commandLine::run scott $Options $words ::sorma::scott::Run -check ::sorma::scott::Check -complete ::sorma::scott::Complete -leading 1]
}
proc ::sorma::scott::Check {settings words} {
    if {[dict get $settings -c] ne {} && $words ne {}} {
        error "either -c or a file, not both: \"[lindex $words 0]\""
    }
}
proc ::sorma::scott::Run {settings words} {
    variable Json [dict get $settings --json]
    if {[dict get $settings --version]} {
        return [puts "scott, SORMA [package present sorma], Tcl [info patchlevel]"]
    }
    set requests [dict get $settings -c]
    ::sorma::shell::prepare
    # These words were for scott: Tk, loaded by a request, would read them too.
    set ::argv {}
    set ::argc 0
    if {[llength $requests] > 0} {
        return [Batch $requests]
    }
    if {[llength $words] > 0 && [lindex $words 0] in [::sorma::shell::commands] && ![file exists [lindex $words 0]]} {
        return [Batch [list [list {*}$words]]]
    }
    if {[llength $words] > 0 && ![file exists [lindex $words 0]]} {
        set word [lindex $words 0]
        puts stderr "scott: \"$word\"[::sorma::DidYouMean $word [::sorma::shell::commands]] is neither a file nor a command of scott;\
            a request is given with -c, as in: scott -c \"$word CTRL -help\""
        return 1
    }
    if {[llength $words] > 0} {
        return [Script {*}$words]
    }
    if {[::sorma::text::isTerminal stdin]} {
        return [interact]
    }
    return [Piped]
}

# Candidates for the last word of a command line. They come from where those of the prompt come from. Names of files are the shell's.
proc ::sorma::scott::Complete words {
    package require sorma::complete
    set partial [lindex $words end]
    set words [lrange $words 0 end-1]
    while {[string match -* [lindex $words 0]]} {
        set words [lassign $words option]
        if {$option eq "-c" && [llength $words] == 0} {
            return [Endings $partial]                   ;# one word holds the whole request
        } elseif {$option eq "-c"} {
            set words [lrange $words 1 end]
        }
    }
    if {[llength $words] > 0} {
        return [if {[lindex $words 0] in [::sorma::shell::commands]} {Endings $partial [list {*}$words]\ }]
    }
    return [concat [::sorma::shell::commands] [dict keys [::sorma::usage::options scott]]]
}
proc ::sorma::scott::Endings {line {before {}}} {
    ::sorma::shell::prepare
    return [::sorma::shell::endings $line $before]
}

# ---- batch ----

proc ::sorma::scott::Batch requests {
    foreach request $requests {
        if {![Do $request]} {
            return 1
        }
    }
    Watches
    return 0
}

# A watch runs until Ctrl-C, until unwatch, or until the reader of its output has ended.
proc ::sorma::scott::Watches {} {
    while {[package provide sorma::inspect] ne {} && [llength [::sorma::inspect::watch]] > 0} {
        after 200 {set ::sorma::scott::Waited 1}
        vwait ::sorma::scott::Waited
    }
}

# Execute a command and print what came. Returns whether it succeeded.
proc ::sorma::scott::Do line {
    set code [catch {::sorma::shell::run [::sorma::line::translate $line] [ShowSettings stdout]} result options]
    try {
        Print $line $code $result $options
        flush stdout
    } trap {POSIX EPIPE} {} {
        exit 0                                  ;# the reader has ended, as after "| head"
    }
    return [expr {$code != 1}]
}

proc ::sorma::scott::Script {file args} {
    set ::argv0 $file
    set ::argv $args
    set ::argc [llength $args]
    if {[catch {uplevel #0 [list source -encoding utf-8 $file]} result options]} {
        Print {} 1 $result $options
        if {![string match "SORMA *" [dict get $options -errorcode]]} {
            puts stderr [dict get $options -errorinfo]
        }
        return 1
    }
    return 0
}

# Commands from standard input, as at the prompt but without one. The event loop runs between them.
proc ::sorma::scott::Piped {} {
    variable Input
    set command {}
    while 1 {
        unset -nocomplain Input
        fileevent stdin readable {set ::sorma::scott::Input [gets stdin]}
        vwait ::sorma::scott::Input
        fileevent stdin readable {}
        if {$Input eq {} && [eof stdin]} break
        append command $Input
        if {![::sorma::line::isComplete $command]} {
            append command \n
            continue
        }
        if {![Do $command]} {
            return 1
        }
        set command {}
    }
    if {[string trim $command] ne {}} {
        puts stderr "scott: the input ends in the middle of: $command"
        return 1
    }
    Watches
    return 0
}

# ---- the prompt ----

# ::sorma::scott::interact --
#       Read commands from the terminal, execute them and show what comes, until Ctrl-D, or a hang-up.
# Results:
#       Exit code of the program: 0.
proc ::sorma::scott::interact {} {
    variable Pending
    variable Editing
    ::sorma::shell::prepare
    package require sorma::edit
    ::sorma::edit attach
    set Editing [expr {[::sorma::edit usable] eq {}}]
    interp bgerror {} ::sorma::scott::BackgroundError
    set ::tcl_interactive 1
    try {
        ::sorma::edit remember {*}[::sorma::shell::recall]
    } on error message {
        puts stderr "scott: $message"
    }
    set Pending {}
    try {
        while 1 {
            try {
                if {![Turn]} break
            } trap {TCL CANCEL} {} {
                set Pending {}      ;# Ctrl-C between two lines
                puts {}
            }
        }
    } finally {
        ::sorma::edit detach
    }
    if {[::sorma::shell::records]} {
        puts [::sorma::record::stop]
    }
    return 0
}

# Read a line, and execute the command that it completes. Returns 0 at the end.
proc ::sorma::scott::Turn {} {
    variable Pending
    lassign [ReadLine [expr {$Pending eq {} ? "% " : "> "}]] how line
    if {$how eq "interrupt"} {
        set Pending {}
        return 1
    }
    if {$how eq "end"} {
        set unfinished [expr {$Pending ne {}}]
        set Pending {}
        return $unfinished
    }
    append Pending $line
    if {![::sorma::line::isComplete $Pending]} {
        append Pending \n
        return 1
    }
    set command $Pending
    set Pending {}
    if {[string trim $command] eq {}} {
        return 1
    }
    try {
        if {[string index $command 0] ne " "} {         ;# which is kept out of it
            ::sorma::edit remember $command
            ::sorma::shell::remember $command
        }
    } on error message {
        puts stderr "scott: $message"
    }
    try {
        Execute $command
    } trap {TCL CANCEL} {message options} {
        return -options $options $message
    } on error message {
        puts stderr "scott: $message"       ;# whatever it was, the prompt comes again
    }
    return 1
}

# Returns list of how (line, end, interrupt) and text.
proc ::sorma::scott::ReadLine prompt {
    variable Editing
    variable Input
    if {$Editing} {
        return [::sorma::edit read -prompt $prompt -complete ::sorma::scott::CompleteAt -hint ::sorma::scott::HintAt]
    }
    puts -nonewline $prompt
    flush stdout
    unset -nocomplain Input
    fileevent stdin readable {set ::sorma::scott::Input [list [gets stdin line] $line]}
    set came [::sorma::edit wait ::sorma::scott::Input]
    fileevent stdin readable {}
    if {!$came} {
        puts {}
        return interrupt
    }
    lassign $Input length line
    if {$length < 0} {
        puts {}
        return end
    }
    return [list line $line]
}

# The words before the cursor may have begun on an earlier line.
proc ::sorma::scott::CompleteAt {line point} {
    variable Pending
    return [::sorma::shell::complete $Pending $line $point]
}
proc ::sorma::scott::HintAt {line point} {
    variable Pending
    set hint [::sorma::shell::hint $Pending $line $point]
    # The hint is made again when a daemon has answered.
    if {[::sorma::table open] > 0 && [info commands ::sorma::scott::renewing] eq {}} {
        coroutine ::sorma::scott::renewing ::sorma::scott::Renew
    }
    return $hint
}
proc ::sorma::scott::Renew {} {
    ::sorma::await settle 2000
    ::sorma::edit hint
}

# Execute a command while the event loop runs, show its result, and record it. Ctrl-C cancels what it waits for.
proc ::sorma::scott::Execute line {
    variable Outcome
    unset -nocomplain Outcome
    try {
        ::sorma::shell::begin scott $line [ShowSettings stdout] ::sorma::scott::Came
        if {![info exists Outcome]} {
            ::sorma::edit wait ::sorma::scott::Outcome
        }
    } trap {TCL CANCEL} {} {
        # Ctrl-C in between
    }
    if {![info exists Outcome]} {
        set Outcome [::sorma::shell::cancel scott]
    }
    lassign $Outcome code result options
    if {$code == 1 && [lrange [dict get $options -errorcode] 0 1] eq {TCL CANCEL} || $code == 1 && [dict get $options -errorcode] eq {SORMA COMM CANCELLED}} {
        puts {}     ;# after the ^C
    }
    Print $line $code $result $options
    ::sorma::shell::note $line $code $result $options
}
proc ::sorma::scott::Came args {
    variable Outcome
    set Outcome $args
}

proc ::sorma::scott::BackgroundError {message options} {
    puts stderr "background error: $message"
}

# ---- what comes back ----

# Print a result, or an error on standard error.
proc ::sorma::scott::Print {line code result options} {
    variable Json
    set channel [expr {$code == 1 && !$Json ? "stderr" : "stdout"}]
    set text [::sorma::shell::show $line $code $result $options [ShowSettings $channel]]
    if {$text ne {}} {
        puts $channel $text
    }
}

# On a terminal for a person, with its width and perhaps colours; elsewhere everything, for a program.
proc ::sorma::scott::ShowSettings channel {
    variable Json
    if {![::sorma::text::isTerminal $channel]} {
        return [list -json $Json -width 0 -whole 1]
    }
    set colour [expr {[Environment NO_COLOR] eq {} && [Environment TERM] ni {dumb unknown {}}}]
    return [list -json $Json -width [Width] -colour $colour]
}

proc ::sorma::scott::Environment name {
    return [expr {[info exists ::env($name)] ? $::env($name) : {}}]
}

# Cells of a line on the terminal.
proc ::sorma::scott::Width {} {
    if {[info commands ::sorma::edit] ne {}} {
        set width [::sorma::edit columns]
    } elseif {[catch {lindex [exec stty size <@stdin] 1} width]} {
        set width 0
    }
    return [expr {$width > 0 ? $width : 80}]
}
