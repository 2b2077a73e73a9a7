# rpc.tcl -- a peer that speaks ONC RPC by hand, well or badly: bytes in, bytes out. Layouts as in generic/comm/sorma.x.

namespace eval rpc {
    variable Program 0x20534f52
    variable Input      ;# array: channel -> bytes that have come, channel,ended -> true
}

# ---- writing ----

proc rpc::text s {
    set bytes [encoding convertto utf-8 $s]
    set n [string length $bytes]
    return [binary format Ia*x[expr {-$n & 3}] $n $bytes]
}

proc rpc::header {xid procedure args} {
    variable Program
    set settings [dict merge [dict create -rpcversion 2 -program $Program -version 1] $args]
    set begin [binary format IIIIII $xid 0 [dict get $settings -rpcversion] [dict get $settings -program] \
        [dict get $settings -version] $procedure]
    if {![dict exists $settings -author]} {
        return $begin[binary format IIII 0 0 0 0]
    }
    set body [binary format IW 1 0][text {}][text [dict get $settings -author]]
    return $begin[binary format II $Program [string length $body]]$body[binary format II 0 0]
}

# A record of one fragment.
proc rpc::record bytes {
    return [binary format I [expr {0x80000000 | [string length $bytes]}]]$bytes
}

proc rpc::null {xid args} {
    return [record [header $xid 0 {*}$args]]
}

# clock, now: what the client says of its clock [ns]; none: an older client.
proc rpc::hello {xid client {clock {}} {now 0} {program test}} {
    set tail [expr {$clock eq {} ? {} : "[text $clock][binary format W $now]"}]
    return [record [header $xid 1][binary format W $client][text somebody][text somewhere][binary format W 77][text $program][binary format I 1000000]$tail]
}

proc rpc::subscribe {xid id name {pattern *} {keep 10}} {
    return [record [header $xid 5][binary format I $id][text $name][text $pattern][binary format I $keep]]
}

# A call that is said to be relayed for an author.
proc rpc::relayed {xid name method author {message {}}} {
    return [record [header $xid 2 -author $author][binary format IIII -1 0 0 $method][text $name][expr {$message eq {} ? [message] : $message}]]
}

proc rpc::oneway {name method message} {
    return [record [header 0 7][binary format IIII -1 0 0 $method][text $name]$message]
}

# method: 0 EXEC, 1 CTRL, 2 DBX
proc rpc::call {xid name method {message {}} {slot 0xffffffff} {sequence 0} {timeleft 0}} {
    if {$message eq {}} {
        set message [message]
    }
    return [record [header $xid 2][binary format IIII $slot $sequence $timeleft $method][text $name]$message]
}

proc rpc::message {{string {}} {floats {}} {words {}}} {
    set out [text $string][binary format I [llength $floats]]
    foreach x $floats {
        append out [binary format Q $x]
    }
    append out [binary format III 0 0 [llength $words]]
    foreach word $words {
        append out [text $word]
    }
    return $out
}

# ---- a connection ----

proc rpc::connect port {
    variable Input
    set channel [socket 127.0.0.1 $port]
    fconfigure $channel -translation binary -blocking 0 -buffering none
    set Input($channel) {}
    set Input($channel,ended) 0
    fileevent $channel readable [list rpc::Take $channel]
    return $channel
}

proc rpc::Take channel {
    variable Input
    if {[catch {read $channel} bytes]} {
        set bytes {}
        set Input($channel,ended) 1
    }
    append Input($channel) $bytes
    if {$Input($channel,ended) || [eof $channel]} {
        set Input($channel,ended) 1
        fileevent $channel readable {}
    }
}

proc rpc::close channel {
    variable Input
    unset -nocomplain Input($channel) Input($channel,ended)
    catch {::close $channel}        ;# the peer may have reset it with our bytes unread
}

proc rpc::send {channel bytes} {
    puts -nonewline $channel $bytes
    flush $channel
}

# The next whole record without its mark; "closed" when the peer has ended the connection instead.
proc rpc::receive channel {
    variable Input
    waitFor {[rpc::Length $channel] >= 0 || $::rpc::Input($channel,ended)}
    set n [Length $channel]
    if {$n < 0} {
        return closed
    }
    set record [string range $Input($channel) 4 [expr {3 + $n}]]
    set Input($channel) [string range $Input($channel) [expr {4 + $n}] end]
    return $record
}

# Length of the first record when all of it is there, else -1.
proc rpc::Length channel {
    variable Input
    if {[binary scan $Input($channel) Iu mark] != 1} {
        return -1
    }
    set n [expr {$mark & 0x7fffffff}]
    return [expr {[string length $Input($channel)] >= 4 + $n ? $n : -1}]
}

proc rpc::ended channel {
    variable Input
    waitFor {$::rpc::Input($channel,ended)}
    return 1
}

# ---- reading ----

# The content of a record: a dict of xid and status. The status is ok, rpc-mismatch, or the accept status of RFC 5531.
# The reply to a call also has code, text, floats, and errors, the symbols of the trail.
proc rpc::reply record {
    if {$record eq "closed"} {
        return closed
    }
    binary scan $record IuIuIuIuIuIu xid kind denied a b status
    if {$kind == 0} {
        binary scan $record @40Iu n
        return [dict create goodbye [string range $record 44 [expr {43 + $n}]]]
    }
    if {$denied} {
        return [dict create xid $xid status rpc-mismatch]
    }
    set names {ok program-unavailable program-mismatch procedure-unavailable garbage}
    return [dict create xid $xid status [lindex $names $status]]
}

proc rpc::result record {
    set out [reply $record]
    if {$out eq "closed" || ![dict exists $out status] || [dict get $out status] ne "ok"} {
        return $out
    }
    binary scan $record @24I code
    set at 40
    dict set out code $code
    dict set out text [Text $record at]
    binary scan $record @${at}Iu n
    incr at 4
    binary scan $record @${at}Q$n floats
    dict set out floats $floats
    incr at [expr {8 * $n}]
    foreach size {8 1} {
        binary scan $record @${at}Iu n
        incr at [expr {4 + ($size * $n + 3 & ~3)}]
    }
    binary scan $record @${at}Iu words
    incr at 4
    for {set i 0} {$i < $words} {incr i} {
        Text $record at
    }
    binary scan $record @${at}IuIu dropped entries
    incr at 8
    set errors {}
    for {set i 0} {$i < $entries} {incr i} {
        incr at 4
        lappend errors [Text $record at]
        binary scan $record @${at}Iu details
        incr at 4
        for {set k 0} {$k < $details + 4} {incr k} {
            set s [Text $record at]
            if {$k == $details} {
                dict lappend out texts $s
            }
        }
        incr at 12
        Text $record at
    }
    dict set out errors $errors
    return $out
}

proc rpc::Text {record atVar} {
    upvar 1 $atVar at
    binary scan $record @${at}Iu n
    set s [string range $record [expr {$at + 4}] [expr {$at + 3 + $n}]]
    incr at [expr {4 + ($n + 3 & ~3)}]
    return [encoding convertfrom utf-8 $s]
}
