# hislip.tcl -- HiSLIP, the side of the instrument, in synchronized mode. It knows no bus, and no SCPI.
#
#     ::sorma::hislip::server create NAME INSTRUMENT 127.0.0.1 0       then NAME port
#
# INSTRUMENT is a command prefix as in vxi11.tcl: open, owns, message, trigger, status, watch, clear, close. A session has a connection for messages and one for the
# rest, by the same author. It ends with either. It has one message at a time. There are no locks and no TLS.
#
# Source: IVI Foundation, IVI-6.1, High-Speed LAN Instrument Protocol, revision 1.1.

package require sorma::hislipMessage
package provide sorma::hislip 1.0

namespace eval ::sorma::hislip {
    variable MostLines 64       ;# connections
    variable MostMessage 65536  ;# bytes of a message that has not ended
    variable MostOutput 134217728   ;# bytes of answers that a client has not read
}

oo::class create ::sorma::hislip::server {
    variable Instrument Socket
    variable Lines              ;# dict: channel -> dict: input session (0: none yet) kind (sync or async)
    variable Sessions           ;# dict: number -> dict: id sync async message busy asks piece, the bytes that its client takes at once
    variable Serial

    constructor {instrument address port} {
        set Instrument $instrument
        set Lines [set Sessions {}]
        set Serial 0
        set Socket [socket -server [namespace code {my Accept}] -myaddr $address $port]
    }
    destructor {
        close $Socket
        foreach channel [dict keys $Lines] {
            if {[dict exists $Lines $channel]} {
                my HangUp $channel
            }
        }
    }
    method port {} { return [lindex [chan configure $Socket -sockname] 2] }
    method lines {} { return [dict size $Sessions] }

    method Accept {channel args} {
        if {[dict size $Lines] >= $::sorma::hislip::MostLines} {
            return [close $channel]
        }
        chan configure $channel -blocking 0 -translation binary
        dict set Lines $channel {input {} session 0 kind {}}
        chan event $channel readable [namespace code [list my Hear $channel]]
    }
    # The other connection of a session goes, too.
    method HangUp channel {
        if {![dict exists $Lines $channel]} return
        set session [dict get $Lines $channel session]
        dict unset Lines $channel
        catch {close $channel}
        if {[dict exists $Sessions $session]} {
            set facts [dict get $Sessions $session]
            dict unset Sessions $session
            {*}$Instrument close [dict get $facts id]
            my HangUp [dict get $facts sync]
            my HangUp [dict get $facts async]
        }
    }
    method Hear channel {
        if {[catch {read $channel 65536} piece] || [eof $channel]} {
            return [my HangUp $channel]
        }
        dict set Lines $channel input [dict get $Lines $channel input]$piece
        my Next $channel
    }
    method Next channel {
        while {[dict exists $Lines $channel]} {
            set session [dict get $Lines $channel session]
            if {[dict get $Lines $channel kind] eq "sync" && [dict get $Sessions $session busy]} {
                # One message at a time: a client that only sends waits.
                return [chan event $channel readable {}]
            }
            set input [dict get $Lines $channel input]
            set message [lassign [::sorma::hislipMessage::take $input $::sorma::hislip::MostMessage] size name]
            if {$size == 0} break
            if {$size < 0} {
                my Say $channel FatalError 1 0 "poorly formed message"
                return [my HangUp $channel]
            }
            dict set Lines $channel input [string range $input $size end]
            if {[catch {my Take $channel $session $name {*}$message} why how]} {
                if {[lindex [dict get $how -errorcode] 1] ne "HANGUP"} {
                    my Say $channel FatalError 3 0 $why
                }
                my HangUp $channel
            }
        }
        if {[dict exists $Lines $channel]} {
            chan event $channel readable [namespace code [list my Hear $channel]]
        }
    }
    method Say {channel args} {
        catch {
            puts -nonewline $channel [::sorma::hislipMessage::make {*}$args]
            flush $channel
        }
        if {![catch {chan pending output $channel} waits] && $waits > $::sorma::hislip::MostOutput} {
            my HangUp $channel
        }
    }
    method Take {channel session name control parameter payload} {
        set kind [dict get $Lines $channel kind]
        switch -- $kind/$name {
            /Initialize { return [my Initialize $channel $parameter $payload] }
            /AsyncInitialize { return [my AsyncInitialize $channel $parameter] }
            sync/Data - sync/DataEnd { return [my Data $session $name $parameter $payload] }
            sync/Trigger {
                set message [{*}$Instrument trigger [dict get $Sessions $session id]]
                return [if {$message ne {}} {my Data $session DataEnd $parameter $message}]
            }
            sync/DeviceClearComplete { return [my Say $channel DeviceClearAcknowledge 0 0] }
            async/AsyncMaxMsgSize {
                if {[binary scan $payload Wu size]} {
                    dict set Sessions $session piece [expr {min(max($size, 256), 67108864)}]
                }
                return [my Say $channel AsyncMaxMsgSizeResponse 0 0 [binary format W $::sorma::hislip::MostMessage]]
            }
            async/AsyncStatusQuery {
                return [my Say $channel AsyncStatusResponse [{*}$Instrument status [dict get $Sessions $session id] 0] 0]
            }
            async/AsyncDeviceClear {
                {*}$Instrument clear [dict get $Sessions $session id]
                dict set Sessions $session message {}
                dict set Sessions $session busy 0
                my Say $channel AsyncDeviceClearAcknowledge 0 0
                return [my Next [dict get $Sessions $session sync]]
            }
            async/AsyncRemoteLocalControl { return [my Say $channel AsyncRemoteLocalResponse 0 0] }
        }
        if {$kind eq {}} {
            error "a session begins with Initialize"
        }
        my Say $channel Error 1 0 "$name is not supported"
    }
    method Initialize {channel parameter device} {
        set id [{*}$Instrument open $channel [if {$device eq {}} {string cat inst0} else {string map {hislip inst} $device}]]
        if {$id eq {}} {
            error "no such device, or not for you"
        }
        while {[dict exists $Sessions [set Serial [expr {$Serial % 65535 + 1}]]]} {}
        dict set Sessions $Serial [dict create id $id sync $channel async {} message {} busy 0 asks 0 piece 65536]
        dict set Lines $channel session $Serial
        dict set Lines $channel kind sync
        {*}$Instrument watch $id [namespace code [list my Look $Serial]]
        my Say $channel InitializeResponse 0 [expr {0x01000000 | $Serial}]
    }
    method AsyncInitialize {channel session} {
        if {![dict exists $Sessions $session] || [dict get $Sessions $session async] ne {} || ![{*}$Instrument owns [dict get $Sessions $session id] $channel]} {
            error "there is no such session"
        }
        dict set Sessions $session async $channel
        dict set Lines $channel session $session
        dict set Lines $channel kind async
        my Say $channel AsyncInitializeResponse 0 0x4f53
    }
    method Data {session name number payload} {
        set message [dict get $Sessions $session message]$payload
        if {[dict get $Sessions $session async] eq {} || [string length $message] > $::sorma::hislip::MostMessage} {
            error "a message that is too long, or a session that has not begun"
        }
        dict set Sessions $session message [if {$name eq "Data"} {set message}]
        if {$name eq "DataEnd"} {
            dict set Sessions $session busy 1
            {*}$Instrument message [dict get $Sessions $session id] $message [namespace code [list my Done $session $number]]
        }
    }
    # end: 0 when the end of the answer does not come.
    method Done {session number answer {end 1}} {
        if {![dict exists $Sessions $session]} return
        set channel [dict get $Sessions $session sync]
        set piece [expr {[dict get $Sessions $session piece] - 16}]
        for {set at 0} {$at < [string length $answer]} {incr at $piece} {
            set last [expr {$end && $at + $piece >= [string length $answer]}]
            my Say $channel [if {$last} {string cat DataEnd} else {string cat Data}] 0 $number [string range $answer $at [expr {$at + $piece - 1}]]
        }
        if {![dict exists $Sessions $session]} return
        dict set Sessions $session busy 0
        my Look $session
        after 0 [namespace code [list my Next $channel]]
    }
    # Does the instrument request service? Once, until the reason is gone.
    method Look session {
        if {![dict exists $Sessions $session]} return
        set byte [{*}$Instrument status [dict get $Sessions $session id] 0]
        set asks [expr {($byte & 64) != 0}]
        if {$asks && ![dict get $Sessions $session asks] && [dict get $Sessions $session async] ne {}} {
            my Say [dict get $Sessions $session async] AsyncServiceRequest $byte 0
        }
        dict set Sessions $session asks $asks
    }
}
