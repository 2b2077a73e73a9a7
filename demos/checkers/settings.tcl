# settings.tcl -- what can be set in the window, each by mouse and by keys, and the page for developers.
#
# The values shown are those in force: a daemon tells the values of its objects. A new daemon is told again the values that a
# person has chosen.
# Rules, time, who plays, and without robot hold from the next game on; another size of the board, or with and without robot, need other daemons:
# then the program that made the window starts them (-restart).

package require sorma::subject

namespace eval checkers::window {
    # option of the program -> what is chosen, what holds in this game
    variable Wanted {}
    variable Now {}
    variable Objects {}         ;# {object option} -> value that a person has set here
    variable Restart {}         ;# command: the daemons are started anew with Wanted
    variable Again {}           ;# command: another game has begun
    variable Rules {braz "Brazilian, 8x8" engl "English, 8x8" intl "international, 10x10"}
    # widget, label, key, what it sets: object, option
    variable Rows {
        level    "Robot's level"           l {draughts.engine@player -level}
        person   "Person's level"          e {human.sim@human -level}
        speed    "Speed, 0: all it can"    s {simlab@lab -speed}
    }
}

# A dict: -variant -dry -mouse -limit, as in force; -restart, -again: commands.
proc checkers::window::settings given {
    variable Restart [dict get $given -restart]
    variable Again [dict get $given -again]
    variable Wanted [dict remove $given -restart -again]
    variable Now $Wanted
}
# The settings of this game.
proc checkers::window::Holds option { variable Now; return [dict get $Now $option] }
# Is there no such daemon, since the game is one without robot?
proc checkers::window::Dry name { return [expr {[Holds -dry] && $name in {eye robot hand transform laser}}] }

# The buttons of a game, in one row.
proc checkers::window::Actions {} {
    ttk::frame .actions -style Page.TFrame
    set gap [sorma::style pixels 4]
    foreach {name text key command} {
        new    "New game"         n checkers::window::New
        resign "Resign"           r {checkers::window::send checkers@player CTRL -resign}
        draw   "Offer a draw"     d {checkers::window::send checkers@player CTRL -draw}
        sides  "Change sides"     t {checkers::window::send checkers@player CTRL -sides}
        order  "Put in order"     o {checkers::window::send checkers@player CTRL -order}
        reset  "Power: reset"     g {checkers::window::send simlab@lab CTRL -reset}
        panels "Panels"           p checkers::window::Panels
    } {
        ttk::button .actions.$name -text $text -command $command {*}[if {$name eq "new"} {list -style Accent.TButton}]
        pack .actions.$name [Key .actions.k$name $key Page.TLabel] -side left -padx [list 0 $gap]
        pack configure .actions.k$name -padx [list 0 [expr {2 * $gap}]]
        bind . <Control-$key> [list .actions.$name invoke]
    }
}
proc checkers::window::Key {window key style} {
    return [ttk::label $window -style $style -text "Ctrl-[string toupper $key]" -font [sorma::style font small] -foreground [sorma::style token quiet]]
}

