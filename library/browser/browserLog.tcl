# browserLog.tcl -- sorma::browserLog: the messages of all daemons as they come, chosen by severity, daemon, object and text; it can be paused.

package require Tk
package require snit
package require sorma::style
package require sorma::trailview
package provide sorma::browserLog 1.0

# ::sorma::browserLog .w -- the last 5000 messages, the newest below.
# Methods:
#       about DAEMON: its errors alone.
#       text: what is shown, in lines; messages: those that are wanted, also while it is paused; pause ?BOOLEAN?
snit::widget ::sorma::browserLog {
    hulltype ttk::frame
    component trails
    variable severity warning   ;# the least that is shown
    variable daemon {}          ;# a part of its name
    variable object {}          ;# a part of NAME@DAEMON
    variable wanted {}          ;# a part of the text
    variable paused 0
    delegate method text to trails
    delegate method messages to trails

    constructor {} {
        set pad [::sorma::style pixels 8]
        set edge [::sorma::style pixels 16]
        ttk::frame $win.bar
        ttk::label $win.bar.severityLabel -text [::msgcat::mc "At least"]
        ttk::combobox $win.bar.severity -style [::sorma::style own TCombobox] -values {error warning verbose} -width 7 -state readonly \
            -textvariable [myvar severity]
        ttk::label $win.bar.daemonLabel -text [::msgcat::mc "Daemon"]
        ttk::combobox $win.bar.daemon -style [::sorma::style own TCombobox] -width 7 -textvariable [myvar daemon] -postcommand [mymethod Daemons]
        ttk::label $win.bar.objectLabel -text [::msgcat::mc "Object"]
        ttk::entry $win.bar.object -width 6 -textvariable [myvar object]
        ttk::label $win.bar.textLabel -text [::msgcat::mc "Text"]
        ttk::entry $win.bar.text -width 6 -textvariable [myvar wanted]
        ttk::checkbutton $win.bar.pause -style [::sorma::style own TCheckbutton] -text [::msgcat::mc Pause] -variable [myvar paused]
        grid {*}[winfo children $win.bar] -padx [list 0 $pad] -sticky ew
        foreach name {severity daemon object} {
            grid configure $win.bar.$name -padx [list 0 $edge]
        }
        grid configure $win.bar.pause -padx 0
        grid columnconfigure $win.bar {5 7} -weight 1           ;# entries take the room that there is, and give way where there is none
        install trails using ::sorma::trailview $win.trails -keep 5000 -keys {*@* *}
        pack $win.bar -side top -fill x -padx $edge -pady [list $edge $pad]
        pack $trails -side top -fill both -expand 1 -padx [list $edge 0] -pady [list 0 $edge]
        foreach {name option} {severity -severity daemon -daemon object -object wanted -text paused -paused} {
            trace add variable [myvar $name] write [mymethod Set $option]
        }
    }
    method pause {{boolean {}}} {
        set paused [expr {$boolean eq {} ? !$paused : $boolean}]
    }
    method about name {
        lassign [list error $name {} {}] severity daemon object wanted
    }
    method Daemons {} {
        $win.bar.daemon configure -values [concat {{}} [::sorma::world keys]]
    }
    method Set {option args} {
        $trails configure $option [switch -- $option {
            -severity { lrange {error warning verbose} 0 [lsearch {error warning verbose} $severity] }
            -daemon { string cat $daemon }
            -object { string cat $object }
            -text { string cat $wanted }
            -paused { string cat $paused }
        }]
    }
}
