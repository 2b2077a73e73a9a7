# value.tcl -- values of objects that change, for sorma::world value: shared by all who look at the same.
#
# Options are read once (sorm DBX -describe, which makes nothing); from then on the daemon tells of each CTRL. What changes by
# itself, and what EXEC answers, is asked for again and again, as often as the most eager one wants it.
#
# A value is a dict: value, state (live, stale: it may be old; refused; gone: there is no such object), by (who set it, when that was
# told), at (ms, when it came), why (not live), age and seen (of a stale value: such as "12 s old", which why
# has, too, and the ms when it was last so; else empty and 0). Tellings are dicts: -option -> value, or REQUEST -> value, of those that are new, gathered for 20 ms.
#
# A value is stale while its daemon does not answer, and while a question for it has waited for 2 s, as behind a long request. As long as
# that lasts it is told again each second, with its age.

package provide sorma::value 1.0         ;# before what needs it in turn
package require sorma::line
package require sorma::text
package require sorma::world

namespace eval ::sorma::value {
    namespace export new forget inUse
    variable Overdue 2000       ;# ms without an answer, then values may be old
    variable Away {silent dead refused unresolved}      ;# states of a daemon that does not answer
    namespace ensemble create
    # dict: {object@daemon what} -> {values timer asking waits seen fresh newer tokens stale}. what: options, or a request; waits: of the
    # question that is under way, after; seen: ms, of the last answer, 0: none; newer: dict of options that were told to have changed since
    # they were asked for: the answer may be older; tokens: dict whose keys are those who look; stale: has All said so since the last answer
    variable Sources
    variable At                 ;# dict: daemon -> dict: object@daemon -> dict whose keys are its sources
    variable Fresh              ;# dict whose keys are the sources that have something to tell
    variable Telling            ;# is a callback on the stack
    variable Tokens             ;# dict: token -> {source option command}; option empty: all
    if {![info exists Tokens]} {
        set Sources [set Tokens [set At [set Fresh {}]]]
        set Telling 0
    }
}

# ::sorma::value::new TOKEN NAME WHAT EVERY COMMAND -- begin; for sorma::world value.
proc ::sorma::value::new {token name what every command} {
    variable Sources
    variable Tokens
    variable At
    variable Fresh
    set key [join [::sorma::line::place $name] @]
    set option {}
    if {[lindex $what 0] eq "EXEC"} {
        set source [list $key $what]
        if {$every == 0} {
            set every 1000
        }
    } else {
        set source [list $key options]
        if {$what ne "*"} {
            set option $what
        }
    }
    if {![dict exists $Sources $source]} {
        dict set Sources $source [dict create values {} timer {} asking 0 waits {} seen 0 fresh {} newer {} tokens {} stale 0]
        dict set At [lindex [::sorma::line::place $key] 1] $key $source 1
    }
    dict set Tokens $token [dict create source $source name $name option $option command $command every $every begun 0]
    dict set Sources $source tokens $token 1
    dict set Fresh $source 1
    if {[dict size [dict get $Sources $source values]] > 0} {
        Soon                            ;# what is known already
    }
    after 0 [list ::sorma::value::Ask $source]
    return $token
}

# ::sorma::value::forget TOKEN -- nothing comes after this.
proc ::sorma::value::forget token {
    variable Sources
    variable Tokens
    variable At
    variable Fresh
    if {![dict exists $Tokens $token]} {
        return
    }
    set source [dict get $Tokens $token source]
    dict unset Tokens $token
    dict unset Sources $source tokens $token
    if {[llength [Listeners $source]] == 0} {
        after cancel [dict get $Sources $source timer]
        after cancel [dict get $Sources $source waits]
        dict unset Sources $source
        dict unset Fresh $source
        set key [lindex $source 0]
        set daemon [lindex [::sorma::line::place $key] 1]
        dict unset At $daemon $key $source
        if {[dict size [dict get $At $daemon $key]] == 0} {
            dict unset At $daemon $key
        }
        if {[dict size [dict get $At $daemon]] == 0} {
            dict unset At $daemon
        }
    }
}

# ::sorma::value::inUse -- does anybody look?
proc ::sorma::value::inUse {} {
    variable Tokens
    return [expr {[dict size $Tokens] > 0}]
}

proc ::sorma::value::Listeners source {
    variable Sources
    return [dict keys [dict get $Sources $source tokens]]
}

