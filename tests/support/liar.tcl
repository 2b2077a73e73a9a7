# liar.tcl TEXT|-file:PATH|-error:{SYMBOL DETAIL ...} ?N? -- listens on a TCP port like a daemon, greets its clients as one, is well, and answers every call with TEXT and a
# trail of N warnings (TEXT may be what a file holds), or refuses it with an error; who subscribes is refused without a reason. Prints its port. Ends with its standard input.

source [file join [file dirname [file normalize [info script]]] rpc.tcl]

proc accept {channel args} {
    fconfigure $channel -translation binary -blocking 0 -buffering none
    set ::rpc::Input($channel) {}
    set ::rpc::Input($channel,ended) 0
    fileevent $channel readable [list take $channel]
}

proc take channel {
    rpc::Take $channel
    while {[set n [rpc::Length $channel]] >= 0} {
        answer $channel [string range $rpc::Input($channel) 4 [expr {3 + $n}]]
        set rpc::Input($channel) [string range $rpc::Input($channel) [expr {4 + $n}] end]
    }
    if {$rpc::Input($channel,ended)} {
        rpc::close $channel
    }
}

proc answer {channel record} {
    binary scan $record IIIIII xid kind - - - procedure
    set head [binary format IIIIII $xid 1 0 0 0 0]
    set welcome [binary format W 4711][rpc::text liar][rpc::text nobody][rpc::text nowhere][binary format W 1][rpc::text lies]
    append welcome [binary format IIWI 1000000 64 0 0]
    switch $procedure {
        1 { rpc::send $channel [rpc::record $head$welcome] }
        2 { rpc::send $channel [rpc::record $head[binary format IIII [expr {[info exists ::refusal] ? -1 : 0}] 0 0 0][rpc::message $::lie][trail]] }
        4 { rpc::send $channel [rpc::record $head[rpc::text liar][binary format WI 0 0][rpc::text {}][binary format WII 0 0 1]] }
        5 { rpc::send $channel [rpc::record $head[binary format IIII -1 0 0 0][rpc::message][binary format II 0 0]] }
    }
}

proc trail {} {
    if {[info exists ::refusal]} {
        set details [join [lmap d [lrange $::refusal 1 end] {rpc::text $d}] {}]
        set entry [binary format I 2][rpc::text [lindex $::refusal 0]][binary format I [expr {[llength $::refusal] - 1}]]$details[rpc::text refused]
        append entry [rpc::text {}][rpc::text {}][rpc::text {}][binary format IW 0 0][rpc::text {}]
        return [binary format II 0 1]$entry
    }
    set n [expr {[llength $::argv] > 1 ? [lindex $::argv 1] : 0}]
    set entry [binary format I 1][rpc::text {LIAR SAYS}][binary format I 0][rpc::text "a lie"][rpc::text {}][rpc::text {}][rpc::text {}]
    append entry [binary format IW 0 0][rpc::text {}]
    return [binary format II 0 $n][string repeat $entry $n]
}

set lie [lindex $argv 0]
if {[regsub {^-file:} $lie {} path]} {
    set channel [open $path]
    set lie [read $channel]
    close $channel
}
if {[regsub {^-error:} $lie {} refusal]} {
    set lie {}
} else {
    unset refusal
}
set reply [rpc::message $lie][trail]
set listener [socket -server accept -myaddr 127.0.0.1 0]
puts [lindex [fconfigure $listener -sockname] 2]
flush stdout
fconfigure stdin -blocking 0
fileevent stdin readable {if {[gets stdin line] < 0 && [eof stdin]} exit}
vwait forever