proc checkers::window::Settings {} {
    variable Rows
    variable Rules
    ttk::labelframe .settings -style Page.TLabelframe -text "Settings" -padding [list [sorma::style pixels 12] [sorma::style pixels 8]]
    set s .settings
    set pad [sorma::style pixels 4]
    foreach {name text key what} $Rows {
        lassign $what object option
        ttk::label $s.t$name -text $text
        Key $s.k$name $key TLabel
        ttk::spinbox $s.$name -width 6 -justify right -command [list checkers::window::Choose $name]
        foreach event {<Return> <FocusOut>} {
            bind $s.$name $event [list checkers::window::Choose $name]
        }
        bind . <Control-$key> [list focus $s.$name]
        set subject [sorma::subject of $object]
        $subject listen [list checkers::window::InForce $name $subject $option] $option
    }
    ttk::label $s.tvariant -text "Rules"
    Key $s.kvariant u TLabel
    ttk::combobox $s.variant -style [::sorma::style own TCombobox] -width 16 -state readonly -values [dict values $Rules]
    $s.variant set [dict get $Rules [Holds -variant]]
    bind $s.variant <<ComboboxSelected>> {
        dict set ::checkers::window::Wanted -variant [lindex [dict keys $::checkers::window::Rules] [.settings.variant current]]
        checkers::window::Later
    }
    ttk::label $s.tlimit -text "Minutes, 0: no limit"
    Key $s.klimit m TLabel
    ttk::spinbox $s.limit -from 0 -to 600 -width 6 -justify right
    $s.limit set [expr {[Holds -limit] / 60.0 == [Holds -limit] / 60 ? [Holds -limit] / 60 : [Holds -limit] / 60.0}]
    set command {checkers::window::Limit [.settings.limit get]}
    $s.limit configure -command $command
    foreach event {<Return> <FocusOut>} {
        bind $s.limit $event $command
    }
    bind . <Control-u> [list focus $s.variant]
    bind . <Control-m> [list focus $s.limit]
    ttk::checkbutton $s.voice -style [::sorma::style own TCheckbutton] -text "Speak aloud" \
        -command checkers::window::Speak -variable ::checkers::window::Voice
    set subject [sorma::subject of speaker@voice]
    $subject listen [list checkers::window::InForce voice $subject -output] -output
    ttk::checkbutton $s.dry -style [::sorma::style own TCheckbutton] -text "Without robot" -variable ::checkers::window::WantDry -command {
        dict set ::checkers::window::Wanted -dry $::checkers::window::WantDry; checkers::window::Later
    }
    ttk::checkbutton $s.mouse -style [::sorma::style own TCheckbutton] -text "I play" -variable ::checkers::window::WantMouse -command {
        dict set ::checkers::window::Wanted -mouse $::checkers::window::WantMouse; checkers::window::Later
    }
    foreach {key name} {a voice w dry y mouse} {
        bind . <Control-$key> [list $s.$name invoke]
        Key $s.k$name $key TLabel
    }
    set ::checkers::window::WantDry [Holds -dry]
    set ::checkers::window::WantMouse [Holds -mouse]
    # Fields begin on one edge.
    foreach name {level person speed variant limit} {
        grid $s.t$name $s.k$name $s.$name -sticky w -padx [list 0 [expr {2 * $pad}]] -pady [expr {$pad / 2}]
    }
    foreach name {voice dry mouse} {
        grid $s.$name $s.k$name -sticky w -padx [list 0 [expr {2 * $pad}]]
    }
    ttk::label $s.later -textvariable ::checkers::window::Later -foreground [sorma::style colour mine] -wraplength [sorma::style pixels 300]
    grid $s.later -columnspan 3 -sticky w
    grid columnconfigure $s 2 -weight 1
}

# ---- what holds at once ----

proc checkers::window::InForce {name subject option args} {
    if {![winfo exists .settings.$name]} return
    set told [$subject get $option]
    if {[dict get $told state] ne "live"} return
    set value [dict get $told live]
    if {$name eq "voice"} {
        set ::checkers::window::Voice [expr {$value eq "sound"}]
        return
    }
    set limits [$subject option $option]
    .settings.$name configure -from [dict get $limits low] -to [dict get $limits high]
    if {[focus] ne ".settings.$name" || ![info exists ::checkers::window::Shown($name)] || [.settings.$name get] eq $::checkers::window::Shown($name)} {
        Shows $name $value
    }
}
# Text that a person is typing there is left alone.
proc checkers::window::Shows {name value} {
    variable Shown
    set Shown($name) [expr {$value == int($value) ? int($value) : $value}]
    .settings.$name set $Shown($name)
}
proc checkers::window::Choose name {
    variable Rows
    lassign [lindex $Rows [expr {[lsearch -exact $Rows $name] + 3}]] object option
    lassign [lmap what {get {cget -from} {cget -to}} {.settings.$name {*}$what}] value from to
    set told [[sorma::subject of $object] get $option]
    [sorma::subject of $object] release
    if {[dict get $told state] eq "live" && [string is double -strict $value] && $value == [dict get $told live]} return
    if {![string is double -strict $value] || $value < $from || $value > $to} {
        Complain "\"$value\" is not a number from [expr {int($from)}] to [expr {int($to)}]"
        if {[string is double -strict [dict get $told live]]} {
            Shows $name [dict get $told live]
        }
        return
    }
    Shows $name $value
    Set $object $option $value
}
proc checkers::window::Speak {} {
    variable Voice
    Set speaker@voice -output [expr {$Voice ? "sound" : "log"}]
}
proc checkers::window::Set {object option value} {
    variable Objects
    dict set Objects [list $object $option] $value
    if {$option eq "-speed"} {
        set ::checkers::session::Speed $value
    }
    send $object CTRL $option $value
}
# A daemon is new: what was chosen is told again.
proc checkers::window::Again daemon {
    variable Objects
    dict for {what value} $Objects {
        lassign $what object option
        if {[lindex [split $object @] 1] eq $daemon} {
            send $object CTRL $option $value
        }
    }
}

