# player.daemon.tcl -- of daemon player: who plays for the robot.
foreach file {packages start} {
    source [file join [file dirname [file normalize [info script]]] $file.tcl]
}
package require sorma::service::checkers
package require sorma::service::sight
package require sorma::service::porter
checkers::start checkers
