# figures.tcl -- the tracker's table, each row for a minute and more; and daemons killed while the arm follows. Options as those of tracker.tcl.

source [file join [file dirname [file normalize [info script]]] tracker.tcl]

proc tracker::figures {} {
    rows::rest 60
    rows::sine 60
    rows::unpredicted 60
    rows::clocks 60
    rows::jumps 30
    rows::hidden 25
    rows::lost 10
    rows::distractors 120
    rows::push
    rows::press
    rows::cameras 30
    rows::quick 60
    rows::kill {argus sight} 40
    rows::interrupted {1 14 27}
}

exit [tracker::run tracker::figures]
