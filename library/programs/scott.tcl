# scott.tcl -- the program scott, the inspector: a tclsh with the bus inside.
#
# ::sorma::scott::main reads the command line and does what it says; ::sorma::scott::interact is the prompt alone.
# What is typed is Tcl. A command whose first word is a service object's name and whose second is EXEC, CTRL or DBX may
# also quote words as 'text', taken as it stands: see line.tcl.
#
# Everything typed runs in a coroutine, so that the event loop goes on while a request waits, and Ctrl-C can give up the
# request and not the program. A batch (-c, a file, a pipe) runs as in tclsh.

package require sorma
package require sorma::line
package require sorma::options
package require sorma::text
package require sorma::usage
package provide sorma::scott 1.0

namespace eval ::sorma::scott {
    variable Options {-c {{collect {a request}}}  --json flag  --version flag  --help flag  -h flag}
    variable Counts {calls underway objects count rate mean min max jitter lost}    ;# what is a number in the inspector's data
    variable Json 0
    variable Direct 0       ;# one of these is what was typed, not a part of it
    variable Outcome        ;# of the command that was typed last, once it is there: list of catch's code, result, options
    variable HistoryFile {} ;# where what is typed is noted; empty: nowhere
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
    variable Json
    if {[lindex $words 0] eq "--complete"} {
        ShellWords [lrange $words 1 end]        ;# for the shells: see library/scott.bash
        return 0
    }
    try {
        set settings [::sorma::options::leading $Options words]
    } trap {SORMA REQUEST SYNTAX} message {
        return [Misused $message]
    }
    if {[dict get $settings --help] || [dict get $settings -h]} {
        puts [::sorma::usage::program scott]
        return 0
    }
    if {[dict get $settings --version]} {
        puts "scott, SORMA [package present sorma], Tcl [info patchlevel]"
        return 0
    }
    set Json [dict get $settings --json]
    set requests [dict get $settings -c]
    if {[llength $requests] > 0 && [llength $words] > 0} {
        return [Misused "either -c or a file, not both: \"[lindex $words 0]\""]
    }
    prepare
    if {[llength $requests] > 0} {
        return [Batch $requests]
    }
    if {[llength $words] > 0 && [lindex $words 0] in [Commands] && ![file exists [lindex $words 0]]} {
        return [Batch [list [list {*}$words]]]
    }
    if {[llength $words] > 0} {
        return [Script {*}$words]
    }
    if {[IsTerminal stdin]} {
        return [interact]
    }
    return [Piped]
}

# ::sorma::scott::ShellWords --
#       Print what can stand for the last word of a command line of scott, a line each. They come from where those of the prompt come
#       from; nothing is listed twice. Names of files are the shell's.
proc ::sorma::scott::ShellWords words {
    package require sorma::complete
    set partial [lindex $words end]
    set words [lrange $words 0 end-1]
    while {[string match -* [lindex $words 0]]} {
        set words [lassign $words option]
        if {$option eq "-c" && [llength $words] == 0} {
            return [PutWords $partial]                  ;# one word holds the whole request
        } elseif {$option eq "-c"} {
            set words [lrange $words 1 end]
        }
    }
    if {[llength $words] > 0} {
        if {[lindex $words 0] in [Commands]} {
            PutWords $partial [list {*}$words]\ 
        }
        return
    }
    Put [lsearch -all -inline -glob [concat [Commands] [dict keys [::sorma::usage::options scott]]] [::sorma::text::escape $partial]*]
}

# The words that can end a line of the prompt, each with what of its last word stands before it.
proc ::sorma::scott::PutWords {line {before {}}} {
    prepare
    set text $before$line
    ::sorma::complete $text [string length $text]           ;# asks the daemons
    ::sorma::await settle 300
    set found [::sorma::complete $text [string length $text]]
    set head [string range $text [string length $before] [dict get $found from]-1]
    Put [lmap word [dict get $found words] {string cat $head $word}]
}

proc ::sorma::scott::Put words {
    if {[llength $words] > 0} {
        puts [join [lsort -unique $words] \n]
    }
}

proc ::sorma::scott::Misused message {
    puts stderr "scott: $message"
    puts stderr [::sorma::usage::program scott]
    return 2
}

