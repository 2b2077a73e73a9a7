# ponder.tcl -- the robot thinks while the person thinks: which move is he going to play, and what shall the answer be?
#
# An engine of its own plays the move that it expects, and searches the answer at the robot's level. If the person plays that move the
# answer is there already; if not the search is stopped. So a weak level stays as weak as it should be.

package require sorma
package provide checkers::ponder 1.0

# The part that all players share. -ponder: the engine; empty: nobody.
oo::class create ::checkers::ponder {
    variable Plan       ;# of this turn: dict of moves (before it), guess, answer (move score seconds); empty: none
    variable Hit        ;# answer to the person's move; empty: it was not foreseen

    # Begin. If it fails in any way, the game goes on without it.
    method Ponder {} {
        set Plan [set Hit {}]
        if {[my Setting -ponder] ne {}} {
            coroutine [self namespace]::Ponders [namespace which my] Pondered
        }
    }
    method Pondered {} {
        set engine [my Setting -ponder]
        catch {
            my Load $engine
            $engine configure {*}[concat {*}[lmap option {-level -seed -time -threads -endgames} {list $option [[my Setting -engine] cget $option]}]] -idle 1
            set guess [dict get [$engine exec go] text]
            set Plan [dict create guess $guess]
            set came [$engine exec go]
            dict set Plan answer [list [dict get $came text] {*}[dict get $came floats]]
            my Note ponder expects $guess answer [dict get $came text]
        }
    }
    # The person has played a move: was it that one? The search ends.
    method Guessed move {
        if {[dict exists $Plan answer] && [dict get $Plan guess] eq $move} {
            set Hit [dict get $Plan answer]
        }
        my Unponder
    }
    method Unponder {} {
        set coroutine [self namespace]::Ponders
        if {[info commands $coroutine] ne {}} {
            catch {[my Setting -ponder] CTRL -stop}
            rename $coroutine {}
        }
        set Plan {}
    }
    # The thought of before; once.
    method Foreseen {} {
        set hit [expr {[info exists Hit] ? $Hit : {}}]
        set Hit {}
        return $hit
    }
}
