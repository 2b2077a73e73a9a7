# launchDaemon.tcl -- one daemon of sorma-launch: its process, its state, and when it is started again.
#
# States: waiting (not yet started), starting (no "ready" yet), ready, pausing (before a restart), stopping, ended (for good).
# In two more it is being ended: late (it was not ready in time), alone (it would share its name with nobody).

package require sorma
package require sorma::launchForward
package provide sorma::launchDaemon 1.0

namespace eval ::sorma::launch {
    variable Steady 60000   ;# ms of service after which restarts are counted from 0 again
    variable Longest 4000   ;# characters of a line that are shown in one piece
}

oo::class create ::sorma::launch::Daemon {
    variable Launcher
    variable Name
    variable Settings       ;# as launchFile::read gives them
    variable State
    variable Pipe           ;# its standard input and output, while there is a process
    variable Pid
    variable Part           ;# the beginning of a line that has not ended
    variable Marks          ;# of the line that is being shown: "|", then ":" for its further pieces
    variable Last           ;# lines that it said last, for errors
    variable Begun          ;# ms: when it was started; when it got ready
    variable Restarts       ;# in a row
    variable Timer          ;# after: of readiness, pause or grace
    variable Killed         ;# has SIGKILL been sent?
    variable Forward        ;# its socket on this host, when it runs on another one; empty: there is none
    variable As             ;# the name that it serves; Name is what it is called here
    variable Role           ;# what it has said since it was started: {} nothing yet; standby; ready; former: another one has the name

    constructor {launcher name settings} {
        namespace path ::sorma::launch
        set Launcher $launcher
        set Name $name
        set Settings $settings
        set As [dict get $settings as]
        set Role {}
        set State waiting
        set Pipe {}
        set Restarts 0
        set Timer {}
        set Forward {}
    }

    destructor {
        my EndForward
    }

    method state {} {
        return $State
    }

    method after {} {
        return [dict get $Settings -after]
    }

    # How long may it take to get ready [s]?
    method patience {} {
        return [dict get $Settings -ready]
    }

    # Does it own the name that it shares with others?
    method owns {} {
        return [expr {$Role eq "ready"}]
    }

    # Nothing to wait for any more: it is ready, or it has failed at least once.
    method settled {} {
        return [expr {$State in {ready ended pausing} || $Restarts > 0}]
    }

    # ---- its life ----

    method start {} {
        set Part {}
        set Marks |
        set Last {}
        set Killed 0
        set Role {}
        set Begun [clock milliseconds]
        set State starting
        set where [expr {[dict get $Settings -on] eq {} ? {} : " on [dict get $Settings -on]"}]
        try {
            set Pipe [open [list | setsid sh -c [commandText $As $Settings] 2>@1] r+]
        } on error message {
            my Over "cannot be started: $message" 1
            return
        }
        set Pid [lindex [pid $Pipe] 0]
        fconfigure $Pipe -blocking 0 -encoding utf-8 -translation lf
        catch {fconfigure $Pipe -profile replace}       ;# Tcl 9 is strict otherwise
        fileevent $Pipe readable [namespace code {my Readable}]
        $Launcher say * "$Name is started$where, process $Pid"
        my Later [dict get $Settings -ready] Late
        ::sorma::AtEnd $Pid [namespace code {my Ended}]
    }

    # Its output is read until there is none; that it has ended is told by the process, not by what it closes.
    method Readable {} {
        if {![my Take] && [eof $Pipe]} {
            fileevent $Pipe readable {}
        }
    }

    # Take what is there, at most 64 K. False: there was nothing.
    method Take {} {
        set came [read $Pipe 65536]
        set lines [split $Part$came \n]
        set Part [lindex $lines end]
        foreach line [lrange $lines 0 end-1] {
            my Line [string trimright $line \r] 1
        }
        if {[string length $Part] > $::sorma::launch::Longest} {
            my Line $Part 0
            set Part {}
        }
        return [expr {$came ne {}}]
    }

    # Show a line, or a piece of one that goes on.
    method Line {line whole} {
        set longest $::sorma::launch::Longest
        if {$State in {starting ready} && $Role in {{} standby} && $Marks eq "|" && [regexp "^(ready|standby) [string map {. \\.} $As]( |\$)" $line -> role]} {
            my Says $role $line
        }
        for {set at 0} {$at == 0 || $at < [string length $line]} {incr at $longest} {
            set piece [string range $line $at [expr {$at + $longest - 1}]]
            $Launcher say $Name $piece {} $Marks
            set Marks :
            set Last [lrange [list {*}$Last [string range $piece 0 199]] end-9 end]
        }
        if {$whole} {
            set Marks |
        }
    }

    # It is ready: it serves, or it stands by. Or it stood by, and serves now.
    method Says {role line} {
        set was $Role
        if {$role eq $was} return
        set Role $role
        if {[dict get $Settings -one-of] && $role eq "standby" && ![string match "* directory=*" $line]} {
            set State alone
            my End
            return
        }
        if {$role eq "ready" && $was eq "standby"} {
            $Launcher takesOver $Name
        }
        my Ready $line
    }

    # Another one has the name now.
    method former {} {
        if {$Role eq "ready"} {
            set Role former
            my EndForward
        }
    }

    method Ready line {
        if {[dict get $Settings -on] ne {} && $Forward eq {} && [regexp { unix=(/[^ ]*)} $line -> remote] &&
                [dict get $Settings -ssh] ne {} && ![file exists [::sorma::RuntimeSocket $As]]} {
            # Those that come after this one wait for it only at its start.
            set seconds [expr {$State eq "starting" ? 5 : 20}]
            if {$State eq "starting"} {
                after cancel $Timer
            }
            set Forward [Forward new $As [dict get $Settings -ssh] [dict get $Settings -on] $remote $seconds \
                [namespace code {my Forwarded}]]
        } elseif {$State eq "starting"} {
            my Serves
        }
    }

    # Without its socket here it is ready, too, for callers that reach it by TCP.
    method Forwarded {here {why {}}} {
        if {!$here} {
            $Launcher say * "$Name: its socket is not to be had on this host: $why" 33
            my EndForward
        }
        if {$State eq "starting"} {
            my Serves
        }
    }

    method EndForward {} {
        if {$Forward ne {}} {
            $Forward destroy
            set Forward {}
        }
    }

    method Serves {} {
        after cancel $Timer
        set State ready
        set took [format %.1f [expr {([clock milliseconds] - $Begun) / 1000.0}]]
        set Begun [clock milliseconds]
        after 0 [list $Launcher gotReady $Name $took $Role]  ;# when its line has been shown
    }

    method Late {} {
        set State late
        my End
    }

    # The process has ended. It is not reaped before its pipe is closed: until then its session can be killed by
    # number.
    method Ended {} {
        after cancel $Timer
        my EndForward
        ::sorma::Signal -$Pid KILL
        fileevent $Pipe readable {}
        for {set n 0} {$n < 32 && [my Take]} {incr n} {}        ;# no more than a pipe holds: others may go on writing
        if {$Part ne {}} {
            my Line $Part 1
        }
        fconfigure $Pipe -blocking 1
        set failed [catch {close $Pipe} message options]
        set Pipe {}
        set how "has ended"
        if {$failed} {
            lassign [dict get $options -errorcode] kind - what
            set how [switch -- $kind {
                CHILDSTATUS { my StatusText $what }
                CHILDKILLED { string cat "was killed by " $what }
                default { string cat "ended: " $message }
            }]
        }
        my Over $how $failed
    }

    # ssh ends with 255 when it does not reach the host, or loses it.
    method StatusText status {
        set text "ended with status $status"
        if {$status == 255 && [dict get $Settings -on] ne {}} {
            append text " (ssh: no connection to [dict get $Settings -on])"
        }
        return $text
    }

    # There is no process any more. how: what to say of it.
    method Over {how failed} {
        set was $State
        set Role {}
        if {[$Launcher stopping]} {
            set State ended
            if {$Killed && [$Launcher stopping] == 1} {
                set how "did not end in [dict get $Settings -grace] s and was killed"
            }
            if {$how eq "was killed by SIGTERM"} {      ;# as it was asked to
                set how "has ended"
                set failed 0
            }
            if {$failed} {
                $Launcher failed
            }
            $Launcher say * "$Name $how" [expr {$failed ? 31 : {}}]
            $Launcher goOn
            return
        }
        switch -- $was {
            late { set how "was not ready in [dict get $Settings -ready] s and was ended" ; set failed 1 }
            alone {
                set how "stands by on its own host alone, since no dictionary there has @directory: it would serve $As beside the others. Give it one with -dict; it was ended"
                set failed 1
            }
            starting { append how " before it was ready" ; set failed 1 }
            ready {
                if {[clock milliseconds] - $Begun >= $::sorma::launch::Steady} {
                    set Restarts 0
                }
            }
        }
        set policy [dict get $Settings -restart]
        set wanted [expr {$was ne "alone" && ($policy eq "always" || ($policy eq "failure" && $failed))}]
        if {$wanted && $Restarts < [dict get $Settings -limit]} {
            set pause [format %g [expr {min(30, [dict get $Settings -pause] * 2**min($Restarts, 20))}]]
            incr Restarts
            set State pausing
            set how "$how; restart $Restarts of [dict get $Settings -limit] in $pause s"
            $Launcher say * "$Name $how" [expr {$failed ? 31 : {}}]
            my Later $pause start
            after 0 [list $Launcher startDue]           ;# perhaps nobody waits for it
            return
        }
        set State ended
        if {$wanted} {
            set failed 1
            if {$Restarts > 0} {
                append how ", and was restarted $Restarts times in vain"
            }
        }
        $Launcher gone $Name $failed [dict get $Settings -essential] "[dict get $Settings place]: daemon $Name $how" $Last
    }

    # ---- the end ----

    # Ask it to end. Returns whether there is something to wait for.
    method stop {} {
        switch -- $State {
            starting - ready { my End }
            late - alone - stopping {}
            default {
                after cancel $Timer
                set State ended
                return 0
            }
        }
        set State stopping
        return 1
    }

    # On another host it sees its standard input end, through ssh; here also when something stands between: sudo.
    method End {} {
        catch {close $Pipe write}
        if {[dict get $Settings -on] eq {}} {
            ::sorma::Signal $Pid TERM
        }
        my Later [dict get $Settings -grace] kill
    }

    method kill {} {
        if {$Pipe ne {}} {
            set Killed 1
            ::sorma::Signal -$Pid KILL
        }
    }

    method Later {seconds method} {
        after cancel $Timer
        set Timer [after [expr {round(1000 * $seconds)}] [namespace code [list my $method]]]
    }
}
