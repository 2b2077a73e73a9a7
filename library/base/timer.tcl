# timer.tcl -- what is to be done once, some time from now, however often it is asked for. It knows no bus.

package provide sorma::timer 1.0

namespace eval ::sorma::timer {
    variable Timers             ;# array: KEY -> id of after
    array set Timers {}
}

# ::sorma::timer::once KEY MS WORD ... -- call that command in so many ms, unless something waits under this key already.
proc ::sorma::timer::once {key ms args} {
    variable Timers
    if {![info exists Timers($key)]} {
        set Timers($key) [after $ms [list ::sorma::timer::Now $key $args]]
    }
}

# ::sorma::timer::waits KEY -- does something wait under it?
proc ::sorma::timer::waits key {
    variable Timers
    return [info exists Timers($key)]
}

# ::sorma::timer::cancel PATTERN -- what waits under such keys is not done.
proc ::sorma::timer::cancel pattern {
    variable Timers
    foreach key [array names Timers $pattern] {
        after cancel $Timers($key)
        unset Timers($key)
    }
}

proc ::sorma::timer::Now {key command} {
    variable Timers
    unset Timers($key)
    {*}$command
}
