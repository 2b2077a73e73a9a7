# circuitText.tcl -- the recipe of a circuit as a graph: its wires, its units, and their places. It knows no bus and no window.
#
# The text is the only source. It is cut into pieces that give the text again when they are joined. An edit replaces, adds or removes
# pieces, so comments, order and white space of all others stay. The grammar of wires is that of services/circuit/wires.h.
#
# graph     a dict: pieces (list), wires (list of WIRE), nodes (dict: KEY -> NODE)
# WIRE      {piece source sink}; piece: its index;  END: {object pin first last numbers}; first is empty: the whole pin; numbers: constants
# KEY       {unit NAME} or {pin NAME}, a pin of the circuit's own
# NODE      a dict: kind (unit, in or out), ins and outs (names of pins, in the order of the text)
#
#     places  = place ((";" | newline) place)*          comments as among wires
#     place   = ("unit" | "pin") name x y               whole numbers, in steps of the grid
#             | "note" number x y text                  a comment in the picture: the rest of the statement
#             | "frame" number x y width height text    a frame with a title
#     In text, \n is a line break, \s a semicolon, \h a #, and \b a backslash.

package provide sorma::circuitText 1.0

namespace eval ::sorma::circuitText {
    namespace export graph node object read text wire end write between add remove replace pins undeclare places place drop notes quote
    namespace ensemble create
    variable options {-wires -inputs -outputs -places}      ;# of a circuit, that are its recipe
    variable Piece {[ \t\r;\n]+|#[^\n]*|[^ \t\r;\n#](?:[^ \t\r;\n]|[ \t\r]+[^#;\n \t\r])*}
    variable Number {^[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?$|^[-+](?:[iI][nN][fF]|[nN][aA][nN])$}
    variable Pin {^[A-Za-z_][A-Za-z0-9_-]*$}
}

# ---- reading ----

# ::sorma::circuitText graph WIRES ?INPUTS? ?OUTPUTS? -- the graph of a recipe: of its options -wires, -inputs and -outputs.
proc ::sorma::circuitText::graph {wires {inputs {}} {outputs {}}} {
    set graph [read $wires]
    set nodes {}
    foreach {kind side text} [list in outs $inputs out ins $outputs] {
        foreach pin [pins $text] {
            dict set nodes [list pin [lindex $pin 0]] [dict merge {ins {} outs {}} [list kind $kind $side [list [lindex $pin 0]]]]
        }
    }
    foreach wire [dict get $graph wires] {
        foreach end [lrange $wire 1 2] {kind side} {in outs out ins} {
            lassign $end object pin
            if {$pin eq {}} continue
            set key [node $end]
            if {![dict exists $nodes $key]} {
                dict set nodes $key [dict create kind [expr {$object ne {} ? "unit" : $kind}] ins {} outs {}]
            }
            if {$pin ni [dict get $nodes $key $side]} {
                dict set nodes $key $side [list {*}[dict get $nodes $key $side] $pin]
            }
        }
    }
    return [dict replace $graph nodes $nodes]
}

# The KEY of the node that an END belongs to.
proc ::sorma::circuitText::node end {
    lassign $end object pin
    return [if {$object ne {}} {list unit $object} else {list pin $pin}]
}

# ::sorma::circuitText object NAME -- the name that the object has itself: findBall.x is findball.x.
proc ::sorma::circuitText::object name {
    return [if {[regexp {^[a-z]\w*} $name class]} {string cat [string tolower $class] [string range $name [string length $class] end]} else {set name}]
}

# ::sorma::circuitText read WIRES -- the pieces and wires alone. Fails with {SORMA CIRCUIT SYNTAX NUMBER FIRST LAST}: the wire, from 1, and its
# characters.
proc ::sorma::circuitText::read text {
    variable Piece
    set pieces [regexp -all -inline $Piece $text]
    set wires {}
    set n 0
    foreach piece $pieces {
        if {![IsGap $piece]} {
            if {[catch {wire $piece} ends]} {
                set first [string length [join [lrange $pieces 0 $n-1] {}]]
                return -code error -errorcode [list SORMA CIRCUIT SYNTAX [expr {[llength $wires] + 1}] $first [expr {$first + [string length $piece] - 1}]] \
                    "wire [expr {[llength $wires] + 1}] \"$piece\": $ends"
            }
            lappend wires [list $n {*}$ends]
        }
        incr n
    }
    return [dict create pieces $pieces wires $wires]
}

# Is it white space, separators or a comment?
proc ::sorma::circuitText::IsGap piece {
    return [expr {[string first [string index $piece 0] " \t\r\n;#"] >= 0}]
}
# ::sorma::circuitText wire TEXT -- {SOURCE SINK} of one wire, both ENDs.
proc ::sorma::circuitText::wire text {
    set words [lsearch -all -inline -exact -not [split $text " \t\r"] {}]
    if {[llength $words] < 3 || [lsearch -exact $words ->] != [llength $words] - 2} {
        return -code error "must be \"source -> sink\", with white space around the arrow"
    }
    set sources [lrange $words 0 end-2]
    if {[Numbers $sources]} {
        return [list [list {} {} {} {} $sources] [end [lindex $words end]]]
    } elseif {[llength $sources] > 1} {
        return -code error "a source is one pin, or numbers"
    }
    return [list [end [lindex $sources 0]] [end [lindex $words end]]]
}
proc ::sorma::circuitText::Numbers words {
    variable Number
    foreach word $words {
        if {![regexp $Number $word]} {
            return 0
        }
    }
    return 1
}

# ::sorma::circuitText end TEXT -- the END that is written so. write END: as it would be written.
proc ::sorma::circuitText::end text {
    variable Pin
    set pin $text
    set object [set first [set last {}]]
    # From the end: names may have dots and brackets.
    if {[string index $text end] eq "\]"} {
        set open [string last \[ $text]
        set pin [string range $text 0 $open-1]
        if {![regexp {^(\d+)(?::(\d+))?$} [string range $text $open+1 end-1] -> first last]} {
            return -code error "bad slice in \"$text\": must be \[i\] or \[i:j\], i <= j"
        }
    }
    set dot [string last . $pin]
    if {$dot >= 0} {
        set object [string range $pin 0 $dot-1]
        set pin [string range $pin $dot+1 end]
    }
    # A class, then perhaps a flavor and a place; the bus knows more of names.
    if {![regexp $Pin $pin] || $dot >= 0 && ![regexp {^[A-Za-z]\w*(?:[.@].|$)} $object]} {
        return -code error "\"$text\" is no pin: must be OBJECT.PIN, or a pin of the circuit's own, with \[i\] or \[i:j\] behind it when it is a part"
    }
    if {[regexp {^[^@]*?([][\{\}$"\\])} $object -> special]} {
        return -code error "\"$text\" is no pin: $special cannot stand in a name, since it is special to Tcl"
    }
    if {$first ne {}} {
        set last [expr {$last eq {} ? $first : $last}]
        scan "$first $last" "%d %d" first last              ;# without zeros before them
        if {$first > $last} {
            return -code error "bad slice in \"$text\": must be \[i\] or \[i:j\], i <= j"
        }
    }
    return [list $object $pin $first $last {}]
}
proc ::sorma::circuitText::write end {
    lassign $end object pin first last numbers
    if {$pin eq {}} {
        return [join $numbers]
    }
    set slice [if {$first ne {}} {string cat \[ $first [if {$last != $first} {string cat : $last}] \]}]
    return [if {$object ne {}} {string cat $object .}]$pin$slice
}
# ::sorma::circuitText between SOURCE SINK -- a wire of these ENDs, as it would be written.
proc ::sorma::circuitText::between {source sink} {
    return "[write $source] -> [write $sink]"
}

# ::sorma::circuitText pins TEXT -- what -inputs or -outputs declares: a list of {name length unit}. Statements with errors are left out.
proc ::sorma::circuitText::pins text {
    set out {}
    foreach words [Statements $text] {
        if {[regexp {^([A-Za-z_][A-Za-z0-9_-]*)(?: (\d+))?(?: (\S+))?$} [join $words] -> name length unit]} {
            lappend out [list $name $length $unit]
        }
    }
    return $out
}
# A list of the words of each statement.
proc ::sorma::circuitText::Statements text {
    variable Piece
    return [lmap piece [regexp -all -inline $Piece $text] {
        if {[IsGap $piece]} continue
        regexp -all -inline {[^ \t\r]+} $piece
    }]
}

# ::sorma::circuitText text GRAPH -- the text that it was read from, with all edits.
proc ::sorma::circuitText::text graph {
    return [join [dict get $graph pieces] {}]
}

# ---- editing the text ----

# ::sorma::circuitText add WIRES SOURCE SINK -- the text with one more wire at its end, laid out like the one before it. SOURCE and SINK: as
# they are written.
proc ::sorma::circuitText::add {text source sink} {
    set graph [read $text]
    set pieces [dict get $graph pieces]
    set wires [dict get $graph wires]
    if {[llength $wires] == 0} {
        return [string cat $text [if {[string trim $text " \t\r;\n"] ne {}} {string cat \n}] "$source -> $sink"]
    }
    set last [lindex $wires end 0]
    set before [expr {$last > 0 ? [lindex $pieces $last-1] : {}}]
    set gap [if {[regexp {\n[ \t\r]*$} $before line]} {set line} elseif {[llength $wires] == 1 && [string first \n $text] >= 0} {string cat \n} else {string cat "; "}]
    # A comment in the same line belongs to the wire there.
    if {[string match #* [lindex $pieces $last+2]] && [string first \n [lindex $pieces $last+1]] < 0} {
        incr last 2
        set gap [expr {[string first \n $gap] < 0 ? "\n" : $gap}]
    }
    return [join [linsert $pieces $last+1 $gap "$source -> $sink"] {}]
}

# ::sorma::circuitText remove WIRES NUMBERS -- the text without these wires, counted from 0. A line that has nothing else goes with its comment.
proc ::sorma::circuitText::remove {text numbers} {
    set graph [read $text]
    foreach number [lsort -integer -decreasing -unique $numbers] {
        set text [Without $text [dict get $graph pieces] [lindex [dict get $graph wires] $number 0]]
    }
    return $text
}
# The text without the statement that is piece AT; text and pieces may differ behind it.
proc ::sorma::circuitText::Without {text pieces at} {
    set from [string length [join [lrange $pieces 0 $at-1] {}]]
    set to [expr {$from + [string length [lindex $pieces $at]]}]
    set line [expr {[string last \n $text $from-1] + 1}]
    set end [string first \n $text $to]
    set end [expr {$end < 0 ? [string length $text] : $end}]
    set before [string range $text $line $from-1]
    set after [string range $text $to $end-1]
    if {[string trim $before " \t\r;"] ne {}} {
        set before [string trimright $before " \t\r;"]
    } elseif {[regexp {^[ \t\r;]*(#.*)?$} $after]} {
        # Nothing else is in its line: that goes, and the last one with the end of the line before it.
        if {$end == [string length $text]} {
            return [string range $text 0 $line-2]
        }
        return [string range $text 0 $line-1][string range $text $end+1 end]
    } else {
        set after [string trimleft $after " \t\r;"]
    }
    return [string range $text 0 $line-1]$before$after[string range $text $end end]
}

# ::sorma::circuitText replace WIRES NUMBER WIRE -- the text with another wire in its place.
proc ::sorma::circuitText::replace {text number wire} {
    set graph [read $text]
    return [join [lreplace [dict get $graph pieces] {*}[lrepeat 2 [lindex [dict get $graph wires] $number 0]] $wire] {}]
}

# ---- places ----

# ::sorma::circuitText places TEXT -- what -places says: a dict KEY -> {x y}. Statements that are no places are left out.
proc ::sorma::circuitText::places text {
    set out {}
    foreach words [Statements $text] {
        lassign $words kind name x y
        if {[llength $words] == 4 && $kind in {unit pin} && [string is integer -strict $x] && [string is integer -strict $y]} {
            dict set out [list $kind $name] [list $x $y]
        }
    }
    return $out
}

# ::sorma::circuitText notes TEXT -- comments and frames in -places: a dict KEY -> {kind note|frame place {x y} size {width height} text}.
# KEY: {note NUMBER} or {frame NUMBER}; the size of a note is empty. Statements that are neither are left out.
proc ::sorma::circuitText::notes text {
    variable Piece
    set out {}
    foreach piece [regexp -all -inline $Piece $text] {
        if {[regexp {^(note|frame)[ \t\r]+(\d+)[ \t\r]+([-+]?\d+)[ \t\r]+([-+]?\d+)(?:[ \t\r]+(.*))?$} $piece -> kind number x y rest]} {
            set size {}
            if {$kind eq "frame" && ![regexp {^(\d+)[ \t\r]+(\d+)(?:[ \t\r]+(.*))?$} $rest -> width height rest]} continue
            if {$kind eq "frame"} {
                set size [lmap n [list $width $height] {scan $n %d}]
            }
            dict set out [list $kind $number] [dict create kind $kind place [lmap n [list $x $y] {scan $n %d}] size $size \
                text [string map {\\n \n \\s ; \\h # \\b \\} $rest]]
        }
    }
    return $out
}
# ::sorma::circuitText quote TEXT -- a text as it is written in a note or frame.
proc ::sorma::circuitText::quote text {
    return [string map {\\ \\b \n \\n ; \\s # \\h} [string trim $text]]
}

# ::sorma::circuitText place TEXT MOVED -- the text of -places with these: a dict KEY -> {x y}, or for notes and frames {x y REST}.
# All others, and a rest that is not given, stay as they are written.
proc ::sorma::circuitText::place {text moved} {
    variable Piece
    set pieces [lmap piece [regexp -all -inline $Piece $text] {
        set key [lrange [regexp -all -inline {\S+} $piece] 0 1]
        if {[string match #* $piece] || ![dict exists $moved $key]} {
            set piece
        } else {
            set new "$key [join [dict get $moved $key]]"
            if {[llength [dict get $moved $key]] == 2 && [regexp {^(?:\S+\s+){3}\S+(\s+\S.*)$} $piece -> rest]} {
                append new $rest
            }
            dict unset moved $key
            set new
        }
    }]
    set out [join $pieces {}]
    # The text before the first new place decides its separator. The others follow in the same way.
    set gap [expr {[string trim $out] eq {} ? {} : [regexp {\n\s*$|;\s*$} $out] ? {} : [regexp {(?:^|\s)#[^\n]*$|\n} $out] ? "\n" : "; "}]
    set next [expr {[string first \n $out$gap] >= 0 ? "\n" : "; "}]
    foreach {key place} $moved {
        append out $gap [string trimright "[join $key] [join $place]"]
        set gap $next
    }
    return $out
}

# ::sorma::circuitText drop TEXT KEYS -- the text of -places without these.
proc ::sorma::circuitText::drop {text keys} {
    return [Less $text 1 $keys]
}
# ::sorma::circuitText undeclare TEXT NAMES -- the text of -inputs or -outputs without these pins.
proc ::sorma::circuitText::undeclare {text names} {
    return [Less $text 0 $names]
}
# The text without the statements whose first words, up to LAST, are one of KEYS.
proc ::sorma::circuitText::Less {text last keys} {
    variable Piece
    set pieces [regexp -all -inline $Piece $text]
    for {set n [expr {[llength $pieces] - 1}]} {$n >= 0} {incr n -1} {
        if {![IsGap [lindex $pieces $n]] && [lrange [regexp -all -inline {\S+} [lindex $pieces $n]] 0 $last] in $keys} {
            set text [Without $text $pieces $n]
        }
    }
    return $text
}
