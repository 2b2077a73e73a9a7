# circuitRun.tcl -- ::sorma::circuitRun: buttons of the circuit editor that run, pause and step the cycle that executes the circuit.
#
# The model tells of cycles at the circuit's daemon. The first one with the circuit among its steps has the buttons.

package require snit
package require sorma::actions
package require sorma::field
package require sorma::parts
package require sorma::style
package require sorma::world
package provide sorma::circuitRun 1.0

snit::macro ::sorma::circuitRun {} {
    variable cycles {}          ;# dict: NAME of a cycle -> {token steps}
    variable cycle {}           ;# the one that has buttons
    variable cycleWatch {}      ;# token of the model
    variable cycleStats {}      ;# token of its figures
    variable cycleText {}       ;# what stands beside the buttons

    # cycle -- the name of the cycle that executes the circuit, or nothing.
    method cycle {} {
        return $cycle
    }
    method StartCycles {} {
        if {$cycleWatch eq {} && $options(-state) eq "normal"} {
            set cycleWatch [::sorma::world watch *@* -events {object.made object.removed} -command [list ::sorma::parts::answer [mymethod CycleThere]]]
        }
    }
    method StopCycles {} {
        $self StopStats
        if {$cycleWatch eq {}} return
        ::sorma::world unwatch $cycleWatch
        set cycleWatch {}
        dict for {name known} $cycles {
            ::sorma::world unwatch [dict get $known token]
        }
        set cycles {}
    }
    method CycleThere {event key about} {
        lassign [split $key @] - where
        if {[dict get $about class] ne "cycle" || $where ne [::sorma::world use [lindex [::sorma::table locate [$subject name]] 1]]} return
        set name [::sorma::world shown $key]
        if {$event eq "object.made" && ![dict exists $cycles $name]} {
            dict set cycles $name [dict create steps {} token [::sorma::world value $name -steps -command [list ::sorma::parts::answer [mymethod CycleSteps]]]]
        } elseif {$event eq "object.removed" && [dict exists $cycles $name]} {
            ::sorma::world unwatch [dict get $cycles $name token]
            dict unset cycles $name
            $self CycleButtons
        }
    }
    method CycleSteps {what key values} {
        set name [::sorma::world shown $key]
        set known [lindex $values 1]
        if {[dict exists $cycles $name] && [dict exists $known value]} {
            dict set cycles $name steps [dict get $known value]
            $self CycleButtons
        }
    }
    method CycleButtons {} {
        set mine [$self NameThere]
        set found [lindex [lmap {name known} $cycles {
            if {[catch {lmap step [dict get $known steps] {lindex $step 0}} steps] || $mine ni $steps} continue
            set name
        }] 0]
        if {$found eq $cycle} return
        set cycle $found
        set frame $win.head.run
        $self StopStats
        destroy $frame
        if {$cycle eq {}} return
        ::ttk::frame $frame
        foreach {name text danger request help} {
            run Run move {CTRL -start} "starts %s; needs the right operate"
            pause Pause {} {CTRL -stop} "stops %s after the present tick"
            step Step move EXEC "one tick of %s, while it is stopped; needs the right operate"
        } {
            ::sorma::button $frame.$name -name $cycle -request $request -text [::msgcat::mc $text][::sorma::actions mark $danger] -command [mymethod CycleRan]
            ::sorma::style tip $frame.$name [format [::msgcat::mc $help] $cycle]
            pack $frame.$name -side left
        }
        ::ttk::label $frame.stats -textvariable [myvar cycleText]
        pack $frame.stats -side left
        grid $frame -row 3 -column 0 -columnspan 3 -sticky w
        set cycleStats [::sorma::world value $cycle {DBX -stats} -every 500 -command [list ::sorma::parts::answer [mymethod CycleStats]]]
    }
    method StopStats {} {
        if {$cycleStats ne {}} {
            ::sorma::world unwatch $cycleStats
            set cycleStats [set cycleText {}]
        }
    }
    # Ticks that go on say that it runs. A fault has its mark.
    method CycleStats {what key values} {
        set known [lindex $values 1]
        set text [if {[dict exists $known value text]} {dict get $known value text}]
        set state [dict get $known state]
        set cycleText $cycle
        if {$state in {stale gone refused}} {
            set cycleText "[::sorma::style mark $state] $cycle: [dict get $known why]"
        } elseif {[regexp {^ticks (\d+) .*?faults (\d+)} $text -> ticks faults]} {
            set cycleText "[if {$faults > 0} {string cat [::sorma::style mark refused] " "}]$cycle: ticks $ticks, faults $faults"
        }
        if {[winfo exists $win.head.run.stats]} {
            $win.head.run.stats configure -foreground [::sorma::style colour [expr {[string match "$cycle*" $cycleText] ? "live" : "refused"}]]
        }
    }
    method CycleRan {status value} {
        set hint [if {$status ne "ok"} {string cat "[::sorma::style mark refused] " [lindex $value 0]}]
    }
}
