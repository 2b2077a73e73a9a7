# largeRecording.tcl ?GIGABYTES? ?FOLDER? -- a recording of 10 GB: how long does its list take, and a search of one name?
#
# A process records its own requests, 128 floats each, to a thousand objects by turns: each is called 1000 times, and then the next one. One more,
# echo.once, is called once in 2000 requests. The file is removed at the end. Beside each time stands the processor time of this process in it:
# on a busy machine that is what counts. By hand, from the build folder:
#
#     nice ionice ./env tclsh8.6 ../bench/largeRecording.tcl 10 /tmp

source [file join [file dirname [file normalize [info script]]] times.tcl]
package require sorma
package require sorma::service::recorder
package require sorma::service::echo

lassign [concat $argv [lrange {10 /tmp} [llength $argv] end]] gigabytes folder
set file [file join $folder large[pid].rec]
set failures 0

# The quickest of five, each with an object that has not seen the file.
proc best script {
    set times {}
    for {set i 0} {$i < 5} {incr i} {
        sorma::create recorder.large -file $::file
        lappend times [ms $script]
        sorma::remove recorder.large
    }
    return [lindex [lsort -real -index 0 $times] 0]
}
# times: of the clock and of the processor [ms].
proc row {what target times note} {
    lassign $times ms processor
    puts [format "%-46s %9.1f ms %9.1f ms  %s%s" $what $ms $processor $note [expr {$target eq {} ? {} : $ms < $target ? "  < $target" : "  NOT < $target"}]]
    incr ::failures [expr {$target ne {} && $ms >= $target}]
}
# Read what a search finds; most: so many pieces at most.
proc found {words {most 1000000000}} {
    set n 0
    set stream [sorma::stream [list recorder.large EXEC records {*}$words]]
    while {[incr most -1] >= 0 && [$stream next piece]} {
        incr n [llength [dict get $piece text]]
    }
    $stream close
    return $n
}
proc replay args {
    return [exec [file join $::env(SORMA_BUILD) sorma-replay] $::file {*}$args]
}

try {
    sorma::create recorder.large -file $file -requests echo.*
    recorder.large CTRL -record
    set floats [lrepeat 128 0.5]
    set took [ms {
        for {set n 0} {[file size $file] < 1e9 * $gigabytes} {incr n} {
            set object echo.[expr {$n % 1000}]
            for {set i 0} {$i < 1000} {incr i} {
                $object EXEC FMSG 128 {*}$floats
            }
            if {$n % 2} {
                echo.once EXEC IMSG 1 $n
            }
        }
    }]
    set said [recorder.large CTRL -stop]
    puts "[file size $file] bytes in [expr {round([lindex $took 0] / 1000)}] s: [lindex $said 3]"
    sorma::remove recorder.large

    set about {}
    row "what is in it (about)" 50 [best {set about [lindex [recorder.large EXEC about] 3]}] "[dict get $about records] records"
    row "the first piece of the list" 50 [best {set n [found {} 1]}] "$n records"
    row "search of one name, called 1000 times in a row" 1000 [best {set n [found {-name echo.500}]}] "$n records"
    row "search of one name, called once in 2000" 1000 [best {set n [found {-name echo.once}]}] "$n records"
    row "search of a name that is not there" 1000 [best {set n [found {-name nobody}]}] "$n records"
    row "sorma-replay -help, a program's start" {} [best {replay -help}] {}
    row "sorma-replay FILE -about" {} [best {replay -about}] {}
    row "sorma-replay FILE, its first line" {} [best {
        set pipe [open [list | [file join $env(SORMA_BUILD) sorma-replay] $file]]
        gets $pipe line
    }] {}
    catch {close $pipe}
    row "sorma-replay FILE -name echo.once" {} [best {set text [replay -name echo.once]}] "[llength [split $text \n]] lines"
} finally {
    file delete $file
}
exit [expr {$failures > 0}]
