# demoDaemons.tcl -- what the launch files of the demos say, for tests that start these daemons themselves.
#
# demoDaemons of FILE ?NAME ...?      dict: name of a daemon -> its words for sormad, with full paths; of all daemons, or of these
# demoDaemons options OBJECT ?TYPES?  of OBJECT, which may be NAME@DAEMON: dict of option -> its row of DBX -describe; only of these types

package require sorma::launchFile

namespace eval demoDaemons {
    variable Demos [file join [file dirname [file dirname [file dirname [file normalize [info script]]]]] demos]
    namespace export of options
    namespace ensemble create
}

proc demoDaemons::of {file args} {
    variable Demos
    set daemons {}
    dict for {name settings} [::sorma::launchFile::read [file join $Demos $file]] {
        if {$args ne {} && $name ni $args} continue
        set settings [lindex [dict values [dict get $settings members]] 0]
        set words {}
        foreach option {-dict -package -script -make -allow} {
            # Each of several files has its option.
            foreach value [expr {$option eq "-script" ? [list [dict get $settings -script]] : [dict get $settings $option]}] {
                if {$value ne {}} {
                    lappend words $option $value
                }
            }
        }
        dict set daemons $name $words
    }
    return $daemons
}

proc demoDaemons::options {object {types *}} {
    lassign [split $object @] name where
    set described [lindex [sorm[expr {$where eq {} ? {} : "@$where"}] DBX -describe $name] 3]
    set rows {}
    foreach row [dict get $described options] {
        if {$types eq "*" || [lindex $row 1] in $types} {
            dict set rows [lindex $row 0] $row
        }
    }
    return $rows
}
