# observe.tcl -- changes and events: watch tells those of an object, monitor all requests and events of a daemon, rate how often an object
# publishes. They only listen, by the lines of the model.

package provide sorma::observe 1.0         ;# before what needs it in turn
package require sorma::inspect

namespace eval ::sorma::inspect {
    variable Watches            ;# dict: id -> {kind name command tokens, and what that kind of watch has}
    variable LastWatch
    if {![info exists Watches]} {
        set Watches {}
        set LastWatch 0
    }
}

# ---- watch ----

# ::sorma::inspect::watch NAME ?-event pattern? ?-every ms? ?-command prefix? --
#       Tell what changes in an object, and what it publishes. Without a name: the watches that there are, a list of {id name}.
# Arguments:
#       pattern tell only of events whose name fits, and nothing of changes
#       every   ms between two looks at what changes by itself, default 1000; what CTRL changes is told at once
#       prefix  is called with a dict of name, time [ms] and one of these; default: a line on standard output
#               changes   list of {what old new}
#               event     a dict as for sorma::subscribe
#               error     the object cannot be seen; told once
# Results:
#       Its id, for unwatch. An object that is not there is waited for.
proc ::sorma::inspect::watch args {
    variable Watches
    variable LastWatch
    if {[llength $args] == 0} {
        return [lmap {id watch} $Watches {list $id [dict get $watch name]}]
    }
    set options [lassign $args name]
    set settings [::sorma::options::parse {-every {{whole 1 {}} 1000} -event any -command {any ::sorma::inspect::PrintWatch}} $options]
    set every [dict get $settings -every]
    lassign [::sorma::table locate $name] service where
    set id watch[incr LastWatch]
    set pattern [dict get $settings -event]
    dict set Watches $id [dict create name $name command [dict get $settings -command] known {} error {} tokens {} held [::sorma::world hold $where]]
    set key [::sorma::world use $where]
    if {$key eq {}} {
        return -code error -errorcode [list SORMA ADDRESS UNRESOLVED $where] "$name: \"$where\" leads nowhere"
    }
    set tokens [list [::sorma::world listen $service@$key -event [if {$pattern eq {}} {string cat *} else {set pattern}] \
        -command [list ::sorma::inspect::Happened $id]]]
    # Also when only events are wanted: it says whether there is such an object.
    lappend tokens [::sorma::world value $service@$key * -every $every -command [list ::sorma::inspect::Valued $id [expr {$pattern eq {}}]]]
    dict set Watches $id tokens $tokens
    return $id
}

# ::sorma::inspect::unwatch ?id? --
#       End a watch, or a monitor; without its id all of them.
proc ::sorma::inspect::unwatch {{only {}}} {
    variable Watches
    if {$only ne {} && ![dict exists $Watches $only]} {
        return -code error -errorcode {SORMA REQUEST SYNTAX} "\"$only\"[::sorma::DidYouMean $only [dict keys $Watches]] is no watch: there are [if {[dict size $Watches] > 0} {join [dict keys $Watches] {, }} else {string cat none}]"
    }
    foreach id [if {$only eq {}} {dict keys $Watches} else {list $only}] {
        set watch [dict get $Watches $id]
        dict unset Watches $id
        foreach token [dict get $watch tokens] {
            ::sorma::world unwatch $token
        }
        ::sorma::world release [dict get $watch held]
    }
}

# Events of the model about its values.
proc ::sorma::inspect::Valued {id changesToo what name told} {
    variable Watches
    if {![dict exists $Watches $id]} {
        return
    }
    set known [dict get $Watches $id known]
    set error {}
    set changes {}
    dict for {item value} $told {
        if {[dict get $value state] ne "live"} {
            set error [dict get $value why]
            continue
        }
        set new [dict get $value value]
        if {![dict exists $known $item]} {
            lappend changes [list $item {} $new]
        } elseif {[dict get $known $item] ne $new} {
            lappend changes [list $item [dict get $known $item] $new]
        }
        dict set known $item $new
    }
    dict set Watches $id known $known
    if {$error ne [dict get $Watches $id error]} {
        dict set Watches $id error $error
        if {$error ne {}} {
            Tell $id error $error
        }
    }
    if {$changesToo && [llength $changes] > 0} {
        Tell $id changes $changes
    }
}

