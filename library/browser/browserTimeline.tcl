# browserTimeline.tcl -- sorma::browserTimeline: the recording of a recorder that was chosen in the browser, or of a file, on a line of time.

package require Tk
package require snit
package require sorma::style
package require sorma::text
package require sorma::world
package provide sorma::browserTimeline 1.0

# ::sorma::browserTimeline .w --
# Methods:
#       about NAME      the recorder of that name; of none: what is there stays
#       open WHAT       a file, or a recorder
#       line            the window of the time line, or nothing
#       text            what stands below it
# All of it is made when the tab is seen.
snit::widget ::sorma::browserTimeline {
    hulltype ttk::frame
    variable shown {}           ;# {-file FILE} or {-name RECORDER}
    variable wanted {}          ;# the same, when the tab is seen
    variable typed {}           ;# in the entry
    variable none               ;# what stands in place of a time line
    variable last 0
    variable line {}

    constructor {} {
        $hull configure -style Page.TFrame
        set none [::msgcat::mc "Choose a recorder at the left or in the list, or type the name of a recording's file and press Return."]
        bind $win <Map> [mymethod Show]
    }
    method Build {} {
        set pad [::sorma::style pixels 8]
        set edge [::sorma::style pixels 16]
        ttk::frame $win.bar -style Page.TFrame
        ttk::label $win.bar.label -style Page.TLabel -text [::msgcat::mc "Recording"]
        ttk::combobox $win.bar.file -style [::sorma::style own TCombobox] -width 6 -textvariable [myvar typed] -postcommand [mymethod Recorders]
        ttk::button $win.bar.read -text [::msgcat::mc "Show"] -command [mymethod Open]
        ttk::button $win.bar.browse -text [::msgcat::mc "Browse\u2026"] -command [mymethod Browse]
        pack $win.bar.label -side left -padx [list 0 $pad]
        pack $win.bar.browse $win.bar.read -side right -padx [list $pad 0]
        pack $win.bar.file -side left -fill x -expand 1         ;# the last: it gives way in a small window
        raise $win.bar.read $win.bar.file
        raise $win.bar.browse $win.bar.read
        ttk::label $win.none -style Page.TLabel -justify left -anchor nw -padding [list $edge $pad] -text $none
        pack $win.bar -side top -fill x -padx $edge -pady [list $edge 0]
        pack $win.none -fill both -expand 1
        bind $win.bar.file <Return> [mymethod Open]
        bind $win.bar.file <<ComboboxSelected>> [mymethod Open]
        bind $win.none <Configure> {%W configure -wraplength [expr {%w - 2 * [::sorma::style pixels 16]}]}
    }
    method about name {
        if {$name ne {}} {
            $self Want [list -name $name]
        }
    }
    method open what {
        $self Want [if {$what in [$self Known]} {list -name $what} else {list -file [file normalize $what]}]
    }
    method line {} {
        return $line
    }
    method text {} {
        return [if {$line eq {}} {set none} else {$line text}]
    }

    method Want what {
        set wanted $what
        set typed [lindex $what 1]
        if {[winfo ismapped $win]} {
            $self Show
        }
    }
    method Show {} {
        if {![winfo exists $win.bar]} {
            $self Build
        }
        if {$wanted eq $shown} return
        package require sorma::timeline
        if {$line ne {}} {
            destroy $line
        }
        pack forget $win.none
        set shown $wanted
        set line [::sorma::timeline $win.line[incr last] {*}$shown]
        pack $line -fill both -expand 1
    }
    # Objects of that class, as far as the model knows.
    method Known {} {
        return [lmap key [::sorma::world keys *@*] {
            set facts [::sorma::world get $key]
            if {![dict exists $facts class] || [dict get $facts class] ne "recorder"} continue
            ::sorma::world shown $key
        }]
    }
    method Recorders {} {
        $win.bar.file configure -values [$self Known]
    }
    method Open {} {
        if {[string trim $typed] ne {}} {
            $self open $typed
        }
    }
    method Browse {} {
        set path [tk_getOpenFile -parent $win -filetypes {{Recording .rec} {All *}}]
        if {$path ne {}} {
            $self open $path
        }
    }
}
