# parts.tcl -- what the widgets have in common that show a service object: a macro for their bodies.

package require Tk
package require snit
package require sorma::message
package require sorma::options
package require sorma::postscript
package require sorma::shown
package require sorma::style
package require sorma::subject
package require sorma::svg
package require sorma::text
package provide sorma::parts 1.0

# ::sorma::parts::answer METHOD WORD ... -- an answer for a method of a widget, as mymethod gives it, unless the widget is gone meanwhile.
namespace eval ::sorma::parts {}
proc ::sorma::parts::answer {method args} {
    if {[namespace exists [lindex $method 1]]} {        ;# that of the instance
        uplevel #0 [list {*}$method {*}$args]
    }
}

# ::sorma::parts::ended WINDOW METHOD -- METHOD hears of the end of its window. A widget that its constructor has refused is no command by then.
proc ::sorma::parts::ended {window method} {
    if {[namespace which -command $window] ne {}} {
        uplevel #0 $method
    }
}

# ::sorma::parts::mark PARENT N STATE WHY -- the mark of row N of a grid, in the label mark N, and why below its field. That label is made when
# there is something to say for the first time.
proc ::sorma::parts::mark {parent n state why} {
    set colour [::sorma::style colour $state]
    $parent.mark$n configure -text [::sorma::style mark $state] -foreground $colour
    set said $parent.why$n
    if {![winfo exists $said]} {
        if {$why eq {}} return
        ttk::label $said -font [::sorma::style font small] -wraplength [Room $parent] -justify left
        bindtags $said [string map [list $parent.label$n $said] [bindtags $parent.label$n]]
    }
    $said configure -text $why -foreground $colour
    if {$why ne {} && [winfo manager $parent.field$n] eq "grid"} {
        grid $said -row [expr {[dict get [grid info $parent.field$n] -row] + 1}] -column 2 -sticky w \
            -padx [list [::sorma::style pixels 4] [::sorma::style pixels 16]] -pady [list 0 [::sorma::style pixels 4]]
    } else {
        grid remove $said
    }
}
# The width of what stands in the column of fields [pixels].
proc ::sorma::parts::Room parent {
    return [expr {max([::sorma::style pixels 200], [winfo width $parent] - [lindex [grid bbox $parent 2 0] 0] - [::sorma::style pixels 16])}]
}

# ::sorma::parts::row PARENT N ROW -- label, mark and field N in a row of the grid, and the unit in the field. A field begins where the others
# do, and is as wide as its type; a scale takes what room there is.
proc ::sorma::parts::row {parent n row} {
    set gap [::sorma::style pixels 4]
    set edge [expr {4 * $gap}]
    set field $parent.field$n
    set high [expr {[winfo class $field] eq "Vector" && [$field named]}]
    grid $parent.label$n -row $row -column 0 -sticky [expr {$high ? "nw" : "w"}] -padx [list $edge [expr {2 * $gap}]] -pady $gap
    grid $parent.mark$n -row $row -column 1 -sticky [expr {$high ? "n" : ""}] -pady $gap
    grid $field -row $row -column 2 -sticky [expr {[winfo class $field] in {Slider Reading} ? "ew" : "w"}] -padx [list $gap $edge] -pady $gap
    if {$high} {
        set above [$field above [winfo reqheight $parent.label$n]]
        foreach part {label mark} {
            grid configure $parent.$part$n -pady [list [expr {$gap + $above}] 0]
        }
    }
    grid rowconfigure $parent $row -minsize [::sorma::style pixels 38]
    # Tab goes from field to field as they are seen; the unit lies above its field.
    raise $field
    if {[winfo exists $parent.unit$n]} {
        raise $parent.unit$n
    }
}

