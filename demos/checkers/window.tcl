# window.tcl -- the game in a window: the board, the board as the camera sees it, its picture, what is said, the moves, the clocks, the plot,
# the daemons. Nothing in it waits: all requests are asynchronous. The settings are in settings.tcl.
#
#     checkers::window::build SETTINGS          as settings.tcl has them
#     checkers::window::begin                   the daemons have been started (again)
#     checkers::window::plot TOLD               what the plot tells: a dict

package require Tk
package require sorma::image
package require sorma::notice
package require sorma::style
package require sorma::theme
package require sorma::world
source [file join [file dirname [file normalize [info script]]] packages.tcl]
package require checkers::repair
package require checkers::tokens
package require checkers::boardview
source [file join [file dirname [file normalize [info script]]] settings.tcl]

namespace eval checkers::window {
    variable Plot {person "Your turn" validate "A move is accepted" think "The robot thinks" answer "The robot has decided" carry "The arm carries"
        carried "The arm carries" verify "The eye looks" trouble "Something is wrong" over "The game is over" begin "A new game" idle "No game"
        shifted "The board was moved" feel "The hand feels" felt "The hand feels" tidy "The robot puts the board in order" survey "The eye looks"
        agreed "The game is over" pointed "The laser points" ponder "Your turn" declined "The draw is declined" offer "The robot offers a draw"
        sides "Sides have been changed" thought "The robot thinks" played "The robot has moved" starting "The daemons are started"}
    variable Daemons {player eye robot hand transform laser voice lab human}
    variable Width 8
    variable Robot black
    variable State starting
    variable Clock {white 0 black 0 limit 0}    ;# [s] that each side has taken
    variable Side {}                    ;# whose clock runs
    variable Since 0                    ;# [ms] when Clock was so
    variable Lies {}                    ;# what lies where, as the left board shows it
    variable Last {}                    ;# the last position that the plot has told: dict
    variable Hand 0                     ;# moves of the person's hand that are under way
    variable Looking 0                  ;# the laboratory is asked what lies on the table
    variable Blind {}                   ;# why that is not known; empty: it is
    variable Shows 0                    ;# how often something was shown: what was asked before that is old
    variable Thoughts {}
    variable Hears {}                   ;# subscriptions
    variable Boots                      ;# array: daemon -> which process it was when it was last seen
}

proc checkers::window::send {name args} {
    sorma::async -timeout 0 -command [list checkers::window::Answered $name] $name {*}$args
}
# Failures are shown among the spoken messages.
proc checkers::window::Answered {name future} {
    if {[catch {$future take} text]} {
        Complain $text
    }
}
proc checkers::window::Complain text {
    puts "    ($text)"
    if {[winfo exists .said]} {
        Write .said "$text\n" wrong
    }
}

# ---- what it looks like ----

