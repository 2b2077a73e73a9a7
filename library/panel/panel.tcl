# panel.tcl -- sorma::panel, a panel for any service object, from its option table and its signature alone.
#
# Its parts are the widgets of field.tcl and one subject; it asks nobody itself, and a daemon that does not answer never makes it stand
# still: its fields turn stale, and say why.

package require Tk
package require snit
package require sorma::field
package require sorma::lamp
package require sorma::reply
package require sorma::trailview
package provide sorma::panel 1.0

# ::sorma::panel .w NAME ?-options list? ?-live ms? ?-apply now|later? ?-state normal|readonly? --
#       A frame with everything that can be set, tried and asked of an object, here or elsewhere. The object need not be there.
# Arguments:
#       list    of options that are shown, in this order; default all
#       ms      how often what changes by itself is asked for, default 1000
#       later   changes are kept until Apply is pressed; a switch in the panel changes that
# Methods:
#       subject, apply, revert; field OPTION: the widget of an option; search TEXT; execute
snit::widget ::sorma::panel {
    hulltype ttk::frame
    option -options -default {} -readonly 1
    option -live -default 1000 -readonly 1
    option -apply -default later -configuremethod SetApply
    option -state -default normal -configuremethod SetState
    variable subject {}
    variable listener {}
    variable shape {}           ;# of the table that is shown
    variable rows {}            ;# dict: -option -> number of its row
    variable wanted {}          ;# what is searched for
    variable searchable 12      ;# options: with more there is a field to search in
    variable trailShown 0
    variable atOnce 0
    variable readOnly 0
    component canvas
    component inner

    constructor {name args} {
        set subject [::sorma::subject of $name -live [from args -live 1000]]
        $self configurelist $args
        set listener [$subject listen [mymethod Told]]
        set pad [::sorma::style pixels 6]
        set small [::sorma::style pixels 3]
        # What it is, and how it is.
        ttk::frame $win.head
        ttk::label $win.head.name -text [$subject name] -font [::sorma::style font strong]
        ::sorma::status $win.head.state -name [$subject name]
        ttk::label $win.head.purpose -foreground [::sorma::style colour asking]
        ttk::checkbutton $win.head.readonly -text "read only" -variable [myvar readOnly] -command [mymethod Switched]
        grid $win.head.name $win.head.state $win.head.readonly -sticky ew -padx [list 0 $pad]
        grid $win.head.purpose - - -sticky w
        grid columnconfigure $win.head 1 -weight 1
        # What can be set.
        ttk::frame $win.find
        ttk::label $win.find.label -text "Search"
        ttk::entry $win.find.entry -textvariable [myvar wanted]
        pack $win.find.label -side left -padx [list 0 $pad]
        pack $win.find.entry -side left -fill x -expand 1
        bind $win.find.entry <KeyRelease> [mymethod Arrange]
        ttk::frame $win.body
        install canvas using canvas $win.body.canvas -highlightthickness 0 -borderwidth 0 -background [ttk::style lookup . -background] \
            -yscrollcommand [list $win.body.bar set] -width [::sorma::style pixels 420] -height [::sorma::style pixels 240]
        ttk::scrollbar $win.body.bar -command [list $canvas yview]
        install inner using ttk::frame $canvas.inner
        $canvas create window 0 0 -anchor nw -window $inner -tags inner
        bind $inner <Configure> [mymethod Sized]
        bind $canvas <Configure> "[list $canvas] itemconfigure inner -width %w"
        pack $win.body.bar -side right -fill y
        pack $canvas -side left -fill both -expand 1
        ttk::frame $win.apply
        ttk::button $win.apply.apply -text Apply -command [mymethod apply] -underline 0
        ttk::button $win.apply.revert -text Revert -command [mymethod revert] -underline 0
        ttk::checkbutton $win.apply.once -text "apply at once" -variable [myvar atOnce] -command [mymethod Switched]
        pack $win.apply.apply $win.apply.revert -side left -padx [list 0 $pad]
        pack $win.apply.once -side right
        # What it does.
        ttk::frame $win.actions
        ttk::labelframe $win.exec -text EXEC -padding $pad
        ttk::button $win.exec.go -text Execute -command [mymethod execute] -underline 0
        ttk::label $win.exec.lamp -width 2
        text $win.exec.reply -height 5 -width 40 -wrap word -state disabled -font [::sorma::style font fixed] -relief flat \
            -background [ttk::style lookup . -background] -foreground [ttk::style lookup . -foreground] -takefocus 0
        grid $win.head -sticky ew -padx $pad -pady [list $pad $small]
        grid $win.find -sticky ew -padx $pad -pady $small
        grid $win.body -sticky nsew -padx $pad -pady $small
        grid $win.apply -sticky ew -padx $pad -pady $small
        grid $win.actions -sticky ew -padx $pad -pady $small
        grid $win.exec -sticky ew -padx $pad -pady [list $small $pad]
        # What went wrong: folded until somebody wants to see it.
        ttk::checkbutton $win.trail -text "Trail" -variable [myvar trailShown] -command [mymethod Unfold] -style Toolbutton
        grid $win.trail -sticky w -padx $pad -pady [list 0 $small]
        grid columnconfigure $win 0 -weight 1
        grid rowconfigure $win 2 -weight 1
        bind $win <Destroy> +[mymethod Ended %W]
        foreach {key method} {<Alt-a> apply <Alt-r> revert <Alt-e> execute} {
            bind $win $key [mymethod $method]
        }
        $self Table
        $self Switched
    }

    method Ended window {
        if {$window eq $win && $subject ne {}} {
            $subject unlisten $listener
            $subject release
            set subject {}
        }
    }

    # ---- what programs say ----

    method subject {} {
        return $subject
    }
    method apply {} {
        $subject apply
    }
    method revert {} {
        $subject revert
        focus $win
    }
    method field option {
        if {![dict exists $rows $option]} {
            return -code error -errorcode [list SORMA OPTION UNKNOWN $option] "[$subject name]: the panel shows no option $option"
        }
        return $inner.field[dict get $rows $option]
    }
    method search text {
        set wanted $text
        $self Arrange
    }
    # execute -- EXEC with what stands in the form.
    method execute {} {
        if {$readOnly} return
        set words EXEC
        foreach {field key} {floats FMSG ints IMSG words WMSG text TMSG any AMSG} {
            set entry $win.exec.in_$field
            if {![winfo exists $entry]} continue
            set value [$entry get]
            if {$value eq {}} continue
            if {$field in {floats ints words}} {
                if {[catch {llength $value} n]} {
                    return [$self Replied error [list "$field: $n" {}]]
                }
                lappend words $key $n {*}$value
            } else {
                lappend words $key $value
            }
        }
        $win.exec.lamp configure -text [::sorma::style mark sending] -foreground [::sorma::style colour sending]
        $subject ask $words [mymethod Replied]
    }
    method Replied {status value} {
        if {![winfo exists $win]} return
        if {$status eq "ok"} {
            set state [expr {[dict get $value code] > 0 ? "warn" : "good"}]
            set text [::sorma::show $value -colour 0 -width 0]
        } else {
            set state refused
            set text [lindex $value 0]
        }
        $win.exec.lamp configure -text [::sorma::style mark $state] -foreground [::sorma::style colour $state]
        $win.exec.reply configure -state normal
        $win.exec.reply replace 1.0 end $text
        $win.exec.reply configure -state disabled
        event generate $win <<SormaReplied>>
    }

    method Unfold {} {
        if {$trailShown && ![winfo exists $win.messages]} {
            set name [$subject name]
            ::sorma::trailview $win.messages -keys [string map {* \\* ? \\? [ \\[} [if {[string first @ $name] < 0} {string cat $name@self} else {set name}]]
        }
        if {$trailShown} {
            grid $win.messages -row 7 -sticky nsew -padx [::sorma::style pixels 6] -pady [list 0 [::sorma::style pixels 6]]
        } else {
            grid remove $win.messages
        }
    }

    # ---- building ----

    method SetApply {option value} {
        set options($option) $value
        set atOnce [expr {$value eq "now"}]
        $self Switched
    }
    method SetState {option value} {
        set options($option) $value
        set readOnly [expr {$value ne "normal"}]
        $self Switched
    }
    # One of the switches was moved.
    method Switched {} {
        set options(-apply) [expr {$atOnce ? "now" : "later"}]
        set options(-state) [expr {$readOnly ? "readonly" : "normal"}]
        foreach {option row} $rows {
            $inner.field$row configure -apply $options(-apply) -state $options(-state)
        }
        if {[winfo exists $win.exec.go]} {
            set state [expr {$readOnly ? "disabled" : "!disabled"}]
            $win.exec.go state $state
            foreach child [winfo children $win.actions] {
                $child configure -state [expr {$readOnly ? "disabled" : "normal"}]
            }
            $self Shown
        }
    }

    method Told {what changed} {
        if {$subject eq {}} return
        if {$what eq "table"} {
            $self Table
        }
        $self Shown
    }

    # The table has come, or it is another one.
    method Table {} {
        set table [$subject table]
        if {$table eq {}} return
        $win.head.purpose configure -text "[dict get $table class]: [dict get $table purpose]"
        set all [lmap item [dict get $table options] {lindex $item 0}]
        set chosen [expr {$options(-options) eq {} ? $all : [lmap option $options(-options) {if {$option ni $all} continue; set option}]}]
        destroy {*}[winfo children $inner]
        set rows {}
        set pad [::sorma::style pixels 4]
        set n 0
        foreach option $chosen {
            dict set rows $option [incr n]
            set facts [$subject option $option]
            ttk::label $inner.mark$n -width 2 -anchor center
            ttk::label $inner.label$n -text [string range $option 1 end]
            [Kind $facts] $inner.field$n -name [$subject name] -option $option -apply $options(-apply) -state $options(-state)
            ttk::label $inner.unit$n -text [dict get $facts unit]
            ttk::label $inner.why$n -font [::sorma::style font small] -wraplength [::sorma::style pixels 380] -justify left
            foreach part {label field} {
                ::sorma::style tip $inner.$part$n [string cat [dict get $facts help] [if {[dict get $facts range] ne {}} {string cat "\n" [dict get $facts range]}]]
            }
            bind $inner.label$n <Button-3> [mymethod Menu $option %X %Y]
        }
        grid columnconfigure $inner 2 -weight 1
        $self Arrange
        # Actions, and EXEC.
        destroy {*}[winfo children $win.actions]
        set n 0
        foreach action [dict get $table actions] {
            lassign $action word usage help least
            if {$least > 0} continue
            set button [::sorma::button $win.actions.b[incr n] -name [$subject name] -request [list CTRL $word]]
            ::sorma::style tip $button $help
            grid $button -row [expr {($n - 1) / 4}] -column [expr {($n - 1) % 4}] -sticky ew -padx [list 0 $pad] -pady [list 0 $pad]
        }
        $self Form $table
        ::sorma::style bindWheel $canvas $canvas
    }

    # The widget for an option.
    proc Kind facts {
        switch -- [dict get $facts type] {
            flag { return ::sorma::check }
            enum { return ::sorma::choice }
            int - double {
                if {[regexp {^-?[\d.]\S* \.\. -?[\d.]\S*$} [dict get $facts range]]} {
                    return ::sorma::slider
                }
            }
        }
        return ::sorma::entry
    }

    method Form table {
        foreach child [winfo children $win.exec] {
            if {[string match *.in_* $child] || [string match *.of_* $child]} {
                destroy $child
            }
        }
        set pad [::sorma::style pixels 4]
        set row 0
        foreach item [lsort -unique -index 0 [dict get $table reads]] {
            set field [lindex $item 0]
            set helps [join [lmap part [lsearch -all -inline -index 0 [dict get $table reads] $field] {
                lassign $part - low high unit help
                string cat [expr {$low eq $high ? $low : $high < 0 ? "$low or more" : "$low to $high"}] [if {$unit ne {}} {string cat " " $unit}] [if {$help ne {}} {string cat ": " $help}]
            }] "; "]
            ttk::label $win.exec.of_$field -text $field
            ttk::entry $win.exec.in_$field
            bind $win.exec.in_$field <Return> [mymethod execute]
            ttk::label $win.exec.of_help$field -text $helps -font [::sorma::style font small] -foreground [::sorma::style colour asking]
            grid $win.exec.of_$field -row $row -column 0 -sticky w -padx [list 0 $pad]
            grid $win.exec.in_$field -row $row -column 1 -sticky ew
            grid $win.exec.of_help$field -row [incr row] -column 1 -sticky w
            incr row
        }
        grid $win.exec.go -row $row -column 0 -sticky w -pady $pad
        grid $win.exec.lamp -row $row -column 1 -sticky w
        grid $win.exec.reply -row [incr row] -column 0 -columnspan 2 -sticky ew
        grid columnconfigure $win.exec 1 -weight 1
    }

    # Only what is searched for is shown.
    method Arrange {} {
        set pattern *[string map {* \\* ? \\? \[ \\\[ \\ \\\\} $wanted]*
        set pad [::sorma::style pixels 4]
        set shown 0
        dict for {option n} $rows {
            set facts [$subject option $option]
            if {$wanted ne {} && ![string match -nocase $pattern "$option [dict get $facts help]"]} {
                grid remove $inner.mark$n $inner.label$n $inner.field$n $inner.unit$n $inner.why$n
                continue
            }
            incr shown
            grid $inner.mark$n -row [expr {2 * $n}] -column 0
            grid $inner.label$n -row [expr {2 * $n}] -column 1 -sticky w -padx [list 0 $pad]
            grid $inner.field$n -row [expr {2 * $n}] -column 2 -sticky ew -pady [list $pad 0]
            grid $inner.unit$n -row [expr {2 * $n}] -column 3 -sticky w -padx $pad
            if {[$inner.why$n cget -text] ne {}} {
                grid $inner.why$n -row [expr {2 * $n + 1}] -column 2 -columnspan 2 -sticky w
            } else {
                grid remove $inner.why$n
            }
        }
        if {[dict size $rows] > $searchable} {
            grid $win.find
        } else {
            grid remove $win.find
        }
        if {$shown == 0 && [dict size $rows] > 0 && ![winfo exists $inner.none]} {
            grid [ttk::label $inner.none -text "no option has \"$wanted\" in its name or its help"] -row 0 -column 0 -columnspan 4 -sticky w
        } elseif {$shown > 0} {
            destroy $inner.none
        }
    }
    method Sized {} {
        $canvas configure -scrollregion [$canvas bbox all]
    }

    # Marks, messages, and how its daemon is.
    method Shown {} {
        dict for {option n} $rows {
            set told [$subject get $option]
            set mark [dict get $told state]
            set colour [::sorma::style colour $mark]
            set why [dict get $told why]
            if {$mark eq "theirs"} {
                set why "[if {[dict get $told by] ne {}} {string cat [dict get $told by]} else {string cat somebody}] has set it to [dict get $told live] meanwhile"
            }
            $inner.mark$n configure -text [::sorma::style mark $mark] -foreground $colour
            if {[$inner.why$n cget -text] ne $why} {
                $inner.why$n configure -text $why -foreground $colour
                $self Arrange
            }
        }
        set edited [expr {[llength [$subject edited]] > 0 ? "!disabled" : "disabled"}]
        $win.apply.apply state [expr {$readOnly ? "disabled" : $edited}]
        $win.apply.revert state $edited
    }

    # What can be done with one option.
    method Menu {option x y} {
        destroy $win.menu
        menu $win.menu -tearoff 0
        $win.menu add command -label "Apply $option" -command [list $subject apply $option]
        $win.menu add command -label "Revert $option" -command [list $subject revert $option]
        $win.menu add command -label "Undo what was set last" -command [list $subject ask {CTRL -undo} list]
        $win.menu add command -label "Copy as a request" -command [mymethod Copy $option]
        tk_popup $win.menu $x $y
    }
    method Copy option {
        clipboard clear -displayof $win
        clipboard append -displayof $win -- [list [$subject name] CTRL $option [dict get [$subject get $option] value]]
    }
}
