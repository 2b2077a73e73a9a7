# panelColumns.tcl -- sorma::panelColumns, how a panel uses the room of its window: one column, or two in a wide window. A macro for its body.

package require Tk
package require snit
package require sorma::style
package require sorma::trailview
package provide sorma::panelColumns 1.0

# ::sorma::panelColumns -- the widget has the parts head, find, body and apply, one below the other in column 0, and ask, said, actions and what. The
# latter stand below them or beside them, and so does the trail.
snit::macro ::sorma::panelColumns {} {
    variable columns {}         ;# 1: two
    variable trailShown 0

    method BeginColumns {} {
        # The trail of an error: folded until the user opens it.
        ttk::checkbutton $win.trail -variable [myvar trailShown] -command [mymethod Unfold] -style Page.Toolbutton -underline 2
        ttk::frame $win.aside -style Page.TFrame
        lower $win.aside
        $self Unfold
        $self Columns
        grid $win.trail
        grid columnconfigure $win 0 -weight 3 -uniform part
        grid columnconfigure $win.aside 0 -weight 1
        grid rowconfigure $win 2 -weight 1 -minsize [::sorma::style pixels 40]
        grid rowconfigure $win 20 -weight 1000         ;# room that is left over is below all
        bind $win <Configure> [mymethod Columns]
    }
    # What is set stands at the left of a wide window, and what is asked at its right. Cards do not become wider than what a person can read.
    method Columns {} {
        set beside [expr {[winfo width $win] >= [::sorma::style pixels 900]}]
        $self Sized
        # In a narrow window the notice has a second line, which is mostly empty: it stands for the room below.
        $win.head configure -padding [lmap n [list 16 12 16 [expr {[winfo width $win.head.say] > [::sorma::style pixels 720] ? 12 : 4}]] {::sorma::style pixels $n}]
        if {$beside} {
            grid columnconfigure $win 2 -minsize [expr {max(0, [winfo width $win] - [::sorma::style pixels 1600])}]
        }
        if {$beside eq $columns} return
        set columns $beside
        set edge [::sorma::style pixels 16]
        set pad [::sorma::style pixels 8]
        set row 3
        foreach part {ask said actions what trail messages} {
            if {![winfo exists $win.$part]} continue
            set shown [expr {[winfo manager $win.$part] ne {}}]
            grid $win.$part -in [expr {$beside ? "$win.aside" : $win}] -row [incr row] -column 0 -padx [expr {$beside ? [list 0 $edge] : $edge}] \
                -sticky [dict get [dict merge [list $part ew] {trail w messages nsew}] $part] -pady [list 0 $pad]
            if {$part eq "trail"} {
                grid configure $win.trail -padx [expr {$beside ? $pad : $edge + $pad}]          ;# its text stands below that of the cards
            }
            if {!$shown} {
                grid remove $win.$part
            }
        }
        foreach frame [list $win $win.aside] {
            grid rowconfigure $frame 9 -weight [expr {$trailShown && ($frame eq $win) != $beside ? 1000000 : 0}]
        }
        grid configure $win.head -columnspan [expr {$beside ? 2 : 1}]
        grid columnconfigure $win 1 -weight [expr {$beside ? 2 : 0}] -uniform [if {$beside} {string cat part}]
        if {$beside} {
            grid $win.aside -row 1 -column 1 -rowspan 20 -sticky nsew
        } else {
            grid remove $win.aside
            grid columnconfigure $win 2 -minsize 0
        }
    }
    # Pixels of the window's height that the other parts of the first column leave.
    method Free {} {
        set gap [::sorma::style pixels 8]
        set free [expr {[winfo height $win] - 3 * $gap}]
        foreach part [concat {head find apply} [if {$columns ne "1"} {list ask said actions what trail messages}]] {
            if {[winfo exists $win.$part] && [winfo manager $win.$part] ne {}} {
                set free [expr {$free - [winfo reqheight $win.$part] - $gap}]
            }
        }
        return $free
    }
    method Unfold {} {
        $win.trail configure -text "[expr {$trailShown ? "\u25be" : "\u25b8"}] [::msgcat::mc Trail]"
        if {$trailShown && ![winfo exists $win.messages]} {
            set name [$subject name]
            ::sorma::trailview $win.messages -style Page.TFrame -keys [string map {* \\* ? \\? [ \\[} [if {[string first @ $name] < 0} {string cat $name@self} else {set name}]]
        }
        if {[winfo exists $win.messages]} {
            grid {*}[expr {$trailShown ? {} : "remove"}] $win.messages
            set columns {}
            $self Columns
        }
    }
}