proc ::sorma::inspect::Happened {id event} {
    variable Watches
    if {[dict exists $Watches $id] && [dict get $event event] ne "sorma.refused"} {
        Tell $id event $event
    }
}

proc ::sorma::inspect::Tell {id what content} {
    variable Watches
    set news [dict create name [dict get $Watches $id name] time [clock milliseconds] $what $content]
    uplevel #0 [list {*}[dict get $Watches $id command] $news]
}

proc ::sorma::inspect::PrintWatch news {
    Print [::sorma::listing watched $news]
}

proc ::sorma::inspect::Print line {
    try {
        puts $line
        flush stdout
    } trap {POSIX EPIPE} {} - trap {POSIX EIO} {} {
        unwatch                                 ;# the reader has ended, as after "| head"
    }
}

# ---- monitor ----

# ::sorma::inspect::monitor ?pattern? ?@daemon? ?-only kinds? ?-command prefix? --
#       Show the traffic of a daemon, from now on, until unwatch. These are requests that come in, their replies, and events that go to
#       somebody.
# Arguments:
#       pattern of the objects that are meant, default all
#       daemon  which, may be a pattern; default all but this process
#       kinds   list of request, reply, event, error (a reply that failed); default request reply event
#       prefix  is called with a dict: where, kind, object, method (of an event its name), caller, number, code, ran [us], text,
#               time [us since 1970], lost. Default: a line on standard output
# Results:
#       Its id, or ids, for unwatch.
proc ::sorma::inspect::monitor args {
    variable Watches
    variable LastWatch
    variable Wait
    set settings [::sorma::options::parse {-only {{some request reply event error} {request reply event}}
        -command {any ::sorma::inspect::PrintPassing}} $args words]
    lassign [Parse $words {pattern *} 1] pattern wheres
    set places [lsearch -all -inline -not -exact [Places [if {[llength $wheres] > 0} {set wheres} else {string cat *}]] {}]
    if {[llength $places] == 0} {
        return -code error -errorcode {SORMA ADDRESS UNRESOLVED} "no daemon is called [join $wheres]: sorma::inspect daemons lists them"
    }
    set ids {}
    foreach {where key trouble} [::sorma::await daemons $Wait $places counted] {
        if {$trouble ne {}} {
            if {[llength $places] == 1} {
                return -code error -errorcode [list SORMA COMM REFUSED $where] "@$where: $trouble"
            }
            continue
        }
        set id watch[incr LastWatch]
        dict set Watches $id [dict create name "monitor $pattern@$where" where $where command [dict get $settings -command] \
            pattern $pattern only [dict get $settings -only] held [::sorma::world hold $where] \
            tokens [list [::sorma::world listen sorm@$key -event monitor.* -queue 10000 -command [list ::sorma::inspect::Passed $id]]]]
        lappend ids $id
    }
    return $ids
}

proc ::sorma::inspect::Passed {id told} {
    variable Watches
    if {![dict exists $Watches $id]} {
        return
    }
    set watch [dict get $Watches $id]
    set news [dict create where [dict get $watch where] kind note object {} method [dict get $told event] caller {} number {} code {} ran {}]
    if {[regexp {^monitor\.(.*)} [dict get $told event] -> kind]} {
        lassign [dict get $told words] object method caller number code
        if {![string match [dict get $watch pattern] $object]} {
            return
        }
        set wanted [dict get $watch only]
        if {$kind ni $wanted && !($kind eq "reply" && "error" in $wanted && $code < 0)} {
            return
        }
        dict set news kind $kind
        dict set news object $object
        dict set news method $method
        if {$kind ne "event"} {         ;# whose further words are its own
            dict set news caller $caller
            dict set news number $number
            dict set news code $code
            dict set news ran [lindex [dict get $told ints] 0]
        }
    }
    foreach key {text time lost} {
        dict set news $key [dict get $told $key]
    }
    uplevel #0 [list {*}[dict get $watch command] $news]
}

