# actions.tcl -- buttons for the actions of an object, in a panel.

package require Tk
package require sorma::field
package require sorma::style
package require sorma::text
package provide sorma::actions 1.0

namespace eval ::sorma::actions {
    namespace export fill mark
    namespace ensemble create
}

# ::sorma::actions mark KIND -- behind the name of a dangerous word; KIND: its danger, or nothing.
proc ::sorma::actions::mark kind {
    return [expr {$kind in {move power fire} ? " \u26a0" : {}}]
}

# ::sorma::actions fill FRAME STOPS NAME TABLE PREFIX -- new buttons for the actions of a table. Buttons that stop are in the frame STOPS, out of what is
# scrolled. PREFIX asks for arguments: it is called with the word and its usage.
proc ::sorma::actions::fill {frame stops name table prefix} {
    destroy {*}[winfo children $frame] {*}[winfo children $stops]
    set pad [::sorma::style pixels 4]
    set n 0
    foreach action [dict get $table actions] {
        lassign $action word usage help least
        set danger [if {[dict exists $table danger $word]} {dict get $table danger $word}]
        if {$danger eq "stop" || $word in {-stop -halt -abort}} {
            set button [::sorma::button $stops.b[incr n] -name $name -request [list CTRL $word]]
            pack $button -side left
        } else {
            set button $frame.b[incr n]
            if {$least > 0} {
                ttk::button $button -text "[::sorma::text::label $word][mark $danger] \u2026" -command [list {*}$prefix $word $usage]
            } else {
                ::sorma::button $button -name $name -request [list CTRL $word] \
                    -text [expr {$danger in {{} stop} ? {} : "[::sorma::text::label $word][mark $danger]"}]
            }
            set at [llength [grid slaves $frame]]
            grid $button -row [expr {$at / 4}] -column [expr {$at % 4}] -sticky ew -padx [list 0 $pad] -pady [list [expr {$at < 4 ? 0 : $pad}] 0]
        }
        if {$danger ni {{} stop}} {
            append help "; " [dict get {move {moves something} power {switches power} fire {fires something}} $danger] ": needs the right operate"
        }
        ::sorma::style tip $button $help
    }
}
