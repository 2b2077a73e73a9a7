# typed.tcl -- the commands that pages name, and what they do when they are typed.
#
#     typed::named TEXT man|md ?0|1?   commands of a page, each as it is typed: a dict, command -> shell|tcl; with 1 also of its examples
#     typed::sessions TEXT            examples with prompts: list of lists {command expected ...}
#     typed::play TASKS               shell commands, several at a time: list of {command facts}; returns what is not as it should be
#
# A command stands in one piece: between `...`, in [cmd {...}] or [const {...}], on an indented line, or in an example. It begins with a
# program, with a command of the package, or with an object and EXEC, CTRL or DBX.

namespace eval typed {
    variable Programs {./bootstrap sormad scott scottwish sorma-launch sorma-keys sorma-browser sorma-neo sorma-record sorma-replay sorma-web sorma-draughts draughts-train make autoreconf ./configure
        configure tclsh tclsh8.6 pkg-config ldconfig export bench gdb valgrind tcpdump ssh for}
    variable Bound 300000       ;# ms for one command
    variable Jobs 4             ;# at a time
    variable Running            ;# array: pipe -> what it has said
    variable Group              ;# array: pipe -> its process, which leads a group
}

# Is this a command? Returns shell, tcl or nothing.
proc typed::Kind text {
    variable Programs
    lassign [regexp -all -inline {\S+} $text] first second
    if {$first in $Programs && $second ne {} && ![regexp {^for (?!i in)} $text] || [regexp {^(?:build/env|tests/\S|demos/\S|[A-Z_]+=.* \./bootstrap|\.ci/run)} $text] && [regexp {\s} $text]} {
        return shell
    }
    # An object in capitals stands for any, and a word without a value for a text about it.
    if {[regexp {^(?!my$)[a-z]\w*(?:\.[\w.]+)?(?:@[\w:.]+)?$} $first] && [regexp {^(?:EXEC|CTRL|DBX|exec|configure|cget)$} $second]
            || [regexp {^(?:sorma::\w+|package|ttk::style|font|lappend|carry|mine)$} $first] && $second ne {}} {
        return tcl
    }
}

