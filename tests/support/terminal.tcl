# terminal.tcl -- a program in a pseudo-terminal of its own, with a screen that can be looked at. Needs the program pty.
#
# terminal open ?-columns n? ?-rows n? ?-term name? command ...      a terminal at a time
# terminal type TEXT                  as if typed; "\x03" is Ctrl-C
# terminal screen                     list of the screen's rows, without empty ones at the end
# terminal row N                      one of them
# terminal until CONDITION            reads what comes until the expression is true; fails with the screen in its message
# terminal shows TEXT                 the same until the text stands somewhere on the screen
# terminal prompts PROMPT             the same until, after what was typed last, the last row is a prompt and nothing else
# terminal hinted                     the same until there is a hint below the line, and the cursor is back at the line's end. Only then Ctrl-C:
#                                     at an interrupt the kernel drops what a terminal has not shown yet
# terminal resize COLUMNS ROWS
# terminal settings WORD ...          what stty says, or does
# terminal pid                        of the program
# terminal end                        waits until the program ends; its exit code
# terminal hangup                     closes the terminal, as a window does
# terminal kill                       ends the program
#
# The screen understands what libedit says to an xterm: what it does not know is an error, not guessed.

namespace eval terminal {
    variable Pipe {}        ;# of pty
    variable Pid            ;# of the program
    variable Slave          ;# its device
    variable Rows           ;# list of rows: each a string of exactly Columns characters
    variable Columns
    variable Height
    variable X              ;# cursor; X may be Columns: the next character goes to the next row
    variable Y
    variable Rest {}        ;# the beginning of a sequence whose end has not come
    variable Ended 0
    variable Bells 0
    variable Came 0         ;# has anything come since the last thing typed?
    variable Returns 0      ;# lines typed last, less the line feeds that came since
    namespace export open type screen row until shows prompts hinted resize settings pid end hangup kill
    namespace ensemble create
}

proc terminal::available {} {
    return [expr {[::info exists ::env(SORMA_BUILD)] && [file executable [file join $::env(SORMA_BUILD) pty]]}]
}

proc terminal::open args {
    variable Pipe
    variable Pid
    variable Slave
    variable Rows
    variable Columns 80
    variable Height 24
    variable X 0
    variable Y 0
    variable Rest {}
    variable Ended 0
    variable Bells 0
    variable Returns 0
    set term xterm
    while {[string match -* [lindex $args 0]]} {
        set args [lassign $args option value]
        switch -- $option {
            -columns { set Columns $value }
            -rows { set Height $value }
            -term { set term $value }
        }
    }
    set Rows [lrepeat $Height [string repeat " " $Columns]]
    set before [array get ::env TERM]
    set ::env(TERM) $term
    set Pipe [::open [list | [file join $::env(SORMA_BUILD) pty] $Height $Columns {*}$args 2>@stderr] r+]
    fconfigure $Pipe -encoding utf-8 -translation lf -buffering none
    catch {fconfigure $Pipe -profile replace}       ;# Tcl 9 is strict otherwise
    lassign [gets $Pipe] Pid Slave
    fconfigure $Pipe -blocking 0
    unset ::env(TERM)
    array set ::env $before
    return
}

proc terminal::type text {
    variable Pipe
    variable Came 0
    variable Returns [regexp -all \r $text]
    puts -nonewline $Pipe $text
}

proc terminal::screen {} {
    variable Rows
    return [split [string trimright [join [lmap row $Rows {string trimright $row}] \n] \n] \n]
}

proc terminal::row n {
    return [lindex [screen] $n]
}

proc terminal::until {condition {bound 60}} {
    variable Ended
    set end [expr {[clock seconds] + $bound}]
    while {![uplevel 1 [list expr $condition]]} {
        if {$Ended || [clock seconds] > $end} {
            return -code error "[expr {$Ended ? "the program has ended" : "waited $bound s in vain"}]: $condition\nscreen:\n[join [screen] \n]"
        }
        Take 1
    }
}

proc terminal::shows text {
    uplevel 1 [list terminal::until "\[string first [list $text] \[join \[terminal::screen\] \\n\]\] >= 0"]
}

proc terminal::prompts prompt {
    # The first bytes may belong to the prompt before.
    uplevel 1 [list terminal::until "\$::terminal::Came && \$::terminal::Returns <= 0 && \[terminal::row end\] eq {$prompt}"]
}

proc terminal::hinted {} {
    until {[screen] ne {} && $::terminal::Y == [llength [screen]] - 2
        && $::terminal::X == [string length [lindex [screen] $::terminal::Y]]}
}

proc terminal::resize {columns rows} {
    variable Id
    variable Rows
    variable Columns
    variable Height
    variable X
    variable Y
    set Rows [lmap row [lrange $Rows 0 $rows-1] {string range [format %-${columns}s $row] 0 $columns-1}]
    while {[llength $Rows] < $rows} {
        lappend Rows [string repeat " " $columns]
    }
    set Columns $columns
    set Height $rows
    set X [expr {min($X, $columns - 1)}]
    set Y [expr {min($Y, $rows - 1)}]
    settings rows $rows columns $columns
}

proc terminal::settings args {
    variable Slave
    return [exec stty -F $Slave {*}$args]
}

proc terminal::pid {} {
    variable Pid
    return $Pid
}

