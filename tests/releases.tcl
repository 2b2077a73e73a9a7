# releases.tcl -- do a client and a daemon of two releases understand each other? Whichever is the newer one.
#
#     build/env tclsh8.6 tests/releases.tcl OTHER_BUILD     clients of this build with daemons of the other one, then the reverse
#     build/env tclsh8.6 tests/releases.tcl -daemons BUILD  clients of this build only
#
# Writes a line for each case: ok, or what came and what was expected. Exits with 1 unless all are ok. The cases use only words
# that the other release has, too.
package require sorma
fconfigure stdout -buffering line

# ---- daemons ----

# A command that comes from a build and from no other one.
proc from build { list env -u TCLLIBPATH -u LD_LIBRARY_PATH $build/env }
proc startDaemon {name {port 0}} {
    global Build Pipes
    set pipe [open [list | {*}[from $Build] sormad -name $name -port $port 2>@ stderr] r]
    if {![regexp {^ready \S+ .*\mtcp=(\d+)} [gets $pipe] -> port]} {
        error "no daemon from $Build"
    }
    dict set Pipes $name $pipe
    return $port
}
# signal: KILL; or TERM, at which a daemon says goodbye.
proc stopDaemon {name signal} {
    global Pipes
    set pipe [dict get $Pipes $name]
    dict unset Pipes $name
    exec kill -$signal [pid $pipe]
    catch {close $pipe}
}

# Turn the event loop until a condition holds, 60 s at most.
proc await condition {
    set end [expr {[clock milliseconds] + 60000}]
    while {![uplevel 1 [list expr $condition]]} {
        if {[clock milliseconds] > $end} {
            error "waited in vain for $condition"
        }
        after 5 {set ::Turned 1}
        vwait ::Turned
    }
}
proc codeOf script {
    catch {uplevel 1 $script} message options
    return [lrange [dict get $options -errorcode] 0 2]
}
proc underway where { dict get [sorma::health $where] underway }

# ---- cases: name, body, and what it returns. The place of the daemon is in $where, its name in $name, its port in $port ----

set Cases {
    {who it is, and who we are} {
        list [string equal [dict get [sorma::health $where] name] $name] \
            [string match "*$::tcl_platform(user)@*" [sorm@$where CTRL -connections]]
    } {1 1}
    {all parts of a message} {
        echo.a@$where EXEC FMSG 2 1.5 -3 IMSG 3 -1 0 9000000000 TMSG "\u00e4 \{"
    } "RET 0 TMSG \u00e4\\ \\\{ FMSG 2 1.5 -3.0 IMSG 3 -1 0 9000000000"
    {a message of 3 MB} {
        set text [string repeat 0123456789 300000]
        string equal [lindex [echo.a@$where EXEC TMSG $text] 3] $text
    } 1
    {an error has the daemon's symbol} { codeOf {echo.a@$where CTRL -delay -1} } {SORMA OPTION RANGE}
    {a class that is not there} { codeOf {nosuch.a@$where EXEC} } {SORMA NAME UNKNOWN_CLASS}
    {an option is set and read} {
        echo.b@$where CTRL -delay 0.25
        echo.b@$where cget -delay
    } 0.25
    {200 calls at a time} {
        echo.slow@$where CTRL -delay 0.05
        set sum 0
        foreach f [lmap k [lrepeat 200 1] {sorma::async echo.slow@$where EXEC IMSG 1 $k}] {
            incr sum [lindex [$f wait] end]
        }
        set sum
    } 200
    {a call is cancelled here and there} {
        echo.late@$where CTRL -delay 600
        set f [sorma::async echo.late@$where EXEC]
        await {[underway $where] == 1}
        set was [$f cancel]
        await {[underway $where] == 0}
        list $was [codeOf {$f wait}]
    } {1 {SORMA COMM CANCELLED}}
    {a deadline ends a call here and there} {
        echo.late@$where CTRL -delay 600
        set code [codeOf {[sorma::async -timeout 200 echo.late@$where EXEC] wait}]
        await {[underway $where] == 0}
        set code
    } {SORMA COMM TIMEOUT}
    {a one-way request} {
        sorma::async -oneway echo.way@$where CTRL -delay 0.5
        await {[echo.way@$where cget -delay] == 0.5}
    } {}
    {events} {
        set ::Events {}
        set s [sorma::subscribe sorm@$where -event dictionary.changed -command {lappend ::Events}]
        foreach word {one two} {
            dict@$where CTRL -add echo.$word -delay 1
        }
        await {[llength $::Events] == 2}
        sorma::unsubscribe $s
        lmap e $::Events {dict get $e text}
    } {echo.one echo.two}
    {a daemon says that it is alive} {
        dict get [sorma::health $where] state
    } alive
    {another daemon in its place: the call is answered, and says what is lost} {
        echo.r@$where CTRL -delay 0.01
        stopDaemon $name TERM
        startDaemon $name $port
        list [string match "*TMSG here*" [echo.r@$where EXEC TMSG here]] [string match "*-delay 0.01*" [sorma::trail]] \
            [expr {[echo.r@$where cget -delay] == 0}]
    } {1 1 1}
    {a subscription outlives its daemon} {
        set ::Events {}
        set s [sorma::subscribe sorm@$where -event dictionary.changed -command {lappend ::Events}]
        stopDaemon $name KILL
        startDaemon $name $port
        await {[lsearch -glob [lmap e $::Events {dict get $e event}] sorma.reconnected] >= 0}
        dict@$where CTRL -add echo.three -delay 1
        await {[lsearch -exact [lmap e $::Events {expr {[dict exists $e text] ? [dict get $e text] : {}}}] echo.three] >= 0}
        sorma::unsubscribe $s
    } {}
    {a call whose daemon is killed} {
        echo.late@$where CTRL -delay 600
        set f [sorma::async echo.late@$where EXEC]
        await {[underway $where] == 1}
        stopDaemon $name KILL
        startDaemon $name $port
        codeOf {$f wait}
    } {SORMA COMM LOST}
}

proc clients build {
    global Build Cases
    set Build $build
    set wrong 0
    set name releases[pid]
    set port [startDaemon $name]
    foreach way {shm unix tcp} where [list $name $name 127.0.0.1:$port] {
        # A release of before has no such option: its lines stay sockets.
        catch {sorma::configure -transport [expr {$way eq "shm" ? "shm" : "unix"}]}
        foreach {title body expected} $Cases {
            set came [catch {apply [list {where name port} $body] $where $name $port} result]
            set ok [expr {$came == 0 && $result eq $expected}]
            incr wrong [expr {!$ok}]
            puts "$way, $title: [expr {$ok ? "ok" : "\"$result\" instead of \"$expected\""}]"
        }
    }
    stopDaemon $name TERM
    return $wrong
}

lassign $argv first build
if {$first eq "-cases"} {
    puts [expr {[llength $Cases] / 3}]
    exit
}
if {$first eq "-daemons"} {
    exit [expr {[clients [file normalize $build]] > 0}]
}
set other [file normalize $first]
puts "clients of $env(SORMA_BUILD), daemons of $other"
set wrong [clients $other]
puts "clients of $other, daemons of $env(SORMA_BUILD)"
incr wrong [catch {exec {*}[from $other] [info nameofexecutable] [info script] -daemons $env(SORMA_BUILD) >@ stdout 2>@ stderr}]
exit [expr {$wrong > 0}]
