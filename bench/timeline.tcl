# timeline.tcl ?RECORDS? ?FOLDER? -- the time line of a recording of ten million records: how long do its answers take?
#
# bench/manyRecords makes the file, an hour of four daemons with 50 objects each. It is removed at the end. A first part asks the class
# recorder alone. With a display, a second part turns the wheel in the window and waits until that is drawn. Beside each time stands the processor
# time of this process in it: on a busy machine that is what counts. By hand, from the build folder:
#
#     nice ./env tclsh8.6 ../bench/timeline.tcl 10000000 /tmp

source [file join [file dirname [file normalize [info script]]] times.tcl]
package require sorma
package require sorma::service::recorder

lassign [concat $argv [lrange {10000000 /tmp} [llength $argv] end]] records folder
set file [file join $folder many[pid].rec]
set failures 0

proc memory {} {
    set f [open /proc/self/status]
    regexp {VmRSS:\s+(\d+)} [read $f] -> kB
    close $f
    return $kB
}
# times: a list of {clock processor}. The middle one and the slowest are printed; the middle one has to be below the target.
proc row {what target times {note {}}} {
    set sorted [lsort -real -index 0 $times]
    lassign [lindex $sorted [expr {[llength $sorted] / 2}]] ms processor
    puts [format "%-52s %8.1f ms %8.1f ms of the processor, slowest %7.1f ms  %s %d ms  %s" $what $ms $processor [lindex $sorted end 0] \
        [expr {$ms < $target ? "<" : "NOT <"}] $target $note]
    incr ::failures [expr {$ms >= $target}]
}
proc ask args {
    return [lindex [recorder.many EXEC timeline {*}$args] 3]
}
# Windows from all of it to a hundred microseconds, around a moment that lies a third from the left.
proc views {first last} {
    set views {}
    set middle [expr {$first + ($last - $first) / 3}]
    for {set span [expr {$last - $first}]} {$span > 1e-4} {set span [expr {$span * 0.8}]} {
        lappend views [list [format %.9f [expr {$middle - $span / 3}]] [format %.9f [expr {$middle + $span * 2 / 3}]]]
    }
    return $views
}

# Turns the wheel in a window of 1280x800, which has read all of it.
proc wheel file {
    package require sorma::timeline
    wm geometry . 1280x800
    pack [sorma::timeline .line -file $file] -fill both -expand 1
    drawn
    for {set i 0} {$i < 70} {incr i} {
        lappend times [ms {
            event generate .line.panes.line.canvas <Button-4> -x 600 -y 50
            drawn
        }]
    }
    return $times
}
proc drawn {} {
    while {![winfo ismapped .line.panes.line.canvas] || ![.line idle]} {
        after 1 {set ::looked 1}
        vwait ::looked
    }
    update idletasks
}

try {
    exec [file join $env(SORMA_BUILD) bench manyRecords] $file $records
    puts "[file size $file] bytes, $records records"
    sorma::create recorder.many -file $file
    row "the first answer" 50 [list [ms {ask}]]
    set read [ms {
        set polls {}
        while {[dict get [set about [ask]] done] < 1} {
            lappend polls [ms {ask about}]
            after 50
        }
    }]
    row "an answer while it is read" 50 $polls
    puts [format "%-52s %8.1f ms; this process has %d kB" "until all is read, in a thread" [lindex $read 0] [memory]]
    set tracks [ask tracks]
    set rows {}
    foreach track $tracks {
        lassign $track source object
        if {$object eq {} || [llength $rows] < 60} {
            lappend rows $source $object
        }
    }
    set views [views [dict get $about first] [dict get $about last]]
    set times {}
    foreach view $views {
        lappend times [ms {set answer [ask draw {*}$view 1400 {*}$rows]}]
    }
    row "draw, 1400 columns of [expr {[llength $rows] / 2}] rows, [llength $views] zooms" 25 $times
    set times {}
    set found {}
    set time [dict get $about first]
    for {set i 0} {$i < 50} {incr i} {
        lappend times [ms {set found [ask next $time {*}$rows]}]
        set time [dict get $found time]
    }
    row "the next one that has failed" 10 $times
    set times {}
    for {set i 1} {$i <= 50} {incr i} {
        set time [format %.9f [expr {[dict get $about first] + $i * 70}]]
        lassign [lindex $tracks $i] source object
        lappend times [ms {set mark [ask mark $time 2 $source $object]}]
        if {$mark eq {} || ([dict get $mark kind] eq "request" && [llength [dict get $mark records]] != 2)} {
            error "no reply at $time: $mark"
        }
    }
    row "a click: request and reply" 50 $times
    if {[info exists env(DISPLAY)]} {
        row "the wheel, until the window is drawn" 50 [wheel $file]
    }
} finally {
    file delete $file
}
exit [expr {$failures > 0}]