proc checkers::window::build settings {
    variable Width
    settings $settings
    set Width [expr {[Holds -variant] eq "intl" ? 10 : 8}]
    wm title . "Draughts with a robot"
    sorma::theme program
    set gap [sorma::style pixels 8]
    # Both boards fit beside a picture, and something below them.
    set size [expr {int(min([sorma::style pixels 560], 0.31 * [winfo screenwidth .], 0.5 * [winfo screenheight .]))}]
    Stop .top 1
    pack .top -fill x -padx $gap -pady $gap
    Lamps
    pack .lamps -side bottom -fill x -padx $gap -pady $gap
    pack [ttk::frame .f -style Page.TFrame] -fill both -expand 1 -padx [expr {$gap / 2}]
    foreach w {game eye camera moves talk} text {"The game" "What the eye sees, and how certain" "The camera in the hand" "Moves" "What is said"} {
        ttk::labelframe .$w -style Page.TLabelframe -text $text -padding $gap
    }
    checkers::boardview create gameBoard .game.board -width $Width -size $size -heaps 1 -drop checkers::window::Drop -goals checkers::window::Goals
    checkers::boardview create eyeBoard .eye.board -width $Width -size [expr {$size * 5 / 8}]
    pack .game.board .eye.board -fill both -expand 1
    sorma::image .camera.picture -name getbrdsit@eye -request {EXEC debug} -every 0 -brief 1 -zoom fit -width 300 -height 220
    ttk::label .camera.none -text "A game without robot and camera" -anchor center
    pack .camera.picture -fill both -expand 1

    text .moves.text -width 24 -height 4 -wrap word -state disabled -takefocus 0 -tabs [sorma::style pixels 34] -yscrollcommand {.moves.y set}
    ttk::scrollbar .moves.y -style [::sorma::style own Vertical.TScrollbar] -command {.moves.text yview}
    text .said -width 34 -height 6 -wrap word -state disabled -takefocus 0 -yscrollcommand {.talk.y set}
    ttk::scrollbar .talk.y -style [::sorma::style own Vertical.TScrollbar] -command {.said yview}
    ttk::label .talk.thoughts -textvariable ::checkers::window::Thoughts
    pack .talk.thoughts -side bottom -fill x
    foreach {frame text} {.moves .moves.text .talk .said} {
        pack $frame.y -side right -fill y
        pack $text -in $frame -fill both -expand 1
    }
    Actions
    pack .actions -before .f -fill x -padx $gap -pady [list 0 $gap]
    Settings
    # The game is at the left and large. The robot's view and messages are in the middle, the settings at the right.
    foreach {column parts weight} {0 {game moves} 8 1 {eye talk} 5 2 {camera settings} 5} {
        grid [ttk::frame .f.c$column -style Page.TFrame] -row 0 -column $column -sticky nsew -padx [expr {$gap / 2}]
        grid columnconfigure .f $column -weight $weight -uniform part
        foreach part $parts share {3 1} {
            grid .$part -in .f.c$column -sticky nsew -pady [list 0 $gap]
            grid rowconfigure .f.c$column [expr {$share == 1}] -weight $share
        }
        grid columnconfigure .f.c$column 0 -weight 1
    }
    # Settings keep their room, and some lines of text can always be read.
    grid rowconfigure .f.c2 1 -weight 0
    foreach column {0 1} text {.moves .talk} {
        grid rowconfigure .f.c$column 1 -minsize [winfo reqheight $text]
    }
    grid rowconfigure .f 0 -weight 1
    bind . <Control-b> {focus .game.board}
    bind . <<ThemeChanged>> {+if {"%W" eq "."} {after idle checkers::window::Themed}}
    Themed
    Yours
    Tick
    sorma::world watch * -events daemon.* -command checkers::window::Daemon
    update idletasks
    # It does not grow with what is shown in it.
    wm geometry . [expr {min(max([winfo reqwidth .], [sorma::style pixels 1280]), [winfo screenwidth .])}]x[expr {min(max([winfo reqheight .],
        [sorma::style pixels 800]), [winfo screenheight .])}]
    wm minsize . [expr {[winfo reqwidth .top.stop] + 4 * $gap}] [expr {[winfo reqheight .top] * 3}]
    focus .game.board
}
# A bar with the emergency stop, which keeps its room when the window is small; Escape is the same. CLOCKS: with the state of the plot, too.
proc checkers::window::Stop {bar clocks} {
    ttk::frame $bar -style Page.TFrame
    button $bar.stop -text "EMERGENCY STOP  (Esc)" -background #c03028 -activebackground #e04038 -foreground white -activeforeground white \
        -font TkHeadingFont -relief flat -borderwidth 0 -highlightbackground #c03028 -pady [sorma::style pixels 10] -padx [sorma::style pixels 24] -command {checkers::window::send simlab@lab CTRL -emergencyStop}
    pack $bar.stop -side right
    if {$clocks} {
        foreach side {black white} {
            pack [canvas $bar.$side -width [sorma::style pixels 190] -height [sorma::style pixels 46] -highlightthickness 0] -side right -padx [list 0 [sorma::style pixels 8]]
        }
        ttk::label $bar.state -style Page.TLabel -textvariable ::checkers::window::Head -font [Large] -anchor w
        pack $bar.state -side left -fill x -expand 1
    }
    bind [winfo toplevel $bar] <Escape> [list $bar.stop invoke]
}
proc checkers::window::Large {} {
    if {"checkersLarge" ni [font names]} {
        font create checkersLarge {*}[font actual TkHeadingFont]
        font configure checkersLarge -size [expr {round(1.5 * [font configure checkersLarge -size])}]
    }
    return checkersLarge
}
# Tk's own widgets look as the theme does.
proc checkers::window::Themed {} {
    if {![winfo exists .lamps]} return
    set back [ttk::style lookup Page.TFrame -background]
    . configure -background $back
    .camera.picture.canvas configure -background [ttk::style lookup TFrame -background]
    foreach canvas {.top.white .top.black} {
        $canvas configure -background $back
    }
    foreach text {.moves.text .said} {
        foreach {option style} {-background -fieldbackground -foreground -foreground} {
            set colour [ttk::style lookup TEntry $style]
            if {$colour ne {}} {
                $text configure $option $colour
            }
        }
        $text configure -relief flat -highlightthickness 0 -font TkDefaultFont -spacing1 [sorma::style pixels 2] -padx [sorma::style pixels 4]
    }
    .said tag configure wrong -foreground [sorma::style colour alarm]
    Clocks
}
# A player with mouse and keys sees the tokens as they lie on the table.
proc checkers::window::Yours {} {
    .game configure -text [expr {[Holds -mouse] ? "The table: carry tokens with the mouse, or arrow keys and Return (Ctrl-B)" : "The game"}]
}

