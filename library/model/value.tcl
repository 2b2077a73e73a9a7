# value.tcl -- values of objects that change, for sorma::world value: shared by all who look at the same.
#
# Options are read once (sorm DBX -describe, which makes nothing); from then on the daemon tells of each CTRL. Replies of EXEC and DBX, and
# options that change by themselves, are asked for again and again, as often as the most eager caller wants them.
#
# A value is a dict:
#     value    as the object gave it
#     state    live; stale: it may be old; refused; gone: there is no such object
#     by       the one who set it, when that was told
#     at       ms, when it came
#     why      it is not live
#     age      of a stale value, such as "12 s old"; why has it, too; else empty
#     seen     of a stale value, the ms when it was last so; else 0
# Tellings are dicts: -option -> value, or REQUEST -> value, of those that are new, gathered for 20 ms.
#
# A value is stale while its daemon does not answer, and while a question for it has waited for 2 s, as behind a long request. As long as
# that lasts it is told again each second, with its age.

package require sorma::line
package require sorma::text
package require sorma::timer
package require sorma::news
package require sorma::worldDaemon
package provide sorma::value 1.0

namespace eval ::sorma::value {
    namespace export new forget taken
    namespace ensemble create
    variable Overdue 2000       ;# ms without an answer, then values may be old
    variable Sources            ;# dict: {object@daemon what} -> object. what: options, or a request
    variable Tokens             ;# dict: token -> {source option name command}
    variable Fresh              ;# dict whose keys are the sources that have something to tell
    variable Telling            ;# is a callback on the stack
    if {![info exists Tokens]} {
        set Sources [set Tokens [set Fresh {}]]
        set Telling 0
    }
}

# ::sorma::value::new TOKEN NAME WHAT EVERY COMMAND -- begin; for sorma::world value.
proc ::sorma::value::new {token name what every command} {
    variable Sources
    variable Tokens
    set full [join [::sorma::line::place $name] @]
    set option {}
    if {[lindex $what 0] in {EXEC DBX}} {
        if {$every == 0} {
            set every 1000
        }
    } else {
        if {$what ne "*"} {
            set option $what
        }
        set what options
    }
    if {![dict exists $Sources $full $what]} {
        dict set Sources $full $what [reading new $full $what]
    }
    set source [dict get $Sources $full $what]
    dict set Tokens $token [list $source $option $name $command]
    $source take $token $option $every
    return $token
}

# ::sorma::value::forget TOKEN -- nothing comes after this.
proc ::sorma::value::forget token {
    variable Tokens
    if {[dict exists $Tokens $token]} {
        lassign [dict get $Tokens $token] source option
        dict unset Tokens $token
        $source leave $token $option
    }
}

# ::sorma::value::taken NAME CHANGES -- an object has taken these values, a dict of options; NAME has its daemon. The event that tells of
# them may come after the reply. News from before are older.
proc ::sorma::value::taken {name changes} {
    variable Sources
    if {[dict exists $Sources $name options]} {
        [dict get $Sources $name options] objectChanged $changes {}
    }
}

# An answer for a source, unless nobody looks any more.
proc ::sorma::value::Answer {source status value} {
    if {[info object isa object $source]} {
        $source Answered $status $value
    }
}

# All that is stale is a second older.
proc ::sorma::value::Grow {} {
    variable Sources
    foreach source [concat {*}[lmap sources [dict values $Sources] {dict values $sources}]] {
        $source grow
    }
}

proc ::sorma::value::Tell {} {
    variable Telling
    variable Tokens
    variable Fresh
    if {$Telling} {                     ;# a callback runs the event loop
        ::sorma::timer::once value.tell 20 ::sorma::value::Tell
        return
    }
    set calls [concat {*}[lmap source [dict keys $Fresh] {$source news}]]
    set Fresh {}
    set Telling 1
    foreach {token told} $calls {
        if {[dict exists $Tokens $token]} {
            lassign [dict get $Tokens $token] source option name command
            ::sorma::news::deliver $command [list value $name $told]
        }
    }
    set Telling 0
}

