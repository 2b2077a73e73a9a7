# day.tcl -- services of the newcomer's day: one that publishes, and one that answers when its door is opened.
package require sorma

oo::class create ticks {
    superclass sorma::Service
    method exec message {
        for {set i 1} {$i <= [lindex [dict get $message ints] 0]} {incr i} {
            my publish tick -ints $i
        }
        return {}
    }
}

oo::class create door {
    superclass sorma::Service
    variable waiting cancelled
    constructor {} {
        set waiting {}
        set cancelled 0
    }
    sorma::concurrency concurrent
    sorma::action -open {} "let all go" {
        foreach c $waiting {
            after 0 $c
        }
        set waiting {}
    }
    sorma::inspection -waiting {} "how many wait" {llength $waiting}
    sorma::inspection -cancelled {} "how many were given up" {set cancelled}
    method exec message {
        lappend waiting [info coroutine]
        sorma::atCancel [list [namespace which my] GivenUp [info coroutine]]
        yield
        return [expr {[sorma::cancelled] ? {} : $message}]
    }
    method GivenUp coroutine {
        set waiting [lsearch -all -inline -not -exact $waiting $coroutine]
        incr cancelled
        after 0 $coroutine
    }
}