# ::sorma::scott::prepare --
#       What all that is typed to scott may rely on, and so does a recording: dict answers CTRL, EXEC and DBX, and the
#       inspector's commands are there. These live in ::sorma::words, which the global namespace looks into last: they give way to
#       every command of the same name that somebody has, or makes later.
proc ::sorma::scott::prepare {} {
    ::sorma::JoinDict
    # Where nothing says which characters the terminal speaks it is UTF-8 today, not what Tcl makes of it.
    if {[encoding system] in {iso8859-1 ascii}} {
        foreach channel {stdin stdout stderr} {
            catch {fconfigure $channel -encoding utf-8}
        }
    }
    namespace eval ::sorma::words {}
    foreach name [InspectorCommands] {
        interp alias {} ::sorma::words::$name {} ::sorma::scott::Look $name
    }
    foreach {name command} {help scott::Help trail scott::Trail record scott::Record} {
        interp alias {} ::sorma::words::$name {} ::sorma::$command
    }
    if {"::sorma::words" ni [namespace eval :: {namespace path}]} {
        namespace eval :: {namespace path [list {*}[namespace path] ::sorma::words]}
    }
}

# Names of the inspector's commands, and of all commands whose text is as it is to be shown. The one list of them is that of
# the package.
proc ::sorma::scott::InspectorCommands {} {
    return [lsort [lmap command [info commands {::sorma::inspect::[a-z]*}] {namespace tail $command}]]
}

proc ::sorma::scott::Commands {} {
    return [concat [InspectorCommands] {trail record}]
}

