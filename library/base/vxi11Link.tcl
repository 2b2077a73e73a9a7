# vxi11Link.tcl -- a link of VXI-11: a message that comes in pieces, an answer that goes in pieces, and its requests for service. It belongs to
# sorma::vxi11, which also says what INSTRUMENT is.

package provide sorma::vxi11Link 1.0

namespace eval ::sorma::vxi11Link {
    variable MostMessage 65536  ;# bytes of a message that has not ended
    variable MostRead 1048576   ;# bytes that are read at once
}

oo::class create ::sorma::vxi11Link::link {
    variable Server Line Number Instrument Id Device
    variable Input              ;# of a message that has not ended
    variable Output At End      ;# the answer; where its rest begins; does its end come with it
    variable Busy               ;# a message is executed
    variable Enabled Handle     ;# service requests: are they sent, and with what
    variable Asked Asks         ;# it has asked for service and was not polled; the reason was there when we looked last

    constructor {server line number instrument id} {
        set Server $server
        set Line $line
        set Number $number
        set Instrument $instrument
        set Id $id
        set Device [{*}$instrument device $id]
        set Input [set Output [set Handle {}]]
        set At [set Busy [set Enabled [set Asked [set Asks 0]]]]
        set End 1
        {*}$instrument watch $id [namespace code {my Look}]
    }
    destructor {
        {*}$Instrument close $Id
        $Server linkEnded $Number $Device
    }
    method number {} { return $Number }
    method line {} { return $Line }
    method device {} { return $Device }
    method busy {} { return $Busy }
    method owns channel { return [{*}$Instrument owns $Id $channel] }
    method trigger {} { return [{*}$Instrument trigger $Id] }

    # Bytes of a message. False: it becomes too long, and what has come of it is dropped.
    method put {bytes end} {
        append Input $bytes
        set size [if {$end} {string length $Input} else {{*}$Instrument whole $Input}]
        if {$size == 0} {
            if {[string length $Input] <= $::sorma::vxi11Link::MostMessage} {
                return 1
            }
            set Input {}
            my Wrong -363
            return 0
        }
        set message [string range $Input 0 $size-1]
        set Input [string range $Input $size end]
        if {[my available]} {
            # The answer was not read: the new message is in its place.
            set Output {}
            {*}$Instrument wrong $Id -410
        }
        set Busy 1
        set End 1
        set At 0
        {*}$Instrument message $Id $message [namespace code {my Done}]
        return 1
    }
    method Done {answer {end 1}} {
        set Busy 0
        set Output $answer
        set End $end
        my Look
        $Server changed
    }
    method available {} { return [expr {$At < [string length $Output]}] }
    # At most so many bytes of the answer, up to this character if it is not empty: the reason why they end, and the bytes.
    method get {size stop} {
        set last [expr {min([string length $Output], $At + min($size, $::sorma::vxi11Link::MostRead)) - 1}]
        set reason 0
        if {$stop ne {} && [set hit [string first $stop $Output $At]] >= 0 && $hit <= $last} {
            set last $hit
            set reason 2
        }
        set bytes [string range $Output $At $last]
        set At [expr {$last + 1}]
        set whole [expr {![my available]}]
        if {$whole} {
            set Output {}
            set At 0
        }
        return [list [expr {$reason | ([string length $bytes] == $size) | ($whole && $End ? 4 : 0)}] $bytes]
    }
    # Somebody wanted to read, and nobody had asked.
    method nothing {} {
        if {!$Busy} {
            my Wrong -420
        }
    }
    method Wrong number {
        {*}$Instrument wrong $Id $number
        my Look
    }
    method clear {} {
        {*}$Instrument clear $Id
        set Input [set Output {}]
        set At [set Busy 0]
        $Server changed
    }
    method enable {enable handle} {
        set Enabled $enable
        set Handle $handle
    }
    # The status byte. In it bit 6 says that it has asked for service; who polls has heard it.
    method poll {} {
        my Look
        set byte [expr {([{*}$Instrument status $Id [my available]] & ~64) | 64 * $Asked}]
        set Asked 0
        return $byte
    }
    # Is there a new reason to ask for service?
    method Look {} {
        set asks [expr {([{*}$Instrument status $Id [my available]] & 64) != 0}]
        if {$asks && !$Asks} {
            set Asked 1
            if {$Enabled} {
                $Line request $Handle
            }
        } elseif {!$asks} {
            set Asked 0
        }
        set Asks $asks
    }
}
