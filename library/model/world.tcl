# world.tcl -- one live model of the running system: daemons, their objects, and what happens to them. This file has what programs say.
#
# A program says what it wants to know (watch, value, listen). It is told what is there, and then each change; nothing here waits.
# Looking never makes an object.
#
# The parts      discovery (where daemons may be) > worldLine and worldSelf, both a worldDaemon (a daemon and its objects) > value, events > world
# A value's way  daemon, Take > value, objectChanged > subject, Valued > field, Told
#
# KEY       robot, a daemon; carry.slow@robot, an object. This process is the daemon called self.
# daemon    a dict: name address how state why since user host pid boot objects busy called
#             state  asking (no answer yet) alive busy gone   silent (no answer for 2 s) refused
#                    denied (it lets nobody look, or not us)   unresolved (its address leads nowhere)   dead (only its socket is left)
#             how    folder dictionary proxy added self   sibling (another daemon has named it, as one of the same user on its host)
#                    rpcbind (the rpcbind of that host has named it)
#             called  name of a sibling on its host
#             since  ms, when the state began   busy    in what   objects   how many
# object    a dict: name class calls underway; in object.changed also changes (dict: -option value) and by
# events    daemon.here daemon.changed daemon.gone object.made object.changed object.removed trail world.ready
#
# Events of one key come in order. *.changed are gathered for 20 ms, and the last state wins; the others are not. After a gap (a
# line that broke, events that were lost) the daemon is asked for everything, and the differences are told. Callbacks run at
# global level, from the event loop, one after another; an error in one goes to bgerror, and its watch lives on.

package require sorma
package require sorma::options
package require sorma::timer
package require sorma::news
package require sorma::discovery
package require sorma::worldLine
package require sorma::worldSelf
package require sorma::value
package require sorma::events
package provide sorma::world 1.0

namespace eval ::sorma::world {
    namespace export watch unwatch get keys shown names others open objects find use add forget hold release value listen ask cancel
    namespace ensemble create

    variable Pulse 1000         ;# ms between two HEALTHs
    variable Linger 10000       ;# ms for which the model lives on when nobody watches any more
    # The data stays when this file is sourced again.
    variable Last               ;# token
    variable Running            ;# is the model at work
    variable Beaten             ;# ms, when Beat was last there
    if {![info exists Last]} {
        set Last [set Running [set Beaten 0]]
    }
}

# ---- who is told ----

# ::sorma::world::watch PATTERN ?-events LIST? -command PREFIX --
#       Be told what there is, and what changes.
# Arguments:
#       PATTERN of keys; without @ it means daemons, with @ objects (*@*), and trails of them
#       LIST    patterns of events, default *
#       PREFIX  is called with EVENT KEY DICT. First comes what is known, as daemon.here and object.made. Then comes
#               world.ready, when each daemon has answered, or has let us wait for a second.
# Results:
#       A token, for unwatch. Nothing is called before this returns.
proc ::sorma::world::watch {pattern args} {
    set options [Read {-events {any *}} event $args]
    set token [NewToken watch]
    Start
    LookOnce
    set before [::sorma::worldDaemon::inUse]
    ::sorma::news::watch $token $pattern [dict get $options -events] [dict get $options -command]
    foreach key [keys] {
        ::sorma::news::tell $token daemon.here $key [get $key]
    }
    if {[string first @ $pattern] >= 0} {
        foreach key [keys $pattern] {
            ::sorma::news::tell $token object.made $key [get $key]
        }
    }
    CountUnknown $before
    ::sorma::worldDaemon::ready
    return $token
}

# ::sorma::world::value NAME *|-option|{EXEC ...}|{DBX ...} ?-every ms? -command PREFIX -- see value.tcl.
proc ::sorma::world::value {name what args} {
    set options [Read {-every {{whole 0 {}} 0}} value $args]
    Start
    set before [::sorma::worldDaemon::inUse]
    set token [::sorma::value new [NewToken value] $name $what [dict get $options -every] [dict get $options -command]]
    CountUnknown $before
    return $token
}

# ::sorma::world::listen NAME ?-event pattern? ?-queue n? ?-as WHO? -command PREFIX -- see events.tcl.
proc ::sorma::world::listen {name args} {
    set options [Read {-event {any *} -queue {{whole 1 1000000} 10000} -as any} event $args]
    Start
    set before [::sorma::worldDaemon::inUse]
    set token [::sorma::events new [NewToken events] $name [dict get $options -event] [dict get $options -queue] [dict get $options -command] [dict get $options -as]]
    CountUnknown $before
    return $token
}

