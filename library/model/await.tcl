# await.tcl -- wait for the model: for programs that show what they have asked for and then go on. Nothing of the model itself waits.
#
# In a coroutine only that is suspended; elsewhere the event loop runs meanwhile.

package require sorma::table
package provide sorma::await 1.0

namespace eval ::sorma::await {
    namespace export until sleep daemons answers answer settle trouble
    namespace ensemble create
    variable Waits              ;# array: token -> coroutine that waits; empty: a caller that blocks
    variable Last 0
    variable Woken {}           ;# id of after
    if {![array exists Waits]} {
        array set Waits {}
    }
}

# ::sorma::await::until MS EXPRESSION --
#       Wait until an expression, of variables of the caller, is true, but no longer than MS. It is looked at again whenever the model
#       has heard of a daemon.
# Results:
#       Is it true?
proc ::sorma::await::until {ms expression} {
    variable Waits
    variable Last
    set end [expr {[clock milliseconds] + $ms}]
    set token [incr Last]
    set Waits($token) [info coroutine]
    try {
        while {![uplevel 1 [list expr $expression]]} {
            if {![Suspended $token [expr {$end - [clock milliseconds]}]]} {
                return 0
            }
        }
        return 1
    } finally {
        unset -nocomplain Waits($token)
    }
}

# ::sorma::await::sleep MS -- let time pass.
proc ::sorma::await::sleep ms {
    until $ms 0
    return
}

# ::sorma::await::daemons MS WHERES ?counted? --
#       Ask daemons how they are, or with counted for all their objects, and wait for the answers. Those that do not come in time are
#       waited for a little longer: it may turn out that the daemon is busy.
# Results:
#       WHERE KEY TROUBLE ..., as find and trouble give them.
proc ::sorma::await::daemons {ms wheres {what heard}} {
    set keys [lmap where $wheres {::sorma::world use $where}]
    set open {}
    set begun [clock milliseconds]
    foreach key $keys {
        if {$key ni {{} self}} {
            ::sorma::worldDaemon::fact $key pulse
            if {$what eq "counted"} {
                ::sorma::worldDaemon::fact $key recount
            }
            dict set open $key 1
        }
    }
    until $ms {[StillOpen $what $begun {asking alive busy} open] == 0}
    until 300 {[StillOpen $what $begun {asking alive} open] == 0}
    return [concat {*}[lmap where $wheres key $keys {
        # It may have been busy for a moment, and yet have answered.
        set well [expr {$what eq "counted" && $key ne {} && [::sorma::worldDaemon::fact $key $what 0] >= $begun}]
        list $where $key [if {!$well} {trouble $where [dict exists $open $key]}]
    }]]
}

# How many have not answered since a time? Those that have, or never will, are taken out.
proc ::sorma::await::StillOpen {what since states openVar} {
    upvar 1 $openVar open
    foreach key [dict keys $open] {
        set known [::sorma::world get $key]
        if {$known eq {} || [dict get $known state] ni $states || [::sorma::worldDaemon::fact $key $what 0] >= $since
                || ([dict get $known state] eq "asking" && [dict get $known why] ne {})} {
            dict unset open $key
        }
    }
    return [dict size $open]
}

# ::sorma::await::answers MS WHERES REQUEST ?REQUEST ...? -- wait until all have answered, or failed.
proc ::sorma::await::answers {ms wheres args} {
    set pairs {}
    foreach where $wheres {
        foreach request $args {
            ::sorma::table answer $where $request       ;# asks, when it is old
            lappend pairs [list $where $request]
        }
    }
    until $ms {[Unanswered pairs] == 0}
    return
}
proc ::sorma::await::Unanswered pairsVar {
    upvar 1 $pairsVar pairs
    set pairs [lmap pair $pairs {
        if {![dict get [::sorma::table answer {*}$pair] open]} continue
        set pair
    }]
    return [llength $pairs]
}

# ::sorma::await::settle MS -- wait for what has just been asked for the first time. Was there anything?
proc ::sorma::await::settle ms {
    if {[::sorma::table open] == 0 && ![Counting]} {
        return 0
    }
    until $ms {[::sorma::table open] == 0 && ![Counting]}
    return 1
}
proc ::sorma::await::Counting {} {
    foreach key [::sorma::world keys] {
        if {[dict get [::sorma::world get $key] state] in {asking alive} && [::sorma::worldDaemon::fact $key counted 0] == 0
                && [clock milliseconds] - [dict get [::sorma::world get $key] since] < 300} {
            return 1
        }
    }
    return 0
}

