# porter.tcl -- porter: has tokens carried, and makes arm and hand usable again when something went wrong.
#
#     porter EXEC FMSG 6 3 3 0 4 4 0 IMSG 1 1 TMSG red

package require sorma

oo::class create ::sorma::service::porter {
    superclass sorma::Service
    sorma::purpose "has tokens carried by arm and hand, and makes both usable again after a fault"
    sorma::option -carry service -default carry -help "carries (class carry)"
    sorma::option -arm service -default pino -help "has the power (class pino)"
    sorma::option -hand service -default manus -help "holds (class manus)"
    sorma::option -transform service -default transform -help "knows where things are (class transform)"
    sorma::option -approach service -default mvpos.approach -help "moves the tool down, to the first contact"
    sorma::option -fields int -range {4 26} -default 8 -help "files of the board: beyond them is the heap, where a token need not lie exactly"
    sorma::option -place double -unit m -range {0 0.1} -default 0.0061 -help "height of the tool above what a token is put on"
    sorma::reads floats 6 "" "from: file, rank, tokens underneath; to: the same"
    sorma::reads ints 0..1 "" "how many tokens are carried together, default 1"
    sorma::reads text * "" "their colour, default: any"
    sorma::writes floats 3 "" "as carry"
    sorma::example "porter CTRL -help"

    variable Ready      ;# arm and hand can be used, as far as is known

    method born {} {
        set Ready 0
    }
    method exec message {
        set transfer [dict get $message floats]
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

    # Power; an open hand. What it holds goes to where it should have gone.
    method Recover transfer {
        [my cget -arm] EXEC power on
        if {[regexp -line {^# holds 1} [lindex [[my cget -carry] CTRL -dump] 3]]} {
            sorma::warn {PORTER HELD} "[my name]: the hand still held a token; it is put to [lrange $transfer 3 4]"
            my PutDown [lrange $transfer 3 5]
        }
        [my cget -hand] EXEC release
        [my cget -carry] CTRL -released
        set Ready 1
    }
    method PutDown place {
        lassign [dict get [[my cget -transform] exec -floats $place boardToWorld] floats] x y z yaw
        set down [list 0 [expr {cos($yaw / 2)}] [expr {sin($yaw / 2)}] 0]
        set approach [my cget -approach]
        $approach CTRL -speed 0.1
        $approach exec -floats [concat $x $y [expr {$z + 0.1}] $down]
        $approach CTRL -speed 0.03
        catch {$approach exec -floats [concat $x $y [expr {$z + [my cget -place]}] $down]}
    }

    # Whoever knows where things are may have been started anew.
    method Learn {transfer stack colour} {
        set transform [my cget -transform]
        set known [lindex [$transform CTRL -dump] 3]
        if {![string match "*board learned*" $known]} {
            $transform EXEC learnBoard
        }
        if {![string match "*grasp learned*" $known]} {
            lassign $transfer file rank underneath
            if {$colour ne "any"} {
                $transform CTRL -colour $colour
            }
            $transform exec -floats [list $file $rank [expr {$underneath + $stack - 1}]] learnGrasp
        }
    }
}

package provide sorma::service::porter 1.0