# The command as it is typed: without prompt, and without what is said about it.
proc typed::Bare line {
    set line [regsub {\s+#\s.*$|\s{3,}\S.*$|\s*;#.*$} [string trim $line] {}]
    return [regsub {^(?:\w*[$%] )} $line {}]
}

proc typed::Add {foundVar text} {
    upvar 1 $foundVar found
    set text [Bare $text]
    set kind [Kind $text]
    if {$kind ne {}} {
        dict set found $text $kind
    }
}

proc typed::named {text markup {scripts 1}} {
    set found {}
    if {$markup eq "md"} {
        set text [regsub -all {```tcl\n.*?\n```} $text {}]
        foreach {- span} [regexp -all -inline {`([^`\n]+)`} $text] {
            Add found $span
        }
        foreach {- line} [regexp -all -inline -line {^    (\S.*)$} $text] {
            Add found $line
        }
        return $found
    }
    foreach {- markup braced quoted more} [regexp -all -inline {\[(const|cmd) (?:\{([^\}]*)\}|"([^"]*)")\]( \[(?:arg|opt|option) |\])?} $text] {
        # A command of the package is a reference to its manual, which suite usage knows. With arguments it is no command yet.
        if {$more ne {} || $markup eq "cmd" && [regexp {^sorma(?:::|-)} $braced$quoted]} continue
        Add found [string map [list \[lb\] \[ \[rb\] \] \\\[ \[ \\\] \] \n " "] $braced$quoted]
    }
    foreach example [if {$scripts} {examples $text}] {
        if {[regexp -line {^% } $example]} continue
        set commands {}
        foreach command [Lines $example] {
            Add commands $command
        }
        if {"tcl" in [dict values $commands]} {
            # A script: also what stands between its requests.
            foreach command [Lines $example] {
                if {[Bare $command] ne {}} {
                    dict set found [Bare $command] tcl
                }
            }
        }
        set found [dict merge $found $commands]
    }
    return $found
}

# The examples of a page of the manual, as they are read.
proc typed::examples text {
    set found {}
    set end {}
    foreach line [split $text \n] {
        if {$end eq {} && $line in {"\[example \{" "\[example_begin\]"}} {
            set end [expr {$line eq "\[example_begin\]" ? "\[example_end\]" : "\}\]"}]
            set lines {}
        } elseif {$end ne {} && $line eq $end} {
            lappend found [string map [expr {$end eq "\}\]" ? {} : {[lb] \[ [rb] \]}}] [join $lines \n]]
            set end {}
        } elseif {$end ne {}} {
            lappend lines $line
        }
    }
    return $found
}
# Lines of a script, those that belong together in one.
proc typed::Lines text {
    set lines {}
    set command {}
    foreach line [split $text \n] {
        append command $line
        if {[info complete $command]} {
            lappend lines $command
            set command {}
        } else {
            append command \n
        }
    }
    return $lines
}

# What was typed at a prompt in the examples of a page, and what is to come: a list of {command expected ...}, one for each example.
proc typed::sessions text {
    return [lmap example [examples $text] {
        if {![regexp -line {^% } $example]} continue
        set steps {}
        foreach step [lrange [split [string map [list "\n% " \0] "\n$example"] \0] 1 end] {
            set lines [Lines $step]
            lappend steps [lindex $lines 0] [join [lrange [split $step \n] [regexp -all {\n} [lindex $lines 0]]+1 end] \n]
        }
        set steps
    }]
}

# Is what came what is expected, where "..." stands for anything?
proc typed::matches {came expected} {
    return [string match [string map {* \\* ? \\? \[ \\\[ \] \\\] \\ \\\\ ... *} $expected] $came]
}

# ---- a shell ----

# Type each command in a shell of its own. Tasks are pairs of a command and a dict of facts:
#       folder        where it is typed
#       environment   list of NAME=VALUE
#       until         a pattern. When it has said this, it has done its work, and is ended
#       window        the same, when an interpreter of this name has a window. One of these at a time: a second one gets another name
#       code          its exit code; default 0
# Returns a list of what is wrong.
proc typed::play tasks {
    variable Jobs
    variable Running
    variable Bound
    set wrong {}
    array set Running {}
    set since {}
    while {[llength $tasks] > 0 || [array size Running] > 0} {
        while {[array size Running] < $Jobs && [set next [Next $tasks $since]] >= 0} {
            set task [lindex $tasks $next]
            set tasks [lreplace $tasks $next $next]
            dict set since [Start {*}$task] [list {*}$task [clock milliseconds]]
        }
        after 50 {set ::typed::Tick 1}
        vwait ::typed::Tick
        foreach pipe [array names Running] {
            lassign [dict get $since $pipe] command facts began
            set until [expr {[dict exists $facts until] ? [dict get $facts until] : {}}]
            set window [expr {[dict exists $facts window] ? [dict get $facts window] : {}}]
            set late [expr {[clock milliseconds] - $began > $Bound}]
            set ended [eof $pipe]
            set done [expr {$until ne {} && [string match *$until* $Running($pipe)] || $window ne {} && $window in [winfo interps]}]
            if {!$ended && !$late && !$done} continue
            set said $Running($pipe)
            set code [End $pipe [expr {$late ? "KILL" : "TERM"}]]
            if {$late} {
                lappend wrong "$command: has neither ended nor \"$until$window\": $said"
            } elseif {!$done && "$until$window" ne {}} {
                lappend wrong "$command: ended with $code without \"$until$window\": $said"
            } elseif {!$done && $code != [expr {[dict exists $facts code] ? [dict get $facts code] : 0}]} {
                lappend wrong "$command: exit code $code: $said"
            }
        }
    }
    return $wrong
}

# The first task that may start now, or -1.
proc typed::Next {tasks since} {
    variable Running
    set drawing [lsearch [lmap pipe [array names Running] {dict exists [lindex [dict get $since $pipe] 1] window}] 1]
    set next 0
    foreach task $tasks {
        if {$drawing < 0 || ![dict exists [lindex $task 1] window]} {
            return $next
        }
        incr next
    }
    return -1
}

proc typed::Start {command facts} {
    variable Running
    variable Group
    # A session of its own: with its group all goes that was started in it. The process that exec makes stays the leader.
    set pipe [open [list | setsid env {*}[dict get $facts environment] sh -c "cd \"\$1\" && $command" sh [dict get $facts folder] < /dev/null 2>@1] r]
    fconfigure $pipe -blocking 0 -encoding utf-8
    set Running($pipe) {}
    set Group($pipe) [pid $pipe]
    fileevent $pipe readable [list typed::Take $pipe]
    return $pipe
}
proc typed::Take pipe {
    variable Running
    append Running($pipe) [read $pipe]
    if {[eof $pipe]} {
        fileevent $pipe readable {}
    }
}

# End what runs still, and wait for that. Returns the exit code.
proc typed::End {pipe signal} {
    variable Running
    variable Group
    variable Bound
    catch {exec kill -$signal -- -$Group($pipe)}
    if {[catch {waitFor {[eof $pipe]} $Bound}]} {
        catch {exec kill -KILL -- -$Group($pipe)}
    }
    unset Running($pipe) Group($pipe)
    fileevent $pipe readable {}
    fconfigure $pipe -blocking 1
    if {![catch {close $pipe} - how]} {
        return 0
    }
    set code [dict get $how -errorcode]
    return [expr {[lindex $code 0] eq "CHILDSTATUS" ? [lindex $code 2] : $code}]
}
