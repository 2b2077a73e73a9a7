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
  -allow LINE         a line of the policy, such as "host 192.168.7.0/24 tune"; may be repeated
  -policy FILE        the policy: who may do what              (default: ~/.config/sorma/policy)
  -share BOOLEAN      let other users of this host connect to the Unix-domain socket (default: 0)
  -dict FILE ...      dictionaries to load
  -package NAME ...   Tcl packages to load, such as sorma::service::echo
  -script FILE        Tcl script to run before the daemon is ready
  -log FILE           where background errors are noted                     (default: standard error)
  -interactive        serve, and give scott's prompt on this terminal; the daemon ends with it
  -until-eof          end when standard input ends: with whoever has started it, also over ssh
  -inetd              serve the socket that is standard input: one connection, or a listener (inetd's "wait")
  -idle SECONDS       end when there has been no connection for so long     (default: 0, never)
  -help               this text
When it can be called it prints: ready NAME tcp=PORT unix=PATH program=0xN (the parts that apply).
SIGTERM and SIGINT end it; exit code 0. Listening sockets that systemd passes are used in place of new ones.}
    variable DaemonEnd      ;# set once: how the daemon ended
    variable Grace 5000     ;# ms for requests to end when the daemon has been told to
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
    variable Grace
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
        if {[dict get $settings -until-eof]} {
            UntilEof $Grace
        }
        StartDaemon $settings [InheritedSockets [dict get $settings -inetd]]
    } on error message {
        puts stderr "sormad: $message"
        return 1
    }
    set name [dict get $settings -name]
    if {![info exists DaemonEnd] && [dict get $settings -interactive]} {
        Prompt $name
    } elseif {![info exists DaemonEnd]} {
        vwait ::sorma::DaemonEnd
    }
    StopServing $name
    return 0
}

proc ::sorma::StopServing name {
    try {
        unserve $name "daemon $name was told to end"
    } trap {SORMA SERVICE GONE} {} {
        # a service of ours has ended the serving before
    }
}

# scott's prompt, inside the daemon: until Ctrl-D there, or until the daemon is told to end.
proc ::sorma::Prompt name {
    variable library
    source -encoding utf-8 [file join $library scott.tcl]
    # Who waits for a line hears of nothing else; the exit puts the terminal's settings back.
    trace add variable ::sorma::DaemonEnd write [list apply {{name args} {
        after 0 [list apply {name {
            ::sorma::StopServing $name
            puts {}
            exit 0
        }} $name]
    }} $name]
    scott::interact
    trace remove variable ::sorma::DaemonEnd write [lindex [trace info variable ::sorma::DaemonEnd] 0 1]
}

# A service that waits in an event loop of its own keeps the daemon from ending: it gets a while, no more.
proc ::sorma::EndDaemon {} {
    variable DaemonEnd
    variable Grace
    if {[info exists DaemonEnd]} {
        return
    }
    set DaemonEnd signal
    Notify "STOPPING=1\nSTATUS=told to end"
    after $Grace {
        puts stderr "sormad: told to end, but a request did not end in 5 s"
        exit 1
    }
}

