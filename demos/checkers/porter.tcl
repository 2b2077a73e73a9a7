# porter.tcl -- porter: has tokens carried, and makes arm and hand usable again when something went wrong.
#
#     porter EXEC FMSG 6 3 3 0 4 4 0 IMSG 1 1 TMSG red
#     porter EXEC height FMSG 2 3 3               -> FMSG 1 2: two tokens lie there, as the hand feels
#     porter EXEC finish FMSG 6 3 3 0 4 4 0       what the hand still holds goes to where it should have gone

package require sorma

oo::class create ::sorma::service::porter {
    superclass sorma::Service
    sorma::purpose "has tokens carried by arm and hand, and makes both usable again after a fault"
    sorma::option -carry service -default carry -help "carries (class carry)"
    sorma::option -arm service -default pino -help "has the power (class pino)"
    sorma::option -hand service -default manus -help "holds (class manus)"
    sorma::option -transform service -default transform -help "knows where things are (class transform)"
    sorma::option -approach service -default mvpos.approach -help "moves the tool down, to the first contact"
    sorma::option -mover service -default mvpos.transfer -help "moves the tool freely"
    sorma::option -fields int -range {4 26} -default 8 -help "files of the board: beyond them is the heap, where a token need not lie exactly"
    sorma::option -place double -unit m -range {0 0.1} -default 0.0061 -help "height of the tool above what a token is put on"
    sorma::option -feel service -default mvpos.feel -help "moves it down to a gentle contact: how high tokens reach"
    sorma::option -pose service -default shmem_r.tool -help "answers where the tool is: floats lab time, position, quaternion"
    sorma::option -touch vector -unit m -length 3 -default {0.007 0.0023 0.0074} -help "how the hand feels, as measured: the tips' distance from its\
        axis; height of the tool above what they touch; how much higher each token is, since tokens give way a little"
    sorma::words "?height|finish?"
    sorma::reads floats 2..6 "" "from: file, rank, tokens underneath; to: the same. height: file, rank"
    sorma::reads ints 0..1 "" "how many tokens are carried together, default 1"
    sorma::reads text * "" "their colour, default: any"
    sorma::writes floats 1..3 "" "as carry; height: how many tokens lie there, and how high they reach \[m\]; finish: did the hand hold anything?"
    sorma::example "porter CTRL -help"

    variable Ready      ;# arm and hand can be used, as far as is known

    method born {} {
        set Ready 0
    }
    method exec message {
        set transfer [dict get $message floats]
        switch [dict get $message words] {
            height { return [dict create floats [my Height {*}$transfer]] }
            finish {
                set Ready 0
                return [dict create floats [my Recover $transfer]]
            }
        }
        set stack [expr {[dict get $message ints] eq {} ? 1 : [dict get $message ints]}]
        set colour [expr {[dict get $message text] eq {} ? "any" : [dict get $message text]}]
        if {!$Ready} {
            my Recover $transfer
        }
        my Learn $transfer $stack $colour
        set beside [expr {[lindex $transfer 3] < 0.5 || [lindex $transfer 3] > [my cget -fields] + 0.5}]
        [my cget -carry] CTRL -stack $stack -colour $colour -verify [expr {$beside ? "none" : "look"}]
        set Ready 0
        set came [[my cget -carry] exec -floats $transfer]
        set Ready 1
        return [dict create floats [dict get $came floats]]
    }

    # Power; an open hand; whoever has touched the arm has been told. The token in the hand goes to its goal. Did it hold
    # anything?
    method Recover transfer {
        [my cget -arm] EXEC power on
        [my cget -arm] EXEC reset
        set held [my Holds]
        if {$held} {
            sorma::warn {PORTER HELD} "[my name]: the hand still held a token; it is put to [lrange $transfer 3 4]"
            my PutDown [lrange $transfer 3 5]
        }
        [my cget -hand] EXEC release
        [my cget -carry] CTRL -released
        if {$held} {
            my Rise
        }
        set Ready 1
        return $held
    }
    # All fingertips feel something. The carrier may have been restarted; then it does not know it.
    method Holds {} {
        return [expr {[tcl::mathfunc::min {*}[lrange [dict get [[my cget -hand] exec status] floats] 0 2]] > 0.2}]
    }
    method PutDown place {
        lassign [my Over {*}$place 0.1] pose z
        my Lower -approach $pose [expr {$z + [my cget -place]}]
    }

    # How many tokens lie at a place: the fingertips come together and go down to the first contact.
    method Height {file rank} {
        set hand [my cget -hand]
        lassign [my cget -touch] distance tips token
        if {!$Ready} {
            [my cget -arm] EXEC power on
            [my cget -arm] EXEC reset
        }
        if {[my Holds]} {
            sorma::fail [list PORTER HOLDS] "[my name]: the hand holds something, and cannot feel: say EXEC finish"
        }
        lassign [my Over $file $rank 0 0.07] pose z
        $hand exec -floats $distance tripod
        try {
            my Lower -feel $pose [expr {$z + $tips}]
            set height [lindex [dict get [[my cget -pose] exec] floats] 3]
        } finally {
            my Rise
            $hand EXEC release
        }
        set height [expr {$height - $z - $tips}]
        return [list [expr {max(0, round($height / $token))}] $height]
    }

    # The arm goes above a place, so high above what lies underneath: its pose, tool down, and the height of what lies underneath.
    method Over {file rank above height} {
        my LearnBoard
        lassign [dict get [[my cget -transform] exec -floats [list $file $rank $above] boardToWorld] floats] x y z yaw
        set pose [list $x $y [expr {$z + $height}] 0 [expr {cos($yaw / 2)}] [expr {sin($yaw / 2)}] 0]
        my Rise
        my Move -mover 0.4 $pose
        return [list $pose $z]
    }
    # On its way it hits nothing.
    method Rise {} {
        set here [lrange [dict get [[my cget -pose] exec] floats] 1 7]
        if {[lindex $here 2] < 0.1} {
            my Move -mover 0.4 [lreplace $here 2 2 0.12]
        }
    }
    # Down to a height, slowly, or to the first contact.
    method Lower {mover pose height} {
        try {
            my Move $mover 0.03 [lreplace $pose 2 2 $height]
        } trap {SORMA ROBOT GUARD} {} {}
    }
    method Move {mover speed pose} {
        [my cget $mover] CTRL -speed $speed
        [my cget $mover] exec -floats $pose
    }

    # The service that knows places may have been restarted. Returns whether the grasp is known.
    method LearnBoard {} {
        set transform [my cget -transform]
        lassign [dict get [$transform exec learned] ints] board grasp
        if {!$board} {
            $transform EXEC learnBoard
        }
        return $grasp
    }
    method Learn {transfer stack colour} {
        set transform [my cget -transform]
        if {![my LearnBoard]} {
            lassign $transfer file rank underneath
            if {$colour ne "any"} {
                $transform CTRL -colour $colour
            }
            $transform exec -floats [list $file $rank [expr {$underneath + $stack - 1}]] learnGrasp
        }
    }
}

package provide sorma::service::porter 1.0
