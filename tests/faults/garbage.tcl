# garbage.tcl ?RECORDS? ?SEED? -- so many spoilt records to a daemon, and so many to a client by a daemon that answers with them.
#
# Both go on; other clients of the daemon are served.

source [file join [file dirname [file normalize [info script]]] faults.tcl]

proc garbage args {
    return [list [file join $::env(SORMA_BUILD) garbage] {*}$args]
}

attack {
    lassign [concat $argv [lrange {100000 4711} [llength $argv] end]] count seed
    set d [serve "sorma::configure -maxmessage 65536" "sorma::configure -requesttime 500"]
    echo@$d EXEC TMSG here
    puts "to a daemon: [exec {*}[garbage [daemon info $d port] $count $seed]]"
    promise "the daemon serves others" [expr {[echo@$d EXEC TMSG here] eq {RET 0 TMSG here}}]
    daemon stop $d
    promise "the daemon ends in good order" 1

    # A client of its own, so that a crash of it is seen.
    set liar [open |[garbage -serve $count $seed 2>@stderr] r+]
    set port [lindex [gets $liar] 1]
    set script {
        package require sorma
        sorma::configure -timeout 50 -maxmessage 65536
        set nop nop@127.0.0.1:$port
        set s {}
        for {set round 0} {[file exists /proc/$liar] && ![regexp {\) Z} [exec cat /proc/$liar/stat]]} {incr round} {
            for {set i 0} {$i < 20} {incr i} {
                set futures {}
                for {set k 0} {$k < 30} {incr k} {
                    lappend futures [sorma::async $nop EXEC]
                }
                foreach f $futures {
                    catch {$f wait}
                    $f destroy
                }
            }
            catch {$nop EXEC}
            catch {sorma::unsubscribe $s}
            catch {set s [sorma::subscribe $nop -command list]}
            catch {sorma::health 127.0.0.1:$port -timeout 50}
            update
        }
        puts "alive after $round rounds"
        exit
    }
    set client [open |[list [info nameofexecutable] << "set liar [pid $liar]\nset port $port\n$script" 2>@stderr] r]
    # A client that has crashed is the first to be heard of.
    foreach channel [list $liar $client] {
        fileevent $channel readable [list set first $channel]
    }
    vwait first
    promise "the client goes on" [expr {$first eq $liar}]
    if {$first eq $liar} {
        puts "to a client: [gets $liar]"
    }
    gets $client
    promise "and ends in good order" [expr {![catch {close $client} message]}]
    catch {close $liar}
}
