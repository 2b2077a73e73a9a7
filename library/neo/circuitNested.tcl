# circuitNested.tcl -- some units of a circuit become a circuit inside of it, and back: the texts. It knows no bus and no window.
#
# A wire that crosses the edge is replaced in its place. So the circuit's own pins, and its floats, keep their order. All other wires stay
# as they are written.

package require sorma::circuitText
package provide sorma::circuitNested 1.0

namespace eval ::sorma::circuitNested {
    namespace export pack unpack
    namespace ensemble create
}

# ::sorma::circuitNested pack WIRES KEYS NAME FACTS -- the units KEYs go into a circuit NAME. FACTS: a prefix; with the number of a wire it
# returns {length unit}. Returns a dict: wires, of the circuit; inner: a dict of -wires and -inputs.
proc ::sorma::circuitNested::pack {text keys name facts} {
    set graph [::sorma::circuitText read $text]
    set taken {}
    set ins [set outs {}]               ;# dict: source as it is written -> name of the pin
    set inner [set inputs [set changes {}]]
    set n -1
    foreach wire [dict get $graph wires] {
        incr n
        lassign $wire piece source sink
        set constant [expr {[lindex $source 1] eq {}}]
        set from [expr {!$constant && [::sorma::circuitText node $source] in $keys}]
        set to [expr {[::sorma::circuitText node $sink] in $keys}]
        set source [::sorma::circuitText write $source]
        set sink [::sorma::circuitText write $sink]
        if {$to && ($from || $constant)} {
            lappend inner [lindex [dict get $graph pieces] $piece]
            lappend changes [list $n {}]
        } elseif {$to} {
            set new {}
            if {![dict exists $ins $source]} {
                set pin [Pin [lindex $wire 1] [lindex $wire 2] taken]
                dict set ins $source $pin
                lappend inputs [string trimright "$pin [join [{*}$facts $n]]"]
                set new "$source -> $name.$pin"
            }
            lappend inner "[dict get $ins $source] -> $sink"
            lappend changes [list $n $new]
        } elseif {$from} {
            if {![dict exists $outs $source]} {
                dict set outs $source [Pin [lindex $wire 2] [lindex $wire 1] taken]
                lappend inner "$source -> [dict get $outs $source]"
            }
            lappend changes [list $n "$name.[dict get $outs $source] -> $sink"]
        }
    }
    # From the end, so that the numbers of those before stay.
    foreach change [lreverse $changes] {
        lassign $change n new
        set text [if {$new eq {}} {::sorma::circuitText remove $text $n} else {::sorma::circuitText replace $text $n $new}]
    }
    return [dict create wires $text inner [dict create -wires [join $inner \n] -inputs [join $inputs "; "]]]
}
# A name for a pin: as the pin of the circuit's own at FIRST, else as the unit's pin at SECOND.
proc ::sorma::circuitNested::Pin {first second takenVar} {
    upvar 1 $takenVar taken
    set pin [lindex [if {[lindex $first 0] eq {}} {set first} else {set second}] 1]
    for {set n {}} {"$pin$n" in $taken} {set n [expr {$n eq {} ? 2 : $n + 1}]} {}
    lappend taken $pin$n
    return $pin$n
}

