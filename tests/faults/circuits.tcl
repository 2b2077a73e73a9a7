# circuits.tcl ?edits? ?seconds? ?parts? ?seed? -- figures of the circuit editor, on an X server of its own. Parts: a list of tracker, values,
# large and random; default: all.
#
# It measures processor time with 200 wires that change, and a click while the daemon is stopped. So many random edits and undos change a circuit
# that runs at 1 kHz. Beside another circuit at 1 kHz, that is not edited, the same edits change a circuit of a second daemon: the window takes as
# much of the machine then. Large circuits are opened, moved and edited, too.
#
# Printed with their targets, not judged, for the machine has its part in them: times. Ticks count as late when the next one was due, or a
# request has delayed them. Promised: what random edits leave. The circuit is then what its recipe says, and undo gives the first recipe.

source [file join [file dirname [file dirname [file normalize [info script]]]] support display.tcl]
display::run [info script] $argv
source [file join [file dirname [file normalize [info script]]] faults.tcl]
if {$display::Missing ne {}} {
    puts stderr "circuits.tcl: $display::Missing"
    exit 1
}
package require sorma::circuitEditor

set classes {foreach class {circuit units cycle} {package require sorma::service::$class}}
proc figure {what value target} { puts [format "%-72s %-12s target %s" $what $value $target] }

# Processor time of this process [ms].
proc spent {} {
    set f [open /proc/self/stat]
    set words [regsub {^.*\) } [read $f] {}]
    close $f
    return [expr {10 * ([lindex $words 11] + [lindex $words 12])}]
}
proc pass ms {
    after $ms {set ::passed 1}
    vwait ::passed
}
# An editor in .t; the time until its picture stands there [ms].
proc opened {name args} {
    set start [clock microseconds]
    toplevel .t
    wm geometry .t 1200x900+0+0
    pack [sorma::circuitEditor .t.w $name {*}$args] -fill both -expand 1
    waitFor {[.t.w known] && [dict size [dict get [.t.w graph] nodes]] > 0 && [winfo viewable .t.w.panes.picture.scene]}
    update
    winfo pointerx .t
    return [expr {([clock microseconds] - $start) / 1000}]
}
proc closed {} {
    destroy .t
    update
}
proc settled {} { waitFor {[.t.w sent] && "sending" ni [lmap option {-wires -places} {dict get [[.t.w subject] get $option] state}]} }

# 100 units and 200 wires in ten rows, all of whose values change in each tick.
proc hundred d {
    set wires {}
    set places {}
    for {set i 0} {$i < 100} {incr i} {
        set from [expr {$i % 10 == 0 ? "wave" : "sum.[expr {$i - 1}].out"}]
        append wires "$from -> sum.$i.in1\n[expr {$i < 10 ? "wave" : "sum.[expr {$i - 10}].out"}] -> sum.$i.in2\n"
        append places "unit sum.$i [expr {20 + 20 * ($i % 10)}] [expr {12 * ($i / 10)}]\n"
    }
    circuit.hundred@$d CTRL -wires [string map {"wave ->" "sine.w.out ->"} $wires] -places "${places}unit sine.w 0 0"
    cycle.hundred@$d CTRL -period 0.001 -steps circuit.hundred -priority 0 -lockMemory 0 -start
}
proc values d {
    global seconds
    hundred $d
    opened circuit.hundred@$d -every 100
    .t.w scene zoom [expr {0.5 / [.t.w scene zoom]}]
    .t.w scene centre {unit sum.55}
    pass 1000
    foreach {rates what} {0 {} 1 { and rates}} {
        .t.w configure -rates $rates
        pass 1500
        set before [.t.w value 100]
        set start [spent]
        pass [expr {1000 * $seconds}]
        figure "200 wires, 100 units, values$what at 10 Hz: processor time of the window" \
            [format "%.1f %%" [expr {([spent] - $start) / (10.0 * $seconds)}]] "< 10 %"
        promise "the values change" [expr {[.t.w value 100] ne $before}]
    }
    set pid [daemon info $d pid]
    exec kill -STOP $pid
    set times {}
    try {
        pass 500
        foreach key {{unit sum.55} {unit sum.45} {unit sum.56} {unit sum.66}} {
            lassign [.t.w box $key] x y width
            lassign [.t.w scene pixel [expr {$x + $width / 2.0}] [expr {$y + 1.5}]] x y
            set start [clock microseconds]
            event generate .t.w.panes.picture.scene <ButtonPress-1> -x $x -y $y
            event generate .t.w.panes.picture.scene <ButtonRelease-1> -x $x -y $y
            update
            winfo pointerx .t
            lappend times [expr {([clock microseconds] - $start) / 1000}]
            promise "the box is selected while the daemon is stopped" [expr {[lindex [.t.w selection] 0] eq [list $key]}]
        }
    } finally {
        exec kill -CONT $pid
    }
    figure "a click while the daemon is stopped, longest of four" "[tcl::mathfunc::max {*}$times] ms" "< 100 ms"
    closed
    cycle.hundred@$d CTRL -stop
}

