# trail.tcl -- trails as people like to read them: each message, where it came from and when, and the stack traces of Tcl.

package require sorma::json
package require sorma::text
package provide sorma::trail 1.0

namespace eval ::sorma::trail {}

# ::sorma::showTrail --
#       A trail, whole: each message with its code, where it came from and when, and the request that shows it again. A stack
#       trace of Tcl (a message SERVICE STACK) is left to showStack.
# Arguments:
#       args    ?trail? -colour bool -width n -json bool; default: the trail of the last request, sorma::trail
proc ::sorma::showTrail args {
    if {[llength $args] % 2 == 1} {
        set args [lassign $args trail]
    } else {
        set trail [trail]
    }
    set settings [::sorma::text::styled {} $args]
    if {[dict get $settings -json]} {
        return [::sorma::json::trail $trail]
    }
    if {[llength $trail] == 0} {
        return [::sorma::text::paint "the last request had no messages" dim $settings]
    }
    set out {}
    set number 0
    foreach entry $trail {
        incr number
        if {[trail::isStack $entry]} continue
        set entry [dict merge {severity error code {} text {} so {} daemon {} file {} line {} time 0 request {}} $entry]
        dict with entry {}
        lappend out [::sorma::text::hang [::sorma::text::paint [format %-7s $severity] $severity $settings] 7 $text $settings]
        set from [trail::from $entry]
        set facts [list [join $code]]
        if {$from ne {}} {
            lappend facts "from $from"
        }
        if {$file ne {}} {
            lappend facts $file:$line
        }
        if {[string is wideinteger -strict $time] && $time > 0} {
            lappend facts [::sorma::text::time $time]
        }
        lappend out [::sorma::text::block "        " [join $facts ", "] dim $settings]
        if {$request ne {}} {
            lappend out [::sorma::text::block "        " "again: [trail::again $entry]" dim $settings]
        }
        if {[trail::isStack [lindex $trail $number]]} {
            lappend out [::sorma::text::block "        " "stack: trail $number -stack" dim $settings]
        }
    }
    return [join $out \n]
}

# ::sorma::showStack --
#       The stack trace of Tcl that came with a message of a trail.
# Arguments:
#       trail   as sorma::trail gives it
#       number  of the message, counted from 1
#       args    as of showTrail
# Results:
#       Its text. Error TRAIL STACK: there is none.
proc ::sorma::showStack {trail number args} {
    set settings [::sorma::text::styled {} $args]
    foreach at [list $number [expr {$number - 1}]] {        ;# that of the message, or itself one
        set entry [lindex $trail $at]
        if {![trail::isStack $entry]} continue
        set text [dict get $entry text]
        set so [dict get $entry so]
        if {[string match "$so: *" $text]} {
            set text [string range $text [string length $so]+2 end]
        }
        return [::sorma::text::block {} $text {} $settings]
    }
    return -code error -errorcode {SORMA TRAIL STACK} \
        "message $number of the trail has no stack trace: only plain Tcl errors of services written in Tcl have one"
}

# ::sorma::trail::from ENTRY -- object@daemon that a message came from; empty: it says neither.
proc ::sorma::trail::from entry {
    set so [dict get $entry so]
    set daemon [dict get $entry daemon]
    if {$daemon eq {} || [string match *@[::sorma::text::escape $daemon] $so]} {
        return $so
    }
    return [expr {$so eq {} ? "daemon $daemon" : "$so@$daemon"}]
}

# ::sorma::trail::again ENTRY -- the request that shows a message again, with the daemon at which it has to be entered.
proc ::sorma::trail::again entry {
    set request [dict get $entry request]
    set daemon [dict get $entry daemon]
    if {$daemon ne {} && [regexp {^([a-z][^\s@"'\{\}]*)(\s.*)$} $request -> name rest]} {
        return $name@$daemon$rest
    }
    return $request
}

# ::sorma::trail::isStack ENTRY -- is this message of a trail a stack trace?
proc ::sorma::trail::isStack entry {
    return [expr {[dict exists $entry code] && [lrange [dict get $entry code] 1 2] eq {SERVICE STACK}}]
}

# ::sorma::trail::fromWord WORD --
#       The word after TDBX as a list, with a dict for each message: severity {SYMBOL detail...} text so daemon file line time request.
#       Before them there may be: dropped N.
proc ::sorma::trail::fromWord word {
    if {[catch {llength $word} n]} {
        return [list [dict create severity error text $word]]
    }
    set out {}
    if {[lindex $word 0] eq "dropped"} {
        lappend out [dict create severity verbose code {SORMA TRAIL DROPPED} text "[lindex $word 1] older messages were dropped"]
        set word [lrange $word 2 end]
    }
    foreach {severity code text so daemon file line time request} $word {
        if {[catch {lindex $code 0} symbol]} {
            set code SORMA
        } elseif {$symbol eq "SERVICE CODE" && [llength $code] > 2} {
            set code [lrange $code 2 end]           ;# a code of the class's own, as it is
        } else {
            set code [concat SORMA [split $symbol] [lrange $code 1 end]]
        }
        set entry {}
        foreach key {severity code text so daemon file line time} {
            dict set entry $key [set $key]
        }
        if {$request ne {}} {
            dict set entry request $request
        }
        lappend out $entry
    }
    return $out
}