# ::sorma::parts::card WINDOW FIRST LAST -- a card behind these rows of a grid of such rows, and room below it.
proc ::sorma::parts::card {card first last} {
    grid $card -row $first -column 0 -columnspan 3 -rowspan [expr {$last - $first + 1}] -sticky nsew
    lower $card
    set parent [winfo parent $card]
    foreach row [list $first $last] {
        grid rowconfigure $parent $row -minsize [::sorma::style pixels 8]
    }
    grid rowconfigure $parent [expr {$last + 1}] -minsize [::sorma::style pixels 12]
    grid columnconfigure $parent 1 -minsize [::sorma::style pixels 20]
}

# ::sorma::parts::byKeys TREE -- the first arrow key goes to its first row; ttk's own go nowhere before a click.
proc ::sorma::parts::byKeys tree {
    foreach key {Down Up Right} {
        bind $tree <$key> {+
            if {[::sorma::parts::ToFirst %W]} break
        }
    }
}
proc ::sorma::parts::ToFirst tree {
    set first [lindex [$tree children {}] 0]
    if {[$tree focus] ne {} || $first eq {}} {
        return 0
    }
    $tree focus $first
    $tree selection set [list $first]
    return 1
}

# ::sorma::parts::withBar FRAME VIEW BAR -- a window that scrolls and its scrollbar fill a frame. The window's -yscrollcommand calls scrolled. Where
# all can be seen there is no bar. Its room stays: else what wraps there would make it come and go without end. scrolled BAR FIRST LAST is for any
# bar in a grid.
proc ::sorma::parts::withBar {frame view bar} {
    ttk::scrollbar $bar -style [::sorma::style own Vertical.TScrollbar] -command [list $view yview]
    grid $view $bar -in $frame -sticky nsew
    grid columnconfigure $frame 0 -weight 1
    grid columnconfigure $frame 1 -minsize [winfo reqwidth $bar]
    grid rowconfigure $frame 0 -weight 1
}
proc ::sorma::parts::scrolled {bar first last} {
    $bar set $first $last
    if {$first <= 0 && $last >= 1} {
        grid remove $bar
    } else {
        grid $bar
    }
}

# ::sorma::parts::scroller FRAME ?PREFIX? -- fills a frame with one that scrolls: FRAME.canvas.inner, which it returns, as wide as the window.
# FRAME.canvas is to be told its -height. PREFIX is called with first and last, when other parts of it can be seen.
# tklib's scrollutil does this, too. Until Debian 13 it changes styles of the program around us when it is loaded: panel-4.0 would fail.
proc ::sorma::parts::scroller {frame {prefix list}} {
    set view [canvas $frame.canvas -highlightthickness 0 -borderwidth 0 -background [ttk::style lookup Page.TFrame -background] \
        -yscrollcommand [list ::sorma::parts::Scrolled $frame.bar $prefix]]
    set inner [ttk::frame $view.inner -style Page.TFrame]
    $frame configure -style Page.TFrame
    $view create window 0 0 -anchor nw -window $inner -tags inner
    bind $view <Configure> "[list $view] itemconfigure inner -width %w"
    bind $view <<ThemeChanged>> "[list $view] configure -background \[ttk::style lookup Page.TFrame -background\]"
    withBar $frame $view $frame.bar
    $frame.bar configure -style Page.[::sorma::style own Vertical.TScrollbar]
    return $inner
}
# ::sorma::parts::margin FRAME EDGE -- the -padx of such a frame between cards: its bar stands in the margin, and its cards end where others do.
proc ::sorma::parts::margin {frame edge} {
    return [list $edge [expr {max(0, $edge - [winfo reqwidth $frame.bar])}]]
}
proc ::sorma::parts::Scrolled {bar prefix first last} {
    scrolled $bar $first $last
    {*}$prefix $first $last
}
# ::sorma::parts::see CANVAS WINDOW -- a window in CANVAS.inner comes into sight, as when Tab has gone to it.
proc ::sorma::parts::see {canvas window} {
    set inner $canvas.inner
    if {![string match $inner.* $window] || [focus -displayof $canvas] ne $window || [winfo height $inner] <= 1} return
    set room [::sorma::style pixels 8]
    set top [expr {[winfo rooty $window] - [winfo rooty $inner] - $room}]
    set bottom [expr {$top + [winfo height $window] + 2 * $room}]
    set first [$canvas canvasy 0]
    set last [$canvas canvasy [winfo height $canvas]]
    if {$top < $first || $bottom - $top > $last - $first} {
        $canvas yview moveto [expr {$top < 3 * $room ? 0 : double($top) / [winfo height $inner]}]       ;# with the edge of the first card
    } elseif {$bottom > $last} {
        $canvas yview moveto [expr {($first + $bottom - $last) / [winfo height $inner]}]
    }
}

