# timelineFollow.tcl -- a time line of a recording that is being made: what is written meanwhile is read each second, and the end stays in sight.

package require snit
package require sorma::timelineText
package provide sorma::timelineFollow 1.0

# ::sorma::timelineFollow -- methods of the widget for that. It has canvas, facts, from, until, whole, grip, trouble and timer.
snit::macro ::sorma::timelineFollow {} {
    variable following 0
    variable followTimer {}
    variable growing 0          ;# what was written meanwhile is being read: the window says nothing of it
    variable placing 0          ;# the view is moved by us

    method follow {{boolean {}}} {
        if {$boolean ne {}} {
            set following [expr {$boolean eq "toggle" ? !$following : !!$boolean}]
            $self Followed
        }
        return $following
    }
    method Followed {} {
        after cancel $followTimer
        if {!$following} return
        $self KeepEnd
        $self More
    }
    # One question at a time; none while nobody sees the answer.
    method More {} {
        after cancel $followTimer
        if {!$following || ![winfo viewable $canvas]} return
        set followTimer [after 1000 [mymethod More]]
        if {$growing || ($trouble eq {} && [dict get $facts done] < 1)} return
        set growing 1
        $self Ask [mymethod Begun] more
    }
    # Nothing came since: then the picture is as it shall be.
    method Unchanged answer {
        if {!$growing || ![dict exists $facts version] || [dict get $facts version] ne [dict get $answer version] || [dict get $facts error] ne [dict get $answer error]} {
            return 0
        }
        if {[dict get $answer done] < 1} {
            set timer [after 50 [mymethod Ask [mymethod Begun] about]]
        } else {
            set growing 0
        }
        return 1
    }
    # The last record stands a little left of the right edge, unless somebody holds the picture.
    method KeepEnd {} {
        if {!$following || $whole || $grip ne {}} return
        set placing 1
        $self Edge 1
        set placing 0
    }
    # Somebody has moved the view from WAS: earlier, or so that the end is out of sight.
    method Left was {
        if {!$following || $placing} return
        lassign $was first last
        set end [::sorma::timelineText::ns [dict get $facts last]]
        if {$end < $from || $end > $until || ($until - $from == $last - $first && $from < $first)} {
            set following 0
            after cancel $followTimer
        }
    }
}
