# record.tcl -- lines typed to scott, kept as a script for doing it again and as a tcltest suite.
#
# The suite holds one test for each command, in order. Before an object is used for the first time, its options are set
# to their values of that time. So a session that tunes something can be played again. Compared is what ought to be the
# same each time:
#
#     NAME EXEC                       code, which parts, how many numbers, and the text apart from the numbers in it
#     NAME CTRL; configure, cget, info    everything; of -dump and -selftest all but the numbers
#     NAME DBX, and commands that look around (ls, top, ...)   that they succeed
#     any other Tcl                   the result apart from numbers
#     an error                        the first three words of its code, and the message apart from numbers
#
# A recording made with -exact compares everything but DBX and what looks around.

package require sorma
package require sorma::line
package require sorma::options
package require sorma::text
package provide sorma::record 1.0
namespace eval ::sorma::record {
    # dict while something is recorded: script and suite (files), exact, and steps, a list of dicts:
    #   line   as typed     script   the Tcl of it     code, result, errorcode
    #   before   list of NAME and its options and values
    variable Recording {}
    variable Before {}      ;# NAME option value ...: of the command that is about to be executed
    variable Unrecorded {record trail source history exit}
}

# ::sorma::record::start --
#       Record from now on. Both files are written again after each command, so that they are complete whatever happens.
# Arguments:
#       file    the script; the suite has the same name but for its end, .test
#       args    -exact
# Results:
#       A sentence that names the files.
proc ::sorma::record::start {file args} {
    variable Recording
    if {$Recording ne {}} {
        return -code error -errorcode {SORMA RECORD BUSY} "[dict get $Recording script] is being recorded; record stop ends that"
    }
    set exact [dict get [::sorma::options::parse {-exact flag} $args] -exact]
    set script [file normalize $file]
    if {[file extension $script] eq ".test"} {
        set script [file rootname $script].tcl
    }
    set recording [dict create script $script suite [file rootname $script].test exact $exact steps {}]
    Write $recording
    set Recording $recording
    return "recording [dict get $recording script] and [file tail [dict get $recording suite]]"
}

# ::sorma::record::stop --
#       End the recording. Returns a sentence that says how to run it.
proc ::sorma::record::stop {} {
    variable Recording
    if {$Recording eq {}} {
        return -code error -errorcode {SORMA RECORD NONE} "nothing is being recorded; record FILE begins"
    }
    set recording $Recording
    set Recording {}
    set n [llength [dict get $recording steps]]
    return "$n command[expr {$n == 1 ? {} : {s}}]; again: scott [dict get $recording script]; as a test: scott [dict get $recording suite]"
}

proc ::sorma::record::active {} {
    variable Recording
    return [expr {$Recording ne {}}]
}

# ::sorma::record::before --
#       To be called before a command is executed: notes the options of an object that is mentioned for the first time.
#       In a coroutine only that one waits, and no longer than 2 s.
proc ::sorma::record::before script {
    variable Recording
    variable Before
    set Before {}
    lassign [Head $script] name method
    if {$Recording eq {} || $method ni {EXEC CTRL DBX exec configure cget info} || $name in {dict sorm sorma::so::dict}} {
        return
    }
    foreach step [dict get $Recording steps] {
        if {[lindex [dict get $step before] 0] eq $name} {
            return
        }
    }
    catch {
        set values {}
        foreach option [[::sorma::async -timeout 2000 $name configure] take] {
            lappend values [lindex $option 0] [lindex $option 5]
        }
        set Before [list $name {*}$values]
    }
}

