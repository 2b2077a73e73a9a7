# daemon.tcl -- the program sormad: a tclsh that serves its repository until it is told to end.
#
# ::sorma::daemon::main reads the command line, makes the daemon, says that it is ready, and serves.

package require sorma
package require sorma::options
package require sorma::packages
package require sorma::text
package require sorma::usage
package provide sorma::daemon 1.0

namespace eval ::sorma::daemon {
    # Options of sorma::serve, which checks their values.
    variable ForServe {
        -port any  -host any  -socket any  -rpcbind any  -program any  -allow collect  -policy any  -open any  -share any  -tls any  -directory any  -standby any  -owned collect
    }
    # The options in the manual of sormad.
    variable Options [concat {
        -name {{word {a name}}}  -dict words  -path words  -package words  -make words  -script word  -log word  -idle {{seconds 0 1e9} 0}  -grace {{seconds 0 86400} 5}
        -selftest {{seconds 0 86400} 0}  -interactive flag  -until-eof flag  -inetd flag  -strict {boolean 0}  -metrics {{whole 0 65535}}  -scpi {{a place}}  -vxi11 {{a place}}
        -help flag  --help flag
    } $ForServe]
    variable End            ;# set once: how the daemon ended
    variable Grace 5        ;# s for requests to end when the daemon has been told to
    variable Waits          ;# set while this daemon stands by: its name
}

# ::sorma::daemon::main --
#       Run the program sormad.
# Arguments:
#       words   command line, as DaemonUsage says
# Results:
#       Exit code of the program: 0 after a signal, 1 when the daemon could not be made, 2 for a bad command line.
proc ::sorma::daemon::main words {
    ::sorma::options::suggest ::sorma::DidYouMean
    variable End
    variable Grace
    variable Waits
    if {"-help" in $words || "--help" in $words} {
        puts [::sorma::usage::program sormad]
        return 0
    }
    try {
        set settings [Parse $words]
    } on error message {
        puts stderr [::sorma::usage::refused sormad $message]
        return 2
    }
    set Grace [dict get $settings -grace]
    try {
        ::sorma::atSignal ::sorma::daemon::EndBySignal
        if {[dict get $settings -until-eof]} {
            ::sorma::UntilEof [expr {round(1000 * $Grace)}]
        }
        Start $settings [InheritedSockets [dict get $settings -inetd]]
    } on error message {
        if {[info exists End] && [info exists Waits]} {
            return 0
        }
        puts stderr "sormad: $message"
        return 1
    }
    set name [dict get $settings -name]
    if {![info exists End] && [dict get $settings -interactive]} {
        Prompt $name
    } elseif {![info exists End]} {
        vwait ::sorma::daemon::End
    }
    StopServing $name
    return 0
}

proc ::sorma::daemon::StopServing name {
    if {[namespace exists ::sorma::vxi11Port]} {
        ::sorma::vxi11Port::close
    }
    if {[namespace exists ::sorma::announce]} {
        ::sorma::announce::end
    }
    try {
        ::sorma::unserve $name "daemon $name was told to end"
    } trap {SORMA SERVICE GONE} {} {
        # a service of ours has ended the serving before
    }
}

# scott's prompt, inside the daemon: until Ctrl-D there, or until the daemon is told to end.
proc ::sorma::daemon::Prompt name {
    package require sorma::scott
    # A process that waits for a line gets no other events; the exit restores the terminal's settings.
    trace add variable ::sorma::daemon::End write [list apply {{name args} {
        after 0 [list apply {name {
            ::sorma::daemon::StopServing $name
            puts {}
            exit 0
        }} $name]
    }} $name]
    ::sorma::scott::interact
    trace remove variable ::sorma::daemon::End write [lindex [trace info variable ::sorma::daemon::End] 0 1]
}

# A service that waits in an event loop of its own keeps the daemon from ending: it gets a while, and then the daemon ends.
proc ::sorma::daemon::EndBySignal {} {
    variable End
    variable Grace
    variable Waits
    if {[info exists End]} {
        return
    }
    set End signal
    ::sorma::Notify "STOPPING=1\nSTATUS=told to end"
    if {[info exists Waits]} {
        StopServing $Waits          ;# or sorma::serve would wait for the name
    }
    after [expr {round(1000 * $Grace)}] {
        puts stderr "sormad: told to end, but a request did not end in $::sorma::daemon::Grace s"
        exit 1
    }
}

# Read the command line into a dict: option -> value; -serve: those for sorma::serve.
proc ::sorma::daemon::Parse words {
    variable Options
    variable ForServe
    set settings [dict remove [::sorma::options::defaults $Options] {*}[dict keys $ForServe]]
    set settings [::sorma::options::take $Options $settings $words]
    if {[dict get $settings -name] eq {}} {
        return -code error "-name is missing"
    }
    if {[dict get $settings -interactive]} {
        foreach option {-until-eof -inetd} {
            if {[dict get $settings $option]} {
                return -code error "-interactive and $option cannot be combined: both use standard input"
            }
        }
        if {![::sorma::text::isTerminal stdin]} {
            return -code error "-interactive needs a terminal as standard input"
        }
    }
    dict set settings -serve {}
    dict for {option type} $ForServe {
        if {[dict exists $settings $option]} {
            foreach value [if {$type eq {collect}} {dict get $settings $option} else {list [dict get $settings $option]}] {
                dict lappend settings -serve $option $value
            }
        }
    }
    return $settings
}

