# window.tcl -- the tracker in a window: the camera's view, errors of the arm, its inputs, and buttons that disturb it.
#
#     ./bootstrap run tracker -window
#
# While a daemon does not answer, the top says which and why; what shows it comes back with it. An arm whose daemon is new moves only when
# somebody says so.
#
# Escape stops following, F12 is the emergency stop; arrow keys, Prior and Next are a hand that pushes, except where one types. Alt and the
# letter that is underlined press a button.
#
# Nothing in it waits. It plots the robot's own knowledge: the ball as sight sees it, read from the buffers of this machine.

package require Tk
package require sorma::panel
package require sorma::chart
package require sorma::image
package require sorma::notice
package require sorma::theme
package require sorma::trailview
source [file join [file dirname [file normalize [info script]]] view.tcl]

namespace eval ::tracker::window {
    variable Said {}                    ;# what the last button has said
    variable Hand {0 0 0}               ;# where keys and mouse push
    variable Inputs {sight {ball seen} force {hand pushed} hand {controller moved}}
    variable Expecting 0                ;# somebody is asked where the ball is by now
    variable Nominal {0 0 0.3} Reach {0.1 0.1 0.08}     ;# of the learned map: sight.ball in tracker.dict
    variable Begin [clock milliseconds]
    variable Boot {}                    ;# which process the robot's daemon is
}
foreach {name key} {rel target.rel pose tool.pose force tool.force target tool.target} {
    sorma::so::dict CTRL -add shmem_r.window.$name [list -key tracker.$key]
}

proc ::tracker::window::send {name args} {
    sorma::async -timeout 0 -command ::tracker::window::Answered $name {*}$args
}
proc ::tracker::window::Answered future {
    variable Said
    catch {$future take} Said
    set Said [string map {\n { }} $Said]
}

# ---- what is known, ten times a second ----

proc ::tracker::window::Tick {} {
    variable Last
    if {![winfo exists .charts]} {
        return
    }
    after 100 ::tracker::window::Tick
    set now [expr {([clock milliseconds] - $::tracker::window::Begin) / 1000.0}]
    set seen 0
    catch {
        lassign [dict get [shmem_r.window.rel exec] floats] time x y z - code
        set pose [dict get [shmem_r.window.pose exec] floats]
        set age [expr {[lindex $pose 0] - $time}]
        set seen [expr {$code == 0 && $age < 0.5}]
        .charts.age sample age [expr {1e3 * $age}] $now
        if {$seen} {
            .charts.error sample error [expr {1e3 * sqrt($x * $x + $y * $y + ($z - 0.3) ** 2)}] $now
        }
        if {[info exists Last] && [lindex $pose 0] > [lindex $Last 0]} {
            set way [::tcl::mathop::+ {*}[lmap a [lrange $Last 1 3] b [lrange $pose 1 3] {expr {($b - $a) ** 2}}]]
            .charts.speed sample speed [expr {1e3 * sqrt($way) / ([lindex $pose 0] - [lindex $Last 0])}] $now
        }
        set Last $pose
        lassign $pose - px py pz
        # The tool points down.
        ::tracker::view::show [list $px $py $pz] [if {$seen} {list [expr {$px + $x}] [expr {$py - $y}] [expr {$pz - $z}]}]
        Expect $pose
    }
    set pushed 0
    catch {
        lassign [dict get [shmem_r.window.force exec] floats] - x y z
        set force [expr {sqrt($x * $x + $y * $y + $z * $z)}]
        set pushed [expr {$force > 2}]
        .charts.force sample force $force $now
    }
    Lamp sight [expr {$seen ? "good" : "alarm"}]
    Lamp force [expr {$pushed ? "good" : "gone"}]
    Lamp hand [expr {$::tracker::window::Hand ne {0 0 0} ? "good" : "gone"}]
    # A hand that goes on pushing says so again and again.
    if {$::tracker::window::Hand ne {0 0 0}} {
        send spacemouse.hand@robot EXEC FMSG 6 {*}$::tracker::window::Hand 0 0 0
    }
}
# A cross in the picture where the ball is expected by now: as track predicts it, and as the learned map sees that.
proc ::tracker::window::Expect pose {
    variable Expecting
    # It is predicted by the circuit: where that does not run, nobody knows.
    if {$Expecting || [clock microseconds] - [lindex [dict get [shmem_r.window.target exec] ints] 2] > 500000} {
        return
    }
    set Expecting 1
    sorma::async -timeout 2000 -command [list ::tracker::window::Predicted $pose] track.ball@robot exec -floats [lindex $pose 0] predict
}
proc ::tracker::window::Predicted {pose future} {
    variable Nominal
    variable Reach
    try {
        lassign [dict get [$future take] floats] bx - - by - - bz
        lassign $pose - x y z
        # The tool points down.
        set places [lmap rel [list [expr {$bx - $x}] [expr {$y - $by}] [expr {$z - $bz}]] nominal $Nominal reach $Reach {expr {($rel - $nominal) / $reach}}]
        sorma::async -timeout 2000 -command ::tracker::window::Projected psom.ball@sight exec -floats $places evaluate
    } on error {} {
        Unexpected
    }
}
proc ::tracker::window::Projected future {
    variable Expecting
    try {
        lassign [lrange [dict get [$future take] floats] 3 4] u v
        if {[winfo exists .camera]} {
            .camera point expected $u $v -colour #ffd000
        }
        set Expecting 0
    } on error {} {
        Unexpected
    }
}
proc ::tracker::window::Unexpected {} {
    if {[winfo exists .camera]} {
        .camera unmark expected
    }
    after 1000 {set ::tracker::window::Expecting 0}
}
proc ::tracker::window::Lamp {input state} {
    variable Inputs
    .inputs.l$input configure -text "[sorma::style::mark $state] [dict get $Inputs $input]" -foreground [sorma::style::colour $state]
}

