# reply.tcl -- replies, errors and plain values as people like to read them, or as JSON for programs.
#
# What is shown may come from anywhere: nothing in it moves a cursor, rings a bell or turns the writing round. Nothing is asked
# for: all that is shown are arguments.

package require sorma::json
package require sorma::message
package require sorma::text
package require sorma::trail
package provide sorma::reply 1.0

namespace eval ::sorma::reply {
    # Beside those of text.tcl.
    variable Options {
        -as      {{choice reply dict plain}}
        -error   any
        -trail   any
        -type    any
        -writes  any
    }
    variable Keys {text floats ints any code trail}
}

# ::sorma::show --
#       Readable text of a command's result: a reply in either dialect (flat list RET..., dict), a plain value, or an error.
# Arguments:
#       value   the result; with -error the message
#       args    -colour bool    escape sequences for colours
#               -width n        columns (0: no limit)
#               -json bool      strict JSON instead: numbers as numbers, bytes as base64, an error as {"error": ...}
#               -writes list    what EXEC of its class writes, as the class's table says: for units and names
#               -error options  value is an error: the dict of options that catch gave
#               -trail list     as sorma::trail gives it; default for an error: sorma::trail
#               -as kind        reply, dict or plain, when it is known; default: as it looks
#               -type type      a plain value of an option of that type, for JSON; default: a number when it looks like one
#               -whole bool     abridge nothing
#               Defaults of -colour, -width, -whole and -json are those of showDefaults.
# Results:
#       Text without a newline at its end; empty for a plain empty value.
proc ::sorma::show {value args} {
    set settings [::sorma::text::styled $reply::Options $args]
    dict with settings {}
    if {${-error} ne {}} {
        set code [if {[dict exists ${-error} -errorcode]} {dict get ${-error} -errorcode}]
        if {${-trail} eq {}} {
            dict set settings -trail [reply::TrailOf $value [trail]]
        }
        if {${-json}} {
            return [::sorma::json::error $value $code [dict get $settings -trail]]
        }
        return [reply::Error $value $code $settings]
    }
    if {${-as} eq {}} {
        set -as [reply::Kind $value]
    }
    switch -- ${-as} {
        reply { set reply [reply::FromList $value] }
        dict { set reply $value }
        default {
            if {!${-json}} {
                return [reply::Plain $value $settings]
            }
            return [if {${-type} ne {}} {::sorma::json::typed ${-type} $value} else {::sorma::json::value $value}]
        }
    }
    return [if {${-json}} {::sorma::json::reply $reply} else {reply::Reply $reply $settings}]
}

# ::sorma::showDefaults --
#       Set defaults of -colour, -width, -whole and -json for all that is shown. Returns them all.
proc ::sorma::showDefaults args {
    return [::sorma::text::style {*}$args]
}

# The trail of the last request, if this error is one of its messages; else it is an older request's.
proc ::sorma::reply::TrailOf {message trail} {
    foreach entry $trail {
        if {[dict exists $entry text] && [dict get $entry text] eq $message} {
            return $trail
        }
    }
    return {}
}

# ---- what is it? ----

proc ::sorma::reply::Kind value {
    variable Keys
    if {[string match "RET *" $value] && ![catch {FromList $value}]} {
        return reply
    }
    if {[string length $value] < 100000000 && ![catch {dict exists $value code} has] && $has
        && [string is wideinteger -strict [dict get $value code]]} {
        foreach key [dict keys $value] {
            if {$key ni $Keys} {
                return plain
            }
        }
        return dict
    }
    return plain
}

# A reply as a list, as a dict; an error when it is none.
proc ::sorma::reply::FromList list {
    set reply [::sorma::message::fromList $list]
    if {[dict exists $reply trail]} {
        dict set reply trail [::sorma::trail::fromWord [dict get $reply trail]]
    }
    return $reply
}

# ---- replies ----

