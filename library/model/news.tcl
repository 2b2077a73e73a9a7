# news.tcl -- tells watchers of sorma::world the events, in order and one call after another.
#
# Changes (*.changed) are collected for 20 ms, and the last state of a key counts; all other events are published as they come. A trail is
# bounded, and says how much was lost. Callbacks run at global level, from the event loop, for 10 ms at a time; an error in one goes to
# bgerror, and its watch lives on. The other parts of the model hear of all at once, by their hooks.

package require sorma::timer
package provide sorma::news 1.0

namespace eval ::sorma::news {
    variable Gather 20          ;# ms for which changes are gathered
    variable Slice 10           ;# ms of callbacks before the event loop has its turn
    variable MostTrail 1000     ;# messages of a trail that wait for one watch
    # The data stays when this file is sourced again.
    variable Watches            ;# dict: token -> {pattern events command ready}
    variable Out                ;# array: token -> list of {event key dict} to be told
    variable Late               ;# array: token -> dict: key -> {event dict}, gathered
    variable Lost               ;# array: token -> messages of a trail that were dropped
    variable Telling            ;# is a callback on the stack
    variable Hooks              ;# dict: event -> command prefixes of other parts of the model
    if {![info exists Watches]} {
        set Watches [set Hooks {}]
        set Telling 0
        foreach name {Out Late Lost} {
            array set $name {}
        }
    }
}

# ---- who is told ----

# ::sorma::news::watch TOKEN PATTERN EVENTS COMMAND -- from now on. PATTERN of keys; without @ of daemons. EVENTS: patterns.
proc ::sorma::news::watch {token pattern events command} {
    variable Watches
    dict set Watches $token [dict create pattern $pattern events $events command $command ready 0]
    set ::sorma::news::Out($token) {}
    set ::sorma::news::Late($token) {}
    set ::sorma::news::Lost($token) 0
}

# ::sorma::news::unwatch TOKEN -- nothing comes after this. Was there such a watch?
proc ::sorma::news::unwatch token {
    variable Watches
    variable Out
    variable Late
    variable Lost
    set there [dict exists $Watches $token]
    dict unset Watches $token
    unset -nocomplain Out($token) Late($token) Lost($token)
    return $there
}

# ::sorma::news::patterns -- of all who watch.
proc ::sorma::news::patterns {} {
    variable Watches
    return [lmap watch [dict values $Watches] {dict get $watch pattern}]
}

# ::sorma::news::ready -- tell world.ready to those who have not been told yet.
proc ::sorma::news::ready {} {
    variable Watches
    foreach token [dict keys $Watches] {
        if {![dict get $Watches $token ready]} {
            dict set Watches $token ready 1
            tell $token world.ready {} {}
        }
    }
}

# ::sorma::news::hook EVENTS PREFIX -- for the other parts of the model: call it with EVENT KEY DICT of these events, at once.
proc ::sorma::news::hook {events prefix} {
    variable Hooks
    foreach event $events {
        if {![dict exists $Hooks $event] || $prefix ni [dict get $Hooks $event]} {
            dict lappend Hooks $event $prefix
        }
    }
}

# ::sorma::news::unhook PREFIX -- stop calling it.
proc ::sorma::news::unhook prefix {
    variable Hooks
    dict for {event prefixes} $Hooks {
        dict set Hooks $event [lsearch -all -inline -not -exact $prefixes $prefix]
    }
}

# ::sorma::news::hint EVENT KEY ?DICT? -- tell only them.
proc ::sorma::news::hint {event key {dict {}}} {
    variable Hooks
    if {[dict exists $Hooks $event]} {
        foreach prefix [dict get $Hooks $event] {
            {*}$prefix $event $key $dict
        }
    }
}

# ::sorma::news::deliver PREFIX WORDS -- call it at global level; an error goes to bgerror.
proc ::sorma::news::deliver {command words} {
    if {[catch {uplevel #0 [list {*}$command {*}$words]} message options] == 1} {
        after 0 [list {*}[interp bgerror {}] $message $options]
    }
}

# ---- telling ----

# ::sorma::news::emit EVENT KEY DICT -- something has happened. The other parts of the model hear of it first.
proc ::sorma::news::emit {event key dict} {
    variable Watches
    hint $event $key $dict
    foreach token [dict keys $Watches] {
        tell $token $event $key $dict
    }
}

# ::sorma::news::tell TOKEN EVENT KEY DICT -- one watch alone, if it wants that.
proc ::sorma::news::tell {token event key dict} {
    variable Watches
    variable Out
    variable Late
    variable Lost
    variable MostTrail
    set watch [dict get $Watches $token]
    set pattern [dict get $watch pattern]
    if {$key ne {} && ((([string first @ $pattern] >= 0) != ([string first @ $key] >= 0)) || ![string match $pattern $key])} {
        return
    }
    if {[lsearch -exact [dict get $watch events] $event] < 0 && ![Matches $event [dict get $watch events]]} {
        return
    }
    if {$event eq "trail"} {
        if {[llength $Out($token)] >= $MostTrail} {
            incr Lost($token)
            return
        }
        dict set dict lost $Lost($token)
        set Lost($token) 0
    } elseif {[string match *.changed $event]} {
        if {[dict exists $Late($token) $key] && [dict exists $dict changes]} {
            set before [lindex [dict get $Late($token) $key] 1]
            if {[dict exists $before changes]} {
                dict set dict changes [dict merge [dict get $before changes] [dict get $dict changes]]
            }
        }
        dict set Late($token) $key [list $event $dict]
        ::sorma::timer::once news.ripen $::sorma::news::Gather ::sorma::news::Ripen
        return
    } elseif {[dict exists $Late($token) $key]} {
        dict unset Late($token) $key        ;# it is overtaken
    }
    lappend Out($token) [list $event $key $dict]
    ::sorma::timer::once news.tell 0 ::sorma::news::Tell
}

proc ::sorma::news::Matches {event patterns} {
    foreach pattern $patterns {
        if {[string match $pattern $event]} {
            return 1
        }
    }
    return 0
}

# Changes have waited long enough.
proc ::sorma::news::Ripen {} {
    variable Out
    variable Late
    foreach token [array names Late] {
        dict for {key item} $Late($token) {
            lappend Out($token) [linsert $item 1 $key]
        }
        set Late($token) {}
    }
    ::sorma::timer::once news.tell 0 ::sorma::news::Tell
}

# Call those who watch, for a while. A callback that runs the event loop calls nobody meanwhile.
proc ::sorma::news::Tell {} {
    variable Out
    variable Watches
    variable Telling
    variable Slice
    if {$Telling} {
        return
    }
    set Telling 1
    set end [expr {[clock milliseconds] + $Slice}]
    set more 0
    foreach token [dict keys $Watches] {
        set at 0
        while {[info exists Out($token)] && $at < [llength $Out($token)]} {
            if {[clock milliseconds] >= $end} {
                set more 1
                break
            }
            lassign [lindex $Out($token) $at] event key dict
            incr at
            deliver [dict get $Watches $token command] [list $event $key $dict]
        }
        if {[info exists Out($token)]} {
            set Out($token) [lrange $Out($token) $at end]
        }
    }
    set Telling 0
    if {$more} {
        ::sorma::timer::once news.tell 1 ::sorma::news::Tell
    }
}
