# show.tcl -- replies, errors and trails as people like to read them, or as JSON for programs.
#
# What is shown may come from anywhere: nothing in it moves a cursor, rings a bell or turns the writing round. Widths are
# those of a terminal: wide characters take two columns, combining ones none.

package require sorma::discover
package provide sorma::show 1.0
namespace eval ::sorma::show {
    variable Settings           ;# defaults
    if {![info exists Settings]} {
        set Settings {-as {} -colour 0 -width 80 -json 0 -so {} -error {} -trail {} -whole 0}
    }
    variable Colours {error 31 warning 33 verbose 2 dim 2 good 32 name 36 strong 1}
    variable Keys {text floats ints any code trail}
    variable MostLines 1000         ;# of a text
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
            return [show::JsonError $value $code [dict get $settings -trail]]
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
            return [if {${-json}} {show::JsonValue $value} else {show::Plain $value $settings}]
        }
    }
    return [if {${-json}} {show::JsonReply $reply} else {show::Reply $reply $settings}]
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
        return [show::JsonTrail $trail]
    }
    if {[llength $trail] == 0} {
        return [show::Paint "the last request had no messages" dim $settings]
    }
    set out {}
    set number 0
    foreach entry $trail {
        incr number
        if {[show::IsStack $entry]} continue
        set entry [dict merge {severity error code {} text {} so {} daemon {} file {} line {} time 0 request {}} $entry]
        dict with entry {}
        lappend out [show::Hang [show::Paint [format %-7s $severity] $severity $settings] 7 $text $settings]
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
        lappend out [show::Block "        " [join $facts ", "] dim $settings]
        if {$request ne {}} {
            lappend out [show::Block "        " "again: $request" dim $settings]
        }
        if {[show::IsStack [lindex $trail $number]]} {
            lappend out [show::Block "        " "stack: trail $number -stack" dim $settings]
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
        if {![show::IsStack $entry]} continue
        set text [dict get $entry text]
        set so [dict get $entry so]
        if {[string match "$so: *" $text]} {
            set text [string range $text [string length $so]+2 end]
        }
        return [show::Block {} $text {} $settings]
    }
    return -code error -errorcode {SORMA TRAIL STACK} \
        "message $number of the trail has no stack trace: only plain Tcl errors of services written in Tcl have one"
}

proc ::sorma::show::IsStack entry {
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
        lappend out [Text [dict get $reply text] $settings]
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
            set values [Numbers $values $settings]
        }
        if {$unit ne {}} {
            append values " [Clean $unit]"
        }
        if {$help ne {}} {
            append values [Paint "  ([Clean $help])" dim $settings]
        }
        set head [format %-*s $wide $label]
        lappend out [Hang [Paint $head name $settings] $wide $values $settings 0]
    }
    set code [dict get $reply code]
    if {$code != 0 && !($code == 1 && [dict exists $reply trail])} {
        lappend out [Paint "code $code" [expr {$code < 0 ? "error" : "warning"}] $settings]
    }
    if {[dict exists $reply trail]} {
        lappend out [Folded [dict get $reply trail] $settings]
    }
    if {[llength $out] == 0} {
        lappend out [Paint ok good $settings]
    }
    return [join $out \n]
}

