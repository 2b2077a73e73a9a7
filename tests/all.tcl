# all.tcl ?-jobs N? ?-until TIME? ?SUITE ...? -- runs every suite in a process of its own, several at a time, and sums up.
#
# TIME, in seconds as `date +%s` gives them: no suite begins after it. Those that are left out are told, and each counts as skipped.
# Suites run in the order in which they are named.
# Each suite gets its own folder for temporary files, its own runtime folder for daemons, and a mark in its environment,
# by which processes that it leaves behind are found. What is left behind, a crash, a suite that runs no test and one
# that takes longer than its bound all count as failures. Last line: N passed, N failed, N skipped.

set here [file dirname [file normalize [info script]]]
set bound 600000    ;# ms for one suite
set given [dict create -jobs [expr {[catch {exec nproc} n] ? 2 : $n}] -until {}]
set wanted {}
for {set i 0} {$i < [llength $argv]} {incr i} {
    set word [lindex $argv $i]
    if {![dict exists $given $word]} {
        lappend wanted $word
    } elseif {![string is wideinteger -strict [lindex $argv [incr i]]]} {
        puts "$word expects a whole number, got \"[lindex $argv $i]\""
        exit 2
    } else {
        dict set given $word [lindex $argv $i]
    }
}
set jobs [dict get $given -jobs]
set until [dict get $given -until]
array set total {passed 0 failed 0 skipped 0}
set failures {}

proc start suite {
    global here running env bound
    set name [file rootname [file tail $suite]]
    set folder [exec mktemp -d /tmp/sorma-test-XXXXXX]
    file mkdir [file join $folder run] [file join $folder tmp]
    file attributes [file join $folder run] -permissions 0700
    set mark SORMA_SUITE=$name-[pid]
    # setsid: a suite that hangs is ended together with what it started.
    set pipe [open [list | env $mark SORMA_RUNTIME_DIR=$folder/run TMPDIR=$folder/tmp HOME=$folder/tmp \
        setsid [info nameofexecutable] [file join $here run.tcl] $suite $folder/tmp 2>@1] r]
    fconfigure $pipe -blocking 0 -encoding utf-8
    set running($pipe) [dict create name $name folder $folder mark $mark output {} begin [clock milliseconds] \
        timer [after $bound [list overdue $pipe]]]
    fileevent $pipe readable [list take $pipe]
}

proc overdue pipe {
    global running bound
    dict append running($pipe) output "\n==== still running after $bound ms: ended\n"
    foreach pid [marked [dict get $running($pipe) mark]] {
        catch {exec sh -c {kill "$@"} kill -KILL $pid}
    }
}

proc take pipe {
    global running
    dict append running($pipe) output [read $pipe]
    if {[eof $pipe]} {
        finish $pipe
    }
}

# Processes that carry the mark of a suite in their environment.
proc marked mark {
    set found {}
    foreach folder [glob -nocomplain /proc/\[0-9\]*] {
        if {![catch {open $folder/environ rb} f]} {
            catch {
                if {[string first $mark\0 [read $f]] >= 0} {
                    lappend found [file tail $folder]
                }
            }
            close $f
        }
    }
    return $found
}

proc finish pipe {
    global running total failures done
    set suite $running($pipe)
    unset running($pipe)
    after cancel [dict get $suite timer]
    fconfigure $pipe -blocking 1
    set crash [catch {close $pipe} message options]
    set name [dict get $suite name]
    set output [dict get $suite output]
    set failed 0
    set problems {}
    if {[regexp {Total\s+(\d+)\s+Passed\s+(\d+)\s+Skipped\s+(\d+)\s+Failed\s+(\d+)} $output -> all passed skipped failed]} {
        incr total(passed) $passed
        incr total(skipped) $skipped
        if {$all == 0} {
            lappend problems "it ran no test"
        }
    } else {
        set passed 0
        set skipped 0
        lappend problems "it ended without its sum"
    }
    if {$crash && $failed == 0} {
        lappend problems "it ended with an error: $message"
    }
    # One that is just ending is none that was left behind.
    set end [expr {[clock milliseconds] + 2000}]
    while {[llength [marked [dict get $suite mark]]] > 0 && [clock milliseconds] < $end} {
        after 10
    }
    set left {}
    foreach pid [marked [dict get $suite mark]] {
        catch {lappend left "$pid [string map [list \0 { }] [exec cat /proc/$pid/cmdline]]"}
        catch {exec sh -c {kill "$@"} kill -KILL $pid}
    }
    if {[llength $left] > 0} {
        lappend problems "it left processes behind: [join $left {; }]"
    }
    set files [glob -nocomplain -tails -directory [dict get $suite folder] run/* tmp/*]
    if {[llength $files] > 0} {
        lappend problems "it left files behind: $files"
    }
    file delete -force [dict get $suite folder]
    incr failed [llength $problems]
    incr total(failed) $failed
    puts [format "%-24s %4d passed %3d failed %3d skipped %7.1f s" $name $passed $failed $skipped \
        [expr {([clock milliseconds] - [dict get $suite begin]) / 1000.0}]]
    if {$failed > 0} {
        lappend failures $name
        puts [string trim $output]
        foreach problem $problems {
            puts "==== $name: $problem"
        }
    }
    flush stdout
    next
}

proc next {} {
    global queue alone running jobs until total done
    if {$until ne {} && [clock seconds] >= $until && [llength $queue] + [llength $alone] > 0} {
        set left [concat $queue $alone]
        puts "left out, since the time is over: [lmap suite $left {file rootname [file tail $suite]}]"
        incr total(skipped) [llength $left]
        set queue {}
        set alone {}
    }
    while {[llength $queue] > 0 && [array size running] < $jobs} {
        set queue [lassign $queue suite]
        start $suite
    }
    if {[array size running] == 0 && [llength $alone] > 0} {
        set alone [lassign $alone suite]
        start $suite
    }
    if {[array size running] == 0} {
        set done 1
    }
}

# Libtool links modules anew in the build tree when it installs: nobody may load one meanwhile.
set queue {}
set alone {}
set there [lmap suite [lsort [glob -tails -directory $here *.test]] {file rootname $suite}]
foreach name [expr {[llength $wanted] > 0 ? $wanted : $there}] {
    if {$name ni $there} {
        puts "no suite \"$name\"; there are: $there"
        exit 2
    }
    lappend [expr {$name eq "install" ? "alone" : "queue"}] [file join $here $name.test]
}
puts "Tcl [info patchlevel]"
array set running {}
next
if {![info exists done]} {
    vwait done
}
if {[llength $failures] > 0} {
    puts "suites with failures: $failures"
}
puts "$total(passed) passed, $total(failed) failed, $total(skipped) skipped"
exit [expr {$total(failed) > 0}]
