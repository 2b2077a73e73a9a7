# tlsProxy.tcl -- a proxy between clients and the daemon at 127.0.0.1:PORT. To a connection it does one thing, at one byte of one side:
#
#     cut     it ends the connection there
#     flip    a bit of that byte is another
#     strip   from there on the side has said what a daemon without TLS answers to the probe, and the rest of that piece is lost
#     clear   the same, and the rest of the piece follows
#     probe   it asks the daemon for TLS by itself: for clients that do not know the probe
#     ok      nothing
#
# The side is near (what clients say) or far (what the daemon says). It is sourced, or a program: tlsProxy.tcl PORT HOW ?BYTE?. The program prints its
# port, and ends with its input. A line on its input has HOW and BYTE for the next connections, or a side. The answer to the line is in hex: what that
# side, or else near, has said since the last line.

namespace eval tlsProxy {
    variable Does           ;# array: port -> {target how side at}
    variable Heard          ;# array: port,side -> bytes
    variable Came           ;# array: channel -> bytes so far
    variable Probe [binary format I11 {0x80000028 7 0 2 0x20534f52 1 0 7 0 0 0}]
    variable Plain [binary format I7 {0x80000018 0x544c5331 1 0 0 0 0}]     ;# to the probe of our own clients
}

# tlsProxy::begin TARGET HOW ?SIDE? ?AT? -- listen: {server port}.
proc tlsProxy::begin {target how {side far} {at 0}} {
    variable Does
    set server [socket -server tlsProxy::Accept -myaddr 127.0.0.1 0]
    set port [lindex [fconfigure $server -sockname] 2]
    set Does($port) [list $target $how $side $at]
    heard $port near
    heard $port far
    return [list $server $port]
}

proc tlsProxy::end {server port} {
    variable Does
    variable Heard
    close $server
    unset Does($port) Heard($port,near) Heard($port,far)
}

# tlsProxy::heard PORT SIDE -- what it has said since the last time.
proc tlsProxy::heard {port side} {
    variable Heard
    set said [expr {[info exists Heard($port,$side)] ? $Heard($port,$side) : {}}]
    set Heard($port,$side) {}
    return $said
}

proc tlsProxy::Accept {near host port} {
    variable Does
    variable Came
    variable Probe
    set mine [lindex [fconfigure $near -sockname] 2]
    lassign $Does($mine) target how side at
    set far [socket 127.0.0.1 $target]
    foreach channel [list $near $far] {
        fconfigure $channel -translation binary -buffering none
        set Came($channel) 0
    }
    if {$how eq "probe"} {
        puts -nonewline $far $Probe
        if {[string range [read $far 36] 24 31] ne "STARTTLS"} {
            return [CloseBoth $near $far]
        }
    }
    foreach {name from to} [list near $near $far far $far $near] {
        fconfigure $from -blocking 0
        fileevent $from readable [list tlsProxy::Carry $name $from $to $mine [expr {$name eq $side ? $how : "ok"}] $at]
    }
}

proc tlsProxy::CloseBoth {one other} {
    variable Came
    catch {close $one}
    catch {close $other}
    unset -nocomplain Came($one) Came($other)
}

proc tlsProxy::Carry {name from to port how at} {
    variable Came
    variable Heard
    variable Plain
    if {[catch {read $from} some] || ($some eq {} && [eof $from])} {
        return [CloseBoth $from $to]
    }
    if {[info exists Heard($port,$name)]} {
        append Heard($port,$name) $some
    }
    set here [expr {$at - $Came($from)}]
    incr Came($from) [string length $some]
    set end 0
    if {$here >= 0 && $here < [string length $some]} {
        switch -- $how {
            cut { set some [string range $some 0 $here-1]; set end 1 }
            flip {
                binary scan $some @${here}cu value
                set some [string replace $some $here $here [binary format c [expr {$value ^ (1 << int(8 * rand()))}]]]
            }
            strip { set some [string range $some 0 $here-1]$Plain }
            clear { set some $Plain[string range $some $here end] }
        }
    }
    if {[catch {puts -nonewline $to $some}] || $end} {
        CloseBoth $from $to
    }
}

proc tlsProxy::main {target how {at 0}} {
    variable Does
    lassign [begin $target $how far $at] - port
    puts $port
    flush stdout
    fileevent stdin readable [list tlsProxy::Answer $port]
    vwait forever
}

proc tlsProxy::Answer port {
    variable Does
    if {[gets stdin line] < 0} exit
    set side near
    if {[lindex $line 0] in {near far}} {
        set side [lindex $line 0]
    } elseif {[llength $line] > 0} {
        lset Does($port) 1 [lindex $line 0]
        lset Does($port) 3 [expr {[llength $line] > 1 ? [lindex $line 1] : 0}]
    }
    puts [binary encode hex [heard $port $side]]
    flush stdout
}

if {[info exists argv0] && [file tail [info script]] eq [file tail $argv0]} {
    tlsProxy::main {*}$argv
}
