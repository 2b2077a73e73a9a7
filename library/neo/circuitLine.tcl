# circuitLine.tcl -- ::sorma::circuitLine: the line in which wires, units and comments are typed in the circuit editor, and its menu.

package require Tk
package require snit
package require sorma::style
package provide sorma::circuitLine 1.0

snit::macro ::sorma::circuitLine {} {
    variable typed {}           ;# in the line
    variable lineFor {}         ;# what it is typed for: {note new X Y}, {frame new KEYS}, the KEY of a note or frame, {wire SOURCE SINK}; empty: new wires and units

    # A line to type in: another text for the wire or note that is selected, else a new wire, or a class for a new unit. WHAT: as lineFor.
    method Line {{what {}}} {
        if {$options(-state) eq "readonly"} return
        if {$what eq {} && $chosenWires eq {} && [llength $chosenKeys] == 1 && [dict exists $notes [lindex $chosenKeys 0]]} {
            set what [lindex $chosenKeys 0]
        }
        set typed [if {[dict exists $notes $what]} {string map {\n \\n} [dict get $notes $what text]}]
        if {$what eq {} && $chosenWires ne {}} {
            set wire [lindex [dict get $graph wires] [lindex $chosenWires 0]]
            set what [list wire {*}[lrange $wire 1 2]]
            set typed [lindex [dict get $graph pieces] [lindex $wire 0]]
        }
        set lineFor $what
        if {![winfo exists $win.line]} {
            ::ttk::entry $win.line -textvariable [myvar typed]
            bind $win.line <Return> [mymethod LineDone]
            bind $win.line <Escape> [mymethod LineEnd]
        }
        pack $win.line -side bottom -fill x -padx [::sorma::style pixels 8] -before $win.panes
        set file "a file at the circuit's machine; Return takes it, Escape ends"
        set hint [expr {$what in {record look} ? $file : $what eq {} ? "source -> sink, or a class; Return takes it, Escape ends"
            : [lindex $what 0] eq "wire" ? "source -> sink; Return takes it, Escape ends"
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
        set hint {}
        pack forget $win.line
        focus $scene
    }
    method LineDone {} {
        set text [string trim $typed]
        set hint {}
        try {
            if {$lineFor in {save record look}} {
                $self [dict get {save saveAs record record look look} $lineFor] $text
            } elseif {[lindex $lineFor 0] eq "wire"} {
                set number [$self WireNow {*}[lrange $lineFor 1 2]]
                $self replace $number $text
                set chosenWires [list $number]
                $self Selected
            } elseif {$lineFor ne {}} {
                $self NoteTyped $text
            } elseif {[regexp {^(\S.*\S|\S)\s+->\s+(\S+)$} $text -> source sink]} {
                $self connect $source $sink
            } elseif {$text ne {}} {
                $self drop $text {*}[$self Middle]
            }
            pack forget $win.line
            focus $scene
        } on error message {
            set hint "[::sorma::style mark refused] $message"
        }
    }
    # The number of a wire that may stand elsewhere by now.
    method WireNow {source sink} {
        set found [lsearch -exact [lmap wire [dict get $graph wires] {lrange $wire 1 2}] [list $source $sink]]
        if {$found < 0} {
            return -code error "there is no wire [::sorma::circuitText between $source $sink] any more"
        }
        return $found
    }
    # The menu is for what is selected.
    method Offer {menu window} {
        if {$options(-state) eq "readonly"} return
        foreach {text method key has} [list "Look inside" LookInside o [expr {$chosenKeys ne {} || $chosenWires ne {}}] "Comment\u2026" Comment c 1 "Frame\u2026" Frame f [llength $chosenKeys] Copy copy Ctrl-C [llength $chosenKeys] \
                Paste paste Ctrl-V 1 \
                "Circuit inside" nest Ctrl-G [llength $chosenKeys] "Its units" unnest Ctrl-U [string match {unit circuit*} [lindex $chosenKeys 0]] \
                "Save as\u2026" SaveAs Ctrl-S 1 "Compare with its recipe" compare d 1 \
                [expr {$recording eq {} ? "Record\u2026" : "End the recording"}] Record Ctrl-R 1 "Look back\u2026" LookBack Ctrl-B 1 \
                "Save the picture\u2026" Print Ctrl-P 1 Delete Remove Delete [expr {$chosenKeys ne {} || $chosenWires ne {}}]] {
            $menu add command -label [::msgcat::mc $text] -command [mymethod $method] -accelerator $key -state [expr {$has ? "normal" : "disabled"}]
        }
        $menu add checkbutton -label [::msgcat::mc "Rates"] -accelerator r -variable [myvar options](-rates) -command [mymethod Values]
    }
}
