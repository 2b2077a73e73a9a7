# tls.tcl ?HOSTILE? ?STRIPPED? ?SEED? -- hostile handshakes with a daemon, and a proxy that strips or spoils the handshake of a client.
#
# Hostile handshakes are cut after each byte, or they are garbage. Hellos come twice, chains have many certificates, versions are old. Keys are
# changed without an end. Some lines stay half open. Then a client calls through the proxy, which does its worst at each byte in turn.

source [file join [file dirname [file normalize [info script]]] faults.tcl]
set folder [file join $env(SORMA_RUNTIME_DIR) tls]
proc testConstraint args {}
source [file join $supportFolder keys.tcl]
source [file join $supportFolder tlsProxy.tcl]

proc descriptors d { return [llength [glob -nocomplain -directory /proc/[daemon info $d pid]/fd *]] }
proc random below { return [expr {int($below * rand())}] }
proc bytes count {
    set out {}
    while {[string length $out] < $count} {
        append out [binary format I [random 0x100000000]]
    }
    return [string range $out 0 $count-1]
}
set probe [binary format I11 {0x80000028 7 0 2 0x20534f52 1 0 7 0 0 0}]
set asked [string replace $probe 4 7 TLS1]                ;# that of our own clients

# A proxy before the daemon; see support/tlsProxy.tcl.
proc proxy {how {side far} {at 0}} {
    return [tlsProxy::begin [daemon info $::d port] $how $side $at]
}
# ---- hostile clients ----

# A client of that host calls: all the bytes that it says, and the reply.
proc recorded host {
    lassign [proxy ok] server port
    set answer [called $host $port]
    set said [tlsProxy::heard $port near]
    tlsProxy::end $server $port
    return [list $said $answer]
}
# A call by TLS in a client of its own, which does not wait for long: its reply, or the error. words: what its dictionary says of TLS.
proc called {host port {patience 30000} {words {-tls yes}}} {
    set client [interp create]
    $client eval {package require sorma}
    $client eval [list sorma::so::dict CTRL -add @cell 127.0.0.1:$port {*}$words]
    at $host {
        set future [$client eval [list sorma::async -timeout $patience echo@cell EXEC TMSG NobodyHearsThis]]
        waitFor {[$client eval [list $future done]]} [expr {$patience + 30000}]
    }
    catch {$client eval [list $future wait]} answer
    interp delete $client
    return $answer
}

# Says bytes, and closes when the daemon does, or at once; open: never.
proc say {bytes {open 0}} {
    set channel [socket 127.0.0.1 [daemon info $::d port]]
    fconfigure $channel -translation binary -buffering none -blocking 0
    catch {puts -nonewline $channel $bytes}
    if {$open} {
        return $channel
    }
    incr ::talking
    fileevent $channel readable [list heardOf $channel]
    catch {close $channel write}
}
proc heardOf channel {
    if {[catch {read $channel}] || [eof $channel]} {
        catch {close $channel}
        incr ::talking -1
    }
}
# Has the daemon refused somebody for this reason?
proc reached reason {
    return [expr {![catch {waitFor {[string match *$reason* [sorm@$::d DBX -denied]]} 30000}]}]
}

# openssl s_client behind a proxy that says the probe.
proc client words {
    global folder
    lassign [proxy probe] server port
    set pipe [open [list | timeout 60 openssl s_client -connect 127.0.0.1:$port -alpn sunrpc -key $folder/desk/desk.pem {*}$words << {} 2>@1] r]
    fconfigure $pipe -blocking 0
    incr ::talking
    fileevent $pipe readable [list heardOf $pipe]
    waitFor {$::talking == 0} 90000
    tlsProxy::end $server $port
}

# A chain that begins with our certificate, and has many more.
proc longChain count {
    global folder
    set name $folder/chain$count.pem
    set out [open $name w]
    set in [open $folder/desk/authority.pem]
    puts $out [string repeat [read $in] $count]
    close $in
    close $out
    return [list -cert $folder/desk/desk.pem -cert_chain $name]
}

