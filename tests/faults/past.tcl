# past.tcl ?QUESTIONS? ?MEGABYTES? ?SEED? -- random questions to past moments of a long recording, against a journal of our own.
#
# The recording has as many records as an hour of 1000 requests a second, if it has 700 MB. No answer may be wrong, and each must come within 50 ms. It
# is asked by its index, and once more without it.

source [file join [file dirname [file normalize [info script]]] faults.tcl]
package require sorma::service::recorder
oo::class create ::lamp {
    superclass sorma::Service
    sorma::option -level int
    sorma::option -colour string
}

attack {
    lassign [concat $argv [lrange {10000 700 4711} [llength $argv] end]] questions megabytes seed
    expr {srand($seed)}
    set file [file join $env(SORMA_RUNTIME_DIR) past.rec]
    for {set i 0} {$i < 200} {incr i} {
        sorma::create lamp.$i -level 0
    }
    sorma::create recorder.past -file $file -requests *
    recorder.past CTRL -record
    set first [clock microseconds]
    set journal [lrepeat 200 {}]
    # An object changes, and some others are called.
    while {[file size $file] < 1000000 * $megabytes} {
        set i [expr {int(200 * rand())}]
        set level [expr {int(1e6 * rand())}]
        set before [clock microseconds]
        lamp.$i configure -level $level
        lset journal $i end+1 [list $before [expr {[clock microseconds] + 1}] $level]
        for {set n 0} {$n < 200} {incr n} {
            echo EXEC FMSG 2 $n 1
        }
    }
    set last [clock microseconds]
    recorder.past CTRL -stop
    set about [lindex [recorder.past EXEC about] 3]
    set source [dict get [lindex [lindex [recorder.past EXEC records -name lamp.0] 3] 0] source]
    set cut $file.cut
    file link -hard $cut $file
    foreach way {index none} {
        if {$way eq "none"} {
            set f [open $cut r+]
            chan truncate $f [expr {[file size $cut] - 100}]
            close $f
        }
        set wrong 0
        set times {}
        set n [expr {$way eq "index" ? $questions : $questions / 10}]
        # The first one reads the index, or goes through the file.
        set opened [lindex [time {catch {recorder.past EXEC at [format %d.%06d [expr {$last / 1000000}] [expr {$last % 1000000}]] lamp.0 cget -level}}] 0]
        for {set q 0} {$q < $n} {incr q} {
            set i [expr {int(200 * rand())}]
            set t [expr {$first + int(rand() * ($last - $first))}]
            set level 0
            set right {}
            foreach change [lindex $journal $i] {
                lassign $change before behind next
                if {$before > $t} break
                if {$behind > $t} {
                    lappend right $level
                }
                set level $next
            }
            lappend right $level
            set begun [clock microseconds]
            catch {recorder.past EXEC at [format %d.%06d [expr {$t / 1000000}] [expr {$t % 1000000}]] lamp.$i[if {$way eq "none"} {string cat @$source}] cget -level} reply
            lappend times [expr {[clock microseconds] - $begun}]
            if {[lindex $reply 3] ni $right} {
                incr wrong
                puts stderr "lamp.$i at $t: $reply, not [join $right { or }]"
            }
        }
        set times [lsort -integer $times]
        puts "by $way records [dict get $about records] bytes [file size $file] questions $n wrong $wrong open_us [expr {round($opened)}] p50_us [lindex $times [expr {$n / 2}]] p99_us [lindex $times [expr {$n * 99 / 100}]] most_us [lindex $times end]"
        incr failures [expr {$wrong > 0 || [lindex $times [expr {$n * 99 / 100}]] > 50000}]
    }
}
