# json.tcl -- strict JSON of replies, errors, trails and values. It knows no bus.
#
# Tcllib's json::write is not used: its layout is a setting of the whole interpreter, which is the user's, and it does not keep to ASCII.

package provide sorma::json 1.0

namespace eval ::sorma::json {}

# An object of keys and JSON, one after the other; an array of a list of JSON; one of texts.
proc ::sorma::json::object members {
    return "\{[join [lmap {key json} $members {string cat [text $key] : $json}] ,]\}"
}
proc ::sorma::json::array items {
    return "\[[join $items ,]\]"
}
proc ::sorma::json::texts texts {
    return [array [lmap text $texts {text $text}]]
}

proc ::sorma::json::reply reply {
    set out {}
    pieces $reply {append out}
    return $out
}
# ::sorma::json::pieces REPLY COMMAND -- the same, piece by piece: COMMAND is called with each, where pieces is called. A piece takes some
# milliseconds at most, so that who sends a large reply can do other things between two of them.
proc ::sorma::json::pieces {reply command} {
    uplevel 1 [list {*}$command "\{\"code\":[number [dict get $reply code]]"]
    foreach {field open close size length slice piece} {
        text \" \" 10000 {string length} {string range} Inner
        floats \[ \] 5000 llength lrange Numbers
        ints \[ \] 5000 llength lrange Numbers
        any \" \" 300000 {string length} {string range} {binary encode base64}
    } {
        if {![dict exists $reply $field]} continue
        set value [dict get $reply $field]
        uplevel 1 [list {*}$command ",\"$field\":$open"]
        for {set at 0} {$at < [{*}$length $value]} {incr at $size} {
            uplevel 1 [list {*}$command [expr {$at > 0 && $open eq "\[" ? "," : {}}][{*}$piece [{*}$slice $value $at [expr {$at + $size - 1}]]]]
        }
        uplevel 1 [list {*}$command $close]
    }
    uplevel 1 [list {*}$command [if {[dict exists $reply trail]} {string cat ,\"trail\": [trail [dict get $reply trail]]}]\}]
}
proc ::sorma::json::Numbers items {
    return [join [lmap x $items {number $x}] ,]
}

proc ::sorma::json::error {message code trail} {
    set words [if {[catch {llength $code}]} {list $code} else {set code}]
    set members [list message [text $message] code [texts $words]]
    if {[llength $trail] > 0} {
        lappend members trail [trail $trail]
    }
    return [object [list error [object $members]]]
}

proc ::sorma::json::trail trail {
    return [array [lmap entry $trail {
        object [concat {*}[lmap {key value} $entry {
            list $key [switch -- $key {
                code { texts $value }
                line - time { number $value }
                default { text $value }
            }]
        }]]
    }]]
}

# A plain value: a number is a number, all else a string.
proc ::sorma::json::value value {
    return [if {[regexp {^-?(0|[1-9]\d*)(\.\d+)?([eE][-+]?\d+)?$} $value]} {set value} else {text $value}]
}

# A value of an option, of the TYPE that the class's table gives.
proc ::sorma::json::typed {type value} {
    switch -- $type {
        flag - int - double { return [number $value] }
        vector { return [array [lmap x $value {number $x}]] }
        default { return [text $value] }
    }
}

# Numbers that JSON does not have (NaN, infinity) become strings.
proc ::sorma::json::number value {
    if {[regexp {^-?(0|[1-9]\d*)(\.\d+)?([eE][-+]?\d+)?$} $value]} {
        return $value
    }
    if {[string is wideinteger -strict $value]} {
        return [expr {wide($value)}]
    }
    if {[string is double -strict $value] && ![catch {expr {double($value)}} number]
        && [regexp {^-?(0|[1-9]\d*)(\.\d+)?([eE][-+]?\d+)?$} $number]} {
        return $number
    }
    return [text $value]
}

# ASCII only, so that no encoding on the way can spoil it. Inner: what stands between the quotes.
proc ::sorma::json::text text {
    return \"[Inner $text]\"
}
proc ::sorma::json::Inner text {
    set out [string map {\\ \\\\ \" \\\" \n \\n \r \\r \t \\t \b \\b \f \\f} $text]
    if {![regexp {[^\x20-\x7e]} $out]} {
        return $out
    }
    set text $out
    set out {}
    set at 0
    foreach range [regexp -all -inline -indices {[^\x20-\x7e]} $text] {
        lassign $range i
        scan [string index $text $i] %c code
        append out [string range $text $at $i-1]
        if {$code > 0xffff} {
            incr code -0x10000
            append out [format "\\u%04x\\u%04x" [expr {0xd800 + ($code >> 10)}] [expr {0xdc00 + ($code & 0x3ff)}]]
        } else {
            append out [format "\\u%04x" $code]
        }
        set at [expr {$i + 1}]
    }
    return $out[string range $text $at end]
}
