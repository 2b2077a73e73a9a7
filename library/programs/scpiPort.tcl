# scpiPort.tcl -- the objects of this process as an instrument: lines of SCPI by TCP. sorma::scpiLink answers them.
#
#     ::sorma::scpiPort::listen 5025      then FOO:A:TEMPo presto, FOO:A:TEMPo?, FOO:A:EXEC

package require sorma::scpiLink
package provide sorma::scpiPort 1.0

namespace eval ::sorma::scpiPort {
    variable Lines {}           ;# dict: channel -> dict: id of the link, input, busy
    variable MostLines 64
    variable MostInput 65536    ;# bytes of a line
    variable MostOutput 1048576 ;# bytes that a client has not read
}

# ::sorma::scpiPort::listen --
#       Answer SCPI on a port of this host.
# Arguments:
#       port        0: a free one
#       address     where: this host alone, unless said otherwise
# Results:
#       The port.
proc ::sorma::scpiPort::listen {port {address 127.0.0.1}} {
    set server [socket -server ::sorma::scpiPort::Accept -myaddr $address $port]
    return [lindex [chan configure $server -sockname] 2]
}

proc ::sorma::scpiPort::Accept {channel args} {
    variable Lines
    variable MostLines
    if {[dict size $Lines] >= $MostLines} {
        return [close $channel]
    }
    chan configure $channel -blocking 0 -translation binary
    dict set Lines $channel [dict create id [::sorma::scpiLink open $channel] input {} busy 0]
    chan event $channel readable [list ::sorma::scpiPort::Hear $channel]
}

proc ::sorma::scpiPort::HangUp channel {
    variable Lines
    if {[dict exists $Lines $channel]} {
        ::sorma::scpiLink close [dict get $Lines $channel id]
        dict unset Lines $channel
    }
    catch {close $channel}
}

proc ::sorma::scpiPort::Hear channel {
    variable Lines
    variable MostInput
    if {[catch {read $channel 16384} piece] || [eof $channel]} {
        return [HangUp $channel]
    }
    set input [dict get $Lines $channel input]$piece
    dict set Lines $channel input $input
    if {![dict get $Lines $channel busy]} {
        Next $channel
    } elseif {[string length $input] > $MostInput} {
        # One that only sends waits.
        chan event $channel readable {}
    }
}

# Execute the next line, if it is there.
proc ::sorma::scpiPort::Next channel {
    variable Lines
    variable MostInput
    if {![dict exists $Lines $channel]} return
    set input [dict get $Lines $channel input]
    set size [::sorma::scpiLink first $input]
    if {$size > 0} {
        dict set Lines $channel busy 1
        dict set Lines $channel input [string range $input $size end]
        return [::sorma::scpiLink message [dict get $Lines $channel id] [string range $input 0 $size-1] [list ::sorma::scpiPort::Answered $channel]]
    }
    dict set Lines $channel busy 0
    if {[string length $input] > $MostInput} {
        Say $channel "-363,\"Input buffer overrun\"\n"
        return [HangUp $channel]
    }
    chan event $channel readable [list ::sorma::scpiPort::Hear $channel]
}

proc ::sorma::scpiPort::Answered {channel answer} {
    variable Lines
    if {![Say $channel $answer]} {
        return [HangUp $channel]
    }
    if {[dict get $Lines $channel input] eq {}} {
        return [Next $channel]
    }
    # Others come first.
    after 0 [list ::sorma::scpiPort::Next $channel]
}

# False: it cannot be sent, or the client does not read.
proc ::sorma::scpiPort::Say {channel text} {
    variable MostOutput
    return [expr {$text eq {} || ![catch {puts -nonewline $channel $text; flush $channel}] && [chan pending output $channel] <= $MostOutput}]
}
