# recording.tcl -- the program sorma-record: what passes at daemons, in a file. An object of class recorder does the work.

package require sorma
package require sorma::commandLine
package require sorma::recordTrigger
package require sorma::text
package provide sorma::recording 1.0

namespace eval ::sorma::recording {
    variable Options {-o {{word {the name of a file}} sorma.rec} -daemon words -requests {any *} -events {any *} -buffers any -max {{word {a number of bytes, as 500M}}}
        -seconds {{seconds 0 1000000000}} -for {{seconds 0 1000000}} -on words -when any -after {{seconds 0 1000000} 1} -saves {{whole 1 100000} 20}}
    variable End            ;# set by a signal
    variable Turn           ;# set when it has waited, and when there is something to do
    variable Met 0          ;# has any daemon answered?
    variable Absent 0       ;# daemons that nobody waits for any more
    variable Away {}        ;# recorders of which it was said that they are away
    variable Reasons {}     ;# why files are to be saved
    variable Number 0       ;# of the recorders that there were: recorder.recordN
}

# ::sorma::recording::main WORDS -- run the program: the exit code.
proc ::sorma::recording::main words {
    variable Options
    return [::sorma::commandLine::run sorma-record $Options $words ::sorma::recording::Record -check ::sorma::recording::Check \
        -complete [list ::sorma::recording::complete $Options -daemon]]
}
proc ::sorma::recording::Check {settings words} {
    if {$words ne {}} {
        error "expected options alone, got \"[lindex $words 0]\""
    }
    dict with settings {}
    Bytes ${-max}
    ::sorma::recordTrigger::check ${-on} ${-when}
    if {${-requests} eq {} && ${-events} eq {}} {
        error "-requests and -events are both empty: nothing of the daemons would be recorded"
    }
    foreach {option usual} {-after 1 -saves 20} {
        if {[dict get $settings $option] != $usual && ${-on} eq {} && ${-when} eq {}} {
            error "$option has an effect with -on or -when alone"
        }
    }
}
proc ::sorma::recording::Record {settings words} {
    dict with settings {}
    set most [Bytes ${-max}]
    set when [::sorma::recordTrigger::check ${-on} ${-when}]
    set daemons [lsort -unique [expr {${-daemon} ne {} ? ${-daemon} : [Daemons]}]]
    try {
        return [During $settings $most $when $daemons]
    } on error {message how} {
        return -options $how [plain $message]
    }
}
# People know the file, not the object that has it.
proc ::sorma::recording::plain message {
    return [regsub {^recorder\.(record\d+|replay): } $message {}]
}
# Record until the end. The exit code.
proc ::sorma::recording::During {settings most when daemons} {
    variable Met
    dict with settings {}
    ::sorma::atSignal {set ::sorma::recording::End [set ::sorma::recording::Turn signal]}
    Begin ${-o} $settings $most $daemons
    if {${-on} ne {} || $when ne {}} {
        ::sorma::recordTrigger::begin $daemons ${-on} $when ${-after} ${-saves} ::sorma::recording::Wanted
    }
    puts ready
    flush stdout
    if {${-for} ne {}} {
        after [expr {round(1000 * ${-for})}] {set ::sorma::recording::End [set ::sorma::recording::Turn time]}
    }
    Run $settings $most $daemons
    Connected
    puts [string map [list ${-o}.next ${-o}] [lindex [[Recorder] CTRL -stop] 3]]
    if {!$Met} {
        puts stderr "sorma-record: no daemon has answered, so no request and no event was recorded"
    }
    return [expr {!$Met}]
}