# ---- daemons ----

proc checkers::window::begin {} {
    variable Hears
    variable Daemons
    foreach subscription $Hears {
        sorma::unsubscribe $subscription
    }
    set Hears [list [sorma::subscribe [expr {[Holds -dry] ? "drysight" : "boardsight"}]@player -event seen -latest -command checkers::window::Seen] \
        [sorma::subscribe checkers@player -event said -queue 1000 -command checkers::window::Said]]
    foreach name $Daemons {
        set told [sorma::world get $name]
        Lamp $name [expr {$told eq {} ? "gone" : [dict get $told state]}]
    }
    .away configure -daemons [lmap name $Daemons {if {[Dry $name]} continue; set name}]
    # Without robot there is no camera.
    .camera.picture configure -every [expr {[Holds -dry] ? 0 : 1000}]
    if {[Holds -dry]} {
        place .camera.none -relx 0.5 -rely 0.5 -anchor center -relwidth 1 -relheight 1
    } else {
        place forget .camera.none
        .camera.picture refresh
    }
}

proc checkers::window::Lamps {} {
    variable Daemons
    ttk::frame .lamps -style Page.TFrame
    foreach name $Daemons {
        pack [ttk::label .lamps.c$name -style Page.TLabel -width 2 -anchor e] [ttk::label .lamps.l$name -style Page.TLabel -text $name] -side left \
            -padx [list 0 [sorma::style pixels 4]]
        Lamp $name gone
    }
    # Which of them is away, and why, stands beside the lamps.
    sorma::notice .away -lines 1 -style Page.TFrame
    .away.text configure -style Page.TLabel
    pack .away -in .lamps -side left -fill x -expand 1 -padx [list [sorma::style pixels 16] 0]
    raise .away .lamps
}
# A daemon was found, has changed, or is gone. A process that is new begins with what it was started with.
proc checkers::window::Daemon {event name told} {
    variable Boots
    if {![winfo exists .lamps.c$name]} return
    Lamp $name [dict get $told state]
    if {[dict get $told state] ne "alive"} return
    set boot [dict get $told boot]
    if {[info exists Boots($name)] && $Boots($name) ne $boot} {
        Again $name
    }
    set Boots($name) $boot
}
proc checkers::window::Lamp {name state} {
    if {$state ne "alive" && [Dry $name]} {
        set state none
    }
    set shown [dict get [dict merge [dict create $state refused] {alive good busy warn none asking asking asking}] $state]
    .lamps.c$name configure -text [sorma::style mark $shown] -foreground [sorma::style colour $shown]
}
proc checkers::window::Tick {} {
    if {![winfo exists .lamps]} return
    Clocks
    Look
    after 500 checkers::window::Tick
}

# ---- what is told ----

proc checkers::window::Head {} {
    variable State
    variable Plot
    variable Head
    variable Last
    variable Blind
    set Head [expr {$Blind ne {} ? "The table is not seen: [lindex [split $Blind \n] 0]" : $State eq "over" ? "The game is over: [dict get $Last result], [dict get $Last reason]"
        : $State in {person ponder} && ![Holds -mouse] ? "The person's turn" : [dict exists $Plot $State] ? [dict get $Plot $State] : $State}]
}
# A clock for each side: what is left when there is a limit, else what has been taken.
proc checkers::window::Clocks {} {
    variable Clock
    variable Side
    variable Since
    variable Robot
    Head
    foreach {side face edge} {white #f0c838 #94761a black #c8322a #7c1712} {
        set seconds [dict get $Clock $side]
        if {$Side eq $side} {
            set seconds [expr {$seconds + ([clock milliseconds] - $Since) / 1e3}]
        }
        set limit [dict get $Clock limit]
        set w .top.$side
        set width [winfo reqwidth $w]
        set height [winfo reqheight $w]
        $w delete all
        set fore [ttk::style lookup TLabel -foreground]
        $w create rectangle 1 1 [expr {$width - 2}] [expr {$height - 2}] -outline [expr {$Side eq $side ? [sorma::style colour mine] : "#909090"}] \
            -width [sorma::style pixels [expr {$Side eq $side ? 3 : 1}]]
        set r [expr {$height * 0.28}]
        $w create oval [expr {$height / 2 - $r}] [expr {$height / 2 - $r}] [expr {$height / 2 + $r}] [expr {$height / 2 + $r}] -fill $face -outline $edge -width [sorma::style pixels 2]
        $w create text $height [expr {$height / 2}] -anchor w -fill $fore -text "[string totitle $side]\n[expr {$Robot eq $side ? "robot" : "person"}]"
        $w create text [expr {$width - $height * 0.2}] [expr {$height / 2}] -anchor e -font [Large] -text [Minutes [expr {$limit > 0 ? max(0, $limit - $seconds) : $seconds}]] \
            -fill [expr {$limit > 0 && $limit - $seconds < 30 ? [sorma::style colour alarm] : $fore}]
    }
}
proc checkers::window::Minutes seconds {
    set seconds [expr {int($seconds)}]
    return [format %d:%02d [expr {$seconds / 60}] [expr {$seconds % 60}]]
}

