# package.tcl -- the commands of the package that are written in Tcl, from the moment it is there.
#
# Read by `package require sorma`. The file of a command is read when one of its commands is first called; until then each is
# a proc that does just that.

apply {{} {
    set usage {}
    catch {
        set channel [open [file join $::sorma::library manual usage]]       ;# not there while the manual is made
        fconfigure $channel -encoding utf-8
        set usage [read $channel][close $channel]
    }
    foreach {package commands} {
        world world
        table table
        await await
        retry retry
        at at
        complete complete
        manual {manual manual::pages manual::titles}
        reply {show showDefaults}
        trail {showTrail showStack}
        inspect {inspect *}
        record {record::start record::stop}
        subject subject
        field {entry slider vector choice check field button}
        execform execform
        chart stripchart
        timeline timeline
        form form
        lamp {led meter reading status}
        image image
        painter painter
        notice notice
        trailview trailview
        panel panel
        classPart classPart
        window window
        display display
        dashboard dashboard
        theme theme
        console console
        arrangement arrangement
        browser browser
        circuitEditor circuitEditor
    } {
        if {"*" in $commands} {                     ;# all that the manual has of it
            set commands [lmap command [concat $package [dict keys $usage sorma::${package}::*]] {regsub {^sorma::} $command {}}]
        }
        foreach command $commands {
            namespace eval ::sorma::[namespace qualifiers $command] {}
            # What was read before is kept.
            if {[package provide sorma::$package] eq {}} {
                proc ::sorma::$command args [string map [list @P@ $package @C@ $command] {
                    try {
                        package require sorma::@P@
                    } trap {TCL PACKAGE UNFOUND} message {
                        if {[package versions sorma::@P@] eq {}} {
                            append message "; Debian has windows in the package sorma-tk"
                        }
                        return -code error -errorcode {TCL PACKAGE UNFOUND} $message
                    }
                    tailcall ::sorma::@C@ {*}$args
                }]
            }
            namespace eval ::sorma::[namespace qualifiers $command] [list namespace export [namespace tail $command]]
        }
    }
}}

# A line of SORMA_DICT, or of another variable, that is wrong is left out; whatever the program, it is said.
if {[info exists env(SORMA_DICT)] || [array names env SORMA_ENTRY_*] ne {}} {
    apply {{} {
        foreach line [split [lindex [::sorma::so::dict CTRL -leftOut] 3] \n] {
            catch {puts stderr "warning: $line"}
        }
    }}
}
