# browserText.tcl -- sorma::browserText: a text to be read, copied and saved: what daemons have answered to requests.
#
# The table asks (sorma::table), behind the scenes; here it is shown as it comes, and asked for again each second while it can be
# seen. A daemon that does not answer leaves what was there, and the reason above it.

package require Tk
package require snit
package require sorma::style
package require sorma::table
package require sorma::text
package require sorma::timer
package provide sorma::browserText 1.0

# ::sorma::browserText .w --
# Methods:
#       ask WHERE {TITLE REQUEST READ ...}      show the answers, each below its title
#       show TEXT                               show that
#       text                                    what is shown
#
# READ is a command prefix, which makes the shown text of an answer. An empty READ leaves the answer as it is.
snit::widget ::sorma::browserText {
    hulltype ttk::frame
    option -every -default 1000         ;# ms
    typevariable Most 200000            ;# characters that are shown of one answer
    variable where {}
    variable requests {}
    variable shown {}
    variable timer {}

    constructor args {
        $self configurelist $args
        ::sorma::style text $win.text {} -wrap word -width 60 -height 16 -padx [::sorma::style pixels 16] -pady [::sorma::style pixels 12] \
            -state disabled -takefocus 1 -yscrollcommand [list $win.bar set]
        ttk::scrollbar $win.bar -style [::sorma::style own Vertical.TScrollbar] -command [list $win.text yview]
        $win.text tag configure title -font [::sorma::style font fixedStrong]
        pack $win.bar -side right -fill y
        pack $win.text -side left -fill both -expand 1
        bind $win.text <ButtonPress-1> {+focus %W}
        bind $win <Map> [mymethod Refresh]
        bind $win <Destroy> +[mymethod Ended %W]
        ::sorma::news::hook answer [mymethod Heard]
    }
    method Ended window {
        if {$window eq $win} {
            after cancel $timer
            ::sorma::timer::cancel $win
            ::sorma::news::unhook [mymethod Heard]
        }
    }

    method ask {place list} {
        set where $place
        set requests $list
        $self Put {}
        $self Refresh
    }
    method show text {
        set requests {}
        after cancel $timer
        $self Put $text
    }
    method text {} {
        return $shown
    }

    method Refresh {} {
        after cancel $timer
        if {[llength $requests] > 0 && [winfo ismapped $win]} {
            $self Show
            set timer [after $options(-every) [mymethod Refresh]]
        }
    }
    method Heard {event about dict} {
        if {[winfo ismapped $win] && [lindex $about 1] in $requests} {
            ::sorma::timer::once $win 20 {*}[mymethod Later]
        }
    }
    method Later {} {
        if {[llength $requests] > 0} {
            $self Show
        }
    }
    method Show {} {
        set out {}
        foreach {title request read} $requests {
            if {[catch {::sorma::table answer $where $request} answer]} {
                set answer [dict create text {} came 0 error $answer]
            }
            set text [dict get $answer text]
            if {[dict get $answer error] ne {}} {
                set text "[::sorma::style mark stale] [dict get $answer error][if {[dict get $answer age] ne {}} {string cat ", " [dict get $answer age]}]\n$text"
            } elseif {[dict get $answer came] == 0} {
                set text \u2026
            } elseif {$text eq {}} {
                set text "(nothing)"
            } elseif {$read ne {} && [catch {{*}$read $text} text]} {
                set text "[::sorma::style mark stale] its answer makes no sense: $text"
            }
            lappend out [string trimleft $title\n[$self Bounded $text]\n \n]
        }
        $self Put [string trimright [join $out \n]]
    }
    # Strangers say what they like: not all of a megabyte is shown, and no line that Tk would break for a minute.
    method Bounded text {
        set length [string length $text]
        if {$length > $Most} {
            set text "[string range $text 0 $Most-1]\n\u2026 and [expr {$length - $Most}] characters more"
        }
        set lines {}
        foreach line [split [::sorma::text::clean $text] \n] {
            for {set at 0} {$at == 0 || $at < [string length $line]} {incr at 1000} {
                lappend lines [string range $line $at $at+999]
            }
        }
        return [join $lines \n]
    }
    method Put text {
        if {$text eq $shown} return
        set shown $text
        set at [lindex [$win.text yview] 0]
        $win.text configure -state normal
        $win.text replace 1.0 end $text
        foreach {title request read} $requests {
            set found [$win.text search -exact -- $title 1.0]
            if {$title ne {} && $found ne {} && [$win.text get "$found linestart" "$found lineend"] eq $title} {
                $win.text tag add title $found "$found lineend"
            }
        }
        $win.text configure -state disabled
        $win.text yview moveto $at
    }
}
