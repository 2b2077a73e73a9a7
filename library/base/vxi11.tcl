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
    # Program -> procedure -> its method, the arguments, and how many words of 0 stand behind an error. A last argument with * is counted bytes.
    # `number` is that of a link of the same connection, which the method gets before all. One with `flags` waits for the lock of the device.
    variable Procedures {
        0x0607af {
            0  {Null {} 0}
            10 {CreateLink {client locks ms device*} 3}
            11 {Write {number io ms flags bytes*} 1}
            12 {Read {number size io ms flags stop} 2}
            13 {Status {number flags ms io} 1}
            14 {Trigger {number flags ms io} 0}
            15 {Clear {number flags ms io} 0}
            16 {Mode {number flags ms io} 0}
            17 {Mode {number flags ms io} 0}
            18 {Lock {number flags ms} 0}
            19 {Unlock {number} 0}
            20 {EnableRequests {number enable handle*} 0}
            22 {Command {number} 1}
            23 {DestroyLink {number} 0}
            25 {CreateInterrupts {host port program version udp} 0}
            26 {DestroyInterrupts {} 0}
        }
        0x0607b0 {0 {Null {} 0}  1 {AbortLink {other} 0}}
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
        lassign [dict get $::sorma::vxi11::Procedures $Program $procedure] method names zeros
        try {
            set results [my $method {*}[my Enter $names [my Arguments $names $arguments]]]
        } trap {VXI11 ARGUMENTS} {} {
            return [::sorma::oncRpc::refusal $xid arguments]
        } trap {VXI11 FAIL} why {
            set results [my Results $why {*}[lrepeat $zeros 0]]
        } trap {VXI11 HANGUP} {} {
            return
        }
        return [::sorma::oncRpc::reply $xid $results]
    }
    # The arguments of a call, by these names.
    method Arguments {names bytes} {
        set count [llength $names]
        if {$count == 0} return
        if {[binary scan $bytes Iu$count words]} {
            if {![string match *\\* [lindex $names end]]} {
                return $words
            }
            set size [lindex $words end]
            if {[string length $bytes] - 4 * $count >= $size} {
                return [lreplace $words end end [string range $bytes [expr {4 * $count}] [expr {4 * $count + $size - 1}]]]
            }
        }
        throw {VXI11 ARGUMENTS} "too few arguments"
    }
    # The same arguments, and the link before them, when it may be used.
    method Enter {names values} {
        if {[lindex $names 0] ne "number"} {
            return $values
        }
        set number [lindex $values 0]
        set link [my Link $number]
        if {$link eq {}} {
            my Fail link
        }
        if {"flags" in $names} {
            my Gate $number [$link device] {*}[lmap name {flags ms} {lindex $values [lsearch -exact $names $name]}]
        }
        return [list $link {*}$values]
    }
    method Results {why args} { return [binary format Iu* [list [dict get $::sorma::vxi11::Error $why] {*}$args]] }
    method Fail why { throw {VXI11 FAIL} $why }
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
    # The same; fails unless it is ready.
    method Ready {number ms condition} {
        set what [uplevel 1 [list my Await $number $ms $condition]]
        if {$what ne "ready"} {
            my Fail $what
        }
    }
    # Wait until no other link has the lock of this device.
    method Gate {number device flags ms} {
        if {[$Server free $device $number]} return
        set what [if {$flags & 1} {my Await $number $ms {[$Server free $device $number]}} else {string cat late}]
        if {$what ne "ready"} {
            my Fail [expr {$what eq "late" ? "locked" : $what}]
        }
    }

    # ---- the calls ----

    method Null {} { return }

    method CreateLink {client locks ms device} {
        if {[$Server full]} {
            my Fail resources
        }
        set id [{*}$Instrument open $Channel $device]
        if {$id eq {}} {
            my Fail device
        }
        set link [$Server add [self] $id]
        lappend Mine [set number [$link number]]
        if {$locks} {
            try {
                my Gate $number [$link device] 1 $ms
            } trap {VXI11 FAIL} {why how} {
                my Destroy $number
                return -options $how $why
            }
            $Server lock [$link device] $number
        }
        return [my Results none $number [$Server port $::sorma::vxi11::Abort] $::sorma::vxi11::MostWrite]
    }
    method DestroyLink {link number} {
        my Destroy $number
        return [my Results none]
    }
    method Destroy number {
        [$Server link $number] destroy
        set Mine [lsearch -all -inline -not -exact $Mine $number]
    }
    method Write {link number io ms flags bytes} {
        if {[string length $bytes] > $::sorma::vxi11::MostWrite} {
            my Fail parameter
        }
        my Ready $number $io {![$link busy]}
        if {![$link put $bytes [expr {$flags & 8}]]} {
            my Fail resources
        }
        return [my Results none [string length $bytes]]
    }
    method Read {link number size io ms flags stop} {
        if {$size == 0} {
            return [my Results none 1 0]
        }
        set what [my Await $number $io {[$link available]}]
        if {$what eq "late"} {
            $link nothing
        }
        if {$what ne "ready"} {
            my Fail $what
        }
        lassign [$link get $size [if {$flags & 128} {format %c [expr {$stop & 255}]}]] reason bytes
        return [my Results none $reason][::sorma::oncRpc::opaque $bytes]
    }
    method Status {link args} { return [my Results none [$link poll]] }
    method Trigger {link number flags ms io} {
        set message [$link trigger]
        if {$message eq {}} {
            my Fail unsupported
        }
        my Ready $number $io {![$link busy]}
        $link put $message 1
        return [my Results none]
    }
    method Clear {link args} {
        $link clear
        return [my Results none]
    }
    # Remote or local: there are no keys on the front.
    method Mode args { return [my Results none] }
    # Twice the same link: the protocol says that this is refused.
    method Lock {link number args} {
        if {[$Server owner [$link device]] eq $number} {
            my Fail locked
        }
        $Server lock [$link device] $number
        return [my Results none]
    }
    method Unlock {link number} {
        if {[$Server owner [$link device]] ne $number} {
            my Fail unlocked
        }
        $Server unlock [$link device]
        return [my Results none]
    }
    method Command args { my Fail unsupported }
    method AbortLink number {
        set link [$Server link $number]
        if {$link eq {} || ![$link owns $Channel]} {
            my Fail link
        }
        [$link line] abort $number
        return [my Results none]
    }
    method abort number {
        if {$Waits eq $number} {
            ::sorma::vxi11::Wake [self] abort
        }
    }

    # ---- service requests ----

    method EnableRequests {link number enable handle} {
        if {[string length $handle] > 40} {
            my Fail parameter
        }
        $link enable $enable $handle
        return [my Results none]
    }
    # A connection of our own back to the client, and to nobody else.
    method CreateInterrupts {host port program version udp} {
        if {$Requests ne {}} {
            my Fail again
        } elseif {$udp} {
            my Fail unsupported
        } elseif {$port < 1 || $port > 65535} {
            my Fail parameter
        } elseif {[join [lmap shift {24 16 8 0} {expr {($host >> $shift) & 255}}] .] ne [regsub {^::ffff:} $Address {}]} {
            my Fail address
        } elseif {[catch {socket -async $Address $port} channel]} {
            my Fail channel
        }
        set Requests [list $channel $program $version]
        chan configure $channel -blocking 0 -translation binary
        chan event $channel writable [list ::sorma::vxi11::Wake [self]]
        set what [my Await {} 2000 {![chan configure $channel -connecting]}]
        if {$what ne "ready" || [chan configure $channel -error] ne {}} {
            my EndRequests
            my Fail channel
        }
        chan event $channel writable {}
        chan event $channel readable [namespace code {my DropReplies}]
        return [my Results none]
    }
    method DestroyInterrupts {} {
        if {$Requests eq {}} {
            my Fail channel
        }
        my EndRequests
        return [my Results none]
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
