# connections.tcl ?count? -- one host opens as many connections as a daemon takes, and says nothing. It may, as long as nobody
# else needs the room; the owner is always let in. The same with a daemon that has few descriptors: whom it cannot take is
# told so, and its services can still open files. count: the daemon's -maxconnections.

source [file join [file dirname [file normalize [info script]]] faults.tcl]

proc idler {port count} {
    set pipe [open [list | [file join $::env(SORMA_BUILD) flooder] $port -idle $count 2>@stderr] r+]
    fconfigure $pipe -buffering line -translation binary
    return $pipe
}

# How many of them are open, and what was said to one that is not.
proc opened pipe {
    set line [gets $pipe]
    return [list [lindex $line 1] [string range $line [string length "open [lindex $line 1] "] end]]
}

# So many clients of the owner, each with a connection of its own, one after another; how many were served?
proc owners {d count} {
    set served 0
    for {set i 0} {$i < $count} {incr i} {
        set client [interp create]
        $client eval {package require sorma}
        incr served [expr {![catch {$client eval [list nop@$d EXEC]} message]}]
        lappend clients $client
    }
    foreach client $clients {
        interp delete $client
    }
    return $served
}

attack {
    set count [expr {$argc > 0 ? [lindex $argv 0] : 10000}]
    set d [serve "sorma::configure -maxconnections $count"]
    set idler [idler [daemon info $d port] [expr {$count - 10}]]
    set open [lindex [opened $idler] 0]
    promise "one host may have nearly all connections" [expr {$open == $count - 10}]
    set more [idler [daemon info $d port] 30]
    promise "beyond the limit the same host is told" [expr {[lindex [opened $more] 0] == 10}]
    promise "the owner is let in, with as many clients as he likes" [expr {[owners $d 20] == 20}]
    puts $idler {}
    puts $more {}
    lassign [opened $idler] open words
    set lost [expr {$count - 10 - $open + 10 - [lindex [opened $more] 0]}]
    puts "$lost idle connections made room: $words"
    # Fewer, where the daemon was so busy that the owner was taken in beyond the limit.
    promise "no more of them made room than was needed" [expr {$lost <= 20}]
    promise "they were told why" [string match "daemon * is full, and most of its connections are of local *: this one, which was silent for *" $words]
    close $idler
    close $more

    set d [serve {package require sorma}]
    exec prlimit --pid [daemon info $d pid] --nofile=200:200
    set idler [idler [daemon info $d port] 400]
    set open [lindex [opened $idler] 0]
    puts "$open of 400 connections with 200 descriptors"
    promise "a daemon without descriptors says so" [expr {$open > 100 && $open < 200}]
    promise "the owner is let in" [expr {[owners $d 3] == 3}]
    promise "and his services load" [expr {![catch {queue.new@$d CTRL -help} message]}]
    close $idler
}