# Only a terminal has a line speed.
proc ::sorma::scott::IsTerminal channel {
    return [expr {![catch {fconfigure $channel -mode}]}]
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

# Who has asked for a watch wants to see it: it ends by Ctrl-C, by unwatch, or when nobody reads it any more.
proc ::sorma::scott::Watches {} {
    while {[package provide sorma::inspect] ne {} && [llength [::sorma::inspect::watch]] > 0} {
        after 200 {set ::sorma::scott::Waited 1}
        vwait ::sorma::scott::Waited
    }
}

# Execute a command and print what came. Returns whether it succeeded.
proc ::sorma::scott::Do line {
    set code [catch {Run [::sorma::line::translate $line]} result options]
    try {
        Print $line $code $result $options
        flush stdout
    } trap {POSIX EPIPE} {} {
        exit 0                                  ;# nobody reads it any more, as after "| head"
    }
    return [expr {$code != 1}]
}

proc ::sorma::scott::Run script {
    variable Direct
    set command [lindex [::sorma::line::head $script] 0]
    set Direct [expr {$command in [Commands]}]
    if {$Direct && $command ni {trail record}} {       ;# what these return fits where it is shown
        ::sorma::showDefaults {*}[dict filter [ShowSettings stdout] key -width -colour]
    }
    return [uplevel #0 $script]
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
    prepare
    package require sorma::edit
    ::sorma::edit attach
    set Editing [expr {[::sorma::edit usable] eq {}}]
    interp bgerror {} ::sorma::scott::BackgroundError
    set ::tcl_interactive 1
    history keep 2000
    LoadHistory
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
    if {[Records]} {
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
    Remember $command
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
    set before [string length $Pending]
    set found [::sorma::complete $Pending$line [expr {$before + $point}]]
    # What is known of a daemon has to be asked for first: who types Tab waits a moment for that.
    if {[llength [dict get $found words]] == 0 && [::sorma::await settle 300]} {
        set found [::sorma::complete $Pending$line [expr {$before + $point}]]
    }
    dict set found from [expr {max([dict get $found from] - $before, 0)}]
    return $found
}

proc ::sorma::scott::HintAt {line point} {
    variable Pending
    if {[string trim $line] eq {}} {
        return {}
    }
    return [dict get [::sorma::complete $Pending$line [expr {[string length $Pending] + $point}]] hint]
}

# Execute a command while the event loop runs, show what came, and record it. Ctrl-C gives up what it waits for.
proc ::sorma::scott::Execute line {
    variable Outcome
    unset -nocomplain Outcome
    try {
        coroutine ::sorma::scott::job ::sorma::scott::Evaluate $line
        if {![info exists Outcome]} {
            ::sorma::edit wait ::sorma::scott::Outcome
        }
    } trap {TCL CANCEL} {} {
        # Ctrl-C in between
    }
    if {![info exists Outcome]} {
        catch {rename ::sorma::scott::job {}}       ;# cancels the requests that it waits for
        set Outcome {1 {interrupted; what was asked for may have been done} {-code 1 -errorcode {SORMA COMM CANCELLED}}}
        set ::errorCode {SORMA COMM CANCELLED}
    }
    lassign $Outcome code result options
    if {$code == 1 && [lrange [dict get $options -errorcode] 0 1] eq {TCL CANCEL} || $code == 1 && [dict get $options -errorcode] eq {SORMA COMM CANCELLED}} {
        puts {}     ;# after the ^C
    }
    Print $line $code $result $options
    if {[Records] && ![catch {::sorma::line::translate $line} script]} {
        ::sorma::record::note $line $script $code $result $options
    }
}

proc ::sorma::scott::Evaluate line {
    variable Outcome
    set code [catch {
        set script [::sorma::line::translate $line]
        if {[Records]} {
            ::sorma::record::before $script
        }
        Run $script
    } result options]
    set Outcome [list $code $result $options]
}

proc ::sorma::scott::Records {} {
    return [expr {[info commands ::sorma::record::active] ne {} && [::sorma::record::active]}]
}

proc ::sorma::scott::BackgroundError {message options} {
    puts stderr "background error: $message"
}

# ---- history: one command a line, a newline in it as \n and a backslash as \\ ----

proc ::sorma::scott::LoadHistory {} {
    variable HistoryFile
    set most 2000
    set HistoryFile {}
    if {[info exists ::env(XDG_STATE_HOME)] && $::env(XDG_STATE_HOME) ne {}} {
        set folder $::env(XDG_STATE_HOME)
    } elseif {[info exists ::env(HOME)] && $::env(HOME) ne {}} {
        set folder [file join $::env(HOME) .local state]
    } else {
        return
    }
    set file [file join $folder sorma scott.history]
    try {
        file mkdir [file dirname $file]
        set channel [open $file {RDWR CREAT APPEND} 0600]
    } on error message {
        puts stderr "scott: what is typed will not be remembered: $message"
        return
    }
    try {
        fconfigure $channel -encoding utf-8
        seek $channel 0
        set lines [split [string trimright [read $channel] \n] \n]
    } on error message {
        puts stderr "scott: cannot read what was typed before: $message"
        return
    } finally {
        close $channel
    }
    set HistoryFile $file
    if {[llength $lines] > 2 * $most} {
        # Shortened now and then, in one step, so that others who read it find it whole.
        set lines [lrange $lines end-[expr {$most - 1}] end]
        catch {
            set channel [open $file.[pid] {WRONLY CREAT TRUNC} 0600]
            fconfigure $channel -encoding utf-8
            puts $channel [join $lines \n]
            close $channel
            file rename -force $file.[pid] $file
        }
    }
    set commands [lmap line [lrange $lines end-[expr {$most - 1}] end] {
        if {$line eq {}} continue
        string map [list {\\} \\ {\n} \n] $line
    }]
    ::sorma::edit remember {*}$commands
    foreach command $commands {
        history add $command        ;# so that Tcl's own history shows the same
    }
}

# A command that begins with a space is kept out of it.
proc ::sorma::scott::Remember command {
    variable HistoryFile
    if {[string index $command 0] eq " "} {
        return
    }
    ::sorma::edit remember $command
    history add $command
    if {$HistoryFile eq {}} {
        return
    }
    try {
        set channel [open $HistoryFile {WRONLY CREAT APPEND} 0600]
        fconfigure $channel -encoding utf-8
        puts $channel [string map [list \\ {\\} \n {\n}] $command]
        close $channel
    } on error message {
        puts stderr "scott: what is typed will not be remembered: $message"
        set HistoryFile {}
    }
}

# ---- what comes back ----

# Print a result, or an error on standard error.
proc ::sorma::scott::Print {line code result options} {
    variable Json
    variable Direct
    if {$code != 1 && $result eq {} && !$Json} {
        return
    }
    if {$code != 1 && $Direct && (!$Json || [lindex [::sorma::line::head $line] 0] ni {help watch unwatch monitor record})} {
        puts $result
        return
    }
    set channel [expr {$code == 1 && !$Json ? "stderr" : "stdout"}]
    set settings [ShowSettings $channel]
    if {$code != 1} {
        lappend settings {*}[WhatItIs $line]
    }
    if {$code == 1} {
        lappend settings -error $options
    }
    puts $channel [::sorma::show $result {*}$settings]
}

# What the table of an object's class says about its answer: units and names of what EXEC writes, the type of an option.
proc ::sorma::scott::WhatItIs line {
    variable Json
    lassign [::sorma::line::head $line 3] name method option
    if {!($method in {EXEC CTRL DBX exec} || $Json && $method eq "cget")} {
        return {}
    }
    package require sorma::table
    set table [::sorma::Aside [list ::sorma::table guess $name]]
    if {$table eq {}} {
        return {}
    }
    if {$method ne "cget"} {
        return [list -writes [dict get $table writes]]
    }
    return [list -as plain -type [lindex [lsearch -inline -index 0 -exact [dict get $table options] $option] 1]]
}

# On a terminal for a person, with its width and perhaps colours; elsewhere everything, for a program.
proc ::sorma::scott::ShowSettings channel {
    variable Json
    if {![IsTerminal $channel]} {
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

# A command of the inspector. With --json its data, when it is all that was typed.
proc ::sorma::scott::Look {name args} {
    variable Json
    variable Direct
    if {!$Json || !$Direct || $name in {watch unwatch monitor}} {
        return [::sorma::inspect::$name {*}$args]
    }
    package require sorma::json
    if {$name eq "dump"} {
        ::sorma::inspect::dump {*}$args -data           ;# fails when there is no such object
        return [JsonOptions [dict get [::sorma::inspect::help {*}$args -data] options]]
    }
    set data [::sorma::inspect::$name {*}$args -data]
    return \[[join [lmap item $data {JsonObject $item}] ,]\]
}

# Options as a table has them: what each value is, is said there, and not by how it looks.
proc ::sorma::scott::JsonOptions options {
    set fields [lmap option $options {
        lassign $option name type unit range default value
        string cat [::sorma::json::text $name] : [::sorma::json::typed $type $value]
    }]
    return "{[join $fields ,]}"
}

proc ::sorma::scott::JsonObject dict {
    variable Counts
    set fields {}
    dict for {key value} $dict {
        set value [switch -- $key {
            uses { JsonObject $value }
            default { if {$key in $Counts && $value ne {}} {::sorma::json::number $value} else {::sorma::json::text $value} }
        }]
        lappend fields "[::sorma::json::text $key]:$value"
    }
    return "{[join $fields ,]}"
}

# help ?NAME?: that of the inspector, and what only scott has.
proc ::sorma::scott::Help args {
    set text [::sorma::inspect::help {*}$args]
    if {[llength $args] == 0} {
        append text \n [::sorma::text::table {} [list \
            [list [join [::sorma::usage::of trail]] {all messages of the last request, or of an object's last one; one; its stack trace}] \
            [list [join [::sorma::usage::of record] { or }] {keeps what is typed as a script, and as a test suite; ends that}] \
            {{Tab, Ctrl-R, Ctrl-C, Ctrl-D} {complete; search what was typed; give up; leave. More: man scott}} \
        ] {*}[dict filter [::sorma::showDefaults] key -colour -width] -wrap 1]
    }
    return $text
}

# record FILE ?-exact?; record stop.
proc ::sorma::scott::Record args {
    if {$args eq "stop"} {
        return [::sorma::record::stop]
    }
    if {[llength $args] == 0} {
        ::sorma::usage::wrong record
    }
    return [::sorma::record::start {*}$args]
}

# trail ?NAME? ?NUMBER? ?-stack?: the messages of the last request, or of the last one of an object that had any; one of them; the
# stack trace of one, or of the first that has one. In colours only when it is shown at once.
proc ::sorma::scott::Trail args {
    variable Direct
    set stack [dict get [::sorma::options::parse {-stack flag} $args words] -stack]
    set number {}
    if {[string is integer -strict [lindex $words end]]} {
        set number [lindex $words end]
        set words [lrange $words 0 end-1]
    }
    if {[llength $words] > 1} {
        ::sorma::usage::wrong trail
    }
    set trail [::sorma::trail {*}$words]
    set settings [expr {$Direct ? [ShowSettings stdout] : {-width 0}}]
    if {$number ne {} && ($number < 1 || $number > [llength $trail])} {
        return -code error -errorcode {SORMA REQUEST SYNTAX} "there is no message $number: the trail has [llength $trail]"
    }
    if {$stack} {
        package require sorma::trail
        if {$number eq {}} {
            set number [expr {max(1, [lsearch -exact [lmap entry $trail {::sorma::trail::isStack $entry}] 1])}]
        }
        return [::sorma::showStack $trail $number {*}$settings]
    }
    if {$number ne {}} {
        set trail [lrange $trail $number-1 $number-1]
    }
    return [::sorma::showTrail $trail {*}$settings]
}
