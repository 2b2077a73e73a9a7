# counter.tcl -- a class that counts, for suites that read streams: as many pieces as its int says. It tells how many it has made; its word
# has it wait, fail, or go on for ever.

package require sorma
oo::class create counter {
    superclass sorma::Service
    sorma::option -made int -help "pieces so far" -default 0
    sorma::option -ended int -help "streams that ended early" -default 0
    method exec {message} {
        lassign [dict get $message words] how
        lassign [dict get $message ints] n
        sorma::atCancel [list catch [list [namespace current]::my Ended]]
        for {set k 0} {$k < $n} {incr k} {
            switch -- $how {
                slow { after 5 [info coroutine]; yield }
                never { yield }
                fail { if {$k == 2} {sorma::fail {COUNTER BROKEN} "broke at $k"} }
                warn { sorma::warn {COUNTER ODD} "odd at $k" }
                empty { sorma::piece {} }
                gone { if {$k == 2} {my destroy} }
            }
            my configure -made [expr {[my cget -made] + 1}]
            sorma::piece [dict create ints $k]
        }
        return [dict create text "$n in all"]
    }
    method Ended {} { my configure -ended [expr {[my cget -ended] + 1}] }
}
