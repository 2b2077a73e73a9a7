# scpiEvents.tcl -- events of objects for links of SCPI: a queue for each link, and a word when something has come. It belongs to sorma::scpiLink.
#
# The policy is asked for each event, too: it may have changed. A link that does not read loses its oldest events, and is told how many.

package require sorma
package provide sorma::scpiEvents 1.0

namespace eval ::sorma::scpiEvents {
    variable Links {}           ;# dict: id of a link -> dict: watch patterns subscriptions (dicts by object) queue bytes lost
    variable MostObjects 16     ;# that a link subscribes to
    variable MostEvents 100     ;# that wait for a link
    variable MostBytes 1048576  ;# of all of them
}

# ::sorma::scpiEvents::may WHO NAME -- may this author inspect the object?
proc ::sorma::scpiEvents::may {who name} {
    return [expr {![catch {::sorma::so::sorm CTRL -may $who inspect $name} may] && [lindex $may 1] == 0 && [string match yes* [lindex $may 3]]}]
}

# ::sorma::scpiEvents::watch ID PREFIX -- call PREFIX when an event has come.
proc ::sorma::scpiEvents::watch {id prefix} {
    variable Links
    Has $id
    dict set Links $id watch $prefix
}

# ::sorma::scpiEvents::most -- so many objects may a link subscribe to.
proc ::sorma::scpiEvents::most {} {
    variable MostObjects
    return $MostObjects
}

proc ::sorma::scpiEvents::Has id {
    variable Links
    if {![dict exists $Links $id]} {
        dict set Links $id [dict create watch {} patterns {} subscriptions {} queue {} bytes 0 lost 0]
    }
}

# ::sorma::scpiEvents::subscribe --
#       From now on events of an object are for this link.
# Arguments:
#       id who      the link, and its author
#       name        an object of this process
#       pattern     of names of events; empty: no events of the object any more
# Results:
#       False: the link has too many objects already.
proc ::sorma::scpiEvents::subscribe {id who name pattern} {
    variable Links
    variable MostObjects
    Has $id
    Leave $id $name
    if {$pattern eq {}} {
        return 1
    }
    if {[dict size [dict get $Links $id patterns]] >= $MostObjects} {
        return 0
    }
    dict set Links $id patterns $name $pattern
    dict set Links $id subscriptions $name [::sorma::subscribe $name -event $pattern -command [list ::sorma::scpiEvents::Come $id $who]]
    return 1
}

proc ::sorma::scpiEvents::Leave {id name} {
    variable Links
    if {[dict exists $Links $id subscriptions $name]} {
        catch {::sorma::unsubscribe [dict get $Links $id subscriptions $name]}
        dict unset Links $id subscriptions $name
        dict unset Links $id patterns $name
    }
}

# ::sorma::scpiEvents::pattern ID NAME -- what the link wants of an object; empty: nothing.
proc ::sorma::scpiEvents::pattern {id name} {
    variable Links
    return [if {[dict exists $Links $id patterns $name]} {dict get $Links $id patterns $name}]
}

proc ::sorma::scpiEvents::Come {id who event} {
    variable Links
    variable MostEvents
    variable MostBytes
    set name [dict get $event object]
    if {![dict exists $Links $id subscriptions $name]} return
    if {![may $who $name]} {
        return [Leave $id $name]
    }
    dict with Links $id {
        lappend queue $event
        incr bytes [Size $event]
        while {[llength $queue] > $MostEvents || $bytes > $MostBytes} {
            incr lost [expr {1 + max(0, [dict get [lindex $queue 0] lost])}]
            incr bytes -[Size [lindex $queue 0]]
            set queue [lrange $queue 1 end]
        }
    }
    if {[dict get $event event] eq "sorma.gone"} {
        Leave $id $name
    }
    if {[dict get $Links $id watch] ne {}} {
        {*}[dict get $Links $id watch]
    }
}

proc ::sorma::scpiEvents::Size event {
    set size 100
    foreach part {text floats ints any words} scale {1 8 8 1 20} {
        if {[dict exists $event $part]} {
            incr size [expr {$scale * [if {$scale == 1} {string length [dict get $event $part]} else {llength [dict get $event $part]}]}]
        }
    }
    return $size
}

# ::sorma::scpiEvents::count ID -- events that wait.
proc ::sorma::scpiEvents::count id {
    variable Links
    return [expr {[dict exists $Links $id] ? [llength [dict get $Links $id queue]] : 0}]
}

# ::sorma::scpiEvents::take ID -- the oldest event, as `sorma::subscribe` has them; its `lost` counts those that the link did not read, too. Empty: none.
proc ::sorma::scpiEvents::take id {
    variable Links
    set event {}
    if {[count $id]} {
        dict with Links $id {
            set queue [lassign $queue event]
            incr bytes -[Size $event]
            dict incr event lost $lost
            set lost 0
        }
    }
    return $event
}

# ::sorma::scpiEvents::clear ID -- drop what waits.
proc ::sorma::scpiEvents::clear id {
    variable Links
    if {[dict exists $Links $id]} {
        dict with Links $id {
            set queue {}
            set bytes [set lost 0]
        }
    }
}

# ::sorma::scpiEvents::end ID -- the link ends.
proc ::sorma::scpiEvents::end id {
    variable Links
    if {[dict exists $Links $id]} {
        foreach name [dict keys [dict get $Links $id subscriptions]] {
            Leave $id $name
        }
        dict unset Links $id
    }
}
