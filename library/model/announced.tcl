# announced.tcl -- daemons that the local network announces by mDNS (_sorma._tcp), as Avahi's program avahi-browse hears them.
#
# This is a hint for people. Anybody in the network can announce anything, so nobody is called because of it.
# Without Avahi there are none.

package require sorma
package provide sorma::announced 1.0

namespace eval ::sorma::announced {
    variable Patience 1         ;# s for what Avahi knows
}

# ::sorma::announced::find -- a list of {NAME ADDRESS:PORT}, sorted, each once.   ask PREFIX -- the same without waiting: PREFIX is called with it.
proc ::sorma::announced::find {} {
    if {[catch {Open} pipe]} {
        return
    }
    set lines [read $pipe]
    catch {close $pipe}
    return [All $lines]
}
proc ::sorma::announced::ask prefix {
    if {[catch {Open} pipe]} {
        return
    }
    chan configure $pipe -blocking 0
    chan event $pipe readable [list ::sorma::announced::Read $pipe $prefix {}]
}
proc ::sorma::announced::Open {} {
    variable Patience
    return [open [list | timeout $Patience avahi-browse --resolve --parsable --no-db-lookup --terminate _sorma._tcp < /dev/null 2> /dev/null] r]
}
proc ::sorma::announced::Read {pipe prefix lines} {
    append lines [read $pipe]
    if {![eof $pipe]} {
        return [chan event $pipe readable [list ::sorma::announced::Read $pipe $prefix $lines]]
    }
    catch {close $pipe}
    uplevel #0 [list {*}$prefix [All $lines]]
}
proc ::sorma::announced::All lines {
    return [lsort -unique [lmap line [split $lines \n] {
        set found [Found $line]
        if {$found eq {}} continue
        set found
    }]]
}

# A line of avahi-browse: =;INTERFACE;PROTOCOL;NAME;TYPE;DOMAIN;HOST;ADDRESS;PORT;FACTS. Addresses of a link mean nothing without its interface.
proc ::sorma::announced::Found line {
    lassign [split $line \;] mark - - name - - - address port
    if {$mark ne "=" || ![regexp {^(?:[\d.]+|[0-9a-fA-F:]+)$} $address] || ![regexp {^\d{1,5}$} $port] || [string match -nocase fe80:* $address]} {
        return
    }
    # \C is a character, and \DDD a byte of UTF-8 in decimal.
    set bytes [encoding convertto utf-8 $name]
    set from 0
    while {[regexp -indices -start $from {\\(\d{3}|.)} $bytes at meant]} {
        set meant [string range $bytes {*}$meant]
        set bytes [string replace $bytes {*}$at [if {[string length $meant] == 3} {format %c [expr {[scan $meant %d] & 255}]} else {set meant}]]
        set from [expr {[lindex $at 0] + 1}]
    }
    set name [encoding convertfrom utf-8 $bytes]
    return [list $name [if {[string first : $address] >= 0} {string cat \[ $address \]} else {set address}]:$port]
}
