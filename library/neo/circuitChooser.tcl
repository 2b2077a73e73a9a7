# circuitChooser.tcl -- sorma::circuitChooser: the circuits that there are, to open one.

package require Tk
package require snit
package require sorma::parts
package require sorma::style
package require sorma::world
package provide sorma::circuitChooser 1.0

# ::sorma::circuitChooser .w -command PREFIX --
#       A list of all objects of class circuit, as they come and go, and a line for the name of another one. PREFIX is called with a name.
# Methods:
#       names: those in the list;  open NAME
snit::widget ::sorma::circuitChooser {
    hulltype ttk::frame
    option -command -default list -readonly 1
    variable name {}
    variable watch {}

    constructor args {
        $self configurelist $args
        set pad [::sorma::style pixels 8]
        $hull configure -padding [::sorma::style pixels 16]
        ::ttk::label $win.title -text [::msgcat::mc Circuits] -font [::sorma::style font title]
        ::ttk::frame $win.list
        ::ttk::treeview $win.list.tree -style [::sorma::style own Treeview] -show tree -selectmode browse -height 10 \
            -yscrollcommand [list ::sorma::parts::scrolled $win.list.bar]
        ::sorma::parts::withBar $win.list $win.list.tree $win.list.bar
        ::sorma::parts::byKeys $win.list.tree
        ::ttk::label $win.other -text [::msgcat::mc "Name, such as circuit.arm@robot"]
        ::ttk::entry $win.name -textvariable [myvar name] -width 40
        ::ttk::button $win.open -style Accent.TButton -text [::msgcat::mc Open] -command [mymethod Open]
        pack $win.title -anchor w
        pack $win.list -fill both -expand 1 -pady $pad
        pack $win.other -anchor w
        pack $win.open -side right -padx [list $pad 0]
        pack $win.name -fill x
        bind $win.list.tree <<TreeviewSelect>> [mymethod Chosen]
        foreach {window event} [list $win.list.tree <Return> $win.list.tree <Double-ButtonPress-1> $win.name <Return>] {
            bind $window $event [mymethod Open]
        }
        bind $win <Destroy> +[list ::sorma::parts::ended $win [mymethod Ended %W]]
        set watch [::sorma::world watch *@* -events object.* -command [list ::sorma::parts::answer [mymethod Changed]]]
    }
    method Ended window {
        if {$window eq $win} {
            ::sorma::world unwatch $watch
        }
    }
    method Changed {event key object} {
        set tree $win.list.tree
        if {$event eq "object.removed"} {
            $tree delete [lmap item [list $key] {if {![$tree exists $item]} continue; set item}]
        } elseif {![$tree exists $key] && [dict get $object class] eq "circuit"} {
            $tree insert {} [llength [lmap item [$tree children {}] {if {[string compare $item $key] > 0} continue; set item}]] -id $key -text [::sorma::world shown $key]
        }
    }
    method Chosen {} {
        set name [lindex [$win.list.tree selection] 0]
    }
    method Open {} {
        if {[string trim $name] ne {}} {
            $self open [string trim $name]
        }
    }
    method open which {
        {*}$options(-command) [regsub {@self$} $which {}]
    }
    method names {} {
        return [$win.list.tree children {}]
    }
}
