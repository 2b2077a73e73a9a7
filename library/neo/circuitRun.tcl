# circuitRun.tcl -- ::sorma::circuitRun: buttons of the circuit editor that run, pause and step the cycle that executes the circuit.
#
# The model tells of cycles at the circuit's daemon. The first one with the circuit among its steps has the buttons. Its clock may be the lab time
# of an object of class simlab. Then the buttons act on lab time: it goes on, stands, or goes on until the next tick.

package require snit
package require sorma::actions
package require sorma::field
package require sorma::parts
package require sorma::style
package require sorma::world
package provide sorma::circuitRun 1.0

snit::macro ::sorma::circuitRun {} {
    variable cycles {}          ;# dict: NAME of a cycle -> {tokens values}; values: dict of its options -steps, -clock, -watchdog
    variable labs {}            ;# dict: NAME of a simlab -> {tokens values}; values: dict of its option -prefix
    variable cycle {}           ;# the one that has buttons
    variable lab {}             ;# the laboratory whose time is its clock, or nothing
    variable stepping 0         ;# is a step under way
    variable cycleWatch {}      ;# token of the model
    variable cycleStats {}      ;# token of its figures
    variable cycleText {}       ;# what stands beside the buttons

    # cycle -- the name of the cycle that executes the circuit, or nothing.
    method cycle {} {
        return $cycle
    }
    # laboratory -- the simlab whose time is the clock of that cycle, or nothing.
    method laboratory {} {
        return $lab
    }
    # run, pause, step -- what the buttons do; nothing without a cycle.
    method run {} { $self PressRun run }
    method pause {} { $self PressRun pause }
    method step {} { $self PressRun step }
    method PressRun which {
        if {[winfo exists $win.head.run.$which]} {
            $win.head.run.$which invoke
        } else {
            set hint "[::sorma::style mark refused] $which: no cycle at this daemon has the circuit among its steps"
        }
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
        foreach kind {cycles labs} {
            foreach name [dict keys [set $kind]] {
                $self ForgetRuns $kind $name
            }
        }
    }
    method CycleThere {event key about} {
        lassign [split $key @] - where
        set class [dict get $about class]
        if {$class eq "simlab"} {
            lassign {labs -prefix} kind asked
        } elseif {$class eq "cycle" && $where eq [::sorma::world use [lindex [::sorma::table locate [$subject name]] 1]]} {
            lassign {cycles {-steps -clock -watchdog}} kind asked
        } else return
        set name [::sorma::world shown $key]
        if {$event eq "object.made" && ![dict exists [set $kind] $name]} {
            dict set $kind $name {tokens {} values {}}
            dict set $kind $name tokens [lmap option $asked {
                ::sorma::world value $name $option -command [list ::sorma::parts::answer [mymethod RunValue $kind $option]]
            }]
        } elseif {$event eq "object.removed" && [dict exists [set $kind] $name]} {
            $self ForgetRuns $kind $name
            $self CycleButtons
        }
    }
    method ForgetRuns {kind name} {
        foreach token [dict get [set $kind] $name tokens] {
            ::sorma::world unwatch $token
        }
        dict unset $kind $name
    }
    method RunValue {kind option what key values} {
        set name [::sorma::world shown $key]
        set known [lindex $values 1]
        if {[dict exists [set $kind] $name] && [dict exists $known value]} {
            dict set $kind $name values $option [dict get $known value]
            $self CycleButtons
        }
    }
    # The cycle that has the circuit among its steps, and the laboratory whose time is its clock.
    method FindCycle {} {
        set mine [$self NameThere]
        dict for {name known} $cycles {
            set values [dict get $known values]
            if {![dict exists $values -steps] || [catch {lmap step [dict get $values -steps] {lindex $step 0}} steps] || $mine ni $steps} continue
            set clock [if {[dict exists $values -clock]} {dict get $values -clock}]
            return [list $name [lindex [lmap {other about} $labs {
                if {$clock eq {} || ![dict exists $about values -prefix] || "[dict get $about values -prefix]lab.clock" ne $clock} continue
                set other
            }] 0]]
        }
    }
    method CycleButtons {} {
        lassign [$self FindCycle] found time
        if {$found eq $cycle && $time eq $lab} return
        set cycle $found
        set lab $time
        set frame $win.head.run
        $self StopStats
        destroy $frame
        if {$cycle eq {}} return
        ::ttk::frame $frame
        foreach {name text danger request help labHelp} {
            run Run move {CTRL -start} "starts %s; needs the right operate" "starts %s, and lab time of %s goes on; needs the right operate"
            pause Pause {} {CTRL -stop} "stops %s after the present tick" "lab time stands: stops %s, and pauses %s"
            step Step move EXEC "one tick of %s, while it is stopped; needs the right operate (s)"
                "lab time goes on until the next tick of %s, and %s is paused; needs the right operate (s)"
        } {
            if {$lab eq {}} {
                set words [list -name $cycle -request $request -command [mymethod [dict get {run CycleRan pause CycleRan step Stepped} $name]]]
            } else {
                set words [list -name $lab -request [list CTRL -paused [expr {$name ne "run"}]] -command [mymethod [dict get {run RanLab pause PausedLab step StepLab} $name]]]
            }
            ::sorma::button $frame.$name {*}$words -text [::msgcat::mc $text][::sorma::actions mark $danger]
            ::sorma::style tip $frame.$name [if {$lab eq {}} {format [::msgcat::mc $help] $cycle} else {format [::msgcat::mc $labHelp] $cycle $lab}]
            pack $frame.$name -side left
        }
        ::ttk::label $frame.stats -textvariable [myvar cycleText]
        bind $frame.stats <Configure> {%W configure -wraplength %w}
        pack $frame.stats -side left -fill x -expand 1
        grid $frame -row 3 -column 0 -columnspan 3 -sticky ew
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
            set cycleText "[if {$faults > 0} {string cat [::sorma::style mark [set state refused]] " "}]$cycle: ticks $ticks, faults $faults"
        }
        if {[winfo exists $win.head.run.stats]} {
            $win.head.run.stats configure -foreground [::sorma::style colour $state]
        }
    }
    method CycleRan {status value} {
        set hint [if {$status ne "ok"} {string cat "[::sorma::style mark refused] " [lindex $value 0]}]
        return [expr {$status eq "ok"}]
    }
    # Ask the process of the cycle, or of the laboratory. NAME is as it is shown here.
    method AskRun {name request prefix} {
        lassign [::sorma::table locate $name] there where
        $self AskAt $where [list $there {*}$request] $prefix
    }

    # ---- lab time ----

    method RanLab {status value} {
        if {[$self CycleRan $status $value]} {
            $self AskRun $cycle {CTRL -start} [mymethod CycleStarted]
        }
    }
    method CycleStarted {status value} {
        if {$status eq "ok" || [lrange [lindex $value 1] 0 2] ne {SORMA CYCLE RUNNING}} {
            $self CycleRan $status $value
        }
    }
    # A cycle with option -watchdog, as that of pino, waits for lab time: to stop it would stop the arm, too. The laboratory tells it that time is paused.
    # Without that option, a machine that is busy for ten periods would be a fault meanwhile.
    method PausedLab {status value} {
        if {[$self CycleRan $status $value] && ![$self Waits]} {
            $self AskRun $cycle {CTRL -stop} [mymethod CycleStopped]
        }
    }
    method Waits {} {
        return [expr {[dict exists $cycles $cycle values -watchdog] && [dict get $cycles $cycle values -watchdog] > 0}]
    }
    method CycleStopped {status value} {
        if {$status eq "ok" || [lrange [lindex $value 1] 0 2] ne {SORMA CYCLE STOPPED}} {
            $self CycleRan $status $value
        }
    }
    # A step: lab time stands, goes on until the next tick is due, and that tick is made. A cycle that runs makes it by itself.
    method StepLab {status value} {
        if {[$self CycleRan $status $value] && !$stepping} {
            set stepping 1
            $self AskRun $cycle {DBX -due} [mymethod StepDue]
        }
    }
    method StepDue {status value} {
        if {![$self StepGoesOn $status $value]} return
        lassign [dict get $value floats] due now
        set runs [lindex [dict get $value ints] 0]
        $self AskRun $lab [list EXEC FMSG 1 [expr {max(1e-6, $due - $now)}]] [mymethod StepPassed $runs]
    }
    method StepPassed {runs status value} {
        if {![$self StepGoesOn $status $value]} return
        set hint [format "lab time %.6g s" [lindex [dict get $value floats] 0]]
        if {$runs} {
            $self StepEnds
        } else {
            $self AskRun $cycle EXEC [mymethod StepTicked]
        }
    }
    method StepTicked {status value} {
        if {[$self StepGoesOn $status $value]} {
            $self StepEnds
        }
    }
    method StepGoesOn {status value} {
        if {$status ne "ok"} {
            set stepping 0
            $self CycleRan $status $value
        }
        return [expr {$status eq "ok"}]
    }
    method StepEnds {} {
        set stepping 0
        $self LookNow
    }
    method Stepped {status value} {
        if {[$self CycleRan $status $value]} {
            set hint "tick [lindex [dict get $value ints] 0], by hand"          ;# values need not change
            $self LookNow
        }
    }
    # The values after a step, without waiting for the next time at which the model asks for them.
    method LookNow {} {
        $self AskThere [list [$self NameThere] DBX -live] [mymethod SeenNow]
    }
    method SeenNow {status value} {
        if {$status eq "ok" && [dict exists $value text]} {
            $self NewValues [dict get $value text]
            $self Values
        }
    }
}