proc terminal::end {} {
    variable Ended
    set bound [expr {[clock seconds] + 60}]
    while {!$Ended && [clock seconds] < $bound} {
        Take 1
    }
    if {!$Ended} {
        return -code error "the program does not end\nscreen:\n[join [screen] \n]"
    }
    return [hangup]
}

# How it ended: the exit code, or what Tcl says of a signal.
proc terminal::hangup {} {
    variable Pipe
    fconfigure $Pipe -blocking 1
    set failed [catch {close $Pipe} message options]
    set Pipe {}
    if {!$failed} {
        return 0
    }
    lassign [dict get $options -errorcode] how - code
    return [expr {$how eq "CHILDSTATUS" ? $code : $message}]
}

# What is killed does not write what gcov has counted. So in a build for `make coverage` a program that is at its prompt may end by itself.
proc terminal::kill {} {
    variable Pipe
    variable Pid
    variable Ended
    if {$Pipe ne {}} {
        if {!$Ended && [glob -nocomplain -directory [file join $::env(SORMA_BUILD) generic edit .libs] *.gcno] ne {}} {
            catch {
                type "\x03\x04"
                for {set try 0} {$try < 3 && !$Ended} {incr try} {
                    Take 1
                }
            }
        }
        catch {exec sh -c {kill "$@"} kill -KILL $Pid}
        hangup
    }
}

# Read what has come, waiting for it for so many seconds.
proc terminal::Take seconds {
    variable Pipe
    variable Ended
    variable Waits 1
    fileevent $Pipe readable {set ::terminal::Waits 0}
    set timer [after [expr {1000 * $seconds}] {set ::terminal::Waits 0}]
    vwait ::terminal::Waits
    after cancel $timer
    fileevent $Pipe readable {}
    set came [read $Pipe]
    if {$came ne {}} {
        variable Came 1
    } elseif {[eof $Pipe]} {
        set Ended 1
    }
    Show $came
}

# ---- the screen ----

proc terminal::Show bytes {
    variable Rest
    variable X
    variable Y
    variable Columns
    variable Height
    variable Rows
    variable Bells
    set text $Rest$bytes
    set Rest {}
    set at 0
    while {$at < [string length $text]} {
        set c [string index $text $at]
        switch -- $c {
            \r { set X 0 }
            \n { Down }
            \b { set X [expr {max(0, min($X, $Columns - 1) - 1)}] }
            \a { incr Bells }
            \t { set X [expr {min($Columns - 1, ($X / 8 + 1) * 8)}] }
            \033 {
                if {![regexp -start $at {\A\033\[([0-9;?]*)([@-~])} $text all numbers command]} {
                    if {![regexp -start $at {\A\033(\[[0-9;?]*)?$} $text]} {
                        return -code error "a sequence that this screen does not know: [string range $text $at $at+10]"
                    }
                    set Rest [string range $text $at end]
                    return
                }
                Command $command $numbers
                incr at [string length $all]
                continue
            }
            default {
                if {$X == $Columns} {
                    set X 0
                    Down
                }
                lset Rows $Y [string replace [lindex $Rows $Y] $X $X $c]
                incr X
            }
        }
        incr at
    }
}

proc terminal::Down {} {
    variable Y
    incr ::terminal::Returns -1
    variable Rows
    variable Height
    variable Columns
    if {$Y < $Height - 1} {
        incr Y
    } else {
        set Rows [list {*}[lrange $Rows 1 end] [string repeat " " $Columns]]
    }
}

proc terminal::Command {command numbers} {
    variable X
    variable Y
    variable Rows
    variable Columns
    variable Height
    if {$command in {m h l}} {
        return      ;# colours, and modes that do not move anything (insert mode is not used by libedit for an xterm)
    }
    set n [expr {[lindex [split $numbers ";"] 0] in {{} 0} ? 1 : [lindex [split $numbers ";"] 0]}]
    set row [lindex $Rows $Y]
    set column [expr {min($X, $Columns - 1)}]
    switch -- $command {
        A { set Y [expr {max(0, $Y - $n)}] }
        B { set Y [expr {min($Height - 1, $Y + $n)}] }
        C { set X [expr {min($Columns - 1, $X + $n)}] }
        D { set X [expr {max(0, $column - $n)}] }
        G { set X [expr {min($Columns, $n) - 1}] }
        H {
            lassign [split $numbers ";"] y x
            set Y [expr {$y eq {} ? 0 : $y - 1}]
            set X [expr {$x eq {} ? 0 : $x - 1}]
        }
        K { set row [Blank [string range $row 0 $column-1]] }
        J {
            if {$numbers eq "2"} {
                set Rows [lrepeat $Height [string repeat " " $Columns]]
                return
            }
            set row [Blank [string range $row 0 $column-1]]
            for {set y [expr {$Y + 1}]} {$y < $Height} {incr y} {
                lset Rows $y [string repeat " " $Columns]
            }
        }
        P { set row [Blank [string replace $row $column [expr {$column + $n - 1}]]] }
        @ { set row [string range [string range $row 0 $column-1][string repeat " " $n][string range $row $column end] 0 $Columns-1] }
        default { return -code error "a command that this screen does not know: $numbers$command" }
    }
    if {$command in {K J P @}} {
        lset Rows $Y $row
    }
}

proc terminal::Blank row {
    variable Columns
    return [format %-${Columns}s $row]
}
