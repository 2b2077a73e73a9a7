# timelineSearch.tcl -- a text is searched for in the recording of a time line.

package require snit
package require sorma
package require sorma::parts
package require sorma::text
package require sorma::timelineText
package provide sorma::timelineSearch 1.0

# ::sorma::timelineSearch -- methods of the widget for that. It has facts, selected, wanted, state and seeking.
snit::macro ::sorma::timelineSearch {} {
    variable needle {}          ;# text to be searched for
    variable round 0            ;# answers to earlier searches are not wanted

    # The recorder reads a part of the file at a time, so that others get their turns.
    method Seek {} {
        $self search $needle
    }
    method search text {
        if {$text eq {} || [dict get $facts last] <= 0} return
        incr round
        set begin [expr {$selected ne {} ? [lindex $selected 2] + 1 : [::sorma::timelineText::ns [dict get $facts first]]}]
        incr seeking
        $self Slice $round $text $begin
    }
    method Slice {number text begin} {
        set first [::sorma::timelineText::ns [dict get $facts first]]
        set end [expr {[::sorma::timelineText::ns [dict get $facts last]] + 1000}]
        if {$number != $round || $begin > $end} {
            incr seeking -1
            if {$number == $round} {
                $self Put [list plain [::msgcat::mc "That text does not come behind this place."]]
            }
            return
        }
        set part [expr {max(1000000, ($end - $first) / 500)}]
        set state "[::msgcat::mc "searching"] [expr {100 * ($begin - $first) / ($end - $first + 1)}] %"
        set words [list records -text $text -from [::sorma::timelineText::seconds $begin] -until [::sorma::timelineText::seconds [expr {$begin + $part}]]]
        if {$wanted ne {}} {
            lappend words -name *[::sorma::text::escape $wanted]*
        }
        incr asks
        set prefix [list ::sorma::parts::answer [mymethod Answered] [mymethod Sliced $number $text [expr {$begin + $part}]]]
        if {[catch {::sorma::async -timeout 60000 -command $prefix $recorder EXEC {*}$words} message]} {
            $self Failure [mymethod Sliced $number $text 0] $message
        }
    }
    method Sliced {number text next status records} {
        if {$status eq "error"} {
            incr seeking -1
            return [$self Put [list error $records]]
        }
        if {$records eq {} || $number != $round} {
            return [$self Slice $number $text $next]
        }
        incr seeking -1
        set record [lindex $records 0]
        set at [::sorma::timelineText::ns [dict get $record time]]
        $self GoTo [list [dict get $record source] [dict get $record object]] $at
        set selected [list {*}[lrange [lindex $rows $row] 0 1] $at]
        $self Select
        $self Put [::sorma::timelineText::record $record]
        $self Say
    }
}
