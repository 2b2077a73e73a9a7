# circuits.tcl ?edits? ?seconds? ?parts? ?seed? -- figures of the circuit editor, on an X server of its own. Parts: a list of tracker, values,
# large, swap and random; default: all.
#
# It measures processor time with 200 wires that change, and a click while the daemon is stopped. Large circuits are opened, moved and edited. It
# measures how long the ticks of a circuit at 1 kHz have to wait for an edit. So many random edits and undos change a circuit at 1 kHz, in turns
# with the same edits of another circuit and with none.
#
# Printed with their targets, not judged, for the machine has its part in them: times. Ticks count as late when they began a quarter of the period
# after they were due, or not at all. Promised: edits do not add late ticks, as far as the turns can tell. The circuit is then what its recipe says,
# and undo gives the first recipe.

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
# An editor in that window; the time until its picture stands there [ms].
proc opened {top name args} {
    set start [clock microseconds]
    toplevel $top
    wm geometry $top 1200x900+0+0
    pack [sorma::circuitEditor $top.w $name {*}$args] -fill both -expand 1
    waitFor {[$top.w known] && [dict size [dict get [$top.w graph] nodes]] > 0 && [winfo viewable $top.w.panes.picture.scene]}
    update
    winfo pointerx $top
    return [expr {([clock microseconds] - $start) / 1000}]
}
proc closed top {
    destroy $top
    update
}
proc settled w { waitFor {[$w sent] && "sending" ni [lmap option {-wires -places} {dict get [[$w subject] get $option] state}]} }

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
    opened .t circuit.hundred@$d -every 100
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
    closed .t
    cycle.hundred@$d CTRL -stop
}

# Counts of that circuit's cycle since CTRL -reset, by its DBX -stats: {due late skipped delayed}. Late ones began a quarter of the period
# after they were due, or did not begin at all, and were skipped; a request has delayed some of them.
proc ticksOf place {
    set text [lindex [cycle.edited@$place DBX -stats] 3]
    regexp {skipped (\d+) .*faults (\d+) .*delayed (\d+)} $text -> skipped faults delayed
    incr ::tickFaults $faults
    set due [set late $skipped]
    foreach {- from unit count} [regexp -all -inline -line {^([\d.]+) (ns|us|ms|s) \.\. .*: (\d+)$} $text] {
        incr due $count
        if {$from * [dict get {ns 1e-3 us 1 ms 1e3 s 1e6} $unit] > 250} {
            incr late $count
        }
    }
    return [list $due $late $skipped $delayed]
}
proc edit {w i} {
    set nodes [dict keys [dict get [$w graph] nodes]]
    set key [lindex $nodes [expr {int(rand() * [llength $nodes])}]]
    # Edits that do not fit are refused; that is one of the cases.
    catch {
        switch [expr {int(rand() * 9)}] {
            0 { $w connect [expr {[lindex $key 0] eq "unit" ? "[lindex $key 1].out" : [lindex $key 1]}] free[expr {$i % 50}] }
            1 { $w delete {} [expr {int(rand() * [llength [dict get [$w graph] wires]])}] }
            2 { if {[llength $nodes] > 6} {$w delete [list $key] {}} }
            3 { $w move [list $key] [expr {int(rand() * 9) - 4}] [expr {int(rand() * 9) - 4}] }
            4 { $w redo }
            5 { if {[$w drafts] ne {}} {$w undo} }
            default { $w undo }
        }
    }
}
proc editMany {w count} {
    for {set i 0} {$i < $count} {incr i} {
        edit $w $i
        update
    }
    settled $w
}
# Mean of a list of numbers, and its standard error.
proc mean values {
    set n [llength $values]
    set mean [expr {[tcl::mathop::+ {*}$values] / double($n)}]
    set squares [tcl::mathop::+ {*}[lmap value $values {expr {($value - $mean) ** 2}}]]
    return [list $mean [expr {sqrt($squares / max(1, $n - 1) / $n)}]]
}
# Two daemons have the same circuit, each at 1 kHz and in a window. In turn, this circuit is edited, the other one is (the window takes as much of the
# machine then), and none is. All ticks are those of this circuit, so that what else the machine does comes into all turns alike.
proc random {d count seed} {
    set first {
    2                  -> sum.error.in1
    integrator.arm.out -> sum.error.in2      # where it is
    sum.error.out      -> gain.p.in
    gain.p.out         -> integrator.arm.in
    integrator.arm.out -> position
}
    set other [serve $::classes]
    foreach {w place} [list .u $other .t $d] {
        circuit.edited@$place CTRL -wires $first
        cycle.edited@$place CTRL -period 0.001 -afterFault continue -steps circuit.edited -start
        opened $w circuit.edited@$place
    }
    expr {srand($seed)}
    set turns 50
    set ::tickFaults 0
    set begun [clock milliseconds]
    set kinds {here {edits of this circuit} elsewhere {edits of another circuit} none {no edits}}
    for {set turn 0} {$turn < $turns} {incr turn} {
        # The turn without edits is as long as the one before it.
        foreach kind [lindex {{here none elsewhere} {elsewhere none here}} [expr {$turn % 2}]] {
            cycle.edited@$d CTRL -reset
            set start [clock milliseconds]
            switch $kind {
                here { editMany .t.w [expr {$count / $turns}] }
                elsewhere { editMany .u.w [expr {$count / $turns}] }
                none { pass $took }
            }
            set took [expr {[clock milliseconds] - $start}]
            lappend counts($kind) [ticksOf $d]
        }
    }
    promise "no tick has failed" [expr {$::tickFaults == 0}]
    puts "$count random edits and undos at 1 kHz, in $turns turns of each kind, [expr {([clock milliseconds] - $begun) / 1000}] s, seed $seed"
    dict for {kind what} $kinds {
        set sums [lmap n {0 1 2 3} {tcl::mathop::+ {*}[lmap turn $counts($kind) {lindex $turn $n}]}]
        set shares($kind) [lmap turn $counts($kind) {expr {100.0 * [lindex $turn 1] / [lindex $turn 0]}}]
        figure "late ticks, $what, of [lindex $sums 0]" [format "%.2f %%" [expr {100.0 * [lindex $sums 1] / [lindex $sums 0]}]] "not more with edits"
        puts [format "    in a turn: median %.2f %%, 9 of 10 below %.2f %%; skipped %d; delayed by a request %d" \
            [quantile $shares($kind) 0.5] [quantile $shares($kind) 0.9] [lindex $sums 2] [lindex $sums 3]]
    }
    foreach kind {elsewhere none} {
        lassign [mean [lmap a $shares(here) b $shares($kind) {expr {$a - $b}}]] more error
        figure "more late ticks than with [dict get $kinds $kind]" [format "%+.2f %% +- %.2f" $more $error] "not above 0"
        promise "edits make no ticks late: that is less than three standard errors above 0" [expr {$more <= 3 * $error}]
    }
    circuit.fresh@$d CTRL -wires [circuit.edited@$d cget -wires] -inputs [circuit.edited@$d cget -inputs] -outputs [circuit.edited@$d cget -outputs]
    promise "the circuit is what a fresh one of its recipe is" \
        [expr {[circuit.fresh@$d DBX -wires] eq [circuit.edited@$d DBX -wires] && [circuit.fresh@$d DBX -order] eq [circuit.edited@$d DBX -order]}]
    .t.w return 0
    settled .t.w
    promise "undo to the beginning gives the first recipe" [expr {[circuit.edited@$d cget -wires] eq $first && [circuit.edited@$d cget -places] eq {}
        && [circuit.edited@$d cget -inputs] eq {} && [circuit.edited@$d cget -outputs] eq {}}]
    if {$::failures > 0} {
        puts "left: [llength [.t.w history]] edits, drafts [.t.w drafts]; [.t.w said]\n[circuit.edited@$d cget -wires]\n[circuit.edited@$d cget -inputs]\n[circuit.edited@$d cget -outputs]"
    }
    closed .t
    closed .u
    daemon stop $other
}

