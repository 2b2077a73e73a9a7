# directory.tcl -- one name, two daemons that may have it, and what happens when the owner is killed, or its cable is cut.
#
#     ./bootstrap run directory       needs root, for network namespaces; exit code 0: all went as it should
#
# etcd runs on the switch. left and right serve the name robot, by TLS: one owns it, the other one waits. Three callers call all the
# time. The one at desk knows the name alone. Those on left and right use the socket there, and ask no directory.
#
# -lease N: of the name [s]. -seed N, -short, -json FILE: as for all that measures.

package require sorma
namespace eval directory {
    variable Here [file dirname [file normalize [info script]]]
    variable Lease
    variable Running        ;# array: host -> pipe of its daemon
    variable Heard {}       ;# list: caller, when [ms], ok or error, what, why
}
foreach file {../measure.tcl hosts.tcl} {
    source [file join $directory::Here $file]
}

# ---- what runs ----

proc directory::keys {} {
    hosts::run left sorma-keys new-authority lab
    hosts::run left sorma-keys new robot
    foreach {host name} {right robot desk desk} {
        set file [file join [hosts::folder switch] $host.keys]
        hosts::run left sorma-keys give $name $file
        hosts::run $host sorma-keys take $file
    }
}
proc directory::etcd {} {
    set url http://192.168.7.1:2379
    hosts::start switch sh -c {etcd "$@" > "$SORMA_RUNTIME_DIR/etcd.log" 2>&1 & read end; exec 2> /dev/null; kill $!; wait} etcd --data-dir [file join [hosts::folder switch] data] \
        --listen-client-urls $url --advertise-client-urls $url --log-level error
    measure until {![catch {hosts::run switch env ETCDCTL_API=3 etcdctl --endpoints $url endpoint health}]} -every 50 -else "etcd does not answer at $url"
}
# A daemon of the name robot there; the line that it says first.
proc directory::serve {host args} {
    variable Here
    variable Running
    set Running($host) [hosts::start $host env PLACE=$host JOURNAL=[file join [hosts::folder switch] journal] sormad -name robot -until-eof \
        -script [file join $Here arm.tcl] -make arm.1 -owned arm.* {*}$args]
    return [gets $Running($host)]
}
proc directory::call {host object} {
    variable Here
    set pipe [hosts::start $host [info nameofexecutable] [file join $Here caller.tcl] $object]
    fconfigure $pipe -blocking 0
    fileevent $pipe readable [list ::directory::Read $host $pipe]
}
proc directory::Read {host pipe} {
    variable Heard
    while {[gets $pipe line] >= 0} {
        lappend Heard [list $host {*}$line]
    }
    if {[eof $pipe]} {
        close $pipe
    }
}

# ---- what came of it ----

# The first thing that a caller said after a time, which fits patterns: when; empty: nothing yet.
proc directory::first {caller after patterns} {
    variable Heard
    foreach said $Heard {
        if {[lindex $said 0] eq $caller && [lindex $said 1] >= $after && [string match $patterns [lrange $said 2 end]]} {
            return [lindex $said 1]
        }
    }
}
proc directory::await {caller after patterns} {
    set within [expr {20 + 2 * $::directory::Lease}]
    measure until {[set last [lindex [lsearch -all -inline -index 0 $::directory::Heard $caller] end]; directory::first $caller $after $patterns] ne {}} \
        -within $within -else {nothing like "$patterns" came from $caller in $within s; the last was "$last"}
    return [first $caller $after $patterns]
}
# Hosts in the order in which they took requests.
proc directory::owners {} {
    set lines [lsort -integer -index 0 [split [string trim [fileutil::cat [file join [hosts::folder switch] journal]]] \n]]
    set hosts {}
    foreach line $lines {
        if {[lindex $line 1] ne [lindex $hosts end]} {
            lappend hosts [lindex $line 1]
        }
    }
    return [list [llength $lines] $hosts]
}

proc directory::rows given {
    variable Lease [dict get $given -lease]
    variable Running
    hosts::begin {left right desk} "@directory etcd:http://192.168.7.1:2379 -lease $Lease"
    try {
        keys
        etcd
        set longest [expr {$Lease + 0.7}]

        measure row "left claims the name" -target {[string match "ready robot *" $said]} -wanted "it serves" -body {
            set said [serve left -directory 1]
            lindex $said 0
        }
        measure row "right claims it, too" -target {$first eq "root@left" && $second eq "root@right"} -wanted "refused, with both identities" -body {
            catch {hosts::run right sormad -name robot -directory 1} said
            set first [set second nobody]
            regexp {is served already by (\S+) .* this is (\S+) } $said -> first second
            string cat "$first has it, not $second"
        }
        measure row "right waits for it" -target {[lrange $said 0 1] eq "standby robot"} -wanted "it listens nowhere" -body {
            set said [serve right -standby 1]
        }
        call left arm.1@[file join [hosts::folder left] robot.sock]
        call right arm.1@[file join [hosts::folder right] robot.sock]
        set begin [clock milliseconds]
        call desk arm.1@robot
        measure row "desk calls robot, by name alone" -target {$host eq "left"} -wanted "left answers" -body {
            set when [await desk $begin "ok *"]
            set host [lindex [lsearch -inline -index 0 $::directory::Heard desk] 3]
            format "%s, after %.2f s" $host [expr {($when - $begin) / 1000.0}]
        }

        set killed [clock milliseconds]
        exec kill -KILL {*}[pid $Running(left)]
        measure row "the owner is killed: right answers" -target {$took <= $longest} -wanted "after [format %.1f $longest] s at most" -body {
            set took [expr {([await desk $killed "ok right"] - $killed) / 1000.0}]
            format "after %.2f s" $took
        }
        serve left -standby 1

        set cut [clock milliseconds]
        hosts::cable right down
        measure row "right is cut off: left answers" -target {$took <= $longest + 1} -wanted "after [format %.1f [expr {$longest + 1}]] s at most" -body {
            set took [expr {([await desk $cut "ok left"] - $cut) / 1000.0}]
            format "after %.2f s" $took
        }
        measure row "right refuses, by its own clock" -target {$before > 0} -wanted "before left takes anything" -body {
            set refused [await right $cut "error {DIRECTORY NOT_OWNER} *"]
            set before [expr {([await left $cut "ok left"] - $refused) / 1000.0}]
            format "%.2f s before" $before
        }
        set healed [clock milliseconds]
        hosts::cable right up
        measure row "the cable is back: right knows the owner" -target {[string match "*its owner is *" $said]} -wanted "it names the owner" -body {
            measure until {[string match "*its owner is *" [set said [directory::refusal]]]} -else {it says "$said"}
            format "after %.2f s" [expr {([clock milliseconds] - $healed) / 1000.0}]
        }
        measure row "who took requests, in this order" -target {$hosts eq {left right left}} -wanted "each host until the next one" -body {
            lassign [owners] count hosts
            format "%d requests: %s" $count [join $hosts {, }]
        }
    } finally {
        hosts::end
    }
}
# The answer of right to somebody on it.
proc directory::refusal {} {
    catch {hosts::run right [info nameofexecutable] << "package require sorma; arm.1@[file join [hosts::folder right] robot.sock] EXEC"} said
    return $said
}

catch {sorma::atSignal {apply {args {hosts::end; exit 1}}}}
exit [measure run {-lease {{whole 2 3600} 2}} {} $argv directory::rows]
