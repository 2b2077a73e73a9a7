# message.tcl -- a reply as commands return it, RET code TMSG text ..., read into a dict; and what is in it. It knows no bus.

package provide sorma::message 1.0

namespace eval ::sorma::message {}

# ::sorma::message::fromList LIST -- a dict of code and, as far as they are there, text, floats, ints, any (bytes) and
# trail (the word of TDBX). Fails when it is no reply.
proc ::sorma::message::fromList list {
    if {[lindex $list 0] ne "RET" || ![string is wideinteger -strict [lindex $list 1]]} {
        return -code error "no reply"
    }
    set reply [dict create code [lindex $list 1]]
    set n [llength $list]
    for {set i 2} {$i < $n} {incr i 2} {
        set value [lindex $list $i+1]
        switch -- [lindex $list $i] {
            TMSG { dict set reply text $value }
            TDBX { dict set reply trail $value }
            AMSG { dict set reply any [binary decode base64 $value] }
            FMSG - IMSG {
                if {![string is integer -strict $value] || $value < 0 || $i + 2 + $value > $n} {
                    return -code error "bad count"
                }
                dict set reply [dict get {FMSG floats IMSG ints} [lindex $list $i]] [lrange $list $i+2 [expr {$i + 1 + $value}]]
                incr i $value
            }
            default { return -code error "no reply" }
        }
    }
    return $reply
}

# ::sorma::message::part REPLY PART INDEX -- {PART VALUE}; if PART is empty, the first of text, floats, ints and words that is
# there. The items of a list, or that of INDEX.
proc ::sorma::message::part {reply part index} {
    foreach part [if {$part ne {}} {list $part} else {list text floats ints words}] {
        if {[dict exists $reply $part] && [dict get $reply $part] ne {}} {
            set value [dict get $reply $part]
            return [list $part [if {$part in {floats ints words} && $index ne {}} {lrange $value $index $index} else {set value}]]
        }
    }
}
