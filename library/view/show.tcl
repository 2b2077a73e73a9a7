# show.tcl -- replies, errors and trails as people like to read them, or as JSON for programs.
#
# What is shown may come from anywhere: nothing in it moves a cursor, rings a bell or turns the writing round. Widths are
# those of a terminal: wide characters take two columns, combining ones none.

package require sorma::table
package require sorma::text
package require sorma::json
package provide sorma::show 1.0
namespace eval ::sorma::show {
    variable Settings           ;# defaults
    if {![info exists Settings]} {
        set Settings {-as {} -colour 0 -width 80 -json 0 -so {} -error {} -trail {} -whole 0}
    }
    variable Keys {text floats ints any code trail}
}

# ::sorma::show --
#       Readable text of what a command has returned: of a reply in either dialect (flat list RET..., dict), or of a plain
#       value; or of an error.
# Arguments:
#       value   the result; with -error the message
#       args    -colour bool    escape sequences for colours (default 0)
#               -width n        columns (default 80; 0: no limit)
#               -json bool      strict JSON instead: numbers as numbers, bytes as base64, an error as {"error": ...}
#               -so name        whose reply it is: units and names come from its class's signature
#               -error options  value is an error: the dict of options that catch gave
#               -trail list     as sorma::trail gives it; default for an error: sorma::trail
#               -as kind        reply, dict or plain, when it is known; default: as it looks
#               -whole bool     abridge nothing
# Results:
#       Text without a newline at its end; empty for a plain empty value.
proc ::sorma::show {value args} {
    set settings [show::Parse $args]
    dict with settings {}
    if {${-error} ne {}} {
        set code [if {[dict exists ${-error} -errorcode]} {dict get ${-error} -errorcode}]
        if {${-trail} eq {} && [string match "SORMA *" $code]} {
            dict set settings -trail [trail]
        }
        if {${-json}} {
            return [::sorma::json::error $value $code [dict get $settings -trail]]
        }
        return [show::Error $value $code $settings]
    }
    if {${-as} eq {}} {
        set -as [show::Kind $value]
    }
    switch -- ${-as} {
        reply { set reply [show::FromList $value] }
        dict { set reply $value }
        default {
            return [if {${-json}} {::sorma::json::value $value} else {show::Plain $value $settings}]
        }
    }
    return [if {${-json}} {::sorma::json::reply $reply} else {show::Reply $reply $settings}]
}

# ::sorma::showTrail --
#       A trail, whole: each message with its code, where it came from and when, and the request that shows it again. A stack
#       trace of Tcl (a message SERVICE STACK) is left to showStack.
# Arguments:
#       args    ?trail? -colour bool -width n -json bool; default: the trail of the last request, sorma::trail
proc ::sorma::showTrail args {
    if {[llength $args] % 2 == 1} {
        set args [lassign $args trail]
    } else {
        set trail [trail]
    }
    set settings [show::Parse $args]
    if {[dict get $settings -json]} {
        return [::sorma::json::trail $trail]
    }
    if {[llength $trail] == 0} {
        return [::sorma::text::paint "the last request had no messages" dim $settings]
    }
    set out {}
    set number 0
    foreach entry $trail {
        incr number
        if {[show::isStack $entry]} continue
        set entry [dict merge {severity error code {} text {} so {} daemon {} file {} line {} time 0 request {}} $entry]
        dict with entry {}
        lappend out [::sorma::text::hang [::sorma::text::paint [format %-7s $severity] $severity $settings] 7 $text $settings]
        set from $so
        if {$daemon ne {}} {
            append from @$daemon
        }
        set facts [list [join $code]]
        if {$from ne {}} {
            lappend facts "from $from"
        }
        if {$file ne {}} {
            lappend facts $file:$line
        }
        if {[string is wideinteger -strict $time] && $time > 0} {
            lappend facts [clock format [expr {$time / 1000000}] -format %H:%M:%S].[format %03d [expr {$time / 1000 % 1000}]]
        }
        lappend out [::sorma::text::block "        " [join $facts ", "] dim $settings]
        if {$request ne {}} {
            lappend out [::sorma::text::block "        " "again: $request" dim $settings]
        }
        if {[show::isStack [lindex $trail $number]]} {
            lappend out [::sorma::text::block "        " "stack: trail $number -stack" dim $settings]
        }
    }
    return [join $out \n]
}