# ::sorma::parts::control WINDOW -- the first part of a field that takes keys, or nothing.
proc ::sorma::parts::control window {
    if {[winfo class $window] in {TEntry TCombobox TCheckbutton TRadiobutton}} {
        return $window
    }
    foreach child [winfo children $window] {
        set found [control $child]
        if {$found ne {}} {
            return $found
        }
    }
}

# ::sorma::parts::fieldMenu MENU SUBJECT OPTION CAN -- what is done to an option. CAN: it may be changed.
proc ::sorma::parts::fieldMenu {menu subject option can} {
    set edited [expr {$option in [$subject edited] ? "normal" : "disabled"}]
    $menu add command -label [::msgcat::mc "Apply %s" $option] -underline 0 -state [expr {$can ? $edited : "disabled"}] -command [list $subject apply $option]
    $menu add command -label [::msgcat::mc "Revert %s" $option] -underline 0 -state $edited -command [list $subject revert $option]
    $menu add separator
    $menu add command -label [::msgcat::mc "Copy as a request"] -underline 0 -command [list ::sorma::parts::copy $menu $subject $option]
    $menu add command -label [::msgcat::mc "On a dashboard"] -underline 5 -command [list ::sorma::window offer [$subject name] $option]
    set plot [Plot $subject $option]
    if {$plot ne {}} {
        plotEntry $menu {*}$plot
    }
}
# The words of ::sorma::window chart for an option; empty: it has no number.
proc ::sorma::parts::Plot {subject option} {
    switch -- [dict get [$subject option $option] type] {
        int - double { return [list [$subject name] $option] }
        vector {
            set n [llength [regexp -all -inline {\S+} [dict get [$subject get $option] live]]]
            return [list [$subject name] $option -index [lrange {0 1 2 3 4 5 6 7} 0 $n-1]]
        }
    }
}
# ::sorma::parts::named LABEL SUBJECT OPTION -- the label of an option can be dropped onto a dashboard. A press on that of a number opens a chart.
proc ::sorma::parts::named {label subject option} {
    set plots [expr {[Plot $subject $option] ne {}}]
    bind $label <B1-Motion> {%W configure -cursor fleur}
    bind $label <ButtonRelease-1> [list ::sorma::parts::Released %W $subject $option %X %Y]
    if {$plots} {
        $label configure -cursor hand2
    }
}
proc ::sorma::parts::Released {label subject option x y} {
    set plot [Plot $subject $option]
    $label configure -cursor [if {$plot ne {}} {string cat hand2}]
    if {[winfo containing $x $y] ne $label} {
        ::sorma::window offer [$subject name] $option $x $y
    } elseif {$plot ne {}} {
        ::sorma::window chart {*}$plot
    }
}
# ::sorma::parts::plotEntry MENU NAME WHAT ?-option value ...? -- what sorma::window chart takes.
proc ::sorma::parts::plotEntry {menu args} {
    $menu add command -label [::msgcat::mc "Plot this"] -underline 0 -command [list ::sorma::window chart {*}$args]
}
proc ::sorma::parts::copy {window subject option} {
    clipboard clear -displayof $window
    clipboard append -displayof $window -- [list [$subject name] CTRL $option [dict get [$subject get $option] value]]
}

