# field.tcl -- widgets for one option of a service object, each usable by itself: sorma::slider, entry, choice and check; sorma::button
# runs a request, sorma::led shows a state.
#
# They are ttk megawidgets: configure and cget with options in Tk's spelling, any geometry manager, nothing left when destroyed. What
# they show comes from a subject, and what is done to them goes there: none of them asks anybody, and none of them waits.

package require Tk
package require snit
package require sorma::style
package require sorma::subject
package provide sorma::field 1.0

# What the widgets for options have in common.
#   -name    of the object      -option  -tempo        -apply  now (each change is sent) or later (the subject keeps it)
#   -state   normal, readonly or disabled              -live   ms, for what changes by itself
snit::macro ::sorma::fieldParts {} {
    hulltype ttk::frame
    option -name -default {} -readonly 1
    option -option -default {} -readonly 1
    option -live -default 0 -readonly 1
    option -apply -default now
    option -state -default normal -configuremethod SetState
    variable subject {}
    variable listener {}
    variable facts {}           ;# what the option is, as the subject says it; empty: not known yet
    variable showing 0          ;# is it we who change the editor
    component editor

    method SetState {option value} {
        set options($option) $value
        if {$subject ne {}} {
            $self Show
        }
    }
    method Begin {} {
        if {$options(-name) eq {} || $options(-option) eq {}} {
            return -code error -errorcode {SORMA REQUEST SYNTAX} "[$self info type]: -name and -option must say what it is for"
        }
        set subject [::sorma::subject of $options(-name) -live $options(-live)]
        set listener [$subject listen [mymethod Told]]
        bind $win <Destroy> +[mymethod Ended %W]
        bind $win <FocusIn> "[list focus] \[lindex \[winfo children [list $win]\] 0\]"
        $self Table
    }
    method Ended window {
        if {$window eq $win && $subject ne {}} {
            $subject unlisten $listener
            $subject release
            set subject {}
        }
    }
    method Told {what changed} {
        if {$subject eq {}} return
        if {$what eq "table"} {
            $self Table
        } elseif {$what eq "state" || $options(-option) in $changed} {
            $self Show
        }
    }
    method Table {} {
        if {[$subject table] ne {}} {
            set facts [$subject option $options(-option)]
            $self Build
        }
        $self Show
    }
    # Somebody has changed the editor.
    method Edited value {
        if {$showing || $subject eq {}} return
        if {$options(-apply) eq "now"} {
            $subject send $options(-option) $value
        } else {
            $subject edit $options(-option) $value
        }
    }
    method Show {} {
        if {$facts eq {} || ![winfo exists $win]} return
        set told [$subject get $options(-option)]
        set showing 1
        $self Put [dict get $told value]
        set showing 0
        set can [expr {$options(-state) eq "normal" && [dict get $told state] ni {asking gone locked}}]
        $self Enable [expr {$can ? "normal" : $options(-state) eq "normal" ? "disabled" : $options(-state)}]
        event generate $win <<SormaShown>>
    }
    # subject -- of the widget. value, apply, revert: of its option.
    method subject {} {
        return $subject
    }
    method value {} {
        return [dict get [$subject get $options(-option)] value]
    }
    method apply {} {
        $subject apply $options(-option)
    }
    method revert {} {
        $subject revert $options(-option)
    }
}

