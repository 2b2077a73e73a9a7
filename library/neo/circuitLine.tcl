# circuitLine.tcl -- ::sorma::circuitLine: the line in which wires, units and comments are typed in the circuit editor, and its menu.

package require Tk
package require snit
package require sorma::style
package provide sorma::circuitLine 1.0

snit::macro ::sorma::circuitLine {} {
    variable typed {}           ;# in the line
    variable lineFor {}         ;# what it is typed for: {note new X Y}, {frame new KEYS}, or the KEY of a note or frame; empty: wires and units

    # A line to type in: another text for the wire or note that is selected, else a new wire, or a class for a new unit. WHAT: as lineFor.
    method Line {{what {}}} {
        if {$options(-state) eq "readonly"} return
        if {$what eq {} && $chosenWires eq {} && [llength $chosenKeys] == 1 && [dict exists $notes [lindex $chosenKeys 0]]} {
            set what [lindex $chosenKeys 0]
        }
        set lineFor $what
        set typed [if {$what ne {}} {
            if {[dict exists $notes $what]} {string map {\n \\n} [dict get $notes $what text]}
        } elseif {$chosenWires ne {}} {lindex [dict get $graph pieces] [lindex [dict get $graph wires] [lindex $chosenWires 0] 0]}]
        if {![winfo exists $win.line]} {
            ::ttk::entry $win.line -textvariable [myvar typed]
            bind $win.line <Return> [mymethod LineDone]
            bind $win.line <Escape> [mymethod LineEnd]
        }
        pack $win.line -side bottom -fill x -padx [::sorma::style pixels 8] -before $win.panes
        set file "a file at the circuit's machine; Return takes it, Escape ends"
        set hint [expr {$what in {record look} ? $file : $what eq {} ? "source -> sink, or a class; Return takes it, Escape ends"
            : $what eq "save" ? "a flavor, such as night, or nothing for its own name; Return saves it, Escape ends"
            : [lindex $what 0] eq "note" ? "a comment, with \\n for a new line; Return takes it, Escape ends"
            : "the title of the frame; Return takes it, Escape ends"}]
        focus $win.line
        $win.line icursor end
    }
    method LookBack {} {
        $self Line look
    }
    method LineEnd {} {
        pack forget $win.line
        set hint {}
        focus $scene
    }
    method LineDone {} {
        set text [string trim $typed]
        try {
            if {$lineFor in {save record look}} {
                $self [dict get {save saveAs record record look look} $lineFor] $text
                pack forget $win.line
                focus $scene
                return
            } elseif {$lineFor ne {}} {
                $self NoteTyped $text
            } elseif {$chosenWires ne {}} {
                $self replace [lindex $chosenWires 0] $text
            } elseif {[regexp {^(\S.*\S|\S)\s+->\s+(\S+)$} $text -> source sink]} {
                $self connect $source $sink
            } elseif {$text ne {}} {
                $self drop $text {*}[$self Middle]
            }
            $self LineEnd
        } on error message {
            set hint "[::sorma::style mark refused] $message"
        }
    }
    # The menu of the right button is for what lies below the pointer, or is selected.
    method Offer {menu window} {
        if {$options(-state) eq "readonly"} return
        lassign [winfo pointerxy $window] x y
        set x [expr {$x - [winfo rootx $window]}]
        set y [expr {$y - [winfo rooty $window]}]
        if {$x >= 0 && $y >= 0 && $x < [winfo width $window] && $y < [winfo height $window] && [lindex [$scene hit $x $y] 1] ni $chosenKeys} {
            $self Press $x $y 0
            $self Drop $x $y
        }
        foreach {text method key has} [list "Comment\u2026" Comment c 1 "Frame\u2026" Frame f [llength $chosenKeys] Copy copy Ctrl-C [llength $chosenKeys] \
                Paste paste Ctrl-V 1 \
                "Circuit inside" nest Ctrl-G [llength $chosenKeys] "Its units" unnest Ctrl-U [string match {unit circuit*} [lindex $chosenKeys 0]] \
                "Save as\u2026" SaveAs Ctrl-S 1 "Compare with its recipe" compare d 1 \
                [expr {$recording eq {} ? "Record\u2026" : "End the recording"}] Record Ctrl-R 1 "Look back\u2026" LookBack Ctrl-B 1 Delete Remove Delete [expr {$chosenKeys ne {} || $chosenWires ne {}}]] {
            $menu add command -label [::msgcat::mc $text] -command [mymethod $method] -accelerator $key -state [expr {$has ? "normal" : "disabled"}]
        }
        $menu add checkbutton -label [::msgcat::mc "Rates"] -accelerator r -variable [myvar options](-rates) -command [mymethod Values]
    }
}
