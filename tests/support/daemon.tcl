# daemon.tcl -- daemons for tests.
#
# daemon start ?-name N? ?-tcp bool? ?-package P? ?-dict F? ?-script F? ...   its name, once it can be called
# daemon info NAME port|socket|pid|program|log
# daemon stop NAME          by SIGTERM; an error unless it exits with 0
# daemon kill NAME ?SIGNAL? returns when the process is gone
# daemon stopAll
# daemon processor PID      processor time that a process has taken, in user mode and in the kernel [s]

namespace eval daemon {
    variable Running    ;# dict: name -> {pipe pid port socket program log}
    variable Count 0
    set Running {}
    namespace export start info stop kill stopAll processor
    namespace ensemble create
}

proc daemon::start args {
    variable Running
    variable Count
    set words {}
    set name d[pid]x[incr Count]
    foreach {option value} $args {
        switch -- $option {
            -name { set name $value }
            -tcp { if {$value} { lappend words -port 0 } }
            default { lappend words $option $value }
        }
    }
    set log [file join [::tcltest::temporaryDirectory] $name.log]
    set pipe [open [list | sormad -name $name {*}$words 2> $log] r]
    set line [gets $pipe]
    if {![string match "ready $name *" $line]} {
        catch {close $pipe}
        set said [ReadFile $log]
        file delete $log
        return -code error "sormad $words said \"$line\" instead of ready: $said"
    }
    set facts [dict create pipe $pipe pid [pid $pipe] port {} program {} metrics {} scpi {} vxi11 {} log $log]
    foreach word [lrange $line 2 end] {
        regexp {^(tcp|unix|program|metrics|scpi|vxi11)=(.*)$} $word -> key value
        dict set facts [dict get {tcp port unix socket program program metrics metrics scpi scpi vxi11 vxi11} $key] $value
    }
    dict set Running $name $facts
    return $name
}

proc daemon::info {name what} {
    variable Running
    return [dict get $Running $name $what]
}

proc daemon::stop name {
    variable Running
    set facts [dict get $Running $name]
    dict unset Running $name
    exec sh -c {kill "$@"} kill -TERM [dict get $facts pid]
    if {[catch {waitFor {[Ended [dict get $facts pid]]}} message]} {
        exec sh -c {kill "$@"} kill -KILL [dict get $facts pid]
    }
    set failed [catch {close [dict get $facts pipe]} message]
    set said [ReadFile [dict get $facts log]]
    file delete [dict get $facts log]
    if {$failed} {
        return -code error "daemon $name ended badly: $message; it said: $said"
    }
    if {[string match -nocase "*sanitizer*" $said] || [string match "*runtime error*" $said]} {
        return -code error "daemon $name: $said"
    }
}

proc daemon::kill {name {signal KILL}} {
    variable Running
    set facts [dict get $Running $name]
    dict unset Running $name
    catch {exec sh -c {kill "$@"} kill -$signal [dict get $facts pid]}
    catch {close [dict get $facts pipe]}
    file delete [dict get $facts log]
    if {$signal eq "KILL" && [dict get $facts socket] ne {}} {
        # A daemon that was killed leaves its socket; the test leaves nothing.
        lappend ::daemon::Sockets [dict get $facts socket]
    }
}

proc daemon::stopAll {} {
    variable Running
    variable Sockets
    foreach name [dict keys $Running] {
        kill $name
    }
    if {[::info exists Sockets]} {
        file delete {*}$Sockets {*}[lmap socket $Sockets {string cat [file rootname $socket] .tcp}]
    }
}

# Has the process ended? Until its pipe is closed it is left as a zombie.
proc daemon::Ended pid {
    if {[catch {ReadFile /proc/$pid/stat} stat]} {
        return 1
    }
    return [regexp {^\d+ \(.*\) Z} $stat]
}

proc daemon::processor pid {
    set stat [ReadFile /proc/$pid/stat]
    lassign [lrange [string range $stat [string last ) $stat] end] 12 13] user kernel
    return [expr {($user + $kernel) / 100.0}]
}

proc daemon::ReadFile file {
    set f [open $file]
    set text [string trim [read $f]]
    close $f
    return $text
}
