# shell.tcl -- what a person types: run, shown, completed and remembered. The one piece below scott's terminal and the console in Tk.
#
# Typed lines are Tcl. A command is a request when its first word is a service object's name and its second EXEC, CTRL or DBX.
# Then it may also quote words as 'text', taken as it stands: see line.tcl. The caller types and shows.
#
# settings: those of text.tcl (-width, -colour, -whole, -json), for the place where what comes is shown.

package require sorma
package require sorma::line
package require sorma::options
package require sorma::text
package require sorma::usage
package provide sorma::shell 1.0

namespace eval ::sorma::shell {
    variable Counts {calls underway objects count rate mean min max jitter lost p50 p99}    ;# columns with numbers in the inspector's data
    variable Settings {-json 0 -width 80 -colour 0 -whole 0}    ;# of the command that was typed last
    variable Direct 0       ;# the command that was typed last is one of `commands` alone: its text is as it is to be shown
    variable HistoryFile {} ;# where what is typed is noted; empty: nowhere
    variable MostHistory 2000
}

# ::sorma::shell::prepare --
#       What all that is typed may rely on, and so does a recording: dict answers CTRL, EXEC and DBX, and the inspector's
#       commands are there. These live in ::sorma::words, which the global namespace looks into last: they give way to
#       every command of the same name that somebody has, or makes later.
proc ::sorma::shell::prepare {} {
    ::sorma::JoinDict
    if {[info commands ::sorma::shell::tclTrace] eq {}} {
        rename ::trace ::sorma::shell::tclTrace
        interp alias {} ::trace {} ::sorma::shell::Trace
    }
    foreach name [InspectorCommands] {
        word $name ::sorma::shell::Look $name
    }
    word help ::sorma::shell::Help
    word trail ::sorma::shell::Trail
    word record ::sorma::shell::Record
    if {"::sorma::words" ni [namespace eval :: {namespace path}]} {
        namespace eval :: {namespace path [list {*}[namespace path] ::sorma::words]}
    }
    # Where nothing says which characters the terminal speaks it is UTF-8 today, not what Tcl makes of it.
    if {[encoding system] in {iso8859-1 ascii}} {
        foreach channel {stdin stdout stderr} {
            catch {fconfigure $channel -encoding utf-8}
        }
    }
}

# ::sorma::shell::word NAME COMMAND ?ARG ...? -- a command for those who type; all but its further words.
proc ::sorma::shell::word {name args} {
    namespace eval ::sorma::words {}
    interp alias {} ::sorma::words::$name {} {*}$args
}

# Names of the inspector's commands. The one list of them is that of the package.
proc ::sorma::shell::InspectorCommands {} {
    return [lsort [lmap command [info commands {::sorma::inspect::[a-z]*}] {namespace tail $command}]]
}

# ::sorma::shell::commands -- all commands whose text is as it is to be shown.
proc ::sorma::shell::commands {} {
    return [concat [InspectorCommands] {trail trace record}]
}

# ---- running ----