proc checkers::window::plot told {
    variable State
    variable Side
    variable Clock
    variable Since
    variable Thoughts
    variable Last
    variable Robot
    variable Width
    if {![winfo exists .moves]} return
    set Last $told
    set State [dict get $told state]
    set Clock [dict get $told clock]
    set Since [clock milliseconds]
    set Robot [dict get $told robot]
    # The robot's clock stands while it waits for others.
    set Side [expr {$State in {over agreed} || ($State eq "trouble" && [dict get $told side] eq $Robot) ? {} : [dict get $told side]}]
    set width [::checkers::tokens width [dict get $told pdn]]
    if {$width != $Width} {
        set Width $width
        gameBoard resize $width
        eyeBoard resize $width
    }
    switch $State {
        thought { set Thoughts "I think: [Spelled $width [dict get $told move]], [Worth [dict get $told score]], [format %.1f [dict get $told seconds]] s" }
        well { set State [expr {[dict get $told side] eq $Robot ? "verify" : "person"}] }
        carry {
            lassign [dict get $told transfer] file rank - toFile toRank
            if {![Holds -mouse]} {
                gameBoard travel [list $file $rank] [list $toFile $toRank]
            }
        }
    }
    .actions.draw configure -text [expr {$State eq "offer" ? "Accept the draw" : "Offer a draw"}]
    if {$State in {begin carried played} || (![Holds -mouse] && $State in {person validate think answer over}) || $::checkers::window::Lies eq {}} {
        Show [dict get $told lies]
    }
    if {$State in {validate answer}} {
        gameBoard mark [lmap square [lrange [split [dict get $told move] -x] 0 1] {::checkers::tokens place $width $square}]
    } elseif {$State eq "begin"} {
        gameBoard mark {}
    }
    Moves [dict get $told pdn]
    Clocks
}
proc checkers::window::Show lies {
    variable Lies
    variable Shows
    incr Shows
    set lies [lsort -stride 2 $lies]
    if {$lies ne $Lies} {
        set Lies $lies
        gameBoard become $lies
    }
}
proc checkers::window::Worth score {
    return [expr {$score > 100 ? "and win" : $score < -100 ? "and lose" : [format "%+.1f men" $score]}]
}
# A move as people say it.
proc checkers::window::Spelled {width move} {
    regexp {^(\d+)([-x])(\d+)} $move - from sign to
    return [join [lmap square [list $from $to] {
        lassign [::checkers::tokens place $width $square] file rank
        string cat [string index abcdefghij [expr {$file - 1}]] $rank
    }] $sign]
}
# A line for each move of White, and the answer.
proc checkers::window::Moves pdn {
    set moves [lindex [split [string map [list \n\n \x01] $pdn] \x01] 1]
    set text [string trim [regsub -all {\s*(\d+\.(?:\.\.)?)\s+} [string map {\n { }} $moves] "\n\\1\t"]]
    .moves.text configure -state normal
    .moves.text delete 1.0 end
    .moves.text insert end [string trimright $text "* "]
    .moves.text see end
    .moves.text configure -state disabled
}
proc checkers::window::Said event {
    if {[dict get $event event] eq "said" && [winfo exists .said]} {
        Write .said "[dict get $event text]\n" [if {[dict get $event words] in {trouble mute}} {string cat wrong}]
    }
}
proc checkers::window::Write {w text {tag {}}} {
    $w configure -state normal
    $w insert end $text $tag
    $w see end
    $w configure -state disabled
}
proc checkers::window::Seen event {
    variable Width
    if {[dict get $event event] ne "seen" || ![winfo exists .eye.board]} return
    set seen [dict get $event text]
    if {[string length $seen] == $Width * $Width} {
        eyeBoard certain [dict get $event floats]
        eyeBoard lie [::checkers::repair seen $Width $seen {}]
    }
}