# ::sorma::showStack --
#       The stack trace of Tcl that came with a message of a trail.
# Arguments:
#       trail   as sorma::trail gives it
#       number  of the message, counted from 1
#       args    as of showTrail
# Results:
#       Its text. Error TRAIL STACK: there is none.
proc ::sorma::showStack {trail number args} {
    set settings [show::Parse $args]
    foreach at [list $number [expr {$number - 1}]] {        ;# that of the message, or itself one
        set entry [lindex $trail $at]
        if {![show::isStack $entry]} continue
        set text [dict get $entry text]
        set so [dict get $entry so]
        if {[string match "$so: *" $text]} {
            set text [string range $text [string length $so]+2 end]
        }
        return [::sorma::text::block {} $text {} $settings]
    }
    return -code error -errorcode {SORMA TRAIL STACK} \
        "message $number of the trail has no stack trace: only plain Tcl errors of services written in Tcl have one"
}

proc ::sorma::show::isStack entry {
    return [expr {[dict exists $entry code] && [lrange [dict get $entry code] 1 2] eq {SERVICE STACK}}]
}

# ::sorma::showDefaults --
#       Set defaults of -colour, -width ... for all that is shown, also by sorma::inspect. Returns them all.
proc ::sorma::showDefaults args {
    set settings [show::Parse $args]
    set show::Settings $settings
    return $settings
}

proc ::sorma::show::Parse words {
    variable Settings
    set settings $Settings
    foreach {option value} $words {
        if {![dict exists $Settings $option]} {
            return -code error -level 2 -errorcode {SORMA REQUEST SYNTAX} \
                "bad option \"$option\": must be [join [lsort [dict keys $Settings]] {, }]"
        }
        dict set settings $option $value
    }
    if {[llength $words] % 2 == 1} {
        return -code error -level 2 -errorcode {SORMA REQUEST SYNTAX} "[lindex $words end] needs a value"
    }
    foreach option {-colour -json -whole} {
        dict set settings $option [expr {bool([dict get $settings $option])}]
    }
    if {[dict get $settings -width] > 0 && [dict get $settings -width] < 10} {
        dict set settings -width 10
    }
    return $settings
}

# ---- what is it? ----

