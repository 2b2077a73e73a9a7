# launchMembers.tcl -- the daemons of one line of a launch file, for sorma-launch: one on each of its hosts, or one of them that serves (-one-of).
#
# Those of a line with -one-of serve the same name: the first that gets it in the directory serves, the others stand by. The line is ready
# when one of them serves. A host that is away stops nothing while another daemon runs.

package require sorma
package provide sorma::launchMembers 1.0

namespace eval ::sorma::launch {
    variable Lines {}       ;# dict: name in the file -> names of its daemons
    variable Shares {}      ;# dict: name in the file, of one with -one-of -> 1
    variable Waits {}       ;# dict: the same -> what is to come when nobody has got the name in time
}

# The daemons of all lines: dict of name, or name and host -> settings.
proc ::sorma::launch::members daemons {
    return [concat {*}[lmap {name settings} $daemons {dict get $settings members}]]
}

proc ::sorma::launch::group daemons {
    variable Lines
    variable Shares
    dict for {name settings} $daemons {
        dict set Lines $name [dict keys [dict get $settings members]]
        if {[dict get $settings -one-of]} {
            dict set Shares $name 1
        }
    }
}

# The name in the file.
proc ::sorma::launch::LineOf name {
    variable Lines
    dict for {line names} $Lines {
        if {$name in $names} {
            return $line
        }
    }
}

# The others that share its name, and have not ended.
proc ::sorma::launch::partners name {
    variable Lines
    variable Shares
    variable Daemons
    set line [LineOf $name]
    if {[dict exists $Shares $line]} {
        return [lmap other [dict get $Lines $line] {
            if {$other eq $name || [[dict get $Daemons $other] state] eq "ended"} continue
            set other
        }]
    }
}

# Are all daemons of these lines ready? If they share a name, one has to serve.
proc ::sorma::launch::allReady lines {
    variable Lines
    variable Shares
    variable Daemons
    variable Told
    foreach line $lines {
        set names [dict get $Lines $line]
        # Say it as well: a reader of the output wants the reason before its consequences.
        set ready [lmap name $names {
            if {[[dict get $Daemons $name] state] ne "ready" || ![dict exists $Told $name]} continue
            set name
        }]
        set shared [dict exists $Shares $line]
        if {$shared ? ![Owned $ready] : [llength $ready] < [llength $names]} {
            return 0
        }
    }
    return 1
}

proc ::sorma::launch::Owned names {
    variable Daemons
    foreach name $names {
        if {[[dict get $Daemons $name] owns]} {
            return 1
        }
    }
    return 0
}

# All lines are ready, and no daemon has yet to say that it stands by, or that it cannot.
proc ::sorma::launch::allSettled {} {
    variable Lines
    variable Daemons
    foreach daemon [dict values $Daemons] {
        if {![$daemon settled]} {
            return 0
        }
    }
    return [allReady [dict keys $Lines]]
}

# It is told when all stand by, and none gets the name.
proc ::sorma::launch::expectOwner name {
    variable Shares
    variable Waits
    variable Daemons
    set line [LineOf $name]
    if {[dict exists $Shares $line] && ![dict exists $Waits $line]} {
        dict set Waits $line [after [expr {round(1000 * [[dict get $Daemons $name] patience])}] [list ::sorma::launch::Unowned $line]]
    }
}

proc ::sorma::launch::Unowned line {
    variable Lines
    if {![stopping] && ![Owned [dict get $Lines $line]]} {
        say * "$line: nobody has got the name yet. Perhaps its directory does not answer, or another daemon has the name: sorm DBX -where @$line. They wait" 33
    }
}

# One that stood by serves.
proc ::sorma::launch::takesOver name {
    variable Daemons
    set before {}
    foreach other [partners $name] {
        if {[[dict get $Daemons $other] owns]} {
            [dict get $Daemons $other] former
            set before ", after $other"
        }
    }
    after 0 [list ::sorma::launch::TookOver $name $before]         ;# when its line has been shown
}

proc ::sorma::launch::TookOver {name before} {
    variable Daemons
    if {[[dict get $Daemons $name] owns]} {
        say * "$name serves$before"
        startDue
    }
}

# In which order daemons are ended: the last one started is the first. If some share a name, the one that serves comes after the
# others, so that the name does not pass through all of them.
proc ::sorma::launch::stopOrder started {
    variable Daemons
    set order {}
    foreach name [lreverse $started] {
        if {[[dict get $Daemons $name] owns]} {
            foreach other [partners $name] {
                if {$other in $started && $other ni $order} {
                    lappend order $other
                }
            }
        }
        if {$name ni $order} {
            lappend order $name
        }
    }
    return $order
}
