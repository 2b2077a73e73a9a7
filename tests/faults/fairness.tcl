# fairness.tcl ?seconds? -- a stranger floods with requests that cost much, by one connection or by fifty. They fail, make and
# remove objects, or subscribe and unsubscribe. A neighbour, another principal, floods with modest ones: how much is left for it?
# So many of them wait in the sockets that the daemon always has some, also on a busy machine.
#
# Its fair share is what it gets beside a client like itself. Both are measured in one run, by turns. Its requests
# count for each second that the daemon has computed. So other work on this machine matters little. In less than 2 s it matters
# more: half of its share is enough then, and a quarter beside fifty connections. Were connections served by turns, it would have a 25th.
#
# The owner calls each 2 ms meanwhile. His waiting time depends on the other work of this machine. A process that only computes
# makes its caller wait, too: that time is printed. How long the daemon computes for others before it answers depends on the daemon
# alone.

source [file join [file dirname [file normalize [info script]]] faults.tcl]

# Time that the daemon has computed [s].
proc computed daemon {
    set f [open /proc/[daemon info $daemon pid]/schedstat]
    set ns [lindex [read $f] 0]
    close $f
    return [expr {$ns * 1e-9}]
}

# Replies to a flooder while the daemon computes for so many seconds, for each of these seconds. The owner calls meanwhile.
proc rateOf {flooder seconds waitsVar} {
    upvar 1 $waitsVar waits
    set owner [caller [daemon info $::d socket] [daemon info $::d pid] nop]
    set begin [computed $::d]
    set before [replies $flooder]
    while {[computed $::d] - $begin < $seconds} {
        after 10
    }
    set rate [expr {([replies $flooder] - $before) / ([computed $::d] - $begin)}]
    endCaller $owner waits
    return $rate
}

# Rates of the neighbour beside each kind of client, and beside one like itself: medians of several turns. The others are
# {kind records connections}.
proc beside {others rounds seconds} {
    set mild [string repeat [rpc::call 1 modest 0] 4000]
    set neighbour [flooder [daemon info $::d socket] neighbour $mild]
    set port [daemon info $::d port]
    for {set round 0} {$round < $rounds} {incr round} {
        foreach {kind records connections} [list twin $mild 1 {*}$others] {
            set other [flooder $port other $records $connections]
            lappend rates($kind) [rateOf $neighbour $seconds ::waits$kind]
            close $other
        }
    }
    close $neighbour
    return [lmap {kind records connections} $others {expr {[quantile $rates($kind) 0.5] / [quantile $rates(twin) 0.5]}}]
}

attack {
    set seconds [expr {$argc > 0 ? [lindex $argv 0] : 2}]
    set bound [expr {$seconds >= 2 ? 0.9 : 0.5}]
    set d [serve {package require sorma::service::nop} {package require sorma::service::echo} {
        oo::class create modest {
            superclass sorma::Service
            method exec message {
                for {set i 0} {$i < 200} {incr i} {}
                return {}
            }
        }
    }]
    nop@$d EXEC
    modest@$d EXEC
    set made {}
    set heard {}
    for {set i 0} {$i < 500} {incr i} {
        append made [rpc::call 1 echo.$i 0][rpc::call 1 sorm 1 [rpc::message {} {} [list -remove echo.$i]]]
        append heard [rpc::subscribe 1 $i nop][rpc::record [rpc::header 1 6][binary format I $i]]
    }
    set alone [caller [daemon info $d socket] [daemon info $d pid] nop]
    puts "the owner waits \[ms\]: p50, p90, p99, p99.9, longest; of that the daemon computed"
    if {$order ne "first"} {
        puts "the callers wait for a processor, too, while the daemon goes on: run this as root"
    }
    after [expr {int($seconds * 1000)}]
    endCaller $alone quiet
    puts [format "%-38s %-28s %s" "with nobody else" [quantiles $quiet(all)] [quantiles $quiet(computed)]]
    set raw [caller -raw]
    after [expr {int($seconds * 1000)}]
    endCaller $raw machine
    puts [format "%-38s %s" "for a process that only computes" [quantiles $machine(all)]]
    foreach {what records} [list \
        "requests that fail" [string repeat [rpc::call 1 nothing.at.all 0] 1000] \
        "words that fail" [string repeat [rpc::call 1 echo 1 [rpc::message {} {} {-nonsense}]] 1000] \
        "objects made and removed" $made \
        "subscribed and unsubscribed" $heard] {
        foreach kind {twin one fifty} {
            unset -nocomplain waits$kind
        }
        # Each of fifty connections has a turn only to find that it must wait: that costs all others.
        set less [expr {$seconds >= 2 ? 0.75 : 0.25}]
        # Noise of a short time can look unfair. Then a longer time is measured before it is judged.
        for {set time $seconds} 1 {set time [expr {3 * $time}]} {
            lassign [beside [list one $records 1 fifty $records 50] [expr {$seconds >= 2 ? 5 : 3}] $time] one fifty
            if {$time >= 1 || ($one >= $bound && $fifty >= $less)} {
                break
            }
        }
        foreach {kind title} [list twin "beside a twin" one "beside $what" fifty "... by 50 connections"] {
            puts [format "%-38s %-28s %s" $title [quantiles [set waits${kind}(all)]] [quantiles [set waits${kind}(computed)]]]
        }
        puts [format "%s: the neighbour has %.2f of its share, beside fifty connections %.2f" $what $one $fifty]
        promise "$what: the neighbour has $bound of its share" [expr {$one >= $bound}]
        promise "$what by fifty connections: the neighbour has $less of its share" [expr {$fifty >= $less}]
        if {$seconds >= 2 && $order eq "first"} {
            promise "$what: of 100 calls of the owner the daemon computes less than 5 ms before it answers 99" \
                [expr {max([quantile $waitsone(computed) 0.99], [quantile $waitsfifty(computed) 0.99]) < 5000}]
        }
    }
}
