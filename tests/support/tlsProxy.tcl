# tlsProxy.tcl PORT HOW ?BYTES? -- stands between a client and the daemon at 127.0.0.1:PORT. Prints its port, and ends with its input.
#
#     probe   asks the daemon for TLS by itself, then carries bytes: for clients that do not know the probe
#     strip   answers the probe as a daemon without TLS does, and carries the rest
#     cut     ends each connection after BYTES bytes of the daemon, in the middle of whatever they are
#     flip    changes byte number BYTES of what the daemon sends
#     answers changes nothing
#
# For each line on its input it prints, in hex, what clients have sent since the last one; with answers, what the daemon has.

lassign $argv target how bytes
set heard {}

proc accept {near args} {
    global target how heard
    set far [socket 127.0.0.1 $target]
    foreach channel [list $near $far] {
        fconfigure $channel -translation binary -buffering none
    }
    if {$how eq "probe"} {
        puts -nonewline $far [binary format I11 {0x80000028 7 0 2 0x20534f52 1 0 7 0 0 0}]
        if {[string range [read $far 36] 24 31] ne "STARTTLS"} {
            close $far
            close $near
            return
        }
    }
    foreach {from to} [list $near $far $far $near] {
        fconfigure $from -blocking 0
        fileevent $from readable [list carry $from $to [expr {$from eq $near}]]
        set ::came($from) 0
    }
}

proc carry {from to client} {
    global how bytes heard came
    if {[catch {read $from} some] || ($some eq {} && [eof $from])} {
        catch {close $from}
        catch {close $to}
        return
    }
    if {$client == ($how ne "answers")} {
        append heard $some
    }
    set before $came($from)
    incr came($from) [string length $some]
    if {$how eq "strip" && $client && $before == 0 && [string length $some] == 44} {
        binary scan $some @4I xid
        puts -nonewline $from [binary format I7 [list 0x80000018 $xid 1 0 0 0 0]]
        return
    }
    set end 0
    if {$how eq "cut" && !$client && $came($from) >= $bytes} {
        set some [string range $some 0 [expr {$bytes - $before - 1}]]
        set end 1
    }
    if {$how eq "flip" && !$client && $before <= $bytes && $came($from) > $bytes} {
        set at [expr {$bytes - $before}]
        binary scan $some @${at}cu value
        set some [string replace $some $at $at [binary format c [expr {$value ^ 1}]]]
    }
    if {[catch {puts -nonewline $to $some}] || $end} {
        catch {close $from}
        catch {close $to}
    }
}

set server [socket -server accept -myaddr 127.0.0.1 0]
puts [lindex [fconfigure $server -sockname] 2]
flush stdout
fileevent stdin readable {
    if {[gets stdin line] < 0} exit
    if {[llength $line] > 0} {
        lassign $line how bytes
    }
    puts [binary encode hex $heard]
    flush stdout
    set heard {}
}
vwait forever
