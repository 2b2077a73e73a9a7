# instruments.tcl ?COUNT? ?SEED? -- an instrument is unplugged so many times in each state, by each kind of line, and plugged in again. Then one answers with
# garbage. It counts settings that were acknowledged and that the instrument does not have, errors without a name, and how long others waited.

source [file join [file dirname [file normalize [info script]]] faults.tcl]

set device [file join $env(SORMA_RUNTIME_DIR) usbtmc0]

# Plug the instrument in: its address.
proc plug by {
    switch -- $by {
        tcp { return tcp:127.0.0.1:[lindex [instrument.sim CTRL -on] 3] }
        hislip { return hislip:127.0.0.1:[lindex [instrument.sim CTRL -hislip] 3] }
        vxi11 { return vxi11:127.0.0.1:[lindex [instrument.sim CTRL -vxi11] 3]/inst0 }
        serial {
            instrument.sim CTRL -link $::device.tty
            return serial:[lindex [instrument.sim CTRL -serial] 3],115200,8n1
        }
        usbtmc {
            set channel [open $::device.port w]
            puts $channel [lindex [instrument.sim CTRL -on] 3]
            close $channel
            return usbtmc:$::device
        }
    }
}
proc unplug {} {
    instrument.sim CTRL -off
    file delete $::device.port
}
proc plays message { return [lindex [instrument.sim EXEC TMSG $message] 3] }
# The reply of a request, or its code. The instrument is in this process, so the request is a future.
proc said args { took [sorma::async {*}$args] }
proc took future {
    waitFor {[$future done]}
    if {[catch {$future take} reply how]} {
        return [lrange [dict get $how -errorcode] 1 2]
    }
    return [lrange $reply 2 end]
}
# Somebody else at the daemon: one request after the other, and how long the slowest has taken [ms].
proc others {d began future} {
    catch {$future take}
    set ::slowest [expr {max($::slowest, [clock microseconds] / 1000.0 - $began)}]
    incr ::asked
    # A rest, or this process would do nothing else.
    after 2 [list next $d]
}
proc next d { sorma::async -command [list others $d [expr {[clock microseconds] / 1000.0}]] echo.a@$d EXEC TMSG 7 }

# states -> the fault on purpose, what is asked, and the error's name
set states {
    idle               {none   VOLT?     {SCPI (LOST|UNREACHABLE)}}
    asked              {silent VOLT?     {SCPI LOST}}
    {within an answer} {half   *IDN?     {SCPI LOST}}
    {within a block}   {half   WAV:DATA? {SCPI LOST}}
    {others wait}      {silent VOLT?     {SCPI LOST}}
    {within a setting} {silent {}        {SCPI LOST}}
}

# Unplug it COUNT times in a state: how many settings were acknowledged, which of them are lost, and what was no error with a name.
proc unplugged {d by state count} {
    lassign [dict get $::states $state] fault question code
    instrument.sim CTRL -kind [if {$question eq "WAV:DATA?"} {string cat oscilloscope} else {string cat supply}] -noise 0
    set object [if {$question eq "WAV:DATA?"} {string cat scpi.psu@$d} else {string cat psu.t@$d}]
    set acknowledged [set lost [set unnamed 0]]
    for {set k 0} {$k < $count} {incr k} {
        said $object CTRL -to [plug $by] -patience 20
        if {$question ne "WAV:DATA?"} {
            set value [expr {int(rand() * 3000) / 100.0}]
            if {[said $object CTRL -voltage $value] eq {}} {
                incr acknowledged
                incr lost [expr {[plays VOLT?] != $value || [lindex [said $object EXEC query VOLT?] 1] != $value}]
            } else {
                incr unnamed
            }
        }
        instrument.sim CTRL -fault $fault
        plays *WAI
        set futures {}
        if {$state ne "idle"} {
            lappend futures [if {$question eq {}} {sorma::async $object CTRL -current 0.5} else {sorma::async $object EXEC query $question}] $code
            if {$state eq "others wait"} {
                lappend futures [sorma::async $object EXEC query *OPC?] {SCPI (LOST|UNREACHABLE)}
            }
            waitFor {[lindex [instrument.sim DBX -heard] 3] eq [if {$question eq {}} {string cat SYST:ERR?} else {set question}]}
        }
        unplug
        if {$state eq "idle"} {
            lappend futures [sorma::async $object EXEC query $question] $code
        }
        foreach {future code} $futures {
            set said [took $future]
            if {![regexp $code $said]} {
                incr unnamed
                puts "$by, $state: $said"
            }
        }
        instrument.sim CTRL -fault none
    }
    return [list $acknowledged $lost $unnamed]
}