# ---- the settings of the next game ----

proc checkers::window::Limit minutes {
    variable Wanted
    if {![string is double -strict $minutes] || $minutes < 0 || $minutes > 600} {
        Complain "\"$minutes\" is not a number from 0 to 600"
        return
    }
    dict set Wanted -limit [expr {round(60 * $minutes)}]
    Later
}
proc checkers::window::Later {} {
    variable Wanted
    variable Now
    variable Later
    set Later [expr {$Wanted eq $Now ? {} : [Apart] ? "The next game will start other daemons (Ctrl-N)." : "This holds from the next game on (Ctrl-N)."}]
}
# Does the next game need other daemons?
proc checkers::window::Apart {} {
    variable Wanted
    variable Now
    return [expr {[dict get $Wanted -dry] != [dict get $Now -dry] || ([dict get $Wanted -variant] eq "intl") != ([dict get $Now -variant] eq "intl")}]
}
# Both give up their game, and begin another one.
proc checkers::window::New {} {
    variable Wanted
    variable Now
    variable Restart
    variable Again
    set apart [Apart]
    set Now $Wanted
    Later
    Yours
    if {$apart} {
        set ::checkers::window::State starting
        set ::checkers::window::Side {}
        Clocks
        {*}$Restart $Now
        return
    }
    send checkers@player CTRL -variant [Holds -variant] -limit [Holds -limit]
    send human.sim@human CTRL -variant [Holds -variant] -mouse [Holds -mouse]
    foreach name {human.sim@human checkers@player} {
        send $name CTRL -new
        send $name EXEC play
    }
    {*}$Again
}

# ---- for developers: a page for each service concerned, with its panel ----

proc checkers::window::Panels {} {
    if {[winfo exists .panels]} {
        raise .panels
        focus .panels.n
        return
    }
    package require sorma::panel
    toplevel .panels -background [ttk::style lookup TFrame -background]
    wm title .panels "Services"
    set gap [sorma::style pixels 6]
    Stop .panels.top 0
    pack .panels.top -fill x -padx $gap -pady $gap
    pack [ttk::notebook .panels.n] -fill both -expand 1 -padx $gap -pady $gap
    ttk::notebook::enableTraversal .panels.n
    set known [lmap d [sorma::daemons] {dict get $d name}]
    set i 0
    foreach name {checkers@player draughts.engine@player porter@player boardsight@player carry@robot pino@robot manus@hand getbrdsit@eye transform@transform
            laser@laser speaker@voice simlab@lab human.sim@human} {
        if {[lindex [split $name @] 1] in $known} {
            .panels.n add [sorma::panel .panels.n.p[incr i] $name] -text [lindex [split $name @] 0]
        }
    }
    wm minsize .panels [winfo reqwidth .panels.top.stop] [expr {[winfo reqheight .panels.top.stop] * 3}]
    focus .panels.n
}
