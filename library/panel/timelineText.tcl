# timelineText.tcl -- times of a time line, exact to a ns, and what stands below it: a request, its reply and its trail.

package require sorma::chartAxis
package require sorma::style
package require sorma::text
package require sorma::trail
package provide sorma::timelineText 1.0

namespace eval ::sorma::timelineText {}

# ::sorma::timelineText::ns SECONDS -- a text of the recorder as whole ns; seconds NS -- and back.
proc ::sorma::timelineText::ns seconds {
    if {![regexp {^(-?)(\d+)(?:\.(\d{1,9}))?} $seconds -> sign whole part]} {
        return 0
    }
    set ns [expr {[scan $whole %lld] * 1000000000 + [scan [string range ${part}000000000 0 8] %d]}]
    return [expr {$sign eq {} ? $ns : -$ns}]
}
proc ::sorma::timelineText::seconds ns {
    return [expr {$ns < 0 ? "-" : ""}][expr {abs($ns) / 1000000000}].[format %09d [expr {abs($ns) % 1000000000}]]
}

# ::sorma::timelineText::step SPAN MOST -- ns between two marks of the axis, for at most so many in SPAN ns.
proc ::sorma::timelineText::step {span most} {
    set step [expr {$span / 1e9 / $most}]
    if {$step > 0.01} {
        return [expr {round(1e9 * [::sorma::chartAxis::step [expr {$span / 1e9}] $most])}]
    }
    set power [expr {10.0 ** floor(log10(max($step, 1e-9)))}]
    foreach factor {1 2 5 10} {
        if {$factor * $power >= $step * 0.999} break
    }
    return [expr {max(1, round(1e9 * $factor * $power))}]
}

# ::sorma::timelineText::at NS STEP -- the time of the day, with as many digits as marks so far apart need.
proc ::sorma::timelineText::at {ns step} {
    set whole [expr {$ns >= 0 ? $ns / 1000000000 : -((-$ns + 999999999) / 1000000000)}]
    set text [clock format $whole -format [expr {$step >= 86400000000000 ? "%Y-%m-%d" : $step >= 60000000000 ? "%H:%M" : "%H:%M:%S"}]]
    if {$step < 1000000000} {
        set digits [expr {9 - int(floor(log10($step) + 1e-9))}]
        append text .[string range [format %09d [expr {$ns - $whole * 1000000000}]] 0 $digits-1]
    }
    return $text
}

# ::sorma::timelineText::span NS -- how long that is, in a unit that fits.
proc ::sorma::timelineText::span ns {
    foreach {unit size} {d 86400e9 h 3600e9 min 60e9 s 1e9 ms 1e6 µs 1e3 ns 1} {
        if {$ns >= $size} break
    }
    return "[format %.4g [expr {$ns / $size}]] $unit"
}

# ::sorma::timelineText::mark MARK -- what `timeline mark` has answered, for people: a list of TAG and TEXT by turns, in lines. A tag is head,
# plain, typed (it can be typed at a prompt) or error.
proc ::sorma::timelineText::mark mark {
    set records [dict get $mark records]
    set begun [ns [dict get $mark time]]
    set out {}
    if {$records eq {}} {
        return [list error [::msgcat::mc "Its record is not in the file any more, or is broken."]]
    }
    foreach record $records {
        lappend out {*}[Record $record $begun [dict get $mark kind]]
    }
    return $out
}
# ::sorma::timelineText::record RECORD -- the same for one record that was found.
proc ::sorma::timelineText::record record {
    set time [ns [dict get $record time]]
    set out [Record $record $time [dict get $record kind]]
    if {[dict exists $record request]} {
        set out [list head [Head [dict get $record source] [dict get $record object] [::msgcat::mc "request"]] typed [dict get $record request] {*}$out]
    }
    return $out
}
proc ::sorma::timelineText::Head {source object what} {
    return [string trim "$what  $object@$source" "@ "]
}
proc ::sorma::timelineText::Record {record begun kind} {
    dict with record {}
    set at "[clock format [lindex [split $time .] 0] -format %Y-%m-%d] [at [ns $time] 1]"
    switch [dict get $record kind] {
        request {
            set out [list head "$at  [Head $source $object [::msgcat::mc "request"]]  ($word)" typed $text]
            if {$kind eq "open"} {
                lappend out error [::msgcat::mc "Its reply is not in the recording."]
            }
            return $out
        }
        reply {
            set took [span [expr {max(0, [ns $time] - $begun)}]]
            set ran [span [ns $span]]
            return [list head "$at  [expr {$code < 0 ? [::msgcat::mc "error"] : [::msgcat::mc "reply"]}]  [::msgcat::mc "after"] $took, [::msgcat::mc "ran"] $ran" {*}[Reply $text $code]]
        }
        event { return [list head "$at  [Head $source $object [::msgcat::mc "event"]]  $word" plain $text] }
        sample { return [list head "$at  [Head $source $object [::msgcat::mc "record"]]  $number" plain $text] }
        loss { return [list head "$at  [Head $source $object {}]" error "$number [::msgcat::mc "records are missing here"]: $word"] }
        default { return [list head "$at  [Head $source $object {}]  $word" plain $text] }
    }
}
# The trail stands below the reply, a line for each message.
proc ::sorma::timelineText::Reply {text code} {
    set words [if {[string is list $text]} {lrange $text 1 end}]
    set at [lsearch -exact $words TDBX]
    set tag [expr {$code < 0 ? "error" : "typed"}]
    if {$at < 0 || [lindex $words 0] ne "RET"} {
        return [list $tag $text]
    }
    set out [list $tag [lrange $words 0 $at-1]]
    foreach entry [::sorma::trail::fromWord [lindex $words $at+1]] {
        set from [if {[dict exists $entry so]} {::sorma::trail::from $entry}]
        set from [if {$from ne {}} {string cat "  ($from)"}]
        set symbol [if {[dict exists $entry code]} {lrange [dict get $entry code] 0 2}]
        set severity [dict get $entry severity]
        lappend out [expr {$severity eq "error" ? "error" : "plain"}] "$severity $symbol: [dict get $entry text]$from"
    }
    return $out
}
