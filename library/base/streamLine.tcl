# streamLine.tcl -- a line of bytes to an instrument: TCP, or a serial line. It finds the end of an answer by its terminator, or by the length of a
# block. It never blocks, and knows no bus and no SCPI.
#
#     ::sorma::streamLine::tcp create NAME WAIT           then open HOST PORT MS
#     ::sorma::streamLine::serial create NAME WAIT        then open LINE MS, as ::sorma::serial::parse has it
#
# It has the methods and errors of instrumentLine.tcl.

package require sorma::instrumentLine
package require sorma::serial
package provide sorma::streamLine 1.0

namespace eval ::sorma::streamLine {}

# ::sorma::streamLine::size INPUT END ?SEEN? -- the bytes of the first answer, without its end; -1: the end is not there yet. So many bytes were SEEN not to have it.
proc ::sorma::streamLine::size {input end {seen 0}} {
    if {[string index $input 0] ne "#" || [string index $input 1] eq "0"} {
        return [string first $end $input $seen]
    }
    set digits [string index $input 1]
    set length [if {[string is digit -strict $digits]} {string range $input 2 1+$digits}]
    if {![string is digit $digits] || ![string is digit $length]} {
        throw {LINE ERROR} "\"[string range $input 0 20]\" does not begin like a block: # and a digit, which says how many digits tell the length"
    }
    return [expr {[string length $length] < $digits ? -1 : 2 + $digits + [scan $length %lld]}]
}

oo::class create ::sorma::streamLine::line {
    superclass ::sorma::instrumentLine::line
    variable Channel
    variable Rest               ;# characters that may still come of the answer before
    variable Lag                ;# ms that a serial line needs for our message: that long the instrument cannot answer

    constructor wait {
        set Rest {}
        set Lag 0
        next $wait
    }
    method shut {} {
        set Rest {}
        next
    }
    method write {bytes ms} {
        set Lag [::sorma::serial::time $Channel [string length $bytes]]
        if {[catch {puts -nonewline $Channel $bytes} why]} {
            throw {LINE UNSENT} $why
        }
    }
    method read {most ms end} {
        set input {}
        set seen 0
        while 1 {
            append input [my Piece $Channel "[string length $input] bytes of the answer had come" $Lag]
            if {$Rest ne {}} {
                set input [string trimleft $input $Rest]
                set Rest [if {$input eq {}} {set Rest}]
            }
            set size [::sorma::streamLine::size $input $end $seen]
            set have [string length $input]
            set known [expr {$size < 0 ? $have : $size}]
            if {$known > $most} {
                throw {LINE BIG} "$known bytes or more"
            }
            if {$size >= 0 && $size <= $have} break
            set seen [expr {max(0, $have - [string length $end] + 1)}]
        }
        # A block's terminator may come after it, and some that are told CR answer CR LF.
        set Rest [if {$end eq "\r"} {string cat \n}][if {$have == $size} {string cat \r\n}]
        return [string range $input 0 $size-1]
    }
}

oo::class create ::sorma::streamLine::tcp {
    superclass ::sorma::streamLine::line
    variable Channel

    method open {host port ms} {
        set Channel [my Connect $host $port]
    }
}

oo::class create ::sorma::streamLine::serial {
    superclass ::sorma::streamLine::line
    variable Channel

    method open {line ms} {
        if {[catch {::sorma::serial::open $line} channel]} {
            throw {LINE OPEN} $channel
        }
        set Channel $channel
    }
    method shut {} {
        if {$Channel ne {}} {
            ::sorma::serial::close $Channel
        }
        next
    }
}
