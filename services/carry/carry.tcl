# carry -- takes a token from one field of the board and puts it on another one, by sight and touch (report 1996, figure 2.4).
#
#     carry EXEC FMSG 6 3 4 0 4 5 0           from file 3, rank 4, nothing underneath, to file 4, rank 5
#
# Each step is a method of its own, and asks others by the names in the recipe: for moving arm and hand, for seeing, for places.
# A step that fails says what was measured. Then the arm rises to where it hits nothing, and what may be
# tried again is tried again. When the caller cancels, the arm stops where it is, and the hand keeps holding.

package require sorma
package require sorma::service::transform

namespace eval ::sorma::service::carry {
    variable Active {}          ;# the object that carries: there is one arm, and one hand, in a process
}
oo::class create ::sorma::service::carry {
    superclass sorma::Service

    sorma::purpose "carries a token from one field of the board to another one, by sight and touch"
    sorma::option -transferSpeed double -group Motion -unit m/s -range {0.01 1.5} -default 0.5 -help "of the tool on its way to a token, and with it"
    sorma::option -approachSpeed double -group Motion -unit m/s -range {0.002 0.1} -default 0.03 -help "of the tool where something may be touched"
    sorma::option -slowZone double -group Motion -unit m -range {0.002 0.1} -default 0.012 -help "how far above its goal it becomes that slow"
    sorma::option -lift double -group Motion -unit m -range {0.02 0.3} -default 0.06 -help "how far a token is lifted"
    sorma::option -arch double -group Motion -unit m -range {0 0.3} -default 0.03 -help "how much higher the middle of its way is"
    sorma::option -lookHeight double -group Heights -unit m -range {0.02 1} -default 0.1 -help "of the tool above a token that is looked at, as transform has learned it"
    sorma::option -graspHeight double -group Heights -unit m -range {0 0.1} -default 0.0058 -help "of the fingertips' middle above what a token stands on"
    sorma::option -placeHeight double -group Heights -unit m -range {0 0.1} -default 0.0061 -help "the same when it is put down"
    sorma::option -token vector -group Token -unit m -length 2 -default {0.015 0.008} -help "radius and height of a token"
    sorma::option -stack int -group Token -range {1 9} -default 1 -help "tokens that are carried together"
    sorma::option -colour enum -group Token -choices {any red yellow} -default any -help "of the token"
    sorma::option -early double -group Checks -unit m -range {0.0005 0.1} -default 0.003 -help "contact so far above the goal is a fault"
    sorma::option -leastForce double -group Checks -unit N -range {0 10} -default 0.2 -help "at each fingertip, while it holds a token"
    sorma::option -lookAgain double -group Checks -unit m -range {0.0005 0.1} -default 0.003 -help "after a larger correction it looks once more"
    sorma::option -shifted double -group Checks -unit m -range {0.001 0.1} -default 0.0045 -help "a token so far from its field, or markers from their places: the board has\
        been moved"
    sorma::option -tolerance double -group Checks -unit m -range {0.0001 0.1} -default 0.003 -help "of the place where the token is seen at the end"
    sorma::option -retries int -group Checks -range {0 9} -default 2 -help "of taking a token"
    sorma::option -relearn flag -group Checks -default 1 -help "look for the board's markers when a token is not where it should be"
    sorma::option -verify enum -group Checks -choices {look board none} -default look -help "how it makes sure that the token lies where it should: one look at\
        it; at the board's markers, too"
    sorma::option -patience double -group Checks -unit s -range {0.1 1000} -default 10 -help "time limit for requests, but for those that move the arm"
    sorma::option -transfer service -group Objects -help "moves the tool freely, on lines to poses in the world (class mvpos)"
    sorma::option -approach service -group Objects -help "the same where something may be touched; its guards say what is contact"
    sorma::option -hand service -group Objects -help "grasps and releases (class manus)"
    sorma::option -tips service -group Objects -help "answers what the hand feels: a record of hand.state; none: nobody watches the token on its way"
    sorma::option -transform service -group Objects -help "knows where things are (class transform)"
    sorma::option -disk service -group Objects -help "sees a token (class getDisk)"
    sorma::option -rest double -group Motion -unit s -range {0 10} -default 0.1 -help "of the arm before it looks: its servos need a moment"
    sorma::option -picture service -group Objects -help "answers a picture, its first float is its time: it must be new; none: the object that sees takes a new one"
    sorma::option -pose service -group Objects -help "answers where the tool is: floats lab time, position, quaternion"
    sorma::option -speaker service -group Objects -help "is told what went wrong (EXEC TMSG); none: nobody"
    sorma::option -laser service -group Objects -help "points at where it went wrong (EXEC point FMSG 3); none: nobody"
    sorma::action -stop {} "stop the arm where it is; the hand keeps what it holds" {my Stop} -danger stop
    sorma::action -released {} "the hand holds nothing any more: somebody has taken it" {set [my varname Holds] 0} -right call
    sorma::inspection -phase {} "what is under way; empty: nothing" {set Phase}
    sorma::danger move
    sorma::reads floats 6 "" "from: file, rank, tokens underneath; to: the same"
    sorma::writes floats 3 "" "how far from the middle of the field the token lies, dx dy \[m\] in the board's axes; seconds of lab time"
    sorma::example "carry EXEC FMSG 6 3 4 0 4 5 0"

    variable Phase      ;# what is under way
    variable Stopped    ;# somebody has said so
    variable Holds      ;# the hand holds a token
    variable Checked    ;# the board's markers have been looked at, in this request
    variable Under      ;# pixel where a token under the tool is seen
    variable Times      ;# of the last request: phase -> seconds of lab time

    method born {} {
        set Phase {}
        set Stopped 0
        set Holds 0
        set Times {}
    }

    method exec message {
        set Phase begin
        my Begin
        sorma::atCancel [namespace code {my Stop}]
        set from [lrange [dict get $message floats] 0 2]
        set to [lrange [dict get $message floats] 3 5]
        try {
            set begun [my LabTime]
            my Pick $from
            set off [my Put $from $to]
            return [dict create floats [concat $off [expr {[my LabTime] - $begun}]]]
        } trap {SORMA CARRY} {text how} {
            if {[lindex [dict get $how -errorcode] 2] ne "STOPPED"} {
                my publish fault -text $text
                my Safe
                my Signal $text $from
            }
            return -options $how $text
        } finally {
            set Phase {}
            set ::sorma::service::carry::Active {}
        }
    }

    method dump {} {
        return [join [concat [list "holds $Holds" "phase $Phase"] [lmap {phase seconds} $Times {format "%s %.2f s" $phase $seconds}]] \n]
    }

    # The conditions before anything moves.
    method Begin {} {
        foreach part {-transfer -approach -hand -transform -disk -pose} {
            if {[my cget $part] eq {}} {
                my Fault PART "$part names nobody: the recipe must" $part
            }
        }
        if {$Holds} {
            my Fault HOLDS "the hand still holds a token: take it, and say \"[my name] CTRL -released\""
        }
        upvar #0 ::sorma::service::carry::Active active
        if {$active ne {}} {
            my Fault BUSY "$active carries" $active
        }
        set active [my name]
        set Stopped 0
        set Checked 0
        set Under {}
        set Times {}
    }

    # ---- taking a token ----

    method Pick place {
        for {set try 0} {1} {incr try} {
            try {
                my Step preshape Preshape $place
                my Step look Look $place
                my Step approach Lower $place [my cget -graspHeight]
                my Step grasp Grasp
                my Step lift Lift
                return
            } trap {SORMA CARRY} {text how} {
                set symbol [lindex [dict get $how -errorcode] 2]
                if {$symbol ni {EARLY EMPTY LOST SHIFTED UNSEEN} || $try >= [my cget -retries]} {
                    return -options $how $text
                }
                sorma::warn [list CARRY AGAIN $symbol] "$text; once more"
                set Holds 0
                my Step again Rise
                if {$symbol in {SHIFTED UNSEEN} && !$Checked} {
                    my Step board CheckBoard
                }
            }
        }
    }

    # The arm goes above the token while the hand opens.
    method Preshape place {
        set opening [my Begun -hand exec release]
        try {
            my Fly [my Over [my Goal $place]]
            $opening wait
        } finally {
            $opening destroy
        }
    }

    # The view from there tells the error of the tool.
    method Look place {
        lassign [my Goal $place] x y
        for {set look 1} {1} {incr look} {
            set correction [my See]
            set pose [my Moved [my Pose] $correction]
            lassign $pose u v
            set off [expr {hypot($u - $x, $v - $y)}]
            if {$off > [my cget -shifted] && [my cget -relearn] && !$Checked} {
                my Fault SHIFTED "the token is [my Millimetres $off] from the middle of its field, more than -shifted [my Millimetres [my cget -shifted]]"
            }
            my Fly $pose
            if {$look == 3 || hypot([lindex $correction 0], [lindex $correction 1]) <= [my cget -lookAgain]} {
                return
            }
        }
    }

    method Grasp {} {
        try {
            set tips [dict get [my Ask -hand exec grasp] floats]
        } trap {SORMA HAND EMPTY} text - trap {SORMA HAND UNEVEN} text {
            my Fault EMPTY $text
        }
        if {[my Least $tips] < [my cget -leastForce]} {
            my Fault EMPTY "the fingertips feel [my Newtons $tips], a token [my cget -leastForce] N at each"
        }
        set Holds 1
    }

    method Lift {} {
        my Fly [my Higher [my Pose] [my cget -lift]]
        my Feel
    }

    # ---- putting it down ----

    # Returns how far from the middle of its field it lies.
    method Put {from to} {
        my Step transfer Transfer $to
        try {
            my Step place Lower $to [my cget -placeHeight]
        } trap {SORMA CARRY EARLY} text {
            # It goes back to where it was.
            my Step back Rise
            my Step back Transfer $from
            my Step back Lower $from [my cget -placeHeight]
            my Step release Release
            my Fault OCCUPIED "$text: the field is occupied; the token is where it was"
        }
        my Step release Release
        my Step deproach Fly [my Over [my Goal $to]]
        set off [my Step verify Verify]
        if {[my cget -verify] eq "board"} {
            set Checked 0
            if {[my Step board CheckBoard] > [my cget -shifted]} {
                my Fault SHIFTED "the board has been moved meanwhile: the token lies where its field was"
            }
        }
        return $off
    }

    # An arch, on which the fingertips are watched.
    method Transfer place {
        set pose [my Pose]
        lassign [my Goal $place] x y z yaw
        set high [expr {max([lindex $pose 2], $z + [my cget -lift])}]
        set end [my Down $x $y [expr {$z + [my cget -lift]}] $yaw]
        set middle [concat [lmap a [lrange $pose 0 1] b [list $x $y] {expr {($a + $b) / 2}}] [expr {$high + [my cget -arch]}] [lrange $end 3 6]]
        my Move -transfer [my cget -transferSpeed] [list $middle $end] 1
        my Feel
    }

    method Release {} {
        my Ask -hand exec release
        set Holds 0
    }

    # Where the token lies in the board's axes, from where it should. The tool stands above that.
    method Verify {} {
        if {[my cget -verify] eq "none"} {
            return {0 0}
        }
        lassign [my See] dx dy
        if {hypot($dx, $dy) > [my cget -tolerance]} {
            my Fault MISPLACED "the token lies [my Millimetres [expr {hypot($dx, $dy)}]] from where it should, -tolerance is\
                [my Millimetres [my cget -tolerance]]"
        }
        return [list $dx [expr {-$dy}]]
    }

    # ---- pieces of several phases ----

    # Down to a height above what the token stands on; slowly at the end, and no farther than to the first contact.
    method Lower {place height} {
        lassign [my Goal $place] - - z
        set pose [my Pose]
        set low [expr {$z + $height}]
        set slow [expr {$low + [my cget -slowZone]}]
        try {
            if {[lindex $pose 2] > $slow} {
                my Move -approach [my cget -transferSpeed] [list [lreplace $pose 2 2 $slow]]
            }
            my Move -approach [my cget -approachSpeed] [list [lreplace $pose 2 2 $low]]
        } trap {SORMA ROBOT GUARD} text {
            set at [lindex [my Pose] 2]
            if {$at - $low > [my cget -early]} {
                my Fault EARLY "contact [my Millimetres [expr {$at - $low}]] above the goal, at [my Millimetres $at]: $text"
            }
        }
    }

    # How far the tool is from above the token, dx dy in its own frame.
    method See {} {
        if {$Under eq {}} {
            set Under [dict get [my Ask -transform exec under] floats]
        }
        ::sorma::service::transform::fresh [my cget -picture] [my cget -pose] [my cget -rest] [my cget -patience]
        set best {0 0 0 0}
        foreach colour [expr {[my cget -colour] eq "any" ? {red yellow} : [my cget -colour]}] {
            try {
                set disk [dict get [my Ask -disk exec -floats $Under -text $colour] floats]
                if {[lindex $disk 3] > [lindex $best 3]} {
                    set best $disk
                }
            } trap {SORMA VISION DISK} text {
                lappend said $text
            }
        }
        if {[lindex $best 3] == 0} {
            my Fault UNSEEN "there is no token: [join $said {; }]"
        }
        try {
            return [dict get [my Ask -transform exec -floats [lrange $best 0 1] correct] floats]
        } trap {SORMA TRANSFORM OUTSIDE} text {
            my Fault UNSEEN $text
        }
    }

    # By how much the board has been moved [m]. Where it lies now is known from then on.
    method CheckBoard {} {
        if {![my cget -relearn]} {
            return 0
        }
        set Checked 1
        set moved [lindex [dict get [my Ask -transform exec learnBoard] floats] 3]
        if {$moved > [my cget -shifted]} {
            sorma::warn {CARRY SHIFTED} "[my name]: the board has been moved by [my Millimetres $moved]"
        }
        return $moved
    }

    method Rise {} {
        set pose [my Pose]
        my Fly [lreplace $pose 2 2 [expr {max([lindex $pose 2], [lindex [my cget -token] 1] + [my cget -lookHeight])}]]
    }

    # The hand still holds its token.
    method Feel {} {
        if {[my cget -tips] eq {}} {
            return
        }
        set tips [lrange [dict get [[my cget -tips] exec] floats] 22 24]
        if {[my Least $tips] < [my cget -leastForce]} {
            set Holds 0
            lassign [my Pose] x y z
            my Fault LOST [format {the token was lost at %.3f %.3f %.3f m: the fingertips feel %s} $x $y $z [my Newtons $tips]]
        }
    }

    # ---- places ----

    method Goal place {
        return [dict get [my Ask -transform exec -floats $place boardToWorld] floats]
    }
    # The tool above the token, from where it is looked at.
    method Over goal {
        lassign $goal x y z yaw
        return [my Down $x $y [expr {$z + [my cget -stack] * [lindex [my cget -token] 1] + [my cget -lookHeight]}] $yaw]
    }
    method Down {x y z yaw} {
        return [list $x $y $z 0 [expr {cos($yaw / 2)}] [expr {sin($yaw / 2)}] 0]
    }
    method Higher {pose by} {
        return [lreplace $pose 2 2 [expr {[lindex $pose 2] + $by}]]
    }
    # A pose of a tool that points down, displaced in its own frame.
    method Moved {pose by} {
        lassign $pose x y - - c s
        lassign [::sorma::service::transform::inWorldAxes {*}$by [expr {2 * atan2($s, $c)}]] dx dy
        return [lreplace $pose 0 1 [expr {$x + $dx}] [expr {$y + $dy}]]
    }
    method Pose {} {
        return [lrange [dict get [[my cget -pose] exec] floats] 1 7]
    }
    method LabTime {} {
        return [lindex [dict get [[my cget -pose] exec] floats] 0]
    }

    # ---- the arm ----

    # Up first, if need be: on its way it hits nothing.
    method Fly pose {
        set here [my Pose]
        set way [list $pose]
        if {[lindex $here 2] < [lindex $pose 2] - 0.005 && hypot([lindex $here 0] - [lindex $pose 0], [lindex $here 1] - [lindex $pose 1]) > 0.01} {
            set way [linsert $way 0 [lreplace $here 2 2 [lindex $pose 2]]]
        }
        my Move -transfer [my cget -transferSpeed] $way
    }
    method Move {mover speed way {watch 0}} {
        [my cget $mover] CTRL -speed $speed
        set motion [my Begun $mover exec -floats [concat {*}$way] via]
        try {
            while {$watch && ![$motion done]} {
                after 20 [info coroutine]
                yield
                my Feel
            }
            $motion wait
        } trap {SORMA CARRY LOST} {text how} {
            # The next motion begins when this one has ended.
            [my cget $mover] CTRL -stop
            catch {$motion wait}
            return -options $how $text
        } finally {
            $motion destroy
        }
    }
    method Stop {} {
        if {$Phase eq {}} {
            return
        }
        set Stopped 1
        foreach mover {-transfer -approach} {
            [my cget $mover] CTRL -stop
        }
    }

    # ---- others ----

    # A request to whom an option names: begun; and its answer. The mover of the arm takes as long as the way.
    method Begun {option args} {
        set patience [expr {$option in {-transfer -approach} ? 0 : int(1e3 * [my cget -patience])}]
        return [sorma::async -timeout $patience [my cget $option] {*}$args]
    }
    method Ask {option args} {
        set request [my Begun $option {*}$args]
        try {
            return [$request wait]
        } finally {
            $request destroy
        }
    }

    # ---- phases and faults ----

    # Run a method as a phase: its times are told, and what fails in it has a name.
    method Step {phase method args} {
        if {$Stopped || [sorma::cancelled]} {
            my Fault STOPPED "stopped before $phase; the arm stays where it is"
        }
        set Phase $phase
        set begun [my LabTime]
        try {
            set result [my $method {*}$args]
        } trap {SORMA CARRY} {text how} {
            return -options $how $text
        } on error {text how} {
            set code [lrange [dict get $how -errorcode] 1 end]
            set symbol [expr {$Stopped || [sorma::cancelled] ? "STOPPED" : "FAILED"}]
            foreach {pattern named} {{COMM *} AWAY {ROBOT STOPPED*} STOPPED {ROBOT *} ARM {HAND *} HAND {VISION *} EYE {TRANSFORM *} PLACE {SHMEM *} SENSOR} {
                if {$symbol eq "FAILED" && [string match $pattern $code]} {
                    set symbol $named
                    break
                }
            }
            my Fault $symbol $text {*}$code
        }
        set ended [my LabTime]
        dict set Times $phase [expr {([dict exists $Times $phase] ? [dict get $Times $phase] : 0) + $ended - $begun}]
        my publish phase -text $phase -floats [list $begun $ended]
        return $result
    }
    method Fault {symbol text args} {
        sorma::fail [list CARRY $symbol $Phase {*}$args] "[my name]: $Phase: $text"
    }
    # After a fault the arm rises to where it hits nothing. The hand keeps what it holds.
    method Safe {} {
        try {
            my Rise
        } on error text {
            sorma::warn {CARRY SAFE} "[my name]: the arm stays where it is: $text"
        }
    }
    method Signal {text place} {
        foreach {option words} {-speaker {list exec -text $text} -laser {list exec -floats [lrange [my Goal $place] 0 2] point}} {
            if {[my cget $option] eq {}} {
                continue
            }
            try {
                my Ask $option {*}[eval $words]
            } on error said {
                sorma::warn {CARRY SIGNAL} "[my name]: $option: $said"
            }
        }
    }

    method Least numbers {
        return [::tcl::mathfunc::min {*}$numbers]
    }
    method Newtons tips {
        return "[join [lmap f $tips {format %.2f $f}]] N"
    }
    method Millimetres m {
        return [format {%.1f mm} [expr {1e3 * $m}]]
    }
}

package provide sorma::service::carry 1.0