# ::sorma::entry .w -name NAME -option -OPTION -- a text or a number; Return and leaving the field take what was typed, Escape takes it
# back.
snit::widget ::sorma::entry {
    ::sorma::fieldParts
    variable text {}
    constructor args {
        install editor using ttk::entry $win.entry -textvariable [myvar text] -width 12
        pack $editor -fill both -expand 1
        $self configurelist $args
        bind $editor <Return> [mymethod Take 1]
        bind $editor <FocusOut> [mymethod Take 0]
        bind $editor <Escape> [mymethod revert]
        $self Begin
        trace add variable [myvar text] write [mymethod Typed]      ;# by keys, or pasted
    }
    method Build {} {
        if {[dict get $facts type] in {int double time}} {
            $editor configure -justify right
        }
    }
    # While somebody types nothing is put into the field but what was typed.
    method Put value {
        if {[focus] ne $editor || ![$self Touched]} {
            set text $value
        }
    }
    method Touched {} {
        return [expr {$options(-option) in [$subject edited]}]
    }
    method Typed args {
        if {!$showing && $subject ne {} && $text ne [$self value]} {
            $subject edit $options(-option) $text
        }
    }
    method Take now {
        if {$subject eq {} || ![$self Touched]} return
        if {$options(-apply) eq "now" && [dict get [$subject get $options(-option)] state] ne "refused" || $now} {
            $subject apply $options(-option)
        }
    }
    method Enable state {
        $editor configure -state $state
    }
}

# ::sorma::slider -- a number with a range: a scale, and an entry for those who know it exactly. One request is under way, and the last
# value is always sent.
snit::widget ::sorma::slider {
    ::sorma::fieldParts
    option -length -default 140
    component entry
    variable position 0
    constructor args {
        $self configurelist $args
        install editor using ttk::scale $win.scale -variable [myvar position] -length [::sorma::style pixels $options(-length)] \
            -command [mymethod Moved]
        install entry using ::sorma::entry $win.entry -name $options(-name) -option $options(-option) -apply $options(-apply) \
            -live $options(-live)
        pack $entry -side right
        pack $editor -side left -fill x -expand 1 -padx [list 0 [::sorma::style pixels 6]]
        $self Begin
    }
    method Build {} {
        lassign [Range [dict get $facts range]] low high
        $editor configure -from $low -to $high
    }
    # low .. high
    proc Range range {
        if {![regexp {^(\S+) \.\. (\S+)$} $range -> low high]} {
            return {0 1}
        }
        return [list $low $high]
    }
    method Moved value {
        if {$showing || $facts eq {}} return
        $self Edited [if {[dict get $facts type] eq "int"} {expr {round($value)}} else {$self Rounded $value}]
    }
    # As many digits as pixels of the scale can tell.
    method Rounded value {
        lassign [Range [dict get $facts range]] low high
        set step [expr {($high - $low) / max(1.0, [winfo width $editor])}]
        set digits [expr {$step > 0 ? max(0, int(ceil(-log10($step)))) : 3}]
        return [expr {double([format %.*f $digits $value])}]
    }
    method Put value {
        if {[string is double -strict $value]} {
            set position $value
        }
    }
    method Enable state {
        $editor state [expr {$state eq "normal" ? "!disabled" : "disabled"}]
        $entry configure -state $options(-state)
    }
}

# ::sorma::choice -- one of a few words: radio buttons up to three, else a combobox; the wheel does not change it.
snit::widget ::sorma::choice {
    ::sorma::fieldParts
    variable text {}
    variable made {}
    constructor args {
        $self configurelist $args
        $self Begin
    }
    method Build {} {
        set words [dict get $facts range]
        if {$words eq $made} return
        set made $words
        destroy {*}[winfo children $win]
        if {[llength $words] <= 3 && [string length [join $words]] < 40} {
            set n 0
            foreach word $words {
                ttk::radiobutton $win.r[incr n] -text $word -value $word -variable [myvar text] -command [mymethod Chosen]
                pack $win.r$n -side left -padx [list 0 [::sorma::style pixels 8]]
            }
        } else {
            ttk::combobox $win.box -values $words -textvariable [myvar text] -state readonly \
                -width [expr {max(6, min(30, [tcl::mathfunc::max 0 {*}[lmap word $words {string length $word}]] + 1))}]
            bind $win.box <<ComboboxSelected>> [mymethod Chosen]
            foreach event {<MouseWheel> <Button-4> <Button-5>} {
                bind $win.box $event {continue}
            }
            bindtags $win.box [lsearch -all -inline -not -exact [linsert [bindtags $win.box] 1 SormaCombobox] TCombobox]
            pack $win.box -fill x
        }
    }
    method Chosen {} {
        $self Edited $text
    }
    method Put value {
        set text $value
    }
    method Enable state {
        foreach child [winfo children $win] {
            $child state [expr {$state eq "normal" ? "!disabled" : "disabled"}]
        }
    }
}
# A combobox in all but the wheel.
foreach event [bind TCombobox] {
    if {![string match *MouseWheel* $event] && $event ni {<Button-4> <Button-5>}} {
        bind SormaCombobox $event [bind TCombobox $event]
    }
}