# Ask for it now, when the model knows its object; looking makes none.
proc ::sorma::value::Ask source {
    variable Sources
    if {![dict exists $Sources $source] || [dict get $Sources $source asking]} {
        return
    }
    lassign $source key what
    lassign [::sorma::line::place $key] name daemon
    after cancel [dict get $Sources $source timer]
    # EXEC would make an object: it must be known to be there, also in a new process.
    if {[::sorma::world get $key] eq {} || $what ne "options" && ![::sorma::world knows $daemon]} {
        if {[::sorma::world get $key] eq {}} {
            set known [::sorma::world get $daemon]
            if {[Answers $daemon] && [::sorma::world knows $daemon]} {
                All $source gone "there is no such object"
            } elseif {$known ne {} && [dict get $known state] in $::sorma::value::Away} {
                All $source stale [Why $source]         ;# it was so before anybody looked
            }
        }
        return [Again $source]
    }
    dict set Sources $source asking 1
    Await $source
    dict set Sources $source newer {}
    set request [if {$what eq "options"} {list sorm DBX -describe $name} else {list $name {*}$what}]
    ::sorma::world ask $daemon $request -command [list ::sorma::value::Answered $source]
}

# Its values may be old when no answer has come for a while.
proc ::sorma::value::Await source {
    variable Sources
    variable Overdue
    dict set Sources $source waits [after $Overdue [list ::sorma::value::Waited $source [expr {[clock milliseconds] + $Overdue}]]]
}

# due: ms, when this was to be called. Where no event loop has run meanwhile, the answer may be here unread.
proc ::sorma::value::Waited {source due} {
    if {[clock milliseconds] - $due > 500} {
        Await $source
    } else {
        All $source stale [Why $source]
    }
}

# Does a daemon answer?
proc ::sorma::value::Answers daemon {
    set facts [::sorma::world get $daemon]
    return [expr {$facts ne {} && [dict get $facts state] in {alive busy}}]
}

# Why there is no answer.
proc ::sorma::value::Why source {
    set daemon [lindex [::sorma::line::place [lindex $source 0]] 1]
    set facts [::sorma::world get $daemon]
    if {$facts eq {}} {
        return "daemon $daemon is gone"
    } elseif {[dict get $facts why] ne {}} {
        return [dict get $facts why]
    }
    return [switch -- [dict get $facts state] {
        busy { string cat "its daemon is busy in " [dict get $facts busy] }
        alive { string cat "no answer yet: it may work on a long request" }
        default { string cat "its daemon is " [dict get $facts state] }
    }]
}

proc ::sorma::value::Again source {
    variable Sources
    variable Tokens
    set every 0
    foreach token [Listeners $source] {
        set wish [dict get $Tokens $token every]
        if {$wish > 0 && ($every == 0 || $wish < $every)} {
            set every $wish
        }
    }
    if {$every > 0} {
        dict set Sources $source timer [after $every [list ::sorma::value::Ask $source]]
    }
}

proc ::sorma::value::Answered {source status value} {
    variable Sources
    if {![dict exists $Sources $source]} {
        return
    }
    dict set Sources $source asking 0
    after cancel [dict get $Sources $source waits]
    lassign $source key what
    if {$status eq "ok" || ![string match "SORMA COMM*" [lindex $value 1]]} {
        dict set Sources $source stale 0
        dict set Sources $source seen [clock milliseconds]
    }
    if {$status eq "error"} {
        lassign $value message code
        switch -glob -- $code {
            "SORMA COMM TIMEOUT*" { All $source stale [Why $source] }
            "SORMA COMM DENIED*" { All $source refused $message }
            "SORMA SERVICE GONE*" { All $source gone $message }
            default { All $source [if {[string match "SORMA COMM*" $code]} {string cat stale} else {string cat refused}] $message }
        }
    } elseif {$what ne "options"} {
        Put $source $what $value live {} {}
    } elseif {[catch {
        set table [dict get $value text]
        if {![dict get $table exists]} {
            All $source gone "there is no such object"
        } else {
            # Why nothing was known is not told any more.
            foreach part {values fresh} {
                dict set Sources $source $part [dict remove [dict get $Sources $source $part] *]
            }
            foreach option [dict get $table options] {
                if {[dict exists $Sources $source newer [lindex $option 0]]} continue
                Put $source [lindex $option 0] [lindex $option 5] live {} {}
            }
        }
    } message]} {
        All $source refused "its daemon's answer makes no sense"
    }
    Again $source
}

# One value, as it is now.
proc ::sorma::value::Put {source item value state by why} {
    variable Sources
    set at [clock milliseconds]
    set known [dict get $Sources $source values]
    if {[dict exists $known $item]} {
        set before [dict get $known $item]
        if {[dict get $before value] eq $value && [dict get $before state] eq $state && [dict get $before why] eq $why} {
            return
        }
        if {$by eq {} && [dict get $before value] eq $value} {
            set by [dict get $before by]
            set at [dict get $before at]
        }
    }
    dict set Sources $source values $item [dict create value $value state $state by $by at $at why $why age {} seen 0]
    New $source $item
}
proc ::sorma::value::New {source item} {
    variable Sources
    variable Fresh
    dict set Sources $source fresh $item 1
    dict set Fresh $source 1
    Soon
}

