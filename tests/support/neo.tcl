# neo.tcl -- a circuit in an editor, for the suites of the circuit editor: windows, places, mouse and keys.

source [file join $supportFolder geometry.tcl]

set behind {}
interp bgerror {} {apply {{message options} {lappend ::behind [dict get $options -errorinfo]}}}

testConstraint display [expr {$display::Missing eq {}}]
if {$display::Missing eq {}} {
    package require sorma::circuitEditor
    foreach class {circuit units} {
        package require sorma::service::$class
    }
} else {
    puts "$display::Missing"
}

set loop {
    target             -> sum.error.in1
    integrator.arm.out -> sum.error.in2      # where it is
    sum.error.out      -> gain.p.in
    gain.p.out         -> integrator.arm.in
    integrator.arm.out -> position
}

# withEditor NAME WORDS SCRIPT: .t.w is one, and its picture is there; then all objects go.
set names [sorma::names]
proc withEditor {name words script} {
    toplevel .t
    wm geometry .t 1000x600
    try {
        pack [sorma::circuitEditor .t.w $name {*}$words] -fill both -expand 1
        update
        uplevel 1 $script
    } finally {
        destroy .t
        waitFor {$sorma::subject::Subjects eq {}}
        foreach made [sorma::names] {
            if {$made ni $::names} {
                catch {sorma::remove $made}
            }
        }
    }
}
# Make circuit.t with these wires, and one tick with these inputs.
proc circuit {wires args} {
    circuit.t CTRL -wires $wires -inputs {target 1 m} -period 0.1
    circuit.t EXEC FMSG [llength $args] {*}$args
}
# Values of all wires have come.
proc valued {} { waitFor {"" ni [lmap wire [dict get [.t.w graph] wires] {.t.w value [incr ::number]}]} }
proc values {} {
    set n -1
    return [lmap wire [dict get [.t.w graph] wires] {.t.w value [incr n]}]
}
# Where something stands in the window, in pixels: a box, or a pin at its edge.
proc box key { return [.t.w scene pixel {*}[lmap a [lrange [.t.w box $key] 0 1] {expr {$a + 2}}]] }
proc title key {
    lassign [.t.w box $key] x y width height
    return [.t.w scene pixel [expr {$x + $width / 2.0}] [expr {$y + 1.5}]]
}
proc pin {key side name} {
    lassign [.t.w box $key] x y width height
    set row [sorma::circuitLayout pin [dict get [.t.w graph] nodes $key] $side $name]
    return [.t.w scene pixel [expr {$side eq "ins" ? $x : $x + $width}] [expr {$y + $row}]]
}
# The left button goes down here, moves there, and up.
proc drag {from to} {
    set scene .t.w.panes.picture.scene
    lassign $from x y
    lassign $to X Y
    event generate $scene <ButtonPress-1> -x $x -y $y
    event generate $scene <B1-Motion> -x [expr {($x + $X) / 2}] -y [expr {($y + $Y) / 2}]
    event generate $scene <B1-Motion> -x $X -y $Y
    event generate $scene <ButtonRelease-1> -x $X -y $Y
    update
}
proc click {place {modifier {}}} {
    lassign $place x y
    event generate .t.w.panes.picture.scene <${modifier}ButtonPress-1> -x $x -y $y
    event generate .t.w.panes.picture.scene <ButtonRelease-1> -x $x -y $y
    update
}
proc key name {
    display::focus .t.w.panes.picture.scene
    event generate .t.w.panes.picture.scene <$name>
    update
}
# Type into the line below the picture, and press Return.
proc answer text {
    .t.w.line delete 0 end
    .t.w.line insert 0 $text
    display::focus .t.w.line
    event generate .t.w.line <Return>
    update
}
# Does this wire go through that unit?
proc through {number unit} {
    lassign [.t.w box [list unit $unit]] left top width height
    set way [lindex [.t.w ways] $number]
    foreach {x y} [lrange $way 0 end-2] {X Y} [lrange $way 2 end] {
        if {max($x, $X) > $left && min($x, $X) < $left + $width && max($y, $Y) > $top && min($y, $Y) < $top + $height} {
            return 1
        }
    }
    return 0
}
proc wires {} { return [circuit.t cget -wires] }
# The wires as the picture shows them, sent or not.
proc wanted {} { return [sorma::circuitText text [.t.w graph]] }
proc top {} { return [lindex [.t.w.head.say says] 1] }
# Faults of the tools in the head: they are cut, too narrow, or overlap.
proc headFaults {} {
    set head .t.w.head
    set right [expr {[winfo rootx $head] + [winfo width $head]}]
    set bottom [expr {[winfo rooty $head] + [winfo height $head]}]
    set bad [overlaps [placed $head]]
    foreach tool [winfo children $head.tools] {
        if {[winfo class $tool] ni {Menu TFrame} && ([winfo width $tool] < [winfo reqwidth $tool] || [winfo rootx $tool] + [winfo width $tool] > $right
                || [winfo rooty $tool] + [winfo height $tool] > $bottom)} {
            lappend bad "[winfo name $tool] is cut"
        }
    }
    return $bad
}