attack {
    lassign [concat $argv [lrange {10000 10000 4711} [llength $argv] end]] hostile stripped seed
    expr {srand($seed)}
    file mkdir $folder
    at cell {keys new-authority lab; keys new cell; keys give desk $folder/desk.keys}
    at desk {keys take $folder/desk.keys}
    at cell {set d [serve "sorma::configure -requesttime 2000"]}
    set talking 0
    lassign [recorded desk] said answer
    promise "a client is served: $answer" [expr {$answer eq {RET 0 TMSG NobodyHearsThis}}]
    set long [string length $said]
    set hello [string range $said 44 end]
    binary scan $hello @3Su size
    set hello [string range $hello 0 [expr {$size + 4}]]

    set quiet [caller [daemon info $d socket] [daemon info $d pid] nop]
    after 1000 {set rested 1}
    vwait rested
    endCaller $quiet alone

    # The heap of the daemon has its size after some of each kind.
    proc round i {
        global probe hello said long
        switch -- [expr {$i % 4}] {
            0 { say [string range $said 0 [expr {$i / 4 % $long}]] }
            1 { say $probe[bytes [random 20000]] }
            2 { say $probe\x16\x03[binary format cS [random 4] [random 0x10000]][bytes [random 20000]] }
            3 { say $probe$hello[expr {$i % 8 == 3 ? $hello : [string replace $hello [set k [random [string length $hello]]] $k [bytes 1]]}] }
        }
        waitFor {$::talking < 20}
    }
    proc byOpenssl i {
        switch -- [expr {$i % 4}] {
            0 { client [longChain [expr {3 + [random 200]}]] }
            1 { client [list -tls1_2 -cert $::folder/desk/desk.pem] }
            2 { return [exec -ignorestderr [file join $::env(SORMA_BUILD) tlsFlood] [daemon info $::d port] $::folder/desk/desk.pem 2000] }
            3 { client [list -cert $::folder/desk/desk.pem -no_tls1_3 -cipher ALL] }
        }
    }
    for {set i 0} {$i < max(40, min(2000, $hostile / 2))} {incr i} { round $i }
    byOpenssl 0
    promise "a huge chain reaches the daemon, and is refused" [reached "excessive message size"]
    byOpenssl 1
    promise "an old version does so, too" [reached "unsupported protocol"]
    set updates [byOpenssl 2]
    promise "$updates changes of keys reach the daemon, which answers then" [expr {$updates == 2000}]
    byOpenssl 3
    waitFor {$talking == 0}
    waitFor {[dict get [sorma::health $d] connections] <= 1}
    set descriptors [descriptors $d]
    set memory [memoryOf $d]

    set other [caller [daemon info $d socket] [daemon info $d pid] nop]
    set open {}
    for {set i 0} {$i < $hostile} {incr i} {
        round $i
        if {$i % 100 == 0} { byOpenssl [expr {$i / 100}] }
        if {$i % 50 == 0} { lappend open [say [string range $said 0 [random $long]] 1] }
    }
    endCaller $other beside
    puts "$hostile hostile handshakes, [llength $open] lines that stay open; $long bytes of a client"
    puts "another client's calls: [llength $beside(all)]; quantiles 0.5 0.9 0.99 0.999 1 \[ms\]: [quantiles $beside(all)]; with nobody else: [quantiles $alone(all)]"
    promise "another client's calls go on" [expr {[llength $beside(all)] > 0}]
    foreach channel $open {
        fileevent $channel readable [list heardOf $channel]
        incr talking
    }
    waitFor {$talking == 0}
    waitFor {[dict get [sorma::health $d] connections] <= 1}
    promise "half a handshake is ended by the daemon" 1
    promise "no descriptor is left" [expr {[descriptors $d] <= $descriptors}]
    puts "[expr {([memoryOf $d] - $memory) / 1024}] kB more"
    promise "nor memory" [expr {[memoryOf $d] < $memory + 4 * 1024 * 1024}]
    promise "a client is served as before" [expr {[called desk [daemon info $d port]] eq {RET 0 TMSG NobodyHearsThis}}]

    # Each byte of both sides, until the answer to the call has begun. A client wants TLS because the dictionary says so, because it has keys, or
    # because it has reached the daemon with TLS before. The first bytes, where all is in clear, are for each of them.
    set kinds {{strip far} {cut far} {flip far} {clear far} {cut near} {flip near}}
    set entries {{-tls yes} {} {-tls try}}
    set wrong {}
    array set counted {}
    for {set i 0} {$i < $stripped} {incr i} {
        lassign [lindex $kinds [expr {$i % [llength $kinds]}]] how side
        set round [expr {$i / [llength $kinds]}]
        set words [lindex $entries [expr {$round % [llength $entries]}]]
        set at [expr {$round < 3 ? 0 : $stripped < 1000 ? [random 1200] : $round < 600 ? $round / 3 : $round - 400}]
        lassign [proxy $how $side $at] server port
        set answer [called desk $port 300 $words]
        set sent [tlsProxy::heard $port near]
        incr counted($how,$side,reached) [expr {[string length [expr {$side eq "near" ? $sent : [tlsProxy::heard $port far]}]] > $at}]
        tlsProxy::end $server $port
        set good [expr {$answer eq {RET 0 TMSG NobodyHearsThis}}]
        incr counted($how,$side,tries)
        incr counted($how,$side,[expr {$good ? "answered" : "refused"}])
        # The number of the program is in the probe, and nowhere else.
        if {[string first NobodyHearsThis $sent] >= 0 || [regexp {\x20SOR\x00\x00\x00\x01} [string map [list $asked {}] $sent]]} {
            incr counted($how,$side,clear)
            lappend wrong "$how $side $at $words: sent in clear"
        } elseif {!$good && [string match RET* $answer]} {
            lappend wrong "$how $side $at $words: $answer"
        }
    }
    puts "$stripped calls through a proxy, the last ones at byte $at; reached: the line has come so far; answered: it did not matter"
    foreach row [list {how side tries reached answered refused {in clear}} {*}$kinds] {
        lassign $row how side
        puts [format {%-6s %-5s %6s %8s %9s %8s %9s} {*}[expr {[llength $row] > 2 ? $row : [list $how $side {*}[lmap what {tries reached answered refused clear} {
            expr {[info exists counted($how,$side,$what)] ? $counted($how,$side,$what) : 0}
        }]]}]]
    }
    promise "nothing of a request is sent in clear $wrong" [expr {$wrong eq {}}]
    waitFor {[dict get [sorma::health $d] connections] <= 1}
    promise "and no descriptor is left" [expr {[descriptors $d] <= $descriptors}]
    daemon stop $d
    file delete -force $folder
    promise "the daemon ends in good order" 1
}