# ::sorma::parts::picture CANVAS FILE ?REGION? -- all of it, in FILE.png (as it is on the screen; package Img), FILE.svg, FILE.pdf (ghostscript) or
# FILE.ps. REGION: {left top right bottom} of it, default its scroll region.
proc ::sorma::parts::picture {canvas file {region {}}} {
    lassign [if {$region ne {}} {set region} else {$canvas cget -scrollregion}] x y right bottom
    set part [if {$bottom ne {}} {list [list $x $y $right $bottom]}]
    switch -- [string tolower [file extension $file]] {
        .png {
            if {[catch {package require img::window; package require img::png}]} {
                return -code error -errorcode {SORMA REQUEST SYNTAX} "$file: Tk's package Img is not installed; it writes PNG (apt-get install libtk-img)"
            }
            set picture [image create photo -format window -data $canvas]
            $picture write $file -format png
            image delete $picture
        }
        .svg { ::sorma::text::writeFile $file [::sorma::svg::of $canvas {*}$part] }
        .ps { ::sorma::text::writeFile $file [::sorma::postscript::of $canvas {*}$part] }
        .pdf {
            if {[auto_execok gs] eq {}} {
                return -code error -errorcode {SORMA REQUEST SYNTAX} "$file: ghostscript is not installed; it makes PDF of PostScript (apt-get install ghostscript)"
            }
            exec gs -q -dNOPAUSE -dBATCH -dEPSCrop -sDEVICE=pdfwrite -sOutputFile=$file - << [::sorma::postscript::of $canvas {*}$part] 2>@1         ;# it also says what is no error
        }
        default {
            return -code error -errorcode {SORMA REQUEST SYNTAX} "$file: the name of a picture or table ends in .csv, .pdf, .png, .ps or .svg"
        }
    }
}

# ::sorma::parts NEEDS LIVE -- options -name, -option and -live, and the subject. NEEDS: those of the options that must be given. LIVE: default
# of -live, in ms. A constructor ends with $self Begin. The widget has methods Build, called when the table, and facts with it, has come or
# changed, and Show, called when there is something else to show.
snit::macro ::sorma::parts {needs live} {
    hulltype ttk::frame
    delegate option -takefocus to hull      ;# Tk asks for it
    option -name -default {} -readonly 1
    option -option -default {} -readonly 1
    option -live -default $live -readonly 1
    variable subject {}
    variable listener {}
    variable facts {}           ;# what the option is, as the subject says it; empty: not known yet
    typevariable Needs $needs

    method Begin {} {
        foreach option $Needs {
            if {$options($option) eq {}} {
                return -code error -errorcode {SORMA REQUEST SYNTAX} "[$self info type]: [join $Needs { and }] must say what it is for"
            }
        }
        $hull configure -takefocus 0        ;# Tab goes to what is in it; else Shift-Tab would come back for ever
        set subject [::sorma::subject of $options(-name) -live $options(-live)]
        $self Listen
        bind $win <Destroy> +[list ::sorma::parts::ended $win [mymethod Ended %W]]
        bind $win <FocusIn> [mymethod Focused]
        bind $win <<ThemeChanged>> [mymethod Told state {}]
        try {
            $self Told table {}
        } on error {message how} {
            $self Ended $win        ;# it is refused, and is no command any more when its window goes
            return -options $how $message
        }
    }
    # Widgets that nobody can see get no values.
    method Listen {} {
        $subject unlisten $listener
        set listener [$subject listen [list $self Told] [if {![info exists options(-seen)] || $options(-seen)} {set options(-option)}]]
    }
    # Tk tells that to the windows around one, too.
    method Focused {} {
        if {[focus] eq $win} {
            focus [lindex [winfo children $win] 0]
        }
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
        if {$what eq "table" && [$subject table] ne {}} {
            if {$options(-option) ne {}} {
                set facts [$subject option $options(-option)]
            }
            $self Build
        }
        $self Show
    }
    method subject {} {
        return $subject
    }
}