# ---- a person with mouse or keys: his hand moves the token ----

# He looks at the table, unless his hand is there. While it is not seen the board shows what was seen last, and the head says so.
proc checkers::window::Look {} {
    variable Hand
    variable Looking
    variable Blind
    if {![Holds -mouse]} {
        set Blind {}
    } elseif {$Hand == 0 && !$Looking} {
        set Looking 1
        sorma::async -timeout 2000 -command [list checkers::window::Looked $::checkers::window::Shows] simlab@lab exec tokens
    }
}
proc checkers::window::Looked {asked future} {
    variable Shows
    variable Width
    variable Looking 0
    variable Blind
    set Blind [expr {[catch {::checkers::tokens seen [$future take]} tokens] ? $tokens : {}}]
    if {$Blind eq {} && $Shows == $asked && [winfo exists .game.board]} {
        set lies {}
        foreach token $tokens {
            lassign $token name file rank - - z
            set place [list $file $rank]
            if {abs($file - round($file)) < 0.3 && abs($rank - round($rank)) < 0.3 && $file > 0.5 && $file < $Width + 0.5} {
                set place [list [expr {round($file)}] [expr {round($rank)}]]
            } elseif {abs($file + 0.4) < 0.3 || abs($file - $Width - 1.4) < 0.3} {
                set place [list [expr {$file < 0 ? -0.4 : $Width + 1.4}] [expr {round($rank)}]]
            }
            if {$file > -1 && $file < $Width + 2 && $rank > 0.3 && $rank < $Width + 0.7} {
                dict lappend lies $place [lindex [split $name _] 0]
            }
        }
        Show $lies
    }
}
# Where a token that is lifted may go.
proc checkers::window::Goals from {
    variable Last
    variable Width
    set state [expr {[dict exists $Last state] ? [dict get $Last side] : {}}]
    if {$state in [list {} $::checkers::window::Robot] || [catch {package require sorma::service::draughts}]} return
    try {
        draughts.window configure -variant [Holds -variant]
        draughts.window exec fen [dict get $Last position]
        set goals {}
        foreach move [dict get [draughts.window exec legal] text] {
            lassign [split $move -x] origin target
            if {[::checkers::tokens place $Width $origin] eq $from} {
                lappend goals [::checkers::tokens place $Width $target]
            }
        }
        return [lsort -unique $goals]
    } on error {} {
        return
    }
}
proc checkers::window::Drop {from to} {
    variable Lies
    variable Width
    variable Hand
    if {![Holds -mouse]} {
        Complain "The simulated person plays. Choose \"I play\" and begin a new game to play yourself."
        return
    }
    set stack [dict get $Lies $from]
    set colour [lindex $stack 0]
    lassign $to file rank
    # Off the board is to the heap.
    if {$file < 1 || $file > $Width || $rank < 1 || $rank > $Width} {
        if {[catch {::checkers::tokens heap $Width $Lies $colour [llength $stack]} to]} {
            Complain $to
            return
        }
        set to [lrange $to 0 1]
    }
    set there [expr {[dict exists $Lies $to] ? [dict get $Lies $to] : {}}]
    # From a heap one token is taken; on a field lie two of a colour at most.
    set under [expr {[OnBoard $from] ? 0 : [llength $stack] - 1}]
    if {[OnBoard $to] && $there ne {} && ([lindex $there 0] ne $colour || [llength $there] + [llength $stack] - $under > 2)} {
        Complain "There is no room: take away what lies there first."
        return
    }
    set transfer [list {*}$from $under {*}$to [llength $there]]
    set Lies [lsort -stride 2 [::checkers::tokens after $Lies $transfer]]
    gameBoard lie $Lies
    incr Hand
    incr ::checkers::window::Shows
    sorma::async -timeout 0 -command checkers::window::Put humanhand@human EXEC FMSG 6 {*}$transfer
}
proc checkers::window::OnBoard place {
    variable Width
    return [expr {[lindex $place 0] >= 0.5 && [lindex $place 0] < $Width + 0.5}]
}
proc checkers::window::Put future {
    incr ::checkers::window::Hand -1
    Answered humanhand $future
    Look
}
