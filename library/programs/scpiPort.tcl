# scpiPort.tcl -- the objects of this process as an instrument: lines of SCPI by TCP. sorma::scpiLink answers them.
#
#     ::sorma::scpiPort::listen 5025      then FOO:A:TEMPo presto, FOO:A:TEMPo?, FOO:A:EXEC

package require sorma::scpiLink
package provide sorma::scpiPort 1.0

namespace eval ::sorma::scpiPort {
    variable MostLines 64       ;# connections
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
    variable MostLines
    if {[llength [info class instances ::sorma::scpiPort::line]] >= $MostLines} {
        return [close $channel]
    }
    ::sorma::scpiPort::line new $channel
}

# A connection, unless it has ended meanwhile, goes on.
proc ::sorma::scpiPort::Go line {
    if {[info object isa object $line]} {
        $line go
    }
}

oo::class create ::sorma::scpiPort::line {
    variable Channel Id         ;# its channel and its link
    variable Input              ;# bytes that have come and were not executed
    variable Busy               ;# a line is executed

    constructor channel {
        set Channel $channel
        set Id [::sorma::scpiLink open $channel]
        set Input {}
        set Busy 0
        chan configure $Channel -blocking 0 -translation binary
        my Listen
    }
    destructor {
        ::sorma::scpiLink close $Id
        catch {close $Channel}
    }
    method Listen {} { chan event $Channel readable [namespace code {my Hear}] }
    method Hear {} {
        if {[catch {read $Channel 16384} piece] || [eof $Channel]} {
            return [my destroy]
        }
        append Input $piece
        if {!$Busy} {
            my go
        } elseif {[string length $Input] > $::sorma::scpiPort::MostInput} {
            # One that only sends waits.
            chan event $Channel readable {}
        }
    }
    # Execute the next line, if it is there.
    method go {} {
        set size [::sorma::scpiLink first $Input]
        set Busy [expr {$size > 0}]
        if {$Busy} {
            set line [string range $Input 0 $size-1]
            set Input [string range $Input $size end]
            ::sorma::scpiLink message $Id $line [namespace code {my Answered}]
        } elseif {[string length $Input] <= $::sorma::scpiPort::MostInput} {
            my Listen
        } else {
            my Say "-363,\"Input buffer overrun\"\n"
            my destroy
        }
    }
    method Answered answer {
        if {![my Say $answer]} {
            my destroy
        } elseif {$Input eq {}} {
            my go
        } else {
            after 0 [list ::sorma::scpiPort::Go [self]]         ;# others come first
        }
    }
    # False: it cannot be sent, or the client does not read.
    method Say text {
        return [expr {$text eq {} || ![catch {puts -nonewline $Channel $text; flush $Channel}] && [chan pending output $Channel] <= $::sorma::scpiPort::MostOutput}]
    }
}
