# worldSelf.tcl -- this process, as one of the daemons of sorma::world: its line only subscribes, and its requests are futures.

package require sorma::message
package require sorma::worldDaemon
package provide sorma::worldSelf 1.0

namespace eval ::sorma::worldSelf {
    variable Underway           ;# dict: number -> future
    if {![info exists Underway]} {
        set Underway {}
    }
}

proc ::sorma::worldSelf::Answer {prefix future} {
    variable Underway
    dict unset Underway [$future request]
    if {[catch {::sorma::KeepTrail [list $future take]} result options]} {
        return [::sorma::news::deliver $prefix [list error [list $result [dict get $options -errorcode]]]]
    }
    # A dict stays; the trail is the user's.
    if {[lindex $result 0] eq "RET"} {
        set result [dict remove [::sorma::message::fromList $result] trail]
    }
    ::sorma::news::deliver $prefix [list ok $result]
}

if {![info object isa object ::sorma::worldSelf::daemon]} {oo::class create ::sorma::worldSelf::daemon}
oo::define ::sorma::worldSelf::daemon {
    superclass ::sorma::worldDaemon::daemon
    variable peer

    constructor {} {
        set peer [::sorma::peer open self]
        $peer subscribe -event {[dot][bir][cja]*} -queue 100000 -command [list [self] Happened] sorm
        next self {} self alive
        my TakeIn [dict create objects [my Items]]
    }
    destructor {
        $peer destroy
        next
    }
    method line {} {
        return $peer
    }
    method Items {} {
        return [lsearch -all -inline -not -index 0 [::sorma::discovery::here objects] *@*]
    }
    # As they are now.
    method objects {} {
        return [lmap item [lsort -index 0 [my Items]] {
            lassign $item name class calls underway
            dict create name $name class $class calls $calls underway $underway
        }]
    }
    method Happened event {
        if {[dict get $event event] eq "dictionary.changed"} {
            return [::sorma::discovery::changed]
        }
        if {[dict get $event lost] != 0} {
            my TakeIn [dict create objects [my Items]]
        }
        my Take $event
    }
    method ask {request ms prefix {who {}}} {
        if {[catch {::sorma::async {*}[if {$who ne {}} {list -as $who}] -timeout $ms -command [list ::sorma::worldSelf::Answer $prefix] {*}$request} future failure]} {
            after 0 [list ::sorma::news::deliver $prefix [list error [list $future [dict get $failure -errorcode]]]]
            return
        }
        dict set ::sorma::worldSelf::Underway [$future request] $future
        return [$future request]
    }
    method cancel number {
        variable ::sorma::worldSelf::Underway
        return [expr {[dict exists $Underway $number] && [[dict get $Underway $number] cancel]}]
    }
    # It needs not be asked how it is.
    method recount {} {}
    method count {} {}
    method pulse {} {}
    method beat {now slept} {}

    export Happened
}
