# text.tcl -- text of any origin, for a terminal: columns, widths, line breaks, colours. It knows no bus.
#
# settings: a dict with -width (columns, 0: no limit), -colour (boolean), -whole (boolean: abridge nothing), -json (boolean: for
# programs). Widths are those of a terminal: wide characters take two columns, combining ones none.

package require sorma::options
package provide sorma::text 1.0

namespace eval ::sorma::text {
    variable Options {-colour boolean -json boolean -whole boolean -width {{whole 0 {}}}}
    variable Style          ;# settings where none are given
    if {![info exists Style]} {
        set Style {-colour 0 -json 0 -whole 0 -width 80}
    }
    variable Widths {}              ;# dict: character -> its columns, of those that have been seen
    variable Colours {error 31 warning 33 verbose 2 dim 2 good 32 name 36 strong 1}
    variable MostLines 1000         ;# of a text
}

# ::sorma::text::style ?-OPTION VALUE...? -- set the settings that are used where none are given. Returns all.
proc ::sorma::text::style args {
    variable Style
    set Style [styled {} $args]
    return $Style
}

# ::sorma::text::styled TABLE WORDS -- the settings that WORDS give, beside the options of TABLE (see options.tcl).
proc ::sorma::text::styled {table words} {
    variable Options
    variable Style
    set settings [dict merge [::sorma::options::defaults $table] $Style]
    set settings [::sorma::options::take [dict merge $Options $table] $settings $words]
    if {[dict get $settings -width] > 0} {
        dict set settings -width [expr {max(10, [dict get $settings -width])}]
    }
    return $settings
}

# ::sorma::text::isTerminal CHANNEL -- only a terminal has a line speed.
proc ::sorma::text::isTerminal channel {
    return [expr {![catch {fconfigure $channel -mode}]}]
}

# ::sorma::text::readFile FILE, writeFile FILE TEXT -- in UTF-8.
proc ::sorma::text::readFile file {
    set channel [open $file]
    try {
        fconfigure $channel -encoding utf-8
        catch {fconfigure $channel -profile replace}        ;# Tcl 9 is strict otherwise
        return [read $channel]
    } finally {
        close $channel
    }
}
proc ::sorma::text::writeFile {file text} {
    set channel [open $file w]
    try {
        fconfigure $channel -encoding utf-8
        puts -nonewline $channel $text
    } finally {
        close $channel
    }
}

# A text as a pattern of string match that fits nothing else.
proc ::sorma::text::escape text {
    return [string map {\\ \\\\ * \\* ? \\? \[ \\\[ \] \\\]} $text]
}

# ::sorma::text::table --
#       Aligned columns; where they do not fit, a block of lines for each row.
# Arguments:
#       heads   names of the columns; empty: none
#       rows    list of lists
#       args    -colour bool, -width n; -right list: columns (counted from 0) to be aligned at their right; -wrap bool:
#               break what does not fit into the last column, rather than cut it
proc ::sorma::text::table {heads rows args} {
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
            set cell [string map {\n { } \t { }} [clean [lindex $row $c]]]
            lappend line $cell
            lset wides $c [expr {max([lindex $wides $c], [columns $cell])}]
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
            set cell [cut [lindex $line $c] [lindex $wides $c]]
            set pad [string repeat { } [expr {[lindex $wides $c] - [columns $cell]}]]
            append text [if {$c in [dict get $settings -right]} {string cat "$pad$cell"} else {string cat "$cell$pad"}] "  "
        }
        set last [lindex $line end]
        if {$columns - 1 in [dict get $settings -right]} {
            set last [string repeat { } [expr {[lindex $wides end] - [columns $last]}]]$last
        }
        if {$width > 0 && [dict get $settings -wrap]} {
            set last [join [wrap $last [expr {$width - $before}] 0] \n[string repeat { } $before]]
        } elseif {$width > 0} {
            set last [cut $last [expr {$width - $before}]]
        }
        set text [string trimright "$text$last"]
        lappend out [if {$isHead} {paint $text strong $settings} else {set text}]
        set isHead 0
    }
    return [join $out \n]
}

proc ::sorma::text::Blocks {heads rows settings} {
    set out {}
    foreach row $rows {
        lappend out [cut [clean [lindex $row 0]] [dict get $settings -width]]
        for {set c 1} {$c < [llength $row]} {incr c} {
            if {[lindex $row $c] eq {}} continue
            set head [lindex $heads $c]
            lappend out [block "  " [if {$head ne {}} {string cat "$head: "}][lindex $row $c] {} $settings]
        }
    }
    return [join $out \n]
}

# A text of any origin within the width: lines keep their indentation, also where they are broken.
proc ::sorma::text::paragraphs {text settings} {
    variable MostLines
    set lines [split $text \n]
    set note {}
    if {[llength $lines] > $MostLines && ![dict get $settings -whole]} {
        set note "... ([expr {[llength $lines] - $MostLines}] more lines)"
        set lines [lrange $lines 0 $MostLines-1]
    }
    set out [lmap line $lines {join [wrap [clean $line] [dict get $settings -width] [Indentation $line]] \n}]
    if {$note ne {}} {
        lappend out [paint $note dim $settings]
    }
    return [join $out \n]
}

# How far the lines below a broken one are moved in: to the second column of help texts, else as the line itself.
proc ::sorma::text::Indentation line {
    if {[regexp -indices {^ *\S.*?\S {2,}(?=\S)} $line range] && [lindex $range 1] < 40} {
        return [expr {[lindex $range 1] + 1}]
    }
    regexp {^ *} $line spaces
    return [string length $spaces]
}

