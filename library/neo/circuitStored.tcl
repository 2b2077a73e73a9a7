# circuitStored.tcl -- ::sorma::circuitStored: in the circuit editor, the recipe that the dictionary has of a circuit. Looking makes no object.
#
# It is shown while there is no such object. So a recipe that makes no circuit can be seen, and what is wrong with it. circuitFlavor.tcl compares with it.

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
            $self AskStored [mymethod StoredCame]
        }
    }
    # Ask for the recipe. PREFIX is called with {FOUND RECIPE WHY}: a dict of the options of circuitText that it has. FOUND 0: there is none, or nobody
    # has told, and WHY says why.
    method AskStored prefix {
        $self AskThere [list dict CTRL -expand [$self NameThere]] [mymethod StoredRead $prefix]
    }
    method StoredRead {prefix status value} {
        set content {}
        if {$status ne "ok"} {
            set none [expr {[lrange [lindex $value 1] 0 2] eq "SORMA DICT UNKNOWN"}]
            return [{*}$prefix 0 {} [if {!$none} {lindex $value 0}]]
        }
        # Actions may stand among the options: nobody needs them here.
        set words [if {[dict exists $value text]} {dict get $value text}]
        foreach option $::sorma::circuitText::options {
            if {![catch {lsearch -exact $words $option} at] && $at >= 0} {
                dict set content $option [lindex $words $at+1]
            }
        }
        {*}$prefix 1 $content {}
    }
    method StopStored {} {
        after cancel $storedTimer
        set storedTimer {}
    }
    method StoredCame {found content why} {
        if {$storedTimer ne "asked"} return
        set before $stored
        set stored $content
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