# Read the command line into a dict: option -> value, or list of values for -dict and -package.
proc ::sorma::ParseDaemonWords words {
    set settings [dict create -name {} -dict {} -package {} -script {} -log {} -until-eof 0 -inetd 0 -idle 0 \
        -interactive 0 -serve {}]
    while {[llength $words] > 0} {
        set words [lassign $words option]
        switch -- $option {
            -until-eof - -inetd - -interactive {
                dict set settings $option 1
            }
            -name - -script - -log - -idle - -port - -host - -socket - -rpcbind - -program - -allow - -policy - -share {
                if {[llength $words] == 0} {
                    return -code error "$option needs a value"
                }
                set words [lassign $words value]
                if {$option eq "-idle" && (![string is double -strict $value] || !($value >= 0 && $value < 1e9))} {
                    return -code error "-idle expects seconds, 0 or more, got \"$value\""
                }
                if {$option in {-name -script -log -idle}} {
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
    if {[dict get $settings -interactive]} {
        foreach option {-until-eof -inetd} {
            if {[dict get $settings $option]} {
                return -code error "either -interactive or $option, not both: standard input is one thing"
            }
        }
        if {[catch {fconfigure stdin -mode}]} {
            return -code error "-interactive needs a terminal as standard input"
        }
    }
    return $settings
}

# Sockets that whoever has started this process has opened for it: systemd says so in the environment
# (sd_listen_fds(3)), inetd gives one as standard input. Returns options for sorma::serve.
proc ::sorma::InheritedSockets inetd {
    global env
    set listen {}
    set options {}
    if {[info exists env(LISTEN_PID)] && $env(LISTEN_PID) eq [pid]} {
        if {![info exists env(LISTEN_FDS)] || ![regexp {^\d{1,4}$} $env(LISTEN_FDS)]} {
            return -code error "LISTEN_FDS must be the number of sockets that are passed"
        }
        set names {}
        if {[info exists env(LISTEN_FDNAMES)]} {
            set names [split $env(LISTEN_FDNAMES) :]
        }
        for {set k 0; set fd 3} {$k < $env(LISTEN_FDS)} {incr k; incr fd} {
            CloseAtExec $fd
            if {[lindex $names $k] eq "connection"} {   ;# a socket unit with Accept=yes
                lappend options -connection $fd
            } else {
                lappend listen $fd
            }
        }
    }
    unset -nocomplain env(LISTEN_PID) env(LISTEN_FDS) env(LISTEN_FDNAMES)
    if {$inetd} {
        lassign [TakeSocket] fd listens
        if {$listens} {
            lappend listen $fd
        } else {
            lappend options -connection $fd
        }
    }
    if {[llength $listen] > 0} {
        lappend options -listen $listen
    }
    return $options
}

# Load what the daemon needs, serve, and say so. On an error nothing is served.
proc ::sorma::StartDaemon {settings inherited} {
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
    if {[dict exists $inherited -connection]} {
        subscribe sorm -event connection.closed -command ::sorma::ConnectionEnded
    }
    # A class in Tcl becomes known when it is first named. Those who look around want to see it before.
    foreach class [classes] {
        catch {Aside [list ::sorma::so::sorm DBX -describe $class]}
    }
    set served [serve [dict get $settings -name] {*}[dict get $settings -serve] {*}$inherited]
    if {[dict get $settings -idle] > 0} {
        WatchIdle [expr {round(1000 * [dict get $settings -idle])}]
    }
    set line "ready [dict get $served name]"
    if {[dict get $served port] ne {}} {
        append line " tcp=[dict get $served port]"
    }
    if {[dict get $served socket] ne {}} {
        append line " unix=[dict get $served socket]"
    }
    if {[dict get $served program] ne {}} {
        append line " program=[dict get $served program]"
    }
    puts $line
    flush stdout
    Notify "READY=1\nSTATUS=$line"
    StartWatchdog
}

# The one connection for which the daemon was made has ended.
proc ::sorma::ConnectionEnded args {
    variable DaemonEnd connection
}

# Each time a connection has ended, see after a while whether there is one.
proc ::sorma::WatchIdle milliseconds {
    subscribe sorm -event connection.closed -command [list ::sorma::AfterIdle $milliseconds]
    AfterIdle $milliseconds
}

proc ::sorma::AfterIdle {milliseconds args} {
    after cancel ::sorma::CheckIdle
    after $milliseconds ::sorma::CheckIdle
}

# again: who has come while this process did not run is let in first.
proc ::sorma::CheckIdle {{again 1}} {
    variable DaemonEnd
    if {$again} {
        after 1 {::sorma::CheckIdle 0}
    } elseif {![regexp -line {^from } [lindex [::sorma::so::sorm CTRL -connections] 3]]} {
        Notify "STOPPING=1\nSTATUS=idle"
        set DaemonEnd idle
    }
}

# Tell systemd regularly that the event loop turns (WatchdogSec=), twice as often as it wants to hear it.
proc ::sorma::StartWatchdog {} {
    global env
    if {![info exists env(WATCHDOG_USEC)] || ![string is wideinteger -strict $env(WATCHDOG_USEC)] ||
            ([info exists env(WATCHDOG_PID)] && $env(WATCHDOG_PID) ne [pid])} {
        return
    }
    Watchdog [expr {max(1, $env(WATCHDOG_USEC) / 2000)}]
}

proc ::sorma::Watchdog milliseconds {
    Notify WATCHDOG=1
    after $milliseconds [list ::sorma::Watchdog $milliseconds]
}

proc ::sorma::NoteBackgroundError {log message options} {
    puts $log "[clock format [clock seconds] -format {%Y-%m-%d %H:%M:%S}] background error: $message"
    if {[dict exists $options -errorinfo]} {
        puts $log [dict get $options -errorinfo]
    }
}
