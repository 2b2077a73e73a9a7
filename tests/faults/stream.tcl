# stream.tcl ?megabytes? ?via? -- a long reply as a stream to a reader in another process.
#
# Shows the memory of both. Then the reader stops, closes, loses its right, or is killed, and at the end the daemon is killed. Times are
# printed. Promised is how much memory they need, and that nothing is left; from 1024 MB on also that it ends within a second. via: unix
# or tcp.

source [file join [file dirname [file normalize [info script]]] faults.tcl]
source [file join $supportFolder child.tcl]

# Memory of a process [bytes]: VmRSS is what it has now, VmHWM the most that it has had.
proc rss {pid {what VmRSS}} {
    set f [open /proc/$pid/status]
    regexp "$what:\\s+(\\d+) kB" [read $f] -> kilobytes
    close $f
    return [expr {$kilobytes * 1024}]
}
# Run a script in the reader: how much more than before both have needed, at most.
proc watched {reader daemon script} {
    set pids [list [pid $reader] [daemon info $daemon pid]]
    set before [lmap p $pids {rss $p}]
    set ::answer {}
    fconfigure $reader -blocking 0
    fileevent $reader readable [list heard $reader]
    puts $reader [list $script]
    flush $reader
    vwait ::answer
    set ::most [lmap p $pids b $before {expr {[rss $p VmHWM] - $b}}]
    fileevent $reader readable {}
    fconfigure $reader -blocking 1
    return [lindex $::answer 1]
}
proc heard reader {
    if {[gets $reader line] >= 0} { set ::answer $line }
}
proc reader {} {
    set r [child start]
    child ask $r {
        proc readAll {request} {
            set s [sorma::stream $request]
            set n 0
            while {[$s next piece]} { incr n [string length [dict get $piece any]] }
            $s close
            return $n
        }
    }
    return $r
}
proc small what {
    lassign $::most reader daemon
    puts "$what: the reader needed [megabytes $reader] more, the daemon [megabytes $daemon]"
    promise "$what: 16 MB in each process are enough" [expr {$reader <= 16e6 && $daemon <= 16e6}]
}
proc none what {
    waitFor {[echo.long@$::d DBX -stream list] eq {RET 0}}
    waitFor {![regexp { requests } [sorm@$::d DBX -budgets]]}
    promise "$what: no stream and no charge is left" 1
}
# Number of descriptors and names of objects of the daemon.
proc owned {} {
    list [llength [glob /proc/[daemon info $::d pid]/fd/*]] \
        [lsort [lmap o [dict get [lindex [sorm@$::d DBX -inventory objects] 3] objects] {lindex $o 0}]]
}
proc elapsed start { expr {[clock milliseconds] - $start} }
# How long an end took. Slow machines promise nothing.
proc soon {what start} {
    set took [elapsed $start]
    puts "$what: it has ended after $took ms"
    if {$::megabytes >= 1024} { promise "$what: within a second" [expr {$took < 1000}] }
}

attack {
    set megabytes [expr {$argc > 0 ? [lindex $argv 0] : 2048}]
    set via [expr {$argc > 1 ? [lindex $argv 1] : "unix"}]
    set d [serve {package require sorma::service::echo}]
    set where [expr {$via eq "tcp" ? "127.0.0.1:[daemon info $d port]" : $d}]
    set block [string repeat x 65536]
    echo.long@$d CTRL -times [expr {$megabytes * 16}]
    set long [list echo.long@$where exec -any $block]
    set owned [owned]
    set r [reader]

    set start [clock milliseconds]
    set bytes [watched $r $d [list readAll $long]]
    set took [elapsed $start]
    puts "$megabytes MB in $took ms, [expr {$took > 0 ? $bytes / $took / 1000 : 0}] MB/s"
    promise "all of it came" [expr {$bytes == $megabytes << 20}]
    small "all"
    none "all"

    watched $r $d "set s \[sorma::stream [list $long]\]; \$s next piece; for {set i 0} {\$i < 200} {incr i} {set l \[echo.long@$where DBX -stream list\]}; set l"
    set listed [lindex $answer 1]
    regexp {: (\d+) pieces} $listed -> pieces
    promise "a reader that stops: the writer waits after 5 pieces" [expr {$pieces == 5}]
    small "a reader that stops"
    child ask $r {for {set i 0} {$i < 20} {incr i} {$s next piece}}
    child ask $r {$s close}
    none "closed in the middle"

    child ask $r "set s \[sorma::stream [list $long]\]; \$s next piece"
    set start [clock milliseconds]
    child kill $r
    waitFor {[echo.long@$d DBX -stream list] eq {RET 0}}
    soon "the reader is killed" $start
    none "the reader is killed"
    waitFor {[owned] eq $owned}
    promise "the reader is killed: no descriptor and no object is left" 1

    if {$via eq "tcp"} {
        set r [reader]
        child ask $r "set s \[sorma::stream [list $long]\]; \$s next piece"
        sorm@$d CTRL -allow {deny anyone call on echo.long}
        set told [child ask $r {while {[$s next piece]} {}}]
        promise "a reader that loses its right is told: [lrange [lindex $told 2] 1 2]" [expr {[lindex $told 2 2] eq "DENIED"}]
        none "a reader that loses its right"
        sorm@$d CTRL -allow {allow anyone call on echo.long}
        child kill $r
    }

    # Many, of whom none reads, by as many clients.
    set crowd [lmap i {1 2 3} {reader}]
    set before [rss [daemon info $d pid]]
    foreach c $crowd {
        child ask $c "for {set i 0} {\$i < 64} {incr i} {lappend all \[sorma::stream [list $long]\]; \[lindex \$all end\] next piece}"
    }
    set more [expr {[rss [daemon info $d pid]] - $before}]
    set start [clock microseconds]
    echo.long@$d EXEC TMSG here
    puts "[expr {64 * [llength $crowd]} ] streams that nobody reads: [megabytes $more], another call takes [expr {[clock microseconds] - $start}] us"
    promise "streams that nobody reads: each needs less than its charge" [expr {$more < 64 * [llength $crowd] * 65536 + 20e6}]
    foreach c $crowd { child kill $c }
    none "their readers are killed"
    waitFor {[owned] eq $owned}
    promise "their readers are killed: no descriptor and no object is left" 1

    set r [reader]
    child ask $r "set s \[sorma::stream [list $long]\]; \$s next piece"
    set start [clock milliseconds]
    daemon kill $d
    set told [child ask $r {while {[$s next piece]} {}}]
    soon "the daemon is killed" $start
    puts "the reader was told: [lindex $told 1]"
    promise "the daemon is killed: [lrange [lindex $told 2] 1 2]" [expr {[lrange [lindex $told 2] 1 2] eq {COMM LOST}}]
    child kill $r
}
