# field.tcl -- widgets for one option of a service object, each usable by itself: sorma::slider, entry, vector, choice and check;
# sorma::button runs a request.
#
# They are ttk megawidgets: configure and cget with options in Tk's spelling, any geometry manager, nothing left when destroyed.
# They show values of a subject, and give all input to it. None of them asks anybody, and none of them waits.

package require sorma::parts
package require sorma::table
package require sorma::text
package provide sorma::field 1.0

namespace eval ::sorma::field {}

# The common part of the widgets for options.
#   -name    of the object      -option  -tempo        -apply  now (each change is sent) or later (the subject keeps it)
#   -state   normal, readonly or disabled              -live   ms, for what changes by itself
#   -seen    0: nobody can see it, and it costs nothing
# A widget has methods Build, Put VALUE, to show it, and Enable STATE. One with another field inside is told for both.
snit::macro ::sorma::fieldParts {} {
    ::sorma::parts {-name -option} 0
    ::sorma::checkedOption -apply now SetShared
    ::sorma::checkedOption -state normal SetShared
    option -seen -default 1 -configuremethod SetShared
    variable showing 0          ;# is it we who change the editor
    variable enabled {}         ;# state that the editor has; empty: Enable is to be called
    component editor
    component inside            ;# another field in this one, of the same option

    method SetShared {option value} {
        if {$value eq $options($option)} return
        set options($option) $value
        if {$inside ne {} && $option ne "-seen"} {
            $inside configure $option $value
        }
        if {$subject ne {}} {
            if {$option eq "-seen"} {
                $self Listen
            }
            $self Show
        }
    }
    # The user has changed the editor.
    method Edited value {
        if {$showing || $subject eq {}} return
        if {$options(-apply) eq "now"} {
            $subject send $options(-option) $value
        } else {
            $subject edit $options(-option) $value
        }
    }
    # told: what the subject says of it, from the field around this one.
    method Show {{told {}}} {
        if {$facts eq {}} return
        if {$told eq {}} {
            if {!$options(-seen)} return
            set told [$subject get $options(-option)]
        }
        set showing 1
        $self Put [dict get $told value]
        set showing 0
        set can [expr {$options(-state) eq "normal" && [dict get $told state] ni {asking gone locked}}]
        set state [expr {$can ? "normal" : $options(-state) eq "normal" ? "disabled" : $options(-state)}]
        if {$state ne $enabled} {
            set enabled $state
            $self Enable $state
        }
        if {$inside ne {}} {
            $inside Show $told
        }
    }
    # beside LABEL: the unit of its option, which stands behind the editor.
    method beside unit {
        pack $unit -in $win -side left -padx [list [::sorma::style pixels 8] 0] {*}[if {$editor ne {}} {list -after $editor}]
    }
    # value, apply, revert: of its option.
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

# A text in a field has been written: by keys, or pasted, unless the field itself does so. OURS: a variable, true meanwhile.
proc ::sorma::field::Written {widget ours args} {
    upvar #0 $ours showing
    if {!$showing} {
        $widget Typed
    }
}

# In fields for typing, Return and leaving the field take the typed text, and Escape takes it back.
snit::macro ::sorma::typedParts {} {
    ::sorma::fieldParts
    method Keys window {
        bind $window <Return> [mymethod Take 1]
        bind $window <FocusOut> [mymethod Take 0]
        bind $window <Escape> [mymethod revert]
    }
    method Touched {} {
        return [expr {$options(-option) in [$subject edited]}]
    }
    method Take now {
        if {$subject eq {} || ![$self Touched]} return
        if {$options(-apply) eq "now" && [dict get [$subject get $options(-option)] state] ne "refused" || $now} {
            $subject apply $options(-option)
        }
    }
    # A text is in the colour of a warning or an alarm when it is a number outside the limits.
    method Paint {window shown} {
        $window configure -foreground [::sorma::style colour [::sorma::table::zone [dict get $facts hints] $shown]]
    }
}

# ::sorma::entry .w -name NAME -option -OPTION -- a text or a number. Some kinds have something beside the value:
#       file            a button to look for it
#       colour          a button that shows it
#       time            the local time
#       sub-service     a button for its panel
snit::widget ::sorma::entry {
    widgetclass SormaEntry      ;# what Tk binds to Entry is for its own
    ::sorma::typedParts
    variable text {}
    variable kind plain
    variable swatch {}
    constructor args {
        install editor using ttk::entry $win.entry -style Sorma.TEntry -textvariable [myvar text] -width 12
        $self configurelist $args
        $self Keys $editor
        $self Begin
        trace add variable [myvar text] write [list ::sorma::field::Written $self [myvar showing]]
    }
    destructor {
        if {$swatch ne {}} {
            ::image delete $swatch
        }
    }
    method Build {} {
        if {[dict get $facts type] in {int double}} {
            $editor configure -justify right
        }
        $editor configure -show [expr {[dict exists $facts hints secret] ? "\u2022" : {}}]
        set enabled {}
        set kind [expr {[dict get $facts type] eq "service" ? "service" : [dict exists $facts hints kind] ? [dict get $facts hints kind] : "plain"}]
        destroy $win.beside
        switch -- $kind {
            file - folder { ttk::button $win.beside -text "\u2026" -width 3 -command [mymethod Browse] }
            colour {
                if {$swatch eq {}} {
                    set swatch [::image create photo -width [::sorma::style pixels 24] -height [::sorma::style pixels 12]]
                }
                ttk::button $win.beside -image $swatch -command [mymethod PickColour]
            }
            time { ttk::label $win.beside -width 20 }
            service {
                ttk::button $win.beside -text "\u2192" -width 3 -command [mymethod Open]
                ::sorma::style tip $win.beside [::msgcat::mc "Opens its panel"]
            }
        }
        if {[winfo exists $win.beside]} {
            pack $win.beside -side right -padx [list [::sorma::style pixels 4] 0]
        }
        $editor configure -width [expr {[dict get $facts type] in {int double} ? 10 : [dict exists {file 34 folder 34 colour 10 time 18} $kind]
            ? [dict get {file 34 folder 34 colour 10 time 18} $kind] : 26}]
        if {[winfo manager $editor] eq {}} {
            pack $editor -side left -fill both -expand 1
        }
    }
    # While the user types, nothing else is put into the field.
    method Put value {
        if {$text ne $value && ([focus] ne $editor || ![$self Touched])} {
            set text $value
        }
        if {[dict get $facts hints] ne {}} {
            $self Paint $editor $text
        }
        if {$kind eq "plain"} return
        switch -- $kind {
            colour {
                $swatch blank
                if {![catch {winfo rgb $win $text}] && $text ne {}} {
                    $swatch put [list $text] -to 0 0 [::image width $swatch] [::image height $swatch]
                }
            }
            time {
                set known [expr {[string is double -strict $text] && abs($text) < 1e11}]
                $win.beside configure -text [if {$known} {clock format [expr {entier(floor($text))}] -format "%Y-%m-%d %H:%M:%S"}]
            }
            service { $win.beside state [expr {$text eq {} ? "disabled" : "!disabled"}] }
        }
    }
    method Typed {} {
        if {$subject ne {} && $text ne [$self value]} {
            $subject edit $options(-option) $text
        }
    }
    method Browse {} {
        if {$kind eq "folder"} {
            set file [tk_chooseDirectory -parent $win -initialdir $text]
        } else {
            set file [tk_getOpenFile -parent $win -initialdir [file dirname $text] -initialfile [file tail $text]]
        }
        if {$file ne {}} {
            $self Edited $file
        }
    }
    method PickColour {} {
        set colour [tk_chooseColor -parent $win {*}[if {![catch {winfo rgb $win $text}] && $text ne {}} {list -initialcolor $text}]]
        if {$colour ne {}} {
            $self Edited $colour
        }
    }
    method Open {} {
        package require sorma::window
        ::sorma::window panel [$subject place $text]
    }
    method Enable state {
        $editor configure -state $state
        if {$kind in {file colour}} {
            $win.beside state [expr {$state eq "normal" ? "!disabled" : "disabled"}]
        }
    }
}

# ::sorma::vector -- numbers in a row, with the names that the class gives them.
snit::widget ::sorma::vector {
    ::sorma::typedParts
    variable texts              ;# array: 1 .. n -> text
    variable entries {}
    constructor args {
        $self configurelist $args
        $self Begin
    }
    method Build {} {
        destroy {*}[winfo children $win]
        set entries {}
        array unset texts
    }
    method Make n {
        $self Build
        set pad [list 0 [::sorma::style pixels 4]]
        for {set i 1} {$i <= $n} {incr i} {
            lappend entries [ttk::entry $win.entry$i -style Sorma.TEntry -textvariable [myvar texts($i)] -width 7 -justify right]
            trace add variable [myvar texts($i)] write [list ::sorma::field::Written $self [myvar showing]]
            $self Keys $win.entry$i
            grid $win.entry$i -row 1 -column $i -sticky ew -padx $pad
            grid columnconfigure $win $i -weight 1
            if {[dict exists $facts hints names]} {
                ttk::label $win.name$i -text [lindex [dict get $facts hints names] $i-1] -font [::sorma::style font small]
                $win.name$i configure -style Quiet.TLabel
                grid $win.name$i -row 2 -column $i
            }
        }
        set enabled {}
        event generate $win <<SormaBuilt>>
    }
    method Put value {
        set numbers [string map {\{\} {}} [split $value]]         ;# no list: anybody may have typed it
        set typing [expr {[focus] in $entries && [$self Touched]}]
        set n [llength [split [dict get [$subject get $options(-option)] live]]]
        if {$n != [llength $entries] && !$typing} {
            $self Make $n
        }
        set i 0
        foreach entry $entries {
            incr i
            if {!$typing} {
                set texts($i) [lindex $numbers $i-1]
            }
            if {[dict get $facts hints] ne {}} {
                $self Paint $entry $texts($i)
            }
        }
    }
    method beside unit {
        grid $unit -in $win -row 1 -column 99 -sticky w
    }
    # Do the numbers have names below them, and how much higher does a label as high as that stand than a number.
    method named {} {
        return [dict exists $facts hints names]
    }
    method above height {
        set probe [ttk::entry $win.probe]           ;# there may be no number yet
        set entry [winfo reqheight $probe]
        destroy $probe
        return [expr {max(0, ($entry - $height) / 2)}]
    }
    method Typed {} {
        if {$subject eq {}} return
        set value [join [lmap i [lsort -integer [array names texts]] {if {$texts($i) eq {}} {string cat "{}"} else {set texts($i)}}]]
        if {$value ne [$self value]} {
            $subject edit $options(-option) $value
        }
    }
    method Enable state {
        foreach entry $entries {
            $entry configure -state $state
        }
    }
}

# ::sorma::slider -- a number with a range: an entry for those who know it exactly, and a scale. One request is under way, and the last
# value is always sent.
snit::widget ::sorma::slider {
    ::sorma::fieldParts
    option -length -default 140
    variable position 0         ;# in steps from the low end: keys and clicks beside the knob go one step, or ten, whatever the range is
    variable step 1
    constructor args {
        $self configurelist $args
        install editor using ttk::scale $win.scale -variable [myvar position] -length [::sorma::style pixels $options(-length)] \
            -command [mymethod Moved]
        install inside using ::sorma::entry $win.entry -name $options(-name) -option $options(-option) -apply $options(-apply) \
            -live $options(-live) -state $options(-state) -seen 0
        pack $inside -side left
        pack $editor -side left -fill x -expand 1 -anchor w -padx [list [::sorma::style pixels 12] 0]
        bind $win <Configure> [mymethod Fit]
        $self Begin
    }
    # The scale takes the free room, up to a length that a hand can aim at.
    method Fit {} {
        set most [::sorma::style pixels 400]
        set wide [expr {[winfo width $win] - [winfo reqwidth $win] + [winfo reqwidth $editor] > $most}]
        if {$wide != ([pack info $editor] ne {} && [dict get [pack info $editor] -fill] eq "none")} {
            $editor configure -length [expr {$wide ? $most : [::sorma::style pixels $options(-length)]}]
            pack configure $editor -fill [expr {$wide ? "none" : "x"}]
        }
    }
    method beside unit {
        pack $unit -in $win -side left -padx [list [::sorma::style pixels 8] 0] -after $inside
    }
    method Build {} {
        if {[dict get $facts low] ne {} && [dict get $facts high] ne {}} {
            set range [$self Range]
            set step [expr {[dict get $facts type] eq "int" ? max(1, round($range / 100)) : $range / 100}]
            $editor configure -from 0 -to [expr {$range / $step}]
        }
    }
    method Range {} {
        set range [expr {double([dict get $facts high]) - [dict get $facts low]}]
        return [expr {$range > 0 ? $range : 1.0}]
    }
    method Moved place {
        if {$showing || $facts eq {}} return
        set value [expr {[dict get $facts low] + $place * $step}]
        $self Edited [if {[dict get $facts type] eq "int"} {expr {round($value)}} else {$self Rounded $value}]
    }
    # As many digits as pixels of the scale can tell, within the range.
    method Rounded value {
        set digits [expr {max(0, int(ceil(-log10([$self Range] / max(100, [winfo width $editor])))))}]
        return [expr {double(max([dict get $facts low], min([dict get $facts high], [format %.*f $digits $value])))}]
    }
    method Put value {
        if {[string is double -strict $value] && $value == $value && $facts ne {}} {        ;# NaN has no place
            set position [expr {($value - [dict get $facts low]) / double($step)}]
        }
    }
    method Enable state {
        $editor state [expr {$state eq "normal" ? "!disabled" : "disabled"}]
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
        set enabled {}
        destroy {*}[winfo children $win]
        if {[llength $words] <= 3 && [string length [join $words]] < 40} {
            set n 0
            foreach word $words {
                ttk::radiobutton $win.r[incr n] -style [::sorma::style own TRadiobutton] -text $word -value $word -variable [myvar text] \
                    -command [mymethod Chosen]
                pack $win.r$n -side left -padx [list 0 [::sorma::style pixels 16]]
            }
        } else {
            ttk::combobox $win.box -style [::sorma::style own TCombobox] -values $words -textvariable [myvar text] -state readonly \
                -width [expr {max(6, min(30, [tcl::mathfunc::max 0 {*}[lmap word $words {string length $word}]] + 1))}]
            bind $win.box <<ComboboxSelected>> [mymethod Chosen]
            foreach event {<MouseWheel> <Button-4> <Button-5>} {
                bind $win.box $event {continue}
            }
            bindtags $win.box [lsearch -all -inline -not -exact [linsert [bindtags $win.box] 1 SormaCombobox] TCombobox]
            pack $win.box -side left -fill x -expand 1
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
        install editor using ttk::checkbutton $win.check -style [::sorma::style own TCheckbutton] -variable [myvar on] -command [mymethod Toggled]
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

# ::sorma::field .w facts ?option value ...? -- the widget that fits an option of which the subject says these facts.
proc ::sorma::field {window facts args} {
    set closed [expr {[dict get $facts low] ne {} && [dict get $facts high] ne {}}]
    switch -- [dict get $facts type] {
        flag { set widget check }
        enum { set widget choice }
        vector { set widget [expr {[regexp {(?:^|, )(\d+) elements?$} [dict get $facts range] -> n] && $n <= 8 ? "vector" : "entry"}] }
        default { set widget [expr {$closed && ![dict exists $facts hints kind] ? "slider" : "entry"}] }
    }
    return [::sorma::$widget $window {*}$args]
}

# ::sorma::button .w -name NAME -request {CTRL -start} ?-text text? ?-command prefix? --
#
# It runs a request. It shows that the request runs, for how long or how far it is, that it is done, or why it failed. A running request can be
# cancelled by Escape, and by a button that appears after a moment. The prefix gets ok and the reply, or error and a list of message and code.
snit::widget ::sorma::button {
    widgetclass SormaButton     ;# what Tk binds to Button is for its own
    ::sorma::runParts
    hulltype ttk::frame
    delegate option -takefocus to hull
    option -name -default {} -readonly 1
    option -request -default EXEC
    option -text -default {} -configuremethod SetText
    option -command -default {}
    ::sorma::checkedOption -state normal SetState
    component button
    component lamp
    variable subject {}
    variable answer {}
    constructor args {
        $hull configure -takefocus 0
        install button using ttk::button $win.button -command [mymethod invoke]
        install lamp using ttk::label $win.lamp -width 2 -anchor center
        ttk::button $win.cancel -text \u2715 -width 2 -style Toolbutton -command [mymethod cancel]
        ::sorma::style tip $win.cancel [::msgcat::mc "Cancel (Escape)"]
        pack $button -side left -fill x -expand 1
        pack $lamp -side left
        bind $button <Escape> [mymethod cancel]
        $self configurelist $args
        if {$options(-name) eq {}} {
            return -code error -errorcode {SORMA REQUEST SYNTAX} "sorma::button: -name must say of which object"
        }
        if {$options(-text) eq {}} {
            $button configure -text [::sorma::text::label [lindex $options(-request) end]]
        }
        set subject [::sorma::subject of $options(-name)]
        bind $win <Destroy> +[list ::sorma::parts::ended $win [mymethod Ended %W]]
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
    # The last result: running, ok or error, and the reply or the message; empty: nothing yet.
    method answer {} {
        return $answer
    }
    method invoke {} {
        if {$running ne {} || $subject eq {}} return
        $self Light sending running {}
        $self Run $options(-request)
    }
    method Runs {part text} {
        set seconds [$self Seconds]
        if {$seconds >= 0.4} {
            pack $win.cancel -side right
        }
        if {$part ne {} || $seconds >= 1} {
            $lamp configure -width 5 -text [if {$part ne {}} {format "%.0f %%" [expr {100 * $part}]} else {format "%d s" [expr {int($seconds)}]}]
        }
    }
    method Ran {status value} {
        pack forget $win.cancel
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
        $lamp configure -width 2 -text [::sorma::style mark $state] -foreground [::sorma::style colour $state]
    }
}
