# hour.tcl ?MINUTES? ?QUESTIONS? ?SEED? ?FILE? -- the daemons of the demos are recorded for an hour of real time, and then asked about that hour.
#
# The laboratory, the eyes of the tracker, and voice and player of the draughts run at a twentieth of their speed. 50 requests a second change
# and ask options. Some are refused, and now and then a new object comes. That needs a few per cent of a processor. A journal of our own says what each option
# was when. No answer of sorma::at may be wrong, and each must come within 50 ms. One that took longer is asked again, nine times at most: other
# programs of the machine may have held it up. SIGTERM ends the recording early. FILE keeps it, and FILE.journal what
# happened.

source [file join [file dirname [file normalize [info script]]] faults.tcl]
source [file join $supportFolder demoDaemons.tcl]
package require sorma::at
package require sorma::service::recorder

# ---- what happens ----

# An object and an option with a range: {NAME@DAEMON -OPTION LOW HIGH WHOLE}.
proc subjects objects {
    set found {}
    foreach object $objects {
        dict for {option row} [demoDaemons options $object {int double}] {
            if {![regexp {^(\S+) \.\. (\S+)$} [lindex $row 3] -> low high]} continue
            # Options that make work for the simulation stay as they are.
            if {$object eq "simlab@lab" && $option ni {-light -seed}} continue
            lappend found [list $object $option $low $high [expr {[lindex $row 1] eq "int"}]]
        }
    }
    return $found
}
proc now {} {
    return [clock microseconds]
}
proc pick list {
    return [lindex $list [expr {int(rand() * [llength $list])}]]
}
# journal: {OBJECT -OPTION} -> list of {before after value}; before and after are us. An empty value: there is no such object.
proc change subject {
    lassign $subject object option low high whole
    set value [expr {$low + rand() * ($high - $low)}]
    set value [if {$whole} {expr {int($value)}} else {format %.6g $value}]
    if {$value < $low || $value > $high} {
        set value $low
    }
    set before [now]
    if {[catch {$object CTRL $option $value}]} {
        incr ::refused
        return
    }
    # Numbers may be kept in a shorter form.
    dict lappend ::journal [list $object $option] [list $before [expr {[now] + 1}] $value]
    incr ::changes
}
proc arrive {} {
    set object mvpos.h[incr ::arrived]@robot
    set before [now]
    $object CTRL -speed 0.5
    dict set ::journal [list $object -speed] [list {0 0 {}} [list $before [expr {[now] + 1}] 0.5]]
}
proc act {} {
    if {[info exists ::done]} return
    after 100 act
    for {set i 0} {$i < 5} {incr i} {
        set subject [pick $::subjects]
        switch [expr {int(rand() * 5)}] {
            0 - 1 { change $subject }
            2 { catch {[lindex $subject 0] CTRL -nonsense 1} }
            default { [lindex $subject 0] DBX -get [lindex $subject 1] }
        }
        incr ::requests
    }
    if {rand() < 0.002} {
        arrive
    }
}

# ---- what is asked ----

proc seconds us {
    return [format %d.%06d [expr {$us / 1000000}] [expr {$us % 1000000}]]
}
# All that may be said of a moment: several values while a change was under way.
proc right {changes time} {
    set level [lindex $changes 0 2]
    set right {}
    foreach change [lrange $changes 1 end] {
        lassign $change before after value
        if {$before > $time} break
        if {$after > $time} {
            lappend right $level
        }
        set level $value
    }
    return [lappend right $level]
}
proc ask {way time object option} {
    switch $way {
        cget { return [sorma::at -file $::file [seconds $time] $object cget $option] }
        configure { return [dict get [sorma::at -file $::file [seconds $time] $object configure] $option] }
        -get { return [lindex [sorma::at -file $::file [seconds $time] $object DBX -get $option] 3] }
    }
}
proc asked {questions first last} {
    set wrong [set again 0]
    set times {}
    for {set q 0} {$q < $questions} {incr q} {
        lassign [set subject [pick [dict keys $::journal]]] object option
        set time [expr {$first + int(rand() * ($last - $first))}]
        set way [pick {cget configure -get}]
        set best {}
        for {set try 0} {$try < 10 && ($best eq {} || $best > 50000)} {incr try} {
            set begun [now]
            set failed [catch {ask $way $time $object $option} answer]
            set took [expr {[now] - $begun}]
            incr again [expr {$try > 0}]
            set best [expr {$best eq {} ? $took : min($best, $took)}]
        }
        lappend times $best
        if {$failed && [regexp {(no object|there was no) \S+} $answer]} {
            set answer {}
        }
        set fits 0
        foreach value [set right [right [dict get $::journal $subject] $time]] {
            set fits [expr {$fits || $answer eq $value || ([string is double -strict $answer] && [string is double -strict $value] && $answer == $value)}]
        }
        if {!$fits && [incr wrong] <= 20} {
            puts stderr "[seconds $time] $object $way $option: $answer, not [join $right { or }]"
        }
    }
    return [list $wrong $again [lsort -integer $times]]
}

