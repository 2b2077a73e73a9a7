# directory.tcl ?-PHASE N ...? ?-longest SECONDS? ?-seed N? -- three servers of etcd, six daemons with three names, all on hosts of their own. The
# owners of names are attacked. Nobody may obey beside the owner. Phases, and how often:
#
#     -takeovers 20   kill all three owners
#     -both 5         kill the leader of etcd and all owners
#     -leaders 20     kill the leader of etcd
#     -stops 30       suspend an owner for 1 to 5 s
#     -cuts 30        cut the host of a daemon off, for 1 s to -longest (8); in a third of them it can send, in another third hear
#     -stalls 1       freeze the disk of the leader of etcd for 10 s; where there are no loop devices, suspend the leader
#     -jumps 4        the clocks of the daemons of one name jump by an hour
#     -away 20        suspend all servers, for so many seconds
#
# By hand, from the build folder; it needs root, etcd-server, etcd-client, faketime and iproute2:
#
#     ./env tclsh ../tests/faults/directory.tcl -leaders 200 -stops 100 -cuts 100 -longest 30 -away 600
#
# The judge: each request that arm.1 takes is a line of a journal, in the order in which they were taken. etcd keeps all its history. So the owners
# by the journal must be the owners by etcd, in the same order. Clocks are not asked. A daemon that was suspended within a request would write its line
# when it goes on, after those of the next owner. So daemons suspend themselves, between two requests.

source [file join [file dirname [file normalize [info script]]] faults.tcl]
set demo [file join [file dirname [file dirname $supportFolder]] demos directory]
source [file join $demo hosts.tcl]

array set often {-takeovers 20 -both 5 -leaders 20 -stops 30 -cuts 30 -longest 8 -stalls 1 -jumps 4 -away 20 -seed 1}
foreach {option n} $argv {
    if {![info exists often($option)] || ![string is integer -strict $n] || $n < 0} {
        puts stderr "directory.tcl: expected one of [lsort [array names often]], and a number; got \"$option $n\""
        exit 2
    }
    set often($option) $n
}
expr {srand($often(-seed))}
set lease 2
set servers {one two three}
set names {alpha beta gamma}
proc hostsOf name {
    return [list $name-a $name-b]
}
proc other host {
    return [string map {-a -b -b -a} $host]
}

# ---- what runs ----

proc url server {
    return http://192.168.7.[expr {2 + [lsearch $::servers $server]}]:2379
}
proc startServer server {
    set peers [join [lmap s $::servers {string cat $s = [string map {:2379 :2380} [url $s]]}] ,]
    set peer [string map {:2379 :2380} [url $server]]
    hosts::start $server sh -c {
        etcd "$@" >> "$SORMA_RUNTIME_DIR/etcd.log" 2>&1 & echo $! > "$SORMA_RUNTIME_DIR/pid.new"; mv "$SORMA_RUNTIME_DIR/pid.new" "$SORMA_RUNTIME_DIR/pid"
        read end; exec 2> /dev/null; kill -CONT $!; kill -KILL $!; wait
    } etcd --name $server --data-dir [file join [hosts::folder $server] data] --listen-client-urls [url $server],http://127.0.0.1:2379 \
        --advertise-client-urls [url $server] --listen-peer-urls $peer --initial-advertise-peer-urls $peer --initial-cluster $peers --log-level error
}
proc signalServer {server signal} {
    set file [open [file join [hosts::folder $server] pid]]
    exec kill -$signal [gets $file]
    close $file
}
proc ctl {server args} {
    return [hosts::run $server env ETCDCTL_API=3 etcdctl --dial-timeout 1s --command-timeout 2s --endpoints [url $server] {*}$args]
}
# A disk of its own for the data of a server, which can be frozen: a file. False: not on this machine.
proc ownDisk server {
    set file [file join [hosts::folder $server] disk]
    set data [file join [hosts::folder $server] data]
    file mkdir $data
    close [open $file w]
    return [expr {![catch {
        hosts::run $server truncate --size 1G $file
        hosts::run $server mkfs.ext4 -q $file
        hosts::run $server mount -o loop $file $data
        file attributes $data -permissions 0700
    }]}]
}
# It melts also when we are killed meanwhile.
proc freeze {server seconds} {
    hosts::run $server setsid sh -c {fsfreeze --freeze "$1" && { (sleep $2; fsfreeze --unfreeze "$1") > /dev/null 2>&1 & }} sh [file join [hosts::folder $server] data] $seconds
}
# The server that leads; empty: none that we can ask.
proc leader {} {
    foreach server $::servers {
        if {![catch {ctl $server endpoint status --write-out fields} said] && [regexp {"Leader" : (\d+)} $said -> leader] && $leader != 0
                && [regexp {"MemberID" : (\d+)} $said -> own] && $own == $leader} {
            return $server
        }
    }
}
proc allServe {} {
    foreach server $::servers {
        if {[catch {ctl $server endpoint health}]} {
            return 0
        }
    }
    return 1
}
proc killLeader {} {
    waitFor {[set ::led [leader]] ne {}} 60000
    signalServer $::led KILL
    return $::led
}

