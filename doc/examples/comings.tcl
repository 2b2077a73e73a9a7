# comings.tcl -- a log of the daemons of this host and their objects: each one that is there, changes, or ends.
#
#     build/env tclsh8.6 doc/examples/comings.tcl            all of them, until Ctrl-C
#     build/env tclsh8.6 doc/examples/comings.tcl foo.*@*    objects of one class

package require sorma

proc say {key text} {
    puts "[clock format [clock seconds] -format %T] $key $text"
    flush stdout
}

proc happened {event key facts} {
    switch -- $event {
        daemon.here { say $key "is there, by its [dict get $facts how]" }
        daemon.changed {
            # The facts also have the count of its objects, and what it is busy with.
            if {[list $key [dict get $facts state]] ni $::states} {
                say $key [string trim "[dict get $facts state] [dict get $facts why]"]
            }
            set ::states [linsert [lsearch -all -inline -not -index 0 -exact $::states $key] end [list $key [dict get $facts state]]]
        }
        daemon.gone { say $key "is gone" }
        object.made { say $key "is there, a [dict get $facts class]" }
        object.changed { if {[dict exists $facts changes]} { say $key "now [dict get $facts changes], by [dict get $facts by]" } }
        object.removed { say $key "is no more" }
        world.ready { say world "known; from now on it is news" }
    }
}

set states {}
if {$argc == 0} {
    sorma::world watch * -command happened
}
sorma::world watch [expr {$argc ? [lindex $argv 0] : "*@*"}] -events {object.* world.ready} -command happened
vwait forever
