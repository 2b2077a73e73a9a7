# tour.tcl -- the main job of ./bootstrap run: a daemon on loopback with the services of the box, and requests to it.
#
# On a terminal there is the prompt of scott. Without one the tour of README.md is played: its commands are
# run and their results are compared with the lines there. The exit code is 1 when any line is not true.

namespace eval tour {
    variable Here [file dirname [file dirname [file dirname [file normalize [info script]]]]]
    variable Folder     ;# private runtime folder, removed at the end
    variable Daemon     ;# pipe of sormad
}

proc tour::begin {} {
    variable Folder [exec mktemp -d /tmp/sorma-tour-XXXXXX]
    variable Daemon
    set ::env(SORMA_RUNTIME_DIR) $Folder
    set file [open [file join $Folder tour.dict] w]
    puts $file "# recipes of the report of 1996, section 1.5"
    puts $file "foo.a   -breakfast -where kitchen -tempo presto"
    puts $file "foo.b   -breakfast -where garden -freshJuice -tempo adagio"
    puts $file "bar     -tea 1.5 -ice crushed -lemon 0.3"
    close $file
    set packages {}
    foreach class {nop echo foo bar host} {
        lappend packages sorma::service::$class
    }
    # In a session of its own: Ctrl-C is for what is typed. It ends with the tour, whatever ends that.
    set Daemon [open [list | setsid sormad -name robot -port 0 -until-eof -dict [file join $Folder tour.dict] \
        -package {*}$packages 2>@stderr] r+]
    gets $Daemon line
    if {![string match "ready robot *" $line]} {
        return -code error "the daemon did not start: $line"
    }
    return $line
}

proc tour::end {} {
    variable Folder
    variable Daemon
    if {[info exists Daemon]} {
        catch {exec sh -c {kill "$@"} kill -TERM {*}[pid $Daemon]}
        catch {close $Daemon}
    }
    file delete -force $Folder
}

# Run one command at global level. Returns what a terminal would show, and sets failedVar.
proc tour::run {command failedVar} {
    upvar 1 $failedVar failed
    set failed [catch {uplevel #0 $command} result]
    return $result
}

# The commands of README.md, or of another page, between ```tcl and ```, with what is expected after each: list of command, expected.
proc tour::steps {{page README.md}} {
    variable Here
    set file [open [file join $Here $page]]
    fconfigure $file -encoding utf-8
    set text [read $file]
    close $file
    set steps {}
    foreach {- block} [regexp -all -inline {```tcl\n(.*?)\n```} $text] {
        lappend steps {*}[session $block]
    }
    return $steps
}

# What was typed at the prompt "% " and what came: list of command, result.
proc tour::session text {
    set steps {}
    set command {}
    set came {}
    foreach line [split $text \n] {
        if {[string match "% *" $line]} {
            if {$command ne {}} {
                lappend steps $command [join $came \n]
            }
            set command [string range $line 2 end]
            set came {}
        } elseif {![info complete $command]} {
            append command \n $line
        } else {
            lappend came $line
        }
    }
    if {$command ne {}} {
        lappend steps $command [join $came \n]
    }
    return $steps
}

# Does what came match what is written, where "..." stands for anything?
proc tour::matches {came expected} {
    set pattern [string map {* \\* ? \\? \[ \\\[ \] \\\] \\ \\\\} $expected]
    return [string match [string map {... *} $pattern] $came]
}

proc tour::play {} {
    set wrong 0
    foreach {command expected} [steps] {
        set command [regsub {\s*;#[^\n]*$} $command {}]
        puts "% $command"
        set came [run $command failed]
        if {$came ne {}} {
            puts $came
        }
        if {![matches $came $expected]} {
            puts "==== README.md says instead:\n$expected"
            incr wrong
        }
    }
    if {$wrong > 0} {
        puts "$wrong lines of the tour are not true"
    }
    return [expr {$wrong > 0}]
}

proc tour::prompt line {
    puts "A daemon runs: $line"
    puts "Type requests or any Tcl; help says what else, Ctrl-D ends."
    puts "Try:  foo.a@robot CTRL -help    host@robot EXEC    find tea"
    package require sorma::scott
    # `exit` must stop the daemon, too.
    rename ::exit ::tour::Exit
    proc ::exit {{code 0}} {
        ::tour::end
        ::tour::Exit $code
    }
    return [sorma::scott::interact]
}

# The exit code: 0, or 1 when the daemon cannot be started or a line is not true.
proc tour::main {} {
    try {
        set line [begin]
        if {[catch {exec test -t 0 <@stdin}]} {
            return [play]
        }
        uplevel #0 {package require sorma}
        return [prompt $line]
    } on error message {
        puts stderr "tour: $message"
        return 1
    } finally {
        end
    }
}

if {[info script] eq $argv0} {
    exit [tour::main]
}
