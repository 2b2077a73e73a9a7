# worldLine.tcl -- a daemon of another process: the line to it, and how it is.
#
# All comes from one line (sorma::peer). A subscription to its object sorm tells of objects, one HEALTH a second that it is still there.
# Nothing comes from a line that has ended: it goes with its peer, and all with the object.

package require sorma::worldDaemon
package provide sorma::worldLine 1.0

namespace eval ::sorma::worldLine {
    variable Silence 1900       ;# ms without an answer, then a daemon counts as silent, at the next beat: within 3 s of its death
}

# An answer to a question of the model. That of a line which has ended is nobody's.
proc ::sorma::worldLine::Answer {peer daemon method status value} {
    if {[namespace which -command $peer] ne {}} {
        $daemon $method $status $value
    }
}

if {![info object isa object ::sorma::worldLine::daemon]} {oo::class create ::sorma::worldLine::daemon}
oo::define ::sorma::worldLine::daemon {
    superclass ::sorma::worldDaemon::daemon
    variable key facts first known heard counted log items
    variable peer               ;# the line; empty: none now
    variable opened             ;# ms, when the line was made
    variable waiting            ;# requests for it, as of ask, when it may yet come
    variable pulsed             ;# ms, when the HEALTH that is not answered was sent; 0: none
    variable told               ;# is there the subscription
    variable wanted             ;# does somebody wait for its objects
    variable asking again       ;# ms, when its objects were asked for; 0: they are not. again: one more such question is wanted
    variable text touched       ;# of that answer; has an object come or gone since
    variable beside             ;# id of after: those beside it are to be asked for
    variable sideways           ;# ms, when they were asked for; 0: the answer is here
    variable greeted            ;# has it let us look

    constructor {itsKey address how} {
        set opened [set pulsed [set told [set wanted [set asking [set again [set touched [set sideways [set greeted 0]]]]]]]]
        set peer [set waiting [set text [set beside {}]]]
        next $itsKey $address $how asking
    }
    destructor {
        my Close
        after cancel $beside
        next
    }
    # gone END -- nothing leads to it: say so, and end. Only from the event loop, never in the midst of a callback of its own.
    method gone end {
        my Close
        my RemoveAll
        if {[dict get $facts how] ni {sibling rpcbind}} {
            ::sorma::discovery::untwin [dict get $facts boot]
        }
        ::sorma::discovery::lead $key {} {}
        my Refuse
        set facts [dict replace $facts state gone since [clock milliseconds]]
        my Leave
        my Tell gone
        ::sorma::worldDaemon::ready
        my destroy
        return 0
    }

    # ---- what programs ask ----

    # May people see it among those that nobody here has named? Its own daemon lets us look then. unsettled: that is not known yet.
    method visible {} {
        return [expr {$greeted && [my answers]}]
    }
    method unsettled {} {
        set fresh [expr {[clock milliseconds] - $first < 1000}]
        set asked [expr {[dict get $facts state] eq "asking" || [my answers] && !$greeted}]
        return [expr {$sideways != 0 || $fresh && $asked && [dict get $facts how] in {sibling rpcbind}}]
    }
    # The sorma::peer; empty: there is no line now.
    method line {} {
        return $peer
    }
    # ask REQUEST MS PREFIX WHO, cancel NUMBER -- as those of sorma::world.
    method ask {request ms prefix {who {}}} {
        if {$peer ne {}} {
            return [$peer ask -timeout $ms -command $prefix -as $who {*}$request]
        }
        lappend waiting [list $request $ms $prefix $who]
        if {[dict get $facts state] ne "asking"} {
            my Refuse
        }
        return
    }
    method Refuse {} {
        foreach item $waiting {
            after 0 [list ::sorma::news::deliver [lindex $item 2] [list error [list "$key: [dict get $facts why]" [list SORMA COMM REFUSED $key]]]]
        }
        set waiting {}
    }
    method cancel number {
        return [expr {$peer ne {} && [$peer cancel $number]}]
    }
    # recount -- ask for all its objects and what they have done; the differences are told.
    method recount {} {
        set wanted 1
        if {[llength $items] > 0} {
            ::sorma::worldDaemon::later [self] takeSome 1
        }
        if {$told && $asking != 0} {
            set again 1                 ;# that answer may be older than what is wanted
        } elseif {$told} {
            my AskObjects
        }
    }
    # count -- ask for its objects, when they are not known and anybody wants to know.
    method count {} {
        if {$told && !$known && $asking == 0 && ($wanted || [::sorma::worldDaemon::inUse])} {
            my AskObjects
        }
    }
    # pulse -- ask for its health now.
    method pulse {} {
        if {$peer ne {} && $pulsed == 0} {
            set pulsed [clock milliseconds]
            $peer health [list [self] Healthy]
        }
    }
    # beat NOW SLEPT -- once a second: is it still there? SLEPT: no event loop has run, so that answers may be waiting for us.
    method beat {now slept} {
        if {$pulsed == 0} {
            my pulse
        } elseif {$peer ne {} && $slept} {
            set pulsed $now
        } elseif {$peer ne {} && $now - $pulsed >= $::sorma::worldLine::Silence} {
            my State silent "no answer: it may be stopped"
        }
    }

    # ---- the line ----

    # leads PLACE -- where its address leads now: a dict of sorma::resolve.
    method leads place {
        if {[dict get $facts called] ne [dict get $place called]} {
            my Set [dict create called [dict get $place called]]
        }
        if {[dict get $facts address] ne [dict get $place address]} {
            my Set [dict create address [dict get $place address]]
            my Close
        }
        switch -- [dict get $place state] {
            known {
                if {$peer eq {} && ([clock milliseconds] - $opened > 900 || $opened <= [::sorma::discovery::moved])} {
                    ::sorma::worldDaemon::later [self] open
                }
            }
            asking { my State asking [dict get $place why] }
            default {
                my State unresolved [dict get $place why]
                my Lost
            }
        }
    }
    # open END -- make the line, when it is its turn. The first request only tells whether a daemon is there.
    method open end {
        if {$peer eq {}} {
            set peer [::sorma::peer open $key -command [list [self] Connected]]
            set opened [set pulsed [clock milliseconds]]
            set known 0
            set log {}
            my Ask {sorm DBX -info class} 60000 Greeted
            foreach request $waiting {
                my ask {*}$request
            }
            set waiting {}
        }
        return 0
    }
    method Close {} {
        set sideways 0
        ::sorma::worldDaemon::never [self]
        if {$peer ne {}} {
            set ended $peer
            set peer [set items {}]
            set told [set asking 0]
            $ended destroy
        }
    }
    method Ask {request ms method} {
        $peer ask -timeout $ms -command [list ::sorma::worldLine::Answer $peer [self] $method] {*}$request
    }
    # It is there, or lost.
    method Connected {} {
        if {![dict get [$peer facts] connected]} {
            # A daemon that closes each connection at once is tried again with the next beat.
            set age [expr {[clock milliseconds] - $opened}]
            my Close
            if {$age > 900} {
                my open 0
            }
            return
        }
        my Set [dict filter [$peer facts] key user host pid boot]
        if {[my IsTwin]} {
            return [my gone 0]
        }
        set pulsed 0
        my pulse
        if {!$told} {
            set told 1
            $peer subscribe -event {[ots][bri][jab]*} -queue 100000 -command [list [self] Happened] sorm
            my count
            my ToObservers lineMade
            ::sorma::news::hint line.made $key
            my AskSiblings
        }
    }
    method Greeted {status value} {
        set greeted [expr {$status eq "ok"}]
        # When it works on something, HEALTH says how it is.
        if {$status ne "ok" && !([string match "SORMA COMM TIMEOUT*" [lindex $value 1]] && [dict get [$peer facts] connected])} {
            my Failed {*}$value
        }
    }
    method Healthy health {
        set pulsed 0
        set heard [clock milliseconds]
        if {[dict get $facts state] ne "denied"} {
            my State [dict get $health state] {} [dict get $health what] [dict get $health since]
            my count
        }
        ::sorma::news::hint heard $key
    }
    # An error as the answer tells the daemon's state.
    method Failed {message code} {
        regsub {^sorm@\S+: } $message {} message
        switch -glob -- $code {
            "SORMA COMM DENIED*" - "SORMA ACCESS*" { return [my State denied $message] }
            "SORMA COMM TIMEOUT*" { my State silent $message }
            "SORMA ADDRESS*" { my State unresolved $message }
            default {
                if {[dict get $facts how] eq "folder" && [string match "SORMA COMM REFUSED*" $code]} {
                    my State dead "its socket is all that is left"
                } else {
                    my State refused $message
                }
            }
        }
        my Lost
    }
    # There is no line to it. The objects of a daemon that is not there are removed; a silent one may come back with all it has.
    method Lost {} {
        my Close
        my Refuse
        if {[dict get $facts state] in {dead refused unresolved}} {
            my RemoveAll
        }
        my Counts
    }

    # ---- its objects ----

    method Happened event {
        switch -- [dict get $event event] {
            sorma.reconnected - sorma.gone { return [my AskObjects] }
            sorma.refused { return [my State denied [dict get $event text]] }
        }
        if {[dict get $event lost] != 0} {
            my AskObjects
        }
        switch -- [dict get $event event] {
            siblings.changed {          ;# of many at once it tells many times
                if {$beside eq {}} {
                    set beside [after 100 [list [self] AskSiblings]]
                }
            }
            object.made - object.removed {
                set touched 1
                if {$asking != 0} {
                    dict set log [dict get $event text] [string range [dict get $event event] 7 end]
                }
            }
        }
        my Take $event
    }
    method AskObjects {} {
        set log {}
        set asking [clock milliseconds]
        my Ask {sorm DBX -inventory objects} 10000 Counted
    }
    method Counted {status value} {
        if {$status eq "error"} {
            set asking 0
            if {![string match "SORMA COMM TIMEOUT*" [lindex $value 1]]} {      ;# then HEALTH says how it is
                my Failed {*}$value
            }
            return
        }
        set before $text
        set text [dict get $value text]
        if {$known && !$touched && $text eq $before && [llength $items] == 0} {
            return [my TookAll]         ;# nothing has happened there since
        }
        set touched 0
        my TakeIn $text $wanted
    }
    method Nonsense {} {
        set asking 0
        my State refused "its answer makes no sense"
    }
    method TookAll {} {
        if {$asking != 0} {             ;# else two answers have come at once
            set counted $asking
        }
        set asking [set wanted 0]
        next
        if {$again} {
            set again 0
            my recount
        }
    }

    # ---- others ----

    # A daemon that was named from elsewhere may be known already, by another address: then it is enough to know it once. Is it this one?
    method IsTwin {} {
        set boot [dict get $facts boot]
        dict for {other daemon} [::sorma::worldDaemon::all] {
            if {$daemon eq [self] || $boot eq {} || [dict get [$daemon facts] boot] ne $boot} continue
            if {[dict get $facts how] in {sibling rpcbind}} {
                ::sorma::discovery::twin $key $boot
                return 1
            } elseif {[dict get [$daemon facts] how] in {sibling rpcbind}} {
                ::sorma::discovery::twin $other $boot
                ::sorma::worldDaemon::later $daemon gone
            }
        }
        return 0
    }
    # Those beside it, when it is reached by TCP.
    method AskSiblings {} {
        after cancel $beside
        set beside {}
        if {$peer ne {} && [dict get $facts how] ni {sibling rpcbind} && ![catch {::sorma::resolve @$key} place] && [dict get $place host] ne {}} {
            set sideways [clock milliseconds]
            my Ask {sorm DBX -inventory siblings} 10000 Siblings
            ::sorma::discovery::host [dict get $place host]
        }
    }
    method Siblings {status value} {
        set sideways 0
        set names {}
        if {$status eq "error" || [catch {
            # A daemon that listens on one interface is reached by that one only.
            set host [dict get [::sorma::resolve @$key] host]
            lmap item [lrange [dict get [dict get $value text] siblings] 0 999] {
                lassign $item name interface port
                if {$interface ni [list 0.0.0.0 :: {} $host] || ![string is integer -strict $port]} continue
                if {[regexp {^[\w.-]{1,64}$} $name]} {
                    dict set names $host:$port $name
                }
                string cat $host : $port
            }
        } addresses]} {
            return
        }
        ::sorma::discovery::lead $key sibling $addresses $names
    }

    export Connected Greeted Healthy Counted Happened AskSiblings Siblings
}
