# tracker.tcl -- an arm that follows a ball by sight, and the table that says how well, in about a minute.
#
#     ./bootstrap run tracker      the daemons end with it; exit code 0: it followed to the end
#
# -window: no table but a window, until it is closed (window.tcl). -learn: teach the map anew, even when there is one. -speed N: of lab time. -csv FILE: where ball and tool were. -figures: count each row
# for so long that the numbers mean something, and kill daemons (figures.tcl).

package require sorma
package require sorma::options

namespace eval tracker {
    variable Here [file dirname [file normalize [info script]]]
    variable Options {}     ;# as they were given
    variable Only {}        ;# those of figures.tcl alone, as sorma::options wants them
}
source [file join $::tracker::Here .. lab lab.tcl]
source [file join $::tracker::Here rows.tcl]

proc tracker::minute {} {
    rows::rest 8
    rows::sine 12
    rows::jumps 4
    rows::hidden 2
    rows::lost 1
    rows::push 2
}

proc tracker::run rowsCmd {
    variable Here
    variable Options
    variable Only
    set options [sorma::options::parse [concat {-learn flag -speed {any 1} -csv {any {}} -window flag} $Only] $::argv]
    set Options $options
    set launch [lab::start sorma-launch --until-eof [file join $Here tracker.launch]]
    lab::untilSignal $launch
    try {
        vwait ::lab::Heard
        if {$::lab::Heard ne "ready"} {
            return 1
        }
        rows::prepare [dict get $options -speed]
        rows::learn [dict get $options -learn]
        rows::follow
        if {[dict get $options -window]} {
            source [file join $Here window.tcl]
            window::build
            tkwait window .
            rows::unfollow
            return 0
        }
        puts [format {%-34s %-44s %-36s %s} what measured target met]
        {*}$rowsCmd
        rows::ticks
        rows::unfollow
        if {[dict get $options -csv] ne {}} {
            rows::save [dict get $options -csv]
        }
        pino@robot EXEC park
        return 0
    } on error {- info} {
        puts stderr [dict get $info -errorinfo]
        return 1
    } finally {
        lab::finish $launch
    }
}

if {[file normalize $argv0] eq [file normalize [info script]]} {
    exit [tracker::run tracker::minute]
}