# ::sorma::circuitNested unpack WIRES NAME INNER -- the text without the circuit NAME, whose wires INNER take its place. Fails with {SORMA CIRCUIT
# NESTED} when a wire cannot be written.
proc ::sorma::circuitNested::unpack {text name innerText} {
    set graph [::sorma::circuitText read $text]
    set inside [::sorma::circuitText read $innerText]
    set pieces [dict get $inside pieces]
    set known [::sorma::circuitText object $name]
    # By the pin that they read, or drive; the others stay as they are written.
    set reading [set driving [set whole {}]]
    foreach wire [dict get $inside wires] {
        lassign $wire piece source sink
        set own 0
        if {[lindex $source 0] eq {} && [lindex $source 1] ne {}} {
            dict lappend reading [lindex $source 1] $wire
            set own 1
        }
        if {[lindex $sink 0] eq {}} {
            dict lappend driving [lindex $sink 1] $wire
            set own 1
        }
        if {!$own} {
            lappend whole [lindex $pieces $piece]
        }
    }
    # Wires outside that drive its inputs.
    set feeds {}
    foreach wire [dict get $graph wires] {
        lassign [lindex $wire 2] object pin
        if {$object ne {} && [::sorma::circuitText object $object] eq $known} {
            dict lappend feeds $pin [lrange $wire 1 2]
        }
    }
    set n -1
    set changes {}
    foreach wire [dict get $graph wires] {
        incr n
        lassign $wire piece source sink
        lassign [lmap end [list $source $sink] {expr {[lindex $end 0] ne {} && [::sorma::circuitText object [lindex $end 0]] eq $known}}] from to
        if {!$from && !$to} continue
        set sources [if {$from} {Behind $source $driving $feeds $name} else {list $source}]
        set new {}
        foreach one $sources {
            if {!$to} {
                lappend new [list $one $sink]
                continue
            }
            foreach reader [if {[dict exists $reading [lindex $sink 1]]} {dict get $reading [lindex $sink 1]}] {
                # An input that is passed on to an output is written where that output is read.
                if {[lindex $reader 2 0] ne {}} {
                    lappend new [list [Part $one [lindex $reader 1] $sink $name] [lindex $reader 2]]
                }
            }
        }
        lappend changes [list $n [lmap ends $new {::sorma::circuitText between {*}$ends}]]
    }
    foreach change [lreverse $changes] {
        lassign $change n new
        set text [if {$new eq {}} {::sorma::circuitText remove $text $n} else {::sorma::circuitText replace $text $n [join $new "; "]}]
    }
    foreach wire $whole {
        lassign [lindex [dict get [::sorma::circuitText read $wire] wires] 0] - source sink
        set text [::sorma::circuitText add $text [::sorma::circuitText write $source] [::sorma::circuitText write $sink]]
    }
    return $text
}
# The ends that stand for an output of the circuit inside.
proc ::sorma::circuitNested::Behind {source driving feeds name} {
    set pin [lindex $source 1]
    set drivers [if {[dict exists $driving $pin]} {dict get $driving $pin}]
    if {[llength $drivers] != 1 || [lindex $drivers 0 2 2] ne {}} {
        Refuse $name $pin
    }
    set end [lindex $drivers 0 1]
    if {[lindex $end 0] eq {} && [lindex $end 1] ne {}} {
        set outside [if {[dict exists $feeds [lindex $end 1]]} {dict get $feeds [lindex $end 1]}]
        if {[llength $outside] != 1} {
            Refuse $name $pin
        }
        set end [Part [lindex $outside 0 0] $end [lindex $outside 0 1] $name]
    }
    return [list [Part $end $source [list {} $pin {} {} {}] $name]]
}
# END outside drives a whole pin, and READ is that pin or a part of it. Returns the same part of END.
proc ::sorma::circuitNested::Part {end read driven name} {
    if {[lindex $driven 2] ne {}} {
        Refuse $name [lindex $driven 1]
    }
    lassign [lrange $read 2 3] first last
    if {$first eq {}} {
        return $end
    } elseif {[lindex $end 1] eq {}} {
        return [lreplace $end 4 4 [lrange [lindex $end 4] $first $last]]
    }
    set base [expr {[lindex $end 2] eq {} ? 0 : [lindex $end 2]}]
    return [lreplace $end 2 3 [expr {$base + $first}] [expr {$base + $last}]]
}
proc ::sorma::circuitNested::Refuse {name pin} {
    return -code error -errorcode {SORMA CIRCUIT NESTED} "$name.$pin is wired in parts: its wires cannot be written without it"
}
