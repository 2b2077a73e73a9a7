# at.tcl -- questions to a past moment, answered from a recording. An object of class recorder reads it (services/recorder/history.h).

package provide sorma::at 1.0         ;# before what needs it in turn
package require sorma::inspect
package require sorma::moment

namespace eval ::sorma::inspect {
    dict set Topics at {what an object was like at a past moment, by a recording: at 12:03:04.125 foo.a cget -tempo}
}
namespace eval ::sorma::at {
    variable Options {-file {{word {the name of a file}}} -recorder {{word {the name of a recorder}}}}
    variable Files {}       ;# dict: file -> the object that reads it
}

# ::sorma::inspect::at ?-file FILE? ?-recorder NAME? TIME REQUEST ... -- the same for people.
proc ::sorma::inspect::at args {
    set words $args
    ::sorma::options::leading $::sorma::at::Options words
    if {[llength $words] < 2} {
        ::sorma::usage::wrong sorma::inspect::at
    }
    return [::sorma::at {*}$args]
}

# ::sorma::at ?-file FILE? ?-recorder NAME? TIME REQUEST ... --
#       Answer a request as it would have been answered at a past moment. No object is asked but the recorder.
# Arguments:
#       FILE    a recording;   NAME  the recorder that has it. Without both, the one here that records, or has a file
#       TIME    see sorma::moment::parse;   REQUEST  one text, or its words
# Results:
#       As of the request then: a value for cget and configure, a reply for EXEC and DBX; of underway a list of dicts.
proc ::sorma::at args {
    set words $args
    set settings [::sorma::options::leading $::sorma::at::Options words]
    if {[llength $words] < 2} {
        ::sorma::usage::wrong sorma::at
    }
    set request [lassign $words time]
    if {[llength $request] == 1} {
        set request [lindex $request 0]
    }
    set time [::sorma::moment::parse {sorma::at} $time]
    set recorder [expr {[dict get $settings -file] ne {} ? [at::Reader [dict get $settings -file]] : [dict get $settings -recorder] ne {} ? [dict get $settings -recorder] : [at::Present]}]
    set reply [$recorder EXEC at $time {*}$request]
    if {[lindex $request 0] eq "buffer" || [lindex $request 1] in {EXEC DBX}} {
        return $reply
    }
    return [lindex $reply 3]
}

# The object that reads a file.
proc ::sorma::at::Reader file {
    variable Files
    set file [file normalize $file]
    if {![dict exists $Files $file] || [dict get $Files $file] ni [::sorma::names recorder.*]} {
        for {set n 1} {"recorder.past$n" in [::sorma::names recorder.*]} {incr n} {}
        ::sorma::create recorder.past$n -file $file
        dict set Files $file recorder.past$n
    }
    return [dict get $Files $file]
}

# The recorder of this process, if there is just one that records, or just one at all.
proc ::sorma::at::Present {} {
    set all [lsearch -all -inline -not -regexp [::sorma::names recorder.*] {@|^recorder\.past\d+$}]
    if {"recorder" in [::sorma::names recorder]} {
        lappend all recorder
    }
    set recording [lmap name $all {
        if {[dict get [dict get [$name exec state] text] state] ne "recording"} continue
        set name
    }]
    set found [expr {[llength $recording] > 0 ? $recording : $all}]
    if {[llength $found] != 1} {
        return -code error -errorcode {SORMA RECORDER WORD} [if {$found eq {}} {
            string cat "no recorder is here: name a recording by -file, or a recorder by -recorder"
        } else {
            string cat "several recorders are here: say -recorder with one of [join $found {, }]"
        }]
    }
    return [lindex $found 0]
}