# The script of the daemons: an arm, and something that suspends the daemon when there is a file `suspend` in its folder.
proc writeScript {} {
    set file [open [file join [hosts::folder switch] arm.tcl] w]
    puts $file [list source [file join $::demo arm.tcl]]
    puts $file {
        proc heed file {
            if {[file exists $file]} {
                file delete $file
                exec kill -STOP [pid]
            }
            after 5 heed $file
        }
        heed [file join $env(SORMA_RUNTIME_DIR) suspend]
    }
    close $file
}
# host -> pipe of its daemon
proc startDaemon {host how} {
    set name [lindex [split $host -] 0]
    set words [list env PLACE=$host JOURNAL=[file join [hosts::folder switch] journal.$name]]
    if {$name eq "gamma"} {
        lappend words LD_PRELOAD=[file join [hosts::folder switch] timer.so]:$::faketime FAKETIME_TIMESTAMP_FILE=[file join [hosts::folder switch] jump] FAKETIME_NO_CACHE=1 FAKETIME_DONT_FAKE_MONOTONIC=1
    }
    set ::daemons($host) [hosts::start $host {*}$words sormad -name $name -until-eof -script [file join [hosts::folder switch] arm.tcl] -make arm.1 -owned arm.* {*}$how]
    return [gets $::daemons($host)]
}
proc killDaemon host {
    exec kill -KILL {*}[pid $::daemons($host)]
    catch {close $::daemons($host)}
}
proc suspend host {
    close [open [file join [hosts::folder $host] suspend] w]
    waitFor {[state $host] eq "T"} 10000
}
proc resume host {
    exec kill -CONT {*}[pid $::daemons($host)]
}
# As ps tells it: T when it is suspended.
proc state host {
    set file [open /proc/[pid $::daemons($host)]/stat]
    regexp {\) (\w)} [read $file] -> state
    close $file
    return $state
}
# heard(CALLER): list: when [ms], ok or error, what, why
proc startCaller {host object what} {
    set pipe [hosts::start $host [info nameofexecutable] [file join $::demo caller.tcl] $object]
    fconfigure $pipe -blocking 0
    fileevent $pipe readable [list readCaller $pipe $what]
    set ::heard($what) {}
}
proc readCaller {pipe what} {
    while {[gets $pipe line] >= 0} {
        lappend ::heard($what) $line
    }
    if {[eof $pipe]} {
        fileevent $pipe readable {}
    }
}

# ---- what is seen ----

