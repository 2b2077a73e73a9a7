# suite.tcl -- what every suite begins with: tcltest, sorma, and helpers that start daemons and wait for facts.

package require tcltest 2.3
namespace import -force ::tcltest::*
set supportFolder [file dirname [file normalize [info script]]]
if {![info exists env(SORMA_RUNTIME_DIR)]} {
    # A suite that is run by hand gets a folder of its own as well.
    set env(SORMA_RUNTIME_DIR) [exec mktemp -d /tmp/sorma-run-XXXXXX]
    set ownRuntimeFolder $env(SORMA_RUNTIME_DIR)
}
# No policy but what a test writes there, and nothing that a window or a prompt of the user has kept.
set env(XDG_CONFIG_HOME) [file join $env(SORMA_RUNTIME_DIR) config]
set env(XDG_STATE_HOME) [file join $env(SORMA_RUNTIME_DIR) state]
configure -verbose {body error} {*}$argv
package require sorma
source [file join $supportFolder wait.tcl]
source [file join $supportFolder daemon.tcl]
set suiteFailed 0

# tcltest's own, which also ends the daemons that a failed test has left. Windows keep their places when they end. tcltest would end the process
# if Tk were still there.
rename ::cleanupTests ::tcltestCleanup
proc ::cleanupTests {} {
    daemon stopAll
    catch {destroy .}
    file delete -force [file join $::env(SORMA_RUNTIME_DIR) state]
    set ::suiteFailed $::tcltest::numTests(Failed)
    ::tcltest::cleanupTests
    if {[info exists ::ownRuntimeFolder]} {
        file delete -force $::ownRuntimeFolder
    }
}

# Evaluate a script that fails; error code without SORMA, and message.
proc failure script {
    if {![catch {uplevel 1 $script} message options]} {
        return "ok: $message"
    }
    return [list [lrange [dict get $options -errorcode] 1 end] $message]
}

# suite overAllTransports nameVar where script: run script with nameVar holding what stands after @, for the daemon
# by Unix-domain socket and by TCP. Returns the list of results.
namespace eval suite {
    namespace export overAllTransports
    namespace ensemble create
}
proc suite::overAllTransports {daemon nameVar script} {
    upvar 1 $nameVar name
    set results {}
    foreach name [list $daemon [daemon info $daemon socket] 127.0.0.1:[daemon info $daemon port]] {
        lappend results [uplevel 1 $script]
    }
    return $results
}
