# browserTree.tcl -- sorma::browserTree: a tree of daemons, their classes, the objects and flavors of each, connections and
# listeners.
#
# The model tells what comes and goes. A branch is filled when it is opened, and then kept as the model says: ten thousand objects that
# nobody looks at cost a word each. The model does not know flavors, connections and subscriptions. The tree asks a daemon for
# them while its row is open, and when the daemon tells of a change. Names of daemons are shown, never evaluated.

package require Tk
package require snit
package require sorma::classMark
package require sorma::parts
package require sorma::style
package require sorma::text
package require sorma::timer
package require sorma::world
package provide sorma::browserTree 1.0

# ::sorma::browserTree .w ?-command PREFIX? ?-most n? --
#       PREFIX is called with the PLACE that was chosen: {daemon KEY}, {class KEY CLASS}, {object KEY NAME}, {flavor KEY NAME} (a recipe
#       of which no object has been made), {connections KEY}, {subscriptions KEY}, {connection KEY {DIRECTION WHO ADDRESS}} or
#       {subscription KEY {OBJECT PATTERN WHO}}. If a class has more than -most objects (default 1000), the first ones are
#       shown; the search finds all.
# Methods:
#       chosen                      the PLACE
#       choose PLACE                open the branches that lead there
#       open PLACE, shut PLACE      a branch that is there
#       shown PLACE                 its text
#       text                        what is shown, in lines
#       keys                        NAME@KEY of all objects
#       flavors                     list of {NAME KEY}
#       learn                       ask for the flavors of all daemons
#       classes                     list of {KEY CLASS}
#       has {KEY CLASS}             is it one of them
#       first {KEY CLASS}           an object of that class, empty when there is none
#       of NAME@KEY                 its PLACE
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
    variable unasked            ;# array: KEY -> 1: it did not answer, or was another process, when it was asked last
    variable recipes            ;# array: KEY -> dict: CLASS -> list of NAME, of all classes that are known there and of their recipes
    variable ears               ;# array: KEY -> token of what it tells of itself, while its row is open
    typevariable Groups {connections Connections subscriptions Subscriptions}

    constructor args {
        $self configurelist $args
        $hull configure -style Page.TFrame
        foreach name {members classOf keyOf items places recipes ears unasked} {
            array set $name {}
        }
        install tree using ttk::treeview $win.tree -style [::sorma::style own Treeview] -show tree -selectmode browse \
            -yscrollcommand [list $win.bar set] -xscrollcommand [list ::sorma::parts::scrolled $win.below]
        ttk::scrollbar $win.bar -style Page.[::sorma::style own Vertical.TScrollbar] -command [list $tree yview]
        ttk::scrollbar $win.below -style [::sorma::style own Horizontal.TScrollbar] -orient horizontal -command [list $tree xview]
        $tree column #0 -width [::sorma::style pixels 200]
        bind $win <<ThemeChanged>> [mymethod Looks]
        $self Looks
        grid $tree $win.bar -sticky nsew
        grid $win.below -sticky ew
        grid columnconfigure $win 0 -weight 1
        grid rowconfigure $win 0 -weight 1
        ::sorma::parts::byKeys $tree
        bind $tree <<TreeviewOpen>> [mymethod Opened]
        bind $tree <<TreeviewClose>> [mymethod Closed]
        bind $tree <<TreeviewSelect>> [mymethod Selected]
        bind $win <Destroy> +[mymethod Ended %W]
        lappend tokens [::sorma::world watch * -events daemon.* -command [mymethod Daemon]]
        lappend tokens [::sorma::world watch *@* -events {object.made object.removed} -command [mymethod Object]]
        ::sorma::news::hook daemon.process [mymethod Process]
    }
    method Looks {} {
        foreach state {good asking stale} {
            $tree tag configure $state -foreground [::sorma::style colour $state]
        }
    }
    method Ended window {
        if {$window eq $win} {
            ::sorma::timer::cancel $win*
            ::sorma::news::unhook [mymethod Process]
            foreach token [concat $tokens [lmap {key token} [array get ears] {set token}]] {
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
        } elseif {$kind in {connections subscriptions}} {
            lappend way $place
        } elseif {$kind in {connection subscription}} {
            lappend way [list ${kind}s $key] $place
        } elseif {$kind eq "flavor"} {
            lappend way [list class $key [lindex [split $name .] 0]] $place
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
                $tree item $items($step) -open 1
                $self Fill $step
            }
        }
        $tree selection set [list $items($place)]
        $tree focus $items($place)
        $tree see $items($place)
    }
    method keys {} {
        return [array names classOf]
    }
    method open place {
        $tree item $items($place) -open 1
        $self Fill $place
    }
    method shut place {
        $tree item $items($place) -open 0
        $self Deaf $place
    }
    method shown place {
        return [if {[info exists items($place)]} {$tree item $items($place) -text}]
    }
    method flavors {} {
        set list {}
        foreach key [array names recipes] {
            foreach name [concat {*}[dict values $recipes($key)]] {
                if {![info exists classOf($name@$key)]} {
                    lappend list [list $name $key]
                }
            }
        }
        return $list
    }
    method learn {} {
        foreach key [::sorma::world keys] {
            if {[$self Answers $key]} {
                $self Ask [list daemon $key]
            }
        }
    }
    method classes {} {
        return [array names members]
    }
    method has class {
        return [info exists members($class)]
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
            $self Deafen $key
            unset -nocomplain recipes($key) unasked($key)
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
        if {$state in {alive busy denied} && ![info exists items([list connections $key])]} {
            dict for {group title} $Groups {
                $self Add $place [list $group $key] $title {}
                $tree insert $items([list $group $key]) end -text {}
            }
        }
        if {![$self Answers $key]} {
            set unasked($key) 1
        } elseif {[info exists unasked($key)]} {
            unset unasked($key)
            $self AskOpen $key [list daemon {*}[dict keys $Groups]]
        }
    }
    # Answers of the previous process do not count.
    method Process {event key daemon} {
        unset -nocomplain recipes($key)
        set unasked($key) 1
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
            if {![info exists members([list $daemon $class])]} continue
            set count [dict size $members([list $daemon $class])]
            if {$count == 0 && !([info exists recipes($daemon)] && [dict exists $recipes($daemon) $class])} {
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
        set item [$tree insert [expr {$above eq {} ? {} : $items($above)}] end -text $text -tags [list {*}$tag] -image [$self Mark $above $place]]
        set items($place) $item
        set places($item) $place
        # The longest text can be scrolled to. Names of objects are not measured: there may be very many.
        if {[lindex $place 0] in {connection subscription}} {
            set width [expr {[font measure TkDefaultFont $text] + [::sorma::style pixels 80]}]
            if {$width > [$tree column #0 -minwidth]} {
                $tree column #0 -minwidth $width
            }
        }
    }
    # A class and what is below it have the mark of the class.
    method Mark {above place} {
        foreach row [list $place $above] {
            if {[lindex $row 0] eq "class"} {
                return [::sorma::classMark of [lindex $row 2]]
            }
        }
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
    # Classes come before connections and subscriptions.
    method Before {a b} {
        set order [expr {([lindex $places($a) 0] eq "class") - ([lindex $places($b) 0] eq "class")}]
        return [expr {$order != 0 ? -$order : [string compare $places($a) $places($b)]}]
    }
    # The rows of an open branch. For a class's objects: remove the rows of removed objects; the others stay where they are.
    method Fill place {
        lassign $place kind daemon class
        if {$kind ne "class"} {
            return [$self AskOpen $daemon [list $kind]]
        }
        set names [lsort -dictionary [dict keys $members([list $daemon $class])]]
        set item $items($place)
        foreach child [$tree children $item] {
            if {![info exists places($child)] || [lindex $places($child) 0] ne "object"
                    || ![dict exists $members([list $daemon $class]) [lindex $places($child) 2]]} {
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
        foreach name [lrange [lsort -dictionary [if {[info exists recipes($daemon)] && [dict exists $recipes($daemon) $class]} {
            dict get $recipes($daemon) $class
        }]] 0 $options(-most)-1] {
            if {![dict exists $members([list $daemon $class]) $name]} {
                $self Add $place [list flavor $daemon $name] "[$self Shown $name]  (not made)" asking
            }
        }
        $self Choose
    }
    # The chosen row may have been drawn again.
    method Choose {} {
        if {$told ne {} && [info exists items($told)] && [$tree selection] eq {}} {
            $tree selection set [list $items($told)]
            $tree focus $items($told)
        }
    }
    method Opened {} {
        set item [$tree focus]
        if {[info exists places($item)]} {
            $self Fill $places($item)
        }
    }
    method Closed {} {
        set item [$tree focus]
        if {[info exists places($item)]} {
            $self Deaf $places($item)
        }
    }
    method Deaf place {
        if {[lindex $place 0] eq "daemon"} {
            $self Deafen [lindex $place 1]
        }
    }

    # ---- questions to a daemon ----

    method Answers key {
        set daemon [::sorma::world get $key]
        return [expr {$daemon ne {} && [dict get $daemon state] in {alive busy denied}}]
    }
    # Can the rows of that branch be seen?
    method Open place {
        set above [list daemon [lindex $place 1]]
        return [expr {[info exists items($place)] && [$tree item $items($place) -open] && [$tree item $items($above) -open]}]
    }
    # KINDS: those of {daemon KEY}, {connections KEY}, {subscriptions KEY} that may have changed. Rows that are closed are asked
    # for when they are opened.
    method AskOpen {key kinds} {
        if {[$self Open [list daemon $key]] && ![info exists ears($key)]} {
            set ears($key) [::sorma::world listen sorm@$key -event {[scd][uoi][bnc]*} -command [mymethod Heard $key]]
        }
        foreach kind $kinds {
            if {[$self Open [list $kind $key]] && [$self Answers $key]} {
                ::sorma::timer::once [list $win $kind $key] 20 {*}[mymethod Ask [list $kind $key]]
            }
        }
    }
    method Deafen key {
        if {[info exists ears($key)]} {
            ::sorma::world unwatch $ears($key)
            unset ears($key)
        }
    }
    # It may tell very often: it is asked at most three times a second.
    method Heard {key event} {
        switch -glob -- [dict get $event event] {
            dictionary.* { set kind daemon }
            connection.* { set kind connections }
            subscription.* { set kind subscriptions }
            default return
        }
        ::sorma::timer::once [list $win later $kind $key] 300 {*}[mymethod AskOpen $key [list $kind]]
    }
    method Ask place {
        lassign $place kind key
        ::sorma::world ask $key [list sorm DBX -inventory {*}[dict get {daemon {classes words} connections connections subscriptions subscriptions} $kind]] \
            -command [list ::sorma::parts::answer [mymethod Answered $place]]
    }
    method Answered {place status value} {
        lassign $place kind key
        if {![info exists items([list daemon $key])]} return
        if {$status eq "ok" && [catch {
            set rows [if {$kind eq "daemon"} {$self Recipes [dict get $value text]} else {$self Rows $kind [dict get [dict get $value text] $kind]}]
        }]} {
            set status error
            set value [list "its answer makes no sense"]
        } elseif {$status ne "ok" && [string match "SORMA COMM TIMEOUT*" [lindex $value 1]]} {
            # It is there, but slow: as long as this is open, it is asked again.
            ::sorma::timer::once [list $win again $kind $key] 3000 {*}[mymethod AskOpen $key [list $kind]]
        }
        if {$kind eq "daemon"} {
            if {$status eq "ok"} {
                $self Learned $key $rows
            }
        } elseif {[info exists items($place)]} {
            $self FillGroup $place [if {$status eq "ok"} {set rows}] [if {$status ne "ok"} {lindex $value 0}]
        }
    }
    # dict: CLASS -> list of NAME. A recipe is a word CLASS.FLAVOR.
    method Recipes inventory {
        set found {}
        foreach item [dict get $inventory classes] {
            if {[regexp {^[a-z]\w*$} [lindex $item 0]] && [lindex $item 1] ne {}} {
                dict set found [lindex $item 0] {}
            }
        }
        foreach word [dict get $inventory words] {
            if {[regexp {^([a-z]\w*)\.[^\s@[:cntrl:]]+$} $word -> class]} {
                dict lappend found $class $word
            }
        }
        return $found
    }
    method Learned {key found} {
        set before [if {[info exists recipes($key)]} {set recipes($key)}]
        set recipes($key) $found
        foreach class [dict keys [dict merge $before $found]] {
            if {![info exists members([list $key $class])]} {
                set members([list $key $class]) {}
            }
            dict set stale [list class $key $class] 1
        }
        $self Refresh
    }
    # dict: place -> its text
    method Rows {kind list} {
        set out {}
        foreach row [lrange $list 0 $options(-most)-1] {
            if {$kind eq "connections"} {
                lassign $row direction who address
                set text [expr {$direction eq "to" ? "to $who  $address" : "from $who  $address"}]
            } else {
                lassign $row object pattern who
                set text "$object  $pattern  for $who"
            }
            dict set out [list [string range $kind 0 end-1] [lrange $row 0 2]] [$self Shown $text]
        }
        return [lsort -stride 2 -index 1 -dictionary $out]
    }
    method FillGroup {place rows why} {
        lassign $place kind key
        set item $items($place)
        $tree item $item -text "[dict get $Groups $kind][if {$why eq {}} {string cat "  ([dict size $rows][if {[dict size $rows] >= $options(-most)} {string cat +}])"}]"
        foreach child [$tree children $item] {
            if {![info exists places($child)] || ![dict exists $rows [list [lindex $places($child) 0] [lindex $places($child) 2]]]} {
                $self Lose $child
                $tree delete [list $child]
            }
        }
        set order {}
        dict for {row text} $rows {
            set at [list [lindex $row 0] $key [lindex $row 1]]
            if {![info exists items($at)]} {
                $self Add $place $at $text {}
            }
            lappend order $items($at)
        }
        $tree children $item $order
        if {$why ne {}} {
            $tree insert $item end -text "[::sorma::style mark stale] [$self Shown $why]" -tags stale
        } elseif {[dict size $rows] == 0} {
            $tree insert $item end -text [::msgcat::mc "(none)"] -tags asking
        }
        $self Choose
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
