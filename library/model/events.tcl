# events.tcl -- what objects publish, for sorma::world listen: by the lines of the model, and for as long as the object is there.
#
# Listening makes no object. It waits for a source that is not there yet. It listens again to a source that went and came back,
# also when only its daemon could not be reached for a while.

package require sorma::line
package require sorma::news
package require sorma::worldDaemon
package provide sorma::events 1.0

namespace eval ::sorma::events {
    namespace export new forget
    namespace ensemble create
    variable Tokens             ;# dict: token -> object
    if {![info exists Tokens]} {
        set Tokens {}
    }
}

# ::sorma::events::new TOKEN NAME PATTERN QUEUE COMMAND ?WHO? -- begin; for sorma::world listen. COMMAND is called with each event, a dict as
# of sorma::subscribe.
proc ::sorma::events::new {token name pattern queue command {who {}}} {
    dict set ::sorma::events::Tokens $token [ear new $name $pattern $queue $command $who]
    return $token
}

# ::sorma::events::forget TOKEN -- nothing comes after this.
proc ::sorma::events::forget token {
    variable Tokens
    if {[dict exists $Tokens $token]} {
        [dict get $Tokens $token] destroy
        dict unset Tokens $token
    }
}

if {![info object isa object ::sorma::events::ear]} {oo::class create ::sorma::events::ear}
oo::define ::sorma::events::ear {
    variable service daemon pattern queue command who peer subscription

    constructor {name events most prefix author} {
        lassign [::sorma::line::place $name] service daemon
        set pattern $events
        set queue $most
        set command $prefix
        set who $author
        set peer [set subscription {}]
        ::sorma::worldDaemon::attach $service@$daemon [self]
        my Begin
    }
    destructor {
        my End
        ::sorma::worldDaemon::detach $service@$daemon [self]
    }
    method Begin {} {
        set there [::sorma::worldDaemon::of $daemon]
        if {$there eq {} || [$there object $service@$daemon] eq {}} return
        set line [$there line]
        if {$line ne {} && $line ne $peer && ($daemon ne "self" || [::sorma::exists $service])} {
            set peer $line
            set subscription [$line subscribe -event $pattern -queue $queue -command [list [self] Heard] {*}[if {$who ne {}} {list -as $who}] $service]
        }
    }
    method End {} {
        if {$subscription ne {}} {
            catch {$peer unsubscribe $subscription}
        }
        set peer [set subscription {}]
    }
    method Heard event {
        if {[dict get $event event] in {sorma.gone sorma.refused}} {
            my End
        }
        ::sorma::news::deliver $command [list $event]
    }
    # A subscription itself says that its object was removed: sorma.gone.
    method objectMade {} {
        my Begin
    }
    method lineMade {} {
        my Begin
    }
    method objectRemoved {} {}
    method daemonChanged {} {}
    method daemonProcess {} {}

    export Heard
}