# ::sorma::check -- a flag.
snit::widget ::sorma::check {
    ::sorma::fieldParts
    option -text -default {} -configuremethod SetText
    variable on 0
    constructor args {
        install editor using ttk::checkbutton $win.check -variable [myvar on] -command [mymethod Toggled]
        pack $editor -side left
        $self configurelist $args
        $self Begin
    }
    method SetText {option value} {
        set options(-text) $value
        $editor configure -text $value
    }
    method Build {} {}
    method Toggled {} {
        $self Edited [expr {$on ? 1 : 0}]
    }
    method Put value {
        set on [expr {[string is boolean -strict $value] && $value}]
    }
    method Enable state {
        $editor state [expr {$state eq "normal" ? "!disabled" : "disabled"}]
    }
}

# ::sorma::button .w -name NAME -request {CTRL -start} ?-text text? ?-command prefix? -- runs a request, and shows that it runs, that it is
# done, or why it failed. prefix gets ok and the reply, or error and a list of message and code.
snit::widget ::sorma::button {
    hulltype ttk::frame
    option -name -default {} -readonly 1
    option -request -default EXEC
    option -text -default {} -configuremethod SetText
    option -command -default {}
    option -state -default normal -configuremethod SetState
    component button
    component lamp
    variable subject {}
    variable running 0
    variable answer {}
    constructor args {
        install button using ttk::button $win.button -command [mymethod invoke]
        install lamp using ttk::label $win.lamp -width 2 -anchor center
        pack $button -side left -fill x -expand 1
        pack $lamp -side left
        $self configurelist $args
        if {$options(-name) eq {}} {
            return -code error -errorcode {SORMA REQUEST SYNTAX} "sorma::button: -name must say of which object"
        }
        if {$options(-text) eq {}} {
            $button configure -text [string totitle [string trimleft [lindex $options(-request) end] -]]
        }
        set subject [::sorma::subject of $options(-name)]
        bind $win <Destroy> +[mymethod Ended %W]
    }
    method Ended window {
        if {$window eq $win && $subject ne {}} {
            $subject release
            set subject {}
        }
    }
    method SetText {option value} {
        set options($option) $value
        $button configure -text $value
    }
    method SetState {option value} {
        set options($option) $value
        $button state [expr {$value eq "normal" ? "!disabled" : "disabled"}]
    }
    # What came of it last: running, ok or error, and the reply or the message; empty: nothing yet.
    method answer {} {
        return $answer
    }
    method invoke {} {
        incr running
        $self Light sending running {}
        $subject ask $options(-request) [mymethod Answered]
    }
    method Answered {status value} {
        incr running -1
        if {![winfo exists $win]} return
        if {$status eq "ok"} {
            $self Light good ok $value
        } else {
            $self Light refused error [lindex $value 0]
        }
        if {$options(-command) ne {}} {
            uplevel #0 [list {*}$options(-command) $status $value]
        }
        event generate $win <<SormaAnswered>>
    }
    method Light {state what value} {
        set answer [list $what $value]
        $lamp configure -text [::sorma::style mark $state] -foreground [::sorma::style colour $state]
    }
}
