# browserLog.tcl -- sorma::browserLog: the messages of all daemons as they come, chosen by severity, object and text; it can be paused.

package require Tk
package require snit
package require sorma::style
package require sorma::text
package require sorma::world
package provide sorma::browserLog 1.0

# ::sorma::browserLog .w ?-keep n? -- the last -keep messages (default 5000), the newest below.
# Methods:
#       text: what is shown, in lines; messages: list of {SEVERITY KEY TIME TEXT}, all that are kept; pause BOOLEAN: meanwhile messages are kept, and shown afterwards
snit::widget ::sorma::browserLog {
    hulltype ttk::frame
    option -keep -default 5000 -readonly 1
    component tree
    variable token {}
    variable messages {}        ;# list of {SEVERITY KEY TIME TEXT}
    variable severity warning   ;# the least that is shown
    variable wantedKey {}       ;# pattern of NAME@DAEMON, or a part of it
    variable wantedText {}
    variable paused 0
    typevariable Rank {error 0 warning 1 verbose 2}

    constructor args {
        $self configurelist $args
        set pad [::sorma::style pixels 4]
        ttk::frame $win.bar
        ttk::label $win.bar.severityLabel -text "At least"
        ttk::combobox $win.bar.severity -values {error warning verbose} -width 8 -state readonly -textvariable [myvar severity]
        ttk::label $win.bar.keyLabel -text "Object"
        ttk::entry $win.bar.key -width 10 -textvariable [myvar wantedKey]
        ttk::label $win.bar.textLabel -text "Text"
        ttk::entry $win.bar.text -width 10 -textvariable [myvar wantedText]
        ttk::checkbutton $win.bar.pause -text Pause -underline 0 -variable [myvar paused] -command [mymethod Fill]
        pack {*}[winfo children $win.bar] -side left -padx [list 0 $pad]
        pack configure $win.bar.key $win.bar.text -fill x -expand 1
        install tree using ttk::treeview $win.tree -columns {time object text} -show headings -selectmode extended -yscrollcommand [list $win.scroll set]
        ttk::scrollbar $win.scroll -command [list $tree yview]
        foreach {column title width stretch} {time Time 110 0 object Object 140 0 text Message 360 1} {
            $tree heading $column -text $title -anchor w
            $tree column $column -width [::sorma::style pixels $width] -stretch $stretch
        }
        foreach {level state} {error refused warning warn verbose asking} {
            $tree tag configure $level -foreground [::sorma::style colour $state]
        }
        grid $win.bar - -sticky ew -padx $pad -pady $pad
        grid $tree $win.scroll -sticky nsew
        grid columnconfigure $win 0 -weight 1
        grid rowconfigure $win 1 -weight 1
        foreach name {severity wantedKey wantedText} {
            trace add variable [myvar $name] write [mymethod Fill]
        }
        bind $win <Alt-p> [list $win.bar.pause invoke]
        bind $win <Destroy> +[mymethod Ended %W]
        set token [::sorma::world watch *@* -events trail -command [mymethod Told]]
    }
    method Ended window {
        if {$window eq $win} {
            ::sorma::world unwatch $token
        }
    }
    method pause boolean {
        set paused $boolean
        $self Fill
    }
    method messages {} {
        return $messages
    }
    method text {} {
        return [join [lmap item [$tree children {}] {join [$tree item $item -values] "  "}] \n]
    }

    method Told {event key message} {
        if {![winfo exists $tree]} return
        if {[dict get $message lost] > 0} {
            $self Keep [list warning $key [dict get $message time] "[dict get $message lost] messages were lost here"]
        }
        $self Keep [list [dict get $message severity] $key [dict get $message time] [dict get $message text]]
    }
    method Keep message {
        lappend messages $message
        if {[llength $messages] > 1.2 * $options(-keep)} {
            set messages [lrange $messages end-[expr {$options(-keep) - 1}] end]
        }
        if {!$paused && [$self Wanted $message]} {
            set below [expr {[lindex [$tree yview] 1] >= 1.0}]
            set item [$self Add $message]
            set rows [$tree children {}]
            if {[llength $rows] > $options(-keep)} {
                $tree delete [list [lindex $rows 0]]
            }
            if {$below} {
                $tree see $item
            }
        }
    }
    method Wanted message {
        lassign $message level key time text
        if {![dict exists $Rank $level] || [dict get $Rank $level] > [dict get $Rank $severity]} {
            return 0
        }
        return [expr {[string match -nocase *$wantedKey* $key] && [string match -nocase *[::sorma::text::escape $wantedText]* $text]}]
    }
    method Add message {
        lassign $message level key time text
        set line [::sorma::text::cut [string map {\n { }} [::sorma::text::clean [string range $text 0 2000]]] 1000]
        return [$tree insert {} end -tags [list $level] -values [list [::sorma::text::time $time] [::sorma::text::clean [string map {@self {} \n { }} $key]] $line]]
    }
    method Fill args {
        if {$paused} return
        $tree delete [$tree children {}]
        foreach message [lrange $messages end-[expr {$options(-keep) - 1}] end] {
            if {[$self Wanted $message]} {
                $self Add $message
            }
        }
        set last [lindex [$tree children {}] end]
        if {$last ne {}} {
            $tree see $last
        }
    }
}
