# vxi11Port.tcl -- the objects of this process as an instrument, by VXI-11. sorma::vxi11 speaks the protocol, sorma::scpiLink answers.
#
#     ::sorma::vxi11Port::listen 1        inst0 is this process, foo.a an object

package require sorma::scpiLink
package require sorma::vxi11
package require sorma::vxi11Rpcbind
package provide sorma::vxi11Port 1.0

namespace eval ::sorma::vxi11Port {
    variable Server {}          ;# the listener
    variable Registered 0       ;# rpcbind knows it
}

# ::sorma::vxi11Port::listen --
#       Answer VXI-11.
# Arguments:
#       port        1: a free one, and rpcbind tells it; 0: a free one, and nobody tells it
#       address     where: this host alone, unless said otherwise
# Results:
#       The port of the core channel.
proc ::sorma::vxi11Port::listen {port {address 127.0.0.1}} {
    variable Server
    variable Registered
    set tell [expr {$port == 1}]
    set server [::sorma::vxi11::server new ::sorma::scpiLink $address [expr {$tell ? 0 : $port}]]
    if {$tell} {
        try {
            ::sorma::vxi11Rpcbind::tell [$server port] "say a port instead of 1"
        } on error {message options} {
            $server destroy
            return -options $options $message
        }
        set Registered 1
    }
    set Server $server
    return [$server port]
}

# ::sorma::vxi11Port::close -- end all connections.
proc ::sorma::vxi11Port::close {} {
    variable Server
    variable Registered
    if {$Server eq {}} return
    if {$Registered} {
        ::sorma::vxi11Rpcbind::forget
        set Registered 0
    }
    $Server destroy
    set Server {}
}
