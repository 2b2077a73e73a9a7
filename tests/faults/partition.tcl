# partition.tcl ?seconds? ?clients? -- a daemon and its clients in two network namespaces; the router between them drops everything
# for so long, and says nothing. Then it goes on. Printed, not judged: how long after that each client has its first good call.
#
# No call may be executed twice. Needs root, and `ip netns`.

source [file join [file dirname [file normalize [info script]]] faults.tcl]

# A client counts, and has each number written down. It prints each number that came back, with the time [ms].
set Client {
    package require sorma
    sorma::configure -timeout 120000
    lassign $argv where first
    puts begins
    flush stdout
    for {set n $first} {1} {incr n} {
        if {![catch {ledger@$where EXEC IMSG 1 $n} said]} {
            puts "$n [clock milliseconds]"
        } else {
            puts "failed $said"
        }
        flush stdout
        after 10
    }
}

# Namespaces sorma-d - sorma-r - sorma-c, of which the middle one passes on what comes.
proc layNet {} {
    foreach space {d r c} {
        exec ip netns add sorma-$space
        exec ip netns exec sorma-$space ip link set lo up
    }
    foreach {space net} {d 1 c 2} {
        exec ip link add veth0 netns sorma-$space type veth peer name to-$space netns sorma-r
        exec ip -n sorma-$space addr add 10.98.$net.2/24 dev veth0
        exec ip -n sorma-$space link set veth0 up
        exec ip -n sorma-r addr add 10.98.$net.1/24 dev to-$space
        exec ip -n sorma-r link set to-$space up
        exec ip -n sorma-$space route add default via 10.98.$net.1
    }
    passOn 1
}
proc passOn yes {
    exec ip netns exec sorma-r sh -c "echo $yes > /proc/sys/net/ipv4/ip_forward"
}
proc clearNet {} {
    foreach space {d r c} {
        catch {exec ip netns del sorma-$space}
    }
}

attack {
    lassign [concat $argv [lrange {30 4} [llength $argv] end]] seconds clients
    set ledger [file join $env(SORMA_RUNTIME_DIR) ledger]
    set env(LEDGER) $ledger
    set pipes {}
    try {
        layNet
        set daemon [open |[list ip netns exec sorma-d sormad -name partition[pid] -host 10.98.1.2 -port 7007 -until-eof -open 1 \
            -script [file join $supportFolder ledger.tcl] 2>@stderr] r+]
        gets $daemon
        set script [file join $env(SORMA_RUNTIME_DIR) client.tcl]
        set f [open $script w]
        puts $f $Client
        close $f
        for {set i 0} {$i < $clients} {incr i} {
            set pipe [open |[list ip netns exec sorma-c [info nameofexecutable] $script 10.98.1.2:7007 [expr {1000000 * $i}] 2>@stderr] r]
            gets $pipe
            fconfigure $pipe -blocking 0
            lappend pipes $pipe
            set good($pipe) {}
            set failed($pipe) 0
        }
        proc take {} {
            foreach pipe $::pipes {
                while {[gets $pipe line] >= 0} {
                    if {[string is integer -strict [lindex $line 0]]} {
                        lappend ::good($pipe) {*}$line
                    } else {
                        incr ::failed($pipe)
                        puts [string range $line 0 300]
                    }
                }
            }
        }
        waitFor {[take] eq {} && [llength [lsearch -all [lmap p $pipes {expr {[llength $good($p)] > 20}}] 1]] == $clients} 30000
        passOn 0
        after [expr {1000 * $seconds}]
        passOn 1
        set healed [clock milliseconds]
        proc later pipe {
            foreach {n ms} $::good($pipe) {
                if {$ms >= $::healed} {
                    return [expr {$ms - $::healed}]
                }
            }
            return -1
        }
        waitFor {[take] eq {} && [lsearch [lmap p $pipes {later $p}] -1] < 0} 120000
        set waits [lmap p $pipes {later $p}]
        foreach pipe $pipes {
            exec kill [pid $pipe]
            catch {close $pipe}
        }
        puts "$seconds s without a net: the first good calls came [lsort -integer $waits] ms after it"
        close $daemon
        set f [open $ledger]
        set executed [split [string trim [read $f]] \n]
        close $f
        foreach n $executed {
            incr times($n)
        }
        promise "each client goes on" [expr {[llength $waits] == $clients}]
        promise "no call failed" [expr {[tcl::mathop::+ {*}[lmap p $pipes {set failed($p)}]] == 0}]
        promise "no call was executed twice" [expr {[llength $executed] == [array size times]}]
    } finally {
        foreach pipe $pipes {
            catch {exec kill [pid $pipe]}
        }
        clearNet
    }
}
