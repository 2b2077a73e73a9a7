# web.tcl -- a sorma-web for tests, and what a program or a browser asks of it.
#
# web::start ?-option value ...?            a dict: place (http://HOST:PORT) port key (of its link) rest pipe pid log
# web::stop FACTS                           by SIGTERM; an error unless it exits with 0
# web::ask FACTS METHOD PATH ?HEADERS? ?BODY?   with the key for programs unless HEADERS says who asks: {STATUS HEADERS BODY}
# web::rest FACTS METHOD PATH ?BODY?        the same with JSON: {STATUS DICT}
# web::with WORDS SCRIPT                    run it with a daemon `d`, started with WORDS, and a sorma-web `w`
# web::refused ANSWER                       of web::rest: {STATUS CODE}
# web::cookie FACTS ?LINK?                  the link exchanged: the cookie
# web::events FACTS PATH                    a stream that is read in the background: its name. web::items NAME: a dict of what it has
# web::hangUp NAME

package require json
source [file join [file dirname [info script]] http.tcl]
namespace eval web {
    variable Items          ;# array: name of a stream -> dict; Rest: what has not been read; Ticks: how many
    variable Rest
    variable Raw            ;# array: bytes that are not a whole chunk yet; Begun: have all headers come
    variable Begun
    variable Ticks
    variable Count 0
}

proc web::start args {
    variable Count
    set log [file join [::tcltest::temporaryDirectory] web[pid]x[incr Count].log]
    set pipe [open [list | sorma-web {*}[dict merge {-port 0} $args] 2> $log] r]
    set facts [dict create pipe $pipe pid [pid $pipe] log $log]
    if {![regexp {^ready (https?://[^/]+:(\d+))/\?key=([0-9a-f]+)$} [gets $pipe] -> place port key] || ![regexp {^rest ([0-9a-f]+)$} [gets $pipe] -> rest]} {
        catch {close $pipe}
        return -code error "sorma-web is not ready: [exec cat $log]"
    }
    return [dict merge $facts [dict create place $place port $port key $key rest $rest]]
}
proc web::stop facts {
    exec sh -c {kill "$@"} kill -TERM [dict get $facts pid]
    close [dict get $facts pipe]
    set said [exec cat [dict get $facts log]]
    file delete [dict get $facts log]
    if {$said ne {}} {
        error "sorma-web said: $said"
    }
}

proc web::ask {facts method path {headers {}} {body {}}} {
    set port [dict get $facts port]
    set all [dict create Host 127.0.0.1:$port Connection close]
    if {![dict exists $headers Cookie] && ![dict exists $headers Authorization]} {
        dict set all Authorization "Bearer [dict get $facts rest]"
    }
    if {$body ne {} || $method eq "POST"} {
        set body [encoding convertto utf-8 $body]
        set all [dict merge $all [dict create Content-Type application/json Content-Length [string length $body]]]
    }
    set all [dict filter [dict merge $all $headers] value ?*]
    if {[catch {http::say 127.0.0.1 $port "$method $path HTTP/1.1\r\n[join [lmap {name value} $all {string cat "$name: $value\r\n"}] {}]\r\n$body"} said]} {
        return {0 {} {}}
    }
    if {![regexp {^HTTP/1\.1 (\d+)[^\r]*\r\n(.*?)\r\n\r\n(.*)$} $said -> status headers body]} {
        return [list 0 {} $said]
    }
    set known {}
    foreach line [split [string map {\r {}} $headers] \n] {
        regexp {^([^:]+): *(.*)$} $line -> name value
        dict set known [string tolower $name] $value
    }
    if {[dict exists $known transfer-encoding]} {
        set body [Chunks body]
    }
    # Pictures are bytes.
    set picture [expr {[dict exists $known content-type] && [string match image/* [dict get $known content-type]]}]
    return [list $status $known [expr {$picture ? $body : [encoding convertfrom utf-8 $body]}]]
}
# Take whole chunks of HTTP (a size, its bytes, the end of a line) off a variable. Returns what was in them.
proc web::Chunks rawVar {
    upvar 1 $rawVar raw
    set out {}
    while {[regexp {^([0-9a-fA-F]+)\r\n} $raw head digits] && [string length $raw] >= [string length $head] + [scan $digits %x] + 2} {
        set from [string length $head]
        set to [expr {$from + [scan $digits %x]}]
        append out [string range $raw $from $to-1]
        set raw [string range $raw $to+2 end]
    }
    return $out
}
proc web::rest {facts method path {body {}}} {
    lassign [ask $facts $method $path {} $body] status - text
    return [list $status [json::json2dict $text]]
}
proc web::with {words script} {
    uplevel 1 [list set d [daemon start -make foo.a -make bar.a -make echo.a {*}$words]]
    uplevel 1 {set w [web::start]}
    try {
        uplevel 1 {waitFor {[lindex [web::rest $w GET /api/foo.a@$d] 0] in {200 403}}}
        return [uplevel 1 $script]
    } finally {
        uplevel 1 {web::stop $w}
        daemon stop [uplevel 1 {set d}]
    }
}
proc web::refused answer {
    lassign $answer status body
    return [list $status [lrange [dict get $body error code] 1 2]]
}
proc web::cookie {facts {path {}}} {
    lassign [ask $facts GET [expr {$path eq {} ? "/?key=[dict get $facts key]" : $path}] {Authorization none}] status headers
    regexp {^([^;]+);} [dict get $headers set-cookie] -> cookie
    return $cookie
}

proc web::events {facts path} {
    variable Items
    variable Rest
    variable Ticks
    variable Raw
    variable Begun
    set channel [socket 127.0.0.1 [dict get $facts port]]
    fconfigure $channel -translation binary -blocking 0 -buffering none
    puts -nonewline $channel "GET $path HTTP/1.1\r\nHost: 127.0.0.1:[dict get $facts port]\r\nAuthorization: Bearer [dict get $facts rest]\r\n\r\n"
    set Items($channel) {}
    set Rest($channel) [set Raw($channel) {}]
    set Begun($channel) 0
    set Ticks($channel) 0
    fileevent $channel readable [list web::Read $channel]
    return $channel
}
proc web::Read channel {
    variable Items
    variable Raw
    variable Begun
    variable Rest
    variable Ticks
    append Raw($channel) [read $channel]
    if {[eof $channel]} {
        fileevent $channel readable {}
        dict set Items($channel) ended 1
    }
    if {!$Begun($channel)} {
        if {[set end [string first \r\n\r\n $Raw($channel)]] < 0} return
        set Begun($channel) 1
        set Raw($channel) [string range $Raw($channel) $end+4 end]
    }
    append Rest($channel) [Chunks Raw($channel)]
    set lines [split $Rest($channel) \n]
    set Rest($channel) [lindex $lines end]
    foreach line [lrange $lines 0 end-1] {
        if {[string match "event: tick*" $line]} {
            incr Ticks($channel)
        } elseif {[regexp {^data: (\{.+\})\r?$} $line -> json]} {
            set Items($channel) [dict merge $Items($channel) [json::json2dict $json]]
        }
    }
}
proc web::items channel {
    variable Items
    return $Items($channel)
}
proc web::item {channel args} {
    variable Items
    return [if {[dict exists $Items($channel) {*}$args]} {dict get $Items($channel) {*}$args}]
}
proc web::hangUp channel {
    variable Items
    close $channel
    unset Items($channel)
}

# Requests of an object that are under way.
proc underway {object d} {
    return [lindex [lsearch -inline -index 0 -exact [dict get [lindex [sorm@$d DBX -inventory objects] 3] objects] $object] 3]
}