# A painted head of some columns, and a text beside it. breaks: whether lines may be broken, else they are cut.
proc ::sorma::text::hang {head columns text settings {clean 1}} {
    set width [dict get $settings -width]
    if {$clean} {
        set text [clean $text]
    }
    set indent [expr {$columns + 1}]
    if {$width > 0 && $indent > $width / 2} {
        set indent 2
        set lines [wrap $text [expr {$width - 2}] 0]
        return $head\n[join [lmap line $lines {string cat "  " $line}] \n]
    }
    set lines {}
    foreach line [split $text \n] {
        lappend lines {*}[wrap $line [expr {$width > 0 ? $width - $indent : 0}] 0]
    }
    return "$head [join $lines "\n[string repeat { } $indent]"]"
}

# Lines moved in and painted.
proc ::sorma::text::block {margin text colour settings} {
    set width [dict get $settings -width]
    if {$width > 0 && [string length $margin] > $width / 3} {
        set margin "  "
    }
    set lines {}
    foreach line [split [clean $text] \n] {
        lappend lines {*}[wrap $line [expr {$width > 0 ? $width - [string length $margin] : 0}] 0]
    }
    return [join [lmap line $lines {paint $margin$line $colour $settings}] \n]
}

# Break a line at spaces, or where it has to be. Escape sequences of Paint count as nothing.
proc ::sorma::text::wrap {line width indent} {
    if {$width <= 0 || [columns $line] <= $width} {
        return [list $line]
    }
    if {$indent > $width / 2} {
        regexp {^ *} $line spaces
        set indent [expr {[string length $spaces] + 2 < $width / 2 ? [string length $spaces] + 2 : 0}]
    }
    set margin [string repeat { } $indent]
    set out {}
    while {[columns $line] > $width} {
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
proc ::sorma::text::Fitting {text width} {
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
        incr used [columns [string index $text $i]]
        if {$used > $width} {
            return $i
        }
    }
    return $length
}

proc ::sorma::text::cut {text width} {
    if {$width <= 0 || [columns $text] <= $width} {
        return $text
    }
    if {$width < 5} {
        return [string range $text 0 [Fitting $text $width]-1]
    }
    return [string trimright [string range $text 0 [expr {[Fitting $text [expr {$width - 3}]] - 1}]]]...
}

# Columns that a text takes on a terminal.
proc ::sorma::text::columns text {
    if {![regexp {[^\x20-\x7e]} $text]} {
        return [string length $text]
    }
    variable Widths
    regsub -all {\x1b\[[0-9;]*m} $text {} text
    set sum 0
    foreach char [split $text {}] {
        if {![dict exists $Widths $char]} {
            dict set Widths $char [Width $char]
        }
        incr sum [dict get $Widths $char]
    }
    return $sum
}

# Tcllib knows which characters are wide, from Unicode's tables. Halves of surrogate pairs (Tcl 8.6) count one each: such characters
# are wide, nearly all of them.
proc ::sorma::text::Width char {
    if {[regexp {[\x20-\x7e]} $char]} {
        return 1
    }
    if {[regexp {[\u0300-\u036f\u1ab0-\u1aff\u20d0-\u20ff\u200b-\u200f\ufe00-\ufe0f\ufeff]} $char]} {
        return 0
    }
    namespace eval ::textutil {}            ;# which its file forgets to make
    package require textutil::wcswidth
    return [::textutil::wcswidth_char [scan $char %c]]
}

# Text that does nothing to a terminal: control characters, and those that turn the direction of writing, become visible.
proc ::sorma::text::clean text {
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

# ::sorma::text::label WORD -- an option or action as it stands on a button: -emergencyStop as Emergency stop.
proc ::sorma::text::label word {
    return [string totitle [regsub -all {[[:lower:]](?=[[:upper:]])} [string trimleft $word -] {& }]]
}

# ::sorma::text::counted N ONE MANY -- such as "1 box" or "3 boxes".
proc ::sorma::text::counted {n one many} {
    return "$n [expr {$n == 1 ? $one : $many}]"
}

# ::sorma::text::digits NUMBERS --
#       Numbers for people: nine digits each, so that 0.45000000000000001 is 0.45, and more only where two numbers that differ would look
#       the same. Whole numbers and short ones stay as they are.
proc ::sorma::text::digits numbers {
    set different [llength [lsort -unique $numbers]]
    foreach digits {9 12 15 17} {
        set shown [lmap x $numbers {
            if {[string length $x] <= 10 || ![regexp {^-?\d+(\.\d+)?(e[-+]?\d+)?$} $x] || [string is wideinteger $x]} {
                set x
            } else {
                format %.${digits}g $x
            }
        }]
        if {[llength [lsort -unique $shown]] == $different} break
    }
    return $shown
}

# ::sorma::text::time MICROSECONDS -- of the day here: 10:31:02.123.
proc ::sorma::text::time us {
    return [clock format [expr {$us / 1000000}] -format %H:%M:%S].[format %03d [expr {$us / 1000 % 1000}]]
}

# ::sorma::text::age MS -- how old something is that is known since then: such as "12 s old".
proc ::sorma::text::age since {
    set s [expr {max(0, [clock milliseconds] - $since) / 1000}]
    return "[expr {$s < 60 ? "$s s" : $s < 3600 ? "[expr {$s / 60}] min" : "[expr {$s / 3600}] h"}] old"
}

proc ::sorma::text::paint {text colour settings} {
    variable Colours
    if {![dict get $settings -colour] || $colour eq {} || $text eq {} || ![dict exists $Colours $colour]} {
        return $text
    }
    return "\x1b\[[dict get $Colours $colour]m$text\x1b\[0m"
}
