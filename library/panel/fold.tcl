# fold.tcl -- the titles of groups in a panel. Groups of a large form fold: their title is a button then, also for the keyboard.

package require Tk
package require sorma::style
package require sorma::window
package provide sorma::fold 1.0

namespace eval ::sorma::fold {
    namespace export title place show remember recall
    namespace ensemble create
    variable Urgent {alarm refused warn theirs mine}        ;# states of options that a folded group tells, the worst first
}

# ::sorma::fold title WINDOW TITLE COMMAND -- the title of a group; an empty command: it does not fold.
proc ::sorma::fold::title {window title command} {
    if {$command ne {}} {
        ttk::button $window -style Heading.Toolbutton -command $command
    } else {
        ttk::label $window -text $title -font [::sorma::style font strong]
    }
}

# ::sorma::fold place WINDOW ROW -- in a grid of rows as parts.tcl makes them. Tab goes to a title before it goes to the fields below.
proc ::sorma::fold::place {window row} {
    set gap [::sorma::style pixels 4]
    grid $window -row $row -column 0 -columnspan 3 -sticky w -padx [expr {[winfo class $window] eq "TButton" ? 2 * $gap : 4 * $gap}] -pady $gap
    raise $window
}

# ::sorma::fold show WINDOW TITLE FOLDED STATES -- a mark tells whether the group is open. A folded one tells how many options it has, and the
# mark of the worst of their states.
proc ::sorma::fold::show {window title folded states} {
    variable Urgent
    set text "\u25be $title"
    if {$folded} {
        set text "\u25b8 $title  ([llength $states])"
        foreach state $Urgent {
            if {$state in $states} {
                append text "  [::sorma::style mark $state]"
                break
            }
        }
    }
    if {[$window cget -text] ne $text} {
        $window configure -text $text
    }
}

# ::sorma::fold remember WINDOW TITLES -- which groups are folded there, for the next time. WINDOW: what arrangement.tcl has for it. recall WINDOW ?OTHERWISE?:
# their titles; one that is damaged is as none.
proc ::sorma::fold::remember {window titles} {
    ::sorma::window remember [list folds {*}$window] $titles
}
proc ::sorma::fold::recall {window {otherwise {}}} {
    set titles [::sorma::window recall [list folds {*}$window] $otherwise]
    return [expr {[string is list $titles] ? $titles : $otherwise}]
}
