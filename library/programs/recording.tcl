# recording.tcl -- the program sorma-record: what passes at daemons, in a file. An object of class recorder does the work.

package require sorma
package require sorma::options
package require sorma::text
package require sorma::usage
package provide sorma::recording 1.0

namespace eval ::sorma::recording {
    variable Options {-o {{word {the name of a file}} sorma.rec} -daemon words -requests {any *} -events {any *} -buffers any -max {{word {a number of bytes, as 500M}}}
        -seconds {{seconds 0 1000000000}} -for {{seconds 0 1000000}} -help flag --help flag -h flag}
    variable End            ;# set by a signal
    variable Turn           ;# set when it has waited
}

# ::sorma::recording::main WORDS -- run the program: the exit code.
proc ::sorma::recording::main words {
    ::sorma::options::suggest ::sorma::DidYouMean
    variable Options
    if {[lindex $words 0] eq "--complete"} {
        puts [join [complete $Options -daemon [lrange $words 1 end]] \n]
        return 0
    }
    try {
        set settings [::sorma::options::parse $Options $words]
        set most [Bytes [dict get $settings -max]]
    } on error message {
        puts stderr "sorma-record: $message\n[::sorma::usage::program sorma-record]"
        return 2
    }
    dict with settings {}
    if {${-help} || ${--help} || ${-h}} {
        puts [::sorma::usage::program sorma-record]
        return 0
    }
    try {
        set daemons [expr {${-daemon} ne {} ? ${-daemon} : [Daemons]}]
        ::sorma::atSignal {set ::sorma::recording::End signal}
        set from [lmap daemon $daemons {string cat recorder@ $daemon}]
        ::sorma::create recorder.record -file ${-o} -requests ${-requests} -events ${-events} -max $most -seconds [expr {${-seconds} eq {} ? 0 : ${-seconds}}] -from $from \
            -buffers ${-buffers} -together [expr {${-buffers} ne {}}]
        recorder.record CTRL -record
        Await $daemons
        puts ready
        flush stdout
        if {${-for} ne {}} {
            after [expr {round(1000 * ${-for})}] {set ::sorma::recording::End time}
        }
        if {![info exists ::sorma::recording::End]} {
            vwait ::sorma::recording::End
        }
        puts [lindex [recorder.record CTRL -stop] 3]
    } on error message {
        puts stderr "sorma-record: $message"
        return 1
    }
    return 0
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

# Wait until all daemons have answered; but not for ever: those that are away are tried again all the time.
proc ::sorma::recording::Await daemons {
    variable End
    for {set i 0} {$i < 250 && ![info exists End]} {incr i} {
        if {[Connected] == [llength $daemons]} {
            return
        }
        after 20 {set ::sorma::recording::Turn 1}
        vwait ::sorma::recording::Turn
    }
    if {![info exists End]} {
        puts stderr "sorma-record: [Connected] of [llength $daemons] daemons have answered; the others are recorded when they are there"
        foreach {- who why} [regexp -all -inline -line {^# away (\S+): (.*)$} [lindex [recorder.record CTRL -dump] 3]] {
            puts stderr "sorma-record: [::sorma::text::clean "$who: $why"]"
        }
    }
}
proc ::sorma::recording::Connected {} {
    regexp -line {^# connected (\d+)$} [lindex [recorder.record CTRL -dump] 3] -> n
    return $n
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

# ::sorma::recording::complete OPTIONS OPTION WORDS -- candidates for the last word of a command line (library/scott.bash): daemons behind OPTION, else options.
proc ::sorma::recording::complete {options option words} {
    package require sorma::world
    set before [lsearch -inline -not [lreverse [lrange $words 0 end-1]] {[!-]*}]
    set found [expr {$before eq $option && ![string match -* [lindex $words end]] ? [::sorma::world::names] : [dict keys $options -*]}]
    return [lsort -unique [lsearch -all -inline -glob $found [::sorma::text::escape [lindex $words end]]*]]
}
