# observe.tcl -- what passes: monitor shows the requests, replies and events of a daemon, rate how often an object publishes.
#
# Part of sorma::inspect, which reads it. Both only listen: they subscribe by the interpreter that asks (discover.tcl).

# ::sorma::inspect::monitor ?pattern? ?@daemon? ?-only kinds? ?-command prefix? --
#       Show what passes through a daemon, from now on, until unwatch: requests that come in, their replies, and events that go
#       to somebody.
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
    set settings {-only {request reply event} -command ::sorma::inspect::PrintPassing}
    set words {}
    while {[llength $args] > 0} {
        set args [lassign $args word]
        if {![dict exists $settings $word]} {
            lappend words $word
        } elseif {[llength $args] == 0} {
            return -code error -errorcode {SORMA REQUEST SYNTAX} "$word needs a value; should be [::sorma::complete::usage sorma::inspect::monitor]"
        } else {
            set args [lassign $args value]
            dict set settings $word $value
        }
    }
    foreach kind [dict get $settings -only] {
        if {$kind ni {request reply event error}} {
            return -code error -errorcode {SORMA REQUEST SYNTAX} "-only expects a list of request, reply, event and error, got \"$kind\""
        }
    }
    lassign [Parse $words {pattern *} 1] pattern wheres
    set places [lsearch -all -inline -not -exact [Places [if {[llength $wheres] > 0} {set wheres} else {string cat *}]] {}]
    if {[llength $places] == 0} {
        return -code error -errorcode {SORMA ADDRESS UNRESOLVED} "no daemon is called [join $wheres]: sorma::inspect daemons lists them"
    }
    ::sorma::discover::await $Wait $places $::sorma::discover::inventoryRequest
    set ids {}
    foreach where $places {
        set trouble [::sorma::discover::trouble $where]
        if {$trouble ne {}} {
            if {[llength $places] == 1} {
                return -code error -errorcode [list SORMA COMM REFUSED $where] "@$where: $trouble"
            }
            continue
        }
        set id watch[incr LastWatch]
        set token [Listen sorm $where monitor.* 10000 [list ::sorma::inspect::Passed $id]]
        dict set Watches $id [dict create name "monitor $pattern@$where" service sorm where $where every 0 \
            command [dict get $settings -command] event $pattern known [dict get $settings -only] error {} timer {} future {} subscription $token]
        lappend ids $id
    }
    return $ids
}

# Subscribe to an object elsewhere, by the interpreter that asks; or here.
proc ::sorma::inspect::Listen {service where pattern queue command} {
    if {$where eq {}} {
        return [::sorma::subscribe $service -event $pattern -queue $queue -command $command]
    }
    set peer [::sorma::discover::asker]
    interp alias $peer [lindex $command 0] {} [lindex $command 0]
    set target [::sorma::discover::numeric [::sorma::discover::address $where]]
    if {$target eq {}} {
        return -code error -errorcode [list SORMA ADDRESS UNRESOLVED $where] [::sorma::discover::whyNot [::sorma::discover::address $where]]
    }
    return [interp eval $peer [list ::sorma::subscribe $service@$target -event $pattern -queue $queue -command $command]]
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
        if {![string match [dict get $watch event] $object]} {
            return
        }
        set wanted [dict get $watch known]
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
    try {
        puts [PassingText $news]
        flush stdout
    } trap {POSIX EPIPE} {} - trap {POSIX EIO} {} {
        unwatch
    }
}

# ::sorma::inspect::PassingText --
#       What a monitor tells, as text: 10:31:02.123 robot > foo.a CTRL -tempo presto  (anna@lab tclsh[4711], 12)
proc ::sorma::inspect::PassingText news {
    dict with news {}
    set head "[clock format [expr {$time / 1000000}] -format %H:%M:%S].[format %03d [expr {$time / 1000 % 1000}]] $where"
    set text [::sorma::text::clean [string map {\n { }} $text]]
    set colour {}
    switch -- $kind {
        request { set line "> [string trimright "$object $method $text"]  ($caller, $number)" }
        reply {
            set line "< [string trimright "$object RET $code $text"]  ($number, [Microseconds $ran])"
            set colour [expr {$code < 0 ? "error" : $code > 0 ? "warning" : {}}]
        }
        event { set line "* $object $method $text" }
        default { set line "- $method $text" }
    }
    if {$lost != 0} {
        append line "  ([if {$lost > 0} {set lost} else {string cat some}] lost before)"
    }
    return [::sorma::text::paint [::sorma::text::cut "$head $line" [Width]] $colour [Style]]
}

