# player.daemon.tcl -- of daemon player: who plays for the robot.
foreach file {packages start} {
    source [file join [file dirname [file normalize [info script]]] $file.tcl]
}
package require sorma::service::checkers
package require sorma::service::boardsight
package require sorma::service::porter
# A new game begins when somebody says so (EXEC play), since the tokens must be set out before; an interrupted one goes on.
checkers::settle
if {[file exists [checkers cget -file]]} {
    checkers::start checkers
}
