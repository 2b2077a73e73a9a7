# recordTrigger.tcl -- what makes sorma-record save its black box: an event, a failed request, or an option that passes a bound.

package require sorma
package require sorma::inspect
package require sorma::text
package require sorma::world
package provide sorma::recordTrigger 1.0

namespace eval ::sorma::recordTrigger {
    variable Command        ;# called with the reason when it is time to save
    variable After 1        ;# s from a trigger until then
    variable Left 0         ;# files that may still be saved
    variable Timer {}       ;# id of after, while one is waited for
    variable Holds {}       ;# dict: condition -> does it hold; those whose option has been seen
    variable Said {}        ;# dict whose keys are the conditions of which something was said
}

# ::sorma::recordTrigger::check ON WHEN -- an error when these are no lists of events and of conditions. Returns the conditions, as a list.
proc ::sorma::recordTrigger::check {on when} {
    set operators {< <= > >= == !=}
    # One condition alone needs no braces.
    if {[string is list $when] && [llength $when] == 4 && [lindex $when 2] in $operators} {
        set when [list $when]
    }
    foreach item $on {
        if {![regexp {^([^:\s]+:)?[^:\s]+$} $item]} {
            return -code error "-on expects EVENT or OBJECT:EVENT, got \"$item\""
        }
    }
    foreach item $when {
        if {![string is list $item] || [llength $item] != 4 || ![string match -?* [lindex $item 1]] || [lindex $item 2] ni $operators} {
            return -code error "-when expects {NAME -option OP VALUE}, OP one of $operators, got \"$item\""
        }
        if {![string match ?*@?* [lindex $item 0]]} {
            return -code error "-when expects a name with its daemon, as [lindex $item 0]@lab, got \"[lindex $item 0]\""
        }
    }
    return $when
}

# ::sorma::recordTrigger::begin DAEMONS ON WHEN AFTER SAVES COMMAND -- look out. DAEMONS: names or addresses of those that are recorded.
proc ::sorma::recordTrigger::begin {daemons on when after saves command} {
    variable Command $command
    variable After $after
    variable Left $saves
    foreach daemon $daemons {
        foreach item $on {
            set object [expr {[regexp {^([^:]+):} $item - object] ? $object : "sorm"}]
            set words [list -event [lindex [split $item :] end] -command [list ::sorma::recordTrigger::Happened $object $daemon]]
            # The model knows when one that is away is there.
            if {[catch {::sorma::subscribe $object@$daemon {*}$words}]} {
                ::sorma::world hold $daemon
                ::sorma::world listen $object@[::sorma::world use $daemon] {*}$words
            }
        }
    }
    foreach item $when {
        ::sorma::inspect::watch [lindex $item 0] -every 100 -command [list ::sorma::recordTrigger::Changed $item]
    }
    after 5000 [list ::sorma::recordTrigger::Seen $when]
}
# A condition that was not seen is told: its name may be mistyped.
proc ::sorma::recordTrigger::Seen when {
    variable Holds
    foreach item $when {
        if {![dict exists $Holds $item]} {
            Say $item "has not been seen yet"
        }
    }
}
proc ::sorma::recordTrigger::Say {condition what} {
    variable Said
    if {![dict exists $Said $condition]} {
        puts stderr [::sorma::text::clean "sorma-record: -when {$condition}: $what; it is waited for"]
    }
    dict set Said $condition 1
}
proc ::sorma::recordTrigger::Happened {object daemon event} {
    if {![string match sorma.* [dict get $event event]]} {
        Fire "$object@$daemon event [dict get $event event] [string range [dict get $event text] 0 200]"
    }
}
# It fires when a condition begins to hold.
proc ::sorma::recordTrigger::Changed {condition told} {
    variable Holds
    lassign $condition name option op bound
    if {[dict exists $told error]} {
        Say $condition [dict get $told error]
    }
    if {![dict exists $told changes]} return
    foreach change [dict get $told changes] {
        lassign $change what old new
        if {$what eq $option} {
            set holds [expr "\$new $op \$bound"]
            if {$holds && !([dict exists $Holds $condition] && [dict get $Holds $condition])} {
                Fire "$name $option is $new, $op $bound"
            }
            dict set Holds $condition $holds
        }
    }
    if {![dict exists $Holds $condition]} {
        Say $condition "$name has no option $option"
    }
}
# Another trigger while one is waited for belongs to it.
proc ::sorma::recordTrigger::Fire reason {
    variable After
    variable Left
    variable Timer
    if {$Timer eq {} && $Left > 0} {
        set Timer [after [expr {round(1000 * $After)}] [list ::sorma::recordTrigger::Due $reason]]
    }
}
proc ::sorma::recordTrigger::Due reason {
    variable Command
    variable Left
    variable Timer {}
    incr Left -1
    {*}$Command [expr {$Left > 0 ? $reason : "$reason; no more files are saved"}]
}