# ::sorma::world::unwatch TOKEN -- end a watch, a value or a listen. Nothing comes after this.
proc ::sorma::world::unwatch token {
    if {![::sorma::news::unwatch $token]} {
        ::sorma::value forget $token
        ::sorma::events forget $token
    }
    EndLater
    return
}

# ---- what is known ----

# ::sorma::world::get KEY -- what is known of a daemon or an object: a dict; empty when nothing is.
proc ::sorma::world::get key {
    set daemon [::sorma::worldDaemon::of $key]
    if {$daemon ne {}} {
        return [$daemon facts]
    }
    set daemon [::sorma::worldDaemon::of [string range $key [string first @ $key]+1 end]]
    return [if {$daemon ne {}} {$daemon object $key}]
}

# ::sorma::world::keys ?PATTERN? -- keys that are known, sorted: of daemons, or of objects when the pattern has an @.
proc ::sorma::world::keys {{pattern *}} {
    set all [::sorma::worldDaemon::all]
    if {[string first @ $pattern] < 0} {
        return [lsort [dict keys $all $pattern]]
    }
    return [lsort [concat {*}[lmap daemon [dict values $all] {$daemon keys $pattern}]]]
}

# ::sorma::world::shown KEY -- how a key is shown to people: what is of this process has no daemon behind it.
proc ::sorma::world::shown key {
    return [regsub {@self$} $key {}]
}

# ::sorma::world::objects DAEMON -- its objects, as get gives them, sorted; of this process as they are now.
proc ::sorma::world::objects daemon {
    return [::sorma::worldDaemon::fact $daemon objects]
}

# ::sorma::world::names -- what can stand after @, sorted. Daemons of this user on this host, aliases of the dictionary, addresses of
# proxies, what was added, and addresses of others.
proc ::sorma::world::names {} {
    return [lsort -unique [concat [::sorma::discovery::names] [dict keys [others]]]]
}

# ::sorma::world::others -- daemons of other hosts that a daemon there, or its rpcbind, has named, and that let us look. A dict: address ->
# name there, or empty. That name is only shown. After @ only the address leads there.
proc ::sorma::world::others {} {
    set found {}
    dict for {key daemon} [::sorma::worldDaemon::all] {
        set facts [$daemon facts]
        if {[dict get $facts how] in {sibling rpcbind} && [$daemon visible]} {
            dict set found $key [dict get $facts called]
        }
    }
    return $found
}

# ::sorma::world::open -- may others become known in a moment?
proc ::sorma::world::open {} {
    if {[::sorma::discovery::unseen]} {
        return 1
    }
    foreach daemon [dict values [::sorma::worldDaemon::all]] {
        if {[$daemon unsettled]} {
            return 1
        }
    }
    return 0
}

# ::sorma::world::find WHERE -- the KEY of the daemon that is meant by what stands after @; empty: none is known there.
proc ::sorma::world::find where {
    if {$where in {{} self}} {
        return self
    }
    if {[catch {::sorma::resolve @$where} place]} {
        return {}
    }
    if {[dict get $place state] eq "here"} {
        return self
    }
    dict for {key daemon} [::sorma::worldDaemon::all] {
        if {[dict get [$daemon facts] address] eq [dict get $place address]} {
            return $key
        }
    }
    return {}
}

# ::sorma::world::use ?WHERE? -- for a user that looks now and then and watches nothing: the model works on for a while, and sees which
# daemons there are. A daemon that nothing else leads to is known meanwhile. Returns its KEY, as find does.
proc ::sorma::world::use {{where {}}} {
    Start
    LookOnce
    set key [find $where]
    set known [get $key]
    if {$known ne {} && [dict get $known state] in {asking unresolved}} {
        Look                            ;# its host may be known now
    }
    if {$key eq {} && ![catch {::sorma::resolve @$where}]} {
        ::sorma::discovery::pass $where
        Look
        set key [find $where]
    } else {
        ::sorma::discovery::pass $where 1
    }
    EndLater
    return $key
}

# ---- what is to be known ----

# ::sorma::world::hold WHERE -- for one that looks at an object: know its daemon until the token that it returns is given to release. Nothing
# is added where the runtime folder or the dictionary leads to it.
proc ::sorma::world::hold where {
    return [if {$where ni {{} self} && ![::sorma::discovery::leads $where]} {
        set token [::sorma::discovery::hold $where]
        Start
        set token
    }]
}
proc ::sorma::world::release token {
    ::sorma::discovery::release $token
    EndLater
    return
}

