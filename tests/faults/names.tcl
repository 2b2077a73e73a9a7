# names.tcl ?processes? ?names? ?seconds? -- many processes claim names in one etcd, and watch all of them. It measures a find, and how late news
# come. It also measures the cost: first nothing happens for so many seconds, then each process ends and begins again.
#
# By hand, from the build folder: ./env tclsh ../tests/faults/names.tcl 50 5000 20

source [file join [file dirname [file normalize [info script]]] faults.tcl]
source [file join $supportFolder etcd.tcl]
set lease 60

proc begin {} {
    set pipe [open [list | [file join $::env(SORMA_BUILD) directories] etcd:[dict get $::server url] -prefix lab -lease $::lease 2>@stderr] r+]
    fconfigure $pipe -buffering line
    if {[gets $pipe] ne "ready"} {
        error "a process does not start"
    }
    set ::news($pipe) {}
    return $pipe
}
# The answer to a command. News before it are kept.
proc ask {pipe args} {
    puts $pipe $args
    while {[gets $pipe said] >= 0} {
        if {![string match "changed *" $said]} {
            return $said
        }
        if {$::keep} {
            lappend ::news($pipe) [lrange $said 1 2]
        }
    }
    error "a process has ended"
}
proc claimAll {pipe number} {
    for {set i 0} {$i < $::each} {incr i} {
        ask $pipe claim daemon.$number.$i root@host[pid $pipe] /tmp/nowhere.sock
    }
}
# By turns: a process whose news nobody reads stands still.
proc knowAll pipes {
    waitFor {[set pipes [lmap pipe $pipes {if {[llength [ask $pipe entries]] == $::names} continue; set pipe}]] eq {}} 120000
}
# Processor time of processes [s].
proc spent pids {
    return [tcl::mathop::+ {*}[lmap pid $pids {daemon processor $pid}]]
}
proc percent {from to seconds} {
    return [format "%.1f %%" [expr {100 * ($to - $from) / $seconds}]]
}

attack {
    lassign [concat $argv [lrange {50 5000 20} [llength $argv] end]] processes names seconds
    set each [expr {$names / $processes}]
    set names [expr {$each * $processes}]
    set keep 0
    set server [etcd::start]
    try {
        set pipes {}
        for {set i 0} {$i < $processes} {incr i} {
            lappend pipes [set pipe [begin]]
            claimAll $pipe $i
        }
        knowAll $pipes
        puts "$processes processes own $names names by a lease of $lease s, and watch all of them"

        set took [ask [lindex $pipes 0] finds daemon.[expr {$processes - 1}].0 100000]
        puts "a find takes [format %.0f $took] ns"
        promise "a find that is cached takes 1 us at most" [expr {$took <= 1000}]

        set from [spent [dict get $server pid]]
        set clients [spent [lmap pipe $pipes {pid $pipe}]]
        after [expr {1000 * $seconds}]
        set idle [percent $from [spent [dict get $server pid]] $seconds]
        set cost [percent $clients [spent [lmap pipe $pipes {pid $pipe}]] $seconds]
        puts "nothing happens: etcd takes $idle of a CPU, all processes together $cost"
        promise "less than 20 % each" [expr {[lindex $idle 0] < 20 && [lindex $cost 0] < 20}]

        # Another key with the same prefix, again and again. From before it is written, to the call in each process.
        set keep 1
        foreach pipe $pipes {
            ask $pipe turns
            set news($pipe) {}
        }
        set value [binary encode base64 {{"identity":"root@elsewhere","machine":"none","addresses":["/tmp/nowhere.sock"]}}]
        lassign [dict get $server ports] port
        for {set i 0} {$i < 100} {incr i} {
            set written($i) [clock microseconds]
            set body "{\"key\": \"[binary encode base64 lab/new.$i]\", \"value\": \"$value\"}"
            http::say 127.0.0.1 $port "POST /v3/kv/put HTTP/1.0\r\nContent-Length: [string length $body]\r\n\r\n$body"
            after 20
        }
        set late {}
        foreach pipe $pipes {
            waitFor {[ask $pipe turns] ne {} && [llength [lsearch -all -glob -index 0 $news($pipe) new.*]] == 100} 30000
            foreach told $news($pipe) {
                if {[regexp {^new\.(\d+)$} [lindex $told 0] -> i]} {
                    lappend late [expr {([lindex $told 1] - $written($i)) / 1000.0}]
                }
            }
        }
        puts "[llength $late] news: [format "%.1f ms, 99 of 100 in %.1f, at most %.1f" [quantile $late 0.5] [quantile $late 0.99] [quantile $late 1]]"
        promise "99 of 100 news come within 50 ms" [expr {[quantile $late 0.99] <= 50}]

        # A rolling restart: each gives its names back, and a new one claims them.
        set keep 0
        set from [spent [dict get $server pid]]
        set clients [expr {-[spent [lmap pipe $pipes {pid $pipe}]]}]
        set begun [clock milliseconds]
        for {set i 0} {$i < $processes} {incr i} {
            set pipe [lindex $pipes $i]
            ask $pipe release {*}[lmap k [lsearch -all [lrepeat $each x] x] {string cat daemon.$i.$k}]
            ask $pipe turns
            set clients [expr {$clients + [spent [pid $pipe]]}]
            catch {close $pipe}         ;# it may have news to tell
            lset pipes $i [begin]
            claimAll [lindex $pipes $i] $i
            after 1000
            foreach pipe $pipes {
                ask $pipe turns
            }
        }
        set ::names [expr {$names + 100}]
        knowAll $pipes
        set took [expr {([clock milliseconds] - $begun) / 1000.0}]
        set clients [percent 0 [expr {$clients + [spent [lmap pipe $pipes {pid $pipe}]]}] $took]
        set etcd [percent $from [spent [dict get $server pid]] $took]
        puts "a rolling restart of all in [format %.0f $took] s: etcd takes $etcd of a CPU, all processes together $clients"
        promise "less than 20 % each" [expr {[lindex $etcd 0] < 20 && [lindex $clients 0] < 20}]
        promise "all names are owned again" [expr {[llength [lsearch -all [lmap i [lsearch -all $pipes *] {ask [lindex $pipes $i] claimed daemon.$i.0}] "owned *"]] == $processes}]
    } finally {
        foreach pipe $pipes {
            catch {close $pipe}
        }
        etcd::endAll
    }
}
