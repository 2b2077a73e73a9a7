# hislipMessage.tcl -- messages of HiSLIP (IVI-6.1) as bytes. It knows no bus and no socket.
#
#     ::sorma::hislipMessage::make DataEnd 0 0xffffff00 *IDN?\n
#     ::sorma::hislipMessage::take INPUT MOST     -> how many bytes the first one takes, its name, control code, parameter and payload

package provide sorma::hislipMessage 1.0

namespace eval ::sorma::hislipMessage {
    variable Names {Initialize InitializeResponse FatalError Error AsyncLock AsyncLockResponse Data DataEnd DeviceClearComplete DeviceClearAcknowledge
        AsyncRemoteLocalControl AsyncRemoteLocalResponse Trigger Interrupted AsyncInterrupted AsyncMaxMsgSize AsyncMaxMsgSizeResponse AsyncInitialize
        AsyncInitializeResponse AsyncDeviceClear AsyncServiceRequest AsyncStatusQuery AsyncStatusResponse AsyncDeviceClearAcknowledge AsyncLockInfo
        AsyncLockInfoResponse}
}

proc ::sorma::hislipMessage::make {name control parameter {payload {}}} {
    variable Names
    return [binary format a2ccIWa* HS [lsearch -exact $Names $name] $control $parameter [string length $payload] $payload]
}

# The count is 0 when the message is not whole, and -1 when it is none, or its payload has more than MOST bytes. Then the name says which: none or big.
# The name is a number when the type has none.
proc ::sorma::hislipMessage::take {input most} {
    variable Names
    if {[binary scan $input a2cucuIuWu mark type control parameter size] < 5} {
        return [if {[string match [string range HS 0 [string length $input]-1]* $input] || [string match HS* $input]} {list 0} else {list -1 none}]
    }
    if {$mark ne "HS"} {
        return {-1 none}
    }
    if {$size > $most} {
        return [list -1 big $size]
    }
    if {[string length $input] < 16 + $size} {
        return 0
    }
    return [list [expr {16 + $size}] [expr {$type < [llength $Names] ? [lindex $Names $type] : $type}] $control $parameter [string range $input 16 [expr {15 + $size}]]]
}
