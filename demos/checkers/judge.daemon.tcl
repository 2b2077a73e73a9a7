# judge.daemon.tcl -- of daemon judge: who counts what the robot believes and is not so.
source [file join [file dirname [file normalize [info script]]] packages.tcl]
package require sorma::service::judge
