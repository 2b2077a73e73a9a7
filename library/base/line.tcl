# line.tcl -- the one reader of lines that are typed: Tcl, and requests, in which '...' quotes as well. It knows no bus.
#
# A request is a command whose first word looks like the name of a service object and whose second is EXEC, CTRL or DBX.
# Its words may stand in '...', in which nothing is special. All else, "..." and {...}, $variables and [commands], is Tcl's own;
# inside of [...] and {...} there is only Tcl.

package provide sorma::line 1.0

namespace eval ::sorma::line {
    variable Name {^[A-Za-z][^\s\[\]$"{};\\']*$}       ;# what may be the name of a service object
}

# ::sorma::line::read --
#       Read a text.
# Arguments:
#       text    commands, on any number of lines
# Results:
#       A dict:
#       commands  list of commands, each a list of its words, each {FROM TO VALUE QUOTE}
#                 FROM, TO   where it begins, and the place behind its end
#                 VALUE      the word without its quotes; substitutions as they are written
#                 QUOTE      " { ' or empty
#       end       what the end of the text is in, as `context` returns it
proc ::sorma::line::read text {
    set commands {}
    set end [Scan $text 0 script {} commands]
    return [dict create commands $commands end $end]
}

# ::sorma::line::context --
#       What the end of a text is in.
# Results:
#       A dict; of a comment: comment, outer and open.
#       words     those before, of the same command
#       partial   the word there as far as it is typed, without quotes
#       from      where it begins
#       quote     the quote around it: empty, ", {, '
#       outer     the context around braces; empty when there is none
#       open      has to be closed there: empty, ", {, ', [ or a backslash
proc ::sorma::line::context text {
    return [dict get [read $text] end]
}

# ::sorma::line::translate --
#       The Tcl of what is typed: the same commands with each '...' as Tcl quotes it.
# Results:
#       Fails with SCOTT INCOMPLETE: a quote, brace or bracket is open; with SCOTT SYNTAX: something stands behind a '.
proc ::sorma::line::translate text {
    set content [read $text]
    set out {}
    set at 0
    foreach command [dict get $content commands] {
        foreach word $command {
            lassign $word from to value quote
            if {$quote eq "'"} {
                if {[regexp -start $to {\A[^\s;]+} $text junk]} {
                    return -code error -errorcode {SORMA SCOTT SYNTAX} "extra characters after close-quote: \"$junk\""
                }
                append out [string range $text $at $from-1] [list $value]
                set at $to
            }
        }
    }
    append out [string range $text $at end]
    if {[dict get $content end open] eq "'"} {
        return -code error -errorcode {SORMA SCOTT INCOMPLETE} "missing '"
    } elseif {![info complete $out]} {
        return -code error -errorcode {SORMA SCOTT INCOMPLETE} "missing close-quote, -brace or -bracket"
    }
    return $out
}

# ::sorma::line::isComplete -- is a text all there, right or wrong? Not when it ends in a backslash.
proc ::sorma::line::isComplete text {
    if {[EndsInBackslash $text]} {
        return 0
    }
    return [expr {![catch {translate $text} message options] || [dict get $options -errorcode] ne {SORMA SCOTT INCOMPLETE}}]
}

# ::sorma::line::head TEXT ?COUNT? -- the first words, two of them or COUNT, of the first command of a text.
proc ::sorma::line::head {text {count 2}} {
    return [Values [lrange [lindex [dict get [read $text] commands] 0] 0 $count-1]]
}

# ::sorma::line::place NAME -- of foo.a@robot: foo.a robot; of one of this process: foo.a self.
proc ::sorma::line::place name {
    set at [string first @ $name]
    return [if {$at < 0} {list $name self} else {list [string range $name 0 $at-1] [string range $name $at+1 end]}]
}

# ::sorma::line::isRequest -- are these the first two words of a request?
proc ::sorma::line::isRequest {name method} {
    variable Name
    return [expr {$method in {EXEC CTRL DBX} && [regexp $Name $name]}]
}

# ::sorma::line::words -- the words of a text as requests have them, in '...', "..." or plain; the last may be left open.
proc ::sorma::line::words text {
    set words {}
    foreach {- single double bare} [regexp -all -inline {'([^']*)'?|"([^"]*)"?|([^\s'"]+)} $text] {
        lappend words $single$double$bare
    }
    return $words
}

# ---- how it reads ----

# Read commands from a place on. It returns the context at the end of the text, or {closed PLACE} at the ] that closes a bracket.
# The kind is script, bracket or brace (the inside of one that is not closed). The variable of commandsVar gets the commands.
proc ::sorma::line::Scan {text at kind outer {commandsVar {}}} {
    if {$commandsVar ne {}} {
        upvar 1 $commandsVar commands
    }
    set commands {}
    set words {}
    set end [string length $text]
    set open [dict get {script {} bracket \[ brace \{} $kind]
    while 1 {
        regexp -start $at -indices {\A(?:[ \t\r\f\v]|\\\n)*} $text blank
        set at [expr {[lindex $blank 1] + 1}]
        set c [string index $text $at]
        if {$at >= $end || $c in [list \n ";"] || $c eq "\]" && $kind eq "bracket"} {
            if {[llength $words] > 0} {
                lappend commands $words
            }
            if {$at >= $end} {
                return [dict create words [Values $words] partial {} from $end quote {} outer $outer open $open]
            }
            if {$c eq "\]"} {
                return [list closed [expr {$at + 1}]]
            }
            set words {}
            incr at
            continue
        }
        if {$c eq "#" && [llength $words] == 0} {
            # Up to the end of the line, unless a backslash stands there.
            regexp -start $at -indices {\A(?:[^\n\\]|\\.|\\\n)*\\?} $text comment
            set at [expr {[lindex $comment 1] + 1}]
            if {$at >= $end} {
                if {$open eq {} && [EndsInBackslash $text]} {
                    set open \\
                }
                return [dict create comment 1 outer $outer open $open]
            }
            continue
        }
        set read [Word $text $at $words $kind $outer $open]
        if {[dict exists $read open]} {
            if {[dict exists $read word]} {
                lappend words [dict get $read word]
                dict unset read word
            }
            lappend commands $words
            return $read
        }
        set to [dict get $read to]
        if {[dict get $read value] eq "*" && [dict get $read quote] eq "\{" && [string index $text $to] ni [list { } \t \n ";" {}]} {
            set at $to      ;# {*}
            continue
        }
        lappend words [list $at $to [dict get $read value] [dict get $read quote]]
        set at $to
    }
}

proc ::sorma::line::Values words {
    return [lmap word $words {lindex $word 2}]
}

proc ::sorma::line::EndsInBackslash text {
    return [regexp {(?:^|[^\\])(?:\\\\)*\\\n?$} $text]
}

# One word that begins at a place: a dict of to, value and quote; or the context, when the text ends in it.
proc ::sorma::line::Word {text at words kind outer open} {
    set c [string index $text $at]
    set before [Values $words]
    set here [dict create words $before outer $outer open $open]
    if {$c eq "\{"} {
        set close [Brace $text $at]
        if {$close < 0} {
            dict set here partial [string range $text $at+1 end]
            dict set here from [expr {$at + 1}]
            dict set here quote "\{"
            return [Scan $text [expr {$at + 1}] brace $here]
        }
        return [dict create value [string range $text $at+1 $close-1] to [expr {$close + 1}] quote "\{"]
    }
    if {$c eq "'" && $kind eq "script" && [isRequest [lindex $before 0] [lindex $before 1]]} {
        set close [string first ' $text $at+1]
        if {$close < 0} {
            return [dict merge $here [dict create partial [string range $text $at+1 end] from [expr {$at + 1}] quote ' open ']]
        }
        return [dict create value [string range $text $at+1 $close-1] to [expr {$close + 1}] quote ']
    }
    return [Substituted $text $at $kind $here]
}

# The same for a word without braces, or in "...". What is substituted in it stays as it is written.
proc ::sorma::line::Substituted {text at kind here} {
    set end [string length $text]
    set quote {}
    if {[string index $text $at] eq "\""} {
        set quote \"
        incr at
    }
    set from $at
    set value {}
    while {$at < $end} {
        # Ordinary characters, many at once.
        if {[regexp -start $at {\A[^][\s;"\\$]+} $text plain]} {
            append value $plain
            incr at [string length $plain]
            continue
        }
        set c [string index $text $at]
        if {$quote eq {} && ($c in [list { } \t \n \r \f \v ";"] || $c eq "\]" && $kind eq "bracket")} {
            return [dict create value $value to $at quote {}]
        }
        if {$quote ne {} && $c eq $quote} {
            return [dict create value $value to [expr {$at + 1}] quote $quote]
        }
        switch -- $c {
            \\ {
                if {$at + 1 == $end} {
                    if {[dict get $here open] eq {} && $quote eq {}} {
                        dict set here open \\
                    }
                    append value \\
                    incr at
                    continue
                }
                if {[string index $text $at+1] eq "\n" && $quote eq {}} {
                    return [dict create value $value to $at quote {}]
                }
                append value [subst -nocommands -novariables [string range $text $at $at+1]]
                incr at 2
            }
            \[ {
                set inside [Scan $text [expr {$at + 1}] bracket {}]
                if {[lindex $inside 0] ne "closed"} {
                    return $inside
                }
                append value [string range $text $at [lindex $inside 1]-1]
                set at [lindex $inside 1]
            }
            default {
                # Of ${a b} and $a(b c) nothing ends the word.
                if {![regexp -start $at {\A\$(?:\{[^\}]*\}|[\w:]*\([^]["()]*\))} $text variable]} {
                    set variable $c
                }
                append value $variable
                incr at [string length $variable]
            }
        }
    }
    if {$quote ne {}} {
        dict set here open $quote
    }
    dict set here word [list $from $end $value $quote]
    return [dict merge $here [dict create partial $value from $from quote $quote]]
}

# Where the brace ends that opens there; -1: nowhere.
proc ::sorma::line::Brace {text at} {
    set depth 0
    while {[regexp -start $at -indices {[\\{}]} $text found]} {
        set at [lindex $found 0]
        switch -- [string index $text $at] {
            \\ { incr at }
            \{ { incr depth }
            \} {
                if {[incr depth -1] == 0} {
                    return $at
                }
            }
        }
        incr at
    }
    return -1
}
