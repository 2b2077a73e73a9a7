# webStop.tcl -- stop all that moves: the button on every page of sorma-web, and POST /stop.
#
# All daemons are asked at the same time for their objects, and for the table of each class. A class may have an action with -danger stop.
# This action is sent to its objects. The right to call an object is enough to stop it.

package require sorma::json
package require sorma::web
package require sorma::world
package provide sorma::webStop 1.0

namespace eval ::sorma::webStop {
    variable Runs {}            ;# dict: NUMBER -> {login open stopped failed}; open: questions without an answer
    variable Patience 2000      ;# ms for each question
}

# ::sorma::webStop::begin -- serve its route.
proc ::sorma::webStop::begin {} {
    ::sorma::web::route POST {^/stop$} ::sorma::webStop::Stop
}

proc ::sorma::webStop::Stop {number request args} {
    variable Runs
    dict set Runs $number [dict create login [dict get $request login] open 1 stopped {} failed {}]
    foreach daemon [::sorma::world keys] {
        if {$daemon ne "self" && [dict get [::sorma::world get $daemon] state] in {alive busy silent asking}} {
            Ask $number $daemon {sorm DBX -inventory objects} [list Objects $daemon]
        }
    }
    Done $number
}

proc ::sorma::webStop::Ask {number daemon request then} {
    variable Runs
    variable Patience
    dict with Runs $number {
        incr open
    }
    ::sorma::world ask $daemon $request -as "web [dict get $Runs $number login]" -timeout $Patience -command [list ::sorma::webStop::Heard $number $daemon $then]
}
proc ::sorma::webStop::Heard {number daemon then status value} {
    if {$status ne "ok"} {
        Note $number failed "$daemon: [lindex $value 0]"
    } elseif {[catch {{*}[lreplace $then 0 0 ::sorma::webStop::[lindex $then 0]] $number $value}]} {
        Note $number failed "$daemon: its answer makes no sense"
    }
    Done $number
}
proc ::sorma::webStop::Note {number list text} {
    variable Runs
    dict with Runs $number {
        lappend $list $text
    }
}

# Its objects, by class.
proc ::sorma::webStop::Objects {daemon number value} {
    set classes {}
    foreach row [dict get [dict get $value text] objects] {
        dict lappend classes [lindex $row 1] [lindex $row 0]
    }
    dict for {class objects} $classes {
        Ask $number $daemon [list sorm DBX -describe [lindex $objects 0]] [list Table $daemon $objects]
    }
}
proc ::sorma::webStop::Table {daemon objects number value} {
    dict for {word danger} [dict get [dict get $value text] danger] {
        if {$danger ne "stop" || ![string match -* $word]} continue
        foreach object $objects {
            Ask $number $daemon [list $object CTRL $word] [list Stopped $object@$daemon]
        }
    }
}
proc ::sorma::webStop::Stopped {name number value} {
    Note $number stopped $name
}

# One question less; the last one answers.
proc ::sorma::webStop::Done number {
    variable Runs
    dict with Runs $number {
        incr open -1
    }
    if {[dict get $Runs $number open] > 0} return
    set run [dict get $Runs $number]
    dict unset Runs $number
    ::sorma::web::json $number 200 [::sorma::json::object [concat {*}[lmap key {stopped failed} {list $key [::sorma::json::texts [dict get $run $key]]}]]]
}
