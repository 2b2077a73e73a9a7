# recorded.tcl -- for suites that sorma-replay has made: their daemons, their requests, and when a reply is the same.
#
# A pattern has a word for each word of a reply, without name and trail: RET 0 TMSG presto FMSG 1 ~0.49..0.51. A word may be
#     ~A..B   a number from A to B         *   any one word         =TEXT   TEXT, when it begins like one of these
#     ~N:U    the number N, or the numbers N, as near as the tolerance of the unit U says
#     ~~LIST  a text with numbers that vary: texts, and A..B between them
# and "..." at the end is any rest. An error has its code: RET -1 ERROR {OPTION RANGE}.

package require sorma
package require sorma::line
package provide sorma::recorded 1.0

namespace eval ::sorma::recorded {
    variable Pipes {}       ;# dict: name of a daemon -> pipe of its process
    variable Folder {}      ;# their sockets
    variable Before         ;# the runtime folder of before, in a list; empty: there was none
    variable Number {[-+]?(?:(?:0|[1-9]\d*)(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?}    ;# 08 is none for Tcl
    variable Pause 0        ;# before each request [ms]
    variable Tolerances {}  ;# dict: unit -> how far a number of it may be off; relative -> the same, as a part of the number
}

# ::sorma::recorded::begin DAEMONS -- start them, in a folder of their own. DAEMONS: a dict of names and words for sormad.
proc ::sorma::recorded::begin daemons {
    variable Pipes
    variable Before [expr {[info exists ::env(SORMA_RUNTIME_DIR)] ? [list $::env(SORMA_RUNTIME_DIR)] : {}}]
    variable Folder [exec mktemp -d [file join [expr {[info exists ::env(TMPDIR)] ? $::env(TMPDIR) : "/tmp"}] sorma-recorded-XXXXXX]]
    set ::env(SORMA_RUNTIME_DIR) $Folder
    dict for {name words} $daemons {
        if {[catch {open [list | sormad -name $name -until-eof {*}$words 2>@stderr] r+} pipe]} {
            end
            return -code error "sormad cannot be started: $pipe; it must be in PATH"
        }
        dict set Pipes $name $pipe
        while {![string match "ready *" [gets $pipe]]} {
            if {[eof $pipe]} {
                end
                return -code error "sormad -name $name $words: it has ended before it was ready"
            }
        }
        fconfigure $pipe -blocking 0
        fileevent $pipe readable [list ::sorma::recorded::Drain $pipe]
    }
}
proc ::sorma::recorded::Drain pipe {
    read $pipe
    if {[eof $pipe]} {
        fileevent $pipe readable {}
    }
}

# ::sorma::recorded::end -- end them, and wait for that.
proc ::sorma::recorded::end {} {
    variable Pipes
    variable Folder
    variable Before
    # Proxies remember what they have set, and the first reply of the next daemons would have a warning of it.
    foreach daemon [dict keys $Pipes] {
        foreach name [::sorma::names *@$daemon] {
            ::sorma::remove $name
        }
    }
    foreach pipe [dict values $Pipes] {
        fconfigure $pipe -blocking 1
        catch {close $pipe}
    }
    set Pipes {}
    file delete -force $Folder
    if {$Before eq {}} {
        unset -nocomplain ::env(SORMA_RUNTIME_DIR)
    } else {
        set ::env(SORMA_RUNTIME_DIR) [lindex $Before 0]
    }
}

# ::sorma::recorded::ended DAEMON -- was it started here, and is it gone?
proc ::sorma::recorded::ended daemon {
    variable Pipes
    if {![dict exists $Pipes $daemon]} {
        return 0
    }
    Drain [dict get $Pipes $daemon]
    return [eof [dict get $Pipes $daemon]]
}

# ::sorma::recorded::pause MS -- wait so long before each request from now on: what others do in their own time has then been done.
proc ::sorma::recorded::pause ms {
    variable Pause $ms
}

# ::sorma::recorded::ask DAEMON REQUEST -- the words of its reply, as a pattern has them. A daemon that has ended is not waited for.
proc ::sorma::recorded::ask {daemon request} {
    variable Pause
    if {[ended $daemon]} {
        return {RET -1 ENDED}
    }
    after $Pause
    set request [renamed $request]
    lassign [::sorma::line::head $request] object
    return [fields [::sorma::dispatch $object@$daemon[string range $request [string length $object] end]]]
}

# ::sorma::recorded::renamed REQUEST -- the same with the names that options have now: the dictionary has CLASS.-OLD -NEW for each.
proc ::sorma::recorded::renamed request {
    set words [lindex [dict get [::sorma::line::read $request] commands] 0]
    set class [lindex [split [lindex $words 0 2] .@] 0]
    if {[lindex $words 1 2] ni {CTRL DBX}} {
        return $request
    }
    foreach word [lreverse [lrange $words 2 end]] {
        lassign $word from to value quote
        if {$quote eq {} && [regexp {^-[A-Za-z]} $value] && ![catch {::sorma::so::dict CTRL -expand $class.$value} found]} {
            set request [string replace $request $from $to-1 [lindex $found end]]
        }
    }
    return $request
}

# ::sorma::recorded::isOfBus REQUEST -- is it a question of the bus itself, which programs ask, and which has another answer each time?
proc ::sorma::recorded::isOfBus request {
    return [regexp {^(sorm DBX|\S+ DBX -info)\M} $request]
}

# ::sorma::recorded::fields REPLY -- of a line NAME RET ...: its words, without name and trail; with the code of an error.
proc ::sorma::recorded::fields reply {
    # A daemon of ours answers with a list.
    set words [expr {[string is list $reply] ? [lrange $reply 1 end] : [lrange [split $reply] 1 end]}]
    set at [lsearch -exact $words TDBX]
    if {$at < 0} {
        return $words
    }
    set trail [lindex $words $at+1]
    set code [if {[lindex $trail 0] eq "error"} {list ERROR [lindex $trail 1 0]}]
    return [concat [lrange $words 0 $at-1] $code]
}

# ::sorma::recorded::tolerances DICT -- how far numbers may be off from now on: dict of units, and of relative. Others are exact.
proc ::sorma::recorded::tolerances dict {
    variable Tolerances $dict
}
# ::sorma::recorded::off UNIT NUMBER TOLERANCES -- how far this number may be off. A unit whose tolerance is 0 is exact.
proc ::sorma::recorded::off {unit number tolerances} {
    if {![dict exists $tolerances $unit] || [dict get $tolerances $unit] == 0} {
        return 0
    }
    set part [expr {[dict exists $tolerances relative] ? [dict get $tolerances relative] : 0}]
    return [expr {max([dict get $tolerances $unit], $part * abs($number))}]
}
# ::sorma::recorded::areNumbers TEXT -- is it a list of finite numbers?
proc ::sorma::recorded::areNumbers text {
    variable Number
    return [expr {[string is list $text] && [lsearch -not -regexp $text ^$Number$] < 0}]
}
proc ::sorma::recorded::Near {numbers unit word} {
    variable Tolerances
    if {![areNumbers $word] || [llength $word] != [llength $numbers]} {
        return 0
    }
    foreach number $numbers is $word {
        if {abs($is - $number) > [off $unit $number $Tolerances]} {
            return 0
        }
    }
    return 1
}

# ::sorma::recorded::same PATTERN WORDS
proc ::sorma::recorded::same {pattern words} {
    if {[lindex $pattern end] eq "..."} {
        set pattern [lrange $pattern 0 end-1]
        set words [lrange $words 0 [llength $pattern]-1]
    }
    if {[llength $pattern] != [llength $words]} {
        return 0
    }
    foreach one $pattern word $words {
        if {$one eq "*"} continue
        if {[string match ~~* $one]} {
            if {![Fits [string range $one 2 end] $word]} {
                return 0
            }
        } elseif {[regexp {^~(.*)\.\.(.*)$} $one -> low high]} {
            if {![string is double -strict $word] || $word < $low || $word > $high} {
                return 0
            }
        } elseif {[regexp {^~(.*?):(.*)$} $one -> numbers unit]} {
            if {![Near $numbers $unit $word]} {
                return 0
            }
        } elseif {[if {[string index $one 0] eq "="} {string range $one 1 end} else {set one}] ne $word} {
            return 0
        }
    }
    return 1
}

# Is this text one of a list of texts, with a number from A to B between two of them?
proc ::sorma::recorded::Fits {list text} {
    variable Number
    set exact [lmap {piece range} $list {regsub -all {\W} $piece {\\&}}]
    if {![regexp "^[join $exact ($Number)]$" $text - {*}[lmap {piece range} [lrange $list 0 end-1] {string cat number[incr n]}]]} {
        return 0
    }
    set n 0
    foreach {piece range} [lrange $list 0 end-1] {
        regexp {^(.*)\.\.(.*)$} $range -> low high
        if {[set number[incr n]] < $low || [set number$n] > $high} {
            return 0
        }
    }
    return 1
}

# ::sorma::recorded::pattern REPLIES ?WIDTHS? -- one that fits all of them, which are lists of words. Numbers may leave their range by ten times
# its width, to either side. Codes may not. WIDTHS: of widths; no range is narrower.
proc ::sorma::recorded::pattern {replies {widths {}}} {
    set out {}
    set lengths [lsort -integer -unique [lmap words $replies {llength $words}]]
    for {set i 0} {$i < [lindex $lengths 0]} {incr i} {
        set seen [lsort -unique [lmap words $replies {lindex $words $i}]]
        lassign [Taken $seen] pieces columns
        set wide [expr {[dict exists $widths [list $i $pieces]] ? [dict get $widths [list $i $pieces]] : {}}]
        lappend out [if {[llength $seen] == 1 && [lsearch -exact -not -real $wide 0] < 0} {
            # Not by expr, which writes inf and 1e-05 in another way.
            string cat [if {[regexp {^[*~=]|^\.\.\.$} [lindex $seen 0]]} {string cat =}] [lindex $seen 0]
        } elseif {$columns eq {}} {
            string cat *
        } elseif {$pieces eq {{} {}}} {
            # A code stays as it was seen: 0, or 1 with a warning, is never an error.
            string cat ~ [Range [lindex $columns 0] [expr {$i == 1 ? 0 : 10}] [lindex $wide 0]]
        } else {
            string cat ~~ [Text $pieces $columns $wide]
        }]
    }
    return [concat $out [if {[llength $lengths] > 1} {list ...}]]
}
# ::sorma::recorded::widths LIST -- how far numbers of one request vary: a dict. LIST: for each time that it was asked, its replies. What is noise at
# one time is noise at all, also when the number was the same by chance.
proc ::sorma::recorded::widths list {
    set widths {}
    foreach replies $list {
        set length [::tcl::mathfunc::min {*}[lmap words $replies {llength $words}]]
        for {set i 2} {$i < $length} {incr i} {
            lassign [Taken [lsort -unique [lmap words $replies {lindex $words $i}]]] pieces columns
            set wide [lmap column $columns {Width $column}]
            if {[dict exists $widths [list $i $pieces]]} {
                set wide [lmap one $wide two [dict get $widths [list $i $pieces]] {expr {max($one, $two)}}]
            }
            dict set widths [list $i $pieces] $wide
        }
    }
    return $widths
}

# {PIECES COLUMNS}: the texts around the numbers of these words, and for each number its values. Without columns: words differ in more.
proc ::sorma::recorded::Taken words {
    variable Number
    foreach word $words {
        set at 0
        set texts [set numbers {}]
        foreach {- place} [regexp -all -inline -indices "(?:^|\[\\s(\\\[{=,\])($Number)(?=$|\[\\s)\\\]},;\])" $word] {
            lassign $place from to
            lappend texts [string range $word $at $from-1]
            lappend numbers [string range $word $from $to]
            set at [expr {$to + 1}]
        }
        lappend texts [string range $word $at end]
        if {[info exists pieces] && $texts ne $pieces} {
            return {}
        }
        set pieces $texts
        set n 0
        foreach number $numbers {
            lappend column[incr n] $number
        }
    }
    return [list $pieces [lmap number $numbers {set column[incr m]}]]
}
proc ::sorma::recorded::Text {pieces columns wide} {
    set out {}
    set text [lindex $pieces 0]
    foreach piece [lrange $pieces 1 end] column $columns least $wide {
        if {[llength [lsort -unique $column]] == 1 && $least in {{} 0}} {
            append text [lindex $column 0] $piece
        } else {
            lappend out $text [Range $column 10 $least]
            set text $piece
        }
    }
    return [concat $out [list $text]]
}
proc ::sorma::recorded::Width numbers {
    set sorted [lsort -real $numbers]
    return [expr {[lindex $sorted end] - [lindex $sorted 0]}]
}
# A range has this width at least.
proc ::sorma::recorded::Range {numbers wider least} {
    set sorted [lsort -real $numbers]
    set width [expr {max([Width $numbers], $least eq {} ? 0 : $least)}]
    return [expr {[lindex $sorted 0] - $wider * $width}]..[expr {[lindex $sorted end] + $wider * $width}]
}
