# circuitPalette.tcl -- sorma::circuitPalette: the classes that a circuit can be made of, with a search and what each is for. They are those of the
# process that has the circuit, and of daemons: a class elsewhere becomes a service elsewhere. It is a view of the model, and waits for no daemon.

package require Tk
package require snit
package require sorma::classMark
package require sorma::parts
package require sorma::style
package require sorma::table
package require sorma::text
package require sorma::world
package provide sorma::circuitPalette 1.0

# ::sorma::circuitPalette .w -where WHERE --
#       The classes of the circuit's process. Each other daemon that this process can name has a part below them. WHERE: the circuit's process, as
#       behind @, empty: this one. A daemon is asked for its classes when somebody opens its part, or searches.
# Methods:
#       search TEXT
#       chosen      the class that is chosen: CLASS, or CLASS@PLACE, as that process writes it; empty: none, or a daemon
#       classes     those that are shown, whether their part is open or not
#       daemons     dict: KEY of a daemon, as of the model -> the state of its part: good, asking or stale
#       key PLACE   what this process writes for PLACE
#       part KEY    the item of that daemon in the list, which has parts when there is more than one
#       tree        the list, where dragging begins
snit::widget ::sorma::circuitPalette {
    hulltype ttk::frame
    option -where -default {} -readonly 1
    variable wanted {}
    variable own self           ;# KEY of the process that has the circuit
    variable known {}           ;# dict: KEY -> dict: class -> purpose
    variable stated {}          ;# dict: KEY of a daemon -> {PLACE STATE WHY}; PLACE: as the circuit's process names it, empty: itself
    variable opened {}          ;# dict: KEY -> is its part open; those that are in it have been asked
    variable items {}           ;# dict: item of the list -> {KEY CLASS}
    variable timer {}
    variable held {}            ;# of the model: it knows that daemon
    variable watch {}           ;# token of the model

    constructor args {
        $self configurelist $args
        set pad [::sorma::style pixels 4]
        $hull configure -style Card.TFrame -padding [::sorma::style pixels 8]
        ::ttk::frame $win.find
        ::ttk::label $win.find.label -text [::msgcat::mc "Search"]
        ::ttk::entry $win.find.entry -textvariable [myvar wanted] -width 8
        ::ttk::frame $win.list
        ::ttk::treeview $win.list.tree -style [::sorma::style own Treeview] -show tree -selectmode browse -height 8 \
            -yscrollcommand [list ::sorma::parts::scrolled $win.list.bar]
        $win.list.tree column #0 -width [::sorma::style pixels 150]
        ::ttk::label $win.help -wraplength [::sorma::style pixels 150] -justify left -anchor nw -font [::sorma::style font small]
        ::sorma::parts::withBar $win.list $win.list.tree $win.list.bar
        ::sorma::parts::byKeys $win.list.tree
        pack $win.find -fill x -pady [list 0 $pad]
        pack $win.find.label -side left -padx [list 0 [::sorma::style pixels 8]]
        pack $win.find.entry -side left -fill x -expand 1
        pack $win.help -side bottom -fill x -pady $pad
        pack $win.list -fill both -expand 1
        ::sorma::style tip $win.find.entry "Search among classes, and in what they are for"
        bind $win.find.entry <KeyRelease> [mymethod List]
        bind $win.find.entry <Escape> [mymethod search {}]
        foreach key {Down Return} {
            bind $win.find.entry <$key> [mymethod First]
        }
        bind $win.list.tree <<TreeviewSelect>> [mymethod Help]
        bind $win.list.tree <<TreeviewOpen>> [mymethod Opened 1]
        bind $win.list.tree <<TreeviewClose>> [mymethod Opened 0]
        bind $win <<ThemeChanged>> [mymethod Looks]
        $self Looks
        bind $win <Map> [mymethod Begin]
        bind $win <Destroy> +[list ::sorma::parts::ended $win [mymethod Ended %W]]
        set held [::sorma::world hold $options(-where)]
    }
    method Looks {} {
        foreach state {good asking stale} {
            $win.list.tree tag configure $state -foreground [::sorma::style colour $state]
        }
    }
    method Ended window {
        if {$window eq $win} {
            after cancel $timer
            if {$watch ne {}} {
                ::sorma::world unwatch $watch
            }
            ::sorma::world release $held
        }
    }

    # ---- the model ----

    method Begin {} {
        set own [::sorma::world use $options(-where)]
        if {$watch eq {}} {
            set watch [::sorma::world watch * -events daemon.* -command [list ::sorma::parts::answer [mymethod Daemon]]]
        }
        $self Soon 0
    }
    method Soon ms {
        after cancel $timer
        set timer [after $ms [mymethod Look]]
    }
    method Daemon {event key daemon} {
        set before $stated
        set own [::sorma::world use $options(-where)]
        set place [if {$event ne "daemon.gone"} {$self Place $key $daemon}]
        if {$event eq "daemon.gone" || $key ne $own && $place eq {}} {
            dict unset stated $key
        } else {
            set state [dict get $daemon state]
            dict set stated $key [list $place [expr {$state in {alive busy} ? "good" : $state eq "asking" ? "asking" : "stale"}] \
                [if {$state ni {alive busy asking}} {string cat $state [if {[dict get $daemon why] ne {}} {string cat ": " [dict get $daemon why]}]}]]
        }
        if {$stated ne $before} {
            $self Soon 0
        }
    }
    # The name of a daemon in the circuit's process, as behind @; empty: no name that is known here leads there. Daemons of one runtime folder know
    # each other by name. An alias of this process means nothing elsewhere, and a path or localhost means nothing on another host.
    method Place {key daemon} {
        if {$key in [list $own self]} return
        if {$own eq "self"} {
            return $key
        }
        set ways [lmap facts [list [::sorma::world get $own] $daemon] {if {$facts ne {}} {dict get $facts how}}]
        if {$ways eq {folder folder}} {
            return $key
        }
        set address [dict get $daemon address]
        return [if {[lindex $ways 0] eq "folder" || [string match *:* $address] && ![regexp {^(?:/|127\.|localhost:|\[::1\])} $address]} {set address}]
    }
    # Take in what is known, and look again while something is still to come.
    method Look {} {
        after cancel $timer
        set now $known
        set open 0
        foreach key [lsort -unique [concat [list $own] [dict keys $stated]]] {
            if {$key ne $own && $wanted eq {} && ![dict exists $opened $key]} continue
            set found [$self Known $key]
            if {$found ne {}} {
                dict set now $key $found
            } elseif {![dict exists $stated $key] || [lindex [dict get $stated $key] 1] ne "stale"} {
                set open 1
            }
        }
        set known $now
        $self List
        if {$open} {
            set timer [after 300 [mymethod Look]]
        }
    }
    method Known key {
        set where [expr {$key eq $own ? $options(-where) : $key}]
        set inventory [::sorma::table inventory $where]
        if {$inventory eq {}} {
            return
        }
        foreach class [concat [dict keys [dict get $inventory classes]] [dict get $inventory installed]] {
            dict set found $class [if {[dict exists $inventory classes $class]} {lindex [dict get $inventory classes $class] 1}]
        }
        return [dict remove $found proxy]
    }

    # ---- the list ----

    method search text {
        set wanted $text
        $self List
    }
    method List {} {
        set tree $win.list.tree
        set before [$tree selection]
        set at [$tree focus]
        set top [lindex [$tree yview] 0]
        $tree delete [$tree children {}]
        set items {}
        set others [dict filter $stated script {key -} {expr {$key ne $own}}]
        if {$wanted ne {} && [lmap key [dict keys $others] {if {[dict exists $known $key] || [dict exists $opened $key]} continue; set key}] ne {}} {
            dict for {key -} $others {
                dict set opened $key 0
            }
            $self Soon 0
        }
        foreach key [concat [list $own] [lsort -dictionary [dict keys $others]]] {
            lassign [if {[dict exists $stated $key]} {dict get $stated $key} else {list {} good}] place state
            set part [if {[dict size $others] > 0} {list daemon $key}]
            set fit [lmap class [if {[dict exists $known $key]} {lsort [dict keys [dict get $known $key]]}] {
                if {![$self Fits $class $key]} continue
                set class
            }]
            if {$wanted ne {} && $fit eq {}} continue
            if {$part ne {}} {
                set open [expr {$wanted ne {} || ($key eq $own ? ![dict exists $opened $key] || [dict get $opened $key] : [dict exists $opened $key] && [dict get $opened $key])}]
                $tree insert {} end -id $part -open $open -tags [list $state] \
                    -text "[if {$state ne {good}} {string cat [::sorma::style mark $state] { }}][::sorma::text::clean [expr {$key eq {self} ? [::msgcat::mc {this process}] : $key}]]"
                if {![dict exists $known $key]} {
                    $tree insert $part end -id [list none $key] -tags asking -text \u2026
                }
            }
            foreach class $fit {
                set item $class[if {$place ne {}} {string cat @ $place}]
                dict set items $item [list $key $class]
                $tree insert $part end -id $item -text $class -image [::sorma::classMark of $class] \
                    -tags [if {$state eq "stale"} {list asking}]
            }
        }
        $tree yview moveto $top
        if {$before ne {} && [$tree exists [lindex $before 0]]} {
            $tree selection set $before
        }
        if {[$tree exists $at]} {
            $tree focus $at             ;# where the arrow keys go on
        }
        $self Help
    }
    # To the list, where the first class is chosen: its help is seen, and Return takes it.
    method First {} {
        set item [lindex [dict keys $items] 0]
        if {$item ne {}} {
            focus $win.list.tree
            $win.list.tree see $item
            $win.list.tree focus $item
            $win.list.tree selection set [list $item]
        }
    }
    method Fits {class key} {
        return [expr {$wanted eq {} || [string first [string tolower $wanted] [string tolower "$class [dict get $known $key $class]"]] >= 0}]
    }
    method Opened open {
        set item [$win.list.tree focus]
        if {$wanted ne {} || [dict exists $items $item]} return
        dict set opened [lindex $item 1] $open
        if {$open} {
            $self Soon 0
        }
    }
    # The help of the class that is chosen, below the reason why its daemon is away.
    method Help {} {
        set item [lindex [$win.list.tree selection] 0]
        lassign [if {[dict exists $items $item]} {dict get $items $item} else {list [lindex $item 1] {}}] key class
        lassign [if {[dict exists $stated $key]} {dict get $stated $key}] place - why
        set text [if {$class ne {}} {
            set purpose [dict get $known $key $class]
            expr {$purpose ne {} ? $purpose : [::msgcat::mc "It is loaded when an object of it is made."]}
        } elseif {$item eq {} && $wanted ne {} && $items eq {}} {
            ::msgcat::mc "No class is called so, or is for that."
        } elseif {$item eq {}} {
            ::msgcat::mc "Drag a class into the picture, or choose it and press Return."
        }]
        if {$class ne {} && $key ne $own} {
            append text "\n[format [::msgcat::mc {Made at %s: a service elsewhere. A circuit that a cycle executes cannot have it.}] $place]"
        }
        $win.help configure -text [string trim "[if {$why ne {}} {string cat [::sorma::style mark stale] { } [::sorma::text::clean $why] \n}]$text"]
    }
    method chosen {} {
        set item [lindex [$win.list.tree selection] 0]
        return [if {[dict exists $items $item]} {set item}]
    }
    method classes {} {
        return [dict keys $items]
    }
    method daemons {} {
        return [dict map {key about} $stated {lindex $about 1}]
    }
    method key place {
        return [lindex [concat [dict keys [dict filter $stated script {key about} {expr {[lindex $about 0] eq $place}}]] [list $place]] 0]
    }
    method part key {
        return [list daemon $key]
    }
    method tree {} {
        return $win.list.tree
    }
}