# The one that records now.
proc ::sorma::recording::Recorder {} {
    variable Number
    return recorder.record$Number
}
# Record into a file, and wait until the daemons have answered.
proc ::sorma::recording::Begin {file settings most daemons} {
    variable Number
    incr Number
    dict with settings {}
    ::sorma::create [Recorder] -file $file -requests ${-requests} -events ${-events} -max $most -seconds [expr {${-seconds} eq {} ? 0 : ${-seconds}}] \
        -from [lmap daemon $daemons {string cat recorder@ $daemon}] -buffers ${-buffers} -together [expr {${-buffers} ne {}}]
    [Recorder] CTRL -record
    Await $daemons
}
# Until the end: save files that are wanted.
proc ::sorma::recording::Run {settings most daemons} {
    variable End
    variable Reasons
    Watch $daemons
    while {![info exists End]} {
        if {$Reasons eq {}} {
            vwait ::sorma::recording::Turn
        } else {
            set Reasons [lassign $Reasons reason]
            Save $settings $most $daemons $reason
        }
    }
}
# Say which daemons are lost and found. Say at once why records are lost, and each reason once: it may run for days.
proc ::sorma::recording::Watch {daemons {told {}}} {
    set state [State]
    # A recorder that has just begun does not know yet.
    if {[dict exists $state away] && [Connected] + [dict size [dict get $state away]] == [llength $daemons]} {
        Changes [dict get $state away]
    }
    set error [if {[dict exists $state error]} {dict get $state error}]
    if {$error ne $told && $error ne {}} {
        puts stderr "sorma-record: records are being lost: [::sorma::text::clean $error]"
        set told $error
    }
    after 1000 [list ::sorma::recording::Watch $daemons $told]
}
proc ::sorma::recording::Wanted reason {
    variable Reasons
    variable Turn 1
    lappend Reasons $reason
}
# The next recorder begins before the present one ends: so nothing is lost between their files, and some records are in both.
proc ::sorma::recording::Save {settings most daemons reason} {
    set before [Recorder]
    set file [dict get $settings -o]
    Begin $file.next $settings $most $daemons
    $before CTRL -stop
    ::sorma::remove $before
    set now [clock milliseconds]
    set saved [file rootname $file]-[clock format [expr {$now / 1000}] -format %Y%m%d-%H%M%S].[format %03d [expr {$now % 1000}]][file extension $file]
    file rename $file $saved
    file rename $file.next $file
    # A line, whatever an event says.
    puts "saved $saved: [::sorma::text::clean [string map {\n { }} $reason]]"
    flush stdout
}

# The daemons of this user on this host.
proc ::sorma::recording::Daemons {} {
    set daemons [lmap daemon [::sorma::daemons] {
        if {[dict get $daemon state] eq "dead"} continue
        dict get $daemon name
    }]
    if {$daemons eq {}} {
        return -code error "no daemon of yours runs on this host; -daemon names others"
    }
    return $daemons
}

# Wait until all daemons have answered; but not for ever: those that are away are tried again all the time. A person is told why, soon and once.
proc ::sorma::recording::Await daemons {
    variable End
    variable Absent
    for {set i 0} {$i < 250 && ![info exists End]} {incr i} {
        set absent [expr {[llength $daemons] - [Connected]}]
        if {$absent <= $Absent} {
            return
        }
        if {$i == 25} {
            Tell $daemons
        }
        after 20 {set ::sorma::recording::Turn 1}
        vwait ::sorma::recording::Turn
    }
    set Absent $absent
}
proc ::sorma::recording::Tell daemons {
    puts stderr "sorma-record: [Connected] of [llength $daemons] daemons have answered; the others are recorded when they are there"
    Changes [dict get [State] away]
}
# Say which recorders are away now, and which answer again.
proc ::sorma::recording::Changes away {
    variable Away
    foreach {who why} $away {
        if {$who ni $Away} {
            # Most reasons name it already.
            puts stderr "sorma-record: [::sorma::text::clean [expr {[string first "$who:" $why] == 0 ? $why : "$who: $why"}]]"
        }
    }
    foreach who $Away {
        if {![dict exists $away $who]} {
            puts stderr "sorma-record: $who answers"
        }
    }
    set Away [dict keys $away]
}
# How many daemons are recorded now.
proc ::sorma::recording::Connected {} {
    variable Met
    set state [State]
    set count [expr {[dict exists $state connected] ? [dict get $state connected] : 0}]
    set Met [expr {$Met || $count > 0}]
    return $count
}
proc ::sorma::recording::State {} {
    return [dict get [[Recorder] exec state] text]
}

# A number of bytes, of which k, M and G may be behind it; 0 for an empty text.
proc ::sorma::recording::Bytes size {
    if {$size eq {}} {
        return 0
    }
    if {![regexp {^(\d{1,12})([kMG]?)$} $size -> number unit]} {
        return -code error "-max expects a number of bytes, as 5000000 or 500M, got \"$size\""
    }
    scan $number %lld number
    return [expr {$number * [dict get {{} 1 k 1000 M 1000000 G 1000000000} $unit]}]
}

# ::sorma::recording::complete OPTIONS OPTION WORDS -- candidates for the last word of a command line (library/scott.bash).
# Behind OPTION they are daemons, behind other options that take a word nothing, because the shell has files, and else options.
proc ::sorma::recording::complete {options option words} {
    package require sorma::world
    set done [lrange $words 0 end-1]
    set last [lindex $done end]
    set before [if {[dict get $options $option] eq "words"} {lsearch -inline [lreverse $done] -*} else {string cat $last}]
    if {$before eq $option && ![string match -* [lindex $words end]]} {
        set found [::sorma::world::names]
    } elseif {[dict exists $options $last] && [lindex [dict get $options $last] 0] ne "flag"} {
        return
    } else {
        set found [dict keys $options -*]
    }
    return [lsort -unique [lsearch -all -inline -glob $found [::sorma::text::escape [lindex $words end]]*]]
}
