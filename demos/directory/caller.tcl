# caller.tcl OBJECT -- calls an object fifty times a second. It ends with its standard input.
#
# It prints a line when the outcome changes: the time [ms since 1970], then ok and a host, or error, code and text.

package require sorma

namespace eval caller {
    variable Object [lindex $::argv 0]
    variable Last {}
}
proc caller::Call {} {
    variable Object
    sorma::async -timeout 500 -command ::caller::Answered $Object EXEC
}
proc caller::Answered future {
    variable Last
    set now [clock milliseconds]
    if {[catch {$future take} said how]} {
        set code [lrange [dict get $how -errorcode] 1 2]
        set what [list error $code]
        set more [list $said]
    } else {
        set what [list ok [lindex $said end]]
        set more {}
    }
    if {$what ne $Last} {
        set Last $what
        puts [list $now {*}$what {*}$more]
        flush stdout
    }
    after 20 ::caller::Call
}
fileevent stdin readable {
    if {[gets stdin] eq {} && [eof stdin]} exit
}
caller::Call
vwait forever
