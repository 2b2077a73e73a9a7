# vxi11.tcl -- VXI-11, the side of the instrument: links, locks with deadlines, service requests. It knows no bus, and no SCPI.
#
#     ::sorma::vxi11::server create NAME INSTRUMENT 127.0.0.1 0       then NAME port
#
# INSTRUMENT is a command prefix. It executes messages:
#
#     open CHANNEL DEVICE         the id of a new link, such as to inst0. Empty: there is no such device, or not for who is at the other end
#     owns ID CHANNEL             does the link belong to who is at the other end there?
#     device ID                   the name of its device. A lock keeps all other links out of the device
#     whole BYTES                 how many of these bytes are messages that have ended
#     message ID BYTES DONE       execute messages, then call DONE with the answer, and 0 if its end does not come. The error VXI11 HANGUP hangs up
#     trigger ID                  a message, or empty: the device has no trigger
#     status ID AVAILABLE         its status byte. AVAILABLE: an answer waits
#     wrong ID NUMBER             an error of SCPI in the protocol
#     watch ID PREFIX             call PREFIX when the status byte may have changed without a message
#     clear ID, close ID          cancel what is executed. DONE is not called any more
#
# Each connection executes its calls one after another: one that waits for a lock or an answer holds up its own connection alone. A connection that
# ends takes its links and their locks along.
#
# Source: VXIbus Consortium, TCP/IP Instrument Protocol, VXI-11 revision 1.0, section B.

package require sorma::oncRpc
package require sorma::vxi11Link
package provide sorma::vxi11 1.0

namespace eval ::sorma::vxi11 {
    variable MostLines 64       ;# connections
    variable MostLinks 64       ;# of all connections
    variable MostWrite 65536    ;# bytes of a device_write
    variable MostOutput 4194304 ;# bytes of replies that a client has not read
    variable Core 0x0607af
    variable Abort 0x0607b0
    variable Interrupt 0x0607b1
    variable Procedures {
        0x0607af {
            0 Null  10 CreateLink  11 Write  12 Read  13 Status  14 Trigger  15 Clear  16 Mode  17 Mode  18 Lock  19 Unlock  20 EnableRequests
            22 Command  23 DestroyLink  25 CreateInterrupts  26 DestroyInterrupts
        }
        0x0607b0 {0 Null  1 AbortLink}
    }
    # Errors, as the protocol numbers them.
    variable Error {
        none 0  device 3  link 4  parameter 5  channel 6  unsupported 8  resources 9  locked 11  unlocked 12  late 15  address 21  abort 23  again 29  ended 17
    }
}

# ---- the listener ----

oo::class create ::sorma::vxi11::server {
    variable Instrument
    variable Sockets            ;# dict: program -> listening socket
    variable Lines              ;# dict: object of a connection -> 1
    variable Links              ;# dict: number -> object of a link
    variable Locks              ;# dict: device -> number of the link that has its lock
    variable Waiting            ;# dict: object of a connection that waits -> 1
    variable Serial

    # port: 0 picks a free one. The abort channel has a free one in any case.
    constructor {instrument address port} {
        set Instrument $instrument
        set Lines [set Links [set Locks [set Waiting [set Sockets {}]]]]
        set Serial 0
        dict set Sockets $::sorma::vxi11::Core [socket -server [namespace code [list my Accept $::sorma::vxi11::Core]] -myaddr $address $port]
        dict set Sockets $::sorma::vxi11::Abort [socket -server [namespace code [list my Accept $::sorma::vxi11::Abort]] -myaddr $address 0]
    }
    destructor {
        foreach socket [dict values $Sockets] {
            catch {close $socket}
        }
        foreach line [dict keys $Lines] {
            $line destroy
        }
    }
    # The port of a program.
    method port {{program {}}} {
        return [lindex [chan configure [dict get $Sockets [if {$program eq {}} {set ::sorma::vxi11::Core} else {set program}]] -sockname] 2]
    }
    method Accept {program channel address port} {
        if {[dict size $Lines] >= $::sorma::vxi11::MostLines} {
            return [close $channel]
        }
        dict set Lines [::sorma::vxi11::line new [self] $Instrument $program $channel $address] 1
    }
    method lines {} { return [dict size $Lines] }
    method lineEnded line {
        dict unset Lines $line
        dict unset Waiting $line
    }

    # ---- links and locks ----

    # A new link, or nothing: there are too many.
    method add {line id} {
        if {[dict size $Links] >= $::sorma::vxi11::MostLinks} return
        while {[dict exists $Links [incr Serial]]} {}
        dict set Links $Serial [::sorma::vxi11Link::link new [self] $line $Serial $Instrument $id]
        return [dict get $Links $Serial]
    }
    method full {} { return [expr {[dict size $Links] >= $::sorma::vxi11::MostLinks}] }
    method link number { return [if {[dict exists $Links $number]} {dict get $Links $number}] }
    method linkEnded {number device} {
        dict unset Links $number
        if {[my owner $device] eq $number} {
            my unlock $device
        }
    }
    method owner device { return [if {[dict exists $Locks $device]} {dict get $Locks $device}] }
    # May a link use the device?
    method free {device number} { return [expr {![dict exists $Locks $device] || [dict get $Locks $device] == $number}] }
    method lock {device number} { dict set Locks $device $number }
    method unlock device {
        dict unset Locks $device
        my changed
    }
    # Something has changed: those who wait look again. The next one in their order comes first.
    method changed {} {
        foreach line [dict keys $Waiting] {
            after 0 [list ::sorma::vxi11::Wake $line]
        }
    }
    method waits line { dict set Waiting $line 1 }
    method goesOn line { dict unset Waiting $line }
}