# Sockets that the starter of this process has opened for it: systemd says so in the environment
# (sd_listen_fds(3)), inetd gives one as standard input. Returns options for sorma::serve.
proc ::sorma::daemon::InheritedSockets inetd {
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
            ::sorma::CloseAtExec $fd
            if {[lindex $names $k] eq "connection"} {   ;# a socket unit with Accept=yes
                lappend options -connection $fd
            } else {
                lappend listen $fd
            }
        }
    }
    unset -nocomplain env(LISTEN_PID) env(LISTEN_FDS) env(LISTEN_FDNAMES)
    if {$inetd} {
        lassign [::sorma::TakeSocket] fd listens
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
proc ::sorma::daemon::Start {settings inherited} {
    if {[dict get $settings -log] ne {}} {
        set log [open [dict get $settings -log] a]
        fconfigure $log -buffering line -encoding utf-8
    } else {
        set log stderr
    }
    interp bgerror {} [list ::sorma::daemon::NoteBackgroundError $log]
    ::sorma::JoinDict
    if {$log ne "stderr"} {     # there the package has said it
        foreach line [split [lindex [::sorma::so::dict CTRL -leftOut] 3] \n] {
            puts $log "warning: $line"
        }
    }
    foreach file [dict get $settings -dict] {
        ::sorma::so::dict CTRL -load $file
    }
    lappend ::auto_path {*}[lmap folder [dict get $settings -path] {file normalize $folder}]
    ::sorma::configure -strict [dict get $settings -strict]
    foreach package [dict get $settings -package] {
        Load $package
    }
    if {[dict get $settings -script] ne {}} {
        uplevel #0 [list source -encoding utf-8 [dict get $settings -script]]
    }
    foreach name [dict get $settings -make] {
        Make $name
    }
    if {[dict get $settings -selftest] > 0} {
        TestObjects [dict get $settings -selftest] $log
    }
    if {[dict exists $inherited -connection]} {
        ::sorma::subscribe sorm -event connection.closed -command ::sorma::daemon::ConnectionEnded
    }
    # A class in Tcl becomes known when it is first named. Those who look around want to see it before.
    foreach class [::sorma::classes] {
        catch {::sorma::KeepTrail [list ::sorma::so::sorm DBX -describe $class]}
    }
    set standby [expr {[dict exists $settings -standby] && [string is true -strict [dict get $settings -standby]]}]
    if {$standby} {
        StandBy [dict get $settings -name]
    }
    set served [Serve $settings $inherited]
    if {[dict get $settings -metrics] ne {}} {
        MakeMetrics [dict get $settings -name] [dict get $settings -metrics]
    }
    set doors {}
    foreach door {scpi vxi11} {
        if {[dict get $settings -$door] ne {}} {
            append doors " $door=[Listen [dict get $settings -name] $door [dict get $settings -$door]]"
        }
    }
    if {[dict get $settings -idle] > 0} {
        WatchIdle [expr {round(1000 * [dict get $settings -idle])}]
    }
    set line [ReadyLine $served [dict get $settings -metrics] $doors]
    if {[dict exists $settings -open] && [dict get $settings -open]} {
        append line " open=1"
        puts stderr "sormad: [dict get $served name] is open (-open 1): whoever reaches it may call and inspect its objects"
    }
    puts $line
    flush stdout
    ::sorma::Notify "READY=1\nSTATUS=$line"
    if {!$standby} {
        StartWatchdog
    }
}

# From here on others can call. A daemon for other hosts is announced to them.
proc ::sorma::daemon::Serve {settings inherited} {
    set served [::sorma::serve [dict get $settings -name] {*}[dict get $settings -serve] {*}$inherited]
    unset -nocomplain ::sorma::daemon::Waits
    if {[dict exists $settings -host] && [dict get $served port] ne {}} {
        package require sorma::announce
        ::sorma::announce::begin [dict get $served name] sorma [dict get $served port] [dict get $settings -host]
    }
    return $served
}

# A standby daemon is all that it should be before it waits: who starts it goes on.
proc ::sorma::daemon::StandBy name {
    variable Waits $name
    set line "standby $name[DirectoryWord]"
    puts $line
    flush stdout
    ::sorma::Notify "READY=1\nSTATUS=$line"
    StartWatchdog
}

# Where a daemon owns its name, for the lines that it says. Nothing: on this host alone.
proc ::sorma::daemon::DirectoryWord {} {
    if {![catch {::sorma::so::dict CTRL -get @directory} reply] && [regexp {^(?:@directory\s+)?(\w+):} [lindex $reply 3] -> kind]} {
        return " directory=$kind"
    }
}

# The line of a daemon that can be called. doors: what it says of those for instruments.
proc ::sorma::daemon::ReadyLine {served metrics doors} {
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
    if {$metrics ne {}} {
        append line " metrics=[lindex [split [lindex [::sorma::so::metrics DBX -address] 3] :] end]"
    }
    return $line$doors
}

# The object that answers Prometheus. When that is impossible, the daemon does not serve.
proc ::sorma::daemon::MakeMetrics {name port} {
    try {
        ::sorma::create metrics -port $port
    } on error {message options} {
        StopServing $name
        if {[lrange [dict get $options -errorcode] 0 2] eq {SORMA NAME UNKNOWN_CLASS}} {
            set message "the class metrics is not there: install libmicrohttpd-dev, then configure and build again"
        }
        return -code error "-metrics $port: $message"
    }
}

# The port of a door for instruments, scpi or vxi11. place: a port, or an address and a port. When there is none, the daemon does not serve.
proc ::sorma::daemon::Listen {name door place} {
    try {
        package require sorma::${door}Port
        lassign [Place $place] port address
        set port [::sorma::${door}Port::listen $port {*}[if {$address ne {}} {list $address}]]
        package require sorma::announce
        ::sorma::announce::begin $name $door $port $address
        return $port
    } on error message {
        StopServing $name
        return -code error "-$door $place: $message"
    }
}

proc ::sorma::daemon::Place place {
    if {![regexp {^(?:(?:\[([0-9a-fA-F:.]+)\]|([\w.-]+)):)?(\d{1,5})$} $place -> six four port] || $port > 65535} {
        return -code error "expected a port, or ADDRESS:PORT"
    }
    return [list $port {*}[if {"$six$four" ne {}} {list $six$four}]]
}

# Objects of the command line are there from the beginning, also after a restart.
proc ::sorma::daemon::Make name {
    if {[::sorma::exists $name]} {
        return                          ;# the script has made it
    }
    try {
        ::sorma::so::$name info class       ;# its first use, so that strict names hold
    } on error {message options} {
        return -options $options "-make $name: $message"
    }
}

# Nobody can call a daemon before all its objects have passed their self-tests; each has so long for it [s].
proc ::sorma::daemon::TestObjects {seconds log} {
    set names [lsearch -all -inline -not -regexp [::sorma::names] {^(?:sorm|dict)$}]
    set n 0
    foreach name $names {
        puts $log "self-test [incr n] of [llength $names]: $name"
        try {
            [::sorma::async -timeout [expr {round(1000 * $seconds)}] $name CTRL -selftest] take
        } on error {message options} {
            return -options $options "the self-test of $name: $message"
        }
    }
}

# A package that is not found: say where it was looked for, since that is nearly always why.
proc ::sorma::daemon::Load package {
    try {
        package require $package
    } on error {message options} {
        if {$message eq "can't find package $package"} {
            set message [::sorma::packages::notFound $package [package names] $::auto_path]
        }
        return -options $options $message
    }
}

# The one connection for which the daemon was made has ended.
proc ::sorma::daemon::ConnectionEnded args {
    variable End connection
}

# Each time a connection has ended, see after a while whether there is one.
proc ::sorma::daemon::WatchIdle milliseconds {
    ::sorma::subscribe sorm -event connection.closed -command [list ::sorma::daemon::AfterIdle $milliseconds]
    AfterIdle $milliseconds
}

proc ::sorma::daemon::AfterIdle {milliseconds args} {
    after cancel ::sorma::daemon::CheckIdle
    after $milliseconds ::sorma::daemon::CheckIdle
}

# again: who has come while this process did not run is let in first.
proc ::sorma::daemon::CheckIdle {{again 1}} {
    variable End
    if {$again} {
        after 1 {::sorma::daemon::CheckIdle 0}
    } elseif {![regexp -line {^from } [lindex [::sorma::so::sorm CTRL -connections] 3]]} {
        ::sorma::Notify "STOPPING=1\nSTATUS=idle"
        set End idle
    }
}

# Tell systemd regularly that the event loop turns (WatchdogSec=), twice as often as it wants to hear it.
proc ::sorma::daemon::StartWatchdog {} {
    global env
    if {![info exists env(WATCHDOG_USEC)] || ![string is wideinteger -strict $env(WATCHDOG_USEC)] ||
            ([info exists env(WATCHDOG_PID)] && $env(WATCHDOG_PID) ne [pid])} {
        return
    }
    Watchdog [expr {max(1, $env(WATCHDOG_USEC) / 2000)}]
}

proc ::sorma::daemon::Watchdog milliseconds {
    ::sorma::Notify WATCHDOG=1
    after $milliseconds [list ::sorma::daemon::Watchdog $milliseconds]
}

proc ::sorma::daemon::NoteBackgroundError {log message options} {
    puts $log "[clock format [clock seconds] -format {%Y-%m-%d %H:%M:%S}] background error: $message"
    if {[dict exists $options -errorinfo]} {
        puts $log [dict get $options -errorinfo]
    }
}