# ::sorma::checkedOption NAME DEFAULT ?METHOD? -- -state or -apply, whose value is checked; METHOD sets it.
snit::macro ::sorma::checkedOption {name default {method {}}} {
    option $name -default $default -validatemethod CheckOption {*}[if {$method ne {}} {list -configuremethod $method}]
    method CheckOption {option value} {
        ::sorma::options::check $option [dict get {-state {choice disabled normal readonly} -apply {choice later now}} $option] $value
    }
}

# ::sorma::stateParts -- the option -state of what is only looked at. While it is disabled, it is grey, and keys and mouse do nothing; it goes on
# showing what comes. The widget has a method Enable, called when that has changed; the first time nothing may be built yet.
snit::macro ::sorma::stateParts {} {
    ::sorma::checkedOption -state normal SetState
    method SetState {option value} {
        set options($option) $value
        $self Enable
    }
    method Enabled {} {
        return [expr {$options(-state) ne "disabled"}]
    }
    # Keys and mouse.
    method Act args {
        if {[$self Enabled]} {
            $self {*}$args
        }
    }
    # The colour of a state.
    method Shade state {
        return [::sorma::style colour [expr {[$self Enabled] ? $state : "asking"}]]
    }
}

# ::sorma::lampParts NEEDS LIVE -- parts and stateParts, for what shows an option and is nothing but labels and canvases.
snit::macro ::sorma::lampParts {needs live} {
    ::sorma::parts $needs $live
    ::sorma::stateParts
    # How old a value is, in a label.
    method ShowAge {label value} {
        $label configure -text [dict get $value age] -foreground [$self Shade stale]
    }
    # What is told of its option, as shown.tcl takes it.
    method Known {} {
        set told [$subject get $options(-option)]
        set state [dict get $told state]
        return [dict merge [dict create state [expr {$state in {asking stale gone refused} ? $state : "live"}] why [dict get $told why] value [dict get $told live] \
            unit {} low {} high {} hints {}] [dict filter $facts key unit low high hints]]
    }
    # An option of the widget that says how it looks.
    method SetLook {option value} {
        set options($option) $value
        $self Enable
    }
    method Enable {} {
        if {$subject eq {}} return
        foreach child [winfo children $win] {
            if {[winfo class $child] eq "TLabel"} {
                $child state [expr {[$self Enabled] ? "!disabled" : "disabled"}]
            }
        }
        $self Show
    }
}

# ::sorma::runParts -- one request at a time, which can be cancelled; closing the window does not. The widget has methods Runs, called while it
# runs, with part (0 to 1, or empty) and text of its progress, and Ran STATUS VALUE, when it is answered.
snit::macro ::sorma::runParts {} {
    variable running {}         ;# token of the request, as the subject gives it
    variable began 0            ;# ms
    variable progress {{} {}}   ;# part and text of it, as far as the class publishes that
    variable timer {}

    # For how long it has run already [s].
    method Seconds {} {
        return [expr {([clock milliseconds] - $began) / 1000.0}]
    }
    method Run words {
        set began [clock milliseconds]
        set progress {{} {}}
        set running [$subject ask $words [list ::sorma::parts::answer [mymethod Answer]] [list ::sorma::parts::answer [mymethod Progress]]]
        $self Tick
    }
    method Tick {} {
        after cancel $timer
        set timer [after 500 [mymethod Tick]]
        $self Runs {*}$progress
    }
    # One number from 0 to 1 is the part that is done; else its text says it.
    method Progress event {
        set part [if {[dict exists $event floats]} {dict get $event floats}]
        set known [expr {[llength $part] == 1 && $part >= 0 && $part <= 1}]
        set progress [list [if {$known} {set part}] [if {[dict exists $event text]} {lindex [split [dict get $event text] \n] 0}]]
        $self Runs {*}$progress
    }
    method Answer {status value} {
        after cancel $timer
        set running {}
        $self Ran $status $value
    }
    method running {} {
        return [expr {$running ne {}}]
    }
    method cancel {} {
        return [expr {$subject ne {} && [$subject cancel $running]}]
    }
    destructor {
        after cancel $timer
    }
}