# A device that answers each message with bytes of any kind, and sometimes hangs up.
proc liar {channel args} {
    fconfigure $channel -blocking 0 -translation binary -buffering none
    fileevent $channel readable [list apply {channel {
        if {[catch {read $channel} message] || [eof $channel]} {
            return [close $channel]
        }
        set bytes {}
        for {set k [expr {int(rand() * 40)}]} {$k > 0} {incr k -1} {
            append bytes [lindex [list #[expr {int(rand() * 10)}] \n [format %c [expr {int(rand() * 256)}]] [expr {int(rand() * 1000)}] #0 , \; \"] [expr {int(rand() * 8)}]]
        }
        catch {puts -nonewline $channel $bytes\n}
        if {rand() < 0.1} {
            close $channel
        }
    }} $channel]
}

attack {
    lassign [concat $argv [lrange {200 4711} [llength $argv] end]] count seed
    expr {srand($seed)}
    set lines {tcp vxi11 hislip}
    if {[auto_execok socat] ne {}} {
        lappend lines serial
    }
    set driver [file join $env(SORMA_BUILD) .libs usbtmcDriver.so]
    if {[file exists $driver]} {
        lappend lines usbtmc
        set env(USBTMC_FILE) $device
        set env(LD_PRELOAD) [join [list {*}[if {[info exists env(LD_PRELOAD)]} {set env(LD_PRELOAD)}] $driver] :]
    }
    set d [serve {package require sorma}]
    set slowest [set asked 0]
    said echo.a@$d EXEC TMSG 7
    next $d
    set memory [memoryOf $d]
    foreach by $lines {
        set sum {0 0 0}
        foreach state [dict keys $states] {
            set sum [lmap a $sum b [unplugged $d $by $state $count] {expr {$a + $b}}]
        }
        lassign $sum acknowledged lost unnamed
        puts "$by: unplugged $count times in each of [dict size $states] states; $acknowledged settings acknowledged"
        promise "$by: no setting that was acknowledged is lost" [expr {$acknowledged > 0 && $lost == 0}]
        promise "$by: each fault has a name" [expr {$unnamed == 0}]
    }
    set server [socket -server liar -myaddr 127.0.0.1 0]
    said scpi.psu@$d CTRL -to tcp:127.0.0.1:[lindex [fconfigure $server -sockname] 2] -patience 0.05
    array set codes {}
    for {set k 0} {$k < $count} {incr k} {
        foreach request {{query VOLT?} {values VOLT?} {write VOLT 1}} {
            set said [said scpi.psu@$d EXEC {*}$request]
            incr codes([if {[lindex $said 0] in {SCPI SORMA}} {set said} else {string cat answered}])
        }
    }
    puts "garbage: [array get codes]"
    promise "garbage: each fault has a name" [expr {[lsearch -not -regexp [array names codes] {^(answered|SCPI (SILENT|ANSWER|LOST|DEVICE|UNREACHABLE))$}] < 0}]
    close $server
    said scpi.psu@$d CTRL -to [plug tcp] -patience 20
    promise "the next instrument is understood" [expr {[said scpi.psu@$d EXEC query *OPC?] eq "TMSG 1"}]
    puts "others: $asked requests, the slowest took [format %.0f $slowest] ms; memory grew by [megabytes [expr {[memoryOf $d] - $memory}]]"
    # A caller that waited for the instrument would wait for 20 s.
    promise "nobody else waits" [expr {$slowest < 5000 && $asked > 0}]
    promise "memory does not grow" [expr {[memoryOf $d] - $memory < 20000000}]
    sorma::remove instrument.sim
}