# Ticks that were late in a run: {ticks skipped delayed}; those that a request has delayed. The script runs meanwhile.
proc lateIn {d script} {
    cycle.edited@$d CTRL -start
    uplevel 1 $script
    set text [lindex [cycle.edited@$d DBX -stats] 3]
    regexp {ticks (\d+) skipped (\d+) .*faults (\d+) .*delayed (\d+)} $text -> ticks skipped faults delayed
    promise "no tick has failed" [expr {$faults == 0}]
    cycle.edited@$d CTRL -stop
    return [list $ticks $skipped $delayed]
}
proc edit i {
    set nodes [dict keys [dict get [.t.w graph] nodes]]
    set key [lindex $nodes [expr {int(rand() * [llength $nodes])}]]
    # Edits that do not fit are refused; that is one of the cases.
    catch {
        switch [expr {int(rand() * 9)}] {
            0 { .t.w connect [expr {[lindex $key 0] eq "unit" ? "[lindex $key 1].out" : [lindex $key 1]}] free[expr {$i % 50}] }
            1 { .t.w delete {} [expr {int(rand() * [llength [dict get [.t.w graph] wires]])}] }
            2 { if {[llength $nodes] > 6} {.t.w delete [list $key] {}} }
            3 { .t.w move [list $key] [expr {int(rand() * 9) - 4}] [expr {int(rand() * 9) - 4}] }
            4 { .t.w redo }
            5 { if {[.t.w drafts] ne {}} {.t.w undo} }
            default { .t.w undo }
        }
    }
}
proc random {d count seed} {
    set first {
    2                  -> sum.error.in1
    integrator.arm.out -> sum.error.in2      # where it is
    sum.error.out      -> gain.p.in
    gain.p.out         -> integrator.arm.in
    integrator.arm.out -> position
}
    cycle.edited@$d CTRL -period 0.001 -afterFault continue -steps circuit.edited -priority 0 -lockMemory 0
    set other [serve $::classes]
    set edits {
        expr {srand($seed)}
        for {set i 0} {$i < $count} {incr i} {
            edit $i
            update
        }
        settled
    }
    circuit.edited@$d CTRL -wires $first
    foreach place [list $other $d] {
        circuit.edited@$place CTRL -wires $first
        opened circuit.edited@$place
        set start [clock milliseconds]
        set late($place) [lateIn $d $edits]
        set took [expr {([clock milliseconds] - $start) / 1000}]
        if {$place eq $other} closed
    }
    puts "$count random edits and undos at 1 kHz in $took s, seed $seed"
    foreach {what place} [list "with edits" $d "with the same edits elsewhere" $other] {
        lassign $late($place) ticks skipped delayed
        figure "late ticks $what, of $ticks" [format "%.2f %%" [expr {100.0 * ($skipped + $delayed) / $ticks}]] "not more with edits"
        figure "    of these, delayed by a request" $delayed none
    }
    circuit.fresh@$d CTRL -wires [circuit.edited@$d cget -wires] -inputs [circuit.edited@$d cget -inputs] -outputs [circuit.edited@$d cget -outputs]
    promise "the circuit is what a fresh one of its recipe is" \
        [expr {[circuit.fresh@$d DBX -wires] eq [circuit.edited@$d DBX -wires] && [circuit.fresh@$d DBX -order] eq [circuit.edited@$d DBX -order]}]
    .t.w return 0
    settled
    promise "undo to the beginning gives the first recipe" [expr {[circuit.edited@$d cget -wires] eq $first && [circuit.edited@$d cget -places] eq {}
        && [circuit.edited@$d cget -inputs] eq {} && [circuit.edited@$d cget -outputs] eq {}}]
    if {$::failures > 0} {
        puts "left: [llength [.t.w history]] edits, drafts [.t.w drafts]; [.t.w said]\n[circuit.edited@$d cget -wires]\n[circuit.edited@$d cget -inputs]\n[circuit.edited@$d cget -outputs]"
    }
    closed
}

