# game.tcl -- the state of a game: the position, where every token lies, and a file that keeps both after each half-move.
#
# The game keeps what a camera cannot see: from above a queen looks like a man, and tokens of a colour look alike.

package require fileutil
package require sorma
package require checkers::tokens
package provide checkers::game 1.0

oo::class create ::checkers::game {
    variable Draughts File
    variable Lies               ;# place -> colours, as tokens.tcl has it
    variable Before             ;# the same before the last move; empty: it is not known
    variable Intended Step      ;# the move that is being carried out, and how many of its transfers have been done
    variable Robot              ;# the colour that it plays; empty: as it was at the beginning
    variable Clock              ;# dict: white black limit [s]
    variable Ended              ;# a result that is not by the rules; empty: none
    # draughts: name of an object of class draughts; file: to keep the game in, empty: nowhere.
    constructor {draughts file} {
        set Before [set Robot [set Ended {}]]
        set Clock {white 0 black 0 limit 0}
        set Step 0
        set Draughts $draughts
        set File $file
        set Lies {}
        set Intended {}
    }

    # Begin with a position, and what lies beside the board: place -> colours.
    method begin {position {heap {}}} {
        set Robot [set Ended {}]
        set Clock [dict replace $Clock white 0 black 0]
        if {$position eq {}} {
            $Draughts EXEC new
        } else {
            $Draughts exec fen $position
        }
        set Lies [dict merge [::checkers::tokens lie [my width] [my position]] $heap]
        my intend {}
    }

    # Go on where the file says that a game was interrupted. False when there is none.
    method resume {} {
        if {$File eq {} || ![file exists $File]} {
            return 0
        }
        set kept [fileutil::cat -encoding utf-8 $File]
        if {[catch {dict get $kept version} version] || $version ne 1} {
            return -code error -errorcode [list CHECKERS FILE $File] "$File is no game of this program; move it away to begin a new one"
        }
        $Draughts configure -variant [dict get $kept variant]
        $Draughts exec -text [dict get $kept pdn] pdn
        set Lies [dict get $kept lies]
        set Intended [dict get $kept intended]
        set Step [expr {[dict exists $kept step] ? [dict get $kept step] : 0}]
        set Robot [expr {[dict exists $kept robot] ? [dict get $kept robot] : {}}]
        if {[dict exists $kept clock]} {
            set Clock [dict get $kept clock]
        }
        return 1
    }

    # Written beside it and moved there: a crash leaves the game before this half-move, or after it.
    method Keep {} {
        if {$File eq {}} {
            return
        }
        fileutil::writeFile -encoding utf-8 $File.new [dict create version 1 variant [$Draughts cget -variant] pdn [my pdn] lies $Lies intended $Intended step $Step \
            robot $Robot clock $Clock]
        file rename -force $File.new $File
    }

    method forget {} {
        if {$File ne {}} {
            file delete $File
        }
    }

    method draughts {} { return $Draughts }
    method lies {} { return $Lies }
    method width {} { return [expr {[$Draughts cget -variant] eq "intl" ? 10 : 8}] }
    method position {} { return [dict get [$Draughts exec fen] text] }
    # With the result, also when it is not one by the rules of the game.
    method pdn {} {
        set pdn [dict get [$Draughts exec pdn] text]
        if {$Ended ne {}} {
            set pdn [string map [list {[Result "*"]} "\[Result \"$Ended\"\]"] $pdn]
            regsub {\*\s*$} $pdn "$Ended\n" pdn
        }
        return $pdn
    }
    # The game is over: by the rules, by agreement, or because a side is out of time.
    method end result { set Ended $result }
    method state what { return [dict get [dict get [$Draughts exec state] text] $what] }
    method side {} { return [my state side] }
    method over {} { return [expr {[my state result] ne "*"}] }

    # The transfers for a move, and the tokens' places after it, in the form of tokens transfers. Nothing is played.
    method plan move {
        lassign [my Path $move] stops victims crowned
        return [::checkers::tokens transfers [my width] $Lies $stops $victims $crowned]
    }
    method Path move {
        set came [dict get [$Draughts exec path $move] ints]
        set stops [lrange $came 1 [lindex $came 0]]
        set victims [lrange $came [lindex $came 0]+1 end]
        # A man that ends on the last row is crowned.
        set from [::checkers::tokens place [my width] [lindex $stops 0]]
        set to [::checkers::tokens place [my width] [lindex $stops end]]
        set last [expr {[string index [my position] 0] eq "W" ? [my width] : 1}]
        return [list $stops $victims [expr {[lindex $to 1] == $last && [llength [dict get $Lies $from]] == 1}]]
    }

    # Where a piece comes from, and where it goes, as places.
    method origin move { return [::checkers::tokens place [my width] [lindex [my Path $move] 0 0]] }
    method goal move { return [::checkers::tokens place [my width] [lindex [my Path $move] 0 end]] }

    # The tokens' places after a move, when nobody knows the heaps.
    method after move {
        set width [my width]
        $Draughts exec play $move
        set lies [::checkers::tokens lie $width [my position]]
        $Draughts exec undo
        return [dict merge [dict filter $Lies script {place -} {expr {[lindex $place 0] < 1 || [lindex $place 0] > $width}}] $lies]
    }

    # The move that is being carried out: whoever continues the game goes on with it. Empty: none.
    method intend move {
        set Intended $move
        set Step 0
        my Keep
    }
    method intended {} { return $Intended }

    # So many of its transfers have been done; the next one may have been begun.
    method begun step {
        if {$step != $Step} {
            set Step $step
            my Keep
        }
    }
    method step {} { return $Step }

    # The colour that the robot plays in this game; empty: as it was at the beginning.
    method robot {{colour {}}} {
        if {$colour ne {}} {
            set Robot $colour
            my Keep
        }
        return $Robot
    }

    # ---- the clocks: a dict, white and black: how long each side has taken [s]; limit: what each one has, 0: as much as it wants ----

    method clock {} { return $Clock }
    method limit seconds { dict set Clock limit $seconds; my Keep }
    method spend {side seconds} { dict set Clock $side [expr {[dict get $Clock $side] + $seconds}] }
    # The side that is out of time; empty: none.
    method late {} {
        dict with Clock {}
        return [expr {$limit == 0 ? {} : $white >= $limit ? "white" : $black >= $limit ? "black" : {}}]
    }
    # The players change sides, and each keeps his time.
    method exchange {} {
        set Clock [dict replace $Clock white [dict get $Clock black] black [dict get $Clock white]]
        my Keep
    }

    # Tokens lie elsewhere than was believed, but the position is the same.
    method correct lies {
        set Lies $lies
        my Keep
    }

    # Play a move, after which LIES is where the tokens are.
    method play {move lies} {
        set played [dict get [$Draughts exec play $move] text]
        set Before $Lies
        set Lies $lies
        set Intended {}
        set Step 0
        my Keep
        return $played
    }

    # Where the tokens lay before the last move; empty: that is not known.
    method before {} { return $Before }

    # Somebody else plays this game, and says where it stands.
    method follow {pdn lies} {
        if {$lies ne $Lies || $pdn ne [my pdn]} {
            $Draughts exec -text $pdn pdn
            set Lies $lies
            my Keep
        }
    }

    # The last move is taken back.
    method back {} {
        $Draughts exec undo
        set Lies $Before
        set Before {}
        my intend {}
    }

    # The camera's view of tokens at these places: a character for each field, Black's row first.
    method sight lies {
        set width [my width]
        set rows {}
        for {set rank $width} {$rank >= 1} {incr rank -1} {
            for {set file 1} {$file <= $width} {incr file} {
                set place [list $file $rank]
                append rows [expr {[dict exists $lies $place] ? [string index [lindex [dict get $lies $place] end] 0] : "."}]
            }
        }
        return $rows
    }
}
