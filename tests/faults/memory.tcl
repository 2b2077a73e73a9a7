# memory.tcl ?megabytes? -- a stranger by TCP makes a daemon keep whatever he can.
#
# He does not finish requests, does not take replies, and asks for calls without an answer and for millions of words. He makes objects,
# subscriptions, values, items of a queue, second names, and entries of the dictionary. He gets his budget, and is told the
# limit's name; others go on. megabytes: the daemon's -maxmessage, of which his budget is twice as much.

source [file join [file dirname [file normalize [info script]]] faults.tcl]

set Client 4710
# Input that is only looked at: answered, refused and lost count replies, ended says that the connection is.
proc attacker port {
    set c [socket 127.0.0.1 $port]
    fconfigure $c -translation binary -blocking 0 -buffering full -buffersize 1000000
    array set ::Tally [list $c,in {} $c,answered 0 $c,refused 0 $c,toobig 0 $c,ended 0 $c,last {}]
    fileevent $c readable [list tally $c]
    put $c [rpc::hello 0 [incr ::Client]]
    awaitReplies $c 1
    return $c
}
proc tally c {
    if {[catch {read $c 1000000} bytes] || [eof $c]} {
        set ::Tally($c,ended) 1
        fileevent $c readable {}
        return
    }
    append ::Tally($c,in) $bytes        ;# bytes that nobody has looked at as a string: else each scan converts all of them
    set all $::Tally($c,in)
    set at 0
    while {[binary scan $all @${at}Iu mark] == 1} {
        set n [expr {$mark & 0x7fffffff}]
        if {[string length $all] - $at < 4 + $n} break
        set record [string range $all [expr {$at + 4}] [expr {$at + 3 + $n}]]
        incr at [expr {4 + $n}]
        binary scan $record @24I code
        if {[string first {COMM LIMIT} $record] >= 0} {
            incr ::Tally($c,refused)
            set ::Tally($c,last) $record
        } elseif {[string first {COMM TOO_BIG} $record] >= 0} {
            incr ::Tally($c,toobig)
        } else {
            incr ::Tally($c,answered)
            set ::Tally($c,answer) $record
        }
    }
    set ::Tally($c,in) [string range $all $at end]
}
proc replies c {
    return [expr {$::Tally($c,answered) + $::Tally($c,refused) + $::Tally($c,toobig)}]
}
proc awaitReplies {c n} {
    waitFor {[replies $c] >= $n || $::Tally($c,ended)} 120000
}
proc put {c bytes} {
    puts -nonewline $c $bytes
    flush $c
}
proc leave args {
    foreach c $args {
        catch {close $c}
    }
    # The daemon gives back what they had.
    waitFor {[dict get [sorma::health $::d] connections] <= 2}
}

# A daemon keeps buffers of 4 MB for the next long message, and 8 MB of its heap.
set spare 20e6
# One attack: how much memory it took beside what was there, and that the owner goes on. times: of the budget, at most. Small things
# take more memory than they are charged with.
proc claim {what script {times 2.2}} {
    set start [clock milliseconds]
    uplevel #0 $script
    set more [expr {[memoryOf $::d] - $::base}]
    puts "$what: [megabytes $more], [expr {[clock milliseconds] - $start}] ms"
    promise "$what: the limit is named" $::named
    promise "$what: within the budget" [expr {$more < $times * $::budget + $::spare}]
    promise "$what: others go on" [expr {[echo@$::d EXEC TMSG here] eq {RET 0 TMSG here}}]
}
proc named c {
    set ::named [expr {[string first -budget $::Tally($c,last)] > 0}]
}

# The daemon that is attacked from here on.
proc begin args {
    set ::d [serve {*}$args]
    set ::port [daemon info $::d port]
    echo@$::d EXEC
    set ::base [memoryOf $::d]
}

