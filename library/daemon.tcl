# daemon.tcl -- the program sormad: a tclsh that serves its repository until it is told to end.
#
# ::sorma::daemonMain reads the command line, makes the daemon, says that it is ready, and serves.

namespace eval ::sorma {
    variable DaemonUsage {usage: sormad -name NAME ?option value ...?
  -name NAME          name of the daemon: others write SO@NAME; letters, digits, _ - .
  -port NUMBER        also listen on TCP; 0 picks a free port               (default: no TCP)
  -host NAME          interface for TCP                                     (default: 127.0.0.1)
  -socket PATH        Unix-domain socket              (default: NAME.sock in the runtime folder)
  -rpcbind BOOLEAN    register the TCP port with this host's rpcbind        (default: 0)
  -program NUMBER     program number there, from 0x20000000                 (default: first free)
  -dict FILE ...      dictionaries to load
  -package NAME ...   Tcl packages to load, such as sorma::service::echo
  -script FILE        Tcl script to run before the daemon is ready
  -log FILE           where background errors are noted                     (default: standard error)
  -help               this text
When it can be called it prints: ready NAME tcp=PORT unix=PATH program=0xN (the parts that apply).
SIGTERM and SIGINT end it; exit code 0.}
    variable DaemonEnd      ;# set by a signal: how the daemon ended
}

# ::sorma::daemonMain --
#       Run the program sormad.
# Arguments:
#       words   command line, as DaemonUsage says
# Results:
#       Exit code of the program: 0 after a signal, 1 when the daemon could not be made, 2 for a bad command line.
proc ::sorma::daemonMain words {
    variable DaemonEnd
    variable DaemonUsage
    if {"-help" in $words || "--help" in $words} {
        puts $DaemonUsage
        return 0
    }
    try {
        set settings [ParseDaemonWords $words]
    } on error message {
        puts stderr "sormad: $message"
        puts stderr $DaemonUsage
        return 2
    }
    try {
        AtSignal ::sorma::EndDaemon
        StartDaemon $settings
    } on error message {
        puts stderr "sormad: $message"
        return 1
    }
    if {![info exists DaemonEnd]} {
        vwait ::sorma::DaemonEnd
    }
    set name [dict get $settings -name]
    try {
        unserve $name "daemon $name was told to end"
    } trap {SORMA SERVICE GONE} {} {
        # a service of ours has ended the serving before
    }
    return 0
}

# A service that waits in an event loop of its own keeps the daemon from ending: it gets a while, no more.
proc ::sorma::EndDaemon {} {
    variable DaemonEnd signal
    after 5000 {
        puts stderr "sormad: told to end, but a request did not end in 5 s"
        exit 1
    }
}

# Read the command line into a dict: option -> value, or list of values for -dict and -package.
proc ::sorma::ParseDaemonWords words {
    set settings [dict create -name {} -dict {} -package {} -script {} -log {} -serve {}]
    while {[llength $words] > 0} {
        set words [lassign $words option]
        switch -- $option {
            -name - -script - -log - -port - -host - -socket - -rpcbind - -program {
                if {[llength $words] == 0} {
                    return -code error "$option needs a value"
                }
                set words [lassign $words value]
                if {$option in {-name -script -log}} {
                    dict set settings $option $value
                } else {
                    dict lappend settings -serve $option $value
                }
            }
            -dict - -package {
                set before [llength [dict get $settings $option]]
                while {[llength $words] > 0 && ![string match -* [lindex $words 0]]} {
                    set words [lassign $words value]
                    dict lappend settings $option $value
                }
                if {[llength [dict get $settings $option]] == $before} {
                    return -code error "$option needs a value"
                }
            }
            default {
                return -code error "unknown option \"$option\""
            }
        }
    }
    if {[dict get $settings -name] eq {}} {
        return -code error "-name is missing"
    }
    return $settings
}

# Load what the daemon needs, serve, and say so. On an error nothing is served.
proc ::sorma::StartDaemon settings {
    if {[dict get $settings -log] ne {}} {
        set log [open [dict get $settings -log] a]
        fconfigure $log -buffering line -encoding utf-8
    } else {
        set log stderr
    }
    interp bgerror {} [list ::sorma::NoteBackgroundError $log]
    JoinDict
    foreach file [dict get $settings -dict] {
        ::sorma::so::dict CTRL -load $file
    }
    foreach package [dict get $settings -package] {
        package require $package
    }
    if {[dict get $settings -script] ne {}} {
        uplevel #0 [list source -encoding utf-8 [dict get $settings -script]]
    }
    set served [serve [dict get $settings -name] {*}[dict get $settings -serve]]
    set line "ready [dict get $served name]"
    if {[dict get $served port] ne {}} {
        append line " tcp=[dict get $served port]"
    }
    append line " unix=[dict get $served socket]"
    if {[dict get $served program] ne {}} {
        append line " program=[dict get $served program]"
    }
    puts $line
    flush stdout
}

proc ::sorma::NoteBackgroundError {log message options} {
    puts $log "[clock format [clock seconds] -format {%Y-%m-%d %H:%M:%S}] background error: $message"
    if {[dict exists $options -errorinfo]} {
        puts $log [dict get $options -errorinfo]
    }
}
