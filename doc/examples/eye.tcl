# eye.tcl -- looks ten times a second, and writes the place of the target [m] to the board.

proc look {} {
    after 100 look
    set t [expr {[clock milliseconds] % 100000 / 1000.0}]
    BLACKBOARD.cell exec -floats [list [expr {0.4 * cos($t)}] [expr {0.4 * sin($t)}]] put target
}
look
puts "the target is on the board"