# The processor time of our daemons, of the recorder and of this process [s].
proc processor pids {
    return [tcl::mathop::+ {*}[lmap pid $pids {daemon processor $pid}]]
}

attack {
    lassign [concat $argv [lrange [list 60 10000 4711 {}] [llength $argv] end]] minutes questions seed keep
    expr {srand($seed)}
    set file [expr {$keep ne {} ? [file normalize $keep] : [file join $env(SORMA_RUNTIME_DIR) hour.rec]}]
    file delete $file
    set journal {}
    set requests [set changes [set refused [set arrived 0]]]
    # Names of daemons are those of the demos: this folder is ours alone.
    set objects {simlab@lab mvpos.line@robot mvpos.low@robot mvpos.jog@robot push.down@robot carry@robot wspc.touch@robot getdisk@eye findbrdmarker@eye getbrdsit@eye
        transform@transform manus@hand findball.argus@argus psom.ball@sight draughts.engine@player checkers@player speaker@voice}
    cd $env(SORMA_RUNTIME_DIR)
    set daemons [dict merge [demoDaemons of lab/lab.launch] [demoDaemons of tracker/tracker.launch argus sight] [demoDaemons of checkers/checkers.launch laser voice player]]
    # Their scripts begin what has no partner here.
    dict for {name words} $daemons {
        daemon start -name $name {*}[concat {*}[lmap {option value} $words {
            if {$name in {argus sight} && $option eq "-script"} continue
            list $option $value
        }]]
    }
    simlab@lab CTRL -speed 0.05
    set subjects [subjects $objects]
    foreach subject $subjects {
        lassign $subject object option
        dict set journal [list $object $option] [list [list 0 0 [$object cget $option]]]
    }
    set pipe [open [list | sorma-record -o $file -daemon {*}[dict keys $daemons] 2>@stderr] r]
    gets $pipe
    set pids [concat [pid] [pid $pipe] [lmap name [dict keys $daemons] {daemon info $name pid}]]
    set used [processor $pids]
    set own [processor [pid $pipe]]
    sorma::atSignal {set done signal}
    set first [now]
    puts "recording [llength $subjects] options of [llength $objects] objects at [dict size $daemons] daemons"
    flush stdout
    after 60000 {puts "after a minute: [format %.1f [expr {100 * ([processor $pids] - $used) * 1e6 / ([now] - $first)}]] % of a processor, $requests requests"; flush stdout}
    after [expr {int(60000 * $minutes)}] {set done time}
    act
    vwait done
    set last [now]
    set percent [format %.1f [expr {100 * ([processor $pids] - $used) * 1e6 / ($last - $first)}]]
    set recorder [format %.2f [expr {100 * ([processor [pid $pipe]] - $own) * 1e6 / ($last - $first)}]]
    exec kill -INT [pid $pipe]
    read $pipe
    close $pipe
    puts "recorded [format %.1f [expr {($last - $first) / 6e7}]] minutes requests $requests changes $changes refused $refused arrived $arrived bytes [file size $file] processor_percent $percent of_that_recorder $recorder"
    flush stdout
    if {$keep ne {}} {
        set f [open $file.journal w]
        puts $f [list $first $last $journal]
        close $f
    }
    # The first one reads the index.
    set opened [lindex [time {catch {ask cget $last simlab@lab -light}}] 0]
    set used [processor [pid]]
    lassign [asked $questions $first $last] wrong again times
    set each [format %.1f [expr {1000 * ([processor [pid]] - $used) / ($questions + $again)}]]
    puts "questions $questions wrong $wrong open_us [expr {round($opened)}] p50_us [quantile $times 0.5] p99_us [quantile $times 0.99] most_us [lindex $times end] asked_again $again processor_ms_each $each"
    promise "no answer is wrong" [expr {$wrong == 0}]
    promise "each comes within 50 ms" [expr {[lindex $times end] <= 50000}]
}