proc ::sorma::reply::Reply {reply settings} {
    set parts {}
    set out {}
    if {[dict exists $reply text]} {
        lappend out [::sorma::text::paragraphs [dict get $reply text] $settings]
    }
    set signature [dict get $settings -writes]
    foreach field {floats ints} {
        if {[dict exists $reply $field]} {
            set parts [concat $parts [Portions $field [dict get $reply $field] $signature]]
        }
    }
    if {[dict exists $reply any]} {
        lappend parts any {} {} [Bytes [dict get $reply any] $settings]
    }
    # Beside a text, and among each other, they need their names.
    set wide 0
    foreach {label unit help values} $parts {
        set wide [expr {max($wide, [string length $label])}]
    }
    foreach {label unit help values} $parts {
        if {$label ne "any"} {
            set values [numbers $values $settings]
        }
        if {$unit ne {}} {
            append values " [::sorma::text::clean $unit]"
        }
        if {$help ne {}} {
            append values [::sorma::text::paint "  ([::sorma::text::clean $help])" dim $settings]
        }
        set head [format %-*s $wide $label]
        lappend out [::sorma::text::hang [::sorma::text::paint $head name $settings] $wide $values $settings 0]
    }
    set code [dict get $reply code]
    if {$code != 0 && !($code == 1 && [dict exists $reply trail])} {
        lappend out [::sorma::text::paint "code $code" [expr {$code < 0 ? "error" : "warning"}] $settings]
    }
    if {[dict exists $reply trail]} {
        lappend out [Folded [dict get $reply trail] $settings]
    }
    if {[llength $out] == 0} {
        lappend out [::sorma::text::paint ok good $settings]
    }
    return [join $out \n]
}

# Numbers of a reply, taken apart as the signature says: label unit help values ...
proc ::sorma::reply::Portions {field values signature} {
    set parts [lsearch -all -inline -index 0 -exact $signature $field]
    set out {}
    set n [llength $values]
    set at 0
    for {set k 0} {$k < [llength $parts] && $at < $n} {incr k} {
        lassign [lindex $parts $k] - low high unit help
        set count [expr {$k + 1 < [llength $parts] && $low eq $high ? $low : $n - $at}]
        lappend out $field $unit $help [lrange $values $at [expr {$at + $count - 1}]]
        incr at $count
    }
    if {$at < $n} {
        lappend out $field {} {} [lrange $values $at end]
    }
    return $out
}

# Numbers in a line; of many the first and the last: 1 2 3 ... 10 (1000 values)
proc ::sorma::reply::numbers {values settings} {
    set n [llength $values]
    set most 12
    if {![dict get $settings -whole]} {
        set values [::sorma::text::digits $values]
    }
    if {[dict get $settings -whole] || $n <= $most} {
        return [::sorma::text::clean [join $values]]
    }
    set width [dict get $settings -width]
    set tail " ... [lindex $values end] ($n values)"
    set room [expr {($width > 0 ? min($width, 80) : 80) - 8 - [string length $tail]}]
    set line {}
    foreach value [lrange $values 0 $most] {
        if {[string length $line] + 1 + [string length $value] > $room && $line ne {}} {
            break
        }
        append line [expr {$line eq {} ? {} : " "}] $value
    }
    return [::sorma::text::clean $line$tail]
}

# Bytes: how many, and the first of them.
proc ::sorma::reply::Bytes {bytes settings} {
    set n [string length $bytes]
    set shown [expr {[dict get $settings -whole] ? $n : min($n, 12)}]
    set first [string range $bytes 0 [expr {$shown - 1}]]
    set hex [regexp -all -inline .. [binary encode hex $first]]
    regsub -all {[^\x20-\x7e]} $first . readable
    return "$n byte[expr {$n == 1 ? {} : "s"}]: [join $hex][expr {$shown < $n ? " ..." : {}}]  $readable"
}

