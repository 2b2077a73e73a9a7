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
        set asked [expr {![catch {::sorma::async -timeout 5000 -command [list ::sorma::parts::answer [mymethod Told]] $name exec state}]}]
    }
    # An error is in the panel's own head.
    method Told future {
        set asked 0
        if {[catch {$future take} answer]} return
        set state [dict get $answer text]
        set text [list [dict get $state state]]
        if {[dict exists $state records]} {
            set lost [dict get $state lost]
            lappend text "[dict get $state records] [::msgcat::mc "records"]" [string trimleft "[if {$lost > 0} {::sorma::style mark warn}] $lost [::msgcat::mc "lost"]"]
        }
        set lines [list [join $text {, }]]
        if {[dict exists $state away]} {
            foreach {who why} [lrange [dict get $state away] 0 9] {
                # Most reasons name it already.
                lappend lines "[::sorma::style mark stale] [::msgcat::mc "away"]: [string range [expr {[string first "$who:" $why] == 0 ? $why : "$who: $why"}] 0 200]"
            }
        }
        $win.text configure -text [::sorma::text::clean [join $lines \n]]
    }
}

::sorma::classPart register recorder ::sorma::recorderState
