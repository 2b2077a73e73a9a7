# faults.tcl -- what the scripts of this folder have in common. Each attacks a daemon of its own for as long as its argument
# says, and prints its counts. It exits with 1 when the daemon has not kept its promises. By hand, from the build folder:
#
#     ./env tclsh ../tests/faults/flood.tcl 20

package require tcltest
package require sorma
set supportFolder [file join [file dirname [file dirname [file normalize [info script]]]] support]
if {![info exists env(SORMA_RUNTIME_DIR)]} {
    set env(SORMA_RUNTIME_DIR) [exec mktemp -d /tmp/sorma-run-XXXXXX]
    set ownRuntimeFolder $env(SORMA_RUNTIME_DIR)
}
set env(XDG_CONFIG_HOME) [file join $env(SORMA_RUNTIME_DIR) config]
::tcltest::configure -tmpdir $env(SORMA_RUNTIME_DIR)
foreach file {wait.tcl daemon.tcl rpc.tcl} {
    source [file join $supportFolder $file]
}

set failures 0

# Run an attack, and leave nothing of it.
proc attack script {
    try {
        uplevel #0 $script
    } on error {message options} {
        puts stderr [dict get $options -errorinfo]
        incr ::failures
    } finally {
        daemon stopAll
        if {[info exists ::ownRuntimeFolder]} {
            file delete -force $::ownRuntimeFolder
        }
    }
    exit [expr {$::failures > 0}]
}

# A daemon that begins with these scripts.
proc serve args {
    set file [file join $::env(SORMA_RUNTIME_DIR) attacked.tcl]
    set f [open $file w]
    puts $f [join $args \n]
    close $f
    try {
        return [daemon start -tcp 1 -script $file]
    } finally {
        file delete $file
    }
}

# A promise: what it says, and whether it was kept.
proc promise {text kept} {
    puts "[expr {$kept ? "kept  " : "BROKEN"}] $text"
    incr ::failures [expr {!$kept}]
}

# Memory of a process that is its own [bytes].
proc memoryOf daemon {
    return [memoryOfProcess [daemon info $daemon pid]]
}
proc memoryOfProcess pid {
    set f [open /proc/$pid/status]
    set text [read $f]
    close $f
    regexp {RssAnon:\s+(\d+) kB} $text -> kilobytes
    return [expr {$kilobytes * 1024}]
}

proc megabytes bytes {
    return "[expr {$bytes / 1000000}] MB"
}

# The value of which a part [0 .. 1] of a list is not greater.
proc quantile {values part} {
    set sorted [lsort -real $values]
    return [lindex $sorted [expr {int($part * ([llength $sorted] - 1))}]]
}

# ---- programs beside the daemon: see tests/embed ----

# A client that sends these records again and again, by so many connections.
proc flooder {where name records {connections 1}} {
    set file [file join $::env(SORMA_RUNTIME_DIR) $name.records]
    set f [open $file wb]
    puts -nonewline $f $records
    close $f
    set pipe [open [list | [file join $::env(SORMA_BUILD) flooder] $where -records $file $connections 2>@stderr] r+]
    waitFor {[replies $pipe] > 0}
    file delete $file
    return $pipe
}
proc replies flooder {
    puts $flooder count
    flush $flooder
    return [gets $flooder]
}

# Somebody who calls each 2 ms, and what his calls took: see tests/embed/waits.cpp.
proc caller args {
    set pipe [open [list | [file join $::env(SORMA_BUILD) waits] {*}$args 2>@stderr] r+]
    set ::order [gets $pipe]
    return $pipe
}
proc endCaller {pipe waitsVar} {
    upvar 1 $waitsVar waits
    close $pipe write
    foreach line [split [string trim [read $pipe]] \n] {
        lappend waits(all) [lindex $line 0]
        lappend waits(computed) [lindex $line 1]
    }
    close $pipe
}
proc quantiles values {
    return [join [lmap part {0.5 0.9 0.99 0.999 1} {format %.2f [expr {[quantile $values $part] / 1000}]}] " "]
}
