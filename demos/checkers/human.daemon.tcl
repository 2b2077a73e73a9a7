# human.daemon.tcl -- of daemon human: the person.
foreach file {packages start} {
    source [file join [file dirname [file normalize [info script]]] $file.tcl]
}
package require sorma::service::human
checkers::settle
checkers::start human.sim
