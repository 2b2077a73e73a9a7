# events.tcl -- what objects publish, for sorma::world listen: by the lines of the model, and for as long as the object is there.
#
# Listening makes no object. One that is not there yet is waited for; one that goes and comes again is listened to again, and so is
# one whose daemon was not to be reached for a while.

package provide sorma::events 1.0         ;# before what needs it in turn
package require sorma::line
package require sorma::world

namespace eval ::sorma::events {
    namespace export new forget inUse
    namespace ensemble create
    variable Tokens             ;# dict: token -> {service daemon event queue command peer subscription}
    if {![info exists Tokens]} {
        set Tokens {}
    }
}

# ::sorma::events::new TOKEN NAME PATTERN QUEUE COMMAND -- begin; for sorma::world listen. COMMAND is called with each event, a dict as
# of sorma::subscribe.
proc ::sorma::events::new {token name pattern queue command} {
    variable Tokens
    lassign [::sorma::line::place $name] service daemon
    dict set Tokens $token [dict create service $service daemon $daemon event $pattern queue $queue command $command peer {} subscription {}]
    if {[::sorma::world get $service@$daemon] ne {}} {
        Begin $token
    }
    return $token
}

# ::sorma::events::forget TOKEN -- nothing comes after this.
proc ::sorma::events::forget token {
    variable Tokens
    if {[dict exists $Tokens $token]} {
        End $token
        dict unset Tokens $token
    }
}

# ::sorma::events::inUse -- does anybody listen?
proc ::sorma::events::inUse {} {
    variable Tokens
    return [expr {[dict size $Tokens] > 0}]
}

proc ::sorma::events::Begin token {
    variable Tokens
    dict with Tokens $token {}
    set line [::sorma::world line $daemon]
    if {$line ne {} && $line ne $peer && ($daemon ne "self" || [::sorma::exists $service])} {
        dict set Tokens $token peer $line
        dict set Tokens $token subscription [$line subscribe -event $event -queue $queue -command [list ::sorma::events::Heard $token] $service]
    }
}

proc ::sorma::events::End token {
    variable Tokens
    dict with Tokens $token {}
    if {$subscription ne {}} {
        catch {$peer unsubscribe $subscription}
    }
    dict set Tokens $token subscription {}
    dict set Tokens $token peer {}
}

proc ::sorma::events::Heard {token event} {
    variable Tokens
    if {![dict exists $Tokens $token]} {
        return
    }
    if {[dict get $event event] in {sorma.gone sorma.refused}} {
        End $token
    }
    ::sorma::world deliver [dict get $Tokens $token command] [list $event]
}

# Events of objects and connections, for the model. A subscription itself says that its object was removed: sorma.gone.
proc ::sorma::events::Happened {event key dict} {
    variable Tokens
    dict for {token t} $Tokens {
        set full [dict get $t service]@[dict get $t daemon]
        if {$event eq "line.made" ? $key eq [dict get $t daemon] && [::sorma::world get $full] ne {} : $key eq $full} {
            Begin $token
        }
    }
}

::sorma::world::hook {object.made line.made} ::sorma::events::Happened
