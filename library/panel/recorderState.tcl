# recorderState.tcl -- what an object of class recorder does, in its panel: its figures, who is away, and the way to its time line.

package require Tk
package require snit
package require sorma
package require sorma::classPart
package require sorma::parts
package require sorma::style
package require sorma::text
package require sorma::window
package provide sorma::recorderState 1.0

# ::sorma::recorderState .w NAME -- asked for each second while it can be seen. shows: the text.
snit::widget ::sorma::recorderState {
    hulltype ttk::frame
    component line
    delegate option -state to line
    variable name {}
    variable timer {}
    variable asked 0            ;# an answer is on its way

    constructor which {
        set name $which
        install line using ttk::button $win.line -text [::msgcat::mc "Show the time line"] -command [list ::sorma::window timeline -name $name]
        ::sorma::style tip $win.line [::msgcat::mc "requests, events and records of its file, by daemon and object"]
        ttk::label $win.text -style Quiet.TLabel -justify left
        pack $win.line -side left
        pack $win.text -side left -padx [::sorma::style pixels 8]
        bind $win <Map> [mymethod Refresh]
        bind $win <Destroy> +[list ::sorma::parts::ended $win [mymethod Ended %W]]
    }
    method Ended window {
        if {$window eq $win} {
            after cancel $timer
        }
    }
    method shows {} {
        return [$win.text cget -text]
    }
    method Refresh {} {
        after cancel $timer
        if {![winfo ismapped $win]} return
        set timer [after 1000 [mymethod Refresh]]
        if {$asked} return
        set asked [expr {![catch {::sorma::async -timeout 5000 -command [list ::sorma::parts::answer [mymethod Told]] $name CTRL -dump}]}]
    }
    # Lines of its dump: # KEY VALUE. An error is in the panel's own head.
    method Told future {
        set asked 0
        if {[catch {$future take} answer]} return
        set text {}
        set number 0
        foreach {- key value} [regexp -all -inline -line {^# (state|records|lost|away) (.*)$} [lindex $answer 3]] {
            if {$key eq "away" && [incr number] > 5} continue
            lappend text [switch $key {
                state { string cat $value }
                records { string cat "$value [::msgcat::mc "records"]" }
                lost { string cat [if {$value > 0} {::sorma::style mark warn}] " $value [::msgcat::mc "lost"]" }
                away { string cat "\n[::sorma::style mark stale] [::msgcat::mc "away"]: [string range $value 0 200]" }
            }]
        }
        $win.text configure -text [::sorma::text::clean [regsub -all {, \n} [join $text {, }] \n]]
    }
}

::sorma::classPart register recorder ::sorma::recorderState
