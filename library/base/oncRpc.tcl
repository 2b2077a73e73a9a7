# oncRpc.tcl -- records, calls and replies of ONC RPC (RFC 5531) as bytes, for small programs of others such as VXI-11. It knows no bus and no socket.
#
# All of it is binary. The caller writes and reads arguments and results by `binary`: Iu is an unsigned word.

package provide sorma::oncRpc 1.0

namespace eval ::sorma::oncRpc {
    variable Last 0x80000000    ;# in the mark of the last piece of a record
}

# ::sorma::oncRpc::opaque BYTES -- counted, and padded to whole words.
proc ::sorma::oncRpc::opaque bytes {
    set size [string length $bytes]
    return [binary format Iua[expr {($size + 3) & ~3}] $size $bytes]
}

# ::sorma::oncRpc::take INPUT MOST -- the first record of these bytes: how many bytes it takes, and the record.
# The count is 0 when it is not whole, and -1 when it has more than MOST bytes. A record may come in pieces.
proc ::sorma::oncRpc::take {input most} {
    variable Last
    set record {}
    set at 0
    while {[binary scan $input @${at}Iu mark]} {
        set size [expr {$mark & ~$Last}]
        # Empty pieces may not come for ever.
        if {[string length $record] + $size > $most || $at > $most + 1024} {
            return {-1 {}}
        }
        incr at 4
        if {[string length $input] < $at + $size} break
        append record [string range $input $at [expr {$at + $size - 1}]]
        incr at $size
        if {$mark & $Last} {
            return [list $at $record]
        }
    }
    return {0 {}}
}

# ::sorma::oncRpc::call XID PROGRAM VERSION PROCEDURE ARGUMENTS -- the record of a call, by nobody in particular.
proc ::sorma::oncRpc::call {xid program version procedure arguments} {
    variable Last
    return [binary format IuIu10a* [expr {$Last | (40 + [string length $arguments])}] [list $xid 0 2 $program $version $procedure 0 0 0 0] $arguments]
}

# ::sorma::oncRpc::asked RECORD -- a list: xid, version of RPC, program, version, procedure and arguments of a call; empty: it is none.
proc ::sorma::oncRpc::asked record {
    if {[binary scan $record IuIuIuIuIuIux4Iu xid type rpc program version procedure length] < 7 || $type != 0 || $length > 400} return
    # The credentials are skipped: they prove nothing.
    set at [expr {36 + (($length + 3) & ~3)}]
    if {![binary scan $record @${at}Iu length] || $length > 400} return
    set at [expr {$at + 4 + (($length + 3) & ~3)}]
    if {$at > [string length $record]} return
    return [list $xid $rpc $program $version $procedure [string range $record $at end]]
}

# ::sorma::oncRpc::reply XID RESULTS -- the record of a reply.
proc ::sorma::oncRpc::reply {xid results} {
    variable Last
    return [binary format Iu7a* [list [expr {$Last | (24 + [string length $results])}] $xid 1 0 0 0 0] $results]
}

# ::sorma::oncRpc::refusal XID WHY ?LOW HIGH? -- the record of a refusal. WHY is program, version, procedure, arguments, or rpc (its version). For version,
# LOW and HIGH are the versions that are there.
proc ::sorma::oncRpc::refusal {xid why args} {
    variable Last
    set words [switch -- $why {
        program { list 0 0 0 1 }
        version { list 0 0 0 2 {*}$args }
        procedure { list 0 0 0 3 }
        arguments { list 0 0 0 4 }
        rpc { list 1 0 2 2 }
    }]
    return [binary format Iu* [list [expr {$Last | (8 + 4 * [llength $words])}] $xid 1 {*}$words]]
}

# ::sorma::oncRpc::results RECORD XID -- the results of this call. A reply to another call gives an error with the code {RPC OTHER}, a refusal
# one with {RPC REFUSED}.
proc ::sorma::oncRpc::results {record xid} {
    if {[binary scan $record IuIuIu id type denied] < 3 || $type != 1 || $id != $xid} {
        throw {RPC OTHER} "no reply to this call"
    }
    if {$denied || ![binary scan $record @16Iu length] || ![binary scan $record @[set at [expr {20 + (($length + 3) & ~3)}]]Iu why] || $why != 0} {
        throw {RPC REFUSED} "the call was refused[if {[info exists why]} {string cat { (} $why )}]"
    }
    return [string range $record $at+4 end]
}
