# game.tcl -- the state of a game: the position, where every token lies, and a file that keeps both after each half-move.
#
# What a camera cannot know is kept here: a queen looks like a man from above, and tokens of a colour look alike.

package require sorma
package require checkers::tokens
package provide checkers::game 1.0

oo::class create ::checkers::game {
    # draughts: name of an object of class draughts; file: to keep the game in, empty: nowhere.
    constructor {draughts file} {
        my variable Draughts File Lies Intended Before
        set Before {}
        set Draughts $draughts
        set File $file
        set Lies {}
        set Intended {}
    }

    # Begin with a position, and what lies beside the board: place -> colours.
    method begin {position {heap {}}} {
        my variable Draughts Lies
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
        my variable Draughts File Lies Intended
        if {$File eq {} || ![file exists $File]} {
            return 0
        }
        set in [open $File]
        fconfigure $in -encoding utf-8
        try {
            set kept [read $in]
        } finally {
            close $in
        }
        if {[catch {dict get $kept version} version] || $version ne 1} {
            return -code error -errorcode [list CHECKERS FILE $File] "$File is no game of this program; move it away to begin a new one"
        }
        $Draughts configure -variant [dict get $kept variant]
        $Draughts exec -text [dict get $kept pdn] pdn
        set Lies [dict get $kept lies]
        set Intended [dict get $kept intended]
        return 1
    }

    # Written beside it and moved there: a crash leaves the game before this half-move, or after it.
    method Keep {} {
        my variable Draughts File Lies Intended
        if {$File eq {}} {
            return
        }
        set out [open $File.new w]
        fconfigure $out -encoding utf-8
        puts $out [dict create version 1 variant [$Draughts cget -variant] pdn [my pdn] lies $Lies intended $Intended]
        close $out
        file rename -force $File.new $File
    }

    method forget {} {
        my variable File
        if {$File ne {}} {
            file delete $File
        }
    }

    method draughts {} { my variable Draughts; return $Draughts }
    method lies {} { my variable Lies; return $Lies }
    method width {} { my variable Draughts; return [expr {[$Draughts cget -variant] eq "intl" ? 10 : 8}] }
    method position {} { my variable Draughts; return [dict get [$Draughts exec fen] text] }
    method pdn {} { my variable Draughts; return [dict get [$Draughts exec pdn] text] }
    method state what { my variable Draughts; return [dict get [dict get [$Draughts exec state] text] $what] }
    method side {} { return [my state side] }
    method over {} { return [expr {[my state result] ne "*"}] }

    # What must be carried for a move, and what lies where then: as tokens transfers says it. Nothing is played.
    method plan move {
        my variable Draughts Lies
        lassign [my Path $move] stops victims crowned
        return [::checkers::tokens transfers [my width] $Lies $stops $victims $crowned]
    }
    method Path move {
        my variable Draughts Lies
        set came [dict get [$Draughts exec path $move] ints]
        set stops [lrange $came 1 [lindex $came 0]]
        set victims [lrange $came [lindex $came 0]+1 end]
        # A man that ends on the last row is crowned.
        set from [::checkers::tokens place [my width] [lindex $stops 0]]
        set to [::checkers::tokens place [my width] [lindex $stops end]]
        set last [expr {[string index [my position] 0] eq "W" ? [my width] : 1}]
        return [list $stops $victims [expr {[lindex $to 1] == $last && [llength [dict get $Lies $from]] == 1}]]
    }

    # The move that is being carried out: whoever continues the game goes on with it. Empty: none.
    method intend move {
        my variable Intended
        set Intended $move
        my Keep
    }
    method intended {} { my variable Intended; return $Intended }

    # Play a move, after which LIES is where the tokens are.
    method play {move lies} {
        my variable Draughts Lies Intended Before
        set played [dict get [$Draughts exec play $move] text]
        set Before $Lies
        set Lies $lies
        set Intended {}
        my Keep
        return $played
    }

    # Where the tokens lay before the last move; empty: that is not known.
    method before {} { my variable Before; return $Before }

    # The last move is taken back.
    method back {} {
        my variable Draughts Lies Before
        $Draughts exec undo
        set Lies $Before
        set Before {}
        my intend {}
    }

    # What a camera must see when tokens lie so: a character for each field, Black's row first.
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
