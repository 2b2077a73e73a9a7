# circuitNests.tcl -- ::sorma::circuitNests: in the circuit editor, the units that are selected become a circuit inside of it, and back.
#
# The circuit inside is made first; it has the same units, and nothing executes it yet. Then one edit puts it in their place, between two ticks.
# Undo puts the units back. The circuit that nothing uses any more stays, for redo.

package require snit
package require sorma::circuitLayout
package require sorma::circuitNested
package require sorma::circuitText
package require sorma::style
package require sorma::text
package provide sorma::circuitNests 1.0

snit::macro ::sorma::circuitNests {} {
    # nest ?KEYS? -- these units become a circuit of their own. Returns its name; it takes their place when it is made.
    method nest {{keys {}}} {
        set keys [lmap key [expr {$keys ne {} ? $keys : $chosenKeys}] {if {[lindex $key 0] ne "unit"} continue; set key}]
        if {$keys eq {}} {
            set hint "[::sorma::style mark refused] circuit inside: select units first"
            return
        } elseif {![$self Editable "circuit inside"]} return
        set name [$self FreeName circuit {}]
        set texts [::sorma::circuitNested pack [dict get $recipe -wires] $keys $name [mymethod NestFacts]]
        lassign [$self Around $keys] left top
        set inside {}
        foreach key $keys {
            lassign [dict get $places $key] x y
            dict set inside $key [list [expr {$x - $left + 17}] [expr {$y - $top}]]
        }
        set changes [dict create -wires [dict get $texts wires] \
            -places [::sorma::circuitText place [::sorma::circuitText drop [dict get $recipe -places] $keys] [list [list unit $name] [list [expr {$left + 3}] [expr {$top + 5}]]]]]
        $self AskThere [list $name CTRL {*}[dict get $texts inner] -places [::sorma::circuitText place {} $inside]] \
            [mymethod Nested $name $keys $changes [dict get $recipe -wires]]
        return $name
    }
    # {length unit} of a wire that begins outside.
    method NestFacts number {
        set wire [lindex [dict get $graph wires] $number]
        return [list [$self Count $wire] [lindex [$self Live [lindex $wire 1] out] 1]]
    }
    # Has the answer come, and is the text still what it was asked for? Else the line below says why not.
    method NestGoes {what was status value} {
        if {$status eq "ok" && $was eq [dict get $recipe -wires]} {
            return 1
        }
        set hint "[::sorma::style mark refused] $what: [expr {$status ne "ok" ? [::sorma::text::clean [lindex $value 0]] : "the wires have changed meanwhile"}]"
        return 0
    }
    method Nested {name keys changes was status value} {
        if {[$self NestGoes $name $was $status $value]} {
            $self AskPins $name
            $self Edit "circuit $name of [Named $keys]" $changes $keys
            set chosenKeys [list [list unit $name]]
            $self Selected
        }
    }
    # unnest ?KEY? -- a circuit inside gives place to its units.
    method unnest {{key {}}} {
        set key [expr {$key ne {} ? $key : [lindex $chosenKeys 0]}]
        set name [lindex $key 1]
        if {![regexp {^circuit(?:\.|$)} $name] || [string first @ $name] >= 0 || ![dict exists $boxes $key]} {
            set hint "[::sorma::style mark refused] units of a circuit: select a circuit of the same daemon first"
            return
        }
        $self AskThere [list sorm DBX -describe $name] [mymethod Unnested $key [dict get $recipe -wires]]
    }
    method Unnested {key was status value} {
        set name [lindex $key 1]
        if {![$self NestGoes $name $was $status $value]} return
        try {
            foreach option [dict get $value text options] {
                set inner([lindex $option 0]) [lindex $option 5]
            }
            set wires [::sorma::circuitNested unpack $was $name $inner(-wires)]
        } on error message {
            set hint "[::sorma::style mark refused] [::sorma::text::clean $message]"
            return
        }
        # Its units stand to each other as they did inside.
        set graphInside [::sorma::circuitText graph $inner(-wires) $inner(-inputs) $inner(-outputs)]
        set inside [dict filter [::sorma::circuitLayout place $graphInside [::sorma::circuitText places $inner(-places)]] key {unit *}]
        set moved {}
        if {$inside ne {}} {
            lassign [dict get $places $key] left top
            foreach axis {0 1} {
                lappend least [tcl::mathfunc::min {*}[lmap place [dict values $inside] {lindex $place $axis}]]
            }
            dict for {unit place} $inside {
                dict set moved $unit [list [expr {$left + [lindex $place 0] - [lindex $least 0]}] [expr {$top + [lindex $place 1] - [lindex $least 1]}]]
                $self AskPins [lindex $unit 1]
            }
        }
        $self Edit "units of $name" [dict create -wires $wires \
            -places [::sorma::circuitText place [::sorma::circuitText drop [dict get $recipe -places] [list $key]] $moved]] [list $key]
        set chosenKeys [dict keys $moved]
        $self Selected
    }
}
