# parts.tcl -- what the widgets have in common that show a service object: a macro for their bodies.

package require Tk
package require snit
package require sorma::style
package require sorma::subject
package provide sorma::parts 1.0

# ::sorma::parts::answer METHOD WORD ... -- an answer for a method of a widget, as mymethod gives it, unless the widget is gone meanwhile.
namespace eval ::sorma::parts {}
proc ::sorma::parts::answer {method args} {
    if {[namespace exists [lindex $method 1]]} {        ;# that of the instance
        uplevel #0 [list {*}$method {*}$args]
    }
}

# ::sorma::parts::mark PARENT N STATE WHY -- the mark before row N of a grid, in the label mark N, and why below its field.
proc ::sorma::parts::mark {parent n state why} {
    set colour [::sorma::style colour $state]
    $parent.mark$n configure -text [::sorma::style mark $state] -foreground $colour
    $parent.why$n configure -text $why -foreground $colour
    if {$why ne {} && [winfo manager $parent.field$n] eq "grid"} {
        grid $parent.why$n
    } else {
        grid remove $parent.why$n
    }
}

# ::sorma::parts::withBar FRAME VIEW BAR -- a window that scrolls and its scrollbar fill a frame; its -yscrollcommand calls scrolled, and where all
# can be seen there is no bar. Its room stays: else what wraps there would make it come and go without end. scrolled BAR FIRST LAST is for any
# bar in a grid.
proc ::sorma::parts::withBar {frame view bar} {
    ttk::scrollbar $bar -command [list $view yview]
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

# ::sorma::parts::ofReply REPLY PART INDEX -- {PART VALUE}; if PART is empty, the first of text, floats, ints and words that is there. Of a list
# the items, or that of INDEX.
proc ::sorma::parts::ofReply {reply part index} {
    foreach part [if {$part ne {}} {list $part} else {list text floats ints words}] {
        if {[dict exists $reply $part] && [dict get $reply $part] ne {}} {
            set value [dict get $reply $part]
            return [list $part [if {$part in {floats ints words} && $index ne {}} {lrange $value $index $index} else {set value}]]
        }
    }
}

# ::sorma::parts::fieldMenu MENU SUBJECT OPTION CAN -- what is done to an option. CAN: it may be changed.
proc ::sorma::parts::fieldMenu {menu subject option can} {
    set edited [expr {$option in [$subject edited] ? "normal" : "disabled"}]
    $menu add command -label "Apply $option" -underline 0 -state [expr {$can ? $edited : "disabled"}] -command [list $subject apply $option]
    $menu add command -label "Revert $option" -underline 0 -state $edited -command [list $subject revert $option]
    $menu add separator
    $menu add command -label "Copy as a request" -underline 0 -command [list ::sorma::parts::copy $menu $subject $option]
    switch -- [dict get [$subject option $option] type] {
        int - double { plotEntry $menu [$subject name] $option }
        vector {
            set n [llength [regexp -all -inline {\S+} [dict get [$subject get $option] live]]]
            plotEntry $menu [$subject name] $option -index [lrange {0 1 2 3 4 5 6 7} 0 $n-1]
        }
    }
}
# ::sorma::parts::plotEntry MENU NAME WHAT ?-option value ...? -- what sorma::window chart takes.
proc ::sorma::parts::plotEntry {menu args} {
    $menu add command -label "Plot this" -underline 0 -command [list ::sorma::window chart {*}$args]
}
proc ::sorma::parts::copy {window subject option} {
    clipboard clear -displayof $window
    clipboard append -displayof $window -- [list [$subject name] CTRL $option [dict get [$subject get $option] value]]
}

# ::sorma::parts::popupAt WINDOW X Y -- where a menu opens: at the pointer, or below the window when a key has opened it.
proc ::sorma::parts::popupAt {window x y} {
    if {$x eq "??" || $x <= 0} {
        return [list [expr {[winfo rootx $window] + 5}] [expr {[winfo rooty $window] + [winfo height $window]}]]
    }
    return [list $x $y]
}

# ::sorma::parts::picture CANVAS FILE -- all of it, in FILE.png (as it is on the screen; package Img), FILE.pdf (ghostscript) or FILE.ps.
proc ::sorma::parts::picture {canvas file} {
    lassign [$canvas cget -scrollregion] x y right bottom
    set part [if {$bottom ne {}} {list -x $x -y $y -width [expr {$right - $x}] -height [expr {$bottom - $y}]}]
    switch -- [string tolower [file extension $file]] {
        .png {
            if {[catch {package require img::window; package require img::png}]} {
                return -code error -errorcode {SORMA REQUEST SYNTAX} "$file: Tk's package Img is not installed; it writes PNG (apt-get install libtk-img)"
            }
            set picture [image create photo -format window -data $canvas]
            $picture write $file -format png
            image delete $picture
        }
        .ps { $canvas postscript -file $file -colormode color {*}$part }
        .pdf {
            if {[auto_execok gs] eq {}} {
                return -code error -errorcode {SORMA REQUEST SYNTAX} "$file: ghostscript is not installed; it makes PDF of PostScript (apt-get install ghostscript)"
            }
            exec gs -q -dNOPAUSE -dBATCH -dEPSCrop -sDEVICE=pdfwrite -sOutputFile=$file - << [$canvas postscript -colormode color {*}$part]
        }
        default {
            return -code error -errorcode {SORMA REQUEST SYNTAX} "$file: the name of a picture or table ends in .csv, .pdf, .png or .ps"
        }
    }
}

# ::sorma::parts NEEDS LIVE -- options -name, -option and -live, and the subject. NEEDS: those of the options that must be given. LIVE: default
# of -live, in ms. A constructor ends with $self Begin. The widget has methods Build, called when the table, and facts with it, has come or
# changed, and Show, called when there is something else to show.
snit::macro ::sorma::parts {needs live} {
    hulltype ttk::frame
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
        set subject [::sorma::subject of $options(-name) -live $options(-live)]
        $self Listen
        bind $win <Destroy> +[mymethod Ended %W]
        bind $win <FocusIn> [mymethod Focused]
        bind $win <<ThemeChanged>> [mymethod Told state {}]
        $self Told table {}
    }
    # Of what nobody can see no values are told.
    method Listen {} {
        $subject unlisten $listener
        set listener [$subject listen [mymethod Told] [if {![info exists options(-seen)] || $options(-seen)} {set options(-option)}]]
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
        if {$subject eq {} || ![winfo exists $win]} return
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
