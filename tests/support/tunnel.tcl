# tunnel.tcl PORT SEED LEAST MOST REFUSE -- a TCP tunnel to 127.0.0.1:PORT that breaks.
#
# Each connection is cut when so many bytes have gone through it, LEAST to MOST of them, in both directions together. So cuts
# fall at any byte, also in the first ones. After every REFUSE cuts nothing listens for up to half a second (0: never).
#
# It says "port N", and for each line on its input the number of cuts. The line "whole" ends the cuts. After "deaf" nothing comes back
# through the present connections. It ends with its input.

lassign $argv target seed least most refuse
expr {srand($seed)}
set cuts 0
set whole 0
set deaf {}
set port 0

proc listen {} {
    global server port
    set server [socket -server accept -myaddr 127.0.0.1 $port]
    set port [lindex [fconfigure $server -sockname] 2]
}

proc accept {near args} {
    global target least most whole left other
    if {[catch {socket 127.0.0.1 $target} far]} {
        close $near
        return
    }
    set other($near) $far
    set other($far) $near
    set left($near) [expr {$least + int(rand() * ($most - $least))}]
    set left($far) $near
    foreach channel [list $near $far] {
        fconfigure $channel -translation binary -blocking 0 -buffering none
        fileevent $channel readable [list carry $channel $near]
    }
}

proc carry {from line} {
    global other left whole deaf
    if {[catch {read $from 65536} bytes] || $bytes eq {}} {
        if {[catch {eof $from} ended] || $ended} {
            cut $line 0
        }
        return
    }
    set some [expr {$whole ? $bytes : [string range $bytes 0 $left($line)-1]}]
    if {$from eq $line || $line ni $deaf} {
        catch {puts -nonewline $other($from) $some}
    }
    incr left($line) [expr {-[string length $bytes]}]
    if {$left($line) <= 0 && !$whole} {
        cut $line 1
    }
}

proc cut {near counts} {
    global other left cuts refuse server
    if {![info exists other($near)]} return
    set far $other($near)
    foreach channel [list $near $far] {
        unset -nocomplain other($channel) left($channel)
        catch {close $channel}
    }
    if {!$counts} return
    incr cuts
    if {$refuse > 0 && $cuts % $refuse == 0 && $server ne {}} {
        close $server
        set server {}
        after [expr {int(rand() * 500)}] listen
    }
}

proc obey {} {
    global cuts whole deaf left
    if {[gets stdin line] < 0} {
        if {[eof stdin]} exit
        return
    }
    if {$line eq "whole"} {
        set whole 1
    } elseif {$line eq "deaf"} {
        set deaf [array names left]
    }
    puts $cuts
    flush stdout
}

fconfigure stdin -blocking 0
fileevent stdin readable obey
listen
puts "port $port"
flush stdout
vwait forever
