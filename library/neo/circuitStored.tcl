# circuitStored.tcl -- ::sorma::circuitStored: in the circuit editor, the recipe that the dictionary has of a circuit, while there is no such object.
#
# So a recipe that makes no circuit can be seen, and what is wrong with it. Looking makes no object.

package require snit
package require sorma::parts
package provide sorma::circuitStored 1.0

snit::macro ::sorma::circuitStored {} {
    variable stored {}          ;# dict: options of that recipe, as far as they are known
    variable storedTimer {}     ;# until it is asked for again; "asked" while there is no answer yet

    # Called with each look at the circuit: is there none?
    method LookStored gone {
        if {!$gone} {
            $self StopStored
            set stored {}
        } elseif {$storedTimer eq {} && $token ne {}} {
            set storedTimer asked
            $self AskThere [list dict CTRL -expand [$self NameThere]] [mymethod StoredCame]
        }
    }
    method StopStored {} {
        after cancel $storedTimer
        set storedTimer {}
    }
    method StoredCame {status value} {
        if {$storedTimer ne "asked"} return
        set words [if {$status eq "ok" && [dict exists $value text]} {dict get $value text}]
        set before $stored
        # Actions may stand among the options: nobody needs them here.
        set stored {}
        foreach option $::sorma::circuitText::options {
            if {![catch {lsearch -exact $words $option} at] && $at >= 0} {
                dict set stored $option [lindex $words $at+1]
            }
        }
        set storedTimer [after 1000 [mymethod StoredAgain]]
        if {$stored ne $before} {
            $self Told
        }
    }
    method StoredAgain {} {
        set storedTimer {}
        $self Told
    }
}