proc ::sorma::show::Kind value {
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

# RET code TMSG ... as a dict; an error when it is none.
proc ::sorma::show::FromList list {
    if {[lindex $list 0] ne "RET" || ![string is wideinteger -strict [lindex $list 1]]} {
        return -code error "no reply"
    }
    set reply [dict create code [lindex $list 1]]
    set n [llength $list]
    for {set i 2} {$i < $n} {incr i 2} {
        set value [lindex $list $i+1]
        switch -- [lindex $list $i] {
            TMSG { dict set reply text $value }
            TDBX { dict set reply trail [TrailFromWord $value] }
            AMSG { dict set reply any [binary decode base64 $value] }
            FMSG - IMSG {
                if {![string is integer -strict $value] || $value < 0 || $i + 2 + $value > $n} {
                    return -code error "bad count"
                }
                dict set reply [dict get {FMSG floats IMSG ints} [lindex $list $i]] [lrange $list $i+2 [expr {$i + 1 + $value}]]
                incr i $value
            }
            default { return -code error "no reply" }
        }
    }
    return $reply
}

# The word after TDBX as a list of dicts: severity {SYMBOL detail...} text so daemon file line time request, for each
# message; before them perhaps: dropped N.
proc ::sorma::show::TrailFromWord word {
    if {[catch {llength $word} n]} {
        return [list [dict create severity error text $word]]
    }
    set out {}
    if {[lindex $word 0] eq "dropped"} {
        lappend out [dict create severity verbose code {SORMA TRAIL DROPPED} text "[lindex $word 1] older messages were dropped"]
        set word [lrange $word 2 end]
    }
    foreach {severity code text so daemon file line time request} $word {
        if {[catch {concat SORMA [split [lindex $code 0]] [lrange $code 1 end]} code]} {
            set code SORMA
        }
        set entry {}
        foreach key {severity code text so daemon file line time} {
            dict set entry $key [set $key]
        }
        if {$request ne {}} {
            dict set entry request $request
        }
        lappend out $entry
    }
    return $out
}

# ---- replies ----

proc ::sorma::show::Reply {reply settings} {
    set parts {}
    set out {}
    if {[dict exists $reply text]} {
        lappend out [::sorma::text::paragraphs [dict get $reply text] $settings]
    }
    set signature [Signature [dict get $settings -so]]
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

# What EXEC of an object writes: list of {field low high unit help}.
proc ::sorma::show::Signature so {
    if {$so eq {}} {
        return {}
    }
    set table [::sorma::Aside [list ::sorma::table guess $so]]
    return [if {$table ne {}} {dict get $table writes}]
}

# Numbers of a reply, taken apart as the signature says: label unit help values ...
proc ::sorma::show::Portions {field values signature} {
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
proc ::sorma::show::numbers {values settings} {
    set n [llength $values]
    set most 12
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
proc ::sorma::show::Bytes {bytes settings} {
    set n [string length $bytes]
    set shown [expr {[dict get $settings -whole] ? $n : min($n, 12)}]
    set first [string range $bytes 0 [expr {$shown - 1}]]
    set hex [regexp -all -inline .. [binary encode hex $first]]
    regsub -all {[^\x20-\x7e]} $first . readable
    return "$n byte[expr {$n == 1 ? {} : "s"}]: [join $hex][expr {$shown < $n ? " ..." : {}}]  $readable"
}

# The trail of a reply in one line: the worst message, and how many there are.
proc ::sorma::show::Folded {trail settings} {
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

proc ::sorma::show::Error {message code settings} {
    set out [list [::sorma::text::hang [::sorma::text::paint error: error $settings] 6 $message $settings]]
    if {[lindex $code 0] eq "SORMA"} {
        lappend out [::sorma::text::block "  " [join $code] dim $settings]
    } elseif {[dict exists $settings -error -errorinfo] && $code in {{} NONE}} {
        # A script of the user: the place helps.
        set lines [lrange [split [dict get $settings -error -errorinfo] \n] 1 end]
        foreach line [lrange $lines [llength [split $message \n]]-1 5] {
            lappend out [::sorma::text::block "  " [string trim $line] dim $settings]
        }
    }
    set trail [dict get $settings -trail]
    set froms {}
    foreach entry $trail {
        if {![catch {dict get $entry so} so]} {
            if {[dict get $entry daemon] ne {}} {
                append so @[dict get $entry daemon]
            }
            dict set froms $so 1
        }
    }
    set n [llength [lsearch -all -not -exact [lmap entry $trail {isStack $entry}] 1]]
    if {$n > 1 || $n == 1 && [dict get [lindex $trail 0] daemon] ne {}} {
        set text "$n message[expr {$n == 1 ? {} : "s"}] from [join [lsearch -all -inline -not -exact [dict keys $froms] {}] {, }], see trail"
        lappend out [::sorma::text::block "  " $text dim $settings]
    }
    return [join $out \n]
}

# ---- plain values ----

proc ::sorma::show::Plain {value settings} {
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

proc ::sorma::show::AllNumbers list {
    foreach value $list {
        if {![string is double -strict $value]} {
            return 0
        }
    }
    return 1
}

# A list of dicts that have the same keys, or of lists of the same length (2 to 9), as rows under their headings. Else
# empty.
proc ::sorma::show::Rows list {
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
    # What configure returns, has names for its columns.
    if {$n == 7 && [string match -* [lindex $list 0 0]] && [lindex $list 0 1] in {flag int double string enum vector service}} {
        return [list {option type unit range default value help} {*}$list]
    }
    return [list {} {*}$list]
}