# ::sorma::world::add ADDRESS -- know a daemon by what stands after @: host:7014, /path, an alias. forget ADDRESS takes one add back.
proc ::sorma::world::add address {
    ::sorma::discovery::hold $address add
    Start
    return $address
}
proc ::sorma::world::forget address {
    release [::sorma::discovery::added $address]
}

# ---- requests ----

# ::sorma::world::ask DAEMON REQUEST ?-timeout ms? ?-as WHO? -command PREFIX --
#       Send a request, NAME EXEC|CTRL|DBX word ..., to a daemon that is known. PREFIX is called with ok and the reply (a dict), or
#       with error and the list of message and error code. For WHO, the list has the trail, too.
# Arguments:
#       ms      default 5000; 0: however long it takes
#       WHO     the author, as of sorma::async; default: you
# Results:
#       Its number, for cancel; what its service publishes meanwhile carries it. Empty when it cannot be sent: PREFIX is told why.
proc ::sorma::world::ask {daemon request args} {
    set options [::sorma::options::parse {-timeout {{whole 0 {}} 5000} -as any -command any} $args]
    set object [::sorma::worldDaemon::of $daemon]
    if {$object eq {}} {
        after 0 [list ::sorma::news::deliver [dict get $options -command] \
            [list error [list "$daemon: no daemon of that name is known" [list SORMA COMM REFUSED $daemon]]]]
        return
    }
    return [$object ask $request [dict get $options -timeout] [dict get $options -command] [dict get $options -as]]
}

# ::sorma::world::cancel DAEMON NUMBER -- give a request up: its PREFIX is called with error, COMM CANCELLED, and its service is told. Was it
# under way?
proc ::sorma::world::cancel {daemon number} {
    set object [::sorma::worldDaemon::of $daemon]
    return [expr {$object ne {} && [$object cancel $number]}]
}

# The options of a command that calls a daemon; one of them must name it.
proc ::sorma::world::Read {table what words} {
    set options [::sorma::options::parse [dict merge $table {-command any}] $words]
    if {[dict get $options -command] eq {}} {
        return -level 2 -code error -errorcode {SORMA REQUEST SYNTAX} "-command is missing: what is to be called with each $what?"
    }
    return $options
}

proc ::sorma::world::NewToken kind {
    variable Last
    return $kind[incr Last]
}

# ---- life of the model ----

proc ::sorma::world::Start {} {
    variable Running
    ::sorma::timer::cancel world.end
    if {!$Running} {
        set Running 1
        ::sorma::discovery::begin ::sorma::world::Look
        ::sorma::worldSelf::daemon new
        Beat
    }
}

proc ::sorma::world::EndLater {} {
    variable Linger
    if {[llength [::sorma::news::patterns]] == 0 && ![::sorma::worldDaemon::observed] && ![::sorma::discovery::held]} {
        ::sorma::timer::once world.end $Linger ::sorma::world::End
    }
}

proc ::sorma::world::End {} {
    set ::sorma::world::Running 0
    ::sorma::discovery::end
    ::sorma::timer::cancel world.*
    foreach daemon [dict values [::sorma::worldDaemon::all]] {
        $daemon destroy
    }
}

# Which daemons there are. Once in a turn of the event loop is enough.
proc ::sorma::world::LookOnce {} {
    if {![::sorma::timer::waits world.looked]} {
        Look
    }
}
proc ::sorma::world::Look {} {
    ::sorma::timer::once world.looked 0 list
    set places [::sorma::discovery::places]
    dict for {where place} $places {
        if {[::sorma::worldDaemon::of $where] eq {}} {
            ::sorma::worldLine::daemon new $where [dict get $place address] [dict get $place how]
        }
        [::sorma::worldDaemon::of $where] leads $place
    }
    dict for {key daemon} [::sorma::worldDaemon::all] {
        if {$key ne "self" && ![dict exists $places $key]} {
            ::sorma::worldDaemon::later $daemon gone
        }
    }
    ::sorma::worldDaemon::ready
}

# Once a second: is each daemon still there? Daemons that are not connected are tried again.
proc ::sorma::world::Beat {} {
    variable Pulse
    variable Beaten
    ::sorma::timer::once world.beat $Pulse ::sorma::world::Beat
    Look
    set now [clock milliseconds]
    set slept [expr {$now - $Beaten > 2 * $Pulse}]
    set Beaten $now
    foreach daemon [dict values [::sorma::worldDaemon::all]] {
        $daemon beat $now $slept
    }
}

# Somebody wants to know objects, for the first time: ask the daemons that are known already.
proc ::sorma::world::CountUnknown before {
    foreach daemon [if {!$before} {dict values [::sorma::worldDaemon::all]}] {
        $daemon count
    }
}
