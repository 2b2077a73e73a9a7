# panelFrames.tcl -- sorma::panelFrames, the parts of a panel around its fields: head, search, Apply, questions and EXEC. A macro for its body.

package require Tk
package require snit
package require sorma::execform
package require sorma::lamp
package require sorma::notice
package require sorma::parts
package require sorma::style
package provide sorma::panelFrames 1.0

# ::sorma::panelFrames -- the widget is a panel: buttons, entries and keys call its methods, and change its variables wanted, readOnly, atOnce and
# asked. BuildFrames makes all parts, and sets its variables canvas and inner. Place puts head, find, body and apply one below the other in column 0;
# panelColumns places the others. Bind binds the keys.
snit::macro ::sorma::panelFrames {} {
    method BuildFrames {} {
        set inside [list [::sorma::style pixels 16] [::sorma::style pixels 12]]
        $self BuildHead $inside
        $self BuildFind $inside
        $self BuildBody
        $self BuildApply $inside
        $self BuildAsk $inside
        $self BuildSaid $inside
        ttk::frame $win.actions -style Card.TFrame -padding $inside
        $self BuildExec $inside
    }
    # Its name, its state, and its stop buttons.
    method BuildHead inside {
        set pad [::sorma::style pixels 8]
        ttk::frame $win.head -style Card.TFrame -padding $inside
        ttk::label $win.head.name -text [$subject name] -font [::sorma::style font title]
        ::sorma::status $win.head.state -name [$subject name] -brief 1
        ::sorma::notice $win.head.say
        ttk::checkbutton $win.head.readonly -style [::sorma::style own TCheckbutton] -text [::msgcat::mc "read only"] -variable [myvar readOnly] \
            -command [mymethod Switched] -underline 5
        ttk::frame $win.head.stop
        grid $win.head.name $win.head.state $win.head.stop $win.head.readonly -sticky ew -padx [list 0 $pad]
        grid configure $win.head.readonly -padx 0
        grid $win.head.say -row 1 -columnspan 4 -sticky ew -pady [list [::sorma::style pixels 4] 0]
        grid columnconfigure $win.head 1 -weight 1
    }
    method BuildFind inside {
        set pad [::sorma::style pixels 8]
        ttk::frame $win.find -style Card.TFrame -padding $inside
        ttk::label $win.find.label -text [::msgcat::mc "Search"] -underline 0
        ttk::entry $win.find.entry -textvariable [myvar wanted]
        pack $win.find.label -side left -padx [list 0 $pad]
        pack $win.find.entry -side left -fill x -expand 1
        bind $win.find.entry <KeyRelease> [mymethod Arrange]
        bind $win.find.entry <Escape> [mymethod search {}]
    }
    # The fields, in a canvas that scrolls.
    method BuildBody {} {
        ttk::frame $win.body
        set inner [::sorma::parts::scroller $win.body [mymethod Scrolled]]
        set canvas $win.body.canvas
        $canvas configure -width [::sorma::style pixels 500] -height [::sorma::style pixels 240]
        bind $inner <Configure> [mymethod Sized]
    }
    method BuildApply inside {
        set pad [::sorma::style pixels 8]
        ttk::frame $win.apply -style Card.TFrame -padding $inside
        ttk::button $win.apply.apply -style Accent.TButton -text [::msgcat::mc Apply] -command [mymethod apply] -underline 0
        ttk::button $win.apply.revert -text [::msgcat::mc Revert] -command [mymethod revert] -underline 0
        ttk::checkbutton $win.apply.once -style [::sorma::style own TCheckbutton] -text [::msgcat::mc "apply at once"] -variable [myvar atOnce] \
            -command [mymethod Switched]
        pack $win.apply.apply $win.apply.revert -side left -padx [list 0 $pad]
        pack $win.apply.once -side right
    }
    # Requests from menus: a word, and the answer.
    method BuildAsk inside {
        set pad [::sorma::style pixels 8]
        ttk::frame $win.ask -style Card.TFrame -padding $inside
        ttk::label $win.ask.label
        ttk::entry $win.ask.entry -textvariable [myvar asked]
        ttk::button $win.ask.ok -text [::msgcat::mc OK]
        pack $win.ask.label $win.ask.entry $win.ask.ok -side left -padx [list 0 $pad]
        pack configure $win.ask.entry -fill x -expand 1
        bind $win.ask.entry <Return> [list $win.ask.ok invoke]
        bind $win.ask.entry <Escape> [list grid remove $win.ask]
    }
    method BuildSaid inside {
        ttk::label $win.said -wraplength [::sorma::style pixels 420] -justify left -padding $inside
        bind $win.said <ButtonPress-1> [mymethod Say {}]
    }
    method BuildExec inside {
        set pad [::sorma::style pixels 8]
        ttk::frame $win.what -style Card.TFrame -padding $inside
        pack [ttk::label $win.what.title -text EXEC -font [::sorma::style font strong]] -anchor w -pady [list 0 $pad]
        ::sorma::execform $win.exec -name [$subject name]
        raise $win.exec
        pack $win.exec -in $win.what -fill both -expand 1
        bind $win.exec <<SormaReplied>> [list event generate $win <<SormaReplied>>]
    }

    method Place {} {
        set pad [::sorma::style pixels 8]
        set edge [::sorma::style pixels 16]
        set row -1
        foreach part {head find body apply} {
            grid $win.$part -row [incr row] -column 0 -sticky [expr {$part eq "body" ? "nsew" : "ew"}] -pady [list [expr {$row == 0 ? $edge : 0}] [expr {$part eq "body" ? 0 : $pad}]] \
                -padx [expr {$part eq "body" ? [::sorma::parts::margin $win.body $edge] : $edge}]
        }
        grid remove $win.find $win.apply
    }
    # Keys act wherever the focus is within the panel, and not in one beside it.
    method Bind {} {
        foreach {key script} [list <Alt-a> [mymethod apply] <Alt-r> [mymethod revert] <Alt-e> [mymethod execute] \
                <Alt-s> [list focus $win.find.entry] <Alt-t> [list $win.trail invoke] \
                <Alt-o> [list $win.head.readonly invoke]] {
            bind [$self Tag] $key "$script; break"
        }
        ::sorma::style menu [$self Tag] $win [mymethod Menu]            ;# before a scale, which would jump there
        bind [$self Tag] <FocusIn> [list ::sorma::parts::see $canvas %W]
    }
}
