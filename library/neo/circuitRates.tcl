# circuitRates.tcl -- ::sorma::circuitRates: how often the wires of a circuit get new values, in the circuit editor.
#
# The rate of a wire is that of its unit: how often it is executed in a second of the clock there. Behind a unit that fails it is 0.
# The same counts tell which unit fails: the first one, in the order of execution, that has missed a tick. Those behind it have old inputs.

package require snit
package require sorma::circuitText
package require sorma::parts
package require sorma::world
package provide sorma::circuitRates 1.0

snit::macro ::sorma::circuitRates {} {
    option -rates -default 0 -configuremethod SetRates -type snit::boolean
    variable rateToken {}       ;# of the model
    variable tickCounts {}      ;# the last answer: dict: name of a unit -> times executed; {} -> {ticks seconds} of the circuit
    variable ill {}             ;# dict: name of a unit -> refused, if it has failed in the last ticks; stale, if it was not executed for that
    variable rates {}           ;# dict: name of a unit -> Hz; {}: of the circuit

    method StartRates {} {
        if {$rateToken eq {}} {
            set rateToken [$subject value {DBX -ticks} 1000 [list ::sorma::parts::answer [mymethod Ticked]]]
        }
    }
    method StopRates {} {
        if {$rateToken ne {}} {
            ::sorma::world unwatch $rateToken
        }
        set rateToken [set tickCounts [set rates [set ill {}]]]
    }
    method Ticked {what name values} {
        set known [lindex $values 1]
        if {[dict get $known state] in {stale gone refused} || ![dict exists $known value text]} {
            set tickCounts [set rates {}]
            return
        }
        set lines [lassign [split [dict get $known value text] \n] first]
        set now [dict create {} [lrange $first 1 2]]
        foreach line $lines {
            dict set now [lindex $line 0] [lindex $line 1]
        }
        if {$now ne $tickCounts} {
            $self ReadRates $now
            $self Values
        }
    }
    # From one answer to the next. After an edit the counts begin again.
    method ReadRates now {
        set before $tickCounts
        set tickCounts $now
        lassign [if {[dict exists $before {}]} {dict get $before {}}] begun since
        lassign [dict get $now {}] more time
        if {$begun eq {} || $more < $begun || $time <= $since} {
            return [$self Illness {}]
        }
        set rates [dict create {} [expr {($more - $begun) / ($time - $since)}]]
        dict for {unit count} [dict remove $now {}] {
            if {[dict exists $before $unit] && $count >= [dict get $before $unit]} {
                dict set rates $unit [expr {($count - [dict get $before $unit]) / ($time - $since)}]
            }
        }
        $self ReadIllness $before $now
    }
    # Without ticks, what is known stays: a cycle ends with its fault.
    method ReadIllness {before now} {
        set ticks [expr {[lindex [dict get $now {}] 0] - [lindex [dict get $before {}] 0]}]
        if {$ticks == 0} return
        set found {}
        dict for {unit count} [dict remove $now {}] {
            if {[dict exists $before $unit] && $count - [dict get $before $unit] < $ticks} {
                dict set found $unit [expr {$found eq {} ? "refused" : "stale"}]
            }
        }
        $self Illness $found
    }
    method Illness found {
        if {$found ne $ill} {
            set ill $found
            $self Show
        }
    }
    # {STATE WHY} of a unit that fails, or has old inputs; nothing of others.
    method illness name {
        set state [if {[dict exists $ill [::sorma::circuitText object $name]]} {dict get $ill [::sorma::circuitText object $name]}]
        return [if {$state ne {}} {list $state [dict get {refused "it fails" stale "its inputs are old: a unit before it fails"} $state]}]
    }
    # rate NUMBER -- of that wire, in Hz; nothing for constants, and while it is not known.
    method rate number {
        lassign [lindex [dict get $graph wires] $number 1] object pin
        set unit [if {$object ne {}} {::sorma::circuitText object $object}]
        return [if {$pin ne {} && [dict exists $rates $unit]} {dict get $rates $unit}]
    }
    # The same as it stands on the wire.
    method RateText number {
        set rate [$self rate $number]
        return [if {$rate ne {}} {format "%.3g Hz" $rate}]
    }
    method SetRates {option value} {
        set options($option) $value
        if {$scene ne {}} {
            $self Values
        }
    }
    method FlipRates {} {
        $self configure -rates [expr {!$options(-rates)}]
    }
}