proc ::sorma::inspect::Microseconds us {
    if {![string is double -strict $us]} {
        return ?
    }
    return [if {$us < 1000} {string cat [Digits $us] " us"} elseif {$us < 1000000} {
        string cat [Digits [expr {$us / 1e3}]] " ms"
    } else {
        string cat [Digits [expr {$us / 1e6}]] " s"
    }]
}

# Three digits, without an exponent.
proc ::sorma::inspect::Digits x {
    set places [expr {abs($x) >= 100 || $x == int($x) ? 0 : abs($x) >= 10 ? 1 : 2}]
    return [format %.${places}f $x]
}

# ::sorma::inspect::rate NAME ?-event pattern? ?-for seconds? ?-data? --
#       How often an object publishes: listen for a while (default 3 s), and count. Times are those of the publisher.
# Results:
#       With -data a list of dicts, one for each event: event, count, rate [1/s], mean, min, max, jitter [s, between two of them;
#       jitter is the standard deviation], lost.
proc ::sorma::inspect::rate args {
    set settings {-event * -for 3}
    set data 0
    set names {}
    while {[llength $args] > 0} {
        set args [lassign $args word]
        if {$word eq "-data"} {
            set data 1
        } elseif {![dict exists $settings $word]} {
            lappend names $word
        } else {
            set args [lassign $args value]
            dict set settings $word $value
        }
    }
    if {[llength $names] != 1} {
        return -code error -errorcode {SORMA REQUEST SYNTAX} "wrong # args: should be \"[::sorma::complete::usage sorma::inspect::rate]\""
    }
    set seconds [dict get $settings -for]
    if {![string is double -strict $seconds] || !($seconds > 0 && $seconds <= 86400)} {
        return -code error -errorcode {SORMA REQUEST SYNTAX} "-for expects seconds, more than 0, got \"$seconds\""
    }
    ::sorma::discover::lookAgain
    set name [lindex $names 0]
    lassign [::sorma::discover::locate $name] service where
    set table [Describe $name]
    if {![dict get $table exists]} {
        return -code error -errorcode [list SORMA SERVICE GONE $name] "$name: there is no such object, and so it publishes nothing"
    }
    variable Heard
    set id [incr ::sorma::inspect::LastWatch]
    set Heard($id) {}
    set token [Listen $service $where [dict get $settings -event] 100000 [list ::sorma::inspect::Hear $id]]
    try {
        ::sorma::discover::sleep [expr {round(1000 * $seconds)}]
        set heard $Heard($id)
    } finally {
        unset Heard($id)
        if {$where eq {}} {
            catch {::sorma::unsubscribe $token}
        } else {
            catch {interp eval [::sorma::discover::asker] [list ::sorma::unsubscribe $token]}
        }
    }
    set items [lmap event [lsort [dict keys $heard]] {Rated $event [dict get $heard $event]}]
    if {$data} {
        return $items
    }
    if {[llength $items] == 0} {
        return "$name has published nothing in [Digits $seconds] s"
    }
    set rows [lmap item $items {
        dict with item {}
        list $event $count [if {$rate ne {}} {string cat [Digits $rate] /s}] {*}[lmap value [list $mean $min $max $jitter] {
            if {$value ne {}} {Microseconds [expr {1e6 * $value}]}
        }] [if {$lost != 0} {set lost}]
    }]
    return [Table {event count rate mean min max jitter lost} $rows {1 2 3 4 5 6 7}]
}

# times: of the events [us], as they came; lost: how many.
proc ::sorma::inspect::Hear {id event} {
    variable Heard
    if {![info exists Heard($id)]} {
        return
    }
    set name [dict get $event event]
    if {![dict exists $Heard($id) $name]} {
        dict set Heard($id) $name {times {} lost 0}
    }
    dict with Heard($id) $name {
        lappend times [dict get $event time]
        incr lost [expr {max(0, [dict get $event lost])}]
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
