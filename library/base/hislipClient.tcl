# hislipClient.tcl -- HiSLIP, the side of the client: one session with one instrument, in synchronized mode. It never blocks, and knows no bus and no SCPI.
#
#     ::sorma::hislipClient::line create NAME WAIT    then open HOST PORT DEVICE MS
#
# It has the methods and errors of a line to an instrument, see instrumentLine.tcl, and asks for WAIT in the same way. A session has two connections: one for
# messages and answers, and one for the status byte and service requests. A line that was shut begins with a new session, so there is nothing to clear.
#
# Source: IVI Foundation, IVI-6.1, High-Speed LAN Instrument Protocol, revision 1.1.

package require sorma::hislipMessage
package require sorma::instrumentLine
package provide sorma::hislipClient 1.0

namespace eval ::sorma::hislipClient {
    variable First 0xffffff00   ;# number of the first message
    variable MostWrite 65536    ;# bytes of a message that are sent at once
    variable MostSmall 4096     ;# bytes of a message that is no data
}

oo::class create ::sorma::hislipClient::line {
    superclass ::sorma::instrumentLine::line
    variable Channel Async      ;# the two connections; empty: closed
    variable Input Behind       ;# bytes of each that were not used yet
    variable Number             ;# of the next message
    variable Taken              ;# an answer was taken since the message before: the instrument is told so
    variable MostWrite          ;# bytes that the instrument takes at once
    variable Prefix             ;# called when the instrument requests service; empty: nothing

    constructor wait {
        set Async [set Prefix {}]
        next $wait
    }
    method idle {} { return [expr {![catch {read $Channel} piece] && ![eof $Channel] && $piece eq {} && $Async ne {}}] }
    method requests prefix { set Prefix $prefix }
    method shut {} {
        catch {close $Async}
        set Async [set Input [set Behind {}]]
        next
    }
    method open {host port device ms} {
        my shut
        set Channel [my Connect $host $port]
        lassign [my Ask $Channel Initialize 0x01004f53 $device InitializeResponse REACH] control parameter
        set Async [my Connect $host $port]
        my Ask $Async AsyncInitialize [expr {$parameter & 0xffff}] {} AsyncInitializeResponse REACH
        lassign [my Ask $Async AsyncMaxMsgSize 0 [binary format W 67108864] AsyncMaxMsgSizeResponse REACH] - - payload
        if {![binary scan $payload Wu most]} {
            throw {LINE REACH} "it answers nonsense about the size of messages"
        }
        set MostWrite [expr {min(max($most, 256) - 16, $::sorma::hislipClient::MostWrite)}]
        set Number $::sorma::hislipClient::First
        set Taken 0
        chan event $Async readable [namespace code {my Hear}]
    }
    method Say {channel args} {
        if {[catch {puts -nonewline $channel [::sorma::hislipMessage::make {*}$args]} why]} {
            throw {LINE UNSENT} $why
        }
    }
    # The next message on a connection: name, control code, parameter, payload.
    method Next {channel most} {
        upvar 0 [if {$channel eq $Async} {my varname Behind} else {my varname Input}] input
        while 1 {
            set message [lassign [::sorma::hislipMessage::take $input $most] size name]
            if {$size < 0} {
                throw [list LINE [if {$name eq "big"} {string cat BIG} else {string cat ERROR}]] [if {$name eq "big"} {string cat "$message bytes or more"} else {string cat "it does not speak HiSLIP"}]
            }
            if {$size > 0} {
                set input [string range $input $size end]
                if {$name in {FatalError Error}} {
                    throw {LINE ERROR} "it says error [lindex $message 0] of HiSLIP: [string range [lindex $message 2] 0 100]"
                }
                return [list $name {*}$message]
            }
            append input [my Piece $channel "the other end has closed it, [string length $input] bytes of an answer had come"]
        }
    }
    # Say something, and wait for its answer: control code, parameter, payload.
    method Ask {channel name parameter payload answer symbol {control 0}} {
        my Say $channel $name $control $parameter $payload
        while 1 {
            set message [lassign [my Next $channel $::sorma::hislipClient::MostSmall] got]
            if {$got eq $answer} {
                return $message
            }
            if {$got eq "AsyncServiceRequest"} {
                my Requested
            } elseif {$got ne "AsyncInterrupted"} {
                throw [list LINE $symbol] "it answers $name with $got"
            }
        }
    }

    method write {bytes ms} {
        set size [string length $bytes]
        for {set at 0} {$at < $size} {incr at $MostWrite} {
            set name [if {$at + $MostWrite >= $size} {string cat DataEnd} else {string cat Data}]
            my Say $Channel $name $Taken $Number [string range $bytes $at [expr {$at + $MostWrite - 1}]]
            set Taken 0
            set Number [expr {($Number + 2) & 0xffffffff}]
        }
    }
    # Pieces of the answer to the last message. Those to another one were given up.
    method read {most ms end} {
        set mine [list [expr {($Number - 2) & 0xffffffff}] 0xffffffff 4294967295]
        set answer {}
        while 1 {
            lassign [my Next $Channel $most] name - number piece
            if {$name ni {Data DataEnd}} {
                if {$name eq "Interrupted"} continue
                throw {LINE ERROR} "it sends $name where an answer should be"
            }
            if {$number ni $mine} continue
            append answer $piece
            if {[string length $answer] > $most} {
                throw {LINE BIG} "[string length $answer] bytes or more"
            }
            if {$name eq "DataEnd"} {
                set Taken 1
                return $answer
            }
        }
    }
    method status ms {
        try {
            return [lindex [my Ask $Async AsyncStatusQuery [expr {($Number - 2) & 0xffffffff}] {} AsyncStatusResponse ERROR $Taken] 0]
        } finally {
            catch {chan event $Async readable [namespace code {my Hear}]}
        }
    }
    # Unasked: a service request, or the end.
    method Hear {} {
        if {[catch {read $Async 65536} piece] || [eof $Async]} {
            catch {close $Async}
            set Async {}
            return
        }
        append Behind $piece
        while {[lindex [set message [::sorma::hislipMessage::take $Behind $::sorma::hislipClient::MostSmall]] 0] > 0} {
            set Behind [string range $Behind [lindex $message 0] end]
            if {[lindex $message 1] eq "AsyncServiceRequest"} {
                my Requested
            }
        }
        if {[lindex $message 0] < 0} {
            close $Async
            set Async {}
        }
    }
    method Requested {} {
        if {$Prefix ne {}} {
            after 0 $Prefix
        }
    }
}
