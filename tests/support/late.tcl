# late.tcl PORT -- a TCP proxy to 127.0.0.1:PORT. It delivers a question or an answer late, also when the client has gone meanwhile.
#
# It says "port N". It answers these lines with a line, and ends with its input:
#
#     question TEXT     keep the next piece that a client sends with this text in it                {}
#     answer TEXT       let such a piece through, and keep what the server says to it               {}
#     kept              how many bytes are kept; empty: none
#     silence TEXT      swallow all pieces that clients send with this text in them                 {}
#     deliver           deliver them now; tell when the server has answered, or the client has heard it     {}

set target [lindex $argv 0]
set text {}
set what {}
array set kept {}
set silence {}
set answered 0

proc accept {near args} {
    set far [socket 127.0.0.1 $::target]
    foreach {from to} [list $near $far $far $near] {
        fconfigure $from -translation binary -blocking 0 -buffering none
        fileevent $from readable [list carry $from $to [expr {$from eq $near}]]
    }
}
proc carry {from to client} {
    if {[catch {read $from 65536} bytes] || $bytes eq {}} {
        if {[catch {eof $from} ended] || $ended} {
            catch {close $from}
            if {![info exists ::kept($from)]} {
                catch {close $to}
            }
        }
        return
    }
    if {$client && $::silence ne {} && [string first $::silence $bytes] >= 0} return
    if {$client && $::text ne {} && [string first $::text $bytes] >= 0} {
        set ::kept([expr {$::what eq "question" ? $from : $to}]) {}
        set ::text {}
    }
    if {[info exists ::kept($from)]} {
        append ::kept($from) $bytes
        set ::to $to
    } else {
        catch {puts -nonewline $to $bytes}
        if {!$client} {
            set ::answered $from
        }
    }
}
proc obey {} {
    if {[gets stdin line] < 0} {
        if {[eof stdin]} exit
        return
    }
    set said {}
    switch [lindex $line 0] {
        question - answer {
            lassign $line ::what ::text
        }
        silence {
            set ::silence [lindex $line 1]
        }
        kept {
            foreach {from bytes} [array get ::kept] {
                set said [string length $bytes]
            }
        }
        deliver {
            foreach {from bytes} [array get ::kept] {
                unset ::kept($from)
                puts -nonewline $::to $bytes
                while {$::what eq "question" && $::answered ne $::to} {
                    vwait ::answered
                }
            }
        }
    }
    puts $said
    flush stdout
}

fconfigure stdin -blocking 0
fileevent stdin readable obey
puts "port [lindex [fconfigure [socket -server accept -myaddr 127.0.0.1 0] -sockname] 2]"
flush stdout
vwait forever