# The robot's daemon may be another process than before: then it has forgotten that it followed.
proc ::tracker::window::Robot {event key told} {
    variable Boot
    if {$key ne "robot" || [dict get $told boot] in [list {} $Boot]} return
    if {$Boot ne {}} {
        .notice say stale "The robot's daemon is new since [clock format [clock seconds] -format %T], and the arm stands still: \"Reset, power on\", then \"Follow\"."
    }
    set Boot [dict get $told boot]
}

# ---- the stand-in of a hand controller: arrow keys, Prior and Next ----

proc ::tracker::window::Push {key way} {
    bind . <KeyPress-$key> [list ::tracker::window::Pushed %W $way]
    bind . <KeyRelease-$key> {set ::tracker::window::Hand {0 0 0}}
}

# Where one types the keys are for that.
proc ::tracker::window::Pushed {focus way} {
    if {[winfo class $focus] ni {TEntry Entry TSpinbox TCombobox Treeview}} {
        set ::tracker::window::Hand $way
    }
}

# ---- the window ----

# The letter that Alt presses it with.
proc ::tracker::window::Letter {button index} {
    $button configure -underline $index
    bind . <Alt-Key-[string tolower [string index [$button cget -text] $index]]> [list $button invoke]
}

# Camera, places and charts, as large as the window leaves room.
proc ::tracker::window::Views {} {
    set gap [sorma::style pixels 8]
    foreach {w text} {seen "What the camera sees" places "Where ball and tool are" charts "How well it follows"} {
        ttk::labelframe .$w -style Page.TLabelframe -text $text -padding $gap
    }
    sorma::image .camera -name findball.argus@argus -request {EXEC debug} -every 200 -brief 1 -zoom fit -width 400 -height 220
    pack .camera -in .seen -fill both -expand 1
    pack [::tracker::view::build .places.view] -fill both -expand 1
    # A chart for each unit.
    foreach {name text unit} {error error mm speed speed mm/s force force N age "age of what is seen" ms} {
        pack [sorma::stripchart .charts.$name -span 20 -low 0 -width 340 -height 96] -fill both -expand 1
        .charts.$name trace $name -text $text -unit $unit
    }
}
# Emergency stop, what begins and ends following, and power.
proc ::tracker::window::Run {} {
    set gap [sorma::style pixels 8]
    ttk::labelframe .run -style Page.TLabelframe -padding $gap
    button .run.stop -text "EMERGENCY STOP (F12)" -background #c03028 -activebackground #e04038 -foreground white -activeforeground white \
        -font TkHeadingFont -relief flat -borderwidth 0 -highlightbackground #c03028 -pady [sorma::style pixels 10] -command {::tracker::window::send simlab@lab CTRL -emergencyStop} -takefocus 1
    grid .run.stop -columnspan 2 -sticky ew
    sorma::button .run.follow -name follow.ball@robot -request EXEC -text Follow
    ttk::button .run.halt -text Stop -command {::tracker::window::send follow.ball@robot CTRL -stop}
    sorma::button .run.learn -name sight.ball@sight -request {EXEC learn} -text Learn
    ttk::button .run.power -text "Reset, power on" -command ::tracker::window::Power
    grid .run.follow .run.halt -sticky ew -pady [list $gap 0]
    grid .run.learn .run.power -sticky ew -pady [list [expr {$gap / 2}] 0]
    grid columnconfigure .run {0 1} -weight 1 -uniform half
}
# The inputs of the arm: a lamp and the weight of each, and how fast it may be.
proc ::tracker::window::Inputs {} {
    set gap [sorma::style pixels 8]
    ttk::labelframe .inputs -style Page.TLabelframe -padding $gap -text "What moves the arm (hand: arrow keys)"
    foreach {input name option} {sight track.ball@robot -index force squash.force@robot -gain hand squash.hand@robot -gain} {
        grid [ttk::label .inputs.l$input] [ttk::label .inputs.n$input -text $option] [sorma::entry .inputs.g$input -name $name -option $option] \
            -sticky ew -padx $gap -pady 2
        Lamp $input gone
    }
    grid [ttk::label .inputs.lspeed -text "at most"] [ttk::label .inputs.nspeed -text -speed] [sorma::entry .inputs.speed -name follow.ball@robot -option -speed] -sticky ew -padx $gap -pady 2
    grid columnconfigure .inputs 2 -weight 1
    grid [ttk::frame .inputs.presets] -columnspan 3 -sticky ew
    grid [ttk::button .inputs.presets.pursuit -text Pursuit -command {::tracker::window::send track.ball@robot CTRL -index 0.3}] \
        [ttk::button .inputs.presets.saccade -text Saccade -command {::tracker::window::send track.ball@robot CTRL -index 1}] -sticky ew -padx 2 -pady 2
    grid columnconfigure .inputs.presets {0 1} -weight 1 -uniform half
}
# What disturbs it.
proc ::tracker::window::Tease {} {
    set gap [sorma::style pixels 8]
    ttk::labelframe .tease -style Page.TLabelframe -padding $gap -text "Tease it"
    set n 0
    foreach {text request} {
        "At rest" {-ball still 0.56 0 0.12}        "Swing" {-ball sine 0.56 0 0.12 0 0.1 0 0.4}
        "Jump" {-ball still 0.56 0.09 0.12}        "Jump back" {-ball still 0.56 0 0.12}
        "Circle" {-ball circle 0.56 0 0.12 0.08 4} "Jerk" {-ball jerk 0.56 -0.08 0.12 0.56 0.08 0.12 1.5}
        "Hide" {-lamp 0}                           "Show" {-lamp 1 -secondBall away}
        "A second one" {-secondBall 0.6 0.08 0.12} "Push the hand" {-push 0 15 0 1}
    } {
        grid [ttk::button .tease.b$n -text $text -command [list ::tracker::window::send simlab@lab CTRL {*}$request]] -row [expr {$n / 2}] -column [expr {$n % 2}] \
            -sticky ew -padx 2 -pady 2
        incr n
    }
    grid columnconfigure .tease {0 1} -weight 1 -uniform half
}
proc ::tracker::window::Letters {} {
    foreach {button index} {
        .run.halt 0 .run.power 0 .inputs.presets.pursuit 1 .inputs.presets.saccade 5
        .tease.b0 0 .tease.b1 1 .tease.b2 0 .tease.b3 5 .tease.b4 0 .tease.b5 1 .tease.b6 0 .tease.b7 2 .tease.b8 6 .tease.b9 0
    } {
        Letter $button $index
    }
}
proc ::tracker::window::Arrange {} {
    set gap [sorma::style pixels 8]
    set half [expr {$gap / 2}]
    grid .seen -in .f -row 0 -column 0 -sticky nsew -padx $half -pady [list 0 $gap]
    grid .places -in .f -row 1 -column 0 -sticky nsew -padx $half -pady [list 0 $gap]
    grid .charts -in .f -row 0 -column 1 -rowspan 2 -sticky nsew -padx $half -pady [list 0 $gap]
    grid [ttk::frame .side -style Page.TFrame] -in .f -row 0 -column 2 -rowspan 2 -sticky new -padx $half
    raise .camera .seen
    lower .side
    pack .run .inputs .tease -in .side -fill x -pady [list 0 $gap]
    # Answers of requests and news of daemons share the last line.
    grid .said -in .f -row 3 -column 0 -sticky w -padx $half
    grid .notice -in .f -row 3 -column 1 -columnspan 2 -sticky ew -padx $half
    raise .notice .f
    grid .trail -in .f -row 2 -column 0 -columnspan 3 -sticky nsew -padx [list $half 0]
    grid columnconfigure .f {0 1} -weight 1
    grid rowconfigure .f {0 1} -weight 1
}
proc ::tracker::window::Keys {} {
    foreach {key way} {Up {150 0 0} Down {-150 0 0} Left {0 150 0} Right {0 -150 0} Prior {0 0 150} Next {0 0 -150}} {
        Push $key $way
    }
    bind . <Escape> {::tracker::window::send follow.ball@robot CTRL -stop}
    bind . <F12> {.run.stop invoke}
}
proc ::tracker::window::Size {} {
    update idletasks
    wm geometry . [expr {min(max([winfo reqwidth .], [sorma::style pixels 1280]), [winfo screenwidth .])}]x[expr {min(max([winfo reqheight .],
        [sorma::style pixels 800]), [winfo screenheight .])}]
    # Buttons and settings are always there; pictures and messages may be smaller.
    wm minsize . [expr {[winfo reqwidth .run] + [winfo reqwidth .tease]}] \
        [expr {[winfo reqheight .side] + [winfo reqheight .trail] + [winfo reqheight .said] + [winfo reqheight .notice]}]
}

proc ::tracker::window::build {} {
    wm title . "The tracker"
    sorma::theme program
    set gap [sorma::style pixels 8]
    sorma::notice .notice -lines 1 -daemons {lab robot argus sight} -style Page.TFrame
    .notice.text configure -style Page.TLabel
    pack [ttk::frame .f -style Page.TFrame -padding [list [expr {$gap / 2}] $gap]] -fill both -expand 1
    Views
    sorma::trailview .trail -height 3 -style Page.TFrame
    Run
    Inputs
    Tease
    Letters
    ttk::label .said -style Page.TLabel -textvariable ::tracker::window::Said -wraplength [sorma::style pixels 900]
    Arrange
    Keys
    Tick
    sorma::world watch robot -events daemon.* -command ::tracker::window::Robot
    Size
}
proc ::tracker::window::Power {} {
    send simlab@lab CTRL -reset
    send pino@robot EXEC power on
    .notice say live {}
}
