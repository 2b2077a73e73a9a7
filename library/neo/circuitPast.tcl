# circuitPast.tcl -- ::sorma::circuitPast: in the circuit editor, record the values of a circuit (class recorder), and look at a past moment.
#
# The recorder stands beside the circuit, and records what the editor asks the circuit for. So a recording has a moment for each of -every ms.

package require Tk
package require snit
package require sorma::style
package require sorma::text
package provide sorma::circuitPast 1.0

snit::macro ::sorma::circuitPast {} {
    variable recording {}       ;# the file that is being recorded
    variable moments {}         ;# of the recording that is looked at: list of {seconds since 1970, text of DBX -live}
    variable moment {}          ;# the number of the one that is shown; empty: the present
    variable pastText {}        ;# beside the scale

    # record FILE -- at the machine of the circuit. endRecord: so that it can be looked at.
    method record file {
        $self AskThere [list recorder.neo CTRL -file $file -requests [$self NameThere] -record] [mymethod Recording $file]
    }
    method endRecord {} {
        $self AskThere {recorder.neo CTRL -stop} [mymethod Recording {}]
    }
    method Recording {file status value} {
        if {$status ne "ok"} {
            set hint "[::sorma::style mark refused] recording: [::sorma::text::clean [lindex $value 0]]"
            return
        }
        set recording $file
        set hint [if {$file ne {}} {string cat "records into " $file} else {dict get $value text}]
    }
    method Record {} {
        if {$recording ne {}} {
            $self endRecord
        } else {
            $self Line record
        }
    }
    # look FILE -- at a recording there. present: back to the values of now.
    method look file {
        $self AskThere [list recorder.neoLook CTRL -file $file] [mymethod LookedFor]
    }
    method LookedFor {status value} {
        if {$status ne "ok"} {
            $self LookFailed $value
        } else {
            $self AskThere [list recorder.neoLook EXEC records -name [$self NameThere]] [mymethod Found]
        }
    }
    method LookFailed value {
        set hint "[::sorma::style mark refused] look back: [::sorma::text::clean [lindex $value 0]]"
    }
    method Found {status value} {
        if {$status ne "ok"} {
            $self LookFailed $value
            return
        }
        set moments {}
        foreach record [if {[dict exists $value text]} {dict get $value text}] {
            if {[dict get $record kind] eq "reply" && [dict exists $record request] && [lrange [dict get $record request] 1 end] eq "DBX -live"} {
                lappend moments [list [dict get $record time] [lindex [dict get $record text] 4]]
            }
        }
        if {$moments eq {}} {
            set hint "[::sorma::style mark refused] look back: the recording has no values of this circuit"
            return
        }
        $self PastBar
        $self moment [expr {[llength $moments] - 1}]
    }
    method PastBar {} {
        set bar $win.past
        destroy $bar
        set pad [::sorma::style pixels 8]
        ::ttk::frame $bar -style Card.TFrame -padding [::sorma::style pixels 4]
        ::ttk::scale $bar.scale -from 0 -to [expr {max(1, [llength $moments] - 1)}] -command [mymethod Scrub]
        ::ttk::label $bar.text -textvariable [myvar pastText]
        ::ttk::button $bar.now -text [::msgcat::mc "Present"] -command [mymethod present]
        ::sorma::style tip $bar.now "Show the values of now again (Escape)"
        pack $bar.now $bar.text -side right -padx [list $pad 0]
        pack $bar.scale -side left -fill x -expand 1
        foreach {key step} {Left -1 Right 1 Prior -10 Next 10} {
            bind $bar.scale <$key> "[mymethod StepMoment $step]; break"
        }
        bind $bar.scale <Escape> [mymethod present]
        pack $bar -side bottom -fill x -padx $pad -pady [::sorma::style pixels 4] -before $win.panes
        focus $bar.scale
    }
    # moment ?NUMBER? -- show that one of the recording, from 0. Without a number: {NUMBER COUNT} of the one that is shown.
    method moment {{number {}}} {
        if {$number eq {}} {
            return [list $moment [llength $moments]]
        }
        set moment [expr {max(0, min([llength $moments] - 1, $number))}]
        lassign [lindex $moments $moment] time text
        set pastText "[clock format [expr {int($time)}] -format {%Y-%m-%d %H:%M:%S}][string range [format %.3f [expr {$time - int($time)}]] 1 end]\
            ([expr {$moment + 1}] of [llength $moments])"
        $win.past.scale set $moment
        $self ReadLive $text
        dict set told age {}
        $self Values
    }
    method Scrub value {
        if {round($value) != $moment} {
            $self moment [expr {round($value)}]
        }
    }
    method StepMoment step {
        $self moment [expr {$moment + $step}]
    }
    method present {} {
        destroy $win.past
        set moments [set moment {}]
        $self ReadLive $reply
        $self Values
        focus $scene
    }
}
