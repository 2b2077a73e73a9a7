# moment.tcl -- moments as people write them.

package provide sorma::moment 1.0

namespace eval ::sorma::moment {}

# ::sorma::moment::parse WHAT TEXT -- seconds since 1970. The text is such a number, or a time of the day with fractions, perhaps behind a day.
# All digits are kept. The error names WHAT.
proc ::sorma::moment::parse {what text} {
    if {[string is double -strict $text]} {
        return $text
    }
    if {![regexp {^(.*\d)(\.\d+)$} $text -> whole fraction]} {
        set whole $text
        set fraction {}
    }
    # To clock, a single letter is a time, too.
    if {[regexp {^[[:alpha:]]?$} $whole] || [catch {clock scan $whole} seconds] || ![Is $whole]} {
        return -code error -errorcode {SORMA REQUEST SYNTAX} "$what expects a time, as 12:03:04.125 or {2026-05-01 12:03:04}, got \"$text\""
    }
    return $seconds$fraction
}
# Clock makes another time of 25:00, and another day of 2026-02-30.
proc ::sorma::moment::Is text {
    if {[regexp {(\d+):(\d\d)(?::(\d\d))?} $text - hours minutes seconds] && ([scan $hours %d] > 23 || [scan $minutes %d] > 59 || [scan 0$seconds %d] > 60)} {
        return 0
    }
    return [expr {![regexp {\d{4}-\d\d-\d\d} $text day] || [clock format [clock scan $day -format %Y-%m-%d] -format %Y-%m-%d] eq $day}]
}
