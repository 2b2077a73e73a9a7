# series.tcl -- numbers over time, kept so that millions of them are soon drawn: beside the points, what is lowest and highest in each 8, 64, 512 ...
#
# Numbers are packed, 8 bytes each: an hour at 1 kHz takes 75 MB. NaN, and what is beyond 1e300, is a gap. Times are seconds and do not go back.

package provide sorma::series 1.0

namespace eval ::sorma::series {
    variable Deep 6                 ;# levels above that of the points
}

# ::sorma::series::new -- a command. Its methods:
#       add TIME VALUE              one more point, later than those before
#       size, first, last           how many; {TIME VALUE} of the oldest and of the newest, or empty
#       at TIME                     the newest point that is not later, {TIME VALUE}; empty: there is none
#       points FROM TO              time value time value ..., all in that time
#       drawn FROM TO COLUMNS       as points, with what is just outside; where there are more than two for a column, its lowest and highest,
#                                   in its middle
#       range FROM TO               {LOW HIGH} of the numbers in that time; empty: there are none
#       forget TIME, clear          points before that time, when they are worth it; all. destroy: the series
proc ::sorma::series::new {} {
    return [Series new]
}

if {![info object isa object ::sorma::series::Series]} {oo::class create ::sorma::series::Series}
oo::define ::sorma::series::Series {
    variable times lows highs       ;# arrays: level -> packed numbers. Level 0: the points, in times and lows. Above: what 8 of the level below have
    variable size                   ;# array: level -> how many
    constructor {} {
        my clear
    }
    method clear {} {
        for {set level 0} {$level <= $::sorma::series::Deep} {incr level} {
            set times($level) [set lows($level) [set highs($level) [binary format {}]]]
            set size($level) 0
        }
    }
    method size {} {
        return $size(0)
    }
    method add {time value} {
        append times(0) [binary format q $time]
        append lows(0) [binary format q $value]
        if {[incr size(0)] & 7} return
        my Sum 0
    }
    # Sums up a level in those above.
    method Sum level {
        while {$level < $::sorma::series::Deep} {
            set above [expr {$level + 1}]
            if {8 * $size($above) + 8 > $size($level)} return
            while {[set first [expr {8 * $size($above)}]] + 8 <= $size($level)} {
                lassign [my Extent $level $first [expr {$first + 7}]] low high
                binary scan $times($level) @[expr {8 * $first}]a8 time
                append times($above) $time
                append lows($above) [binary format q $low]
                append highs($above) [binary format q $high]
                incr size($above)
            }
            set level $above
        }
    }
    # Lowest and highest of some of a level; NaN: none of them is a number.
    method Extent {level first last} {
        set numbers [my Numbers $lows($level) $first $last]
        if {$level > 0} {
            lappend numbers {*}[my Numbers $highs($level) $first $last]
        }
        set low [set high NaN]
        foreach v $numbers {
            if {!($v > -1e300 && $v < 1e300)} continue
            if {$low ne "NaN"} {
                if {$v < $low} {set low $v} elseif {$v > $high} {set high $v}
            } else {
                set low [set high $v]
            }
        }
        return [list $low $high]
    }
    method Numbers {packed first last} {
        set n [expr {$last - $first + 1}]
        if {$n < 1} return
        binary scan $packed @[expr {8 * $first}]q$n numbers
        return $numbers
    }
    # The index of the newest point of a level that is not later; -1: there is none.
    method Index {level time} {
        set low -1
        set high $size($level)
        while {$high - $low > 1} {
            set middle [expr {($low + $high) / 2}]
            binary scan $times($level) @[expr {8 * $middle}]q there
            if {$there <= $time} {set low $middle} else {set high $middle}
        }
        return $low
    }
    method Highs {level first last} {
        if {$level == 0} {
            return [my Numbers $lows(0) $first $last]
        }
        return [my Numbers $highs($level) $first $last]
    }
    method Point index {
        if {$index < 0 || $index >= $size(0)} return
        return [list [my Numbers $times(0) $index $index] [my Numbers $lows(0) $index $index]]
    }
    method first {} {
        return [my Point 0]
    }
    method last {} {
        return [my Point [expr {$size(0) - 1}]]
    }
    method at time {
        return [my Point [my Index 0 $time]]
    }
    # Indices of the first and the last point in that time.
    method Within {from to} {
        set first [my Index 0 $from]
        if {$first < 0 || [my Numbers $times(0) $first $first] < $from} {
            incr first
        }
        return [list $first [my Index 0 $to]]
    }
    method points {from to} {
        return [my Flat {*}[my Within $from $to]]
    }
    method Flat {first last} {
        set flat {}
        foreach t [my Numbers $times(0) $first $last] v [my Numbers $lows(0) $first $last] {
            lappend flat $t $v
        }
        return $flat
    }
    # Parts of levels that are these points together, none finer than so many points: level, first and last, as they follow each other.
    method Parts {first last coarse} {
        set before {}
        set after {}
        for {set level 0} {$level < $coarse} {incr level} {
            set up [expr {($first + 7) / 8}]
            set down [expr {($last + 1) / 8 - 1}]
            if {$down < $up} break
            set before [concat $before [list $level $first [expr {8 * $up - 1}]]]
            set after [concat [list $level [expr {8 * $down + 8}] $last] $after]
            set first $up
            set last $down
        }
        return [concat $before [list $level $first $last] $after]
    }
    method drawn {from to columns} {
        lassign [my Within $from $to] first last
        set first [expr {max(0, $first - 1)}]
        set last [expr {min($size(0) - 1, $last + 1)}]
        if {$last - $first < 2 * $columns} {
            return [my Flat $first $last]
        }
        set level 0
        while {(($last - $first) >> 3 * $level) > 8 * $columns && $level < $::sorma::series::Deep} {
            incr level
        }
        # One column after another: {number of it, its time, low, high}.
        set width [expr {($to - $from) / double($columns)}]
        set flat {}
        set now {}
        set end 0
        foreach {level first last} [my Parts $first $last $level] {
            foreach t [my Numbers $times($level) $first $last] l [my Numbers $lows($level) $first $last] h [my Highs $level $first $last] {
                set column [expr {int(floor(($t - $from) / $width))}]
                if {$column ne $now} {
                    if {$now ne {}} {
                        my Column flat end $at $low $high
                    }
                    set now $column
                    set at [expr {$from + ($column + 0.5) * $width}]
                    set low $l
                    set high $h
                } elseif {!($low > -1e300 && $low < 1e300)} {
                    set low $l
                    set high $h
                } else {
                    if {$l < $low} {set low $l}
                    if {$h > $high && $h < 1e300} {set high $h}
                }
            }
        }
        my Column flat end $at $low $high
        return $flat
    }
    # The end that lies nearer to the line so far comes first.
    method Column {flatVar endVar time low high} {
        upvar 1 $flatVar flat $endVar end
        if {$low == $high || $low != $low} {
            lappend flat $time $low
        } elseif {abs($high - $end) < abs($low - $end)} {
            lappend flat $time $high $time $low
        } else {
            lappend flat $time $low $time $high
        }
        set end [lindex $flat end]
    }
    method range {from to} {
        lassign [my Within $from $to] first last
        set all {}
        foreach {level first last} [my Parts $first $last $::sorma::series::Deep] {
            lassign [my Extent $level $first $last] low high
            if {$low == $low} {
                lappend all $low $high
            }
        }
        if {$all ne {}} {
            return [list [tcl::mathfunc::min {*}$all] [tcl::mathfunc::max {*}$all]]
        }
    }
    # It copies what stays, so not for a few points. Levels up to one are cut between its numbers; those above are summed up again.
    method forget time {
        set index [my Index 0 $time]
        if {$index < 64 || 4 * $index < $size(0)} return
        set level $::sorma::series::Deep
        while {8 ** $level > $index} {
            incr level -1
        }
        set gone [expr {$index / 8 ** $level}]
        for {set at $::sorma::series::Deep} {$at > $level} {incr at -1} {
            set times($at) [set lows($at) [set highs($at) [binary format {}]]]
            set size($at) 0
        }
        for {} {$at >= 0} {incr at -1} {
            foreach packed {times lows highs} {
                set ${packed}($at) [string range [set ${packed}($at)] [expr {8 * $gone}] end]
            }
            incr size($at) [expr {-$gone}]
            set gone [expr {8 * $gone}]
        }
        my Sum $level
    }
}