# The trail of a reply in one line: the worst message, and how many there are.
proc ::sorma::reply::Folded {trail settings} {
    set severities [lmap entry $trail {dict get $entry severity}]
    set texts [lmap entry $trail {dict get $entry text}]
    foreach worst {error warning verbose} {
        set index [lsearch -exact $severities $worst]
        if {$index >= 0} break
    }
    if {$index < 0} {
        set index 0
        set worst verbose
    }
    set more [expr {[llength $texts] - 1}]
    set text "$worst: [lindex $texts $index]"
    set note [expr {$more > 0 ? "  (+$more, see trail)" : {}}]
    set text [::sorma::text::clean $text]
    set width [dict get $settings -width]
    if {$width > 0 && $width < 40} {
        return [::sorma::text::paint [join [::sorma::text::wrap $text$note $width 2] \n] $worst $settings]
    }
    if {$width > 0} {
        set text [::sorma::text::cut $text [expr {$width - [string length $note]}]]
    }
    return [::sorma::text::paint $text $worst $settings][::sorma::text::paint $note dim $settings]
}

proc ::sorma::reply::Error {message code settings} {
    set out [list [::sorma::text::hang [::sorma::text::paint error: error $settings] 6 $message $settings]]
    set trail [dict get $settings -trail]
    if {[lindex $code 0] eq "SORMA" || [llength $trail] > 0} {
        lappend out [::sorma::text::block "  " [join $code] dim $settings]
    } elseif {[dict exists $settings -error -errorinfo] && $code in {{} NONE}} {
        # A script of the user: the place helps.
        set lines [lrange [split [dict get $settings -error -errorinfo] \n] 1 end]
        foreach line [lrange $lines [llength [split $message \n]]-1 5] {
            lappend out [::sorma::text::block "  " [string trim $line] dim $settings]
        }
    }
    set froms {}
    foreach entry $trail {
        if {![catch {::sorma::trail::from $entry} from]} {
            dict set froms $from 1
        }
    }
    set n [llength [lsearch -all -not -exact [lmap entry $trail {::sorma::trail::isStack $entry}] 1]]
    if {$n > 1 || $n == 1 && [dict get [lindex $trail 0] daemon] ne {}} {
        set text "$n message[expr {$n == 1 ? {} : "s"}] from [join [lsearch -all -inline -not -exact [dict keys $froms] {}] {, }], see trail"
        lappend out [::sorma::text::block "  " $text dim $settings]
    }
    return [join $out \n]
}

# ---- plain values ----

proc ::sorma::reply::Plain {value settings} {
    if {![string match *\n* $value] && ![catch {llength $value} n] && $n > 1} {
        if {[string index $value 0] in [list "\{" "\""] || $n > 3} {
            set rows [Rows $value]
            if {$rows ne {}} {
                return [::sorma::text::table [lindex $rows 0] [lrange $rows 1 end] {*}[dict filter $settings key -colour -width]]
            }
        }
        if {$n > 12 && ![dict get $settings -whole] && [AllNumbers $value]} {
            return [join [::sorma::text::wrap [numbers $value $settings] [dict get $settings -width] 0] \n]
        }
    }
    return [::sorma::text::paragraphs $value $settings]
}

proc ::sorma::reply::AllNumbers list {
    foreach value $list {
        if {![string is double -strict $value]} {
            return 0
        }
    }
    return 1
}

# A list of dicts that have the same keys, or of lists of the same length (2 to 9), as rows under their headings. Else
# empty.
proc ::sorma::reply::Rows list {
    if {[llength $list] < 1 || [catch {llength [lindex $list 0]} n] || $n < 2} {
        return {}
    }
    foreach row $list {
        if {[catch {llength $row} m] || $m != $n} {
            return {}
        }
    }
    if {$n % 2 == 0 && [llength [dict keys [lindex $list 0]]] * 2 == $n && ([llength $list] > 1 || $n > 4)} {
        set keys [dict keys [lindex $list 0]]
        set same 1
        foreach row $list {
            set same [expr {$same && [dict keys $row] eq $keys}]
        }
        if {$same && [lsearch -regexp -not $keys {^[-\w]+$}] < 0} {
            return [list $keys {*}[lmap row $list {dict values $row}]]
        }
    }
    if {[llength $list] < 2 || $n > 9} {
        return {}
    }
    # The columns of the result of configure have names.
    if {$n == 7 && [string match -* [lindex $list 0 0]] && [lindex $list 0 1] in {flag int double string enum vector service}} {
        return [list {option type unit range default value help} {*}$list]
    }
    return [list {} {*}$list]
}
