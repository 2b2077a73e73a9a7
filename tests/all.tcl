# all.tcl ?-jobs N? ?-until TIME? ?-bound SECONDS? ?-but SUITE,...? ?SUITE ...? -- runs every suite in a process of its own, several at a time, and sums up.
#
# A suite that takes longer than SECONDS (600 unless given) is ended. -but names suites that do not run, also by patterns such as neo*.
# TIME, in seconds as `date +%s` gives them: no suite begins after it. Those that are left out are told, and each counts as failed, or with
# SORMA_QUICK=1 as skipped. Suites run in the order in which they are named, else those first that take longest.
# Each suite gets its own folder for temporary files and its own runtime folder for daemons. A mark in its environment finds the
# processes that it leaves behind. What is left behind, a crash, a suite that runs no test and one
# that takes longer than its bound all count as failures. The end lists which tests were skipped and why: CONTRIBUTING.md has the reasons that
# there may be. With SORMA_REQUIRE=all a test that is skipped for no such reason is a failure, too. Last line: N passed, N failed, N skipped.

set here [file dirname [file normalize [info script]]]
set given [dict create -jobs [expr {[catch {exec nproc} n] ? 2 : $n + 1}] -until {} -bound 600 -but {}]     ;# suites wait most of the time
set wanted {}
for {set i 0} {$i < [llength $argv]} {incr i} {
    set word [lindex $argv $i]
    if {![dict exists $given $word]} {
        lappend wanted $word
    } elseif {$word eq "-but"} {
        dict set given $word [split [lindex $argv [incr i]] ,]
    } elseif {![string is wideinteger -strict [lindex $argv [incr i]]]} {
        puts "$word expects a whole number, got \"[lindex $argv $i]\""
        exit 2
    } else {
        dict set given $word [lindex $argv $i]
    }
}
set jobs [dict get $given -jobs]
set until [dict get $given -until]
set bound [expr {[dict get $given -bound] * 1000}]      ;# ms for one suite
array set total {passed 0 failed 0 skipped 0}
set failures {}
set times {}        ;# list of {suite seconds}
set skips {}        ;# dict: reason -> list of {suite number}
set strict [expr {[info exists env(SORMA_REQUIRE)] && $env(SORMA_REQUIRE) eq "all"}]
set quick [expr {[info exists env(SORMA_QUICK)] && $env(SORMA_QUICK) eq "1"}]

# The reasons for which tests may be skipped. The table of CONTRIBUTING.md has a row for each: a reason, `an expression` that says when it
# holds, and the `constraints` of tests. Returns a dict: constraint -> {reason holds}.
proc reasons file {
    set f [open $file]
    fconfigure $f -encoding utf-8
    set found {}
    foreach line [split [read $f] \n] {
        if {[regexp {^\| ([^|]+) \| `([^|]+)` \| ((?:`[^`|]+` ?)+)\|$} $line -> reason when constraints]} {
            foreach {- constraint} [regexp -all -inline {`([^`]+)`} $constraints] {
                dict set found $constraint [list $reason [uplevel #0 [list expr $when]]]
            }
        }
    }
    close $f
    return $found
}

# Why tests of a suite were skipped, from what tcltest says at its end. Returns what is wrong with that.
proc whySkipped {name output} {
    global skips permitted
    set problems {}
    regexp {Number of tests skipped for each constraint:((?:\n\t\d+\t[^\n]*)*)} $output -> lines
    if {[info exists lines]} {
        foreach {- number constraint} [regexp -all -inline -line {^\t(\d+)\t(.*)$} $lines] {
            set reason "\"$constraint\", which CONTRIBUTING.md does not list"
            if {[dict exists $permitted $constraint]} {
                lassign [dict get $permitted $constraint] listed holds
                set reason [expr {$holds ? $listed : "\"$constraint\", though here its reason does not hold: $listed"}]
            }
            dict lappend skips $reason [list $name $number]
            if {![dict exists $permitted $constraint] || !$holds} {
                lappend problems "$number skipped for $reason"
            }
        }
    }
    return $problems
}

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
    global running total failures times strict done
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
    set unlisted [whySkipped $name $output]
    if {$strict} {
        lappend problems {*}$unlisted
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
    set seconds [expr {([clock milliseconds] - [dict get $suite begin]) / 1000.0}]
    lappend times [list $name $seconds]
    puts [format "%-24s %4d passed %3d failed %3d skipped %7.1f s" $name $passed $failed $skipped $seconds]
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
    global queue alone running jobs until total quick done
    if {$until ne {} && [clock seconds] >= $until && [llength $queue] + [llength $alone] > 0} {
        set left [concat $queue $alone]
        puts "left out, since the time is over: [lmap suite $left {file rootname [file tail $suite]}]"
        incr total([expr {$quick ? "skipped" : "failed"}]) [llength $left]
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
set permitted [reasons [file join [file dirname $here] CONTRIBUTING.md]]
set queue {}
set alone {}
set there [lmap suite [lsort [glob -tails -directory $here *.test]] {file rootname $suite}]
# A long suite that begins last would run alone at the end. First come those that take longest, as measured; then the others, by the sizes of
# their files, and by name.
set longest {checkers trackerDemo draughts robot launch checkersWindow hardware lab connection sync tutorials simlab browser panel hand cycle vision}
set byLength [lmap item [lsort -decreasing -integer -index 1 [lmap name $there {list $name [file size [file join $here $name.test]]}]] {lindex $item 0}]
set order [concat [lmap name $longest {expr {$name in $there ? $name : [continue]}}] [lmap name $byLength {expr {$name in $longest ? [continue] : $name}}]]
foreach pattern [dict get $given -but] {
    if {[lsearch -glob $order $pattern] < 0} {
        puts "-but: no suite is like \"$pattern\"; there are: $there"
        exit 2
    }
    set order [lsearch -all -inline -not -glob $order $pattern]
}
foreach name [expr {[llength $wanted] > 0 ? $wanted : $order}] {
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
if {[llength $times] > 10} {
    puts "the slowest: [join [lmap item [lrange [lsort -decreasing -real -index 1 $times] 0 9] {format "%s %.0f s" {*}$item}] {, }]"
}
dict for {reason suites} $skips {
    puts "skipped for $reason: [join [lmap item [lsort $suites] {lassign $item name number; string cat "$number in $name"}] {, }]"
}
if {[llength $failures] > 0} {
    puts "suites with failures: $failures"
}
puts "$total(passed) passed, $total(failed) failed, $total(skipped) skipped"
exit [expr {$total(failed) > 0}]
