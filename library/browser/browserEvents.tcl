# browserEvents.tcl -- sorma::browserEvents: the events of an object, after the button Listen was pressed.

package require Tk
package require snit
package require sorma::listing
package require sorma::parts
package require sorma::style
package require sorma::world
package provide sorma::browserEvents 1.0

# ::sorma::browserEvents .w ?-keep n? --
# Methods:
#       about NAME: the object that is meant; empty: none. One that is listened to already goes on. listen: begin or end; text
snit::widget ::sorma::browserEvents {
    hulltype ttk::frame
    option -keep -default 1000 -readonly 1
    variable name {}
    variable tokens {}          ;# dict: NAME -> token of the model

    constructor args {
        $self configurelist $args
        set pad [::sorma::style pixels 8]
        set edge [::sorma::style pixels 16]
        ttk::frame $win.bar
        ttk::button $win.bar.listen -text [::msgcat::mc Listen] -command [mymethod listen] -state disabled
        ttk::label $win.bar.name -text [::msgcat::mc "Choose an object."]
        pack $win.bar.listen $win.bar.name -side left -padx [list 0 $pad]
        pack $win.bar -side top -fill x -padx $edge -pady [list $edge $pad]
        ttk::treeview $win.tree -style [::sorma::style own Treeview] -columns text -show headings -yscrollcommand [list $win.scroll set]
        $win.tree heading text -text [::msgcat::mc "Events"] -anchor w
        ttk::scrollbar $win.scroll -style [::sorma::style own Vertical.TScrollbar] -command [list $win.tree yview]
        pack $win.scroll -side right -fill y -pady [list 0 $edge]
        pack $win.tree -side left -fill both -expand 1 -padx [list $edge 0] -pady [list 0 $edge]
        ::sorma::parts::byKeys $win.tree
        bind $win <Destroy> +[mymethod Ended %W]
    }
    method Ended window {
        if {$window eq $win} {
            foreach token [dict values $tokens] {
                ::sorma::world unwatch $token
            }
        }
    }
    method about object {
        set name $object
        $self Show
    }
    method Show {} {
        $win.bar.listen configure -state [expr {$name eq {} ? "disabled" : "normal"}] -text [expr {[dict exists $tokens $name] ? "Stop (Ctrl-L)" : "Listen (Ctrl-L)"}]
        set others [llength [dict keys [dict remove $tokens $name]]]
        $win.bar.name configure -text "[if {$name eq {}} {string cat "Choose an object."} else {::sorma::text::cut [::sorma::text::clean $name] 60}][if {$others > 0} {
            string cat "  (and $others more)"
        }]"
    }
    method listen {} {
        if {$name eq {}} return
        if {[dict exists $tokens $name]} {
            ::sorma::world unwatch [dict get $tokens $name]
            dict unset tokens $name
        } else {
            dict set tokens $name [::sorma::world listen [$self Full] -command [mymethod Heard $name]]
        }
        $self Show
    }
    method Full {} {
        return [expr {[string first @ $name] < 0 ? "$name@self" : $name}]
    }
    method Heard {from event} {
        set line [string map {\n { }} [::sorma::listing watched [dict create name $from time [clock milliseconds] event $event]]]
        set below [expr {[lindex [$win.tree yview] 1] >= 1.0}]
        set item [$win.tree insert {} end -values [list $line]]
        set rows [$win.tree children {}]
        if {[llength $rows] > $options(-keep)} {
            $win.tree delete [list [lindex $rows 0]]
        }
        if {$below} {
            $win.tree see $item
        }
    }
    method text {} {
        return [join [lmap item [$win.tree children {}] {lindex [$win.tree item $item -values] 0}] \n]
    }
}
