# http.tcl -- ask a web server of this host, byte by byte where a test wants it.
#
# http::get HOST PORT PATH ?HEADER ...?     status and body
# http::say HOST PORT BYTES                 all that it answers until it closes the connection

namespace eval http {}

proc http::get {host port path args} {
    if {[lsearch -glob $args Host:*] < 0} {
        lappend args "Host: $host:$port"
    }
    set said [say $host $port [join [list "GET $path HTTP/1.1" {*}$args {} {}] \r\n]]
    regexp {^HTTP/1\.[01] (\d+)} $said -> status
    return [list $status [string range $said [string first \r\n\r\n $said]+4 end]]
}

proc http::say {host port bytes} {
    set channel [socket $host $port]
    fconfigure $channel -translation binary -buffering none
    try {
        # While nobody listens there yet, the kernel may choose that very port for us: then we are at both ends.
        if {[fconfigure $channel -sockname] eq [fconfigure $channel -peername]} {
            error "nobody listens at $host:$port"
        }
        puts -nonewline $channel $bytes
        return [read $channel]
    } finally {
        close $channel
    }
}