# ::sorma::await::answer WHERE REQUEST MS -- the text of the answer to a request that is sent now. Fails as the request does.
proc ::sorma::await::answer {where request ms} {
    variable Replies
    variable Last
    lassign [daemons 400 [list $where]] - key
    set token r[incr Last]
    set Replies($token) {}
    if {$key eq {}} {
        set place [::sorma::resolve @$where]
        set Replies($token) [list error [list [dict get $place why] [list SORMA ADDRESS UNRESOLVED $where]]]
    } else {
        ::sorma::world ask $key $request -timeout $ms -command [list ::sorma::await::Reply $token]
    }
    try {
        until [expr {$ms + 1000}] {$::sorma::await::Replies($token) ne {}}
        set found $Replies($token)
    } finally {
        unset Replies($token)
    }
    lassign $found status value
    if {$status eq "ok"} {
        return [dict get $value text]
    }
    lassign [if {$status eq {}} {list {no answer} [list SORMA COMM TIMEOUT $where]} else {set value}] message code
    return -code error -errorcode $code [string cat [if {$where ne {}} {string cat "daemon $where: "}] [regsub {^(?:sorm@\S+|[^\s:]+): (?=the dictionary has no entry)|^sorm@\S+: } $message {}]]
}
proc ::sorma::await::Reply {token args} {
    variable Replies
    if {[info exists Replies($token)]} {
        set Replies($token) $args
        WakeAll
    }
}

# ::sorma::await::trouble WHERE ?silent? -- why a daemon gives no answer, in one line for people; empty when it does. silent: it has let
# us wait just now. The remains of a dead daemon are removed, so they are mentioned once.
proc ::sorma::await::trouble {where {silent 0}} {
    set key [::sorma::world find $where]
    if {$key eq {}} {
        return [if {[catch {::sorma::resolve @$where} place]} {set place} else {dict get $place why}]
    }
    set daemon [::sorma::world get $key]
    switch -- [dict get $daemon state] {
        alive { return [if {$silent} {string cat "no answer: it may be stopped"}] }
        busy { return "busy with [dict get $daemon busy], for [expr {[clock milliseconds] - [dict get $daemon since]}] ms" }
        silent { return "no answer: it may be stopped" }
        asking { return [if {[dict get $daemon why] eq {}} {string cat "no answer: it may be stopped"} else {dict get $daemon why}] }
        dead {
            set name [file rootname [file tail [dict get $daemon address]]]
            if {![catch {::sorma::SweepSocket $name} swept] && $swept} {
                return "dead: its socket was all that was left, and has been removed"
            }
            return "dead: its socket is all that is left"
        }
    }
    return [dict get $daemon why]
}

# ---- waiting ----

# Suspend the coroutine, or run the event loop, for some time, or until something happens. 0: the time is over.
proc ::sorma::await::Suspended {token ms} {
    variable Waits
    if {$ms <= 0} {
        return 0
    }
    set timer [after $ms [list ::sorma::await::Wake $token]]
    set coroutine $Waits($token)
    if {$coroutine ne {}} {
        # It may be deleted, and another one be called as it was: that must not be woken.
        set gone [list unset -nocomplain ::sorma::await::Waits($token)]
        trace add command $coroutine delete "$gone ;#"
        set blocked [catch yield]
        trace remove command $coroutine delete "$gone ;#"
        if {$blocked} {                 ;# there is C code in between
            set coroutine {}
            set Waits($token) {}
        }
    }
    if {$coroutine eq {}} {
        vwait ::sorma::await::Waits($token)
    }
    after cancel $timer
    return 1
}

proc ::sorma::await::Wake token {
    variable Waits
    if {![info exists Waits($token)]} {
        return
    }
    if {$Waits($token) eq {}} {
        set Waits($token) {}
    } elseif {[namespace which -command $Waits($token)] ne {}} {
        $Waits($token)
    }
}

# The model has heard of something; of many things at once they who wait are told once.
proc ::sorma::await::Heard args {
    variable Woken
    variable Waits
    if {$Woken eq {} && [array size Waits] > 0} {
        set Woken [after 0 ::sorma::await::WakeAll]
    }
}
proc ::sorma::await::WakeAll {} {
    variable Woken
    variable Waits
    after cancel $Woken
    set Woken {}
    foreach token [array names Waits] {
        Wake $token
    }
}

::sorma::news::hook {daemon.here daemon.changed daemon.gone counted heard answer line.made} ::sorma::await::Heard
