# webFlooder.tcl PORT KIND CONNECTIONS -- a stranger who asks a sorma-web as fast as he can, by so many connections.
#
# A connection that is closed is opened again. For "count" on standard input he prints four numbers: requests sent, answers, good answers, connections
# that were closed. The program ends with its input.
#
#     stranger   without a login          forged   with a cookie that nobody has given           origin   as a page of another site, with STOP
#     half       half a request           idle     nothing is sent                               huge     heads, bodies and pieces without end
#     upgrade    asks for a WebSocket, and sends frames

lassign $argv port kind connections
set host "Host: 127.0.0.1:$port"
set cookie "Cookie: sorma$port=[string repeat 0123456789abcdef 4]"
set burst [string repeat [dict get [dict create \
    stranger "GET /api HTTP/1.1\r\n$host\r\n\r\n" \
    forged "GET /api/foo.a@x HTTP/1.1\r\n$host\r\n$cookie\r\n\r\n" \
    origin "POST /stop HTTP/1.1\r\n$host\r\n$cookie\r\nOrigin: http://evil.example\r\nContent-Length: 2\r\n\r\n{}" \
    upgrade "GET /live/overview HTTP/1.1\r\n$host\r\n$cookie\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n\x82\xff\x00\x00\x00\x00\x7f\xff\xff\xff" \
    huge "POST /api/foo.a@x/exec HTTP/1.1\r\n$host\r\n$cookie\r\nTransfer-Encoding: chunked\r\n\r\n[string repeat "ffff\r\n[string repeat x 65535]\r\n" 4]" \
    half "GET / HT" idle {}] $kind] [expr {$kind in {half idle} ? 1 : $kind eq "huge" ? 8 : 100}]]
set each [expr {$kind in {half idle} ? 1 : $kind eq "huge" ? 8 : 100}]
lassign {0 0 0 0} sent answered good closed

proc again {} {
    if {[catch {socket -async 127.0.0.1 $::port} channel]} {
        return [after 10 again]
    }
    fconfigure $channel -translation binary -blocking 0 -buffering full
    fileevent $channel readable [list heard $channel]
    fileevent $channel writable [list write $channel]
}
proc write channel {
    if {[catch {
        puts -nonewline $channel $::burst
        flush $channel
    }]} {
        return [gone $channel]
    }
    incr ::sent $::each
    if {$::kind in {half idle}} {
        fileevent $channel writable {}
    }
}
proc heard channel {
    if {[catch {read $channel 65536} said]} {
        return [gone $channel]
    }
    incr ::answered [regexp -all {HTTP/1\.1 } $said]
    incr ::good [regexp -all {HTTP/1\.1 (?:200|101|303)} $said]
    if {[eof $channel]} {
        gone $channel
    }
}
proc gone channel {
    catch {close $channel}
    incr ::closed
    after 1 again
}
fileevent stdin readable {
    if {[gets stdin] eq {} && [eof stdin]} exit
    puts "$sent $answered $good $closed"
    flush stdout
}
for {set i 0} {$i < $connections} {incr i} again
vwait forever
