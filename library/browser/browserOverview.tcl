# browserOverview.tcl -- sorma::browserOverview: a card for each daemon, with its state, its load, and the errors of the last hour. Below stand the
# objects that are called most, and the time of a call. It asks for that only while somebody can see it.

package require Tk
package require snit
package require sorma::load
package require sorma::parts
package require sorma::style
package require sorma::table
package require sorma::text
package require sorma::world
package provide sorma::browserOverview 1.0

# ::sorma::browserOverview .w ?-command PREFIX? --
#       PREFIX is called with a place, as the tree has it, when a daemon or an object is chosen.
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
    typevariable Rows 4         ;# objects in a card
    typevariable Hour 3600000

    constructor args {
        $self configurelist $args
        pack [ttk::frame $win.body] -fill both -expand 1
        set inner [::sorma::parts::scroller $win.body]
        ttk::label $inner.none -style Page.TLabel -text [::msgcat::mc "No daemon is known yet."]
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
            set load [::sorma::load watch -count 20 -command [mymethod Loaded]]
        } elseif {!$can && $load ne {}} {
            ::sorma::load unwatch $load
            set load {}
        }
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
        $win.body.canvas configure -scrollregion [$win.body.canvas bbox all]
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
            ttk::label $card.$part -font [::sorma::style font title]
            ttk::label $card.${part}Unit -style Unit.TLabel -text [::msgcat::mc $text]
            grid $card.$part -row 2 -column $column -sticky [expr {$column ? "e" : "w"}] -padx $gap
            grid $card.${part}Unit -row 3 -column $column -sticky [expr {$column ? "e" : "w"}] -padx $gap -pady [list 0 $gap]
            incr column
        }
        for {set i 0} {$i < $Rows} {incr i} {
            ttk::button $card.object$i -style Toolbutton
            ttk::label $card.calls$i
            ttk::label $card.time$i
            grid $card.object$i -row [expr {5 + $i}] -column 0 -sticky w
            grid $card.calls$i -row [expr {5 + $i}] -column 1 -sticky e -padx $gap
            grid $card.time$i -row [expr {5 + $i}] -column 2 -sticky e -padx $gap
        }
        foreach {part text column sticky} {most "called most" 0 w perSecond "per second" 1 e slow "99 of 100 within" 2 e} {
            ttk::label $card.$part -style Quiet.TLabel -font [::sorma::style font small] -text [::msgcat::mc $text]
            grid $card.$part -row 4 -column $column -sticky $sticky -padx $gap
        }
        grid columnconfigure $card {0 1 2} -weight 1 -uniform parts
        ::sorma::style bindWheel $card $win.body.canvas
    }
    method Fill {card daemon} {
        set known [::sorma::world get $daemon]
        set state [dict get $known state]
        set look [dict get [dict merge [list $state gone] {alive good busy warn asking asking}] $state]
        set why [lindex [split [dict get $known why] \n] 0]
        $card.state configure -text [string trim "[::sorma::style mark $look] $state"] -foreground [::sorma::style colour $look]
        $card.address configure -text [::sorma::text::clean [string range [string trim "[dict get $known address]  $why"] 0 60]]
        set rows [expr {[dict exists $busiest $daemon] ? [dict get $busiest $daemon] : {}}]
        set rates [lmap row $rows {if {[dict get $row rate] eq {}} continue; dict get $row rate}]
        $card.rate configure -text [if {$rates ne {}} {Number [tcl::mathop::+ {*}$rates]} else {string cat \u2013}]
        set errors [$self errors $daemon]
        $card.errors configure -text $errors -foreground [if {$errors > 0} {::sorma::style colour refused}]
        $card.objects configure -text [llength [::sorma::world objects $daemon]]
        for {set i 0} {$i < $Rows} {incr i} {
            set row [lindex $rows $i]
            set parts [list $card.object$i $card.calls$i $card.time$i]
            if {$row eq {}} {
                grid remove {*}$parts
                continue
            }
            grid {*}$parts
            set name [dict get $row name]
            $card.object$i configure -text [::sorma::text::clean $name] -command [mymethod Choose [list object $daemon $name]]
            $card.calls$i configure -text [if {[dict get $row rate] ne {}} {Number [dict get $row rate]}]
            $card.time$i configure -text [$self Time $daemon $name]
        }
        if {$rows eq {}} {
            grid remove $card.most $card.perSecond $card.slow
        } else {
            grid $card.most $card.perSecond $card.slow
        }
    }
    # How long 99 of 100 calls take at most, as the object says.
    method Time {daemon name} {
        if {$load eq {}} return
        if {[catch {::sorma::table text $daemon [list sorm DBX -look $name -stats]} text]} return      ;# it has gone meanwhile
        return [if {[regexp {p99 <= ([\d.e+-]+) (\S+)} $text -> number unit]} {string cat "$number [string trimright $unit :,]"}]
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
    method Choose place {
        if {$options(-command) ne {}} {
            uplevel #0 [list {*}$options(-command) $place]
        }
    }
    method text {} {
        return [join [concat {*}[lmap daemon [dict keys $cards] {
            set card $inner.card[dict get $cards $daemon]
            list "$daemon  [$card.state cget -text]  [$card.rate cget -text] requests/s  [$card.errors cget -text] errors this hour  [$card.objects cget -text] objects" \
                {*}[lmap row [lrange [if {[dict exists $busiest $daemon]} {dict get $busiest $daemon}] 0 $Rows-1] {string cat "    [dict get $row name]  [dict get $row calls] calls"}]
        }]] \n]
    }
}
