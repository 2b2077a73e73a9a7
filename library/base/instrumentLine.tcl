# instrumentLine.tcl -- what lines to instruments by channels have in common. They never block, and know no bus and no SCPI.
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
# They are made with WAIT, a command prefix: it gets readable or writable, a channel, and ms that it may take longer than usual. It suspends the
# coroutine, and returns ready or the reason why it has given up.
#
# Errors have the code LINE and: OPEN, there is nothing to open; REACH, the connection cannot be made; WAIT REASON; UNSENT, it broke before the message
# was sent; LOST, it broke; BIG, the answer has too many bytes; ERROR, the answer makes no sense. Lines with a protocol also have LOCKED, another
# client has the lock; and LATE, the instrument says that its time is over. Then shut the line.

package provide sorma::instrumentLine 1.0

namespace eval ::sorma::instrumentLine {}

oo::class create ::sorma::instrumentLine::line {
    variable Wait
    variable Channel            ;# empty: closed
    variable Opening            ;# one that is not connected yet; empty: none

    constructor wait {
        set Wait $wait
        set Channel [set Opening {}]
    }
    destructor {
        my shut
    }
    method isOpen {} { return [expr {$Channel ne {}}] }
    method idle {} { return [expr {![catch {read $Channel}] && ![eof $Channel]}] }
    method shut {} {
        foreach channel [list $Channel $Opening] {
            catch {close $channel}
        }
        set Channel [set Opening {}]
    }
    # A channel to there.
    method Connect {host port} {
        if {[catch {socket -async $host $port} channel]} {
            throw {LINE OPEN} $channel
        }
        set Opening $channel
        try {
            chan configure $channel -blocking 0 -buffering none -translation binary
            my Await writable $channel
            if {$Opening eq {}} {
                throw {LINE LOST} "it was closed"
            }
            if {[set why [chan configure $channel -error]] ne {}} {
                throw {LINE REACH} $why
            }
        } on error {why how} {
            catch {close $channel}
            return -options $how $why
        } finally {
            set Opening {}
        }
        return $channel
    }
    method Await {event channel {longer 0}} {
        set what [{*}$Wait $event $channel $longer]
        if {$what ne "ready"} {
            throw [list LINE WAIT $what] "given up: $what"
        }
    }
    # The next bytes. lost: what the error says when there are none.
    method Piece {channel lost {longer 0}} {
        my Await readable $channel $longer
        if {[catch {::read $channel 262144} piece] || [eof $channel] && $piece eq {}} {
            throw {LINE LOST} $lost
        }
        return $piece
    }
}
