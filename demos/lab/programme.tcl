# programme.tcl ?-speed N? ?-short? ?-json FILE? -- a programme of motions in the laboratory, and the table that says how each of them went. Exit
# code 0: as it should.
#
# -speed N: of lab time: 1 (default) real time, 0 as fast as the machine can, as with -short.

source [file join [file dirname [file normalize [info script]]] .. measure.tcl]

namespace eval lab::programme {
    variable Down {0 1 0 0}             ;# the tool points at the table
}

# The tool's position now, and lab time.
proc lab::programme::tool {} {
    return [lrange [dict get [pino@robot exec status] floats] 0 2]
}
proc lab::programme::labTime {} {
    return [lindex [dict get [simlab@lab exec time] floats] 0]
}

# lab::programme::step WHAT EXPECTED SCRIPT -- one row: the script returns what was measured; EXPECTED: the error code's pattern.
proc lab::programme::step {what expected script} {
    measure row $what -error $expected -wanted $expected -body {
        set before [labTime]
        set failed [catch {uplevel 1 $script} result how]
        return -options $how [format {%6.2f s: %s} [expr {[labTime] - $before}] $result]
    }
}

proc lab::programme::run given {
    variable Down
    simlab@lab CTRL -speed [dict get $given -speed]
    step "power on" {} {pino@robot EXEC power on; set - "the arm holds"}
    step "to the middle of the table" {} {
        mvpos.line@robot exec -floats [concat {0.55 0 0.3} $Down]
        away {0.55 0 0.3}
    }
    step "the hand is weighed" {} {
        set found [calibrate@robot exec]
        set - "[format %.3f [lindex [dict get $found floats] 0]] kg"
    }
    foreach corner {{0.45 0.15 0.25} {0.65 0.15 0.25} {0.65 -0.15 0.25} {0.45 -0.15 0.25}} {
        step "line to $corner" {} {
            mvpos.line@robot exec -floats [concat $corner $Down]
            away $corner
        }
    }
    step "a dry run says what would happen" {} {
        mvpos.dry@robot CTRL -as pose -move line -dry
        dict get [mvpos.dry@robot exec -floats [concat {0.55 0 0.3} $Down]] text
    }
    step "a guard refuses the table" "ROBOT GUARD*" {mvpos.low@robot exec -floats [concat {0.55 0 0.01} $Down]}
    step "out of reach is refused" "ROBOT UNREACHABLE*" {mvpos.line@robot exec -floats [concat {1.4 0 0.3} $Down]}
    step "stopped on its way" "ROBOT STOPPED*" {
        set call [sorma::async mvpos.line@robot EXEC FMSG 7 0.6 0.2 0.35 {*}$Down]
        measure until {abs([lindex [tool] 1] + 0.15) > 0.03}
        mvpos.line@robot CTRL -stop
        $call take
    }
    step "down to the table, by feeling" {} {
        mvpos.line@robot exec -floats [concat {0.42 0.22 0.03} $Down]
        set reply [push.down@robot exec -floats {0.42 0.22 0.02 0.42 0.22 0.004}]
        set - "contact at [format %.2f [expr {1e3 * [lindex [dict get $reply floats] 2]}]] mm"
    }
    step "emergency stop: no power" "ROBOT POWER*" {
        set call [sorma::async mvpos.line@robot EXEC FMSG 7 0.5 -0.2 0.3 {*}$Down]
        measure until {[lindex [tool] 2] > 0.05}
        simlab@lab CTRL -emergencyStop
        $call take
    }
    step "power only after a reset" "ROBOT POWER*" {pino@robot EXEC power on}
    step "a person resets it" {} {simlab@lab CTRL -reset; pino@robot EXEC power on; set - "the arm holds"}
    step "park" {} {pino@robot EXEC park; set - "no power"}
}

# How far the tool is from where it should be, in millimetres.
proc lab::programme::away place {
    set square 0
    foreach is [tool] should $place {
        set square [expr {$square + ($is - $should) ** 2}]
    }
    return "[format %.2f [expr {1e3 * sqrt($square)}]] mm off"
}

exit [measure run {-speed {any 1}} {-speed 0} $argv lab::programme::run]
