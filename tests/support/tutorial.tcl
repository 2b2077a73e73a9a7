# tutorial.tcl -- does what a reader of a tutorial does: writes the files, types the commands, looks at what comes.
#
# A Markdown file's blocks between ``` are
#   a file      when the line before says so: "... this into `NAME`:"
#   typed       when its lines begin with prompts: "$ " to a shell, "% " to a tclsh; a word before the prompt is the host.
#               The output follows, "..." standing for anything. Each host has one shell and one tclsh.
# Anything else is an error: then there would be a block that nobody has tried.

namespace eval tutorial {
    variable Here [file dirname [file normalize [info script]]]
    variable Sessions {}    ;# dict: {host kind} -> pipe
    variable Came           ;# array: pipe -> what it has said that nobody has looked at
    variable Bound 60000    ;# ms for one command; it may be a compiler under a sanitizer
}

# tutorial::play file ?map? ?wrapCmd? -- returns {number of blocks, what is not true}; it stops at the first such thing.
#   map       pairs: what stands in the text and what is to be typed and expected instead
#   wrapCmd   gives with a host's name what to put before the command line of its sessions
proc tutorial::play {file {map {}} {wrapCmd {apply {host {}}}}} {
    variable Sessions
    set folder [file join [::tcltest::temporaryDirectory] tutorial]
    file mkdir $folder
    set blocks [blocks $file]
    try {
        foreach {language name body} $blocks {
            set body [string map $map $body]
            if {$name ne {}} {
                set out [open [file join $folder $name] w]
                fconfigure $out -encoding utf-8
                puts $out $body
                close $out
                continue
            }
            foreach {host kind command expected} [steps $body] {
                if {$kind eq {}} {
                    return [list "not all" [list "a $language block that is neither a file nor typed: $command"]]
                }
                set came [type $host $kind $command $expected $folder $wrapCmd]
                if {![matches $came $expected]} {
                    # The next commands would only wait for output that cannot come.
                    return [list "not all" [list "$host$kind $command\n---- gave\n$came\n---- instead of\n$expected"]]
                }
            }
        }
    } finally {
        foreach pipe [dict values $Sessions] {
            end $pipe
        }
        set Sessions {}
        file delete -force $folder
    }
    return [list [expr {[llength $blocks] / 3}] {}]
}

# Blocks of a Markdown file: language name-of-a-file-or-empty text ...
proc tutorial::blocks file {
    set in [open $file]
    fconfigure $in -encoding utf-8
    set lines [split [read $in] \n]
    close $in
    set blocks {}
    set before {}
    set body {}
    set language {}
    set inside 0
    foreach line $lines {
        if {[regexp {^```(\w*)$} $line -> word]} {
            if {$inside} {
                set name {}
                regexp {this into[\s\n]`([\w.]+)`:$} $before -> name
                lappend blocks $language $name [join $body \n]
            }
            set inside [expr {!$inside}]
            set language $word
            set body {}
            if {!$inside} {
                set before {}
            }
        } elseif {$inside} {
            lappend body $line
        } elseif {$line ne {}} {
            # A paragraph's last two lines: the sentence may have been broken.
            set before "[lindex [split $before \n] end]\n$line"
        }
    }
    return $blocks
}

# What is typed and expected: host kind command expected ... kind: $ or %; empty: no prompt.
proc tutorial::steps body {
    set steps {}
    set kind {}
    foreach line [split $body \n] {
        if {[regexp {^(\w*)([$%]) (.*)$} $line -> newHost newKind typed]} {
            if {$kind ne {}} {
                lappend steps $host $kind $command [join $expected \n]
            }
            lassign [list $newHost $newKind $typed {}] host kind command expected
        } elseif {$kind eq {}} {
            return [list {} {} $body {}]
        } elseif {$kind eq "%" && ![info complete $command]} {
            append command \n$line
        } else {
            lappend expected $line
        }
    }
    lappend steps $host $kind $command [join $expected \n]
    return $steps
}

proc tutorial::matches {came expected} {
    set pattern [string map {* \\* ? \\? \[ \\\[ \] \\\] \\ \\\\ ... *} $expected]
    return [string match $pattern $came]
}

# Type a command. Waits until it is done and what is expected has come, which a program in the background may say later.
proc tutorial::type {host kind command expected folder wrapCmd} {
    variable Sessions
    variable Came
    variable Bound
    variable Here
    if {![dict exists $Sessions $host$kind]} {
        if {$kind eq "$"} {
            set program sh
        } else {
            set program [list [info nameofexecutable] [file join $Here tutorialShell.tcl]]
        }
        # setsid: with the session all goes that was started in it.
        set pipe [open |[list {*}[{*}$wrapCmd $host] setsid sh -c {cd "$0" && exec "$@" 2>&1} $folder {*}$program] r+]
        fconfigure $pipe -blocking 0 -buffering line -encoding utf-8 -translation {auto lf}
        dict set Sessions $host$kind $pipe
        set Came($pipe) {}
        fileevent $pipe readable [list tutorial::Take $pipe]
    }
    set pipe [dict get $Sessions $host$kind]
    if {$kind eq "$"} {
        puts $pipe "$command\nprintf '\\001\\n'"
    } else {
        puts $pipe [binary encode base64 [encoding convertto utf-8 $command]]
    }
    catch {waitFor {[string first \1 $Came($pipe)] >= 0 && [tutorial::matches [tutorial::Clean $Came($pipe)] $expected]} \
        [expr {$expected eq {} ? 1 : $Bound}]}
    catch {waitFor {[string first \1 $Came($pipe)] >= 0} $Bound}
    set came [Clean $Came($pipe)]
    set Came($pipe) {}
    return $came
}

proc tutorial::Take pipe {
    variable Came
    append Came($pipe) [read $pipe]
    if {[eof $pipe]} {
        fileevent $pipe readable {}
        append Came($pipe) "(it has ended)\1"
    }
}

proc tutorial::Clean text {
    return [string trim [string map [list \1\n {} \1 {}] $text] \n]
}

proc tutorial::end pipe {
    variable Came
    # Daemons end as they do for a reader, with their sockets. The program kill: that of dash takes no --.
    foreach pid [pid $pipe] {
        catch {exec kill -TERM -- -$pid}
        if {[catch {waitFor {[eof $pipe]} 10000}]} {
            catch {exec kill -KILL -- -$pid}
        }
    }
    fileevent $pipe readable {}
    catch {
        fconfigure $pipe -blocking 1
        close $pipe
    }
    unset Came($pipe)
}

proc tutorial::QuoteForShell word { return '[string map {' '\\''} $word]' }

# Programs as a reader has them: the tclsh of the tests under its usual name, and a compiler. The compiler is not itself sanitized,
# and makes code for the program that will load it.
proc tutorial::programs folder {
    file mkdir $folder
    set sanitizers {}
    if {[info exists ::env(SORMA_BUILD)]} {
        catch {set sanitizers [exec sed -n {s/^SORMA_SANITIZERS = //p} [file join $::env(SORMA_BUILD) Makefile]]}
    }
    foreach {name command} [list \
            tclsh8.6 [info nameofexecutable] \
            g++ "env -u LD_PRELOAD PATH=[QuoteForShell $::env(PATH)] [lindex [auto_execok g++] 0] $sanitizers"] {
        set file [open [file join $folder $name] w]
        # Not found again by a compiler's wrapper, such as ccache, that looks for the real one along PATH.
        puts $file "#!/bin/sh\nPATH='$::env(PATH)' exec $command \"\$@\""
        close $file
        file attributes [file join $folder $name] -permissions 0755
    }
}