# ::sorma::shell::run SCRIPT SETTINGS -- execute Tcl, as line::translate gives it, at global level.
proc ::sorma::shell::run {script settings} {
    variable Direct
    variable Settings
    set Settings [dict merge {-json 0 -width 80 -colour 0 -whole 0} $settings]
    set Direct [IsDirect $script]
    if {$Direct && [lindex [::sorma::line::head $script] 0] ni {trail record}} {       ;# what these return fits where it is shown
        ::sorma::showDefaults {*}[dict filter $Settings key -width -colour]
    }
    try {
        return [uplevel #0 $script]
    } trap {TCL LOOKUP COMMAND} {text how} {
        set name [lindex [dict get $how -errorcode] 3]
        set known [concat [commands] help [::sorma::usage::commands sorma::*]]
        return -options [dict replace $how -level 0] [string map [list "\"$name\"" "\"$name\"[::sorma::DidYouMean $name $known]"] $text]
    }
}
proc ::sorma::shell::IsDirect line {
    return [expr {[lindex [::sorma::line::head $line] 0] in [commands]}]
}

# ::sorma::shell::begin ID LINE SETTINGS PREFIX --
#       Execute what was typed in a coroutine, so that the event loop goes on while it waits.
# Arguments:
#       ID      by which it can be cancelled
#       PREFIX  called with catch's code, result and options, perhaps before this returns; never after `cancel`
proc ::sorma::shell::begin {id line settings prefix} {
    coroutine ::sorma::shell::job.$id ::sorma::shell::Evaluate $line $settings $prefix
    return
}
proc ::sorma::shell::Evaluate {line settings prefix} {
    set coroutine [info coroutine]
    set code [catch {
        set script [::sorma::line::translate $line]
        if {[records]} {
            ::sorma::record::before $script
        }
        run $script $settings
    } result options]
    if {[namespace which -command $coroutine] ne {}} {
        {*}$prefix $code $result $options
    }
}

# ::sorma::shell::cancel ID --
#       Give up what was begun: the requests that it waits for are cancelled.
# Results:
#       Code, result and options that stand for its outcome.
proc ::sorma::shell::cancel id {
    catch {rename ::sorma::shell::job.$id {}}
    set ::errorCode {SORMA COMM CANCELLED}
    return {1 {interrupted; what was asked for may have been done} {-code 1 -errorcode {SORMA COMM CANCELLED}}}
}

# ::sorma::shell::note LINE CODE RESULT OPTIONS -- keep it in the recording, if there is one.
proc ::sorma::shell::note {line code result options} {
    if {[records] && ![catch {::sorma::line::translate $line} script]} {
        ::sorma::record::note $line $script $code $result $options
    }
}

# ::sorma::shell::records -- is there a recording?
proc ::sorma::shell::records {} {
    return [expr {[info commands ::sorma::record::active] ne {} && [::sorma::record::active]}]
}

# ---- the words that can come next ----

# ::sorma::shell::complete PENDING LINE POINT --
#       As sorma::complete, of a line that goes on from lines before it. Facts of a daemon have to be asked for first. A
#       coroutine waits a moment for them; elsewhere the event loop runs meanwhile.
proc ::sorma::shell::complete {pending line point} {
    set before [string length $pending]
    set found [::sorma::complete $pending$line [expr {$before + $point}]]
    if {[llength [dict get $found words]] == 0 && [::sorma::await settle 300]} {
        set found [::sorma::complete $pending$line [expr {$before + $point}]]
    }
    dict set found from [expr {max([dict get $found from] - $before, 0)}]
    return $found
}

# ::sorma::shell::hint PENDING LINE POINT -- what is expected there.
proc ::sorma::shell::hint {pending line point} {
    if {[string trim $line] eq {}} {
        return {}
    }
    return [dict get [::sorma::complete $pending$line [expr {[string length $pending] + $point}]] hint]
}

# ::sorma::shell::endings LINE ?BEFORE? -- for a shell: the words that can end LINE when BEFORE stands before it. Each has with it the part
# of the last word that is there already.
proc ::sorma::shell::endings {line {before {}}} {
    set text $before$line
    ::sorma::complete $text [string length $text]           ;# asks the daemons
    ::sorma::await settle 300
    set found [::sorma::complete $text [string length $text]]
    set head [string range $text [string length $before] [dict get $found from]-1]
    return [lmap word [dict get $found words] {string cat $head $word}]
}

# ---- history: one command a line, a newline in it as \n and a backslash as \\ ----

# ::sorma::shell::recall --
#       What was typed before, here or in another window, the oldest first; Tcl's own history shows the same.
# Results:
#       List of commands. Fails, with a message for people, when nothing can be remembered.
proc ::sorma::shell::recall {} {
    variable HistoryFile
    variable MostHistory
    history keep $MostHistory
    set HistoryFile {}
    if {[info exists ::env(XDG_STATE_HOME)] && $::env(XDG_STATE_HOME) ne {}} {
        set folder $::env(XDG_STATE_HOME)
    } elseif {[info exists ::env(HOME)] && $::env(HOME) ne {}} {
        set folder [file join $::env(HOME) .local state]
    } else {
        return {}
    }
    set file [file join $folder sorma scott.history]
    try {
        file mkdir [file dirname $file]
        set channel [open $file {RDWR CREAT APPEND} 0600]
    } on error message {
        return -code error "the history cannot be saved: $message"
    }
    try {
        fconfigure $channel -encoding utf-8
        seek $channel 0
        set lines [split [string trimright [read $channel] \n] \n]
    } on error message {
        return -code error "cannot read the history: $message"
    } finally {
        close $channel
    }
    set HistoryFile $file
    if {[llength $lines] > 2 * $MostHistory} {
        # Shortened now and then, in one step, so that others who read it find it whole.
        set lines [lrange $lines end-[expr {$MostHistory - 1}] end]
        catch {
            set channel [open $file.[pid] {WRONLY CREAT TRUNC} 0600]
            fconfigure $channel -encoding utf-8
            puts $channel [join $lines \n]
            close $channel
            file rename -force $file.[pid] $file
        }
    }
    set commands [lmap line [lrange $lines end-[expr {$MostHistory - 1}] end] {
        if {$line eq {}} continue
        string map [list {\\} \\ {\n} \n] $line
    }]
    foreach command $commands {
        history add $command
    }
    return $commands
}

# ::sorma::shell::remember COMMAND -- for the next time. Fails once, with a message for people, when that is not possible.
proc ::sorma::shell::remember command {
    variable HistoryFile
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
        set HistoryFile {}
        return -code error "the history cannot be saved: $message"
    }
}