proc large {d count} {
    set wires "target -> sum.0.in1; 0 -> sum.0.in2; sum.0.out -> sum.1.in1; 0 -> sum.1.in2"
    for {set i 2} {$i < $count} {incr i} {
        append wires "\nsum.[expr {$i - 1}].out -> sum.$i.in1\nsum.[expr {$i - 2}].out -> sum.$i.in2"
    }
    circuit.large@$d CTRL -wires $wires
    set start [spent]
    set time [opened circuit.large@$d]
    figure "a circuit of $count units is opened" "$time ms" [expr {$count == 1000 ? "< 2 s" : "none"}]
    figure "    processor time of that" "[expr {[spent] - $start}] ms" none
    # 30 steps of a pan, zoomed in so that values are written.
    .t.w scene zoom [expr {1.0 / [.t.w scene zoom]}]
    .t.w scene centre "unit sum.[expr {$count / 2}]"
    pass 500
    set times {}
    set begun [spent]
    for {set i 0} {$i < 30} {incr i} {
        set start [clock microseconds]
        .t.w scene follow 7 3
        update
        winfo pointerx .t
        lappend times [expr {[clock microseconds] - $start}]
    }
    figure "    panning, median of 30" [format "%.0f Hz" [expr {1e6 / [quantile $times 0.5]}]] "30 Hz"
    figure "    processor time of a step" [format "%.1f ms" [expr {([spent] - $begun) / 30.0}]] "< 33 ms"
    set start [clock microseconds]
    set begun [spent]
    .t.w move {{unit sum.5}} 0 3
    update
    figure "    the first edit" "[expr {([clock microseconds] - $start) / 1000}] ms" [expr {$count > 1000 ? "about 1 s" : "none"}]
    figure "    processor time of that" "[expr {[spent] - $begun}] ms" none
    settled
    closed
    sorm@$d CTRL -remove circuit.large
}

# The tracker's circuit, with all its units, at a daemon of its own. It does not run: nothing moves.
proc tracker {} {
    set file [file join [file dirname [file dirname [file dirname [file normalize [info script]]]]] demos tracker tracker.dict]
    set d [serve {foreach class {robot shmem clock circuit units track} {catch {package require sorma::service::$class}}} \
        [list sorma::so::dict CTRL -load $file]]
    if {[catch {circuit.tracker@$d DBX -wires} message]} {
        puts "the tracker's circuit is not there: [lindex [split $message \n] 0]"
        return
    }
    set times [lmap n {1 2 3} {
        set time [opened circuit.tracker@$d]
        closed
        set time
    }]
    figure "the tracker's circuit is opened, median of three" "[quantile $times 0.5] ms" "< 0.3 s"
}

attack {
    set edits [expr {$argc > 0 ? [lindex $argv 0] : 10000}]
    set seconds [expr {$argc > 1 ? [lindex $argv 1] : 10}]
    set parts [expr {$argc > 2 ? [lindex $argv 2] : "tracker values large random"}]
    set seed [expr {$argc > 3 ? [lindex $argv 3] : [clock seconds] % 100000}]
    set d [serve $classes]
    foreach part $parts {
        switch $part {
            tracker { tracker }
            values { values $d }
            large { foreach count {1000 10000} {large $d $count} }
            random { random $d $edits $seed }
            default { error "no part $part: must be tracker, values, large, or random" }
        }
    }
}
