# notice.tcl -- sorma::notice: what holds for all values of an object, said once, such as their age. Its room is always there: nothing
# moves when there is a message. Panels and forms have one, and windows that are written by hand: these name the daemons that they show.

package require Tk
package require snit
package require sorma::style
package require sorma::world
package provide sorma::notice 1.0

# ::sorma::notice .w ?-lines n? ?-daemons list? --
#       So many lines of text (2; in a wide window there is one). Longer text is cut off and shown in a tip. While one of these daemons does not answer, the notice says
#       which, since when and why; then what it was told to say.
# Methods:
#       say STATE TEXT ?PREFIX?     STATE: as sorma::style has it; PREFIX: called by the button "Make it", which is there only then
#       says                        {STATE TEXT}, as shown
snit::widget ::sorma::notice {
    hulltype ttk::frame
    delegate option -style to hull
    option -lines -default 2 -readonly 1
    option -daemons -default {} -configuremethod SetDaemons
    variable told {live {} {}}  ;# by the program: state, text and prefix
    variable said {}            ;# what is shown, like that
    variable away {}            ;# dict: each of -daemons that does not answer -> why
    variable watch {}
    variable lines 0            ;# that there are now

    constructor args {
        $self configurelist $args
        ttk::label $win.text -justify left -anchor nw
        ttk::button $win.make -style Link.Toolbutton -text [::msgcat::mc "Make it"] -takefocus 1
        pack $win.text -side left -fill both -expand 1
        pack propagate $win 0
        bind $win.text <Configure> [mymethod Fit]
        bind $win <<ThemeChanged>> [mymethod Looks]
        $self Looks
        $self Show
    }
    destructor {
        if {$watch ne {}} {
            ::sorma::world unwatch $watch
        }
    }
    method SetDaemons {option names} {
        set options($option) $names
        if {$watch ne {}} {
            ::sorma::world unwatch $watch
            set watch {}
        }
        set away {}
        if {[llength $names] > 0} {
            set watch [::sorma::world watch * -events {daemon.* world.ready} -command [mymethod Daemon]]
        }
        if {[winfo exists $win.make]} {
            $self Show
        }
    }
    method Looks {} {
        set lines [expr {[winfo width $win] > [::sorma::style pixels 720] ? 1 : $options(-lines)}]
        set high [expr {$lines * [font metrics TkDefaultFont -linespace] + [::sorma::style pixels 2]}]
        $hull configure -height [expr {max($high, [winfo reqheight $win.make])}]
        if {$said ne {}} {
            $win.text configure -foreground [::sorma::style colour [lindex $said 0]]
        }
    }
    method say {state text {prefix {}}} {
        set told [list $state $text $prefix]
        $self Show
    }

    # ---- daemons ----

    method Daemon {event args} {
        foreach name $options(-daemons) {
            set known [::sorma::world get [::sorma::world find $name]]
            set state [if {$known eq {}} {string cat gone} else {dict get $known state}]
            if {$state in {alive busy}} {
                dict unset away $name
            } elseif {$state ne "asking" && ($known ne {} || $event ne "daemon.here")} {
                dict set away $name [$self Why $known]
            }
        }
        $self Show
    }
    method Why known {
        if {$known eq {}} {
            return "there is no such daemon now"
        }
        set why [dict get $known why]
        return "[if {$why eq {}} {dict get $known state} else {set why}], since [clock format [expr {[dict get $known since] / 1000}] -format %T]"
    }

    # ---- what is shown ----

    method Show {} {
        set now $told
        if {[dict size $away] > 0} {
            set names [lmap name $options(-daemons) {if {![dict exists $away $name]} continue; set name}]
            set others [lassign $names first]
            set text "[::sorma::style mark stale] $first: [dict get $away $first]"
            if {[llength $others] > 0} {
                append text "; nor is there an answer of [join $others {, }]"
            }
            set now [list stale $text {}]
        }
        if {$now eq $said} return
        set said $now
        lassign $said state text prefix
        $win.text configure -foreground [::sorma::style colour $state]
        $self Fit
        ::sorma::style tip $win.text $text
        if {$prefix ne {}} {
            $win.make configure -command $prefix
            pack $win.make -side right -anchor n -before $win.text
        } else {
            pack forget $win.make
        }
    }
    # One line ends where the window does.
    method Fit {} {
        if {($lines == 1) != ([winfo width $win] > [::sorma::style pixels 720] || $options(-lines) == 1)} {
            $self Looks
        }
        set text [lindex $said 1]
        set width [winfo width $win.text]
        if {$lines > 1} {
            $win.text configure -wraplength [expr {max(1, $width - [::sorma::style pixels 4])}]
        } elseif {$width > 1 && [font measure TkDefaultFont $text] > $width} {
            set n [string length $text]
            while {$n > 0 && [font measure TkDefaultFont [string range $text 0 $n-1]\u2026] > $width} {
                incr n -1
            }
            set text [string range $text 0 $n-1]\u2026
        }
        $win.text configure -text $text
    }
    method says {} {
        return [lrange $said 0 1]
    }
}