# ---- what comes back ----

# ::sorma::shell::show LINE CODE RESULT OPTIONS SETTINGS -- what is to be shown of the outcome of a command; empty: nothing.
proc ::sorma::shell::show {line code result options settings} {
    set json [dict get $settings -json]
    if {$code != 1 && $result eq {} && !$json} {
        return
    }
    if {$code != 1 && [IsDirect $line] && (!$json || [lindex [::sorma::line::head $line] 0] ni {help watch unwatch monitor record})} {
        return $result
    }
    if {$code != 1} {
        lappend settings {*}[WhatItIs $line $json]
    } else {
        lappend settings -error $options
    }
    return [::sorma::show $result {*}$settings]
}

# Facts from the table of an object's class about its answer: units and names of what EXEC writes, the type of an option.
proc ::sorma::shell::WhatItIs {line json} {
    lassign [::sorma::line::head $line 3] name method option
    if {!($method in {EXEC CTRL DBX exec} || $json && $method eq "cget")} {
        return {}
    }
    package require sorma::table
    set table [::sorma::KeepTrail [list ::sorma::table guess $name]]
    if {$table eq {}} {
        return {}
    }
    if {$method ne "cget"} {
        return [list -writes [dict get $table writes]]
    }
    return [list -as plain -type [lindex [lsearch -inline -index 0 -exact [dict get $table options] $option] 1]]
}

# A command of the inspector. With -json its data, when it is all that was typed.
proc ::sorma::shell::Look {name args} {
    variable Settings
    variable Direct
    if {![dict get $Settings -json] || !$Direct || $name in {watch unwatch monitor}} {
        try {
            return [::sorma::inspect::$name {*}$args]
        } trap {SORMA REQUEST SYNTAX} {text how} {
            return -options $how [string map {sorma::inspect:: {}} $text]       ;# as it is typed here
        }
    }
    package require sorma::json
    if {$name eq "retry"} {
        return [::sorma::inspect::retry -data {*}$args]
    }
    if {$name eq "dump"} {
        ::sorma::inspect::dump {*}$args -data           ;# fails when there is no such object
        return [JsonOptions [dict get [::sorma::inspect::help {*}$args -data] options]]
    }
    set data [::sorma::inspect::$name {*}$args -data]
    return \[[join [lmap item $data {JsonObject $item}] ,]\]
}

# Options as a table has them: what each value is, is said there, and not by how it looks.
proc ::sorma::shell::JsonOptions options {
    set fields [lmap option $options {
        lassign $option name type unit range default value
        string cat [::sorma::json::text $name] : [::sorma::json::typed $type $value]
    }]
    return "{[join $fields ,]}"
}

proc ::sorma::shell::JsonObject dict {
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
proc ::sorma::shell::Help args {
    set text [::sorma::inspect::help {*}$args]
    if {[llength $args] == 0} {
        append text \n [::sorma::text::table {} [list \
            [list [join [::sorma::usage::of trail]] {all messages of the last request, or of an object's last one; one; its stack trace}] \
            [list [join [::sorma::usage::of trace]] {all calls of a request, over all daemons, and the time of each}] \
            [list [join [::sorma::usage::of record] { or }] {keeps what is typed as a script, and as a test suite; ends that}] \
            {{Tab, Ctrl-R, Ctrl-C, Ctrl-D} {complete; search what was typed; give up; leave. More: man scott}} \
        ] {*}[dict filter [::sorma::showDefaults] key -colour -width] -wrap 1]
    }
    return $text
}

# record FILE ?-exact?; record stop.
proc ::sorma::shell::Record args {
    if {$args eq "stop"} {
        return [::sorma::record::stop]
    }
    if {[llength $args] == 0} {
        ::sorma::usage::wrong record
    }
    return [::sorma::record::start {*}$args]
}

# trace SCRIPT: its calls, over all daemons, and what it returned. With other words it is Tcl's own.
proc ::sorma::shell::Trace args {
    if {[llength $args] == 0} {
        ::sorma::usage::wrong trace
    }
    if {[llength $args] != 1} {
        tailcall ::sorma::shell::tclTrace {*}$args
    }
    set told [uplevel 1 [list ::sorma::trace [lindex $args 0]]]
    package require sorma::listing
    set result [::sorma::text::clean [dict get $told result]]
    return "[::sorma::listing calls [dict get $told tree]]\n[expr {[dict get $told code] == 1 ? {error: } : {}}]$result"
}

# trail ?NAME? ?NUMBER? ?-stack?: the messages of the last request, or of the last one of an object that had any. A number chooses one of
# them. With -stack it is the stack trace of that one, or of the first that has one. Colours only come when it is shown at once.
proc ::sorma::shell::Trail args {
    variable Direct
    variable Settings
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
    set settings [expr {$Direct ? $Settings : {-width 0}}]
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