# All values that are known have another state.
proc ::sorma::value::All {source state why} {
    variable Sources
    if {$state eq "stale"} {
        dict set Sources $source stale 1
        ::sorma::timer::once value.age 1000 ::sorma::value::Grow
    }
    set values [dict get $Sources $source values]
    if {[dict size $values] == 0} {
        lassign $source key what
        foreach token [Listeners $source] {
            set option [dict get $::sorma::value::Tokens $token option]
            Put $source [if {$what ne "options"} {set what} elseif {$option eq {}} {string cat *} else {set option}] {} $state {} $why
        }
    }
    dict for {item value} $values {
        if {!($state eq "stale" && [dict get $value state] eq "gone")} {
            Put $source $item [dict get $value value] $state {} $why
        }
    }
}

# All that is stale is a second older.
proc ::sorma::value::Grow {} {
    variable Sources
    dict for {source facts} $Sources {
        if {![dict get $facts stale]} continue
        if {[dict get $facts asking]} {
            All $source stale [Why $source]
        }
        foreach item [dict keys [dict get $facts values]] {
            New $source $item
        }
        ::sorma::timer::once value.age 1000 ::sorma::value::Grow
    }
}

# As it is told: a stale value with its age.
proc ::sorma::value::Told {source item} {
    variable Sources
    set value [dict get $Sources $source values $item]
    set seen [dict get $Sources $source seen]
    if {[dict get $value state] eq "stale" && $seen > 0} {
        set seen [expr {max($seen, [dict get $value at])}]
        set age [::sorma::text::age $seen]
        dict set value age $age
        dict set value seen $seen
        dict set value why "$age: [dict get $value why]"
    }
    return $value
}

# Events of objects and daemons, for the model.
proc ::sorma::value::Happened {event key dict} {
    variable Sources
    variable At
    if {[string match daemon.* $event] || $event eq "counted"} {
        if {[dict exists $At $key]} {
            foreach sources [dict values [dict get $At $key]] {
                foreach source [dict keys $sources] {
                    OfDaemon $source $event $key $dict
                }
            }
        }
        return
    }
    set daemon [lindex [::sorma::line::place $key] 1]
    if {![dict exists $At $daemon $key]} {
        return
    }
    foreach source [dict keys [dict get $At $daemon $key]] {
        switch -- $event {
            object.made { Ask $source }
            object.removed {
                if {[Answers $daemon]} {
                    All $source gone "there is no such object"
                } else {
                    All $source stale [Why $source]     ;# it went with its daemon, and may come again with it
                }
            }
            object.changed {
                if {[lindex $source 1] eq "options" && [dict exists $dict changes]} {
                    dict for {option value} [dict get $dict changes] {
                        dict set Sources $source newer $option 1
                        Put $source $option $value live [dict get $dict by] {}
                    }
                }
            }
        }
    }
}

proc ::sorma::value::OfDaemon {source event daemon dict} {
    variable Sources
    set facts [dict get $Sources $source]
    if {$event eq "daemon.gone" || $event eq "daemon.changed" && [dict get $dict state] in $::sorma::value::Away} {
        All $source stale [Why $source]
    } elseif {$event eq "daemon.process" || [Answers $daemon]
            && ([dict get $facts stale] || [dict size [dict get $facts values]] == 0 || [::sorma::world get [lindex $source 0]] eq {})} {
        Ask $source
    }
}

proc ::sorma::value::Soon {} {
    variable Timer
    if {![info exists Timer]} {
        set Timer [after 20 ::sorma::value::Tell]
    }
}

proc ::sorma::value::Tell {} {
    variable Timer
    variable Telling
    variable Sources
    variable Tokens
    variable Fresh
    unset -nocomplain Timer
    if {$Telling} {
        return [Soon]                   ;# a callback runs the event loop
    }
    set calls {}
    foreach source [dict keys $Fresh] {
        set facts [dict get $Sources $source]
        set fresh [dict keys [dict get $facts fresh]]
        dict set Sources $source fresh {}
        foreach token [Listeners $source] {
            set t [dict get $Tokens $token]
            set items [if {[dict get $t begun]} {set fresh} else {dict keys [dict get $facts values]}]
            set told {}
            foreach item $items {
                if {$item ne "*" && [dict get $t option] in [list {} $item]} {
                    dict set told $item [Told $source $item]
                } elseif {$item eq "*"} {
                    dict set told $item [Told $source $item]
                }
            }
            if {[dict size $told] > 0} {
                dict set Tokens $token begun 1
                lappend calls $token $told
            }
        }
    }
    set Fresh {}
    set Telling 1
    foreach {token told} $calls {
        if {[dict exists $Tokens $token]} {
            ::sorma::world::deliver [dict get $Tokens $token command] [list value [dict get $Tokens $token name] $told]
        }
    }
    set Telling 0
}

::sorma::world::hook {object.made object.changed object.removed daemon.here daemon.changed daemon.gone daemon.process counted} ::sorma::value::Happened
