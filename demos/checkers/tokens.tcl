# tokens.tcl -- where the tokens lie, on the board and beside it, and which of them must be carried for a move.
#
# A place is a list {file rank}, in the board's coordinates. The heaps lie beside the board, as low as possible: taken red
# tokens on the robot's half, taken yellow ones on the person's. The spare tokens lie there from the beginning. A queen is two
# tokens on each other; they are carried as one.
# The tokens' places are a dict: place -> list of colours, the lowest first.
#
# A transfer is a list {file rank underneath file rank underneath}, as for carry. The hand grips a token that has so many others
# underneath, with all tokens on it, and puts it on so many others.

package require Tcl 8.6-
package provide checkers::tokens 1.0

namespace eval ::checkers::tokens {
    namespace export width seen lie place square there spares colour heapPlace heap spare after transfers
    namespace ensemble create

    variable Most 6             ;# tokens on each other, of a heap
    variable Colours {white yellow black red}
}

# ::checkers::tokens::lie WIDTH POSITION -- what lies on a board of WIDTH files in a position: a FEN with numbers of squares.
proc ::checkers::tokens::lie {width position} {
    variable Colours
    set lies {}
    foreach part [lrange [split [string trimright $position .] :] 1 end] {
        set colour [dict get $Colours [dict get {W white B black} [string index $part 0]]]
        foreach piece [split [string range $part 1 end] ,] {
            if {![regexp {^(K?)(\d+)(?:-(\d+))?$} $piece -> king first last]} continue
            for {set square $first} {$square <= ($last eq {} ? $first : $last)} {incr square} {
                dict set lies [place $width $square] [lrepeat [expr {$king eq {} ? 1 : 2}] $colour]
            }
        }
    }
    return $lies
}

# ::checkers::tokens::seen REPLY -- the tokens of the laboratory, the lowest first, from its answer to EXEC tokens: list of {name file rank x y z}.
proc ::checkers::tokens::seen reply {
    if {![dict exists $reply text]} {
        return
    }
    return [lsort -real -index 5 [lmap name [dict get $reply text] {file rank x y z} [dict get $reply floats] {
        list $name $file $rank $x $y $z
    }]]
}

