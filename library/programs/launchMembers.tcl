# launchMembers.tcl -- the daemons of one line of a launch file, for sorma-launch: one on each of its hosts, or one of them that serves (-one-of).
#
# Those of a line with -one-of serve the same name: the first that gets it in the directory serves, the others stand by. The line is ready
# when one of them serves. A host that is away stops nothing while another daemon runs.

package require sorma
package provide sorma::launchMembers 1.0

namespace eval ::sorma::launch {}

# The daemons of all lines: dict of name, or name and host -> settings.
proc ::sorma::launch::members daemons {
    return [concat {*}[lmap {name settings} $daemons {dict get $settings members}]]
}

# The part of a launcher that knows them.
oo::class create ::sorma::launch::lines {
    variable Daemons Told   ;# of the launcher
    variable Lines          ;# dict: name in the file -> names of its daemons
    variable Shares         ;# dict: name in the file, of one with -one-of -> 1
    variable Waits          ;# dict: the same -> what is to come when nobody has got the name in time

    constructor {} {
        set Lines [set Shares [set Waits {}]]
    }
    method group daemons {
        dict for {name settings} $daemons {
            dict set Lines $name [dict keys [dict get $settings members]]
            if {[dict get $settings -one-of]} {
                dict set Shares $name 1
            }
        }
    }

    # The name in the file.
    method LineOf name {
        dict for {line names} $Lines {
            if {$name in $names} {
                return $line
            }
        }
    }

    # The others that share its name, and have not ended.
    method partners name {
        set line [my LineOf $name]
        if {[dict exists $Shares $line]} {
            return [lmap other [dict get $Lines $line] {
                if {$other eq $name || [[dict get $Daemons $other] state] eq "ended"} continue
                set other
            }]
        }
    }

    # Are all daemons of these lines ready? If they share a name, one has to serve.
    method allReady lines {
        foreach line $lines {
            set names [dict get $Lines $line]
            # Say it as well: a reader of the output wants the reason before its consequences.
            set ready [lmap name $names {
                if {[[dict get $Daemons $name] state] ne "ready" || ![dict exists $Told $name]} continue
                set name
            }]
            set shared [dict exists $Shares $line]
            if {$shared ? ![my Owned $ready] : [llength $ready] < [llength $names]} {
                return 0
            }
        }
        return 1
    }

    method Owned names {
        foreach name $names {
            if {[[dict get $Daemons $name] owns]} {
                return 1
            }
        }
        return 0
    }

    # All lines are ready, and no daemon has yet to say that it stands by, or that it cannot.
    method allSettled {} {
        foreach daemon [dict values $Daemons] {
            if {![$daemon settled]} {
                return 0
            }
        }
        return [my allReady [dict keys $Lines]]
    }

    # It is told when all stand by, and none gets the name.
    method expectOwner name {
        set line [my LineOf $name]
        if {[dict exists $Shares $line] && ![dict exists $Waits $line]} {
            dict set Waits $line [after [expr {round(1000 * [[dict get $Daemons $name] patience])}] [namespace code [list my Unowned $line]]]
        }
    }

    method Unowned line {
        if {![my stopping] && ![my Owned [dict get $Lines $line]]} {
            my say * "$line: nobody has got the name yet. Perhaps its directory does not answer, or another daemon has the name: sorm DBX -where @$line. They wait" 33
        }
    }

    # One that stood by serves.
    method takesOver name {
        set before {}
        foreach other [my partners $name] {
            if {[[dict get $Daemons $other] owns]} {
                [dict get $Daemons $other] former
                set before ", after $other"
            }
        }
        after 0 [namespace code [list my TookOver $name $before]]         ;# when its line has been shown
    }

    method TookOver {name before} {
        if {[[dict get $Daemons $name] owns]} {
            my say * "$name serves$before"
            my startDue
        }
    }

    # In which order daemons are ended: the last one started is the first. If some share a name, the one that serves comes after the
    # others, so that the name does not pass through all of them.
    method stopOrder started {
        set order {}
        foreach name [lreverse $started] {
            if {[[dict get $Daemons $name] owns]} {
                foreach other [my partners $name] {
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
}
