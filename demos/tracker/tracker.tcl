# tracker.tcl -- an arm that follows a ball by sight, and the table that says how well, in about a minute.
#
#     ./bootstrap run tracker      the daemons end with it; exit code 0: it followed to the end, and each row met its target
#
# -window     no table but a window, until it is closed (window.tcl)
# -learn      teach the map anew, even when there is one
# -speed N    of lab time
# -csv FILE   the places of ball and tool
# -short      each row as short as it still means something
# -seed N, -json FILE    as of all scripts that measure
#
# figures.tcl measures each row long enough for quotable numbers, and kills daemons.

package require sorma

namespace eval tracker {
    variable Here [file dirname [file normalize [info script]]]
    variable Options {}     ;# as they were given
}
foreach file {../measure.tcl ../lab/lab.tcl rows.tcl} {
    source [file join $::tracker::Here $file]
}

# Count rows: name -> {in which time it is measured, what of rows.tcl counts it, how long, how long with -short}. In lab time, which stands between two
# samples, or which the row itself lets run, each has one try.
proc tracker::count rows {
    variable Options
    dict for {- row} $rows {
        lassign $row time script long short
        set script [list {*}$script [expr {[dict get $Options -short] ? $short : $long}]]
        switch $time {
            lab { rows::lab {*}$script }
            runs { namespace eval rows $script }
            wall { measure tries 3 namespace eval rows $script }
        }
    }
}
proc tracker::minute {} {
    count {
        rest {lab rest 8 2}
        sine {lab sine 12 5}
        jumps {lab jumps 5 3}
        hidden {lab hidden 2 1}
        lost {lab lost 1 1}
        push {lab push 2 1}
    }
}

# A program that counts rows: its exit code. TABLE: its own options.
proc tracker::run {rowsCmd {table {}}} {
    return [measure run [concat {-learn flag -speed {any 1} -csv {any {}} -window flag} $table] {} $::argv [list tracker::Run $rowsCmd]]
}
proc tracker::Run {rowsCmd options} {
    variable Here
    variable Options $options
    set launch [lab::launch [file join $Here tracker.launch]]
    try {
        rows::prepare [dict get $options -speed]
        rows::learn [dict get $options -learn]
        rows::follow
        if {[dict get $options -window]} {
            source [file join $Here window.tcl]
            window::build
            puts "The window is yours; close it to end."
            tkwait window .
            rows::unfollow
            return
        }
        {*}$rowsCmd
        measure tries 3 rows::ticks
        rows::unfollow
        if {[dict get $options -csv] ne {}} {
            rows::save [dict get $options -csv]
        }
        pino@robot EXEC park
    } finally {
        lab::finish $launch
    }
}

if {[file normalize $argv0] eq [file normalize [info script]]} {
    exit [tracker::run tracker::minute]
}
