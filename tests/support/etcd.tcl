# etcd.tcl -- etcd servers for tests, on free ports of 127.0.0.1. One of them is a cluster of one.
#
# etcd::available           is there such a program?
# etcd::start ?FOLDER PORTS? ?OPTION ...?   -> dict: url, pid, folder, ports, pipe; when it answers. FOLDER PORTS: of one that has ended,
#                           with its data. With --cert-file its url is https, and that it takes connections is enough
# etcd::signal SERVER NAME  STOP, CONT ...
# etcd::end SERVER          by SIGKILL; returns when it is gone. Its folder stays until etcd::endAll
# etcd::endAll
# etcd::ctl SERVER WORD ... what etcdctl says

source [file join $supportFolder http.tcl]

namespace eval etcd {
    variable Running {}     ;# dict: url -> server
    variable Folders {}
}

proc etcd::available {} {
    return [expr {[auto_execok etcd] ne {} && [auto_execok etcdctl] ne {}}]
}

proc etcd::FreePorts {} {
    set ports {}
    foreach k {1 2} {
        lappend held [set s [socket -server list -myaddr 127.0.0.1 0]]
        lappend ports [lindex [fconfigure $s -sockname] 2]
    }
    foreach s $held {
        close $s
    }
    return $ports
}

# Somebody else may take a port between our look and its start: then it ends, and we try others.
proc etcd::start {{folder {}} {given {}} args} {
    variable Running
    variable Folders
    if {$folder eq {}} {
        set folder [exec mktemp -d [file join [::tcltest::temporaryDirectory] etcdXXXXXX]]
        lappend Folders $folder
    }
    foreach attempt {1 2 3 4 5 6 7 8} {
        lassign [set ports [if {$given ne {}} {set given} else {FreePorts}]] client peer
        set url [expr {"--cert-file" in $args ? "https" : "http"}]://127.0.0.1:$client
        set here http://127.0.0.1:$peer
        set pipe [open [list | etcd --name one --data-dir [file join $folder data] --listen-client-urls $url --advertise-client-urls $url \
            --listen-peer-urls $here --initial-advertise-peer-urls $here --initial-cluster one=$here --logger zap \
            --log-level error {*}$args 2> [file join $folder log]] r]
        set server [dict create url $url pid [pid $pipe] folder $folder ports $ports pipe $pipe]
        dict set Running $url $server
        while {![daemon::Ended [pid $pipe]]} {
            if {![catch {http::get 127.0.0.1 $client /health {Connection: close}} answer] && [string match *true* [lindex $answer 1]]} {
                return $server
            }
            if {"--cert-file" in $args && ![catch {socket 127.0.0.1 $client} channel]} {
                close $channel
                return $server
            }
            after 10
        }
        end $server
        if {$given eq {}} {
            file delete -force [file join $folder data]
        }
    }
    return -code error "etcd does not start: [daemon::ReadFile [file join $folder log]]"
}

proc etcd::signal {server name} {
    exec sh -c {kill "$@"} kill -$name [dict get $server pid]
}

proc etcd::end server {
    variable Running
    dict unset Running [dict get $server url]
    catch {signal $server KILL}
    catch {close [dict get $server pipe]}
}

proc etcd::endAll {} {
    variable Running
    variable Folders
    foreach server [dict values $Running] {
        end $server
    }
    file delete -force {*}$Folders
    set Folders {}
}

proc etcd::ctl {server args} {
    return [exec env ETCDCTL_API=3 etcdctl --endpoints [dict get $server url] {*}$args]
}
