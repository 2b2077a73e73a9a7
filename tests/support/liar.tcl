# liar.tcl TEXT|-file:PATH|-error:{SYMBOL DETAIL ...} ?N? ?SEED? -- listens on a TCP port like a daemon, and lies.
#
# It greets its clients as a daemon does, and is well. It answers every call with TEXT, or the content of a file, and a trail of N warnings,
# or refuses it with an error. It refuses subscribers without a reason. With SEED each answer has lies of a trace: random spans behind it, and in its bytes others that no reply
# brings. Prints its port. Ends with its standard input.

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
        2 { rpc::send $channel [rpc::record $head[binary format IIII [expr {[info exists ::refusal] ? -1 : 0}] 0 0 0][lied][trail][spans $record]] }
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

# ---- lies of a trace: doc/wire.md ----

proc lied {} {
    if {[llength $::argv] < 3} { return [rpc::message $::lie] }
    set late {}
    for {set i [expr {int(rand() * 10)}]} {$i > 0} {incr i -1} {
        set rows [rows 1]
        append late [binary format WWII [expr {int(rand() * 1000)}] [expr {int(rand() * 6)}] [expr {rand() < 0.8}] [string length $rows]] $rows
    }
    return [rpc::text $::lie][binary format III 0 0 [string length $late]]$late[binary format I 0]
}

proc spans record {
    if {![traced $record] || [llength $::argv] < 3} return
    set rows [rows 0]
    return [binary format I [string length $rows]]$rows
}

# Has the call the number of a trace? It is the last part of its credentials: relayed, request, callers, author, trace.
proc traced record {
    binary scan $record @24II flavor size
    if {$flavor == 0} {
        return 0
    }
    set at 12
    foreach text {callers author} {
        if {$at >= $size} {
            return 0
        }
        binary scan $record @[expr {32 + $at}]I length
        incr at [expr {4 + ($length + 3) / 4 * 4}]
    }
    return [expr {$at < $size}]
}

# The beginning and the rows of spans: most can be read; causes are few, so that spans cause each other.
proc rows late {
    set out [binary format WWI [expr {$late ? 0 : [moment]}] [expr {$late ? 0 : [moment]}] 0]
    set depth 0
    set n [expr {rand() < 0.1 ? 3000 : int(rand() * 8)}]
    for {set i 0} {$i < $n} {incr i} {
        set depth [expr {rand() < 0.02 ? int(rand() * 400) : $depth < 250 && rand() < 0.5 ? $depth + 1 : max(1, int(rand() * ($depth + 1)))}]
        set kind [expr {int(rand() * 4)}]
        append out [binary format II $depth [expr {$kind << 6 | (rand() < 0.02 ? int(rand() * 64) : 4 | int(rand() * 3) | (rand() < 0.5 ? 48 : 0))}]]
        append out [rpc::text [string repeat x [expr {int(rand() * (rand() < 0.02 ? 10000 : 20))}]]][rpc::text "a \{ lie"]
        append out [binary format WWWWWI [moment] [moment] [moment] [moment] [moment] 0]
        if {$kind in {1 2}} { append out [binary format WI [expr {int(rand() * 6)}] [expr {rand() < 0.1 ? 0xffffffff : int(rand() * 4)}]] }
    }
    return [expr {rand() < 0.03 ? [string range $out 0 end-[expr {4 * int(rand() * 5)}]] : $out}]
}

proc moment {} {
    return [expr {rand() < 0.01 ? -1 : rand() < 0.1 ? (1 << 60) - 1 : int(rand() * 1e6)}]
}

if {[llength $argv] > 2} { expr {srand([lindex $argv 2])} }
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
