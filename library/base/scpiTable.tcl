# scpiTable.tcl -- the SCPI of an option: what a driver declares beside the option's name and type. It knows no bus and no line.
#
#     ::sorma::scpiTable::row -voltage double {-unit V -set "VOLT %g" -get VOLT?}     -> the row, and the words that are left
#     ::sorma::scpiTable::fill ROW VALUES                  -> the row; %(channel)d in a message has become the value of -channel, in a dict: name -> value
#     ::sorma::scpiTable::setting ROW VALUE                -> :VOLT 3.3, a part of a message
#     ::sorma::scpiTable::value ROW ANSWER                 -> a value of the option
#
# A row is a dict: name, type, set, get, choices, unit, others: the names of other options in its messages. A wrong declaration has the code SORMA CLASS TABLE. Other errors have SCPI_TABLE and: TEXT, the
# value would become another message; or ANSWER, it is no value of the type.

package provide sorma::scpiTable 1.0

namespace eval ::sorma::scpiTable {
    variable Other {%\((\w+)\)([-+ #0-9.]*[a-zA-Z])}      ;# %(channel)d
    variable Number {^[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?}
}

proc ::sorma::scpiTable::row {name type words} {
    variable Other
    set row [dict create name $name type $type set {} get {} choices {} unit {} others {}]
    set rest {}
    foreach {word value} $words {
        if {$word in {-set -get -choices -unit}} {
            dict set row [string range $word 1 end] $value
        }
        if {$word ni {-set -get}} {
            lappend rest $word $value
        }
    }
    if {[dict get $row get] ne {} && [string first ? [dict get $row get]] < 0} {
        throw {SORMA CLASS TABLE} "option $name: -get \"[dict get $row get]\" is no question: it has no question mark"
    }
    if {[dict get $row set] ne {}} {
        Check [dict replace $row set [regsub -all $Other [dict get $row set] {}]] [if {[dict exists $rest -length]} {dict get $rest -length}]
    }
    foreach {- other -} [regexp -all -inline $Other "[dict get $row set] [dict get $row get]"] {
        dict set row others [lsort -unique [concat [dict get $row others] $other]]
    }
    return [list $row $rest]
}

# Does the format take the values of the type? length: as of a vector.
proc ::sorma::scpiTable::Check {row length} {
    dict with row {}
    set places [regexp -all {%} [string map {%% {}} $set]]
    if {$type eq "vector" && ![string is integer -strict $length]} {
        throw {SORMA CLASS TABLE} "option $name: -set of a vector needs -length, the number of its elements"
    }
    set wanted [expr {$type eq "vector" ? $length : 1}]
    if {$places != $wanted} {
        throw {SORMA CLASS TABLE} "option $name: -set \"$set\" has $places places for values, expected $wanted: %g is a number, %d a flag or an int, %s a word"
    }
    set value [if {$type in {double vector}} {string cat 0.5} elseif {$type in {flag int}} {string cat 1} else {string cat word}]
    if {[catch {format $set {*}[lrepeat $wanted $value]} why]} {
        throw {SORMA CLASS TABLE} "option $name: -set \"$set\" does not take a value of type $type: $why"
    }
}

proc ::sorma::scpiTable::fill {row values} {
    dict set row set [Fill [dict get $row set] $values {% %%}]
    dict set row get [Fill [dict get $row get] $values {}]
    return $row
}
proc ::sorma::scpiTable::Fill {text values marks} {
    variable Other
    while {[regexp -indices $Other $text whole name conversion]} {
        set name [string range $text {*}$name]
        set value [format %[string range $text {*}$conversion] [dict get $values $name]]
        if {[regexp {[^\x20-\x7e]|["';]} $value]} {
            throw [list SCPI_TABLE TEXT $value] "-$name goes to the instrument: expected ASCII without quotes and semicolons, got \"[string range $value 0 100]\""
        }
        set text [string replace $text {*}$whole [string map $marks $value]]
    }
    return $text
}

# The part of a message that sets it. A text must not get out of its place there.
proc ::sorma::scpiTable::setting {row value} {
    if {[dict get $row type] eq "string" && [regexp {[^\x20-\x7e]|["';]} $value]} {
        throw [list SCPI_TABLE TEXT $value] "[dict get $row name] goes to the instrument: expected ASCII without quotes and semicolons, got \"[string range $value 0 100]\""
    }
    set part [format [dict get $row set] {*}[if {[dict get $row type] eq "vector"} {set value} else {list $value}]]
    return [if {[string match {[:*]*} $part]} {set part} else {string cat : $part}]
}

proc ::sorma::scpiTable::question row {
    return [dict get $row get]
}

proc ::sorma::scpiTable::value {row answer} {
    variable Number
    switch -- [dict get $row type] {
        string { return [string trim $answer "\"'"] }
        vector { return [lmap part [split $answer ,] {string trim $part}] }
        flag { set value [string map -nocase {ON 1 OFF 0} $answer]; if {[string is double -strict $value]} {return [expr {$value != 0}]} }
        int { if {[regexp $Number $answer value]} {return [expr {round($value)}]} }
        double { if {[regexp $Number $answer value]} {return $value} }
        enum {
            set word [string trim $answer "\"'"]
            foreach choice [dict get $row choices] {
                if {$word ne {} && [string equal -nocase -length [string length $word] $word $choice]} {return $choice}
            }
        }
    }
    throw [list SCPI_TABLE ANSWER [dict get $row name]] "[dict get $row get] has answered \"[string range $answer 0 100]\", expected a value of [dict get $row name]"
}
