# values.tcl ?count? ?megabytes? -- a stranger puts values of any size up to that, one over the other, and removes the last one. His
# connection stays. Nothing else does: no buffer of a long request, and no text of a message.

source [file join [file dirname [file normalize [info script]]] faults.tcl]

attack {
    set count [expr {$argc > 0 ? [lindex $argv 0] : 40}]
    set most [expr {1000000 * ($argc > 1 ? [lindex $argv 1] : 60)}]
    set d [serve "sorma::configure -maxmessage [expr {$most + 1000000}] -budget [expr {4 * $most}]" {package require sorma::service::blackboard}]
    set c [rpc::connect [daemon info $d port]]
    proc ask record {
        rpc::send $::c $record
        return [rpc::reply [rpc::receive $::c]]
    }
    ask [rpc::hello 1 4711]
    ask [rpc::call 1 blackboard 0 [rpc::message x {} {put v}]]
    set base [memoryOf $d]
    set beside {}
    for {set i 0} {$i < $count} {incr i} {
        # Small steps and large ones, up and down, the longest one first.
        set size [expr {int($most * (1 - fmod(0.618034 * $i, 1)))}]
        ask [rpc::call 1 blackboard 0 [rpc::message [string repeat x $size] {} {put v}]]
        # Memory of a longer value before may be used again, up to as much as the value takes; it is charged.
        lappend beside [expr {[memoryOf $d] - $base - 2 * $size}]
    }
    set kept [expr {[lindex [blackboard@$d EXEC version v] end]}]
    ask [rpc::call 1 blackboard 0 [rpc::message {} {} {remove v}]]
    set left [expr {[memoryOf $d] - $base}]
    promise "what is there is twice the value and 20 MB, at most" [expr {[tcl::mathfunc::max {*}$beside] < 20000000}]
    puts "$count values of up to [megabytes $most] leave [megabytes $left]"
    promise "each is kept" [expr {$kept == $count + 1}]
    promise "what stays is less than 20 MB" [expr {$left < 20000000}]
    rpc::close $c
}
