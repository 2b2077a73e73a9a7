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

# ::sorma::replaySuite::make FILE OUT STEPS DAEMONS -- write the suite OUT.
# Arguments:
#       FILE     the recording, which recorder.replay has;   STEPS  its requests with their replies: dicts of source, object, time, request, reply
#       DAEMONS  dict: name of a daemon -> words for sormad
# Results:
#       {TESTS OPEN}: how many tests it has, and how many of them leave something open.
proc ::sorma::replaySuite::make {file out steps daemons} {
    set steps [Wanted $steps]
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
    During $daemons {
        set begin [Beginning $steps]
        set first [Replies $begin $steps]
    }
    During $daemons {
        set second [Replies $begin $steps]
    }
    set patterns [lmap step $steps one $first two $second {::sorma::recorded::pattern [list [dict get $step reply] $one $two]}]
    Write $file $out $daemons $begin $steps $patterns
    return [list [llength $steps] [llength [lsearch -all -regexp $patterns {(^| )\{?([*~]|\.\.\.$)}]]]
}

# Run a script while these daemons are there.
proc ::sorma::replaySuite::During {daemons script} {
    ::sorma::recorded::begin $daemons
    try {
        uplevel 1 $script
    } finally {
        ::sorma::recorded::end
    }
}

# Those that a suite can ask, with the daemon: it has the name of the source, or a part of its address. Questions of the bus itself and to SORM are left
# out.
proc ::sorma::replaySuite::Wanted steps {
    return [lmap step $steps {
        if {[dict get $step object] eq "sorm" || [regexp {^\S+ DBX -info\M} [dict get $step request]]} continue
        dict replace $step daemon [regsub -all {[^\w-]+} [file rootname [file tail [dict get $step source]]] -] reply [::sorma::recorded::fields [dict get $step reply]]
    }]
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
            set option [lindex [::sorma::recorded::renamed [list $object CTRL $option]] end]
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