# ::checkers::tokens::width PDN -- files of the board of a game.
proc ::checkers::tokens::width pdn {
    return [expr {[regexp {GameType "20} $pdn] ? 10 : 8}]
}

# ::checkers::tokens::place WIDTH SQUARE -- the place of a square; they are numbered along the rows from Black's side.
proc ::checkers::tokens::place {width square} {
    set half [expr {$width / 2}]
    set row [expr {($square - 1) / $half}]
    return [list [expr {2 * (($square - 1) % $half) + ($row % 2 == 0) + 1}] [expr {$width - $row}]]
}

# ::checkers::tokens::square WIDTH FILE RANK -- the square of a place.
proc ::checkers::tokens::square {width file rank} {
    return [expr {($width - $rank) * ($width / 2) + ($file + 1) / 2}]
}

# ::checkers::tokens::there WIDTH FILE RANK -- does a token whose middle is there lie on the board, or on a heap beside it?
proc ::checkers::tokens::there {width file rank} {
    return [expr {$file > -1 && $file < $width + 2 && $rank > 0.5 && $rank < $width + 0.5}]
}

# ::checkers::tokens::spares WIDTH -- the spare tokens that lie there before a game: two of each colour, one beside the other.
proc ::checkers::tokens::spares width {
    set lies {}
    foreach colour {red yellow} {
        foreach place [lrange [HeapPlaces $width $colour] 0 1] {
            dict set lies $place $colour
        }
    }
    return $lies
}

# ::checkers::tokens::heap WIDTH LIES COLOUR COUNT -- where so many tokens of a colour are put on the heap: {file rank underneath}. Heaps
# stay low: the higher one is, the more of its side a camera takes for the token on top.
proc ::checkers::tokens::heap {width lies colour count} {
    variable Most
    set least $Most
    foreach place [HeapPlaces $width $colour] {
        set there [Height $lies $place]
        if {$there < $least && $there + $count <= $Most} {
            set least $there
            set goal [list {*}$place $there]
        }
    }
    if {![info exists goal]} {
        return -code error -errorcode {CHECKERS HEAP} "the heap of $colour tokens is full"
    }
    return $goal
}
proc ::checkers::tokens::Height {lies place} {
    return [expr {[dict exists $lies $place] ? [llength [dict get $lies $place]] : 0}]
}

# Where tokens of a colour are put, beside the board at the right, then at the left. A row is free between two heaps: the fingers that close on
# a token push what lies one field away (demos/lab/carries.tcl -heaps).
proc ::checkers::tokens::HeapPlaces {width colour} {
    set places {}
    foreach file [list [expr {$width + 1.4}] -0.4] {
        for {set n 0} {$n < $width / 2 - 1} {incr n 2} {
            lappend places [list $file [expr {$colour eq "red" ? $width - $n : 1 + $n}]]
        }
    }
    return $places
}

# ::checkers::tokens::heapPlace WIDTH COLOUR -- the first place of a colour's heaps.
proc ::checkers::tokens::heapPlace {width colour} {
    return [lindex [HeapPlaces $width $colour] 0]
}

# ::checkers::tokens::colour WIDTH PLACE -- of the heap at a place beside the board.
proc ::checkers::tokens::colour {width place} {
    return [expr {[lindex $place 1] > $width / 2 ? "red" : "yellow"}]
}

# ::checkers::tokens::spare WIDTH LIES COLOUR -- the uppermost token of the highest one of a colour's heaps: {file rank underneath}.
proc ::checkers::tokens::spare {width lies colour} {
    set most 0
    foreach place [HeapPlaces $width $colour] {
        if {[Height $lies $place] >= max(1, $most)} {
            set most [Height $lies $place]
            set spare [list {*}$place [expr {$most - 1}]]
        }
    }
    if {![info exists spare]} {
        return -code error -errorcode [list CHECKERS SPARE $colour] \
            "no $colour token lies on the heap to make a queen of: put one to [lindex [HeapPlaces $width $colour] 0]"
    }
    return $spare
}

# ::checkers::tokens::after LIES TRANSFER -- what lies where after a transfer. Fails where it cannot be done.
proc ::checkers::tokens::after {lies transfer} {
    lassign $transfer file rank underneath toFile toRank above
    set from [list $file $rank]
    set to [list $toFile $toRank]
    set there [expr {[dict exists $lies $to] ? [dict get $lies $to] : {}}]
    if {![dict exists $lies $from] || [llength [dict get $lies $from]] <= $underneath} {
        return -code error -errorcode {CHECKERS TRANSFER} "nothing lies at $from above $underneath tokens"
    }
    if {[llength $there] != $above} {
        return -code error -errorcode {CHECKERS TRANSFER} "at $to lie [llength $there] tokens, not $above"
    }
    set stack [dict get $lies $from]
    dict set lies $to [concat $there [lrange $stack $underneath end]]
    if {$underneath == 0} {
        dict unset lies $from
    } else {
        dict set lies $from [lrange $stack 0 $underneath-1]
    }
    return $lies
}

# ::checkers::tokens::transfers WIDTH LIES STOPS VICTIMS CROWNED -- a move as transfers, and what lies where after them.
#       STOPS and VICTIMS are numbers of squares, as draughts EXEC path tells them. The piece goes from stop to stop, the victims to
#       their heap, and a man that is crowned gets a second token from the heap. A camera above cannot see that token: so it never comes
#       last. When the board looks as it should, all is done.
# Results:
#       A list: transfers, and the dict.
proc ::checkers::tokens::transfers {width lies stops victims crowned} {
    set all {}
    set places [lmap square $stops {place $width $square}]
    if {$crowned && [llength $victims] == 0} {
        Crown $width [lindex $places 0]
    }
    foreach from [lrange $places 0 end-1] to [lrange $places 1 end] {
        if {$from ne $to} {
            Carry [list {*}$from 0 {*}$to 0]
        }
    }
    if {$crowned && [llength $victims] > 0} {
        Crown $width [lindex $places end]
    }
    foreach square $victims {
        set place [place $width $square]
        set stack [dict get $lies $place]
        Carry [list {*}$place 0 {*}[heap $width $lies [lindex $stack 0] [llength $stack]]]
    }
    return [list $all $lies]
}

# Of transfers: one more.
proc ::checkers::tokens::Carry transfer {
    upvar 1 all all lies lies
    lappend all $transfer
    set lies [after $lies $transfer]
}
proc ::checkers::tokens::Crown {width place} {
    upvar 1 all all lies lies
    Carry [list {*}[spare $width $lies [lindex [dict get $lies $place] 0]] {*}$place 1]
}
