# repair.tcl -- finds the transfers that put a wrong board in order. Places and transfers are those of tokens.tcl.

package require checkers::tokens
package provide checkers::repair 1.0

namespace eval ::checkers::repair {
    namespace export seen anew order
    namespace ensemble create
}

# ::checkers::repair::seen WIDTH SIGHT SHOULD -- the tokens' places as the camera sees the board. The camera sees the uppermost
#       token of a field, and nothing beside the board. SHOULD fills in the rest.
proc ::checkers::repair::seen {width sight should} {
    set lies [dict filter $should script {place -} {expr {![OnBoard $width $place]}}]
    set i -1
    foreach letter [split $sight {}] {
        incr i
        set colour [dict get {. {} r red y yellow ? {}} $letter]
        if {$colour eq {}} continue
        set place [list [expr {$i % $width + 1}] [expr {$width - $i / $width}]]
        set there [expr {[dict exists $should $place] ? [dict get $should $place] : {}}]
        dict set lies $place [expr {[lindex $there end] eq $colour ? $there : $colour}]
    }
    return $lies
}
proc ::checkers::repair::OnBoard {width place} {
    return [expr {[lindex $place 0] >= 1 && [lindex $place 0] <= $width}]
}

# ::checkers::repair::anew WIDTH LIES TRANSFERS -- the same transfers with changed heaps. Each token from a heap is taken where
#       one lies now, and each token for a heap goes where there is room. Returns transfers, and what lies where after them.
proc ::checkers::repair::anew {width lies transfers} {
    set all {}
    foreach transfer $transfers {
        lassign $transfer file rank underneath toFile toRank above
        if {![OnBoard $width [list $file $rank]]} {
            set colour [lindex [dict get $lies [list $toFile $toRank]] 0]
            set transfer [list {*}[::checkers::tokens spare $width $lies $colour] $toFile $toRank $above]
        } elseif {![OnBoard $width [list $toFile $toRank]]} {
            set stack [dict get $lies [list $file $rank]]
            set transfer [list $file $rank $underneath {*}[::checkers::tokens heap $width $lies [lindex $stack 0] [llength $stack]]]
        }
        lappend all $transfer
        set lies [::checkers::tokens after $lies $transfer]
    }
    return [list $all $lies]
}

# ::checkers::repair::order WIDTH LIES SHOULD -- what must be carried so that the board is as it should be.
# Results:
#       A list: transfers; what lies where after them; places that are still wrong, since tokens are missing.
proc ::checkers::repair::order {width lies should} {
    set all {}
    while {[set transfer [Next $width $lies $should]] ne {}} {
        lappend all $transfer
        set lies [::checkers::tokens after $lies $transfer]
    }
    return [list $all $lies [Wrong $width $lies $should]]
}
proc ::checkers::repair::Wrong {width lies should} {
    return [lsort [lmap place [lsort -unique [concat [dict keys $lies] [dict keys $should]]] {
        if {![OnBoard $width $place] || [At $lies $place] eq [At $should $place]} continue
        set place
    }]]
}
proc ::checkers::repair::At {lies place} {
    return [expr {[dict exists $lies $place] ? [dict get $lies $place] : {}}]
}
# A token that is too much goes to where one is missing, else to the heap; what is still missing comes from the heap.
proc ::checkers::repair::Next {width lies should} {
    set wrong [Wrong $width $lies $should]
    set surplus [lmap place $wrong {expr {[TooMuch $lies $should $place] ? $place : [continue]}}]
    foreach place $wrong {
        set here [At $lies $place]
        set goal [At $should $place]
        # The tokens there are right, but too few.
        if {[llength $here] >= [llength $goal] || $here ne [lrange $goal 0 [llength $here]-1]} continue
        set colour [lindex $goal 0]
        foreach from $surplus {
            set stack [At $lies $from]
            set below [Below $lies $should $from]
            if {[lindex $stack end] eq $colour && [llength $stack] - $below <= [llength $goal] - [llength $here]} {
                return [list {*}$from $below {*}$place [llength $here]]
            }
        }
        if {![catch {::checkers::tokens spare $width $lies $colour} spare] && $surplus eq {}} {
            return [list {*}$spare {*}$place [llength $here]]
        }
    }
    foreach from $surplus {
        set stack [At $lies $from]
        set below [Below $lies $should $from]
        return [list {*}$from $below {*}[::checkers::tokens heap $width $lies [lindex $stack end] [expr {[llength $stack] - $below}]]]
    }
}
proc ::checkers::repair::TooMuch {lies should place} {
    return [expr {[llength [At $lies $place]] > [Below $lies $should $place]}]
}
# So many tokens of a place, from below, are as they should be.
proc ::checkers::repair::Below {lies should place} {
    set n 0
    foreach a [At $lies $place] b [At $should $place] {
        if {$a eq {} || $a ne $b} break
        incr n
    }
    return $n
}
