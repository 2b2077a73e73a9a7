# panelEnter.tcl -- sorma::panelEnter, the keyboard goes to the first field of a panel that somebody has opened to change something. A macro for its body.

package require Tk
package require snit
package require sorma::parts
package provide sorma::panelEnter 1.0

# ::sorma::panelEnter -- the widget has layout, rows and inner as a panel has them. It calls Enter when its fields are laid out.
snit::macro ::sorma::panelEnter {} {
    variable entering 0         ;# until then [ms] the first field gets the keyboard, as soon as its value is there

    method enter {} {
        set entering [expr {[clock milliseconds] + 2000}]
        $self Enter
    }
    # A person who has meanwhile gone to another part of the panel stays there.
    method Enter {} {
        if {$entering == 0 || $layout eq {}} return
        if {[clock milliseconds] > $entering || [string match $win.* [focus -displayof $win]]} {
            return [set entering 0]
        }
        foreach {title members} [dict get $layout groups] {
            set first [if {$members ne {} && ![$self Folded $title]} {::sorma::parts::control $inner.field[dict get $rows [lindex $members 0]]}]
            if {$first eq {}} continue
            # Fields get their values when they can be seen.
            if {[winfo class $first] eq "TEntry" && [$first get] eq {}} break
            set entering 0
            focus $first
            if {[winfo class $first] eq "TEntry"} {
                $first selection range 0 end
            }
            return
        }
        after 30 [list ::sorma::parts::answer [mymethod Enter]]
    }
}
