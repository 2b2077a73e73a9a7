# traces.tcl ?megabytes? -- what a stranger leaves behind by saying something very long. He says it in HELLO, in requests that are
# refused, in words and names, and in values that he puts again and again. megabytes: of the long text. A request with it is
# below the daemon's -maxmessage.

source [file join [file dirname [file normalize [info script]]] faults.tcl]

proc flood {c bytes} {
    # The daemon may hang up before it has all.
    catch {
        puts -nonewline $c $bytes
        flush $c
    }
}

attack {
    set megabytes [expr {$argc > 0 ? [lindex $argv 0] : 10}]
    set long [string repeat x [expr {$megabytes * 1000000}]]
    set d [serve "sorma::configure -maxmessage [expr {($megabytes + 1) << 20}] -budget [expr {20 * $megabytes << 20}]"]
    set port [daemon info $d port]
    echo@$d EXEC

    set base [memoryOf $d]
    set hello [rpc::hello 1 4711 {} 0 [string repeat p 32000000]]
    for {set i 0} {$i < 50} {incr i} {
        set c [rpc::connect $port]
        flood $c $hello
        waitFor {$rpc::Input($c,ended)}
        rpc::close $c
    }
    unset hello
    set more [expr {[memoryOf $d] - $base}]
    puts "50 long HELLOs: [megabytes $more]"
    promise "50 long HELLOs leave less than 2 MB" [expr {$more < 2000000}]

    # A text that is too long, in a record that is not.
    set c [rpc::connect $port]
    flood $c [rpc::hello 1 4711 {} 0 [string repeat p 257]]
    waitFor {$rpc::Input($c,ended)}
    promise "they are told why" [expr {[string first "the program in HELLO has 257 bytes; a text there has at most 256" $rpc::Input($c)] > 0}]
    rpc::close $c
    set c [rpc::connect $port]
    flood $c [rpc::hello 1 4711 {} 0 [string repeat p 256]]
    waitFor {[string length $rpc::Input($c)] > 100}
    promise "256 bytes are taken" [expr {!$rpc::Input($c,ended)}]
    rpc::close $c

    # The heap goes up and down by some of what it is asked for: the least of several looks is what stays.
    proc ask {c record} {
        flood $c $record
        waitFor {$rpc::Input($c) ne {} || $rpc::Input($c,ended)} 20000
        waitFor {[binary scan $rpc::Input($c) Iu mark] && [string length $rpc::Input($c)] == 4 + ($mark & 0x7fffffff)}
        set rpc::Answer $rpc::Input($c)
        set rpc::Input($c) {}
    }
    proc least records {
        set sizes {}
        for {set i 0} {$i < 20} {incr i} {
            ask $::c [lindex $records [expr {$i % [llength $records]}]]
            lappend sizes [memoryOf $::d]
        }
        return [tcl::mathfunc::min {*}$sizes]
    }
    # A daemon keeps three buffers of 4 MB.
    proc leaves {what records bytes} {
        set base [least $records]
        for {set i 0} {$i < 100} {incr i} {
            ask $::c [lindex $records [expr {$i % [llength $records]}]]
        }
        set more [expr {[least $records] - $base}]
        puts "100 requests with $what: [megabytes $more]"
        promise "100 requests with $what leave less than [megabytes $bytes]" [expr {$more < $bytes}]
    }
    set c [rpc::connect $port]
    ask $c [rpc::hello 1 4712]

    # Words and names have a limit of their own, and say which. A megabyte of words is taken.
    set most [string repeat x [expr {(1 << 20) - 16}]]
    set many [binary format I 65537][string repeat \0 [expr {4 * 65537}]]
    set bare [rpc::text {}][binary format III 0 0 0]
    foreach {what record said} [list \
        "a long word" [rpc::call 1 echo 1 [rpc::message {} {} [list -$long]]] "it may have 65536 words of 1048576 bytes: put what is long into TMSG" \
        "many words" [rpc::call 1 echo 0 $bare$many] "a request came with 65537 words of 262148 bytes in all" \
        "a long name" [rpc::call 1 [string repeat n 65537] 0] "a request came whose name has 65537 bytes; it may have 65536" \
        "a long pattern" [rpc::subscribe 1 1 echo [string repeat p 65537]] "a request came whose pattern has 65537 bytes" \
        "a megabyte of words" [rpc::call 1 echo 1 [rpc::message {} {} [list -delay $most]]] "OPTION VALUE" \
        "a name of 64 kB" [rpc::call 1 [string repeat n 65536] 0] "NAME UNKNOWN_CLASS" \
        "a long text" [rpc::call 1 echo 0 [rpc::message $long]] "the reply has"] {
        ask $c $record
        promise "$what: $said" [expr {[string first $said $rpc::Answer] > 0}]
    }

    leaves "a long word" [list [rpc::call 1 echo 1 [rpc::message {} {} [list -$long]]] [rpc::call 2 echo 2 [rpc::message {} {} [list -$long]]]] 12000000
    # An unknown word, and a name without a right, as long as they may be.
    set word -[string repeat x 1000000]
    leaves "a word of 1 MB" [list [rpc::call 1 echo 1 [rpc::message {} {} [list $word]]] [rpc::call 2 echo 2 [rpc::message {} {} [list $word]]] \
        [rpc::call 3 echo 1 [rpc::message {} {} [list -delay 0 $word]]] [rpc::call 4 dict 1 [rpc::message {} {} [list -load /$word]]]] 12000000
    # A word that is long is in another place each time: none of them is kept for the next one.
    set moving {}
    for {set i 0} {$i < 40} {incr i} {
        set words [lrepeat 40 {}]
        lset words $i $word
        lappend moving [rpc::call 1 echo 0 [rpc::message {} {} $words]]
    }
    leaves "a word of 1 MB in any place" $moving 12000000
    set texts [list [echo@$d DBX -audit] [sorm@$d DBX -denied] [echo@$d DBX -trail] [dict@$d DBX -trail]]
    puts "sizes of -audit, -denied, trails: [lmap text $texts {string length $text}]"
    promise "-audit, -denied and trails can be read" [expr {[llength [lsearch -all $texts "* bytes more*"]] >= 3 &&
        [tcl::mathfunc::max {*}[lmap text $texts {string length $text}]] < 150000}]

    # Values: one is kept, whatever was there before; with what keeps it, it goes.
    set base [memoryOf $d]
    leaves "a long value" [list [rpc::call 1 blackboard 0 [rpc::message $long {} {put v}]]] 12000000
    promise "one long value is kept" [expr {[memoryOf $d] - $base < [string length $long] + 14000000}]
    sorm@$d CTRL -remove blackboard
    promise "a long value is given back" [expr {[memoryOf $d] - $base < 14000000}]
    rpc::close $c
}
