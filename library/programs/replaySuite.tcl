# replaySuite.tcl -- sorma-replay -as-test: a suite of tcltest from a recording.
#
# The requests from outside are sent twice more, each time to new daemons. The suite has a range for numbers that differ then, and leaves other
# differences open.

package require sorma
package require sorma::at
package require sorma::options
package require sorma::recorded
package provide sorma::replaySuite 1.0

namespace eval ::sorma::replaySuite {}

# ::sorma::replaySuite::make FILE OUT RECORDS DAEMONS -- write the suite OUT.
# Arguments:
#       FILE     the recording;   RECORDS  those of its records that are wanted, as a list of dicts of recorder EXEC records
#       DAEMONS  dict: name of a daemon -> words for sormad
# Results:
#       {TESTS OPEN}: how many tests it has, and how many of them leave something open.
proc ::sorma::replaySuite::make {file out records daemons} {
    set steps [Steps $records]
    if {$steps eq {}} {
        return -code error "the recording has no request from outside that has a reply"
    }
    set known [lsort -unique [lmap step $steps {dict get $step daemon}]]
    foreach name [dict keys $daemons] {
        if {$name ni $known} {
            return -code error "-start: no request went to a daemon \"$name\"; expected [::sorma::options::oneOf $known]"
        }
    }
    set daemons [dict merge [dict create {*}[concat {*}[lmap name $known {list $name {}}]]] $daemons]
    ::sorma::recorded::begin $daemons
    try {
        set begin [Beginning $steps]
        set first [Replies $begin $steps]
    } finally {
        ::sorma::recorded::end
    }
    ::sorma::recorded::begin $daemons
    try {
        set second [Replies $begin $steps]
    } finally {
        ::sorma::recorded::end
    }
    set patterns [lmap step $steps one $first two $second {::sorma::recorded::pattern [list [dict get $step reply] $one $two]}]
    Write $file $out $daemons $begin $steps $patterns
    return [list [llength $steps] [llength [lsearch -all -regexp $patterns {(^| )\{?([*~]|\.\.\.$)}]]]
}

# Requests from outside, and their replies: dicts source daemon object request reply time. Those of the bus itself and those to SORM are left out.
# The daemon gets the name of its source, or a part of its address.
proc ::sorma::replaySuite::Steps records {
    set wanted {}
    set steps {}
    foreach record $records {
        set key [list [dict get $record source] [dict get $record number]]
        if {[dict get $record kind] eq "request" && [dict get $record code] == 0} {
            dict set wanted $key [dict get $record time]
        } elseif {[dict get $record kind] eq "reply" && [dict exists $wanted $key]} {
            set request [dict get $record request]
            if {[dict get $record object] ne "sorm" && ![regexp {^\S+ DBX -info\M} $request]} {
                set source [dict get $record source]
                lappend steps [dict create source $source daemon [regsub -all {[^\w-]+} [file rootname [file tail $source]] -] object [dict get $record object] request $request \
                    reply [::sorma::recorded::fields [dict get $record text]] time [dict get $wanted $key]]
            }
            dict unset wanted $key
        }
    }
    return $steps
}

# The options that objects had when they were asked first, and do not have from their beginning: requests, as {DAEMON REQUEST}. The daemons have just begun.
proc ::sorma::replaySuite::Beginning steps {
    set seen {}
    set begin {}
    foreach step $steps {
        dict with step {}
        if {[dict exists $seen $source/$object]} continue
        dict set seen $source/$object 1
        # Objects that do not tell, or are not in the recording at that time, begin as they are.
        if {[catch {::sorma::at -recorder recorder.replay $time [list $object@$source configure]} then]} continue
        dict for {option value} $then {
            if {![catch {$object@$daemon cget $option} now] && $now ne $value} {
                set request [list $object CTRL $option $value]
                if {[lrange [::sorma::recorded::ask $daemon $request] 0 1] eq {RET 0}} {
                    lappend begin [list $daemon $request]
                }
            }
        }
    }
    return $begin
}

proc ::sorma::replaySuite::Replies {begin steps} {
    foreach item $begin {
        ::sorma::recorded::ask {*}$item
    }
    return [lmap step $steps {::sorma::recorded::ask [dict get $step daemon] [dict get $step request]}]
}

proc ::sorma::replaySuite::Write {file out daemons begin steps patterns} {
    set name [file rootname [file tail $out]]
    set lines [list "# $name.test -- what was recorded in [file tail $file] is answered still. Made by sorma-replay -as-test; sorma::manual sorma-replay has the patterns." \
        {} "package require tcltest" "namespace import ::tcltest::*" "package require sorma::recorded" "customMatch recorded ::sorma::recorded::same" \
        {} "# The daemons, and the options that their objects had." "::sorma::recorded::begin [list $daemons]"]
    foreach item $begin {
        lappend lines "::sorma::recorded::ask $item"
    }
    set n 0
    foreach step $steps pattern $patterns {
        set title [string range "[dict get $step daemon]: [dict get $step request]" 0 119]
        lappend lines {} "test $name-1.[incr n] [list $title] -body {" "    ::sorma::recorded::ask [list [dict get $step daemon] [dict get $step request]]" \
            "} -match recorded -result [list $pattern]"
    }
    lappend lines {} "::sorma::recorded::end" "cleanupTests"
    set channel [open $out {WRONLY CREAT TRUNC} 0600]
    fconfigure $channel -encoding utf-8
    puts $channel [join $lines \n]
    close $channel
}
