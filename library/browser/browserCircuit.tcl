# browserCircuit.tcl -- sorma::browserCircuit: the circuit that was chosen in the browser, as a picture.

package require Tk
package require snit
package require sorma::circuitEditor
package require sorma::style
package provide sorma::browserCircuit 1.0

# ::sorma::browserCircuit .w --
# Methods:
#       about NAME      the circuit of that name, or none
#       editor          the window of the one that is shown, or nothing
#       text            its wires
# Its editor is made when the tab is seen. One that has drafts stays, and comes again with its circuit.
snit::widget ::sorma::browserCircuit {
    hulltype ttk::frame
    variable name {}
    variable editor {}
    variable editors {}         ;# dict: name -> window
    variable last 0

    constructor {} {
        ttk::label $win.none -justify left -anchor nw -padding [::sorma::style pixels 6] -text [::msgcat::mc "Choose an object of class circuit at the left."]
        pack $win.none -fill both -expand 1
        bind $win <Map> [mymethod Show]
    }
    method about which {
        set name $which
        if {[winfo ismapped $win]} {
            $self Show
        }
    }
    method editor {} {
        return $editor
    }
    method text {} {
        return [if {$editor eq {}} {$win.none cget -text} else {::sorma::circuitText text [$editor graph]}]
    }
    method Show {} {
        if {$editor ne {} && [[$editor subject] name] ne $name} {
            pack forget $editor
            if {[$editor drafts] eq {}} {
                dict unset editors [[$editor subject] name]
                destroy $editor
            }
            set editor {}
        }
        if {$name eq {}} {
            pack $win.none -fill both -expand 1
        } elseif {$editor eq {}} {
            pack forget $win.none
            if {![dict exists $editors $name]} {
                dict set editors $name [::sorma::circuitEditor $win.e[incr last] $name]
            }
            set editor [dict get $editors $name]
            pack $editor -fill both -expand 1
        }
    }
}
