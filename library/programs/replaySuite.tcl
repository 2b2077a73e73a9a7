# replaySuite.tcl -- sorma-replay -as-test: a suite of tcltest from a recording.
#
# The requests from outside are sent twice more, each time to new daemons. The second run has pauses, because replies may depend on how fast requests
# come. The suite has the same pauses, so it does not ask before other daemons have done what they do by themselves. When replies differ, two more runs
# tell by how much. The suite has a range for numbers that differ, and leaves other differences open. Numbers that have a unit may be off by its
# tolerance (replayUnits.tcl).

package require sorma
package require sorma::at
package require sorma::options
package require sorma::recorded
package require sorma::replayUnits
package require sorma::text
package provide sorma::replaySuite 1.0

namespace eval ::sorma::replaySuite {
    # The pause before each request of the second run and of the suite, and the most that all of them may take [ms].
    variable Pause 50
    variable Longest 5000
}

# ::sorma::replaySuite::make FILE OUT STEPS DAEMONS TOLERANCES -- write the suite OUT.
# Arguments:
#       FILE     the recording, which recorder.replay has;   STEPS  its requests with their replies: dicts of source, object, time, request, reply
#       DAEMONS  dict: name of a daemon -> words for sormad;   TOLERANCES  dict: unit, or relative -> how far such numbers may be off, in place of what is usual
# Results:
#       {TESTS OPEN}: how many tests it has, and how many of them leave something open.
proc ::sorma::replaySuite::make {file out steps daemons tolerances} {
    # Also those that are asked nothing but questions of the bus: others may need them.
    set known [lsort -unique [lmap step $steps {Daemon $step}]]
    set steps [Wanted $steps]
    if {$steps eq {}} {
        return -code error "the recording has no request from outside that has a reply"
    }
    foreach name [dict keys $daemons] {
        if {$name ni $known} {
            return -code error "-start: no request went to a daemon \"$name\"; expected [::sorma::options::oneOf $known]"
        }
    }
    # They are started in this order.
    foreach name [lsort -unique [lmap step $steps {dict get $step daemon}]] {
        dict append daemons $name
    }
    During $daemons {
        set begin [Beginning $steps]
        set first [Replies 1 $begin $steps]
        set units [Units $steps]
    }
    variable Pause
    variable Longest
    set pause [expr {min($Pause, $Longest / [llength $steps])}]
    ::sorma::recorded::pause $pause
    set runs [list $first [Again 2 $daemons $begin $steps]]
    # Numbers of three replies can be near each other by chance (once in 21 * 21, when all of a range are as likely): a suite would fail that is right.
    # With two more runs that is once in 21 ** 4.
    if {[Open [Patterns $steps $runs]]} {
        lappend runs [Again 3 $daemons $begin $steps] [Again 4 $daemons $begin $steps]
    }
    ::sorma::recorded::pause 0
    set patterns [Patterns $steps $runs]
    set known [lsort -unique [concat {*}[lmap table [dict values $units] {dict values $table}]]]
    foreach unit [dict keys $tolerances] {
        if {$unit ni [concat relative $known]} {
            return -code error "-tolerance: no number of the recording has the unit \"$unit\"; expected [::sorma::options::oneOf [concat relative $known]]"
        }
    }
    set tolerances [::sorma::replayUnits::chosen $tolerances $known]
    set patterns [lmap step $steps pattern $patterns {
        ::sorma::replayUnits::put [dict get $units [Key $step]] [dict get $step request] $pattern $tolerances
    }]
    Write $file $out $daemons $begin $steps $patterns [Used $tolerances $patterns] $pause
    return [list [llength $steps] [Open $patterns]]
}

