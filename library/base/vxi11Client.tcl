# vxi11Client.tcl -- VXI-11, the side of the client: one link to one instrument. It never blocks, and knows no bus and no SCPI.
#
#     ::sorma::vxi11Client::line create NAME WAIT      then open, write, read within a coroutine
#
# It has the methods and errors of a line to an instrument, see streamLine.tcl, and asks for WAIT in the same way.

package require sorma::oncRpc
package provide sorma::vxi11Client 1.0

namespace eval ::sorma::vxi11Client {
    variable Core 0x0607af
    variable Rpcbind 111
    variable MostReply 4194304  ;# bytes of a reply
    variable MostRead 1048576   ;# bytes that are asked for at once
}

oo::class create ::sorma::vxi11Client::line {
    variable Wait
    variable Channel            ;# empty: closed
    variable Input              ;# bytes of replies
    variable Xid
    variable Link MostWrite     ;# number of the link, and bytes that it takes at once

    constructor wait {
        set Wait $wait
        set Channel {}
        set Xid 0
    }
    destructor {
        my shut
    }
    method isOpen {} { return [expr {$Channel ne {}}] }
    method idle {} { return [expr {![catch {read $Channel}] && ![eof $Channel]}] }
    method shut {} {
        if {$Channel ne {}} {
            catch {close $Channel}
        }
        set Channel [set Input {}]
    }
    # port: 0 asks the rpcbind of the host. ms: how long the instrument may wait for a lock.
    method open {host port device ms} {
        if {$port == 0} {
            my Connect $host $::sorma::vxi11Client::Rpcbind
            binary scan [my Call 3 [binary format Iu* [list $::sorma::vxi11Client::Core 1 6 0]] 100000 2]x4 Iu port
            my shut
            if {$port < 1 || $port > 65535} {
                throw {LINE REACH} "its rpcbind knows no VXI-11"
            }
        }
        my Connect $host $port
        set results [my Call 10 [binary format Iu* [list [pid] 0 $ms]][::sorma::oncRpc::opaque $device]]
        if {[binary scan $results IuIuIuIu error Link - MostWrite] < 4} {
            throw {LINE REACH} "it answers nonsense when a link is made"
        }
        if {$error} {
            throw {LINE REACH} [if {$error == 3} {string cat "it has no device $device, or not for us"} else {string cat "it makes no link to $device: error $error"}]
        }
        set MostWrite [expr {min(max($MostWrite, 256), 65536)}]
    }
    method Connect {host port} {
        my shut
        if {[catch {socket -async $host $port} channel]} {
            throw {LINE REACH} $channel
        }
        set Channel $channel
        chan configure $Channel -blocking 0 -buffering none -translation binary
        my Await writable
        if {[set why [chan configure $Channel -error]] ne {}} {
            throw {LINE REACH} "$why (port $port)"
        }
    }
    method Await event {
        set what [{*}$Wait $event $Channel 0]
        if {$Channel eq {}} {
            throw {LINE LOST} "the line was closed"
        }
        if {$what ne "ready"} {
            throw [list LINE WAIT $what] "given up: $what"
        }
    }
    # The results of a call. Replies to calls before it are dropped.
    method Call {procedure arguments {program 0x0607af} {version 1}} {
        set Xid [expr {($Xid + 1) & 0x7fffffff}]
        if {[catch {puts -nonewline $Channel [::sorma::oncRpc::call $Xid $program $version $procedure $arguments]} why]} {
            throw {LINE LOST} $why
        }
        while 1 {
            lassign [::sorma::oncRpc::take $Input $::sorma::vxi11Client::MostReply] size record
            if {$size < 0} {
                throw {LINE ERROR} "it does not speak RPC"
            }
            if {$size > 0} {
                set Input [string range $Input $size end]
                try {
                    return [::sorma::oncRpc::results $record $Xid]
                } trap {RPC OTHER} {} {
                    continue
                } trap {RPC REFUSED} why {
                    throw {LINE ERROR} $why
                }
            }
            my Await readable
            if {[catch {read $Channel 262144} piece] || [eof $Channel] && $piece eq {}} {
                throw {LINE LOST} "the other end has closed it"
            }
            append Input $piece
        }
    }
    method Check error {
        switch -- $error {
            0 { return }
            11 { throw {LINE LOCKED} "another client has locked it" }
            15 { throw {LINE LATE} "its time is over" }
        }
        throw {LINE ERROR} "it says error $error of VXI-11"
    }
    # Write a message.
    method write {bytes ms} {
        set size [string length $bytes]
        for {set at 0} {$at < $size} {incr at $MostWrite} {
            set piece [string range $bytes $at [expr {$at + $MostWrite - 1}]]
            set end [expr {$at + $MostWrite >= $size ? 8 : 0}]
            set results [my Call 11 [binary format Iu* [list $Link $ms $ms [expr {$end | 1}]]][::sorma::oncRpc::opaque $piece]]
            if {[binary scan $results IuIu error taken] < 2} {
                throw {LINE ERROR} "it answers nonsense to a write"
            }
            my Check $error
            if {$taken != [string length $piece]} {
                throw {LINE ERROR} "it has taken $taken bytes of [string length $piece]"
            }
        }
    }
    # The instrument says where the answer ends, and its time is over a little before ours.
    method read {most ms end} {
        set ms [expr {$ms * 9 / 10}]
        set answer {}
        set reason 0
        while {!($reason & 4)} {
            set results [my Call 12 [binary format Iu* [list $Link $::sorma::vxi11Client::MostRead $ms $ms 1 0]]]
            if {[binary scan $results IuIuIu error reason size] < 3 || [string length $results] < 12 + $size} {
                throw {LINE ERROR} "it answers nonsense to a read"
            }
            my Check $error
            append answer [string range $results 12 [expr {11 + $size}]]
            if {[string length $answer] > $most} {
                throw {LINE BIG} "[string length $answer] bytes or more"
            }
        }
        return $answer
    }
}
