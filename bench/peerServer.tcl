# peerServer.tcl unix:PATH | tcp -- a daemon for harnesses that measure several systems alike: prints "ready ADDRESS".
#
# The client that goes with it: bench --client ADDRESS nop|rec. Needs a runtime folder of its own: SORMA_RUNTIME_DIR.

package require sorma
package require sorma::service::nop
package require sorma::service::echo

set where [lindex $argv 0]
if {[string match unix:* $where]} {
    set path [file normalize [string range $where 5 end]]
    sorma::serve peer[pid] -socket $path
    puts "ready $path"
} else {
    puts "ready 127.0.0.1:[dict get [sorma::serve peer[pid] -port 0] port]"
}
flush stdout
vwait forever
