# mcap.tcl -- writes records of a recording as a file of MCAP, the container of robotics (mcap.dev/spec). Messages are JSON.
#
# Each object has a channel, SOURCE/OBJECT. The file has no chunks and no summary; readers take it from its beginning to its end.

package require sorma::json
package provide sorma::mcap 1.0

namespace eval ::sorma::mcap {
    variable Magic "\x89MCAP0\r\n"
    variable Code {header 1 footer 2 schema 3 channel 4 message 5 end 15}
    variable Channels {}    ;# dict: file -> dict: topic -> number of its channel
    variable Count {}       ;# dict: file -> messages so far
}

# ::sorma::mcap::begin FILE -- the channel to a new file, for the other commands.
proc ::sorma::mcap::begin file {
    variable Magic
    variable Channels
    variable Count
    set out [open $file w 0600]
    fconfigure $out -translation binary
    puts -nonewline $out $Magic
    Put $out header [Text {}][Text sorma]
    Put $out schema [binary format s 1][Text sorma.Record][Text jsonschema][Text {{"type":"object"}}]
    dict set Channels $out {}
    dict set Count $out 0
    return $out
}

# ::sorma::mcap::add OUT RECORD -- append a record, as `records` of class recorder gives it.
proc ::sorma::mcap::add {out record} {
    variable Channels
    variable Count
    set topic [dict get $record source]/[dict get $record object]
    if {![dict exists $Channels $out $topic]} {
        set number [expr {[dict size [dict get $Channels $out]] + 1}]
        if {$number > 65535} {
            return -code error "MCAP has room for 65535 objects; choose some with -name"
        }
        dict set Channels $out $topic $number
        Put $out channel [binary format ss $number 1][Text $topic][Text json][binary format i 0]
    }
    scan [string map {. {}} [dict get $record time]] %lld time
    set time [expr {max(0, $time)}]
    set json [join [lmap {key value} [dict remove $record time] {
        string cat [::sorma::json::text $key] : [if {$key in {number code span}} {set value} else {::sorma::json::text $value}]
    }] ,]
    Put $out message [binary format siww [dict get $Channels $out $topic] [dict get $Count $out] $time $time]\{$json\}
    dict incr Count $out
}

# ::sorma::mcap::finish OUT -- complete the file, and close it.
proc ::sorma::mcap::finish out {
    variable Magic
    variable Channels
    variable Count
    Put $out end [binary format i 0]
    Put $out footer [binary format wwi 0 0 0]
    puts -nonewline $out $Magic
    dict unset Channels $out
    dict unset Count $out
    close $out
}

proc ::sorma::mcap::Put {out kind content} {
    variable Code
    puts -nonewline $out [binary format cw [dict get $Code $kind] [string length $content]]$content
}
proc ::sorma::mcap::Text text {
    set bytes [encoding convertto utf-8 $text]
    return [binary format i [string length $bytes]]$bytes
}
