# recorded.tcl -- for suites that sorma-replay has made: their daemons, their requests, and when a reply is the same.
#
# A pattern has a word for each word of a reply, without name and trail: RET 0 TMSG presto FMSG 1 ~0.49..0.51. A word may be
#     ~A..B   a number from A to B         *   any one word         =TEXT   TEXT, when it begins like one of these
#     ~N:U    the number N, or the numbers N, as near as the tolerance of the unit U says
# and "..." at the end is any rest. An error has its code: RET -1 ERROR {OPTION RANGE}.

package require sorma
package require sorma::line
package provide sorma::recorded 1.0

namespace eval ::sorma::recorded {
    variable Pipes {}       ;# dict: name of a daemon -> pipe of its process
    variable Folder {}      ;# their sockets
    variable Before         ;# the runtime folder of before, in a list; empty: there was none
    variable Tolerances {}  ;# dict: unit -> how far a number of it may be off; relative -> the same, as a part of the number
}

# ::sorma::recorded::begin DAEMONS -- start them, in a folder of their own. DAEMONS: a dict of names and words for sormad.
proc ::sorma::recorded::begin daemons {
    variable Pipes
    variable Before [expr {[info exists ::env(SORMA_RUNTIME_DIR)] ? [list $::env(SORMA_RUNTIME_DIR)] : {}}]
    variable Folder [exec mktemp -d [file join [expr {[info exists ::env(TMPDIR)] ? $::env(TMPDIR) : "/tmp"}] sorma-recorded-XXXXXX]]
    set ::env(SORMA_RUNTIME_DIR) $Folder
    dict for {name words} $daemons {
        set pipe [open [list | sormad -name $name -until-eof {*}$words 2>@stderr] r+]
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

# ::sorma::recorded::ask DAEMON REQUEST -- the words of its reply, as a pattern has them. A daemon that has ended is not waited for.
proc ::sorma::recorded::ask {daemon request} {
    if {[ended $daemon]} {
        return {RET -1 ENDED}
    }
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
# ::sorma::recorded::areNumbers TEXT -- is it a list of finite numbers? 08 is none for Tcl.
proc ::sorma::recorded::areNumbers text {
    return [expr {[string is list $text] && [lsearch -not -regexp $text {^[-+]?((0|[1-9]\d*)(\.\d*)?|\.\d+)([eE][-+]?\d+)?$}] < 0}]
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
        if {[regexp {^~(.*)\.\.(.*)$} $one -> low high]} {
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

# ::sorma::recorded::pattern REPLIES -- one that fits all of them, which are lists of words. Numbers may leave their range by ten times
# its width, to either side. Codes may not.
proc ::sorma::recorded::pattern replies {
    set out {}
    set lengths [lsort -integer -unique [lmap words $replies {llength $words}]]
    for {set i 0} {$i < [lindex $lengths 0]} {incr i} {
        set seen [lsort -unique [lmap words $replies {lindex $words $i}]]
        lappend out [if {[llength $seen] == 1} {
            # Not by expr, which writes inf and 1e-05 in another way.
            string cat [if {[regexp {^[*~=]|^\.\.\.$} [lindex $seen 0]]} {string cat =}] [lindex $seen 0]
        } elseif {[lsearch -not -regexp $seen {^\S+$}] < 0 && [areNumbers $seen]} {
            # A code stays as it was seen: 0, or 1 with a warning, is never an error.
            Range $seen [expr {$i == 1 ? 0 : 10}]
        } else {
            string cat *
        }]
    }
    return [concat $out [if {[llength $lengths] > 1} {list ...}]]
}
proc ::sorma::recorded::Range {numbers wider} {
    set sorted [lsort -real $numbers]
    set low [lindex $sorted 0]
    set high [lindex $sorted end]
    return ~[expr {$low - $wider * ($high - $low)}]..[expr {$high + $wider * ($high - $low)}]
}
