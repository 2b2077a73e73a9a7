# webFigures.tcl -- what pages of sorma-web take: until one is opened, until a click is answered, and what many viewers and a slow network cost. The tests
# do not run it: they judge nothing by time. It needs chromedriver.
#
#     build/env tclsh tests/support/webFigures.tcl ?-short?
#
# Times are those of the browser itself. A page is open when the first values stand on it, counted from the beginning of its navigation.

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

# A class with numbers that change all together, so many times in a second, and one that is the time [ms].
proc lively {count rate} {
    set lines {}
    for {set i 0} {$i < $count} {incr i} {
        lappend lines "sorma::option -v$i double -default 0"
    }
    return "oo::class create lively {\nsuperclass sorma::Service\n[join $lines \n]\nsorma::option -time double -default 0
        sorma::action -begin {} {change from now on} {my step}
        variable n
        method step {} {
            after [expr {1000 / $rate}] \[namespace code {my step}\]
            incr n
            for {set i 0} {\$i < $count} {incr i} {
                my store -v\$i \[expr {\$n + \$i}\]
            }
            my store -time \[clock milliseconds\]
        }
        method exec message {return {}}
    }\n"
}
proc median values {
    return [lindex [lsort -real $values] [expr {[llength $values] / 2}]]
}
# For so many seconds, with the event loop running.
proc pass seconds {
    after [expr {round(1000 * $seconds)}] {set ::passed 1}
    vwait ::passed
}

proc opening {place d given} {
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
    set time [median $times]
    measure row "a page with [dict get $given -options] options opens, median of [llength $times]" -wanted "300 ms" -target {$time < 300} \
        -measured [format "%.0f ms" $time]
    measure row "bytes that come for it" -wanted "100 kB" -target {$bytes < 100000} -measured [format "%.1f kB" [expr {$bytes / 1000.0}]]
}

# A daemon that does not answer: a click is answered by a sign that it is under way.
proc stopped {place d given} {
    set times {}
    for {set i 0} {$i < [dict get $given -count]} {incr i} {
        webDriver::go about:blank
        webDriver::go $place/#/object/wide.a@$d
        waitFor {[webDriver::run {return document.querySelectorAll('.field').length}] == [dict get $given -options]}
        exec sh -c {kill "$@"} kill -STOP [daemon info $d pid]
        try {
            lappend times [webDriver::run {
                const box = document.querySelector('.field input[type=checkbox]'), mark = box.closest('.field').querySelector('.mark');
                return new Promise((done) => {
                    const began = performance.now();
                    new MutationObserver(() => requestAnimationFrame(() => setTimeout(() => done(performance.now() - began)))).observe(mark, {childList: true, characterData: true, subtree: true});
                    box.click();
                });
            }]
        } finally {
            exec sh -c {kill "$@"} kill -CONT [daemon info $d pid]
        }
    }
    set time [median $times]
    measure row "a click while the daemon is stopped, until its sign is drawn, median of [llength $times]" -wanted "100 ms" -target {$time < 100} -measured [format "%.0f ms" $time]
}

proc viewers {w place d given} {
    set rate [dict get $given -rate]
    set streams [lmap n [lrepeat [expr {[dict get $given -viewers] - 1}] 1] {web::events $w /live/object?name=lively.a@$d}]
    webDriver::go $place/#/object/lively.a@$d
    waitFor {[webDriver::run {return document.querySelectorAll('.field').length}] > [dict get $given -values]}
    lively.a@$d CTRL -begin
    waitFor {[web::item [lindex $streams 0] -time] > 0}
    # From here on this process only takes what comes, and counts.
    proc web::Read channel {
        set said [read $channel]
        incr ::events [regexp -all {event: items} $said]
        incr ::bytes [string length $said]
    }
    pass 1
    set ::events [set ::bytes 0]
    set before [daemon processor [dict get $w pid]]
    set daemonBefore [daemon processor [daemon info $d pid]]
    set began [clock milliseconds]
    pass [dict get $given -seconds]
    set time [expr {([clock milliseconds] - $began) / 1000.0}]
    set part [expr {100 * ([daemon processor [dict get $w pid]] - $before) / $time}]
    set daemonPart [expr {100 * ([daemon processor [daemon info $d pid]] - $daemonBefore) / $time}]
    measure row "[dict get $given -values] values at $rate Hz to [dict get $given -viewers] viewers, one of them a browser: a core for sorma-web" -wanted "15 %" -target {$part < 15} -measured [format "%.1f %%" $part]
    set each [expr {$::events / $time / [llength $streams]}]
    measure row "the same: pieces of news in a second for each viewer, of [expr {$::events ? $::bytes / $::events : 0}] bytes" -wanted "> 0.8 of the rate" -target {$each > 0.8 * $rate} -measured [format %.1f $each]
    measure row "the same: a core for the daemon" -measured [format "%.1f %%" $daemonPart]
    foreach stream $streams {
        close $stream
    }
}

# How old the time on the page is, seen for a while: a list of two quantiles, [s].
proc lag {object seconds} {
    set all {}
    set end [expr {[clock milliseconds] + 1000 * $seconds}]
    while {[clock milliseconds] < $end} {
        set shown [webDriver::run {return document.getElementById('option-time').value}]
        lappend all [expr {([clock milliseconds] - $shown) / 1000.0}]
    }
    return [list [median $all] [lindex [lsort -real $all] end]]
}
proc slow {place d given} {
    # Slow 3G as in Chromium: 400 kbit/s, 400 ms.
    foreach {what ms bytes wanted} {loopback 0 -1 1 {slow 3G} 400 50000 3} {
        webDriver::network $ms $bytes
        webDriver::go about:blank
        webDriver::go $place/#/object/lively.a@$d
        waitFor {[webDriver::run {return document.getElementById('option-time')?.value ?? 0}] > 0}
        lassign [lag lively.a@$d [dict get $given -seconds]] half most
        measure row "how old a value is by $what: half of them, and at most" -wanted "$wanted s" -target {$most < $wanted} -measured [format "%.2f s, %.2f s" $half $most]
    }
    webDriver::network 0 -1
}

proc figures given {
    set file [file join [::tcltest::temporaryDirectory] wide[pid].tcl]
    set out [open $file w]
    puts $out [script [dict get $given -options]][lively [dict get $given -values] [dict get $given -rate]]
    close $out
    set d [daemon start -script $file -make wide.a -make lively.a]
    set w [web::start]
    webDriver::start
    try {
        set place [dict get $w place]
        webDriver::go $place/?key=[dict get $w key]
        opening $place $d $given
        stopped $place $d $given
        viewers $w $place $d $given
        slow $place $d $given
    } finally {
        webDriver::stop
        web::stop $w
        daemon stop $d
        file delete $file
    }
}
exit [measure run {-count {{whole 1 1000} 11} -options {{whole 1 200} 40} -values {{whole 1 1000} 200} -rate {{whole 1 100} 10} -viewers {{whole 2 30} 20} -seconds {{whole 1 1000} 10}} \
    {-count 3 -seconds 3} $argv figures]
