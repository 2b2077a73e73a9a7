# vxi11Client.tcl -- VXI-11, the side of the client: one link to one instrument. It never blocks, and knows no bus and no SCPI.
#
#     ::sorma::vxi11Client::line create NAME WAIT      then open, write, read within a coroutine
#
# It has the methods and errors of a line to an instrument, see instrumentLine.tcl, and asks for WAIT in the same way.

package require sorma::instrumentLine
package require sorma::oncRpc
package provide sorma::vxi11Client 1.0

namespace eval ::sorma::vxi11Client {
    variable Core 0x0607af
    variable Interrupt 0x0607b1
    variable Rpcbind 111
    variable MostReply 4194304  ;# bytes of a reply
    variable MostRead 1048576   ;# bytes that are asked for at once
}

oo::class create ::sorma::vxi11Client::line {
    superclass ::sorma::instrumentLine::line
    variable Channel Opening
    variable Input              ;# bytes of replies
    variable Xid
    variable Link MostWrite     ;# number of the link, and bytes that it takes at once
    variable Prefix Handle      ;# of service requests: what is called then, empty: nothing; and by what they are known
    variable Listener Back      ;# where the instrument connects for them, and how it has done so: channel and bytes

    constructor wait {
        set Prefix [set Listener [set Back {}]]
        set Xid 0
        next $wait
    }
    method shut {} {
        foreach channel [list $Listener [lindex $Back 0]] {
            catch {close $channel}
        }
        set Input [set Listener [set Back {}]]
        next
    }
    # PREFIX is called when the instrument requests service; empty: it shall not. From the next opening on.
    method requests prefix { set Prefix $prefix }
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
        if {$Prefix ne {}} {
            my Listen
        }
    }
    method Connect {host port} {
        my shut
        try {
            set Channel [next $host $port]
        } trap {LINE OPEN} why {
            throw {LINE REACH} $why
        } trap {LINE REACH} why {
            throw {LINE REACH} "$why (port $port)"
        }
    }
    # A line that was closed meanwhile says so, and not that the instrument is late.
    method Await args {
        try {
            next {*}$args
        } trap {LINE WAIT} {why how} {
            if {$Channel eq {} && $Opening eq {}} {
                throw {LINE LOST} "the line was closed"
            }
            return -options $how $why
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
            append Input [my Piece $Channel "the other end has closed it"]
        }
    }
    # The status byte.
    method status ms {
        if {[binary scan [my Call 13 [binary format Iu* [list $Link 1 $ms $ms]]] IuIu error byte] < 2} {
            throw {LINE ERROR} "it answers nonsense when its status byte is read"
        }
        my Check $error
        return [expr {$byte & 255}]
    }

    # ---- service requests: the instrument connects to us, and calls ----

    method Listen {} {
        lassign [chan configure $Channel -sockname] address
        set address [regsub {^::ffff:} $address {}]
        if {![regexp {^[\d.]+$} $address]} {
            throw {LINE REACH} "service requests of VXI-11 need IPv4, and the line to it has $address"
        }
        set peer [lindex [chan configure $Channel -peername] 0]
        set Listener [socket -server [namespace code [list my Accept $peer]] -myaddr $address 0]
        set port [lindex [chan configure $Listener -sockname] 2]
        set host 0
        foreach part [split $address .] {
            set host [expr {$host << 8 | $part}]
        }
        set results [my Call 25 [binary format Iu* [list $host $port $::sorma::vxi11Client::Interrupt 1 0]]]
        if {![binary scan $results Iu error] || $error} {
            throw {LINE REACH} "it makes no connection for service requests: error [if {[info exists error]} {set error}]"
        }
        set Handle [format %x-%x [pid] [expr {int(rand() * 0x7fffffff)}]]
        set results [my Call 20 [binary format Iu* [list $Link 1]][::sorma::oncRpc::opaque $Handle]]
        if {![binary scan $results Iu error] || $error} {
            throw {LINE REACH} "it enables no service requests: error [if {[info exists error]} {set error}]"
        }
    }
    # Nobody but the instrument, and once.
    method Accept {peer channel address port} {
        if {$Back ne {} || $address ne $peer} {
            return [close $channel]
        }
        set Back [list $channel {}]
        chan configure $channel -blocking 0 -buffering none -translation binary
        chan event $channel readable [namespace code {my Hear}]
    }
    # These calls have no answer: the instrument does not wait.
    method Hear {} {
        lassign $Back channel input
        if {[catch {read $channel 65536} piece] || [eof $channel]} {
            catch {close $channel}
            set Back {}
            return
        }
        append input $piece
        while 1 {
            lassign [::sorma::oncRpc::take $input 1024] size record
            if {$size < 0} {
                close $channel
                set Back {}
                return
            }
            if {$size == 0} break
            set input [string range $input $size end]
            lassign [::sorma::oncRpc::asked $record] - - program - procedure arguments
            if {$program == $::sorma::vxi11Client::Interrupt && $procedure == 30 && [string match [::sorma::oncRpc::opaque $Handle]* $arguments]} {
                {*}$Prefix
            }
        }
        lset Back 1 $input
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
