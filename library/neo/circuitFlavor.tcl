# circuitFlavor.tcl -- ::sorma::circuitFlavor: in the circuit editor, save the circuit as a recipe of the dictionary, and compare it with its recipe.

package require Tk
package require snit
package require sorma::circuitText
package require sorma::parts
package require sorma::style
package require sorma::text
package provide sorma::circuitFlavor 1.0

namespace eval ::sorma::circuitFlavor {
    namespace export compare
    namespace ensemble create
}

# ::sorma::circuitFlavor::compare OLD NEW -- what differs between two recipes, dicts of options: a list of {MARK TEXT}. MARK: + for a wire of the new
# one, - for a wire of the old one, ~ for another option.
proc ::sorma::circuitFlavor::compare {old new} {
    set counts {}
    foreach recipe [list $old $new] step {-1 1} {
        set text [if {[dict exists $recipe -wires]} {dict get $recipe -wires}]
        foreach wire [dict get [::sorma::circuitText read $text] wires] {
            dict incr counts [::sorma::circuitText between {*}[lrange $wire 1 2]] $step
        }
    }
    set out {}
    dict for {wire count} $counts {
        if {$count != 0} {
            lappend out [list [expr {$count > 0 ? "+" : "-"}] $wire]
        }
    }
    foreach option {-inputs -outputs} {
        lassign [lmap recipe [list $old $new] {if {[dict exists $recipe $option]} {dict get $recipe $option}}] before after
        if {[::sorma::circuitText pins $before] ne [::sorma::circuitText pins $after]} {
            lappend out [list ~ "$option: {$before}, now {$after}"]
        }
    }
    lassign [lmap recipe [list $old $new] {if {[dict exists $recipe -places]} {dict get $recipe -places}}] before after
    set moved 0
    foreach read {places notes} {
        lassign [lmap text [list $before $after] {::sorma::circuitText $read $text}] was is
        dict for {key what} [dict merge $was $is] {
            incr moved [expr {![dict exists $was $key] || ![dict exists $is $key] || [dict get $was $key] ne [dict get $is $key]}]
        }
    }
    if {$moved > 0} {
        lappend out [list ~ "-places: $moved of them differ"]
    }
    return $out
}

snit::macro ::sorma::circuitFlavorParts {} {
    # saveAs ?FLAVOR? -- write the recipe that runs into the dictionary there, under this flavor or its own name.
    method saveAs {{flavor {}}} {
        if {[$self drafts] ne {}} {
            set hint "[::sorma::style mark refused] save: the circuit has not taken all edits; undo or revert those that it refuses"
            return
        }
        $subject ask [concat [list CTRL -save] $flavor] [list ::sorma::parts::answer [mymethod FlavorSaved]]
    }
    method FlavorSaved {status value} {
        if {$status ne "ok"} {
            set hint "[::sorma::style mark refused] save: [::sorma::text::clean [lindex $value 0]]"
            return
        }
        set hint "saved in the dictionary: [lindex [dict get $value text] 0]"
    }
    method SaveAs {} {
        $self Line save
    }
    # compare -- show what differs from the recipe in the dictionary, and select wires that it does not have. The second call ends that.
    method compare {} {
        if {[winfo exists $win.diff]} {
            destroy $win.diff
            focus $scene
            return
        }
        $self AskStored [mymethod Compared]
    }
    method Compared {has old why} {
        set name [$subject name]
        if {$why ne {}} {
            set hint "[::sorma::style mark refused] compare: [::sorma::text::clean $why]"
            return
        }
        if {[catch {::sorma::circuitFlavor::compare $old $recipe} found]} {
            set hint "[::sorma::style mark refused] compare: [::sorma::text::clean $found]"
            return
        }
        destroy $win.diff
        ::ttk::frame $win.diff
        set view $win.diff.text
        ::sorma::style text $view {+ good - refused ~ theirs} -height [expr {min(8, max(1, [llength $found] + !$has))}] -width 20 -wrap none -highlightthickness 1 \
            -padx [::sorma::style pixels 8] -takefocus 1 -yscrollcommand [list ::sorma::parts::scrolled $win.diff.bar]
        ::sorma::parts::withBar $win.diff $view $win.diff.bar
        $view insert end [expr {$has ? {} : "no recipe of $name is in the dictionary; all of it is new\n"}]
        $view insert end [if {$found eq {}} {string cat "$name is as its recipe says"} else {join [lmap line $found {string map {\n { }} [join $line]}] \n}]
        set row [expr {!$has}]
        foreach line $found {
            incr row
            $view tag add [lindex $line 0] $row.0 $row.end
        }
        $view configure -state disabled
        bind $view <Escape> [mymethod compare]
        pack $win.diff -side bottom -fill x -padx [::sorma::style pixels 8] -before $win.panes
        # The new ones are seen in the picture.
        set fresh [lmap line $found {if {[lindex $line 0] ne "+"} continue; lindex $line 1}]
        set chosenKeys {}
        set n -1
        set chosenWires [lmap wire [dict get $graph wires] {
            incr n
            if {[::sorma::circuitText between {*}[lrange $wire 1 2]] ni $fresh} continue
            set n
        }]
        $self Selected
    }
    # differences -- the lines that compare shows.
    method differences {} {
        return [if {[winfo exists $win.diff]} {split [string trim [$win.diff.text get 1.0 end]] \n}]
    }
}