# How long ticks cannot begin because of an edit: the new plan is made while they go on, and taken between two of them. No window looks on.
proc swap {d count} {
    set wires "1 -> gain.0.in"
    for {set i 1} {$i < $count} {incr i} {
        append wires "\ngain.[expr {$i - 1}].out -> gain.$i.in"
    }
    circuit.swapped@$d CTRL -wires $wires
    cycle.swapped@$d CTRL -period 0.001 -afterFault continue -steps circuit.swapped -start
    set edits 50
    set refused 0
    set times {}
    for {set i 0} {$i < $edits} {incr i} {
        set start [clock microseconds]
        incr refused [catch {circuit.swapped@$d CTRL -wires "$wires[if {$i % 2 == 0} {string cat "\ngain.0.out -> more"}]" -places "unit gain.0 $i 0"}]
        lappend times [expr {[clock microseconds] - $start}]
    }
    regexp -line {^time of a request between ticks: .* longest (.*)$} [lindex [cycle.swapped@$d DBX -stats] 3] -> longest
    figure "an edit of a circuit of $count units at 1 kHz, median" [format "%.2f ms" [expr {[quantile $times 0.5] / 1e3}]] none
    figure "    of that, ticks cannot begin, longest of $edits" $longest "< 250 us"
    figure "    refused, because ticks would have been late" "$refused of $edits" [expr {$count > 1000 ? "none" : "0"}]
    cycle.swapped@$d CTRL -stop
}

proc large {d count} {
    set wires "target -> sum.0.in1; 0 -> sum.0.in2; sum.0.out -> sum.1.in1; 0 -> sum.1.in2"
    for {set i 2} {$i < $count} {incr i} {
        append wires "\nsum.[expr {$i - 1}].out -> sum.$i.in1\nsum.[expr {$i - 2}].out -> sum.$i.in2"
    }
    circuit.large@$d CTRL -wires $wires
    set start [spent]
    set time [opened .t circuit.large@$d]
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
    settled .t.w
    closed .t
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
        set time [opened .t circuit.tracker@$d]
        closed .t
        set time
    }]
    figure "the tracker's circuit is opened, median of three" "[quantile $times 0.5] ms" "< 0.3 s"
}

attack {
    set edits [expr {$argc > 0 ? [lindex $argv 0] : 10000}]
    set seconds [expr {$argc > 1 ? [lindex $argv 1] : 10}]
    set parts [expr {$argc > 2 ? [lindex $argv 2] : "tracker values large swap random"}]
    set seed [expr {$argc > 3 ? [lindex $argv 3] : [clock seconds] % 100000}]
    set d [serve $classes]
    foreach part $parts {
        switch $part {
            tracker { tracker }
            values { values $d }
            large { foreach count {1000 10000} {large $d $count} }
            swap { foreach count {10 100 1000 10000} {swap $d $count} }
            random { random $d $edits $seed }
            default { error "no part $part: must be tracker, values, large, swap, or random" }
        }
    }
}
