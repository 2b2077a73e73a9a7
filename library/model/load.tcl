# load.tcl -- the busiest objects of each daemon, and how often they are called, from time to time.

package require sorma::world
package provide sorma::load 1.0

namespace eval ::sorma::load {
    namespace export watch unwatch
    namespace ensemble create
    variable Watches            ;# dict: token -> {command count every timer before}. before: dict: name@daemon -> {calls time}
    variable Last
    if {![info exists Last]} {
        set Watches {}
        set Last 0
    }
}

# ::sorma::load::watch ?-count n? ?-every ms? -command PREFIX --
#       PREFIX is called each time that a daemon has answered (every: default 1000 ms). It gets DAEMON and a list of dicts name class
#       calls underway rate [1/s] p99 [s], the most called first. Rates are there from the second time on. 99 of 100 EXEC took at most p99; it
#       is empty where none has been timed.
# Results:
#       A token, for unwatch.
proc ::sorma::load::watch args {
    variable Watches
    variable Last
    set settings [::sorma::options::parse {-count {{whole 1 {}} 20} -every {{whole 1 {}} 1000} -command any} $args]
    set token load[incr Last]
    dict set Watches $token [dict create command [dict get $settings -command] count [dict get $settings -count] \
        every [dict get $settings -every] timer [after 0 [list ::sorma::load::Ask $token]] before {} \
        world [::sorma::world watch {} -command {apply {args {}}}]]
    return $token
}

# ::sorma::load::unwatch TOKEN
proc ::sorma::load::unwatch token {
    variable Watches
    if {[dict exists $Watches $token]} {
        after cancel [dict get $Watches $token timer]
        ::sorma::world unwatch [dict get $Watches $token world]
        dict unset Watches $token
    }
}

proc ::sorma::load::Ask token {
    variable Watches
    dict set Watches $token timer [after [dict get $Watches $token every] [list ::sorma::load::Ask $token]]
    foreach daemon [::sorma::world keys] {
        if {[dict get [::sorma::world get $daemon] state] in {alive busy}} {
            ::sorma::world ask $daemon [list sorm DBX -inventory busiest [dict get $Watches $token count]] -command [list ::sorma::load::Told $token $daemon]
        }
    }
}

proc ::sorma::load::Told {token daemon status value} {
    variable Watches
    if {![dict exists $Watches $token] || $status ne "ok" || [catch {dict get [dict get $value text] busiest} items]} {
        return
    }
    set now [clock milliseconds]
    set before [dict get $Watches $token before]
    set rows {}
    foreach item $items {
        lassign $item name class calls underway p99
        if {![string is wideinteger -strict $calls]} continue
        set key $name@$daemon
        set rate {}
        if {[dict exists $before $key]} {
            lassign [dict get $before $key] old then
            set rate [expr {$calls >= $old && $now > $then ? 1000.0 * ($calls - $old) / ($now - $then) : 0.0}]
        }
        dict set before $key [list $calls $now]
        lappend rows [dict create name $name class $class calls $calls underway $underway rate $rate \
            p99 [if {[string is wideinteger -strict $p99] && $p99 > 0} {expr {$p99 * 1e-9}}]]
    }
    dict set Watches $token before $before
    ::sorma::news::deliver [dict get $Watches $token command] [list $daemon $rows]
}
