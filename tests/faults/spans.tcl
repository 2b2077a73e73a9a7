# spans.tcl ?TREES? ?SEED? ?KILLS? ?LIES? -- traces of random trees through four daemons; of daemons that are killed meanwhile; and of a
# daemon that lies about spans.
#
# Each tree has calls one after another and beside each other, one-way requests, and events to which all daemons listen. The judge is the
# journal of the services. Each piece of work is there, in its place, as long as it was. The times add up to the whole within 2 %. They are
# also those of the journal, except where the machine has interrupted a service between the two clocks: at most in five of a hundred trees.
# Kills: each trace ends within its limit of spans, and the surviving daemons forget it. Lies: sizes, cycles, times that make no sense.

source [file join [file dirname [file normalize [info script]]] faults.tcl]
namespace import ::tcltest::makeFile
source [file join $supportFolder hops.tcl]
package require sorma::listing

proc count span {
    set n 1
    foreach c [dict get $span calls] { incr n [count $c] }
    return $n
}

proc sane span {
    foreach time {offset whole waiting running wire} {
        if {!([dict get $span $time] >= 0 && [dict get $span $time] < 1e16)} { return 0 }
    }
    foreach c [dict get $span calls] {
        if {![sane $c]} { return 0 }
    }
    return 1
}

attack {
    lassign [concat $argv [lrange {1000 35 100 500} [llength $argv] end]] trees seed kills lies
    expr {srand($seed)}
    set script [hops::script]
    set daemons [lmap i {1 2 3 4} {daemon start -script $script -package sorma::service::echo}]
    set a [lindex $daemons 0]

    hops::begin $daemons
    set spans 0
    set missing 0
    set slow 0
    set off 0
    for {set i 0} {$i < $trees} {incr i} {
        set text [hops::random]
        set told [sorma::trace -late 20000 {hop.top@$a EXEC TMSG $text}]
        incr spans [count [dict get $told tree]]
        set wrong [hops::judge [dict get $told tree] 1]
        set sums [lsearch -all -inline -regexp $wrong { of \S+ us$}]
        set times [lsearch -all -inline -regexp $wrong { (took|ran) }]
        if {[llength $wrong] > [llength $times] + [llength $sums]} {
            incr missing
            puts stderr "$text\n    $wrong"
        }
        incr slow [expr {[llength $times] > 0}]
        incr off [llength $sums]
    }
    puts "$trees trees of [expr {$spans / max($trees, 1)}] spans; $slow with a time that differs from the journal, $off times that do not add up"
    promise "each piece of work is there, in its place" [expr {$missing == 0}]
    promise "the times add up" [expr {$off == 0}]
    promise "the times are those of the journal" [expr {$slow <= $trees / 20}]
    hops::end

    # One daemon is killed and started anew, at random, while others are traced.
    set victim [lindex $daemons end]
    sorma::configure -timeout 2000
    set ended 0
    set most 0
    set failed 0
    for {set i 0} {$i < $kills} {incr i} {
        set text [hops::random]
        lappend text work [expr {int(rand() * 20)}] {} {*}[join [lmap d $daemons {list oneway hop.x@$d {work 5 {} call echo x}}]]
        set killer [open |[list sh -c "sleep 0.0[expr {int(rand() * 30)}]; kill -KILL [daemon info $victim pid]" 2>@stderr]]
        set told [sorma::trace -late 100 {hop.top@$a EXEC TMSG $text}]
        catch {close $killer}
        incr ended
        incr failed [dict get $told code]
        set most [expr {max($most, [count [dict get $told tree]])}]
        daemon kill $victim
        daemon start -name $victim -script $script -package sorma::service::echo
    }
    puts "$kills kills: $failed requests failed; $most spans at most"
    promise "each trace of a killed daemon ends" [expr {$ended == $kills && $most <= 1001}]
    set id [expr {$kills > 0 ? [dict get $told trace] : "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01"}]
    promise "the daemons forget it" [expr {![catch {
        foreach d $daemons { waitFor {[sorm@$d DBX -spans $id] eq {RET 0}} 30000 }
    }]}]

    set liar [open |[list [info nameofexecutable] [file join $supportFolder liar.tcl] lie 0 $seed 2>@stderr] r+]
    set port [gets $liar]
    set good 0
    set most 0
    set deepest 0
    for {set i 0} {$i < $lies} {incr i} {
        set told [sorma::trace -late 30 {nop@127.0.0.1:$port EXEC}]
        set tree [dict get $told tree]
        set n [count $tree]
        set most [expr {max($most, $n)}]
        incr good [expr {[dict get $told code] == 0 && $n <= 1002 && [sane $tree] && [string length [sorma::listing calls $tree]] > 0}]
    }
    catch {close $liar}
    puts "$lies lies: $most spans at most"
    promise "no lie is worse than a wrong trace" [expr {$good == $lies}]
}
