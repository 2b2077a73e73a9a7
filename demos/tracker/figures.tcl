# figures.tcl -- the tracker's table, each row for a minute and more; and daemons killed while the arm follows. Options as those of tracker.tcl.

source [file join [file dirname [file normalize [info script]]] tracker.tcl]

proc tracker::figures {} {
    rows::rest 60
    rows::sine 60
    rows::jumps 30
    rows::hidden 25
    rows::lost 10
    rows::push
    rows::kill argus 20
    rows::kill sight 20
}

exit [tracker::run tracker::figures]