attack {
    set megabytes [expr {$argc > 0 ? [lindex $argv 0] : 64}]
    set most [expr {$megabytes << 20}]
    set budget [expr {2 * $most}]
    set script "sorma::configure -maxmessage $most\nsorma::configure -replytime 500\n"
    begin $script {
        oo::class create never {
            superclass sorma::Service
            sorma::concurrency concurrent
            method exec message {
                yield
            }
        }
    }

    claim "kept replies" {
        set c [attacker $port]
        set message [rpc::message [string repeat x [expr {$most / 70}]]]
        for {set i 0} {$i < 600} {incr i} {
            put $c [rpc::call [expr {$i + 1}] echo 0 $message $i 1]
            awaitReplies $c [expr {$i + 2}]
        }
        # The last one was executed, and is not kept.
        put $c [rpc::call 1000 echo 0 $message 599 1]
        awaitReplies $c 602
        set named [expr {$::Tally($c,answered) == 602 && [string first "too large for daemon" $::Tally($c,answer)] > 0}]
        leave $c
    }
    claim "unfinished requests" {
        set cs {}
        for {set i 0} {$i < 12} {incr i} {
            set c [attacker $port]
            set record [rpc::call 7 echo 0 [rpc::message [string repeat x [expr {$most - 1000}]]]]
            put $c [string range $record 0 end-[expr {$most / 16}]]
            lappend cs $c
        }
        waitFor {[llength [set refused [lmap c $cs {expr {$::Tally($c,refused) ? $c : [continue]}}]]] >= 5} 60000
        named [lindex $refused 0]
        leave {*}$cs
    }
    claim "empty words" {
        set n [expr {$most / 4 - 100}]
        set c [attacker $port]
        put $c [rpc::call 7 echo 0 [rpc::text {}][binary format III 0 0 0][binary format I $n][string repeat \0 [expr {4 * $n}]]]
        awaitReplies $c 2
        # The clients before him may have left his budget full: then that is named.
        set named [regexp -- {it may have 65536 words|-budget} $::Tally($c,last)]
        leave $c
    }
    claim "replies that are not taken" {
        set cs {}
        set call [rpc::call 7 echo 0 [rpc::message [string repeat x 50000]]]
        for {set i 0} {$i < 10} {incr i} {
            set c [socket 127.0.0.1 $port]
            fconfigure $c -translation binary -blocking 0 -buffering full -buffersize 1000000
            catch {put $c [string repeat $call 240]}        ;# more than the kernel takes; who is over his budget is let go
            lappend cs $c
        }
        # They wait, or he has been let go.
        waitFor {[string match "* queues *" [sorm@$d DBX -budgets]] || [dict get [sorma::health $d] connections] < 11}
        set named 1
        leave {*}$cs
    }
    claim "calls that are never answered" {
        set c [attacker $port]
        put $c [string repeat [rpc::call 7 never 0 [rpc::message [string repeat x 1000]]] 1100]
        waitFor {$::Tally($c,refused) >= 1100 - 1024} 60000
        set named [regexp -- {-inflight|-budget} $::Tally($c,last)]
        leave $c
    }
    claim "objects" {
        set c [attacker $port]
        set n [expr {3200 * $megabytes}]
        for {set i 0} {$i < $n} {incr i 1000} {
            set bytes {}
            for {set k $i} {$k < $i + 1000} {incr k} {
                append bytes [rpc::call 7 echo.$k 0]
            }
            put $c $bytes
            awaitReplies $c [expr {$i + 1001}]
        }
        puts "    $Tally($c,answered) objects made, $Tally($c,refused) refused"
        named $c
        leave $c
    }
    daemon stop $d
    begin $script
    claim "subscriptions" {
        set c [attacker $port]
        set n [expr {3200 * $megabytes}]
        for {set i 0} {$i < $n} {incr i 1000} {
            set bytes {}
            for {set k $i} {$k < $i + 1000} {incr k} {
                append bytes [rpc::subscribe 7 $k echo]
            }
            put $c $bytes
            awaitReplies $c [expr {$i + 1001}]
        }
        puts "    $Tally($c,answered) subscriptions, $Tally($c,refused) refused"
        named $c
        leave $c
    }
    puts [sorm@$d DBX -budgets]
    daemon stop $d
    begin $script
    set long [string repeat x [expr {$most / 4}]]
    foreach {what object words} {values blackboard {put v$k} items queue {put now}} {
        claim $what {
            set c [attacker $port]
            for {set k 1} {$k <= 40} {incr k} {
                put $c [rpc::call $k $object 0 [rpc::message $long {} [subst $words]]]
                awaitReplies $c [expr {$k + 1}]
            }
            puts "    $Tally($c,answered) kept, $Tally($c,refused) refused"
            named $c
            leave $c
        } 1
        # They go with what kept them.
        sorm@$d CTRL -remove $object
        promise "$what: they are given back" [expr {![string match "* values *" [sorm@$d DBX -budgets]] && [memoryOf $d] - $base < $spare}]
    }
    foreach {what object words} {
        "second names" sorm {-alias echo.[string repeat a 4000]$k echo}
        "entries" dict {-add w$k [string repeat x 4000]}
    } {
        daemon stop $d
        begin $script
        claim $what {
            set c [attacker $port]
            set n [expr {600 * $megabytes}]
            for {set i 0} {$i < $n} {incr i 100} {
                set bytes {}
                for {set k $i} {$k < $i + 100} {incr k} {
                    append bytes [rpc::call $k $object 1 [rpc::message {} {} [subst $words]]]
                }
                put $c $bytes
                awaitReplies $c [expr {$i + 101}]
            }
            puts "    $Tally($c,answered) made, $Tally($c,refused) refused"
            named $c
            leave $c
        }
    }
    puts [sorm@$d DBX -budgets]
}
