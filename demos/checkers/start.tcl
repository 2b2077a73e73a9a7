# start.tcl -- for scripts of daemons: settings for their objects.
#
# The file "settings" in the daemon's folder has a dict, name of an object -> its options. Objects get these, and one of them begins to
# play. A daemon that they need may just be away: they wait for it.

package require fileutil

namespace eval ::checkers {}
proc ::checkers::settle {} {
    if {[file exists settings]} {
        dict for {object options} [fileutil::cat settings] {
            if {[lindex [split $object .] 0] in [sorma::classes]} {
                Patiently [list $object configure {*}$options]
            }
        }
    }
}
# For a minute; nobody waits for this daemon before it is ready.
proc ::checkers::Patiently script {
    for {set try 1} 1 {incr try} {
        try {
            return [uplevel 1 $script]
        } trap {SORMA COMM} {text how} {
            if {$try >= 300} {
                return -options $how $text
            }
            after 200
        }
    }
}
proc ::checkers::start name {
    after 0 [list sorma::async -timeout 0 -command [list ::checkers::ended $name] $name EXEC play]
}
proc ::checkers::ended {name future} {
    if {[catch {$future take} text how]} {
        puts stderr $text
        if {[lrange [dict get $how -errorcode] 0 1] eq {SORMA COMM}} {
            after 500 [list ::checkers::start $name]
        }
    }
}
