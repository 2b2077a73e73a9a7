# hosts.tcl -- hosts on this one: network namespaces, and a switch that connects them. Each has its name, as all of them know it, and folders for
# daemons, keys and a dictionary. It also has its own number of a boot: by that, programs know whether a socket file is on their host.
#
#     hosts::begin {left right desk} "@directory ..."   192.168.7.2 and so on; the switch is the host `switch`, 192.168.7.1. Error HOSTS RIGHTS
#     hosts::run HOST WORD ...                          what a command there says
#     hosts::start HOST WORD ...                        a pipe to one that runs. It should end with its standard input
#     hosts::cable HOST up|down
#     hosts::end                                        all of it goes, with all that runs there. The kernel takes it away when we are killed
#
# Needs root, and ip, nsenter and unshare.

package require fileutil

namespace eval hosts {
    variable Folder {}
    variable Holders {}     ;# dict: host -> the pipe to the process that keeps its namespace
    variable Started {}     ;# pipes
}

proc hosts::begin {names line} {
    variable Folder
    variable Holders
    if {[catch {exec unshare --net ip link add cable type veth peer name plug 2>@1} why]} {
        return -code error -errorcode {HOSTS RIGHTS} "network namespaces are refused here: $why; this needs root, as by sudo, and the package iproute2"
    }
    set Folder [exec mktemp -d -t sorma-hosts-XXXXXX]
    try {
        Make [linsert $names 0 switch] $line
    } on error {why options} {
        end
        return -options $options $why
    }
}
proc hosts::Make {names line} {
    variable Folder
    variable Holders
    set mounts [Mounts]
    set number 0
    fileutil::writeFile [file join $Folder hosts] "127.0.0.1 localhost\n[join [lmap host $names {string cat "192.168.7.[incr number] $host"}] \n]\n"
    set number 0
    foreach host $names {
        file mkdir [file join $Folder $host]
        file attributes [file join $Folder $host] -permissions 0700
        set holder [open [list | unshare --net {*}$mounts --uts sh -c {
            hostname "$(basename "$1")" && cat /proc/sys/kernel/random/uuid > "$1/boot" && mount --bind "$1/boot" /proc/sys/kernel/random/boot_id &&
                mount --bind "$1/../hosts" /etc/hosts && echo up
            read end
        } sh [file join $Folder $host] 2>@1] r+]
        if {[gets $holder said] < 0 || $said ne "up"} {
            return -code error -errorcode {HOSTS RIGHTS} "a host cannot be made: $said; this needs root, as by sudo"
        }
        dict set Holders $host $holder
        fileutil::writeFile [file join $Folder $host dict] $line\n
        run $host ip link set lo up
        set address 192.168.7.[incr number]/24
        if {$host eq "switch"} {
            run switch ip link add hub type bridge
            run switch ip addr add $address dev hub
            run switch ip link set hub up
        } else {
            run switch ip link add $host type veth peer name eth0 netns [pid $holder]
            run switch ip link set $host master hub
            run switch ip link set $host up
            run $host ip addr add $address dev eth0
            run $host ip link set eth0 up
        }
    }
}

# Words for unshare, so that what is mounted in a host is seen there alone. In a chroot / is no mount, and cannot be made private: then mounts
# must not be shared in the first place. A shared one keeps what it gets when its process has ended.
proc hosts::Mounts {} {
    variable Folder
    if {![catch {exec unshare --mount true 2>@1} why]} {
        return --mount
    }
    set words {--mount --propagation unchanged}
    set probe [file join $Folder probe]
    close [open $probe w]
    if {[catch {exec unshare {*}$words mount --bind /etc/hosts $probe 2>@1} why]} {
        return -code error -errorcode {HOSTS RIGHTS} "a host needs mounts of its own: $why; this needs root, as by sudo"
    }
    if {[file size $probe]} {
        exec umount $probe
        return -code error -errorcode {HOSTS RIGHTS} "a host needs mounts of its own, and those of this chroot are shared: start it outside"
    }
    return $words
}

# Words that go before a command.
proc hosts::At host {
    variable Folder
    variable Holders
    set own [file join $Folder $host]
    return [list env SORMA_RUNTIME_DIR=$own SORMA_KEYS=[file join $own keys] SORMA_DICT=[file join $own dict] SORMA_PASSPHRASE=[file tail $Folder] \
        nsenter -t [pid [dict get $Holders $host]] -n -m -u -r -w]
}
proc hosts::run {host args} {
    return [exec {*}[At $host] {*}$args 2>@1]
}
proc hosts::start {host args} {
    variable Started
    set pipe [open [list | {*}[At $host] {*}$args 2>@stderr] r+]
    fconfigure $pipe -buffering line
    lappend Started $pipe
    return $pipe
}
proc hosts::cable {host state} {
    run switch ip link set $host $state
}
proc hosts::folder host {
    variable Folder
    return [file join $Folder $host]
}

proc hosts::end {} {
    variable Folder
    variable Holders
    variable Started
    foreach pipe [concat [lreverse $Started] [dict values $Holders]] {
        catch {close $pipe write}
        catch {
            fconfigure $pipe -blocking 1
            close $pipe
        }
    }
    set Started [set Holders {}]
    file delete -force $Folder
}
