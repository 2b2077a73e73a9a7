# stranger.tcl BEHAVIOUR -- something that listens on a TCP port and is no daemon. Prints its port.
#
#     silent    accepts and never answers
#     greets    speaks first, as ssh does
#     http      answers any line with an HTTP error
#     leaves    closes each connection at once
#     lies      answers a HELLO with a record of nonsense

proc accept {behaviour channel args} {
    fconfigure $channel -translation binary -blocking 0 -buffering none
    switch $behaviour {
        greets { puts $channel "SSH-2.0-OpenSSH_9.2p1 Debian-2+deb12u3\r" }
        leaves { close $channel; return }
    }
    fileevent $channel readable [list answer $behaviour $channel]
}

proc answer {behaviour channel} {
    set bytes [read $channel]
    if {[eof $channel]} {
        close $channel
        return
    }
    switch $behaviour {
        http { puts $channel "HTTP/1.1 400 Bad Request\r\n\r" }
        lies { puts -nonewline $channel [binary format IIIIIIIa40 [expr {0x80000000 | 64}] 0 1 0 0 0 0 [string repeat \xff 40]] }
    }
}

set listener [socket -server [list accept [lindex $argv 0]] -myaddr 127.0.0.1 0]
puts [lindex [fconfigure $listener -sockname] 2]
flush stdout
fconfigure stdin -blocking 0
fileevent stdin readable {if {[gets stdin line] < 0 && [eof stdin]} exit}
vwait forever
