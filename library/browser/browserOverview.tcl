# browserOverview.tcl -- sorma::browserOverview: a card for each daemon, with its state, its load, and the errors of the last hour. Below stand the
# objects that are called most, the slowest ones, and a button that stops the daemon. It asks only while somebody can see it.

package require Tk
package require snit
package require sorma::listing
package require sorma::load
package require sorma::parts
package require sorma::style
package require sorma::text
package require sorma::world
package provide sorma::browserOverview 1.0

# ::sorma::browserOverview .w ?-command PREFIX? --
#       A press calls PREFIX with a place, as the tree has it. {errors DAEMON} stands for its errors.
# Methods:
#       text: what is shown, a line for each daemon and object; errors DAEMON: of the last hour, as far as they came since this was made
snit::widget ::sorma::browserOverview {
    hulltype ttk::frame
    option -command -default {}
    variable inner {}
    variable tokens {}          ;# watches of the model
    variable load {}            ;# that of the load; empty: nobody can see it
    variable busiest {}         ;# dict: daemon -> rows as sorma::load tells them
    variable failed {}          ;# dict: daemon -> list of times [ms]
    variable cards {}           ;# dict: daemon -> number of its card
    variable last 0
    variable timer {}
    variable columns 0
    variable width 0            ;# of the window, for which names are cut
    typevariable Lists {most {4 "called most" "per second"} slow {3 slowest {}}}    ;# of objects in a card: how many, and the titles
    typevariable Most 100       ;# objects that are asked for, of each daemon
    typevariable Hour 3600000

    constructor args {
        $self configurelist $args
        pack [ttk::frame $win.body] -fill both -expand 1
        set inner [::sorma::parts::scroller $win.body]
        ttk::label $inner.none -style Page.TLabel -text [::msgcat::mc "No daemon is known yet."]
        bind $inner <Configure> [mymethod Sized]
        bind $win <Map> [mymethod Seen 1]
        bind $win <Unmap> [mymethod Seen 0]
        bind $win <Destroy> +[list ::sorma::parts::ended $win [mymethod Ended %W]]
        bind $win <<ThemeChanged>> [mymethod Soon]
        bind $win.body.canvas <Configure> +[mymethod Soon]
        set tokens [list [::sorma::world watch * -events {daemon.* object.made object.removed} -command [mymethod Told]] \
            [::sorma::world watch * -events trail -command [mymethod Failed]] [::sorma::world watch *@* -events trail -command [mymethod Failed]]]
        $self Soon
    }
    method Ended window {
        if {$window eq $win} {
            after cancel $timer
            $self Seen 0
            foreach token $tokens {
                ::sorma::world unwatch $token
            }
        }
    }
    method Seen can {
        if {$can && $load eq {}} {
            set load [::sorma::load watch -count $Most -command [mymethod Loaded]]
        } elseif {!$can && $load ne {}} {
            ::sorma::load unwatch $load
            set load {}
        }
    }
    method Sized {} {
        $win.body.canvas configure -scrollregion [$win.body.canvas bbox all]
    }
    method Told {event key told} {
        $self Soon
    }
    method Loaded {daemon rows} {
        dict set busiest $daemon $rows
        $self Soon
    }
    method Failed {event key message} {
        if {[dict get $message severity] ne "error"} return
        dict lappend failed [lindex [split $key @] end] [clock milliseconds]
        $self Soon
    }
    method errors daemon {
        if {![dict exists $failed $daemon]} {
            return 0
        }
        set since [expr {[clock milliseconds] - $Hour}]
        dict set failed $daemon [lmap time [lrange [dict get $failed $daemon] end-9999 end] {if {$time < $since} continue; set time}]
        return [llength [dict get $failed $daemon]]
    }

    # ---- what is shown ----

    method Soon {} {
        if {$timer eq {}} {
            set timer [after 100 [mymethod Show]]
        }
    }
    method Show {} {
        set timer {}
        set daemons [::sorma::world keys]
        dict for {daemon n} $cards {
            if {$daemon ni $daemons} {
                destroy $inner.card$n
                dict unset cards $daemon
            }
        }
        foreach daemon $daemons {
            if {![dict exists $cards $daemon]} {
                dict set cards $daemon [incr last]
                $self Make $inner.card$last $daemon
            }
            $self Fill $inner.card[dict get $cards $daemon] $daemon
        }
        $self Lay $daemons
        # Names are cut to the room that there is: it may be another one now.
        if {[winfo width $win.body.canvas] != $width} {
            set width [winfo width $win.body.canvas]
            after idle [list ::sorma::parts::answer [mymethod Soon]]
        }
    }
    method Make {card daemon} {
        set gap [::sorma::style pixels 8]
        ttk::frame $card -style Card.TFrame -padding [list [expr {2 * $gap}] [::sorma::style pixels 12]]
        ttk::button $card.name -style Strong.Toolbutton -text [::sorma::text::clean $daemon] -command [mymethod Choose [list daemon $daemon {}]]
        ttk::label $card.state
        ttk::label $card.address -style Quiet.TLabel
        grid $card.name -row 0 -column 0 -sticky w
        grid $card.state -row 0 -column 1 -columnspan 2 -sticky e
        grid $card.address -row 1 -column 0 -columnspan 3 -sticky w -padx [list $gap 0] -pady [list 0 $gap]
        set column 0
        foreach {part text} {rate requests/s errors "errors this hour" objects objects} {
            if {$part eq "errors"} {
                ttk::button $card.errors -style Value.Toolbutton -command [mymethod Choose [list errors $daemon {}]]
                ::sorma::style tip $card.errors [::msgcat::mc "show them in the log"]
            } else {
                ttk::label $card.$part -font [::sorma::style font title]
            }
            ttk::label $card.${part}Unit -style Unit.TLabel -text [::msgcat::mc $text]
            grid $card.$part -row 2 -column $column -sticky [expr {$column ? "e" : "w"}] -padx $gap
            grid $card.${part}Unit -row 3 -column $column -sticky [expr {$column ? "e" : "w"}] -padx $gap -pady [list 0 $gap]
            incr column
        }
        set row 3
        dict for {list titles} $Lists {
            lassign $titles count title calls
            $self Row $card $list [incr row] TLabel
            grid rowconfigure $card $row -minsize [::sorma::style pixels 32]
            $card.${list}Object configure -style Quiet.TLabel -text [::msgcat::mc $title]
            $card.${list}Calls configure -text [::msgcat::mc $calls]
            $card.${list}Time configure -text [::msgcat::mc "99 of 100 within"]
            for {set i 0} {$i < $count} {incr i} {
                $self Row $card $list$i [incr row] Toolbutton
            }
        }
        ttk::frame $card.end
        ttk::label $card.end.said -style Quiet.TLabel
        ttk::button $card.end.stop -text [::msgcat::mc Stop] -command [mymethod AskStop $card $daemon]
        ttk::button $card.end.keep -text [::msgcat::mc Keep] -command [mymethod Keep $card]
        pack $card.end.stop -side right
        pack $card.end.said -side left -fill x -expand 1
        grid $card.end -row [incr row] -column 0 -columnspan 3 -sticky ew -padx $gap -pady [list $gap 0]
        grid rowconfigure $card $row -weight 1
        grid configure $card.end -sticky sew
        grid columnconfigure $card 0 -weight 1
        ::sorma::style bindWheel $card $win.body.canvas
    }
    # The parts of a row of a list: NAMEObject, in that style of buttons or labels, NAMECalls and NAMETime.
    method Row {card name row style} {
        set gap [::sorma::style pixels 8]
        if {$style eq "Toolbutton"} {
            ttk::button $card.${name}Object -style $style
        } else {
            ttk::label $card.${name}Object
        }
        ttk::label $card.${name}Calls -style [expr {$style eq "Toolbutton" ? "TLabel" : "Quiet.TLabel"}]
        ttk::label $card.${name}Time -style [$card.${name}Calls cget -style]
        grid $card.${name}Object -row $row -column 0 -sticky w -padx [expr {$style eq "Toolbutton" ? 0 : $gap}]
        grid $card.${name}Calls -row $row -column 1 -sticky e -padx $gap
        grid $card.${name}Time -row $row -column 2 -sticky e -padx $gap
    }
    method Fill {card daemon} {
        set known [::sorma::world get $daemon]
        set state [dict get $known state]
        set look [dict get [dict merge [list $state gone] {alive good busy warn asking asking}] $state]
        set why [lindex [split [dict get $known why] \n] 0]
        $card.state configure -text [string trim "[::sorma::style mark $look] $state"] -foreground [::sorma::style colour $look]
        $card.address configure -text [::sorma::text::clean [string range [string trim "[dict get $known address]  $why"] 0 60]]
        set rows [$self Rows $daemon]
        set rates [lmap row $rows {if {[dict get $row rate] eq {}} continue; dict get $row rate}]
        $card.rate configure -text [if {$rates ne {}} {Number [tcl::mathop::+ {*}$rates]} else {string cat \u2013}]
        set errors [$self errors $daemon]
        $card.errors configure -text [if {$errors > 0} {string cat "[::sorma::style mark refused] $errors"} else {set errors}] \
            -style [expr {$errors > 0 ? "Error.Value.Toolbutton" : "Value.Toolbutton"}]
        $card.objects configure -text [llength [::sorma::world objects $daemon]]
        foreach list [dict keys $Lists] {
            $self List $card $list $daemon [$self Chosen $list $daemon]
        }
        $self Stops $card $known
    }
    method Rows daemon {
        return [if {[dict exists $busiest $daemon]} {dict get $busiest $daemon}]
    }
    # The objects of a list, in their order.
    method Chosen {list daemon} {
        set rows [$self Rows $daemon]
        if {$list eq "slow"} {
            set timed [lmap row $rows {if {[dict get $row p99] eq {}} continue; list [dict get $row p99] $row}]
            set rows [lmap pair [lsort -real -decreasing -index 0 $timed] {lindex $pair 1}]
        }
        return [lrange $rows 0 [lindex [dict get $Lists $list] 0]-1]
    }
    # A list has its title as long as there are objects in it.
    method List {card list daemon rows} {
        for {set i -1} {$i < [lindex [dict get $Lists $list] 0]} {incr i} {
            set name $list[if {$i >= 0} {set i}]
            set parts [list $card.${name}Object $card.${name}Calls $card.${name}Time]
            if {$i >= [llength $rows] || $rows eq {}} {
                grid remove {*}$parts
                continue
            }
            grid {*}$parts
            if {$i >= 0} {
                set row [lindex $rows $i]
                set object [dict get $row name]
                $card.${name}Object configure -text [$self Fit $card [::sorma::text::clean $object]] -command [mymethod Choose [list object $daemon $object]]
                $card.${name}Calls configure -text [if {$list eq "most" && [dict get $row rate] ne {}} {Number [dict get $row rate]}]
                $card.${name}Time configure -text [if {[dict get $row p99] ne {}} {::sorma::listing microseconds [expr {1e6 * [dict get $row p99]}]}]
            }
        }
    }
    # A name that there is no room for ends in dots.
    method Fit {card name} {
        set room [expr {[lindex [grid bbox $card 0 2] 2] - [::sorma::style pixels 20]}]
        set font TkDefaultFont
        if {$room < 20 || [font measure $font $name] <= $room} {
            return $name
        }
        while {[string length $name] > 4 && [font measure $font $name\u2026] > $room} {
            set name [string range $name 0 end-1]
        }
        return $name\u2026
    }
    proc Number rate {
        return [if {$rate >= 100} {format %.0f $rate} else {format %.1f $rate}]
    }
    # Beside each other, as many as there is room for.
    method Lay daemons {
        set wanted [expr {max(1, [winfo width $win.body.canvas] / [::sorma::style pixels 380])}]
        set gap [::sorma::style pixels 16]
        set n 0
        foreach daemon $daemons {
            grid $inner.card[dict get $cards $daemon] -row [expr {$n / $wanted}] -column [expr {$n % $wanted}] -sticky nsew -padx [list $gap 0] -pady [list $gap 0]
            incr n
        }
        for {set column 0} {$column < max($wanted, $columns)} {incr column} {
            grid columnconfigure $inner $column -weight [expr {$column < $wanted}] -uniform [expr {$column < $wanted ? "cards" : {}}]
        }
        set columns $wanted
        if {$daemons eq {}} {
            grid $inner.none -row 0 -column 0 -padx $gap -pady $gap
        } else {
            grid remove $inner.none
        }
    }
    # ---- a daemon is stopped ----

    # It is of this user and on this host when its socket lies in the user's folder: then it can be stopped, as from a shell.
    method Stops {card known} {
        set can [expr {[dict get $known how] eq "folder" && [dict get $known pid] ne {} && [dict get $known state] in {alive busy silent}}]
        if {$can} {
            grid $card.end
        } else {
            $self Keep $card
            grid remove $card.end
        }
    }
    method AskStop {card daemon} {
        if {[winfo manager $card.end.keep] eq {}} {
            $card.end.said configure -text [::msgcat::mc "Its objects end with it."]
            $card.end.stop configure -style Accent.TButton -text [::msgcat::mc "Stop it"]
            pack $card.end.keep -side right -padx [list 0 [::sorma::style pixels 8]]
            return
        }
        $self Keep $card
        set known [::sorma::world get $daemon]
        if {$known ne {} && [dict get $known pid] ne {} && [catch {exec kill [dict get $known pid]} message]} {
            $card.end.said configure -text [lindex [split $message \n] 0]
        }
    }
    method Keep card {
        $card.end.said configure -text {}
        $card.end.stop configure -style TButton -text [::msgcat::mc Stop]
        pack forget $card.end.keep
    }
    method Choose place {
        if {$options(-command) ne {}} {
            uplevel #0 [list {*}$options(-command) $place]
        }
    }
    method text {} {
        return [join [concat {*}[lmap daemon [dict keys $cards] {
            set card $inner.card[dict get $cards $daemon]
            list "$daemon  [$card.state cget -text]  [$card.rate cget -text] requests/s  [$self errors $daemon] errors this hour  [$card.objects cget -text] objects" \
                {*}[lmap row [$self Chosen most $daemon] {string cat "    [dict get $row name]  [dict get $row calls] calls"}] \
                {*}[lmap row [$self Chosen slow $daemon] {string cat "    [dict get $row name]  99 of 100 within [::sorma::listing microseconds [expr {1e6 * [dict get $row p99]}]]"}]
        }]] \n]
    }
}
