# vxi11Rpcbind.tcl -- have this host's rpcbind tell clients the port of VXI-11's core channel.
#
#     ::sorma::vxi11Rpcbind::tell $port $way          a failure ends with $way: what to do
#     ::sorma::vxi11Rpcbind::forget
#
# rpcbind takes that from this host alone, by version 2 of its protocol (RFC 1833). Nothing else runs meanwhile, for 2 s at most: a program
# does it when it begins and when it ends.

package require sorma::oncRpc
package provide sorma::vxi11Rpcbind 1.0

namespace eval ::sorma::vxi11Rpcbind {
    variable Patience 2000      ;# ms for an answer
    variable Program 0x0607af   ;# of the core channel
    variable Procedures {set 1 unset 2 port 3}
}

# ::sorma::vxi11Rpcbind::tell --
#       Have rpcbind name this port of TCP.
# Arguments:
#       port        where the core channel listens
#       way         what to do when rpcbind does not: the end of the message
proc ::sorma::vxi11Rpcbind::tell {port way} {
    if {[Ask set $port $way]} return
    # A process that was killed has not taken its entry back.
    set other [Ask port 0 $way]
    if {$other > 0 && [Alive $other]} {
        return -code error "rpcbind names port $other for VXI-11 already: one process of a host can be told. [string toupper $way 0 0]"
    }
    Ask unset 0 $way
    if {![Ask set $port $way]} {
        return -code error "rpcbind of this host has refused to name port $port for VXI-11; $way"
    }
}

# ::sorma::vxi11Rpcbind::forget -- take the entry back, if rpcbind still answers.
proc ::sorma::vxi11Rpcbind::forget {} {
    catch {Ask unset 0 {}}
}

proc ::sorma::vxi11Rpcbind::Alive port {
    return [expr {![catch {close [socket 127.0.0.1 $port]}]}]
}

# The answer of rpcbind: for set and unset 1, it has done so; for port the port, or 0.
proc ::sorma::vxi11Rpcbind::Ask {what port way} {
    variable Patience
    variable Program
    variable Procedures
    if {[catch {socket 127.0.0.1 111} channel]} {
        return -code error "no rpcbind answers at port 111 of this host ($channel): start rpcbind, or $way"
    }
    try {
        chan configure $channel -blocking 0 -translation binary
        puts -nonewline $channel [::sorma::oncRpc::call 1 100000 2 [dict get $Procedures $what] [binary format Iu* [list $Program 1 6 $port]]]
        flush $channel
        set input {}
        set size 0
        for {set ms 0} {$size == 0 && $ms < $Patience && ![eof $channel]} {incr ms} {
            append input [read $channel 4096]
            lassign [::sorma::oncRpc::take $input 1024] size record
            if {$size == 0} {
                after 1
            }
        }
        if {$size > 0 && [binary scan [::sorma::oncRpc::results $record 1] Iu answer]} {
            return $answer
        }
    } on error {} {
    } finally {
        close $channel
    }
    return -code error "something at port 111 of this host does not speak as rpcbind does: start rpcbind, or $way"
}
