# json.tcl -- reads JSON as strictly as RFC 8259 demands, for tests of what programs print.

# json text: the value. An object is a dict, an array a list, null the empty string; an error says where it is no JSON.
proc json text {
    set at 0
    set value [json::Value $text at]
    json::Token $text at {}
    if {$at != [string length $text]} {
        json::Wrong $text $at
    }
    return $value
}

namespace eval json {}

proc json::Wrong {text at} {
    return -code error "no JSON at character $at: \"[string range $text $at [expr {$at + 20}]]\""
}

# Skip white space, then take what the pattern matches there.
proc json::Token {text atVar pattern} {
    upvar 1 $atVar at
    regexp -start $at -indices {\A[ \t\r\n]*} $text space
    set at [expr {[lindex $space 1] + 1}]
    if {![regexp -start $at -indices "\\A(?:$pattern)" $text found]} {
        Wrong $text $at
    }
    set token [string range $text {*}$found]
    incr at [string length $token]
    return $token
}

proc json::Value {text atVar} {
    upvar 1 $atVar at
    set string {"(?:[^"\\\u0000-\u001f]|\\["\\/bfnrt]|\\u[0-9a-fA-F]{4})*"}
    set token [Token $text at "$string|\[\[\{\]|-?(?:0|\[1-9]\[0-9]*)(?:\\.\[0-9]+)?(?:\[eE]\[-+]?\[0-9]+)?|true|false|null"]
    switch -glob -- $token {
        \"* { return [subst -nocommands -novariables [string range $token 1 end-1]] }
        \{ - \\\[ {
            set end [expr {$token eq "\{" ? "\}" : "\]"}]
            set values {}
            for {set separator [Token $text at "\\$end|"]} {$separator ne $end} {set separator [Token $text at "\\$end|,"]} {
                if {$separator eq {} && [llength $values] > 0} {
                    Wrong $text $at
                }
                if {$token eq "\{"} {
                    lappend values [string range [Token $text at $string] 1 end-1]
                    Token $text at :
                }
                lappend values [Value $text at]
            }
            return $values
        }
        null { return {} }
        default { return $token }
    }
}
