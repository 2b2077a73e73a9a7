# circuitPalette.tcl -- sorma::circuitPalette: the classes that a circuit can be made of, with a search and what each is for.

package require Tk
package require snit
package require sorma::classMark
package require sorma::parts
package require sorma::style
package require sorma::table
package require sorma::world
package provide sorma::circuitPalette 1.0

# ::sorma::circuitPalette .w -where WHERE --
#       The classes of the process that has the circuit. WHERE: what stands after @, empty: this one.
# Methods:
#       search TEXT; chosen: the class that is chosen; classes: those that are shown; tree: the list, where dragging begins
snit::widget ::sorma::circuitPalette {
    hulltype ttk::frame
    option -where -default {} -readonly 1
    variable wanted {}
    variable known {}           ;# dict: class -> purpose
    variable timer {}
    variable held {}            ;# of the model: it knows that daemon
    variable watch {}

    constructor args {
        $self configurelist $args
        set pad [::sorma::style pixels 4]
        $hull configure -style Card.TFrame -padding [::sorma::style pixels 8]
        ::ttk::entry $win.search -textvariable [myvar wanted] -width 12
        ::ttk::frame $win.list
        ::ttk::treeview $win.list.tree -style [::sorma::style own Treeview] -show tree -selectmode browse -height 8 \
            -yscrollcommand [list ::sorma::parts::scrolled $win.list.bar]
        $win.list.tree column #0 -width [::sorma::style pixels 150]
        ::ttk::label $win.help -wraplength [::sorma::style pixels 150] -justify left -anchor nw -font [::sorma::style font small]
        ::sorma::parts::withBar $win.list $win.list.tree $win.list.bar
        ::sorma::parts::byKeys $win.list.tree
        pack $win.search -fill x -pady [list 0 $pad]
        pack $win.help -side bottom -fill x -pady $pad
        pack $win.list -fill both -expand 1
        ::sorma::style tip $win.search "Search among classes, and in what they are for"
        bind $win.search <KeyRelease> [mymethod List]
        bind $win.search <Escape> [mymethod search {}]
        bind $win.search <Down> [list focus $win.list.tree]
        bind $win.list.tree <<TreeviewSelect>> [mymethod Help]
        bind $win <Map> [mymethod Begin]
        bind $win <Destroy> +[list ::sorma::parts::ended $win [mymethod Ended %W]]
        set held [::sorma::world hold $options(-where)]
    }
    method Ended window {
        if {$window eq $win} {
            after cancel $timer
            ::sorma::world release $held
        }
    }
    # The table of a daemon comes when it answers.
    method Begin {} {
        after cancel $timer
        set found [$self Known]
        if {$found ne $known} {
            set known $found
            $self List
        }
        if {$known eq {}} {
            set timer [after 300 [mymethod Begin]]
        }
    }
    method Known {} {
        set inventory [::sorma::table inventory $options(-where)]
        set found {}
        foreach class [if {$inventory ne {}} {::sorma::table classes $options(-where)}] {
            dict set found $class [if {[dict exists $inventory classes $class]} {lindex [dict get $inventory classes $class] 1}]
        }
        return $found
    }
    method search text {
        set wanted $text
        $self List
    }
    method List {} {
        set tree $win.list.tree
        set before [$self chosen]
        $tree delete [$tree children {}]
        foreach class [lsort [dict keys $known]] {
            if {$wanted eq {} || [string first [string tolower $wanted] [string tolower "$class [dict get $known $class]"]] >= 0} {
                $tree insert {} end -id $class -text $class -image [::sorma::classMark of $class]
            }
        }
        if {[$tree exists $before]} {
            $tree selection set [list $before]
        }
        $self Help
    }
    method Help {} {
        set class [$self chosen]
        $win.help configure -text [if {$class ne {}} {dict get $known $class} else {::msgcat::mc "Drag a class into the picture, or choose it and press Return."}]
    }
    method chosen {} {
        return [lindex [$win.list.tree selection] 0]
    }
    method classes {} {
        return [$win.list.tree children {}]
    }
    method tree {} {
        return $win.list.tree
    }
}