# What EXEC of an object writes: list of {field low high unit help}.
proc ::sorma::show::Signature so {
    if {$so eq {}} {
        return {}
    }
    set table [::sorma::Aside [list ::sorma::discover::guess $so]]
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
proc ::sorma::show::Numbers {values settings} {
    set n [llength $values]
    set most 12
    if {[dict get $settings -whole] || $n <= $most} {
        return [Clean [join $values]]
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
    return [Clean $line$tail]
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
    set text [Clean $text]
    set width [dict get $settings -width]
    if {$width > 0 && $width < 40} {
        return [Paint [join [Wrap $text$note $width 2] \n] $worst $settings]
    }
    if {$width > 0} {
        set text [Cut $text [expr {$width - [string length $note]}]]
    }
    return [Paint $text $worst $settings][Paint $note dim $settings]
}

proc ::sorma::show::Error {message code settings} {
    set out [list [Hang [Paint error: error $settings] 6 $message $settings]]
    if {[lindex $code 0] eq "SORMA"} {
        lappend out [Block "  " [join $code] dim $settings]
    } elseif {[dict exists $settings -error -errorinfo] && $code in {{} NONE}} {
        # A script of the user: the place helps.
        set lines [lrange [split [dict get $settings -error -errorinfo] \n] 1 end]
        foreach line [lrange $lines [llength [split $message \n]]-1 5] {
            lappend out [Block "  " [string trim $line] dim $settings]
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
    set n [llength [lsearch -all -not -exact [lmap entry $trail {IsStack $entry}] 1]]
    if {$n > 1 || $n == 1 && [dict get [lindex $trail 0] daemon] ne {}} {
        set text "$n message[expr {$n == 1 ? {} : "s"}] from [join [lsearch -all -inline -not -exact [dict keys $froms] {}] {, }], see trail"
        lappend out [Block "  " $text dim $settings]
    }
    return [join $out \n]
}

# ---- plain values ----

proc ::sorma::show::Plain {value settings} {
    if {![string match *\n* $value] && ![catch {llength $value} n] && $n > 1} {
        if {[string index $value 0] in [list "\{" "\""] || $n > 3} {
            set rows [Rows $value]
            if {$rows ne {}} {
                return [Table [lindex $rows 0] [lrange $rows 1 end] {*}[dict filter $settings key -colour -width]]
            }
        }
        if {$n > 12 && ![dict get $settings -whole] && [AllNumbers $value]} {
            return [join [Wrap [Numbers $value $settings] [dict get $settings -width] 0] \n]
        }
    }
    return [Text $value $settings]
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

# ::sorma::show::Table --
#       Aligned columns; where they do not fit, a block of lines for each row.
# Arguments:
#       heads   names of the columns; empty: none
#       rows    list of lists
#       args    -colour bool, -width n; -right list: columns (counted from 0) to be aligned at their right; -wrap bool:
#               break what does not fit into the last column, rather than cut it
proc ::sorma::show::Table {heads rows args} {
    set settings [dict merge {-colour 0 -width 80 -right {} -wrap 0} $args]
    set width [dict get $settings -width]
    set columns [llength [expr {[llength $heads] > 0 ? $heads : [lindex $rows 0]}]]
    # Columns that are empty throughout say nothing.
    set kept {}
    for {set c 0} {$c < $columns} {incr c} {
        if {[lsearch -exact -not -index $c $rows {}] >= 0} {
            lappend kept $c
        }
    }
    if {[llength $kept] < $columns && [llength $kept] > 0} {
        set heads [lmap c [expr {[llength $heads] > 0 ? $kept : {}}] {lindex $heads $c}]
        set rows [lmap row $rows {lmap c $kept {lindex $row $c}}]
        dict set settings -right [lmap c [dict get $settings -right] {lsearch -exact $kept $c}]
        set columns [llength $kept]
    }
    set wides [lrepeat $columns 0]
    set cells {}
    foreach row [concat [list $heads] $rows] {
        if {[llength $row] == 0} continue
        set line {}
        for {set c 0} {$c < $columns} {incr c} {
            set cell [string map {\n { } \t { }} [Clean [lindex $row $c]]]
            lappend line $cell
            lset wides $c [expr {max([lindex $wides $c], [Columns $cell])}]
        }
        lappend cells $line
    }
    # The last column takes what is left. When that is too little, the widest ones give way; when that is not enough,
    # rows become blocks.
    set least [expr {min(max(12, $width / 3), [lindex $wides end])}]
    set before [expr {[::tcl::mathop::+ {*}[lrange $wides 0 end-1]] + 2 * ($columns - 1)}]
    while {$width > 0 && $before + $least > $width} {
        set widest [lindex [lsort -integer -indices -decreasing [lrange $wides 0 end-1]] 0]
        if {[lindex $wides $widest] <= 10 || $widest == 0} {
            return [Blocks $heads $rows $settings]
        }
        lset wides $widest [expr {[lindex $wides $widest] - 1}]
        incr before -1
    }
    set out {}
    set isHead [expr {[llength $heads] > 0}]
    foreach line $cells {
        set text {}
        for {set c 0} {$c < $columns - 1} {incr c} {
            set cell [Cut [lindex $line $c] [lindex $wides $c]]
            set pad [string repeat { } [expr {[lindex $wides $c] - [Columns $cell]}]]
            append text [if {$c in [dict get $settings -right]} {string cat "$pad$cell"} else {string cat "$cell$pad"}] "  "
        }
        set last [lindex $line end]
        if {$columns - 1 in [dict get $settings -right]} {
            set last [string repeat { } [expr {[lindex $wides end] - [Columns $last]}]]$last
        }
        if {$width > 0 && [dict get $settings -wrap]} {
            set last [join [Wrap $last [expr {$width - $before}] 0] \n[string repeat { } $before]]
        } elseif {$width > 0} {
            set last [Cut $last [expr {$width - $before}]]
        }
        set text [string trimright "$text$last"]
        lappend out [if {$isHead} {Paint $text strong $settings} else {set text}]
        set isHead 0
    }
    return [join $out \n]
}

proc ::sorma::show::Blocks {heads rows settings} {
    set out {}
    foreach row $rows {
        lappend out [Cut [Clean [lindex $row 0]] [dict get $settings -width]]
        for {set c 1} {$c < [llength $row]} {incr c} {
            if {[lindex $row $c] eq {}} continue
            set head [lindex $heads $c]
            lappend out [Block "  " [if {$head ne {}} {string cat "$head: "}][lindex $row $c] {} $settings]
        }
    }
    return [join $out \n]
}

# ---- text ----

# A text of any origin within the width: lines keep their indentation, also where they are broken.
proc ::sorma::show::Text {text settings} {
    variable MostLines
    set lines [split $text \n]
    set note {}
    if {[llength $lines] > $MostLines && ![dict get $settings -whole]} {
        set note "... ([expr {[llength $lines] - $MostLines}] more lines)"
        set lines [lrange $lines 0 $MostLines-1]
    }
    set out [lmap line $lines {join [Wrap [Clean $line] [dict get $settings -width] [Indentation $line]] \n}]
    if {$note ne {}} {
        lappend out [Paint $note dim $settings]
    }
    return [join $out \n]
}

# How far the lines below a broken one are moved in: to the second column of help texts, else as the line itself.
proc ::sorma::show::Indentation line {
    if {[regexp -indices {^ *\S.*?\S {2,}(?=\S)} $line range] && [lindex $range 1] < 40} {
        return [expr {[lindex $range 1] + 1}]
    }
    regexp {^ *} $line spaces
    return [string length $spaces]
}

# A painted head of some columns, and a text beside it. breaks: whether lines may be broken, else they are cut.
proc ::sorma::show::Hang {head columns text settings {clean 1}} {
    set width [dict get $settings -width]
    if {$clean} {
        set text [Clean $text]
    }
    set indent [expr {$columns + 1}]
    if {$width > 0 && $indent > $width / 2} {
        set indent 2
        set lines [Wrap $text [expr {$width - 2}] 0]
        return $head\n[join [lmap line $lines {string cat "  " $line}] \n]
    }
    set lines {}
    foreach line [split $text \n] {
        lappend lines {*}[Wrap $line [expr {$width > 0 ? $width - $indent : 0}] 0]
    }
    return "$head [join $lines "\n[string repeat { } $indent]"]"
}

# Lines moved in and painted.
proc ::sorma::show::Block {margin text colour settings} {
    set width [dict get $settings -width]
    if {$width > 0 && [string length $margin] > $width / 3} {
        set margin "  "
    }
    set lines {}
    foreach line [split [Clean $text] \n] {
        lappend lines {*}[Wrap $line [expr {$width > 0 ? $width - [string length $margin] : 0}] 0]
    }
    return [join [lmap line $lines {Paint $margin$line $colour $settings}] \n]
}

# Break a line at spaces, or where it has to be. Escape sequences of Paint count as nothing.
proc ::sorma::show::Wrap {line width indent} {
    if {$width <= 0 || [Columns $line] <= $width} {
        return [list $line]
    }
    if {$indent > $width / 2} {
        regexp {^ *} $line spaces
        set indent [expr {[string length $spaces] + 2 < $width / 2 ? [string length $spaces] + 2 : 0}]
    }
    set margin [string repeat { } $indent]
    set out {}
    while {[Columns $line] > $width} {
        set fits [Fitting $line $width]
        set space [string last { } $line $fits]
        if {$space <= $indent || [string trim [string range $line 0 $space]] eq {}} {
            set space [expr {max(1, $fits) - 1}]
        }
        lappend out [string trimright [string range $line 0 $space]]
        set line $margin[string trimleft [string range $line $space+1 end]]
    }
    lappend out $line
    return $out
}

# How many characters of a text fit into some columns.
proc ::sorma::show::Fitting {text width} {
    set n [expr {min([string length $text], $width)}]
    if {[string length $text] <= $width * 8 && ![regexp {[^\x20-\x7e]} $text]} {
        return $n
    }
    set used 0
    set length [string length $text]
    for {set i 0} {$i < $length} {incr i} {
        if {[string index $text $i] eq "\x1b" && [regexp -indices -start $i {\A\x1b\[[0-9;]*m} $text range]} {
            set i [lindex $range 1]
            continue
        }
        incr used [Columns [string index $text $i]]
        if {$used > $width} {
            return $i
        }
    }
    return $length
}

proc ::sorma::show::Cut {text width} {
    if {$width <= 0 || [Columns $text] <= $width} {
        return $text
    }
    if {$width < 5} {
        return [string range $text 0 [Fitting $text $width]-1]
    }
    return [string trimright [string range $text 0 [expr {[Fitting $text [expr {$width - 3}]] - 1}]]]...
}

# Columns that a text takes on a terminal.
proc ::sorma::show::Columns text {
    if {![regexp {[^\x20-\x7e]} $text]} {
        return [string length $text]
    }
    regsub -all {\x1b\[[0-9;]*m} $text {} text
    set n [string length $text]
    # Halves of surrogate pairs (Tcl 8.6) count one each: such characters are wide, nearly all of them.
    set wide [regexp -all {[\u1100-\u115f\u2e80-\u303e\u3041-\ua4cf\uac00-\ud7a3\uf900-\ufaff\ufe30-\ufe6f\uff00-\uff60\uffe0-\uffe6]} $text]
    if {[package vsatisfies [package provide Tcl] 9-]} {
        incr wide [regexp -all {[\U1f300-\U1faff\U20000-\U3fffd]} $text]
    }
    set none [regexp -all {[\u0300-\u036f\u1ab0-\u1aff\u20d0-\u20ff\u200b-\u200f\ufe00-\ufe0f\ufeff]} $text]
    return [expr {$n + $wide - $none}]
}

# Text that does nothing to a terminal: control characters, and those that turn the direction of writing, become visible.
proc ::sorma::show::Clean text {
    if {[string first \t $text] >= 0} {
        set text [string map [list \t "    "] $text]
    }
    if {![regexp {[\x00-\x09\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ufeff]} $text]} {
        return $text
    }
    set out {}
    set at 0
    foreach range [regexp -all -inline -indices {[\x00-\x09\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ufeff]} $text] {
        lassign $range i
        scan [string index $text $i] %c code
        append out [string range $text $at $i-1] [format [expr {$code < 256 ? "\\x%02x" : "\\u%04x"}] $code]
        set at [expr {$i + 1}]
    }
    return $out[string range $text $at end]
}

proc ::sorma::show::Paint {text colour settings} {
    variable Colours
    if {![dict get $settings -colour] || $colour eq {} || $text eq {} || ![dict exists $Colours $colour]} {
        return $text
    }
    return "\x1b\[[dict get $Colours $colour]m$text\x1b\[0m"
}

# ---- JSON ----

proc ::sorma::show::JsonReply reply {
    set members [list "\"code\":[JsonNumber [dict get $reply code]]"]
    if {[dict exists $reply text]} {
        lappend members "\"text\":[JsonText [dict get $reply text]]"
    }
    foreach field {floats ints} {
        if {[dict exists $reply $field]} {
            lappend members "\"$field\":\[[join [lmap x [dict get $reply $field] {JsonNumber $x}] ,]\]"
        }
    }
    if {[dict exists $reply any]} {
        lappend members "\"any\":\"[binary encode base64 [dict get $reply any]]\""
    }
    if {[dict exists $reply trail]} {
        lappend members "\"trail\":[JsonTrail [dict get $reply trail]]"
    }
    return "\{[join $members ,]\}"
}

proc ::sorma::show::JsonError {message code trail} {
    set words [if {[catch {llength $code}]} {list $code} else {set code}]
    set text "\{\"error\":\{\"message\":[JsonText $message],\"code\":\[[join [lmap word $words {JsonText $word}] ,]\]"
    if {[llength $trail] > 0} {
        append text ",\"trail\":[JsonTrail $trail]"
    }
    return $text\}\}
}

proc ::sorma::show::JsonTrail trail {
    set items {}
    foreach entry $trail {
        set members {}
        foreach {key value} $entry {
            switch -- $key {
                code { set value "\[[join [lmap word $value {JsonText $word}] ,]\]" }
                line - time { set value [JsonNumber $value] }
                default { set value [JsonText $value] }
            }
            lappend members "[JsonText $key]:$value"
        }
        lappend items "\{[join $members ,]\}"
    }
    return "\[[join $items ,]\]"
}

# A plain value: a number is a number, all else a string.
proc ::sorma::show::JsonValue value {
    return [if {[regexp {^-?(0|[1-9]\d*)(\.\d+)?([eE][-+]?\d+)?$} $value]} {set value} else {JsonText $value}]
}

# What JSON has no number for (NaN, infinity) becomes a string.
proc ::sorma::show::JsonNumber value {
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
    return [JsonText $value]
}

# ASCII only, so that no encoding on the way can spoil it.
proc ::sorma::show::JsonText text {
    set out [string map {\\ \\\\ \" \\\" \n \\n \r \\r \t \\t \b \\b \f \\f} $text]
    if {![regexp {[^\x20-\x7e]} $out]} {
        return \"$out\"
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
    return \"$out[string range $text $at end]\"
}
