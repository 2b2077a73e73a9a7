# retry.tcl -- repeat a request that failed, as long as nothing can be done twice that must be done once.
#
# The error tells: the request was answered, it never ran, or it has perhaps run. One that never ran is sent again. One that has
# perhaps run is sent again only if its class declares it repeatable. The daemon is asked for that first.

package provide sorma::retry 1.0         ;# before what needs it in turn
package require sorma::inspect

namespace eval ::sorma::inspect {
    dict set Topics retry {repeats a request that failed, as long as that is safe, and says why when it is not}
}
namespace eval ::sorma::retry {
    variable MostPause 2000     ;# ms between two attempts
    variable Options {-times {{whole 1 100000} 5} -within {{seconds 0.01 86400} 30} -pause {{whole 0 60000} 100}}
}

# ::sorma::inspect::retry ?-times n? ?-within seconds? ?-pause ms? ?-data? NAME METHOD ?word ...? --
#       The same for people: tells each attempt that failed.
# Results:
#       The reply as text. With -data as the object gave it.
proc ::sorma::inspect::retry args {
    set settings [::sorma::options::leading [dict merge $::sorma::retry::Options {-data flag}] args]
    if {[llength $args] < 2} {
        ::sorma::usage::wrong sorma::inspect::retry
    }
    set tell [list apply {news {
        dict with news {}
        Print [::sorma::text::clean "$error; again in $pause ms ($attempt of $times)"]
    } ::sorma::inspect}]
    set reply [::sorma::retry {*}[dict remove $settings -data] {*}[if {![dict get $settings -data]} {list -tell $tell}] {*}$args]
    return [if {[dict get $settings -data]} {set reply} else {::sorma::show $reply}]
}

# ::sorma::retry ?-times n? ?-within seconds? ?-pause ms? ?-tell prefix? NAME METHOD ?word ...? --
#       Make a request, and repeat it while that is safe.
# Arguments:
#       n       attempts, default 5;   seconds  for all of them, default 30
#       ms      before the second attempt, default 100; each time twice as long, 2 s at most
#       prefix  called with a dict after each attempt that is to be repeated: attempt times error pause (ms)
# Results:
#       What the request returns. Fails as the request does; the message then also says why it was not repeated.
proc ::sorma::retry args {
    set settings [::sorma::options::leading [dict merge $retry::Options {-tell any}] args]
    if {[llength $args] < 2} {
        ::sorma::usage::wrong sorma::retry
    }
    set begun [clock milliseconds]
    set end [expr {$begun + round(1000 * [dict get $settings -within])}]
    set pause [dict get $settings -pause]
    set state [dict create name [lindex $args 0] asked 0 whyNot {}]
    for {set attempt 1} {1} {incr attempt} {
        if {![catch {retry::Attempt state $args $end} result how]} {
            return $result
        }
        set why [retry::WhyStop $state $result [dict get $how -errorcode]]
        set left [expr {$end - [clock milliseconds]}]
        if {$why eq {} && ($attempt >= [dict get $settings -times] || $left <= $pause)} {
            set why "tried $attempt time[expr {$attempt > 1 ? {s} : {}}] in [format %.1f [expr {([clock milliseconds] - $begun) / 1000.0}]] s"
        }
        if {$why ne {}} {
            return -options [dict replace $how -level 1] [string cat $result [if {$why ne "answered"} {string cat "; " $why}]]
        }
        if {[dict get $settings -tell] ne {}} {
            uplevel #0 [dict get $settings -tell] [list [dict create attempt $attempt times [dict get $settings -times] error $result pause $pause]]
        }
        ::sorma::await sleep $pause
        set pause [expr {min(max(1, 2 * $pause), $retry::MostPause)}]
    }
}

# One attempt. The first one that reaches the daemon asks before whether the request may be repeated.
proc ::sorma::retry::Attempt {stateVar request end} {
    upvar 1 $stateVar state
    if {![dict get $state asked]} {
        dict set state whyNot [Ask [dict get $state name] [::sorma::RequestWords {*}$request] $end]
        dict set state asked 1
    }
    return [[::sorma::async -timeout [Left $end] {*}$request] take]
}
proc ::sorma::retry::Left end {
    set most [::sorma::configure -timeout]
    set left [expr {max(1, $end - [clock milliseconds])}]
    return [expr {$most > 0 ? min($most, $left) : $left}]
}

# Why such a request may not be repeated; empty: it may. Fails when its daemon cannot be reached.
proc ::sorma::retry::Ask {name words end} {
    lassign [::sorma::table locate $name] service where
    try {
        set reply [[::sorma::async -timeout [Left $end] [if {$where eq {}} {string cat sorm} else {string cat sorm@ $where}] \
            DBX -repeatable $service {*}$words] take]
    } trap {SORMA OPTION UNKNOWN} {} {
        return "its daemon is of an older version, which cannot tell whether it may be repeated"
    } trap {SORMA COMM DENIED} text {
        return "whether it may be repeated cannot be asked: $text"
    } on error {text how} {                 ;# told of the object that was meant
        set own [list [string cat sorm@ $where] $name]
        return -options [dict replace $how -errorcode [string map $own [dict get $how -errorcode]]] [string map $own $text]
    }
    return [lindex $reply 3]
}

# Why there is no further attempt after an error; empty: there may be one.
proc ::sorma::retry::WhyStop {state text code} {
    if {![dict get $state asked]} {
        return [if {![Passing $code]} {string cat answered}]        ;# it was not sent yet
    }
    switch -- [Verdict [dict get $state name] $text $code] {
        never { return }
        answered { return answered }
    }
    set why [dict get $state whyNot]
    return [if {$why ne {}} {string cat "it is not repeated: " $why}]
}

# Errors that may be over in a moment.
proc ::sorma::retry::Passing code {
    return [expr {[lrange $code 0 1] eq {SORMA COMM} && [lindex $code 2] in {LOST REFUSED TIMEOUT LIMIT} || [lrange $code 0 2] eq {SORMA ADDRESS UNRESOLVED}}]
}

# Did a request run? answered: yes, and the error is its answer; never; or perhaps. An error that names another object comes from a
# request that this one has made. So this one ran, at least in part.
proc ::sorma::retry::Verdict {name text code} {
    if {![Passing $code]} {
        return answered
    }
    if {![Same $name [lindex $code 3]]} {
        return perhaps
    }
    if {[lindex $code 2] in {REFUSED LIMIT UNRESOLVED}} {
        return never
    }
    return [expr {[regexp {never sent|was not executed|it did not run|never started} $text] ? {never} : {perhaps}}]
}
proc ::sorma::retry::Same {one other} {
    return [expr {$one eq $other || ![catch {
        lmap name [list $one $other] {dict filter [::sorma::resolve $name] key service address}
    } places] && [lindex $places 0] eq [lindex $places 1]}]
}
