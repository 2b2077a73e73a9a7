# boardsight.tcl -- boardsight: the camera goes above the board, and what stands there is read; if need be, where the board lies is learned anew.
#
#     boardsight EXEC              -> TMSG ..r.r.y...  FMSG 64 confidences
#     boardsight EXEC board        -> FMSG 1 by how much the board has been moved [mm]

package require sorma
package require sorma::service::transform

oo::class create ::sorma::service::boardsight {
    superclass sorma::Service
    sorma::purpose "moves the camera above the board and says what stands there"
    sorma::option -mover service -default mvpos.survey -help "moves the tool on lines, to a pose in the world (class mvpos)"
    sorma::option -arm service -default pino -help "gets power when it has none (class pino)"
    sorma::option -reader service -default getbrdsit -help "reads the board (class getBrdSit)"
    sorma::option -transform service -default transform -help "knows where things are (class transform)"
    sorma::option -pose service -default shmem_r.tool -help "answers where the tool is: floats lab time, position, quaternion"
    sorma::option -survey vector -unit "m, 1" -length 7 -default {0.5 0 0.52 0 1 0 0} -help "pose of the tool from where the whole board is seen"
    sorma::option -safe double -unit m -range {0 1} -default 0.1 -help "lower than that the tool goes up before it goes aside"
    sorma::option -near double -unit m -range {0.0001 0.1} -default 0.003 -help "so near to -survey it need not go"
    sorma::option -rest double -unit s -range {0 10} -default 0.1 -help "of the arm before it looks, in lab time"
    sorma::words "?board?"
    sorma::writes text * "" "a character for each field: . nothing, r red, y yellow, ? not certain; the last rank first"
    sorma::writes floats 1.. "" "how certain each one is, 0 to 1; board: by how much it has been moved \[mm\]"
    sorma::example "boardsight EXEC"

    method exec message {
        try {
            my Go
        } trap {SORMA ROBOT OVERLOAD} {text how} {
            # The caller tells it before the arm moves again.
            [my cget -arm] exec reset
            return -options $how $text
        } trap {SORMA SHMEM} {} - trap {SORMA ROBOT} {} {
            [my cget -arm] exec power on
            my Go
        }
        if {[dict get $message words] eq "board"} {
            set known [lindex [dict get [[my cget -transform] exec learned] ints] 0]
            set moved [lindex [dict get [[my cget -transform] exec learnBoard] floats] 3]
            return [dict create floats [expr {$known ? 1e3 * $moved : 0}]]
        }
        try {
            ::sorma::service::transform::fresh {} [my cget -pose] [my cget -rest] 3
        } trap {SORMA VISION PICTURE} {} {
            [my cget -arm] exec power on
        }
        set seen [[my cget -reader] exec]
        my publish seen -text [dict get $seen text] -floats [dict get $seen floats]
        return [dict create text [dict get $seen text] floats [dict get $seen floats]]
    }
    # The arm goes above the board, unless it is there.
    method Go {} {
        # The process that looked before may have been killed: its motion goes on, and ends soon.
        for {set try 1} 1 {incr try} {
            try {
                return [my Leave]
            } trap {SORMA ROBOT BUSY} {text how} {
                if {$try > 300} {
                    return -options $how $text
                }
                sorma::await sleep 100
            }
        }
    }
    method Leave {} {
        set survey [my cget -survey]
        set here [lrange [dict get [[my cget -pose] exec] floats] 1 7]
        lassign $here x y z
        lassign $survey u v w
        set away [expr {sqrt(($x - $u) ** 2 + ($y - $v) ** 2 + ($z - $w) ** 2)}]
        if {$away <= [my cget -near]} {
            return
        }
        set way $survey
        if {[lindex $here 2] < [my cget -safe]} {
            set way [concat [lreplace $here 2 2 [my cget -safe]] $survey]
        }
        [my cget -mover] exec -floats $way via
    }
}

package provide sorma::service::boardsight 1.0