proc ::sorma::vxi11::Wake {line {what changed}} {
    if {[info object isa object $line]} {
        $line wake $what
    }
}

# ---- a connection ----

oo::class create ::sorma::vxi11::line {
    variable Server Instrument Program Channel Address
    variable Input              ;# bytes that have come and were not executed
    variable State              ;# of the coroutine: idle, it wants a record; waiting, for a change; busy, it executes
    variable Ended              ;# 1: the other end has closed the connection
    variable Waits              ;# number of the link whose call waits
    variable Mine               ;# numbers of its links
    variable Requests           ;# channel of service requests, the program there, and its version; empty: none

    constructor {server instrument program channel address} {
        set Server $server
        set Instrument $instrument
        set Program $program
        set Channel $channel
        set Address $address
        set Input [set Mine [set Waits [set Requests {}]]]
        set Ended 0
        chan configure $channel -blocking 0 -translation binary -buffersize 65536
        chan event $channel readable [namespace code {my Hear}]
        coroutine Work [namespace which my] Work
    }
    destructor {
        foreach number $Mine {
            [$Server link $number] destroy
        }
        catch {my EndRequests}
        catch {close $Channel}
        $Server lineEnded [self]
    }
    method Hear {} {
        if {[catch {read $Channel 65536} piece] || [eof $Channel] && $piece eq {}} {
            chan event $Channel readable {}
            set Ended 1
            return [my wake ended]
        }
        append Input $piece
        if {$State eq "idle"} {
            Work go
        } elseif {[string length $Input] > 2 * $::sorma::vxi11::MostWrite} {
            # One that only sends waits.
            chan event $Channel readable {}
        }
    }
    method wake what {
        if {$State eq "waiting" || $what eq "ended" && $State eq "idle"} {
            Work $what
        }
    }
    method Work {} {
        try {
            while {[set record [my Next]] ne {} && [set call [::sorma::oncRpc::asked $record]] ne {} && [set reply [my Answer $call]] ne {} && [my Say $reply]} {}
        } finally {
            [self] destroy
        }
    }
    # The next record; empty: the connection is of no use any more.
    method Next {} {
        while {!$Ended} {
            lassign [::sorma::oncRpc::take $Input [expr {$::sorma::vxi11::MostWrite + 1024}]] size record
            if {$size < 0} break
            if {$size > 0} {
                set Input [string range $Input $size end]
                if {$Input ne {}} {
                    # Others come first.
                    chan event $Channel readable [namespace code {my Hear}]
                    after 0 [list ::sorma::vxi11::Wake [self] go]
                    set State waiting
                    yield
                    set State busy
                }
                return $record
            }
            set State idle
            yield
            set State busy
        }
        return
    }
    # Send a reply. False: it cannot be sent, or the client does not read.
    method Say record {
        return [expr {!$Ended && ![catch {puts -nonewline $Channel $record; flush $Channel}] && [chan pending output $Channel] < $::sorma::vxi11::MostOutput}]
    }
    # The reply; empty: none, the connection ends.
    method Answer call {
        lassign $call xid rpc program version procedure arguments
        if {$rpc != 2} {
            return [::sorma::oncRpc::refusal $xid rpc]
        } elseif {$program != $Program} {
            return [::sorma::oncRpc::refusal $xid program]
        } elseif {$version != 1} {
            return [::sorma::oncRpc::refusal $xid version 1 1]
        } elseif {![dict exists $::sorma::vxi11::Procedures $Program $procedure]} {
            return [::sorma::oncRpc::refusal $xid procedure]
        }
        try {
            return [::sorma::oncRpc::reply $xid [my [dict get $::sorma::vxi11::Procedures $Program $procedure] $arguments]]
        } trap {VXI11 ARGUMENTS} {} {
            return [::sorma::oncRpc::refusal $xid arguments]
        } trap {VXI11 HANGUP} {} {
            return
        }
    }
    # The arguments of a call as words. With opaque, bytes stand at the end.
    method Arguments {bytes words {opaque {}}} {
        set count [expr {$words + ($opaque ne {})}]
        if {[binary scan $bytes Iu${count} all] && ($opaque eq {} || [string length $bytes] - 4 * $count >= [lindex $all end])} {
            return [if {$opaque eq {}} {set all} else {lreplace $all end end [string range $bytes [expr {4 * $count}] [expr {4 * $count + [lindex $all end] - 1}]]}]
        }
        throw {VXI11 ARGUMENTS} "too few arguments"
    }
    method Fail {why args} { return [binary format Iu* [list [dict get $::sorma::vxi11::Error $why] {*}$args]] }
    # The link with this number, if it is one of this connection.
    method Link number { return [if {$number in $Mine} {$Server link $number}] }

    # Wait until the condition holds, not longer than so many ms: ready, late, abort, or ended.
    method Await {number ms condition} {
        if {[uplevel 1 [list expr $condition]]} {
            return ready
        }
        set Waits $number
        $Server waits [self]
        set timer [after $ms [list ::sorma::vxi11::Wake [self] late]]
        while 1 {
            set State waiting
            set what [yield]
            set State busy
            if {$what in {late abort ended}} break
            if {[uplevel 1 [list expr $condition]]} {
                set what ready
                break
            }
        }
        after cancel $timer
        $Server goesOn [self]
        set Waits {}
        return $what
    }
    # Wait until no other link has the lock of this device: none, or why not.
    method Gate {number device flags ms} {
        if {[$Server free $device $number]} {
            return none
        }
        if {!($flags & 1)} {
            return locked
        }
        return [dict get {ready none late locked abort abort ended ended} [my Await $number $ms {[$Server free $device $number]}]]
    }
    # As most calls begin: the link is there, and not locked by another one. Sets link in the caller.
    method Enter {number flags ms} {
        upvar 1 link link
        set link [my Link $number]
        return [if {$link eq {}} {string cat link} else {my Gate $number [$link device] $flags $ms}]
    }

    # ---- the calls ----

    method Null arguments { return }

    method CreateLink arguments {
        lassign [my Arguments $arguments 3 opaque] client locks ms device
        if {[$Server full]} {
            return [my Fail resources 0 0 0]
        }
        set id [{*}$Instrument open $Channel $device]
        if {$id eq {}} {
            return [my Fail device 0 0 0]
        }
        set link [$Server add [self] $id]
        lappend Mine [set number [$link number]]
        if {$locks} {
            set why [my Gate $number [$link device] 1 $ms]
            if {$why ne "none"} {
                my Destroy $number
                return [my Fail $why 0 0 0]
            }
            $Server lock [$link device] $number
        }
        return [my Fail none $number [$Server port $::sorma::vxi11::Abort] $::sorma::vxi11::MostWrite]
    }
    method DestroyLink arguments {
        lassign [my Arguments $arguments 1] number
        if {[my Link $number] eq {}} {
            return [my Fail link]
        }
        my Destroy $number
        return [my Fail none]
    }
    method Destroy number {
        [$Server link $number] destroy
        set Mine [lsearch -all -inline -not -exact $Mine $number]
    }
    method Write arguments {
        lassign [my Arguments $arguments 4 opaque] number io ms flags bytes
        if {[set why [my Enter $number $flags $ms]] ne "none"} {
            return [my Fail $why 0]
        }
        if {[string length $bytes] > $::sorma::vxi11::MostWrite} {
            return [my Fail parameter 0]
        }
        if {[$link busy] && [set what [my Await $number $io {![$link busy]}]] ne "ready"} {
            return [my Fail $what 0]
        }
        if {![$link put $bytes [expr {$flags & 8}]]} {
            return [my Fail resources 0]
        }
        return [my Fail none [string length $bytes]]
    }
    method Read arguments {
        lassign [my Arguments $arguments 6] number size io ms flags stop
        if {[set why [my Enter $number $flags $ms]] ne "none"} {
            return [my Fail $why 0 0]
        }
        if {$size == 0} {
            return [my Fail none 1 0]
        }
        if {![$link available] && [set what [my Await $number $io {[$link available]}]] ne "ready"} {
            if {$what eq "late"} {
                $link nothing
            }
            return [my Fail $what 0 0]
        }
        lassign [$link get $size [if {$flags & 128} {format %c [expr {$stop & 255}]}]] reason bytes
        return [my Fail none $reason][::sorma::oncRpc::opaque $bytes]
    }
    method Status arguments {
        lassign [my Arguments $arguments 4] number flags ms
        if {[set why [my Enter $number $flags $ms]] ne "none"} {
            return [my Fail $why 0]
        }
        return [my Fail none [$link poll]]
    }
    method Trigger arguments {
        lassign [my Arguments $arguments 4] number flags ms io
        if {[set why [my Enter $number $flags $ms]] ne "none"} {
            return [my Fail $why]
        }
        set message [$link trigger]
        if {$message eq {}} {
            return [my Fail unsupported]
        }
        set what [my Await $number $io {![$link busy]}]
        if {$what ne "ready"} {
            return [my Fail $what]
        }
        $link put $message 1
        return [my Fail none]
    }
    method Clear arguments {
        lassign [my Arguments $arguments 4] number flags ms
        if {[set why [my Enter $number $flags $ms]] eq "none"} {
            $link clear
        }
        return [my Fail $why]
    }
    # Remote or local: there are no keys on the front.
    method Mode arguments {
        lassign [my Arguments $arguments 4] number flags ms
        return [my Fail [my Enter $number $flags $ms]]
    }
    method Lock arguments {
        lassign [my Arguments $arguments 3] number flags ms
        if {[set why [my Enter $number $flags $ms]] ne "none"} {
            return [my Fail $why]
        }
        # Twice the same link: the protocol says that this is refused.
        if {[$Server owner [$link device]] eq $number} {
            return [my Fail locked]
        }
        $Server lock [$link device] $number
        return [my Fail none]
    }
    method Unlock arguments {
        lassign [my Arguments $arguments 1] number
        if {[set link [my Link $number]] eq {}} {
            return [my Fail link]
        }
        if {[$Server owner [$link device]] ne $number} {
            return [my Fail unlocked]
        }
        $Server unlock [$link device]
        return [my Fail none]
    }
    method Command arguments {
        lassign [my Arguments $arguments 1] number
        return [my Fail [if {[my Link $number] eq {}} {string cat link} else {string cat unsupported}] 0]
    }
    method AbortLink arguments {
        lassign [my Arguments $arguments 1] number
        set link [$Server link $number]
        if {$link eq {} || ![$link owns $Channel]} {
            return [my Fail link]
        }
        [$link line] abort $number
        return [my Fail none]
    }
    method abort number {
        if {$Waits eq $number} {
            ::sorma::vxi11::Wake [self] abort
        }
    }

    # ---- service requests ----

    method EnableRequests arguments {
        lassign [my Arguments $arguments 2 opaque] number enable handle
        if {[set link [my Link $number]] eq {}} {
            return [my Fail link]
        }
        if {[string length $handle] > 40} {
            return [my Fail parameter]
        }
        $link enable $enable $handle
        return [my Fail none]
    }
    # A connection of our own back to the client, and to nobody else.
    method CreateInterrupts arguments {
        lassign [my Arguments $arguments 5] host port program version udp
        if {$Requests ne {}} {
            return [my Fail again]
        } elseif {$udp} {
            return [my Fail unsupported]
        } elseif {$port < 1 || $port > 65535} {
            return [my Fail parameter]
        } elseif {[join [lmap shift {24 16 8 0} {expr {($host >> $shift) & 255}}] .] ne [regsub {^::ffff:} $Address {}]} {
            return [my Fail address]
        }
        if {[catch {socket -async $Address $port} channel]} {
            return [my Fail channel]
        }
        set Requests [list $channel $program $version]
        chan configure $channel -blocking 0 -translation binary
        chan event $channel writable [list ::sorma::vxi11::Wake [self]]
        set what [my Await {} 2000 {![chan configure $channel -connecting]}]
        if {$what ne "ready" || [chan configure $channel -error] ne {}} {
            my EndRequests
            return [my Fail channel]
        }
        chan event $channel writable {}
        chan event $channel readable [namespace code {my DropReplies}]
        return [my Fail none]
    }
    method DestroyInterrupts arguments {
        if {$Requests eq {}} {
            return [my Fail channel]
        }
        my EndRequests
        return [my Fail none]
    }
    method EndRequests {} {
        if {$Requests ne {}} {
            catch {close [lindex $Requests 0]}
            set Requests {}
        }
    }
    method DropReplies {} {
        set channel [lindex $Requests 0]
        if {[catch {read $channel 4096}] || [eof $channel]} {
            my EndRequests
        }
    }
    method request handle {
        if {$Requests eq {}} return
        lassign $Requests channel program version
        if {[catch {puts -nonewline $channel [::sorma::oncRpc::call 0 $program $version 30 [::sorma::oncRpc::opaque $handle]]; flush $channel}] ||
                [chan pending output $channel] > 65536} {
            my EndRequests
        }
    }
}