# How many patterns leave something open.
proc ::sorma::replaySuite::Open patterns {
    return [llength [lsearch -all -regexp $patterns {(^| )\{?(\*|~~|~[^:]*\.\.|\.\.\.$)}]]
}

# Dict: daemon and object -> the units of its numbers.
proc ::sorma::replaySuite::Units steps {
    set units {}
    foreach step $steps {
        if {![dict exists $units [Key $step]]} {
            dict set units [Key $step] [::sorma::replayUnits::of [dict get $step daemon] [dict get $step object]]
        }
    }
    return $units
}
proc ::sorma::replaySuite::Key step {
    return [list [dict get $step daemon] [dict get $step object]]
}
# The tolerances that patterns need.
proc ::sorma::replaySuite::Used {tolerances patterns} {
    set used [lsort -unique [lmap word [concat {*}$patterns] {if {![regexp {^~[^:]*:(.*)$} $word -> unit]} continue; set unit}]]
    return [expr {$used eq {} ? {} : [dict filter $tolerances script {unit -} {expr {$unit eq "relative" || $unit in $used}}]}]
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
        if {[dict get $step object] eq "sorm" || [::sorma::recorded::isOfBus [dict get $step request]]} continue
        dict replace $step daemon [Daemon $step] reply [::sorma::recorded::fields [dict get $step reply]]
    }]
}

proc ::sorma::replaySuite::Daemon step {
    return [regsub -all {[^\w-]+} [file rootname [file tail [dict get $step source]]] -]
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

# It can take long: who waits at a terminal is told.
proc ::sorma::replaySuite::Replies {run begin steps} {
    if {[::sorma::text::isTerminal stderr]} {
        puts stderr "run $run: [::sorma::text::counted [llength $steps] request requests]"
    }
    foreach item $begin {
        ::sorma::recorded::ask {*}$item
    }
    return [lmap step $steps {::sorma::recorded::ask [dict get $step daemon] [dict get $step request]}]
}

# The same of daemons that have just begun.
proc ::sorma::replaySuite::Again {run daemons begin steps} {
    During $daemons {
        set replies [Replies $run $begin $steps]
    }
    return $replies
}

# A pattern for each step. RUNS: replies to all of them, of each run.
proc ::sorma::replaySuite::Patterns {steps runs} {
    set n -1
    set seen [lmap step $steps {
        incr n
        list [dict get $step reply] {*}[lmap run $runs {lindex $run $n}]
    }]
    set asked {}
    foreach step $steps replies $seen {
        dict lappend asked [list [dict get $step daemon] [dict get $step request]] $replies
    }
    set widths [dict map {- replies} $asked {::sorma::recorded::widths $replies}]
    return [lmap step $steps replies $seen {
        ::sorma::recorded::pattern $replies [dict get $widths [list [dict get $step daemon] [dict get $step request]]]
    }]
}

proc ::sorma::replaySuite::Write {file out daemons begin steps patterns tolerances pause} {
    set name [file rootname [file tail $out]]
    set lines [list "# $name.test -- what was recorded in [file tail $file] is answered still. Made by sorma-replay -as-test; sorma::manual sorma-replay has the patterns." \
        {} "package require tcltest" "namespace import ::tcltest::*" "package require sorma::recorded" "customMatch recorded ::sorma::recorded::same" \
        {} "# The daemons, and the options that their objects had." "::sorma::recorded::begin [list $daemons]"]
    foreach item $begin {
        lappend lines "::sorma::recorded::ask $item"
    }
    lappend lines {} "# Wait so long before each request \[ms\], as one of the runs has done that this suite was made of." "::sorma::recorded::pause $pause"
    if {$tolerances ne {}} {
        lappend lines {} "# How far a number ~N:UNIT may be off: by so much in its unit, or by this part of it (relative), whichever is more. 0: not at all." \
            "::sorma::recorded::tolerances {"
        dict for {unit most} $tolerances {
            lappend lines "    [list $unit $most]"
        }
        lappend lines "}"
    }
    set n 0
    foreach step $steps pattern $patterns {
        set title [string range "[dict get $step daemon]: [dict get $step request]" 0 119]
        lappend lines {} "test $name-1.[incr n] [list $title] -body {" "    ::sorma::recorded::ask [list [dict get $step daemon] [dict get $step request]]" \
            "} -match recorded -result [list $pattern]"
    }
    lappend lines {} "::sorma::recorded::end" {set failed $::tcltest::numTests(Failed)} "cleanupTests" {if {$failed > 0} {exit 1}}
    set channel [open $out {WRONLY CREAT TRUNC} 0600]
    fconfigure $channel -encoding utf-8
    puts $channel [join $lines \n]
    close $channel
}
