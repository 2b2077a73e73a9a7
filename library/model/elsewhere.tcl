# elsewhere.tcl -- daemons of other hosts, for sorma::world: one hop, and no broadcast. Nobody is called who has not been named.
#
# A daemon that is reached by TCP names those beside it, of the same user on its host, and tells when there are others. The rpcbind
# of a host is asked when there is the first line to that host.

package provide sorma::elsewhere 1.0         ;# before what needs it in turn
package require sorma::timer
package require sorma::world

namespace eval ::sorma::elsewhere {
    variable Hosts              ;# dict: host -> 1: its rpcbind has been asked, since the model began its work
    if {![info exists Hosts]} {
        set Hosts {}
    }
}

# Events of daemons, for the model.
proc ::sorma::elsewhere::Happened {event key dict} {
    switch -- $event {
        line.made { Ask $key }
        world.ended { set ::sorma::elsewhere::Hosts {} }
        daemon.gone { ::sorma::world lead $key sibling {} }
        siblings.changed {              ;# of many at once it tells many times
            ::sorma::timer::once elsewhere.$key 100 ::sorma::elsewhere::Ask $key
        }
    }
}

proc ::sorma::elsewhere::Ask key {
    variable Hosts
    set daemon [::sorma::world get $key]
    if {$daemon eq {} || [dict get $daemon how] in {sibling rpcbind} || [catch {::sorma::resolve @$key} place] || [dict get $place host] eq {}} {
        return
    }
    set host [dict get $place host]
    ::sorma::world ask $key {sorm DBX -inventory siblings} -timeout 10000 -command [list ::sorma::elsewhere::Siblings $key $host]
    if {![dict exists $Hosts $host]} {
        dict set Hosts $host 1
        catch {::sorma::peer programs $host -command [list ::sorma::elsewhere::Programs $host]}
    }
}

proc ::sorma::elsewhere::Siblings {key host status value} {
    if {$status eq "error" || [::sorma::world get $key] eq {} || [catch {
        # A daemon that listens on one interface is reached by that one only.
        lmap item [lrange [dict get [dict get $value text] siblings] 0 999] {
            lassign $item name interface port
            if {$interface ni [list 0.0.0.0 :: {} $host] || ![string is integer -strict $port]} continue
            string cat $host : $port
        }
    } addresses]} {
        return
    }
    ::sorma::world lead $key sibling $addresses
}

proc ::sorma::elsewhere::Programs {host programs} {
    ::sorma::world lead rpcbind@$host rpcbind [lmap program $programs {string cat $host : $program}]
}

::sorma::world::hook {line.made daemon.gone siblings.changed world.ended} ::sorma::elsewhere::Happened
