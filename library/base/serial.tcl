# serial.tcl -- serial lines: what an address says, and a channel that is set so.
#
#     ::sorma::serial::parse /dev/ttyUSB0,9600,8n1,rtscts     -> path mode handshake, as `chan configure` takes them
#     ::sorma::serial::open {path mode handshake}             -> the channel: raw bytes, not blocking
#     ::sorma::serial::time CHANNEL BYTES                     -> ms that it needs for so many bytes
#     ::sorma::serial::close CHANNEL
# The last two take other channels, too: these need no time.
#
# Errors have the code SERIAL and: ADDRESS, it is no such address; BUSY, this process has opened the line already; or OPEN, there is no such
# line, or it does not take these settings.

package provide sorma::serial 1.0

namespace eval ::sorma::serial {
    variable Lines {}           ;# dict: channel -> path without links, and bits in a second
}

proc ::sorma::serial::parse text {
    if {![regexp {^(/[^,]+),([1-9]\d{0,7}),([5-8])([noems])([12])(?:,(none|rtscts|xonxoff))?$} $text -> path baud data parity stop handshake]} {
        throw {SERIAL ADDRESS} "expected PATH,BAUD,8n1 and perhaps ,rtscts or ,xonxoff, got \"$text\""
    }
    return [list $path $baud,$parity,$data,$stop [expr {$handshake eq {} ? "none" : $handshake}]]
}

# The driver of a line may take other settings than it was told. Then answers would be garbage now and then, so the settings are read again.
# Bytes of before are dropped.
proc ::sorma::serial::open line {
    variable Lines
    lassign $line path mode handshake
    set true [True $path]
    if {[lsearch -exact -index 0 [dict values $Lines] $true] >= 0} {
        throw {SERIAL BUSY} "another object of this process has opened it"
    }
    if {[catch {::open $path {RDWR NOCTTY NONBLOCK}} channel]} {
        throw {SERIAL OPEN} $channel
    }
    try {
        if {[catch {chan configure $channel -mode}]} {
            throw {SERIAL OPEN} "$path is no serial line"
        }
        chan configure $channel -mode $mode
        chan configure $channel -handshake $handshake
        set has [chan configure $channel -mode]
        if {$has ne $mode} {
            throw {SERIAL OPEN} "the line does not take [Said $mode]; it has [Said $has]"
        }
        chan configure $channel -blocking 0 -buffering none -translation binary
        read $channel
    } on error why {
        catch {::close $channel}
        throw {SERIAL OPEN} $why
    }
    dict set Lines $channel [list $true [lindex [split $mode ,] 0]]
    return $channel
}

# A start bit, 8 bits, parity and a stop bit are 11.
proc ::sorma::serial::time {channel bytes} {
    variable Lines
    return [expr {[dict exists $Lines $channel] ? 11000 * $bytes / [lindex [dict get $Lines $channel] 1] : 0}]
}

# Bytes that were not sent are sent without the device's "go on", or dropped where Tcl can: the kernel would wait for it, and the process with it.
proc ::sorma::serial::close channel {
    variable Lines
    if {[dict exists $Lines $channel]} {
        dict unset Lines $channel
        catch {chan configure $channel -handshake none}
        catch {chan configure $channel -closemode discard}
    }
    catch {::close $channel}
}

# Without links: two names may be one line.
proc ::sorma::serial::True path {
    return [file dirname [file normalize $path/x]]
}

# 9600,n,8,1 as people write it: 9600,8n1.
proc ::sorma::serial::Said mode {
    lassign [split $mode ,] baud parity data stop
    return $baud,$data$parity$stop
}