proc owner name {
    set file [open [file join [hosts::folder switch] journal.$name]]
    seek $file [expr {max(0, [file size [file join [hosts::folder switch] journal.$name]] - 200)}]
    set lines [split [string trim [read $file]] \n]
    close $file
    return [lindex $lines end 1]
}
# When the desk was first served there, after a time [ms]; empty: not yet.
proc served {name host after} {
    foreach said $::heard($name) {
        if {[lindex $said 0] >= $after && [lindex $said 1] eq "ok" && [lindex $said 2] eq $host} {
            return [lindex $said 0]
        }
    }
}
# Each name serves the desk now: what it heard last is no error.
proc allServed {} {
    foreach name $::names {
        if {[lindex $::heard($name) end 1] ne "ok"} {
            return 0
        }
    }
    return 1
}
# The lines of a journal, and by turns: the number of a line, and the host that took requests from there on.
proc journal name {
    set file [open [file join [hosts::folder switch] journal.$name]]
    set lines [split [string trim [read $file]] \n]
    close $file
    return $lines
}
proc runs lines {
    set runs {}
    for {set n 0} {$n < [llength $lines]} {incr n} {
        if {[lindex $lines $n 1] ne [lindex $runs end]} {
            lappend runs $n [lindex $lines $n 1]
        }
    }
    return $runs
}
# dict: name -> hosts that etcd has granted it to, in this order.
proc grants {} {
    ctl one put lab/zz-end now
    set pipe [open [list | {*}[hosts::At one] env ETCDCTL_API=3 etcdctl --endpoints [url one] watch --prefix lab/ --rev 1] r]
    set found {}
    while {[gets $pipe what] >= 0} {
        gets $pipe key
        gets $pipe value
        set name [file tail $key]
        if {$name eq "zz-end"} break
        if {$what eq "PUT" && [regexp {"identity":"root@([\w-]+)} $value -> host] && [lindex [dict get [dict merge [list $name {}] $found] $name] end] ne $host} {
            dict lappend found $name $host
        }
    }
    exec kill {*}[pid $pipe]
    catch {close $pipe}
    return $found
}
# Are runs what remains of a list of hosts when some are left out? Where not: the number of the line.
proc wrong {runs hosts} {
    set at 0
    foreach {line host} $runs {
        while {[lindex $hosts $at] ne $host} {
            if {[incr at] >= [llength $hosts]} {
                return $line
            }
        }
    }
}
# The lines about each run of less than ten.
proc brief {lines runs} {
    set found {}
    foreach {line host} $runs {next -} [concat [lrange $runs 2 end] [llength $lines] end] {
        if {$next - $line < 10} {
            lappend found $line [lrange $lines [expr {$line - 2}] [expr {$next + 1}]]
        }
    }
    return $found
}
proc random {low high} {
    return [expr {$low + rand() * ($high - $low)}]
}
proc say text {
    puts "[format %6.1f [expr {([clock milliseconds] - $::began) / 1000.0}]] s  $text"
    flush stdout
}

# ---- attacks ----

# Kill all owners at once. Returns for each how long the desk was without its service [s].
proc takeover {{first {}}} {
    waitFor {[allServed]} 60000
    set begin [clock milliseconds]
    {*}$first
    foreach name $::names {
        set was($name) [owner $name]
        killDaemon $was($name)
    }
    set took {}
    foreach name $::names {
        waitFor {[served $name [other $was($name)] $begin] ne {}} 60000
        lappend took [expr {([served $name [other $was($name)] $begin] - $begin) / 1000.0}]
    }
    foreach name $::names {
        startDaemon $was($name) {-standby 1}
    }
    return $took
}
# Drop in silence all that a host sends, or hears.
proc cut {host direction} {
    set drop {tbf rate 8kbit burst 10 limit 10}
    if {$direction in {out both}} {
        hosts::run $host tc qdisc add dev eth0 root {*}$drop
    }
    if {$direction in {in both}} {
        hosts::run switch tc qdisc add dev $host root {*}$drop
    }
}
proc heal host {
    catch {hosts::run $host tc qdisc del dev eth0 root}
    catch {hosts::run switch tc qdisc del dev $host root}
}
# Two names at a time, by turns: the third one serves on. attack HOST SECONDS begins; its end is `end HOST`.
proc torment {count seconds attack end} {
    for {set i 0} {$i < $count} {incr i 2} {
        set hosts [lmap name [lreplace $::names [expr {$i / 2 % 3}] [expr {$i / 2 % 3}]] {
            expr {rand() < 0.75 ? [owner $name] : [other [owner $name]]}
        }]
        set ::pending 2
        foreach host $hosts {
            {*}$attack $host
            after [expr {int(1000 * [random 1 $seconds])}] [list apply {{end host} {{*}$end $host; incr ::pending -1}} $end $host]
        }
        waitFor {$::pending == 0} [expr {1000 * $seconds + 10000}]
        waitFor {[allServed]} 60000
    }
}
proc jump seconds {
    set file [open [file join [hosts::folder switch] jump.new] w]
    puts $file [format %+d $seconds]
    close $file
    file rename -force [file join [hosts::folder switch] jump.new] [file join [hosts::folder switch] jump]
}

attack {
    set began [clock milliseconds]
    set faketime [lindex [glob -nocomplain /usr/lib/*/faketime/libfaketimeMT.so.1] 0]
    if {$faketime eq {}} {
        error "the package faketime is not installed"
    }
    set urls [join [lmap server $servers {url $server}] ,]
    hosts::begin [concat $servers [concat {*}[lmap name $names {hostsOf $name}]] desk] "@directory etcd:$urls -prefix lab -lease $lease"
    try {
        hosts::run alpha-a sorma-keys new-authority lab
        hosts::run alpha-a sorma-keys new alpha
        foreach {host name} [concat {*}[lmap name $names {list $name-a $name $name-b $name}] desk desk] {
            if {$host eq "alpha-a"} continue
            set file [file join [hosts::folder switch] $host.keys]
            hosts::run alpha-a sorma-keys give $name $file
            hosts::run $host sorma-keys take $file
        }
        jump 0
        writeScript
        # faketime changes timers that follow the monotonic clock, too, though we ask it not to: those go straight to the kernel.
        exec cc -shared -fPIC -x c -o [file join [hosts::folder switch] timer.so] - << {
            #include <sys/syscall.h>
            #include <sys/timerfd.h>
            #include <unistd.h>
            int timerfd_settime(int fd, int flags, const struct itimerspec* now, struct itimerspec* old) {
                return syscall(SYS_timerfd_settime, fd, flags, now, old);
            }
        }
        set disks [expr {$often(-stalls) > 0 && [ownDisk one] && [ownDisk two] && [ownDisk three]}]
        foreach server $servers {
            startServer $server
        }
        waitFor {[allServe]} 60000
        # faketime leaves shared memory of those that are killed.
        foreach host [hostsOf gamma] {
            hosts::run $host mount -t tmpfs tmpfs /dev/shm
        }
        foreach name $names {
            startDaemon $name-a {-directory 1}
            startDaemon $name-b {-standby 1}
            startCaller desk arm.1@$name $name
            foreach host [hostsOf $name] {
                startCaller $host arm.1@[file join [hosts::folder $host] $name.sock] $host
            }
        }
        waitFor {[allServed]} 60000
        say "three servers, six daemons, nine callers"

        if {$often(-takeovers) > 0} {
            set took {}
            for {set i 0} {$i < $often(-takeovers)} {incr i} {
                lappend took {*}[takeover]
            }
            say "[llength $took] owners killed: the next one answers after [format "%.2f s, 99 of 100 %.2f, at most %.2f" [quantile $took 0.5] [quantile $took 0.99] [quantile $took 1]]"
            promise "99 of 100 within the lease and 0.7 s" [expr {[quantile $took 0.99] <= $lease + 0.7}]
        }
        if {$often(-both) > 0} {
            set took {}
            for {set i 0} {$i < $often(-both)} {incr i} {
                lappend took {*}[takeover killLeader]
                startServer $led
                waitFor {[allServe]} 60000
            }
            say "[llength $took] owners killed with the leader of etcd: the next one answers after [format "%.2f s, at most %.2f" [quantile $took 0.5] [quantile $took 1]]"
            promise "within two leases and 2 s" [expr {[quantile $took 1] <= 2 * $lease + 2}]
        }
        if {$often(-leaders) > 0} {
            for {set i 0} {$i < $often(-leaders)} {incr i} {
                set killed [killLeader]
                waitFor {[set ::now [leader]] ne {}} 60000
                after [expr {int([random 0 2000])}] {set ::pause 1}
                vwait ::pause
                startServer $killed
                waitFor {[allServe]} 60000
            }
            waitFor {[allServed]} 60000
            say "$often(-leaders) leaders of etcd killed"
        }
        if {$often(-stops) > 0} {
            torment $often(-stops) 5 suspend resume
            say "$often(-stops) daemons suspended"
        }
        if {$often(-cuts) > 0} {
            torment $often(-cuts) $often(-longest) {apply {host {cut $host [lindex {both in out} [expr {int(3 * rand())}]]}}} heal
            say "$often(-cuts) hosts cut off"
        }
        for {set i 0} {$i < $often(-stalls)} {incr i} {
            waitFor {[set led [leader]] ne {}} 60000
            if {$disks} {
                freeze $led 10
                catch {ctl $led put elsewhere/key written}          ;# a leader that has nothing to write needs no disk
            } else {
                signalServer $led STOP
            }
            after 11000 {set pause 1}
            vwait pause
            if {!$disks} {
                signalServer $led CONT
            }
            set other [leader]
            waitFor {[allServe] && [allServed]} 60000
            say "leader $led of etcd [expr {$disks ? "with a frozen disk" : "suspended"}] for 10 s; then $other led"
        }
        for {set i 0} {$i < $often(-jumps)} {incr i} {
            set before [llength $heard(gamma)]
            jump [expr {$i % 2 ? 0 : 3600}]
            after [expr {2000 * $lease}] {set pause 1}
            vwait pause
            foreach line [lrange $heard(gamma) $before end] {
                say "the desk hears: $line"
            }
            promise "a jump of an hour [expr {$i % 2 ? "back" : "ahead"}] costs the owner nothing" [expr {[llength $heard(gamma)] == $before}]
            takeover
        }
        if {$often(-away) > 0} {
            # Nobody owns nop. Its connections are open.
            foreach name $names {
                startCaller desk nop.1@$name nop.$name
            }
            waitFor {[llength [lmap name $names {if {[lindex $heard(nop.$name) end 1] ne "ok"} continue}]] == 3} 60000
            foreach server $servers {
                signalServer $server STOP
            }
            set before [lmap name $names {llength $heard(nop.$name)}]
            after [expr {1000 * $often(-away)}] {set pause 1}
            vwait pause
            set lost [expr {[lmap name $names {llength $heard(nop.$name)}] ne $before}]
            set refused [lmap name $names {lindex $heard($name) end 1}]
            foreach server $servers {
                signalServer $server CONT
            }
            say "all servers suspended for $often(-away) s"
            promise "calls by connections that are open go on" [expr {!$lost}]
            promise "owned objects refuse meanwhile" [expr {$often(-away) <= $lease || $refused eq {error error error}}]
        }

        waitFor {[allServe]} 60000
        promise "each name is served again" [expr {![catch {waitFor {[allServed]} 60000}]}]
        set granted [grants]
        foreach name $names {
            set runs [runs [set lines [journal $name]]]
            say "$name: granted [llength [dict get $granted $name]] times, taken by [expr {[llength $runs] / 2}] owners one after another"
            set line [wrong $runs [dict get $granted $name]]
            promise "requests to $name went to its owner alone" [expr {$line eq {}}]
            if {$line ne {}} {
                puts "from line $line on it is not in order; few requests in a row: [brief $lines $runs]"
            }
        }
    } finally {
        foreach server $servers {
            catch {hosts::run $server umount --lazy [file join [hosts::folder $server] data]}
        }
        hosts::end
    }
}
