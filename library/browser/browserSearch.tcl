# browserSearch.tcl -- sorma::browserSearch: find a word in names of objects and of options, their units and help texts, while it is typed.
#
# Names come from the tree, texts from the tables of classes. Those are asked for at the first search; no object is made.

package require Tk
package require snit
package require sorma::style
package require sorma::table
package require sorma::text
package require sorma::timer
package provide sorma::browserSearch 1.0

# ::sorma::browserSearch .w -tree TREE ?-command PREFIX? ?-most n? --
#
# PREFIX is called with the PLACE of what was chosen, as the tree has it, and an option or nothing. At most -most are shown (200).
#
# Methods:
#       search WORD     find it, as if it was typed
#       found           list of {TEXT PLACE OPTION}, as it was found last
#       text            the same TEXTs, in lines
snit::widget ::sorma::browserSearch {
    hulltype ttk::frame
    option -tree -default {}
    option -command -default {}
    option -most -default 200
    variable wanted {}
    variable found {}
    variable index {}           ;# dict: {KEY CLASS} -> list of OPTION {its name, unit and help}, flat

    constructor args {
        $self configurelist $args
        $hull configure -style Page.TFrame
        ttk::frame $win.bar -style Page.TFrame
        ttk::label $win.bar.label -style Page.TLabel -text [::msgcat::mc "Search"] -underline 2
        ttk::entry $win.bar.entry -textvariable [myvar wanted]
        pack $win.bar.label -side left -padx [list 0 [::sorma::style pixels 6]]
        pack $win.bar.entry -side left -fill x -expand 1
        pack $win.bar -side top -fill x -pady [::sorma::style pixels 4]
        ttk::treeview $win.list -style [::sorma::style own Treeview] -show tree -selectmode browse -yscrollcommand [list $win.scroll set]
        ttk::scrollbar $win.scroll -style [::sorma::style own Vertical.TScrollbar] -command [list $win.list yview]
        bind $win.bar.entry <FocusIn> [mymethod Focused]
        trace add variable [myvar wanted] write [mymethod Typed]
        bind $win.bar.entry <Escape> [mymethod search {}]
        bind $win.bar.entry <Return> [mymethod Choose 0]
        bind $win.bar.entry <Down> [mymethod Down]
        bind $win.list <<TreeviewSelect>> [mymethod Selected]
        bind $win.list <Escape> [mymethod search {}]
        bind $win <Destroy> +[mymethod Ended %W]
        ::sorma::news::hook {answer daemon.changed daemon.process} [mymethod Answered]
    }
    method Ended window {
        if {$window eq $win} {
            ::sorma::timer::cancel $win
            ::sorma::timer::cancel $win.again
            ::sorma::news::unhook [mymethod Answered]
        }
    }
    method found {} {
        return $found
    }
    method text {} {
        return [join [lmap item $found {lindex $item 0}] \n]
    }
    method search word {
        set wanted $word
    }

    # ---- what is known ----

    method Focused {} {
        $options(-tree) learn
        $self Learn
    }
    # Texts of classes that are not in the index yet. Were there any? A question may fail, and then no answer comes: ask again, as long as
    # somebody searches.
    method Learn {} {
        set learned 0
        set missing 0
        foreach class [$options(-tree) classes] {
            if {![dict exists $index $class]} {
                if {[$self LearnClass $class]} {
                    set learned 1
                } else {
                    set missing 1
                }
            }
        }
        if {$missing && $wanted ne {}} {
            ::sorma::timer::once $win.again 1000 {*}[mymethod More]
        }
        return $learned
    }
    # Is it known?
    method LearnClass class {
        lassign $class daemon name
        # Its own table has no such name; an object of that flavor is not made by the question.
        set where [if {$daemon ne "self"} {string cat @$daemon}]
        if {[catch {::sorma::table describe $name.?$where} table] || $table eq {}} {
            return 0
        }
        set texts {}
        foreach option [dict get $table options] {
            lassign $option word type unit range default value help
            lappend texts $word "$word $unit $help"
        }
        dict set index $class $texts
        return 1
    }
    # A table has come, a daemon has changed, or another process has its name: then its classes may be of another version.
    method Answered {event about dict} {
        if {$event eq "daemon.process"} {
            set index [dict filter $index script {class texts} {expr {[lindex $class 0] ne $about}}]
        }
        if {$wanted ne {}} {
            ::sorma::timer::once $win 50 {*}[mymethod More]
        }
    }
    method More {} {
        if {[$self Learn] && $wanted ne {}} {
            $self Show
        }
    }

    # ---- looking ----

    method Typed args {
        $self Learn
        $self Show
    }
    method Show {} {
        if {$wanted eq {}} {
            set found {}
            pack forget $win.list $win.scroll
            return
        }
        $self Find
        set chosen [$win.list selection]
        $win.list delete [$win.list children {}]
        foreach item $found {
            $win.list insert {} end -text [lindex $item 0]
        }
        $win.list configure -height [expr {max(1, min(12, [llength $found]))}]
        if {[llength $found] == 0} {
            $win.list insert {} end -text [::msgcat::mc "nothing is called so"]
        }
        pack $win.scroll -side right -fill y
        pack $win.list -side left -fill both -expand 1
    }
    method Find {} {
        set pattern *[::sorma::text::escape $wanted]*
        set found {}
        foreach key [lsort -dictionary [lsearch -all -inline -nocase -glob [$options(-tree) keys] $pattern]] {
            lappend found [list [$self Line [::sorma::world shown $key]] [$options(-tree) of $key] {}]
            if {[llength $found] >= $options(-most)} return
        }
        foreach flavor [lsort -dictionary [$options(-tree) flavors]] {
            lassign $flavor name daemon
            if {[string match -nocase $pattern $name@$daemon]} {
                lappend found [list "[$self Line [::sorma::world shown $name@$daemon]]  (not made)" [list flavor $daemon $name] {}]
                if {[llength $found] >= $options(-most)} return
            }
        }
        dict for {class texts} $index {
            if {![$options(-tree) has $class]} continue
            lassign $class daemon name
            set object [$options(-tree) first $class]
            set place [expr {$object ne {} ? [list object $daemon $object] : [list class {*}$class]}]
            foreach {option text} $texts {
                if {[string match -nocase $pattern $text]} {
                    lappend found [list [$self Line "$name $text"] $place $option]
                    if {[llength $found] >= $options(-most)} return
                }
            }
        }
    }
    method Line text {
        return [::sorma::text::cut [string map {\n { }} [::sorma::text::clean [string range $text 0 300]]] 120]
    }
    method Down {} {
        set first [lindex [$win.list children {}] 0]
        if {$first ne {}} {
            focus $win.list
            $win.list focus $first
            $win.list selection set [list $first]
        }
    }
    method Selected {} {
        set item [lindex [$win.list selection] 0]
        if {$item ne {}} {
            $self Choose [$win.list index $item]
        }
    }
    method Choose number {
        if {$number < [llength $found]} {
            uplevel #0 [list {*}$options(-command) {*}[lrange [lindex $found $number] 1 2]]
        }
    }
}