proc ::sorma::inspect::PrintPassing news {
    Print [::sorma::listing passing $news]
}

# ---- rate ----

# ::sorma::inspect::rate NAME ?-event pattern? ?-for seconds? ?-data? --
#       How often an object publishes: listen for a while (default 3 s), and count. Times are those of the publisher.
# Results:
#       With -data a list of dicts, one for each event: event count rate [1/s] lost mean min max jitter. The last four are of the times
#       between two events [s]; the jitter is their standard deviation.
proc ::sorma::inspect::rate args {
    variable Heard
    variable LastWatch
    variable Wait
    set settings [::sorma::options::parse {-event {any *} -for {{seconds 0 86400} 3} -data flag} $args names]
    if {[llength $names] != 1} {
        ::sorma::usage::wrong sorma::inspect::rate
    }
    dict with settings {}
    set seconds ${-for}
    set name [lindex $names 0]
    Existing $name ", so there are no events"
    lassign [::sorma::table locate $name] service where
    lassign [::sorma::await daemons $Wait [list $where] counted] - key
    set held [::sorma::world hold $where]
    set id [incr LastWatch]
    set Heard($id) {}
    set token [::sorma::world listen $service@$key -event [dict get $settings -event] -queue 100000 -command [list ::sorma::inspect::Hear $id]]
    try {
        ::sorma::await sleep [expr {round(1000 * $seconds)}]
        set heard $Heard($id)
    } finally {
        unset Heard($id)
        ::sorma::world unwatch $token
        ::sorma::world release $held
    }
    if {[dict exists $heard sorma.refused]} {
        return -code error -errorcode [list SORMA COMM DENIED $name] [dict get $heard sorma.refused text]
    }
    set items [lmap event [lsort [dict keys $heard]] {Rated $event [dict get $heard $event]}]
    if {${-data}} {
        return $items
    }
    if {[llength $items] == 0} {
        return "$name has published nothing in [::sorma::listing digits $seconds] s"
    }
    return [::sorma::listing rates $items]
}

# times: of the events [us], as they came; lost: how many; text of the last one.
proc ::sorma::inspect::Hear {id event} {
    variable Heard
    if {![info exists Heard($id)]} {
        return
    }
    set name [dict get $event event]
    if {![dict exists $Heard($id) $name]} {
        dict set Heard($id) $name {times {} lost 0 text {}}
    }
    dict with Heard($id) $name {
        lappend times [dict get $event time]
        incr lost [expr {max(0, [dict get $event lost])}]
        set text [dict get $event text]
    }
}

proc ::sorma::inspect::Rated {event heard} {
    set times [dict get $heard times]
    set out [dict create event $event count [llength $times] rate {} mean {} min {} max {} jitter {} lost [dict get $heard lost]]
    set steps [lmap a [lrange $times 0 end-1] b [lrange $times 1 end] {expr {($b - $a) / 1e6}}]
    set n [llength $steps]
    if {$n > 0} {
        set mean [expr {([lindex $times end] - [lindex $times 0]) / 1e6 / $n}]
        set squares [tcl::mathop::+ {*}[lmap step $steps {expr {($step - $mean) ** 2}}]]
        dict set out rate [expr {$mean > 0 ? 1 / $mean : {}}]
        dict set out mean $mean
        dict set out min [tcl::mathfunc::min {*}$steps]
        dict set out max [tcl::mathfunc::max {*}$steps]
        dict set out jitter [expr {sqrt($squares / $n)}]
    }
    return $out
}
