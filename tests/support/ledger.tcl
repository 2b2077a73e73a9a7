# ledger.tcl -- a service for daemons of tests: writes down each number that it is called with, and gives it back.
# With an environment variable LEDGER also at the end of the file that it names, which outlives the daemon.
package require sorma

oo::class create ledger {
    superclass sorma::Service
    variable Seen
    sorma::inspection -counts {} {numbers that were executed, and how many of them twice} {
        return "executed [array size Seen] twice [llength [lsearch -all -not -exact [lmap {- n} [array get Seen] {set n}] 1]]"
    }
    sorma::inspection -known {number} {how often a number was executed} {
        return [expr {[info exists Seen($number)] ? $Seen($number) : 0}]
    }
    method exec message {
        set number [lindex [dict get $message ints] 0]
        incr Seen($number)
        if {[info exists ::env(LEDGER)]} {
            set f [open $::env(LEDGER) a]
            puts $f $number
            close $f
        }
        return [dict create ints [dict get $message ints]]
    }
}
