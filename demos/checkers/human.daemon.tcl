# human.daemon.tcl -- of daemon human: the person.
foreach file {people start} {
    source [file join [file dirname [file normalize [info script]]] $file.tcl]
}
checkers::start human.sim
