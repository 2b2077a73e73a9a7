# streamLine.tcl -- a line of bytes to an instrument: TCP, or a serial line. It finds the end of an answer by its terminator, or by the length of a
# block. It never blocks, and knows no bus and no SCPI.
#
#     ::sorma::streamLine::tcp create NAME WAIT           then open HOST PORT MS
#     ::sorma::streamLine::serial create NAME WAIT        then open LINE MS, as ::sorma::serial::parse has it
#
# All lines to instruments have these methods, which are called within a coroutine. Times are in ms, bytes are binary:
#
#     open ARGUMENT ... MS        connect
#     isOpen                      has it been opened, and not been shut?
#     idle                        before a message: is it as it was? Bytes that nobody has asked for are dropped
#     write BYTES MS              send a message
#     read MOST MS END            the bytes of an answer, which ends with END where the line has no other end
#     shut                        close it; what was under way is dropped
#
# WAIT is a command prefix: it gets readable or writable, a channel, and ms that it may take longer than usual. It suspends the coroutine, and returns
# ready or the reason why it has given up.
#
# Errors have the code LINE and: OPEN, there is nothing to open; REACH, the connection cannot be made; WAIT REASON; UNSENT, it broke before the message
# was sent; LOST, it broke; BIG, the answer has too many bytes; ERROR, the answer makes no sense. Lines with a protocol also have LOCKED, another
# client has the lock; and LATE, the instrument says that its time is over. Then shut the line.

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
    variable Wait
    variable Channel            ;# empty: closed
    variable Rest               ;# characters that may still come of the answer before
    variable Lag                ;# ms that a serial line needs for our message: that long the instrument cannot answer

    constructor wait {
        set Wait $wait
        set Channel [set Rest {}]
        set Lag 0
    }
    destructor {
        my shut
    }
    method isOpen {} { return [expr {$Channel ne {}}] }
    method idle {} { return [expr {![catch {read $Channel}] && ![eof $Channel]}] }
    method shut {} {
        if {$Channel ne {}} {
            ::sorma::serial::close $Channel
        }
        set Channel [set Rest {}]
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
            set what [{*}$Wait readable $Channel $Lag]
            if {$what ne "ready"} {
                throw [list LINE WAIT $what] "given up: $what"
            }
            if {[catch {read $Channel 262144} piece] || [eof $Channel] && $piece eq {}} {
                throw {LINE LOST} "[string length $input] bytes of the answer had come"
            }
            append input $piece
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
    variable Wait Channel

    method open {host port ms} {
        if {[catch {socket -async $host $port} channel]} {
            throw {LINE OPEN} $channel
        }
        set Channel $channel
        chan configure $channel -blocking 0 -buffering none -translation binary
        set what [{*}$Wait writable $channel 0]
        if {$what ne "ready"} {
            throw [list LINE WAIT $what] "given up: $what"
        }
        if {$Channel eq {}} {
            throw {LINE LOST} "it was closed"
        }
        if {[set why [chan configure $channel -error]] ne {}} {
            throw {LINE REACH} $why
        }
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
}
