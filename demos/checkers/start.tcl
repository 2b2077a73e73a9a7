# start.tcl -- for scripts of daemons: an object begins to play, with the settings that the file "settings" has in the daemon's folder:
# a dict, name of an object -> its options.

namespace eval ::checkers {}
proc ::checkers::start name {
    if {[file exists settings]} {
        set in [open settings]
        try {
            set settings [read $in]
        } finally {
            close $in
        }
        dict for {object options} $settings {
            if {[lindex [split $object .] 0] in [sorma::classes]} {
                $object configure {*}$options
            }
        }
    }
    after 0 [list sorma::async -timeout 0 -command ::checkers::ended $name EXEC play]
}
proc ::checkers::ended future {
    if {[catch {$future result} text how]} {
        puts stderr $text
    }
    $future destroy
}
