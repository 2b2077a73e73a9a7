# clock.tcl -- how long each side has thought and moved. The game keeps the times and their limit (game.tcl); the player counts them here.

package provide checkers::clock 1.0

# The part that all players share.
oo::class create ::checkers::clock {
    variable Game Trouble       ;# of the player
    variable Ticked     ;# [s] the time up to here has been counted; empty: the clock has not begun to run

    # The time since the last call belongs to the side whose turn it is. While the robot waits in its own turn for a board that
    # is in disorder, the clock stands.
    method Tick {} {
        set now [expr {[clock milliseconds] / 1e3}]
        if {[info exists Ticked] && $Ticked ne {} && ($Trouble eq {} || [$Game side] ne [my Setting -robot])} {
            $Game spend [$Game side] [expr {max(0, $now - $Ticked)}]
        }
        set Ticked $now
    }
    # For a new game.
    method Unclock {} { set Ticked {} }

    # A side without time has lost.
    method Late {} {
        my Tick
        if {[$Game late] ne {}} {
            throw {CHECKERS ORDER time} "[$Game late] is out of time"
        }
    }
}
