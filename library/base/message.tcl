# message.tcl -- a reply as commands return it, RET code TMSG text ..., read into a dict. It knows no bus.

package provide sorma::message 1.0

namespace eval ::sorma::message {}

# ::sorma::message::fromList LIST -- a dict of code and what is there of text, floats, ints, any (bytes) and trail (the word of TDBX);
# an error when it is no reply.
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
