# replayUnits.tcl -- sorma-replay -as-test: how far numbers of a suite may be off, by their units.
#
# Numbers with a unit are those of options of type double or vector that DBX -get answers, and the floats of EXEC. A suite that was made on one
# machine so holds on another, whose last digits differ. All else is exact.

package require sorma
package require sorma::line
package require sorma::recorded
package provide sorma::replayUnits 1.0

namespace eval ::sorma::replayUnits {
    # A number may be off by this part of it, or by that of its unit, whichever is more.
    variable Relative 1e-6
    # Units that are not of this list may be off by a millionth of the unit. So may their parts; but mm, ms, mV and such by a thousandth. A compound one is
    # as its first unit.
    variable Absolute {1 1e-9   % 1e-6   deg 1e-4   pixels 1e-3   K 1e-3   degC 1e-3   Pa 1e-3}
    # What is counted is exact.
    variable Counted {B byte bytes MB words messages records requests items nodes children values steps}
}

# ::sorma::replayUnits::tolerance UNIT -- the absolute one of a unit, as it stands in a table of options.
proc ::sorma::replayUnits::tolerance unit {
    variable Absolute
    variable Counted
    regexp {^[^\s/,^*]*} $unit first
    if {$first in $Counted} {
        return 0
    } elseif {[dict exists $Absolute $first]} {
        return [dict get $Absolute $first]
    }
    return [expr {[regexp {^[munp\u00b5][A-Za-z]+$} $first] && $first ni {min mol} ? 1e-3 : 1e-6}]
}

# ::sorma::replayUnits::of DAEMON OBJECT -- the units of an object's numbers: dict of options, and of EXEC, -> unit. A number without one has the unit 1.
# Empty: the daemon has no such class now.
proc ::sorma::replayUnits::of {daemon object} {
    set units {}
    if {[catch {lindex [sorm@$daemon DBX -describe $object] 3} table]} {
        return
    }
    foreach row [dict get $table options] {
        lassign $row option type unit
        if {$type in {double vector}} {
            dict set units $option [Or1 $unit]
        }
    }
    foreach row [dict get $table writes] {
        lassign $row kind - - unit help
        if {$kind eq "floats"} {
            dict set units EXEC [Or1 [expr {$unit ne {} ? $unit : [Told $help]}]]
        }
    }
    return $units
}
proc ::sorma::replayUnits::Or1 unit {
    # Floats of several units: none of them holds for all.
    return [expr {$unit eq {} || [string first , $unit] >= 0 ? "1" : $unit}]
}
# The unit that a text has in brackets, if it is the only one.
proc ::sorma::replayUnits::Told help {
    set found [lsort -unique [lmap {- unit} [regexp -all -inline {\[([^]]+)\]} $help] {set unit}]]
    return [expr {[llength $found] == 1 ? [lindex $found 0] : {}}]
}

# ::sorma::replayUnits::put UNITS REQUEST PATTERN TOLERANCES -- the pattern with units: ~0.25:m/s. A range becomes as wide as its unit allows, at least.
# TOLERANCES: as ::sorma::recorded::tolerances has them.
proc ::sorma::replayUnits::put {units request pattern tolerances} {
    set words [::sorma::line::words [::sorma::recorded::renamed $request]]
    lassign $words - method what option
    if {$method eq "EXEC" && [dict exists $units EXEC]} {
        set unit [dict get $units EXEC]
        set at [lsearch -exact $pattern FMSG]
        # Behind the number of floats.
        set first [expr {$at < 0 ? [llength $pattern] : $at + 2}]
    } elseif {$method eq "DBX" && $what eq "-get" && [dict exists $units $option]} {
        set unit [dict get $units $option]
        set first [expr {[lindex $pattern 2] eq "TMSG" ? 3 : [llength $pattern]}]
    } else {
        return $pattern
    }
    set last [expr {$method eq "DBX" ? $first : [string is integer -strict [lindex $pattern $first-1]] ? $first + [lindex $pattern $first-1] - 1 : $first - 1}]
    for {set i $first} {$i <= $last && $i < [llength $pattern]} {incr i} {
        lset pattern $i [Word [lindex $pattern $i] $unit $tolerances]
    }
    return $pattern
}
proc ::sorma::replayUnits::Word {word unit tolerances} {
    if {[regexp {^~([^~].*)\.\.(.*)$} $word -> low high]} {
        set off [::sorma::recorded::off $unit [expr {max(abs($low), abs($high))}] $tolerances]
        set middle [expr {($low + $high) / 2}]
        return ~[expr {min($low, $middle - $off)}]..[expr {max($high, $middle + $off)}]
    }
    # A whole number without a unit is perhaps a count.
    if {$word eq {} || ![::sorma::recorded::areNumbers $word] || ($unit eq "1" && [lsearch -not -regexp $word {^[-+]?\d+$}] < 0)} {
        return $word
    }
    return ~$word:$unit
}

# ::sorma::replayUnits::chosen GIVEN UNITS -- the tolerances of a suite: dict of relative, and of these units. GIVEN: those of -tolerance.
proc ::sorma::replayUnits::chosen {given units} {
    variable Relative
    set all [dict create relative $Relative]
    foreach unit [lsort -unique $units] {
        dict set all $unit [tolerance $unit]
    }
    return [dict merge $all $given]
}
