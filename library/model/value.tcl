# value.tcl -- values of objects that change, for sorma::world value: shared by all who look at the same.
#
# Options are read once (sorm DBX -describe, which makes nothing); from then on the daemon tells of each CTRL. What changes by
# itself, and what EXEC answers, is asked for again and again, as often as the most eager one wants it.
#
# A value is a dict: value, state (live, stale: its daemon does not answer; refused; gone: there is no such object), by (who set it,
# when that was told), at (ms, when it came), why (not live). Tellings are dicts: -option -> value, or REQUEST -> value, of those that
# are new, gathered for 20 ms.

package provide sorma::value 1.0         ;# before what needs it in turn
package require sorma::line
package require sorma::world

namespace eval ::sorma::value {
    namespace export new forget inUse
    namespace ensemble create
    # dict: {object@daemon what} -> {values timer asking fresh newer}. what: options, or a request; newer: dict of options that were told
    # to have changed since they were asked for: the answer may be older
    variable Sources
    variable Telling            ;# is a callback on the stack
    variable Tokens             ;# dict: token -> {source option command}; option empty: all
    if {![info exists Tokens]} {
        set Sources [set Tokens {}]
        set Telling 0
    }
}

# ::sorma::value::new TOKEN NAME WHAT EVERY COMMAND -- begin; for sorma::world value.
proc ::sorma::value::new {token name what every command} {
    variable Sources
    variable Tokens
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
        dict set Sources $source [dict create values {} timer {} asking 0 fresh {} newer {}]
    }
    dict set Tokens $token [dict create source $source name $name option $option command $command every $every begun 0]
    after 0 [list ::sorma::value::Ask $source]
    return $token
}

# ::sorma::value::forget TOKEN -- nothing comes after this.
proc ::sorma::value::forget token {
    variable Sources
    variable Tokens
    if {![dict exists $Tokens $token]} {
        return
    }
    set source [dict get $Tokens $token source]
    dict unset Tokens $token
    if {[llength [Listeners $source]] == 0} {
        after cancel [dict get $Sources $source timer]
        dict unset Sources $source
    }
}

# ::sorma::value::inUse -- does anybody look?
proc ::sorma::value::inUse {} {
    variable Tokens
    return [expr {[dict size $Tokens] > 0}]
}

proc ::sorma::value::Listeners source {
    variable Tokens
    return [lmap {token t} $Tokens {if {[dict get $t source] ne $source} continue; set token}]
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
    if {[::sorma::world get $key] eq {}} {
        set state [::sorma::world get $daemon]
        if {$state ne {} && [dict get $state objects] ne {} && [dict get $state state] in {alive busy}} {
            All $source gone "there is no such object"
        }
        return [Again $source]
    }
    dict set Sources $source asking 1
    dict set Sources $source newer {}
    set request [if {$what eq "options"} {list sorm DBX -describe $name} else {list $name {*}$what}]
    ::sorma::world ask $daemon $request -command [list ::sorma::value::Answered $source]
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
    lassign $source key what
    if {$status eq "error"} {
        lassign $value message code
        switch -glob -- $code {
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
    set known [dict get $Sources $source values]
    if {[dict exists $known $item]} {
        set before [dict get $known $item]
        if {[dict get $before value] eq $value && [dict get $before state] eq $state && [dict get $before why] eq $why} {
            return
        }
        if {$by eq {} && [dict get $before value] eq $value} {
            set by [dict get $before by]
        }
    }
    dict set Sources $source values $item [dict create value $value state $state by $by at [clock milliseconds] why $why]
    dict set Sources $source fresh $item 1
    Soon
}

# All values that are known have another state.
proc ::sorma::value::All {source state why} {
    variable Sources
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

# Events of objects and daemons, for the model.
proc ::sorma::value::Happened {event key dict} {
    variable Sources
    foreach source [dict keys $Sources] {
        lassign $source full what
        if {$full eq $key} {
            switch -- $event {
                object.made { Ask $source }
                object.removed { All $source gone "there is no such object" }
                object.changed {
                    if {$what eq "options" && [dict exists $dict changes]} {
                        dict for {option value} [dict get $dict changes] {
                            dict set Sources $source newer $option 1
                            Put $source $option $value live [dict get $dict by] {}
                        }
                    }
                }
            }
        } elseif {[string match daemon.* $event] && [lindex [::sorma::line::place $full] 1] eq $key} {
            if {$event eq "daemon.gone" || [dict get $dict state] in {silent dead refused unresolved}} {
                All $source stale [if {[dict get $dict why] ne {}} {dict get $dict why} else {string cat "daemon $key is gone"}]
            } elseif {[dict get $dict state] in {alive busy} && [lsearch -glob [dict values [dict get $Sources $source values]] *stale*] >= 0} {
                Ask $source
            } elseif {[dict size [dict get $Sources $source values]] == 0 && [dict get $dict objects] ne {}} {
                Ask $source
            }
        }
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
    unset -nocomplain Timer
    if {$Telling} {
        return [Soon]                   ;# a callback runs the event loop
    }
    set calls {}
    dict for {source facts} $Sources {
        set fresh [dict keys [dict get $facts fresh]]
        dict set Sources $source fresh {}
        foreach token [Listeners $source] {
            set t [dict get $Tokens $token]
            set items [if {[dict get $t begun]} {set fresh} else {dict keys [dict get $facts values]}]
            set told {}
            foreach item $items {
                if {$item ne "*" && [dict get $t option] in [list {} $item]} {
                    dict set told $item [dict get $facts values $item]
                } elseif {$item eq "*"} {
                    dict set told $item [dict get $facts values $item]
                }
            }
            if {[dict size $told] > 0} {
                dict set Tokens $token begun 1
                lappend calls $token $told
            }
        }
    }
    set Telling 1
    foreach {token told} $calls {
        if {[dict exists $Tokens $token]} {
            ::sorma::world::deliver [dict get $Tokens $token command] [list value [dict get $Tokens $token name] $told]
        }
    }
    set Telling 0
}

::sorma::world::hook {object.made object.changed object.removed daemon.here daemon.changed daemon.gone} ::sorma::value::Happened
