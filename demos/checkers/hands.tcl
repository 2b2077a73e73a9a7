# hands.tcl -- what a player does with the hand, beside carrying: it feels what the camera cannot know, and puts the board in order.
#
# From above two tokens on each other look as one, and what lies beside the board is not seen. In doubt, and only then, the hand touches
# the place: -carry EXEC height FMSG 2 file rank answers how many tokens lie there.

package require sorma
package require checkers::tokens
package require checkers::repair
package provide checkers::hands 1.0

# The part that all players share.
oo::class create ::checkers::hands {
    variable Game Stages Transfers      ;# of the player

    # How many tokens lie at a place.
    method Height place {
        my Enter feel place $place
        set there [expr {round([lindex [dict get [[my Setting -carry] exec -floats $place height] floats] 0])}]
        my Note felt place $place tokens $there
        return $there
    }
    # If the hand still holds a token after a carry that failed, this takes the token to its goal. Did it hold anything?
    method Finish transfer {
        return [expr {[lindex [dict get [[my Setting -carry] exec -floats $transfer finish] floats] 0] != 0}]
    }

    # Has it been carried?
    method Carry {transfer lies} {
        my Enter carry transfer $transfer
        set stack [lrange [dict get $lies [lrange $transfer 0 1]] [lindex $transfer 2] end]
        if {[catch {[my Setting -carry] exec -floats $transfer -ints [llength $stack] -text [lindex $stack end]} message how]} {
            my Trouble [my Plain $message [dict get $how -errorcode]] code [dict get $how -errorcode] detail $message
            sorma::await sleep [my Setting -look]
            return 0
        }
        my Note carried transfer $transfer lies [::checkers::tokens after $lies $transfer]
        return 1
    }

    # Which one of the stages that look alike (FITS) it is, after transfer NEAR perhaps failed; the hand feels where they differ. Where a
    # heap is otherwise than the game says, the game is put right, and what is still to be carried, too. Empty: it is none of them, or it
    # cannot be felt; that has been told.
    method Felt {near fits} {
        try {
            while {[llength $fits] > 1} {
                set place [my Differing {*}[lmap k [lrange $fits 0 1] {lindex $Stages $k}]]
                if {$place eq {}} {
                    set fits [lindex $fits 0]
                    break
                }
                set there [my Height $place]
                set fits [lmap k $fits {expr {[my Tokens [lindex $Stages $k] $place] == $there ? $k : [continue]}}]
                if {$fits eq {}} {
                    my Trouble "On [my Named $place] I feel [my Count $there]. Please put it in order." place $place
                    return
                }
            }
            set k [lindex $fits 0]
            foreach {file rank -} [lindex $Transfers $near] {
                set place [list $file $rank]
                if {![my OnBoard $place] && [set there [my Height $place]] != [my Tokens [lindex $Stages $k] $place]} {
                    my Correct $k $place $there
                }
            }
            return $k
        } on error {text how} {
            if {[lrange [dict get $how -errorcode] 0 1] eq {CHECKERS ORDER}} {
                return -options $how $text
            }
            my Trouble [my Plain $text [dict get $how -errorcode]] code [dict get $how -errorcode] detail $text
            return
        }
    }
    # The heap at a place is as high as it is felt, from stage K on.
    method Correct {k place there} {
        set lies [lindex $Stages $k]
        my Note heap place $place tokens $there
        my Say "On [my Named $place] I feel [my Count $there], there should be [my Tokens $lies $place]. I go on without what is missing."
        set colour [::checkers::tokens colour [$Game width] $place]
        set lies [expr {$there == 0 ? [dict remove $lies $place] : [dict replace $lies $place [lrepeat $there $colour]]}]
        set Transfers [concat [lrange $Transfers 0 $k-1] [lindex [::checkers::repair anew [$Game width] $lies [lrange $Transfers $k end]] 0]]
        set Stages [concat [lrange $Stages 0 $k-1] [my StagesOf $lies [lrange $Transfers $k end]]]
    }
    # A place that has not as many tokens in both, one of the board if there is one.
    method Differing {a b} {
        set differ [lmap place [lsort -unique [concat [dict keys $a] [dict keys $b]]] {
            expr {[my Tokens $a $place] != [my Tokens $b $place] ? $place : [continue]}
        }]
        foreach place $differ {
            if {[my OnBoard $place]} {
                return $place
            }
        }
        return [lindex $differ 0]
    }

    # Carry what lies elsewhere than it should. On a field with too many tokens the hand feels one token, or as many as the
    # field should have.
    method Tidy {sight should} {
        set width [$Game width]
        my Enter tidy
        my Say "I put the board in order."
        set lies [::checkers::repair seen $width $sight $should]
        # Among queens the camera does not know what is one.
        if {[lsearch -exact [lmap stack [dict values $should] {llength $stack}] 2] >= 0} {
            dict for {place stack} $lies {
                if {[my OnBoard $place] && [my Tokens $should $place] != [llength $stack]} {
                    dict set lies $place [lrepeat [my Height $place] [lindex $stack 0]]
                }
            }
        }
        lassign [::checkers::repair order $width $lies $should] transfers after wrong
        foreach transfer $transfers {
            my Obey
            if {![my Carry $transfer $lies]} {
                # Until the hand is empty, whoever has been killed.
                while {[catch {my Finish $transfer} text how]} {
                    my Trouble [my Plain $text [dict get $how -errorcode]] code [dict get $how -errorcode] detail $text
                    my Obey
                    sorma::await sleep [my Setting -look]
                }
                return $should
            }
            set lies [::checkers::tokens after $lies $transfer]
        }
        if {$wrong ne {}} {
            my Say "Tokens are missing for [join [lmap place $wrong {my Named $place}] {, }]. Please put them there."
        }
        # The heaps beside the board, now.
        return [dict merge [dict filter $should script {place -} {my OnBoard $place}] [dict filter $after script {place -} {expr {![my OnBoard $place]}}]]
    }

    method Tokens {lies place} {
        return [expr {[dict exists $lies $place] ? [llength [dict get $lies $place]] : 0}]
    }
    method OnBoard place {
        return [expr {[lindex $place 0] >= 1 && [lindex $place 0] <= [$Game width]}]
    }
    # A place in words.
    method Named place {
        if {[my OnBoard $place]} {
            return [my Field {*}$place]
        }
        return "the heap at the [expr {[lindex $place 0] < 1 ? "left" : "right"}] of row [lindex $place 1]"
    }
    method Count n {
        return [expr {$n == 0 ? "no token" : $n == 1 ? "one token" : "$n tokens"}]
    }
}
