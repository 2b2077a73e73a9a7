# browserTree.tcl -- sorma::browserTree: what there is, as a tree: daemons, their classes, and the objects of each.
#
# The model tells what comes and goes; nothing is asked. A branch is filled when it is opened, and then kept as the model says: ten
# thousand objects that nobody looks at cost a word each. What daemons call themselves is shown, never evaluated.

package require Tk
package require snit
package require sorma::style
package require sorma::text
package require sorma::timer
package require sorma::world
package provide sorma::browserTree 1.0

# ::sorma::browserTree .w ?-command PREFIX? ?-most n? --
#       PREFIX is called with the PLACE that was chosen: {daemon KEY}, {class KEY CLASS} or {object KEY NAME}. Of a class that has more
#       than -most objects (default 1000) the first ones are shown; the search finds all.
# Methods:
#       chosen: the PLACE; choose PLACE: open the branches that lead there; text: what is shown, in lines; keys: NAME@KEY of all objects;
#       classes, first, of: see there
snit::widget ::sorma::browserTree {
    hulltype ttk::frame
    option -command -default {}
    option -most -default 1000 -readonly 1
    component tree
    variable tokens {}
    variable members            ;# array: {KEY CLASS} -> dict: NAME -> 1
    variable classOf            ;# array: NAME@KEY -> CLASS
    variable keyOf              ;# array: NAME@KEY -> KEY, a name may have an @ of its own
    variable items              ;# array: PLACE -> item of the tree
    variable places             ;# array: item -> PLACE
    variable stale {}           ;# dict: {class KEY CLASS} -> 1: what was shown of these is not what is there
    variable told {}            ;# the PLACE of which -command was told last

    constructor args {
        $self configurelist $args
        foreach name {members classOf keyOf items places} {
            array set $name {}
        }
        install tree using ttk::treeview $win.tree -show tree -selectmode browse -yscrollcommand [list $win.bar set]
        ttk::scrollbar $win.bar -command [list $tree yview]
        ttk::style configure Treeview -rowheight [expr {[font metrics TkDefaultFont -linespace] + [::sorma::style pixels 3]}]
        $tree column #0 -width [::sorma::style pixels 260]
        foreach state {good asking stale} {
            $tree tag configure $state -foreground [::sorma::style colour $state]
        }
        pack $win.bar -side right -fill y
        pack $tree -side left -fill both -expand 1
        bind $tree <<TreeviewOpen>> [mymethod Opened]
        bind $tree <<TreeviewSelect>> [mymethod Selected]
        bind $win <Destroy> +[mymethod Ended %W]
        lappend tokens [::sorma::world watch * -events daemon.* -command [mymethod Daemon]]
        lappend tokens [::sorma::world watch *@* -events {object.made object.removed} -command [mymethod Object]]
    }
    method Ended window {
        if {$window eq $win} {
            ::sorma::timer::cancel $win
            foreach token $tokens {
                ::sorma::world unwatch $token
            }
        }
    }

    # ---- what programs say ----

    method chosen {} {
        set item [lindex [$tree selection] 0]
        return [if {[info exists places($item)]} {set places($item)}]
    }
    method choose place {
        lassign $place kind key name
        set way [list [list daemon $key]]
        if {$kind eq "class"} {
            lappend way $place
        } elseif {$kind eq "object" && [info exists classOf($name@$key)]} {
            lappend way [list class $key $classOf($name@$key)] $place
        }
        $self Refresh
        foreach step $way {
            if {![info exists items($step)]} {
                if {[lindex $step 0] ne "object"} return
                $self Add [lindex $way 1] $step [$self Shown $name] {}      ;# one of those that are too many
            }
            if {$step ne $place} {
                $self Fill $step
                $tree item $items($step) -open 1
            }
        }
        $tree selection set [list $items($place)]
        $tree focus $items($place)
        $tree see $items($place)
    }
    method keys {} {
        return [array names classOf]
    }
    # classes -- list of {KEY CLASS}; first {KEY CLASS}: an object of that class, empty when there is none; of NAME@KEY: its PLACE
    method classes {} {
        return [array names members]
    }
    method first class {
        return [if {[info exists members($class)]} {lindex [dict keys $members($class)] 0}]
    }
    method of key {
        return [list object $keyOf($key) [string range $key 0 end-[expr {[string length $keyOf($key)] + 1}]]]
    }
    method text {} {
        return [join [$self Lines {} {}] \n]
    }
    method Lines {item margin} {
        set out {}
        foreach child [$tree children $item] {
            lappend out $margin[$tree item $child -text]
            if {[$tree item $child -open]} {
                lappend out {*}[$self Lines $child "$margin  "]
            }
        }
        return $out
    }

    # ---- the model ----

    method Daemon {event key daemon} {
        set place [list daemon $key]
        if {$event eq "daemon.gone"} {
            $self Remove $place
            return
        }
        set state [dict get $daemon state]
        set look [expr {$state in {alive busy} ? "good" : $state eq "asking" ? "asking" : "stale"}]
        set text "[::sorma::style mark $look] [$self Shown $key]"
        if {$state ne "alive"} {
            append text "  ($state)"
        }
        if {![info exists items($place)]} {
            $self Add {} $place $text $look
            $self Sort {}
        } else {
            $tree item $items($place) -text $text -tags [list $look]
        }
    }
    method Object {event key object} {
        set name [dict get $object name]
        set daemon [string range $key [expr {[string length $name] + 1}] end]
        if {[info exists classOf($key)]} {
            $self Forget $key $name $daemon
        }
        if {$event eq "object.made"} {
            set class [dict get $object class]
            set classOf($key) $class
            set keyOf($key) $daemon
            dict set members([list $daemon $class]) $name 1
            dict set stale [list class $daemon $class] 1
        }
        ::sorma::timer::once $win 50 {*}[mymethod Refresh]
    }
    method Forget {key name daemon} {
        set class $classOf($key)
        unset classOf($key) keyOf($key)
        dict unset members([list $daemon $class]) $name
        dict set stale [list class $daemon $class] 1
    }

    # Show what has changed, all at once.
    method Refresh {} {
        set changed $stale
        set stale {}
        foreach place [dict keys $changed] {
            lassign $place - daemon class
            set count [dict size $members([list $daemon $class])]
            if {$count == 0} {
                $self Remove $place
                unset members([list $daemon $class])
                continue
            }
            set above [list daemon $daemon]
            if {![info exists items($above)]} {
                dict set stale $place 1         ;# its daemon has not been told yet
                continue
            }
            set text "[$self Shown $class]  ($count)"
            if {![info exists items($place)]} {
                $self Add $above $place $text {}
                $self Sort $items($above)
                $tree insert $items($place) end -text {}
            } else {
                $tree item $items($place) -text $text
            }
            if {[$tree item $items($place) -open]} {
                $self Fill $place
            }
        }
        if {[dict size $stale] > 0} {
            ::sorma::timer::once $win 50 {*}[mymethod Refresh]
        }
    }

    # ---- rows ----

    method Shown text {
        return [::sorma::text::cut [string map {\n \\n} [::sorma::text::clean $text]] 200]
    }
    method Add {above place text tag} {
        set item [$tree insert [expr {$above eq {} ? {} : $items($above)}] end -text $text -tags [list {*}$tag]]
        set items($place) $item
        set places($item) $place
    }
    method Remove place {
        if {[info exists items($place)]} {
            set item $items($place)
            $self Lose $item
            $tree delete [list $item]
        }
    }
    method Lose item {
        foreach child [$tree children $item] {
            $self Lose $child
        }
        if {[info exists places($item)]} {
            unset -nocomplain items($places($item)) places($item)
        }
    }
    method Sort item {
        $tree children $item [lsort -command [mymethod Before] [$tree children $item]]
    }
    method Before {a b} {
        return [string compare [lindex $places($a) end] [lindex $places($b) end]]
    }
    # The rows of a class's objects: those that are gone go, others stay where they are.
    method Fill place {
        lassign $place kind daemon class
        if {$kind ne "class"} return
        set names [lsort -dictionary [dict keys $members([list $daemon $class])]]
        set item $items($place)
        foreach child [$tree children $item] {
            if {![info exists places($child)] || ![dict exists $members([list $daemon $class]) [lindex $places($child) 2]]} {
                $self Lose $child
                $tree delete [list $child]
            }
        }
        set order {}
        foreach name [lrange $names 0 $options(-most)-1] {
            set object [list object $daemon $name]
            if {![info exists items($object)]} {
                $self Add $place $object [$self Shown $name] {}
            }
            lappend order $items($object)
        }
        $tree children $item $order
        set more [expr {[llength $names] - $options(-most)}]
        if {$more > 0} {
            $tree insert $item end -text "\u2026 and $more more; search for them" -tags asking
        }
    }
    method Opened {} {
        set item [$tree focus]
        if {[info exists places($item)]} {
            $self Fill $places($item)
        }
    }
    method Selected {} {
        set place [$self chosen]
        if {$place ne {} && $place ne $told} {
            set told $place
            if {$options(-command) ne {}} {
                uplevel #0 [list {*}$options(-command) $place]
            }
        }
    }
}
