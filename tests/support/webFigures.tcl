# webFigures.tcl -- how long a browser takes to open the page of an object with 40 options, and how many bytes come. The tests do not run it: they
# judge nothing by time. It needs chromedriver.
#
#     build/env tclsh tests/support/webFigures.tcl ?-short?
#
# The time is that of the browser itself: from the beginning of the navigation until the first values stand on the page.

namespace eval tcltest {proc temporaryDirectory {} {return /tmp}}
package require sorma
set here [file dirname [file normalize [info script]]]
source [file join $here .. .. demos measure.tcl]
foreach name {wait daemon web webDriver} {
    source [file join $here $name.tcl]
}

# A class with 40 options of all kinds, as a script for a daemon.
proc script count {
    set lines {}
    for {set i 0} {$i < $count} {incr i} {
        lappend lines "sorma::option -option$i [lindex {{double -unit m/s -range {0 10} -default 1} {flag -default 1} {string -default kitchen} {int -range {0 100}}} [expr {$i % 4}]] -help {what it does}"
    }
    return "oo::class create wide {\nsuperclass sorma::Service\n[join $lines \n]\n}\n"
}

proc figures given {
    set file [file join [::tcltest::temporaryDirectory] wide[pid].tcl]
    set out [open $file w]
    puts $out [script [dict get $given -options]]
    close $out
    set d [daemon start -script $file -make wide.a]
    set w [web::start]
    webDriver::start
    try {
        set place http://127.0.0.1:[dict get $w port]
        webDriver::go $place/?key=[dict get $w key]
        set times {}
        for {set i 0} {$i < [dict get $given -count]} {incr i} {
            webDriver::go about:blank
            webDriver::go $place/#/object/wide.a@$d
            waitFor {[webDriver::run {return document.querySelectorAll('.field').length}] == [dict get $given -options]}
            lassign [webDriver::run {
                const all = [...performance.getEntriesByType('navigation'), ...performance.getEntriesByType('resource')];
                return [performance.getEntriesByName('opened')[0].startTime, all.reduce((sum, one) => sum + one.transferSize, 0)];
            }] time bytes
            lappend times $time
        }
        set time [lindex [lsort -real $times] [expr {[llength $times] / 2}]]
        measure row "a page with [dict get $given -options] options opens, median of [llength $times]" -wanted "300 ms" -target {$time < 300} \
            -measured [format "%.0f ms" $time]
        measure row "bytes that come for it" -wanted "100 kB" -target {$bytes < 100000} -measured [format "%.1f kB" [expr {$bytes / 1000.0}]]
    } finally {
        webDriver::stop
        web::stop $w
        daemon stop $d
        file delete $file
    }
}
exit [measure run {-count {{whole 1 1000} 11} -options {{whole 1 200} 40}} {-count 3} $argv figures]
