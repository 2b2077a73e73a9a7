# browserFigures.tcl -- what the browser costs, measured: for the notes of an issue, and not run by the tests, which judge nothing by time.
#
#     build/env tclsh tests/support/browserFigures.tcl          on $DISPLAY; best an Xvfb of its own
#
# 20 daemons with 500 objects each. Prints a line for each figure; times are the browser's own, from the call to the end of its drawing. On a
# machine that does other things, too, the time that it computes says more.

set began [clock microseconds]
package require Tk
package require sorma
package require sorma::browser
set loaded [expr {([clock microseconds] - $began) / 1000.0}]
source [file join [file dirname [file normalize [info script]]] daemon.tcl]
namespace eval tcltest {proc temporaryDirectory {} {return /tmp}; namespace export *}

# ms that this process has computed so far
proc computed {} {
    set channel [open /proc/self/schedstat]
    set ns [lindex [gets $channel] 0]
    close $channel
    return [expr {$ns / 1e6}]
}
proc pause ms {
    after $ms {set ::over 1}
    vwait ::over
}
proc until condition {
    set end [expr {[clock milliseconds] + 60000}]
    while {![uplevel #0 [list expr $condition]]} {
        if {[clock milliseconds] > $end} {
            error "waited 60 s in vain for $condition"
        }
        pause 5
    }
}
proc took {what script} {
    set from [clock microseconds]
    set before [computed]
    uplevel #0 $script
    update idletasks
    puts "$what: [format %.1f [expr {([clock microseconds] - $from) / 1000.0}]] ms, computing for [format %.1f [expr {[computed] - $before}]] ms"
}

puts "Tk and the packages are loaded: [format %.1f $loaded] ms, computing for [format %.1f [computed]] ms"

# Daemons of others are not to be seen.
set env(SORMA_RUNTIME_DIR) /tmp/browserFigures[pid]
file mkdir $env(SORMA_RUNTIME_DIR)
file attributes $env(SORMA_RUNTIME_DIR) -permissions 0700
set file $env(SORMA_RUNTIME_DIR)/objects.tcl
set channel [open $file w]
puts $channel {for {set i 0} {$i < 500} {incr i} {sorma::create foo.n$i}}
close $channel
set daemons {}
for {set i 0} {$i < 20} {incr i} {
    lappend daemons [daemon start -package sorma::service::foo -script $file]
}
try {
    wm geometry . 1000x640
    took "start, until 20 daemons and 10000 objects are in the tree" {
        pack [sorma::browser .w] -fill both -expand 1
        until {[llength [lsearch -all [.w tree keys] foo.n*]] == 10000}
    }
    pause 2000
    .w search search musicians                      ;# asks for the tables of the classes
    until {[llength [.w search found]] == 20}
    foreach word {n foo.n4 n499@ musicians nothing} {
        took "search for $word" {.w search search $word}
    }
    .w search search {}
    .w choose [list object [lindex $daemons 0] foo.n1]
    pause 2000
    foreach kind {connections subscriptions} {
        .w tree open [list $kind [lindex $daemons 0]]
    }
    pause 1000
    set before [computed]
    pause 10000
    puts "idle, with rows of a daemon open and a panel shown: [format %.2f [expr {([computed] - $before) / 10000 * 100}]] % of a core"
    foreach d [lrange $daemons 10 end] {
        exec kill -STOP [daemon info $d pid]
    }
    took "click on an object, with ten daemons stopped" {.w choose [list object [lindex $daemons 1] foo.n2]; update}
    took "click on an object of a stopped daemon" {.w choose [list object [lindex $daemons 15] foo.n2]; update}
    foreach d [lrange $daemons 10 end] {
        exec kill -CONT [daemon info $d pid]
    }
    set log [.w tab log select]
    update
    took "an error anywhere, until the log shows it" {
        catch {foo.n1@[lindex $daemons 3] CTRL -tempo sideways}
        until {[string match *sideways* [$log text]]}
    }
    set graph [.w tab graph select]
    update
    set reply {object {} event monitor.reply number 1 lost 0 time 0 request 1 text {} floats {} ints 250 any {} words {}}
    for {set i 0} {$i < 30} {incr i} {
        $graph passed [lindex $daemons 0] [dict replace $reply words [list foo.n$i EXEC "joe@lab plan\[[expr {$i % 4}]\]" $i 0]]
    }
    until {[dict size [$graph boxes]] == 5}
    took "30 objects drawn" {event generate $graph.canvas <Configure>; update}
} finally {
    foreach d $daemons {
        catch {daemon kill $d}
    }
    file delete -force $env(SORMA_RUNTIME_DIR)
}
exit