# ::sorma::record::note --
#       To be called after a command was executed.
# Arguments:
#       line    as it was typed
#       script  the Tcl of it
#       code, result, options   of catch
proc ::sorma::record::note {line script code result options} {
    variable Recording
    variable Before
    variable Unrecorded
    if {$Recording eq {} || [lindex [Head $script] 0] in $Unrecorded} {
        return
    }
    set errorcode [expr {$code == 1 ? [dict get $options -errorcode] : {}}]
    if {$errorcode eq {SORMA COMM CANCELLED} || [lrange $errorcode 0 1] eq {TCL CANCEL}} {
        return      ;# given up by hand
    }
    dict lappend Recording steps [dict create line [string trim $line] script [string trim $script] code $code result $result \
        errorcode $errorcode before $Before]
    set Before {}
    try {
        Write $Recording
    } on error message {
        set Recording {}
        return -code error -errorcode {SORMA RECORD FILE} "the recording has ended: $message"
    }
}

# The first two words of what a script executes; of "set x [foo EXEC]" those inside of the brackets.
proc ::sorma::record::Head script {
    regexp {^\s*set\s+\S+\s+\[(.*)$} $script -> script
    return [::sorma::line::head $script]
}

# ---- the two files ----

proc ::sorma::record::Write recording {
    ::sorma::text::writeFile [dict get $recording script] [Script $recording]
    ::sorma::text::writeFile [dict get $recording suite] [Suite $recording]
}

proc ::sorma::record::Script recording {
    set out "# [file tail [dict get $recording script]] -- recorded by scott, [clock format [clock seconds] -format {%Y-%m-%d %H:%M}].\n"
    append out "# To do it again: scott [file tail [dict get $recording script]]\n\n"
    append out "package require sorma::record\nsorma::record::prepare\n\n"
    foreach step [dict get $recording steps] {
        if {[dict get $step code] == 1} {
            append out "catch [Braced [dict get $step script]]    ;# [Comment [dict get $step result]]\n"
        } else {
            append out [dict get $step script] \n
        }
    }
    return $out
}

proc ::sorma::record::Suite recording {
    set name [regsub -all {[^\w.]} [file rootname [file tail [dict get $recording suite]]] _]
    set out "# [file tail [dict get $recording suite]] -- recorded by scott, [clock format [clock seconds] -format {%Y-%m-%d %H:%M}].\n"
    append out "# To check that all is as it was then: scott [file tail [dict get $recording suite]]\n"
    append out "# -match says what is compared: exact, same (but for the trail), numbers (all but the numbers),\n# reply (code, parts, counts and text, not the numbers).\n\n"
    append out "package require tcltest 2.3\nnamespace import -force ::tcltest::*\npackage require sorma::record\n"
    append out "sorma::record::prepare\nsorma::record::matches\n"
    set n 0
    foreach step [dict get $recording steps] {
        dict with step {
            append out "\ntest $name-1.[incr n] [Braced [regsub -all {\s*\n\s*} $line { }]]"
            if {[llength $before] > 1} {
                append out " -setup {\n    sorma::record::restore $before\n}"
            }
            append out " -body [Braced "\n    $script\n"]"
            if {$code == 1} {
                append out " -returnCodes error -errorCode [list [CodePattern $errorcode]]"
            }
            append out " [Expectation $step [dict get $recording exact]]\n"
        }
    }
    append out "\nsorma::record::finish\n"
    return $out
}

# The result that a test expects.
proc ::sorma::record::Expectation {step exact} {
    set result [dict get $step result]
    set script [dict get $step script]
    lassign [Head $script] name method
    set plain [::sorma::line::isRequest {*}[lrange [list {*}[::sorma::line::head $script] {} {}] 0 1]]
    if {$name in {clock pid} || [info commands ::sorma::inspect::[::sorma::text::escape $name]] ne {}} {
        return "-match glob -result *"
    }
    if {[dict get $step code] == 1} {
        set match [expr {$exact ? "exact" : "numbers"}]
    } elseif {$plain && $method eq "DBX"} {
        return "-match glob -result [list [GlobQuote [lrange $result 0 1]]*]"
    } elseif {$exact} {
        set match exact
    } elseif {$plain && $method eq "EXEC"} {
        set match reply
    } elseif {$method in {CTRL configure cget info} && ![regexp {\s-(dump|selftest)\M} $script]} {
        set match exact
    } else {
        set match numbers
    }
    if {$match eq "exact" && $plain && [WithoutTrail $result] ne $result} {
        set match same
    }
    return "[expr {$match eq {exact} ? {} : "-match $match "}]-result [list [WithoutTrail $result]]"
}

# The trail of a reply has times in it; that there were warnings is told by the code.
proc ::sorma::record::WithoutTrail result {
    if {[string match "RET *" $result] && ![catch {llength $result}] && [lindex $result end-1] eq "TDBX"} {
        return [lrange $result 0 end-2]
    }
    return $result
}

# The first three words of an error code as they are written; all of it when it is not written as Tcl writes a list.
proc ::sorma::record::CodePattern errorcode {
    set first [lrange $errorcode 0 2]
    return [GlobQuote [expr {[string first $first $errorcode] == 0 ? $first : $errorcode}]]*
}

proc ::sorma::record::GlobQuote text {
    return [string map {* \\* ? \\? \[ \\\[ \] \\\] \\ \\\\} $text]
}

# The first line of a text, for a comment. It may come from anywhere, and must not swallow the next line with a backslash.
proc ::sorma::record::Comment text {
    return [string map {\\ /} [regsub -all {[[:cntrl:]]} [lindex [split $text \n] 0] { }]]
}

# As one word, as readable as it can be.
proc ::sorma::record::Braced text {
    set braced "{$text}"
    if {[info complete $braced] && ![catch {llength $braced} n] && $n == 1 && [string index $text end] ne "\\"} {
        return $braced
    }
    return [list $text]
}

# ---- for a recording that is run ----

# A recording may use the commands of scott.
proc ::sorma::record::prepare {} {
    package require sorma::shell
    ::sorma::shell::prepare
}

proc ::sorma::record::matches {} {
    ::tcltest::customMatch numbers ::sorma::record::SameButNumbers
    ::tcltest::customMatch reply ::sorma::record::SameReply
    ::tcltest::customMatch same ::sorma::record::Same
}

# Print the sum, and end the program with 1 when a test has failed.
proc ::sorma::record::finish {} {
    set failed $::tcltest::numTests(Failed)
    uplevel #0 ::tcltest::cleanupTests
    if {$failed > 0} {
        exit 1
    }
}

# Give an object the options that it had. Those that are as they should be are not touched: some cannot be changed.
proc ::sorma::record::restore {name args} {
    set change {}
    foreach {option value} $args {
        if {[$name cget $option] ne $value} {
            lappend change $option $value
        }
    }
    if {$change ne {}} {
        $name configure {*}$change
    }
}

proc ::sorma::record::Masked text {
    return [regsub -all {[-+]?(0x[[:xdigit:]]+|\d[\d.]*(e[-+]?\d+)?|\m(nan|inf)\M)} $text #]
}

proc ::sorma::record::SameButNumbers {expected actual} {
    return [string equal [Masked $expected] [Masked $actual]]
}

proc ::sorma::record::Same {expected actual} {
    return [string equal $expected [WithoutTrail $actual]]
}

proc ::sorma::record::SameReply {expected actual} {
    if {[catch {Shape $expected} expected] || [catch {Shape [WithoutTrail $actual]} actual]} {
        return 0
    }
    return [string equal $expected $actual]
}

# A reply without what may differ each time.
proc ::sorma::record::Shape reply {
    set shape [lrange $reply 0 1]
    set at 2
    while {$at < [llength $reply]} {
        set part [lindex $reply $at]
        set value [lindex $reply $at+1]
        incr at 2
        switch $part {
            FMSG - IMSG {
                lappend shape $part $value
                incr at $value
            }
            TMSG { lappend shape $part [Masked $value] }
            default { lappend shape $part }
        }
    }
    return $shape
}
