# player.daemon.tcl -- of daemon player: who plays for the robot.
foreach file {plot sight porter start} {
    source [file join [file dirname [file normalize [info script]]] $file.tcl]
}
checkers::start checkers