# All values of an object, or one reply: what one question brings.
if {![info object isa object ::sorma::value::reading]} {oo::class create ::sorma::value::reading}
oo::define ::sorma::value::reading {
    variable full name daemon what
    variable values             ;# dict: -option, or the request -> value; *: of none anything is known, and why
    variable fresh newer        ;# dicts of options: not told yet; told to have changed since they were asked for: the answer may be older
    variable takers             ;# dict: option (empty: all) -> dict: token -> ms
    variable begin              ;# dict whose keys are tokens that have not been told anything
    variable every timer        ;# ms between two questions, 0: it is not asked again; id of after
    variable asking waits       ;# is a question under way; id of after, for what is overdue
    variable seen               ;# ms, of the last answer; 0: none
    variable stale              ;# has All said so since the last answer

    constructor {itsName question} {
        set full $itsName
        set what $question
        lassign [::sorma::line::place $full] name daemon
        set values [set fresh [set newer [set takers [set begin [set timer [set waits {}]]]]]]
        set every [set asking [set seen [set stale 0]]]
        ::sorma::worldDaemon::attach $full [self] [expr {$what eq "options"}]
    }
    destructor {
        after cancel $timer
        after cancel $waits
        ::sorma::worldDaemon::never [self]
        ::sorma::worldDaemon::detach $full [self]
        dict unset ::sorma::value::Sources $full $what
        if {[dict size [dict get $::sorma::value::Sources $full]] == 0} {
            dict unset ::sorma::value::Sources $full
        }
        dict unset ::sorma::value::Fresh [self]
    }

    # take TOKEN OPTION EVERY -- one more who looks. leave TOKEN OPTION -- one less; with the last it goes.
    method take {token option ms} {
        dict set takers $option $token $ms
        dict set begin $token $option
        if {$ms > 0 && ($every == 0 || $ms < $every)} {
            set every $ms
        }
        if {[dict size $values] > 0} {
            my Soon                     ;# what is known already
        }
        my AskSoon
    }
    method leave {token option} {
        set ms [dict get $takers $option $token]
        dict unset begin $token
        dict unset takers $option $token
        if {[dict size [dict get $takers $option]] == 0} {
            dict unset takers $option
        }
        if {[dict size $takers] == 0} {
            my destroy
        } elseif {$ms > 0 && $ms == $every} {
            set all [lsearch -all -inline -exact -not [concat {*}[lmap tokens [dict values $takers] {dict values $tokens}]] 0]
            set every [if {[llength $all] > 0} {::tcl::mathfunc::min {*}$all} else {string cat 0}]
        }
    }

    # ---- asking ----

    method AskSoon {} {
        ::sorma::worldDaemon::later [self] ask
    }
    # ask END -- ask for it, when the model knows its object; looking makes none. It is the turn of this one.
    method ask end {
        if {$asking} {
            return 0
        }
        after cancel $timer
        set there [::sorma::worldDaemon::of $daemon]
        set exists [expr {$there ne {} && [$there object $full] ne {}}]
        # EXEC would make an object: it must be known to be there, also in a new process.
        if {!$exists || $what ne "options" && ![$there knows]} {
            if {!$exists && $there ne {}} {
                if {[$there answers] && [$there knows]} {
                    my All gone "there is no such object"
                } elseif {[$there away]} {
                    my All stale [my Why]           ;# it was so before anybody looked
                }
            }
            my Again
            return 0
        }
        set asking 1
        set newer {}
        my Await
        $there ask [if {$what eq "options"} {
            list sorm DBX -describe $name
        } elseif {[lindex $what 0] eq "DBX"} {
            list sorm DBX -look $name {*}[lrange $what 1 end]
        } else {
            list $name {*}$what
        }] 5000 [list ::sorma::value::Answer [self]]
        return 0
    }
    method Again {} {
        if {$every > 0} {
            set timer [after $every [list [self] AskSoon]]
        }
    }
    # Its values may be old when no answer has come for a while.
    method Await {} {
        set overdue $::sorma::value::Overdue
        set waits [after $overdue [list [self] Waited [expr {[clock milliseconds] + $overdue}]]]
    }
    # due: ms, when this was to be called. Where no event loop has run meanwhile, the answer may be here unread.
    method Waited due {
        if {[clock milliseconds] - $due > 500} {
            my Await
        } else {
            my All stale [my Why]
        }
    }
    # Why there is no answer.
    method Why {} {
        set there [::sorma::worldDaemon::of $daemon]
        if {$there eq {}} {
            return "daemon $daemon is gone"
        }
        set facts [$there facts]
        if {[dict get $facts why] ne {}} {
            return [dict get $facts why]
        }
        return [switch -- [dict get $facts state] {
            busy { string cat "its daemon is busy in " [dict get $facts busy] }
            alive { string cat "no answer yet: it may work on a long request" }
            default { string cat "its daemon is " [dict get $facts state] }
        }]
    }
    method Answered {status value} {
        set asking 0
        after cancel $waits
        if {$status eq "ok" || ![string match "SORMA COMM*" [lindex $value 1]]} {
            set stale 0
            set seen [clock milliseconds]
        }
        if {$status eq "error"} {
            lassign $value message code
            switch -glob -- $code {
                "SORMA COMM TIMEOUT*" { my All stale [my Why] }
                "SORMA COMM DENIED*" { my All refused $message }
                "SORMA SERVICE GONE*" { my All gone $message }
                "SORMA COMM*" { my All stale $message }
                default { my All refused $message }
            }
        } elseif {$what ne "options"} {
            my Put $what $value live {} {}
        } elseif {[catch {my Options [dict get $value text]}]} {
            my All refused "its daemon's answer makes no sense"
        }
        my Again
    }
    method Options table {
        if {![dict get $table exists]} {
            my All gone "there is no such object"
            return
        }
        # Why nothing was known is not told any more.
        dict unset values *
        dict unset fresh *
        foreach option [dict get $table options] {
            if {![dict exists $newer [lindex $option 0]]} {
                my Put [lindex $option 0] [lindex $option 5] live {} {}
            }
        }
    }

    # ---- what is known ----

    # One value, as it is now.
    method Put {item value state by why} {
        set at [clock milliseconds]
        if {[dict exists $values $item]} {
            set before [dict get $values $item]
            if {[dict get $before value] eq $value} {
                set known [expr {$by eq {} || [dict get $before by] ne {}}]     ;# the reply to one who sets a value may be faster than the event
                if {[dict get $before state] eq $state && [dict get $before why] eq $why && $known} return
                if {$by eq {}} {
                    set by [dict get $before by]
                    set at [dict get $before at]
                }
            }
        }
        dict set values $item [dict create value $value state $state by $by at $at why $why age {} seen 0]
        my New $item
    }
    method New item {
        dict set fresh $item 1
        my Soon
    }
    method Soon {} {
        dict set ::sorma::value::Fresh [self] 1
        ::sorma::timer::once value.tell 20 ::sorma::value::Tell
    }
    # All values that are known have another state.
    method All {state why} {
        if {$state eq "stale"} {
            set stale 1
            ::sorma::timer::once value.age 1000 ::sorma::value::Grow
        }
        if {[dict size $values] == 0} {
            foreach option [dict keys $takers] {
                my Put [if {$what ne "options"} {set what} elseif {$option eq {}} {string cat *} else {set option}] {} $state {} $why
            }
        }
        dict for {item value} $values {
            if {!($state eq "stale" && [dict get $value state] eq "gone")} {
                my Put $item [dict get $value value] $state {} $why
            }
        }
    }
    # grow -- what is stale is a second older.
    method grow {} {
        if {!$stale} return
        if {$asking} {
            my All stale [my Why]
        }
        foreach item [dict keys $values] {
            my New $item
        }
        ::sorma::timer::once value.age 1000 ::sorma::value::Grow
    }

    # ---- what is told ----

    # news -- what has not been told yet: a list of TOKEN and dict, of those who want it.
    method news {} {
        set told {}
        foreach item [dict keys $fresh] {
            set value [my Told $item]
            foreach tokens [if {$item eq "*"} {dict values $takers} else {list [my Takers {}] [my Takers $item]}] {
                foreach token [dict keys $tokens] {
                    dict set told $token $item $value
                }
            }
        }
        set fresh {}
        dict for {token option} $begin {
            foreach item [if {$option eq {}} {dict keys $values} else {list * $option}] {
                if {[dict exists $values $item]} {
                    dict set told $token $item [my Told $item]
                }
            }
            if {[dict exists $told $token]} {
                dict unset begin $token
            }
        }
        return $told
    }
    method Takers option {
        return [if {[dict exists $takers $option]} {dict get $takers $option}]
    }
    # As it is told: a stale value with its age.
    method Told item {
        set value [dict get $values $item]
        if {[dict get $value state] eq "stale" && $seen > 0} {
            set last [expr {max($seen, [dict get $value at])}]
            set age [::sorma::text::age $last]
            set value [dict replace $value age $age seen $last why "$age: [dict get $value why]"]
        }
        return $value
    }

    # ---- what its daemon says ----

    method objectMade {} {
        my AskSoon
    }
    method objectChanged {changes by} {
        dict for {option value} $changes {
            dict set newer $option 1
            my Put $option $value live $by {}
        }
    }
    method objectRemoved {} {
        set there [::sorma::worldDaemon::of $daemon]
        if {$there ne {} && [$there answers]} {
            my All gone "there is no such object"
        } else {
            my All stale [my Why]       ;# it went with its daemon, and may come again with it
        }
    }
    method daemonChanged {} {
        set there [::sorma::worldDaemon::of $daemon]
        if {$there eq {} || [$there away]} {
            my All stale [my Why]
        } elseif {[$there answers] && ($stale || [dict size $values] == 0 || [$there object $full] eq {})} {
            my AskSoon
        }
    }
    method daemonProcess {} {
        my AskSoon
    }
    method lineMade {} {}

    export AskSoon Waited Answered
}
