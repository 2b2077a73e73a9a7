# upgrade.tcl -- a client that lives through an upgrade: all that a daemon has acknowledged is there when the next one answers.
#
#     tclsh8.6 tests/upgrade.tcl FOLDER DAEMON...
#
# tests/packages starts it with daemons whose dictionary has `gain.kept -gain 0 -remember 1`, upgrades packages, and starts the
# daemons anew. It counts with each daemon until FOLDER has a file `enough`. When a daemon has acknowledged something, the file
# FOLDER/DAEMON.1.0.0 is made, with the number of its release. Writes "DAEMON: acknowledged N, kept N, by 1.0.0 1.0.1" for
# each; exits with 1 when anything was lost.
package require sorma

proc number daemon { lindex [gain.kept@$daemon cget -gain] 0 }
proc version daemon { lindex [regexp -inline {SORMA ([0-9.]+)} [gain.kept@$daemon DBX -version]] 1 }

set daemons [lassign $argv folder]
foreach daemon $daemons {
    set acknowledged($daemon) 0
    set seen($daemon) {}
    set lost($daemon) 0
}
while {![file exists [file join $folder enough]]} {
    foreach daemon $daemons {
        try {
            # It may have more than we know of: a request whose answer did not come.
            if {[number $daemon] < $acknowledged($daemon)} {
                puts "$daemon has [number $daemon], and has acknowledged $acknowledged($daemon)"
                incr lost($daemon)
            }
            gain.kept@$daemon CTRL -gain [expr {$acknowledged($daemon) + 1}]
            incr acknowledged($daemon)
            set version [version $daemon]
        } trap {SORMA COMM} {} - trap {SORMA ADDRESS UNRESOLVED} {} {
            continue                        ;# it is being started anew
        }
        if {$version ni $seen($daemon)} {
            lappend seen($daemon) $version
            close [open [file join $folder $daemon.$version] w]
        }
    }
    after 5
}
set code 0
foreach daemon $daemons {
    set kept [expr {int([number $daemon])}]
    puts "$daemon: acknowledged $acknowledged($daemon), kept $kept, by $seen($daemon)"
    if {$lost($daemon) > 0 || $kept < $acknowledged($daemon)} {
        set code 1
    }
}
exit $code
