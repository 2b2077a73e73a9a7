# child.tcl -- other processes for tests: each a tclsh with sorma that does what it is told.
#
# child start               -> name, when it is ready
# child ask NAME SCRIPT     -> list: code, result, error code
# child kill NAME           by SIGKILL; returns when it is gone
# child end NAME            it exits
# child endAll

namespace eval child {
    variable Running {}     ;# names, which are pipes
    namespace export start ask kill end endAll
    namespace ensemble create
}

proc child::start {} {
    variable Running
    set pipe [open [list | [info nameofexecutable] [file join $::supportFolder childMain.tcl] 2>@stderr] r+]
    fconfigure $pipe -buffering line
    lappend Running $pipe
    gets $pipe
    return $pipe
}

proc child::ask {pipe script} {
    puts $pipe [list $script]
    set answer {}
    while {[gets $pipe line] >= 0} {
        append answer $line \n
        if {[info complete $answer]} break
    }
    return [string range $answer 0 end-1]
}

proc child::kill pipe {
    exec sh -c {kill "$@"} kill -KILL [pid $pipe]
    Gone $pipe
}

proc child::end pipe {
    puts $pipe exit
    Gone $pipe
}

proc child::endAll {} {
    variable Running
    foreach pipe $Running {
        kill $pipe
    }
}

# Closing waits for its end.
proc child::Gone pipe {
    variable Running
    set Running [lsearch -all -inline -not -exact $Running $pipe]
    catch {close $pipe}
}
