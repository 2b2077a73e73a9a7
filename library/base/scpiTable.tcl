# scpiTable.tcl -- the SCPI of an option: what a driver declares beside the option's name and type. It knows no bus and no line.
#
#     ::sorma::scpiTable::row -voltage double {-unit V -set "VOLT %g" -get VOLT?}     -> the row, and the words that are left
#     ::sorma::scpiTable::setting ROW VALUE                -> :VOLT 3.3, a part of a message
#     ::sorma::scpiTable::value ROW ANSWER                 -> a value of the option
#
# A row is a dict: type, set, get, choices, unit. Errors have the code SCPI_TABLE and: DECLARE, the declaration is wrong; TEXT, the value would become
# another message; or ANSWER, it is no value of the type.

package provide sorma::scpiTable 1.0

namespace eval ::sorma::scpiTable {
    variable Number {^[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?}
}

proc ::sorma::scpiTable::row {name type words} {
    set row [dict create type $type set {} get {} choices {} unit {}]
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
        throw {SCPI_TABLE DECLARE} "-get \"[dict get $row get]\" is no question: it has no question mark"
    }
    if {[dict get $row set] ne {}} {
        Check $row [if {[dict exists $rest -length]} {dict get $rest -length}]
    }
    return [list $row $rest]
}

# Does the format take the values of the type? length: as of a vector.
proc ::sorma::scpiTable::Check {row length} {
    dict with row {}
    set places [regexp -all {%} [string map {%% {}} $set]]
    if {$type eq "vector" && ![string is integer -strict $length]} {
        throw {SCPI_TABLE DECLARE} "-set of a vector needs -length, the number of its elements"
    }
    set wanted [expr {$type eq "vector" ? $length : 1}]
    if {$places != $wanted} {
        throw {SCPI_TABLE DECLARE} "-set \"$set\" has $places places for values, expected $wanted: %g is a number, %d a flag or an int, %s a word"
    }
    set value [if {$type in {double vector}} {string cat 0.5} elseif {$type in {flag int}} {string cat 1} else {string cat word}]
    if {[catch {format $set {*}[lrepeat $wanted $value]} why]} {
        throw {SCPI_TABLE DECLARE} "-set \"$set\" does not take a value of type $type: $why"
    }
}

# The part of a message that sets it. A text must not get out of its place there.
proc ::sorma::scpiTable::setting {row value} {
    if {[dict get $row type] eq "string" && [regexp {[^\x20-\x7e]|["';]} $value]} {
        throw {SCPI_TABLE TEXT} "expected ASCII without quotes and semicolons, got \"[string range $value 0 100]\""
    }
    set part [format [dict get $row set] {*}[if {[dict get $row type] eq "vector"} {set value} else {list $value}]]
    return [if {[string match {[:*]*} $part]} {set part} else {string cat : $part}]
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
    throw {SCPI_TABLE ANSWER} "[dict get $row get] has answered \"[string range $answer 0 100]\""
}
