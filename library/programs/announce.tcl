# announce.tcl -- tell the local network of the ports of a daemon, by mDNS and DNS-SD, where Avahi runs. `daemons` at the prompt, the browser,
# `lxi discover --mdns` and VISA find them then.
#
#     ::sorma::announce::begin robot vxi11 1024 0.0.0.0
#     ::sorma::announce::end
#
# Avahi's program avahi-publish has the announcement as long as it runs. It ends with this process, however that ends: a shell waits for the end of its
# input. Without the program, or without Avahi's daemon, nothing is told, and nothing fails.

package provide sorma::announce 1.0

namespace eval ::sorma::announce {
    variable Channels {}        ;# to the shells
    variable Types {sorma _sorma._tcp vxi11 _vxi-11._tcp scpi _scpi-raw._tcp}
}

# ::sorma::announce::begin --
#       Announce a port, unless only this host can reach it.
# Arguments:
#       name        of the daemon
#       door        sorma: the bus; vxi11 or scpi: an instrument
#       port        where it listens
#       address     of its interface; empty: of this host alone
proc ::sorma::announce::begin {name door port address} {
    variable Channels
    variable Types
    if {[Local $address] || [auto_execok avahi-publish] eq {}} return
    set facts [if {$door ne "sorma"} {list txtvers=1 Manufacturer=SORMA Model=sormad SerialNumber=$name FirmwareVersion=[package provide sorma]}]
    set called [if {$door eq "sorma"} {set name} else {string cat "SORMA " $name}]
    set script {avahi-publish -f -s "$@" > /dev/null 2>&1 & trap "kill $!" EXIT; read end}
    if {![catch {open [list | sh -c $script sh $called [dict get $Types $door] $port {*}$facts] w} channel]} {
        chan configure $channel -blocking 0
        lappend Channels $channel
    }
}

# ::sorma::announce::end -- take all announcements back.
proc ::sorma::announce::end {} {
    variable Channels
    foreach channel $Channels {
        catch {close $channel}
    }
    set Channels {}
}

proc ::sorma::announce::Local address {
    return [expr {$address in {{} localhost ::1} || [string match 127.* $address]}]
}
