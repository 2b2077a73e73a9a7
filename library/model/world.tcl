# world.tcl -- one live model of the running system: daemons, their objects, and what happens to them.
#
# A program says what it wants to know (watch), and is told what is there and then what changes; it asks nobody itself, and
# nothing here waits. What the model knows comes from one line to each daemon (sorma::peer): one subscription to its object sorm,
# which tells of objects, and one HEALTH a second, which tells that it is still there. Looking never makes an object.
#
# KEY       robot, a daemon; carry.slow@robot, an object. This process is the daemon called self.
# daemon    a dict: name address how state why since user host pid boot objects busy
#             state  asking (no answer yet) alive busy silent (no answer for 2 s) refused denied (it lets nobody look, or not us)
#                    unresolved (its address leads nowhere) dead (its socket is all that is left) gone
#             how    folder dictionary proxy added sibling rpcbind self: how it came to be known. sibling: a daemon that is reached by
#                    TCP has named it, as one of the same user on its host; rpcbind: the rpcbind of that host has
#             since  ms, when the state began;  busy: in what;  objects: how many
# object    a dict: name class calls underway; in object.changed also changes (dict: -option value) and by
# events    daemon.here daemon.changed daemon.gone object.made object.changed object.removed trail world.ready
#
# The parts of the model and the views also have hooks, of which they hear at once. daemon.process: another process, or the first one,
# answers under that name; what the one before has said of its classes does not count any more.
#
# Events of one key come in order. *.changed are gathered for 20 ms, and the last state wins; the others are not. After a gap (a
# line that broke, events that were lost) the daemon is asked for everything, and the differences are told. Callbacks run at
# global level, from the event loop, one after another; an error in one goes to bgerror, and its watch lives on.

package require sorma
package require sorma::message
package require sorma::options
package require sorma::timer
package require sorma::news
package provide sorma::world 1.0

namespace eval ::sorma::world {
    namespace export watch unwatch get keys shown add forget hold release value listen ask cancel names find objects recount counted knows pulse heard use line hook unhook hint lead deliver
    namespace import -force ::sorma::news::hook ::sorma::news::unhook ::sorma::news::hint ::sorma::news::deliver
    namespace ensemble create

    variable Slice 10           ;# ms of work before the event loop has its turn
    variable Pulse 1000         ;# ms between two HEALTHs
    variable Silence 1900       ;# ms without an answer, then a daemon counts as silent, at the next beat: within 3 s of its death
    variable MostObjects 200000 ;# that are known of one daemon, so that a lie does not fill the memory
    variable Linger 10000       ;# ms for which the model lives on when nobody watches any more
    # The data stays when this file is sourced again.
    variable Daemons            ;# dict: KEY -> daemon, as get gives it
    variable Objects            ;# array: name@daemon -> object, as get gives it
    variable Names              ;# array: daemon -> dict: name -> 1
    # array: daemon -> dict: peer (empty: no line now), serial (of the line; an answer to an older one is ignored), opened (ms),
    # asked (ms, when the HEALTH that is not answered was sent; 0: none), told (is there a subscription), known (are its objects),
    # heard (ms, of the last HEALTH), asking (ms, when its objects were asked for), again (one more such question is wanted),
    # counted (ms, when the question was sent that was answered last), text (of that answer), touched (has one come or gone since),
    # log (dict: name -> made or removed, while they are asked for)
    variable Lines
    variable Added              ;# dict: token of an add or a hold that has not been taken back -> ADDRESS
    variable Passing            ;# dict: what stands after @ -> ms, when somebody last looked there
    variable Led                ;# dict: who says so -> {how addresses}, by lead
    variable Twins              ;# dict: address -> boot of a daemon that is known by another one
    variable Last               ;# token, or serial
    variable Running            ;# is the model at work
    variable Work               ;# list of {daemon serial objects at seen}: answers that are to be taken in
    variable Wanted             ;# dict: daemon -> 1: somebody waits for these, they come first
    variable Opening            ;# daemons to which a line is to be made
    variable Local              ;# line to this process: it only subscribes
    variable Here               ;# dict: number -> future, of requests to this process that are under way
    variable Beaten             ;# ms, when Beat was last there
    if {![info exists Last]} {
        foreach name {Daemons Added Passing Led Twins Work Wanted Opening Local Here} {
            set $name {}
        }
        foreach name {Last Running Beaten} {
            set $name 0
        }
        foreach name {Objects Names Lines} {
            array set $name {}
        }
    }
}

# ---- what programs say ----

# ::sorma::world::watch PATTERN ?-events LIST? -command PREFIX --
#       Be told what there is, and what changes.
# Arguments:
#       PATTERN of keys; without @ it means daemons, with @ objects (*@*), and trails of them
#       LIST    patterns of events, default *
#       PREFIX  is called with EVENT KEY DICT. First comes what is known, as daemon.here and object.made; then world.ready, when
#               each daemon has answered, or has let us wait for a second
# Results:
#       A token, for unwatch. Nothing is called before this returns.
proc ::sorma::world::watch {pattern args} {
    set options [Read {-events {any *}} event $args]
    set token [NewToken watch]
    Start
    if {![::sorma::timer::waits world.looked]} {
        Look
    }
    ::sorma::news::watch $token $pattern [dict get $options -events] [dict get $options -command]
    dict for {key daemon} $::sorma::world::Daemons {
        ::sorma::news::tell $token daemon.here $key $daemon
    }
    if {[string first @ $pattern] >= 0} {
        foreach key [lsort [array names ::sorma::world::Objects $pattern]] {
            ::sorma::news::tell $token object.made $key $::sorma::world::Objects($key)
        }
    }
    CountUnknown
    CheckReady
    return $token
}

# ::sorma::world::unwatch TOKEN --
#       End a watch, or a value. Nothing comes after this.
proc ::sorma::world::unwatch token {
    if {![::sorma::news::unwatch $token]} {
        ::sorma::value forget $token
        ::sorma::events forget $token
    }
    EndLater
    return
}

# ::sorma::world::get KEY -- what is known of a daemon or an object: a dict; empty when nothing is.
proc ::sorma::world::get key {
    variable Daemons
    variable Objects
    if {[dict exists $Daemons $key]} {
        return [dict get $Daemons $key]
    }
    return [if {[info exists Objects($key)]} {set Objects($key)}]
}

# ::sorma::world::keys ?PATTERN? -- keys that are known, sorted: of daemons, or of objects when the pattern has an @.
proc ::sorma::world::keys {{pattern *}} {
    variable Daemons
    variable Objects
    if {[string first @ $pattern] < 0} {
        return [lsort [dict keys $Daemons $pattern]]
    }
    return [lsort [array names Objects $pattern]]
}

# ::sorma::world::shown KEY -- how a key is shown to people: what is of this process has no daemon behind it.
proc ::sorma::world::shown key {
    return [regsub {@self$} $key {}]
}

# ::sorma::world::objects DAEMON -- its objects, as get gives them, sorted; of this process as they are now.
proc ::sorma::world::objects daemon {
    variable Names
    variable Objects
    if {$daemon eq "self"} {
        return [lmap item [lsort -index 0 [HereObjects]] {
            lassign $item name class calls underway
            dict create name $name class $class calls $calls underway $underway
        }]
    }
    return [if {[info exists Names($daemon)]} {
        lmap name [lsort [dict keys $Names($daemon)]] {set Objects($name@$daemon)}
    }]
}

# ::sorma::world::names -- what can stand after @, sorted: daemons of this user on this host, aliases of the dictionary, addresses of
# proxies, and what was added.
proc ::sorma::world::names {} {
    variable Added
    set names [concat [dict keys [Ways]] [dict values $Added]]
    return [lsort -unique [lsearch -all -inline -regexp $names {^[^\s@\[\]{}$"\\;[:cntrl:]]+$}]]
}

# ::sorma::world::find WHERE -- the KEY of the daemon that is meant by what stands after @; empty: none is known there.
proc ::sorma::world::find where {
    variable Daemons
    if {$where in {{} self}} {
        return self
    }
    if {[catch {::sorma::resolve @$where} place]} {
        return {}
    }
    if {[dict get $place state] eq "here"} {
        return self
    }
    dict for {key daemon} $Daemons {
        if {[dict get $daemon address] eq [dict get $place address]} {
            return $key
        }
    }
    return {}
}

# ::sorma::world::use ?WHERE? -- for a user that looks now and then and watches nothing: the model works on for a while, and sees which
# daemons there are. A daemon that nothing else leads to is known meanwhile. Returns its KEY, as find does.
proc ::sorma::world::use {{where {}}} {
    variable Daemons
    variable Passing
    Start
    if {![::sorma::timer::waits world.looked]} {
        Look
    }
    set key [find $where]
    if {[dict exists $Daemons $key] && [dict get $Daemons $key state] in {asking unresolved}} {
        Look                            ;# its host may be known now
    }
    if {$key eq {} && ![catch {::sorma::resolve @$where}]} {
        dict set Passing $where [clock milliseconds]
        Look
        set key [find $where]
    } elseif {[dict exists $Passing $where]} {
        dict set Passing $where [clock milliseconds]
    }
    EndLater
    return $key
}

# ::sorma::world::recount DAEMON -- ask for all its objects and what they have done; the differences are told.
# counted DAEMON -- ms, when the question was sent that was last answered; 0: none, or it is this process.
# knows DAEMON -- are all its objects known, since there is the line to it?
proc ::sorma::world::recount daemon {
    variable Lines
    variable Wanted
    dict set Wanted $daemon 1
    if {[info exists Lines($daemon)] && [dict get $Lines($daemon) peer] ne {} && [dict get $Lines($daemon) told]} {
        if {[dict exists $Lines($daemon) asking]} {
            dict set Lines($daemon) again 1         ;# that answer may be older than what is wanted
        } else {
            AskObjects $daemon
        }
    }
}
proc ::sorma::world::counted daemon {
    variable Lines
    return [if {[info exists Lines($daemon)]} {dict get $Lines($daemon) counted} else {string cat 0}]
}
proc ::sorma::world::knows daemon {
    variable Lines
    variable Daemons
    return [expr {[info exists Lines($daemon)] ? [dict get $Lines($daemon) known] : [dict exists $Daemons $daemon] && [dict get $Daemons $daemon objects] ne {}}]
}

# ::sorma::world::pulse DAEMON -- ask for its health now. heard DAEMON -- ms, when it last answered that; 0: never.
proc ::sorma::world::pulse daemon {
    variable Lines
    if {[info exists Lines($daemon)] && [dict get $Lines($daemon) peer] ne {} && [dict get $Lines($daemon) asked] == 0} {
        Pulse $daemon
    }
}
proc ::sorma::world::heard daemon {
    variable Lines
    return [if {[info exists Lines($daemon)]} {dict get $Lines($daemon) heard} else {string cat 0}]
}

# ::sorma::world::line DAEMON -- for the other parts of the model: the sorma::peer that is the line to it; empty: there is none now.
proc ::sorma::world::line daemon {
    variable Lines
    return [if {$daemon eq "self"} {set ::sorma::world::Local} elseif {[info exists Lines($daemon)]} {dict get $Lines($daemon) peer}]
}

# ::sorma::world::add ADDRESS -- know a daemon by what stands after @: host:7014, /path, an alias. forget ADDRESS takes one add back.
proc ::sorma::world::add address {
    Held add $address
    return $address
}
proc ::sorma::world::forget address {
    variable Added
    release [lindex [dict filter $Added script {token held} {expr {$held eq $address && [string match add* $token]}}] end-1]
}
# hold WHERE -- for one that looks at an object: know its daemon until the token that it returns is given to release. Nothing is added where the
# runtime folder or the dictionary leads to it.
proc ::sorma::world::hold where {
    set how [Ways]
    return [Held hold [if {$where ni {{} self} && (![dict exists $how $where] || [dict get $how $where] eq "proxy")} {set where}]]
}
proc ::sorma::world::release token {
    variable Added
    dict unset Added $token
    Soon
    EndLater
    return
}
proc ::sorma::world::Held {what address} {
    variable Added
    set token [NewToken $what]
    if {$address ne {}} {
        ::sorma::resolve @$address
        dict set Added $token $address
        Start
        Soon
    }
    return $token
}

# ::sorma::world::value NAME *|-option|{EXEC ...} ?-every ms? -command PREFIX -- see value.tcl.
proc ::sorma::world::value {name what args} {
    set options [Read {-every {{whole 0 {}} 0}} value $args]
    Start
    set token [::sorma::value new [NewToken value] $name $what [dict get $options -every] [dict get $options -command]]
    CountUnknown
    return $token
}

# ::sorma::world::listen NAME ?-event pattern? ?-queue n? -command PREFIX -- see events.tcl.
proc ::sorma::world::listen {name args} {
    set options [Read {-event {any *} -queue {{whole 1 1000000} 10000}} event $args]
    Start
    set token [::sorma::events new [NewToken events] $name [dict get $options -event] [dict get $options -queue] [dict get $options -command]]
    CountUnknown
    return $token
}

# ::sorma::world::ask DAEMON REQUEST ?-timeout ms? -command PREFIX --
#       Send a request, NAME EXEC|CTRL|DBX word ..., to a daemon that is known. PREFIX is called with ok and the reply (a dict), or
#       with error and the list of message and error code.
# Arguments:
#       ms      default 5000; 0: however long it takes
# Results:
#       Its number, for cancel; what its service publishes meanwhile carries it. Empty when it cannot be sent: PREFIX is told why.
proc ::sorma::world::ask {daemon request args} {
    variable Lines
    variable Here
    set options [::sorma::options::parse {-timeout {{whole 0 {}} 5000} -command any} $args]
    set command [dict get $options -command]
    if {$daemon eq "self"} {
        if {[catch {::sorma::async -timeout [dict get $options -timeout] -command [list ::sorma::world::AnswerHere $command] {*}$request} future failure]} {
            after 0 [list ::sorma::world::deliver $command [list error [list $future [dict get $failure -errorcode]]]]
            return
        }
        set number [$future request]
        dict set Here $number $future
        return $number
    }
    if {![info exists Lines($daemon)] || [dict get $Lines($daemon) peer] eq {}} {
        set known [get $daemon]
        set why [if {$known eq {}} {string cat "no daemon of that name is known"} else {dict get $known why}]
        after 0 [list ::sorma::world::deliver $command [list error [list "$daemon: $why" [list SORMA COMM REFUSED $daemon]]]]
        return
    }
    return [[dict get $Lines($daemon) peer] ask -timeout [dict get $options -timeout] -command $command {*}$request]
}

# ::sorma::world::cancel DAEMON NUMBER -- give a request up: its PREFIX is called with error, COMM CANCELLED, and its service is told. Was it
# under way?
proc ::sorma::world::cancel {daemon number} {
    variable Here
    if {$daemon eq "self"} {
        return [expr {[dict exists $Here $number] && [[dict get $Here $number] cancel]}]
    }
    set line [line $daemon]
    return [expr {$line ne {} && [$line cancel $number]}]
}

proc ::sorma::world::AnswerHere {command future} {
    variable Here
    set number [$future request]
    if {[dict exists $Here $number] && [dict get $Here $number] eq $future} {
        dict unset Here $number
    }
    set failed [catch {::sorma::KeepTrail [list $future take]} result options]
    if {$failed} {
        return [deliver $command [list error [list $result [dict get $options -errorcode]]]]
    }
    # A dict stays; the trail is the user's.
    if {[lindex $result 0] eq "RET"} {
        set result [dict remove [::sorma::message::fromList $result] trail]
    }
    deliver $command [list ok $result]
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

# ::sorma::world::lead WHO HOW ADDRESSES -- for the other parts of the model: as long as WHO says so, there are daemons at these.
proc ::sorma::world::lead {who how addresses} {
    variable Led
    if {[llength $addresses] > 0} {
        dict set Led $who [list $how $addresses]
    } else {
        dict unset Led $who
    }
    Soon
}

# Has each daemon answered, or failed, or let us wait for long enough?
proc ::sorma::world::CheckReady {} {
    variable Daemons
    variable Lines
    set now [clock milliseconds]
    dict for {key daemon} $Daemons {
        if {![info exists Lines($key)] || [dict get $Lines($key) known]} continue
        if {[dict get $daemon state] in {asking alive busy} && $now - [dict get $Lines($key) first] < 1000} {
            ::sorma::timer::once world.ready [expr {1001 - ($now - [dict get $Lines($key) first])}] ::sorma::world::CheckReady
            return
        }
    }
    ::sorma::news::ready
}

# ---- life of the model ----

proc ::sorma::world::Start {} {
    variable Running
    variable Local
    ::sorma::timer::cancel world.end
    if {$Running} {
        return
    }
    set Running 1
    set Local [::sorma::peer open self]
    $Local subscribe -event {[dot][bir][cja]*} -queue 100000 -command ::sorma::world::HappenedHere sorm
    NewDaemon self {} self
    TakeObjects self {} [dict create objects [HereObjects]]
    Beat
}

proc ::sorma::world::EndLater {} {
    variable Added
    variable Linger
    if {[llength [::sorma::news::patterns]] == 0 && ![::sorma::value inUse] && ![::sorma::events inUse] && [dict size $Added] == 0} {
        ::sorma::timer::once world.end $Linger ::sorma::world::End
    }
}

proc ::sorma::world::End {} {
    variable Running
    variable Local
    variable Lines
    set Running 0
    $Local destroy
    catch {::sorma::peer names -command {}}
    ::sorma::timer::cancel world.*
    foreach key [array names Lines] {
        Close $key
    }
    set ::sorma::world::Daemons {}
    set ::sorma::world::Work {}
    set ::sorma::world::Wanted {}
    set ::sorma::world::Led {}
    ::sorma::news::hint world.ended {} {}
    set ::sorma::world::Twins {}
    set ::sorma::world::Opening {}
    foreach name {Objects Names Lines} {
        array unset ::sorma::world::$name
    }
}

# The objects or daemons may have changed: look again when the present events were handled.
proc ::sorma::world::Soon args {
    ::sorma::timer::once world.look 0 ::sorma::world::Look
}

# A socket was added or removed: a daemon that could not be reached before may be there now.
proc ::sorma::world::FolderChanged {} {
    variable Lines
    foreach key [array names Lines] {
        if {[dict get $Lines($key) peer] eq {}} {
            dict set Lines($key) opened 0
        }
    }
    Soon
}

# Which daemons there are: of the runtime folder, the dictionary, proxies, and those that were added. One address, one daemon.
proc ::sorma::world::Look {} {
    variable Daemons
    variable Added
    variable Running
    if {!$Running} {
        return
    }
    variable Passing
    variable Led
    variable Twins
    variable Linger
    ::sorma::timer::once world.looked 0 list                 ;# once in a turn of the event loop is enough
    set how [Ways]
    set old [expr {[clock milliseconds] - 6 * $Linger}]
    set Passing [dict filter $Passing script {where ms} {expr {$ms > $old}}]
    foreach where [concat [dict values $Added] [dict keys $Passing]] {
        if {![dict exists $how $where]} {
            dict set how $where added
        }
    }
    dict for {who found} $Led {
        lassign $found reason addresses
        foreach where $addresses {
            if {![dict exists $how $where] && ![dict exists $Twins $where]} {
                dict set how $where $reason
            }
        }
    }
    set seen {}
    dict for {where reason} $how {
        if {[catch {::sorma::resolve @$where} place] || [dict get $place state] eq "here" || [dict exists $seen [dict get $place address]]} {
            dict unset how $where
            continue
        }
        dict set seen [dict get $place address] 1
        if {![dict exists $Daemons $where]} {
            NewDaemon $where [dict get $place address] $reason
        } elseif {[dict get $Daemons $where address] ne [dict get $place address]} {
            Set $where [dict create address [dict get $place address]]
            Close $where
        }
        Resolved $where $place
    }
    foreach key [dict keys $Daemons] {
        if {$key ne "self" && ![dict exists $how $key]} {
            Gone $key
        }
    }
    CheckReady
}

# The ways to daemons that are known here: a dict: text after @ -> folder, dictionary or proxy.
proc ::sorma::world::Ways {} {
    set how {}
    catch {                             ;# a folder that others may write to is as good as none
        foreach name [::sorma::peer names -command ::sorma::world::FolderChanged] {
            dict set how $name folder
        }
    }
    foreach item [HereFacts addresses] {
        lassign $item word address
        set where [if {[string match @* $word]} {string range $word 1 end} else {string trimleft $address @}]
        if {![dict exists $how $where]} {
            dict set how $where dictionary
        }
    }
    foreach name [::sorma::names *@*] {
        set where [string range $name [string first @ $name]+1 end]
        if {![dict exists $how $where]} {
            dict set how $where proxy
        }
    }
    return $how
}

# Once a second: is each daemon still there? What is not connected is tried again.
proc ::sorma::world::Beat {} {
    variable Lines
    variable Pulse
    variable Silence
    variable Beaten
    ::sorma::timer::once world.beat $Pulse ::sorma::world::Beat
    Look
    set now [clock milliseconds]
    set slept [expr {$now - $Beaten > 2 * $Pulse}]      ;# no event loop has run: answers may be waiting for us
    set Beaten $now
    foreach key [array names Lines] {
        if {[dict get $Lines($key) peer] eq {}} continue
        set asked [dict get $Lines($key) asked]
        if {$asked == 0} {
            Pulse $key
        } elseif {$slept} {
            dict set Lines($key) asked $now
        } elseif {$now - $asked >= $Silence} {
            State $key silent "no answer: it may be stopped"
        }
    }
}

proc ::sorma::world::Pulse key {
    variable Lines
    dict set Lines($key) asked [clock milliseconds]
    [dict get $Lines($key) peer] health [list ::sorma::world::Healthy $key [dict get $Lines($key) serial]]
}

# ---- daemons ----

proc ::sorma::world::NewDaemon {key address how} {
    variable Daemons
    variable Lines
    variable Names
    set now [clock milliseconds]
    dict set Daemons $key [dict create name $key address $address how $how state [expr {$key eq "self" ? "alive" : "asking"}] why {} \
        since $now user {} host {} pid {} boot {} objects {} busy {}]
    set Names($key) {}
    if {$key ne "self"} {
        set Lines($key) [dict create peer {} serial 0 opened 0 first $now asked 0 told 0 known 0 counted 0 heard 0 text {} touched 0 log {}]
    }
    ::sorma::news::emit daemon.here $key [dict get $Daemons $key]
}

# Facts of a daemon that may be new.
proc ::sorma::world::Set {key facts} {
    variable Daemons
    set before [dict get $Daemons $key]
    set after [dict merge $before $facts]
    if {$after ne $before} {
        dict set Daemons $key $after
        if {[dict get $after boot] ne [dict get $before boot]} {
            hint daemon.process $key $after
        }
        ::sorma::news::emit daemon.changed $key $after
    }
}

# ago: how long it has lasted already, when it is new [ms].
proc ::sorma::world::State {key state why {busy {}} {ago 0}} {
    variable Daemons
    set facts [dict create state $state why $why busy $busy]
    if {[dict get $Daemons $key state] ne $state} {
        dict set facts since [expr {[clock milliseconds] - $ago}]
    }
    Set $key $facts
    CheckReady
}

# Its address leads there now.
proc ::sorma::world::Resolved {key place} {
    variable Lines
    switch -- [dict get $place state] {
        known {
            if {[dict get $Lines($key) peer] eq {} && [clock milliseconds] - [dict get $Lines($key) opened] > 900} {
                OpenLater $key
            }
        }
        asking { State $key asking [dict get $place why] }
        default {
            State $key unresolved [dict get $place why]
            Lost $key
        }
    }
}

# Lines are made a slice at a time, like all that may be much.
proc ::sorma::world::OpenLater key {
    variable Opening
    if {$key ni $Opening} {
        lappend Opening $key
        ::sorma::timer::once world.open 0 ::sorma::world::OpenSome
    }
}

proc ::sorma::world::OpenSome {} {
    variable Opening
    variable Lines
    variable Slice
    set end [expr {[clock milliseconds] + $Slice}]
    while {[llength $Opening] > 0} {
        set Opening [lassign $Opening key]
        if {[info exists Lines($key)] && [dict get $Lines($key) peer] eq {}} {
            Open $key
        }
        if {[clock milliseconds] >= $end && [llength $Opening] > 0} {
            ::sorma::timer::once world.open 1 ::sorma::world::OpenSome
            return
        }
    }
}

# Make a connection to it. The first request only tells whether a daemon is there.
proc ::sorma::world::Open key {
    variable Lines
    set serial [NewToken line]
    set peer [::sorma::peer open $key -command [list ::sorma::world::Connected $key $serial]]
    set Lines($key) [dict merge $Lines($key) [dict create peer $peer serial $serial opened [clock milliseconds] asked [clock milliseconds] \
        told 0 known 0 log {}]]
    hint line.open $key
    $peer ask -timeout 60000 -command [list ::sorma::world::Greeted $key $serial] sorm DBX -info class
}

proc ::sorma::world::Close key {
    variable Lines
    if {[info exists Lines($key)] && [dict get $Lines($key) peer] ne {}} {
        [dict get $Lines($key) peer] destroy
        dict set Lines($key) peer {}
        dict set Lines($key) serial {}
        dict set Lines($key) told 0
        dict unset Lines($key) asking
    }
}

proc ::sorma::world::Gone key {
    variable Daemons
    variable Lines
    variable Names
    Close $key
    foreach name [dict keys $Names($key)] {
        Removed $key $name
    }
    set boot [dict get $Daemons $key boot]
    if {[dict get $Daemons $key how] ni {sibling rpcbind}} {
        set ::sorma::world::Twins [dict filter $::sorma::world::Twins script {where twin} {expr {$twin ne $boot}}]
    }
    unset -nocomplain Lines($key) Names($key)
    set last [dict merge [dict get $Daemons $key] [dict create state gone since [clock milliseconds]]]
    dict unset Daemons $key
    ::sorma::news::emit daemon.gone $key $last
    CheckReady
}

# Does an answer come on the line that there is?
proc ::sorma::world::Current {key serial} {
    variable Lines
    return [expr {[info exists Lines($key)] && [dict get $Lines($key) serial] eq $serial}]
}

# The line is there, or lost.
proc ::sorma::world::Connected {key serial} {
    variable Lines
    if {![Current $key $serial]} {
        return
    }
    set peer [dict get $Lines($key) peer]
    set facts [$peer facts]
    if {[dict get $facts connected]} {
        Set $key [dict filter $facts key user host pid boot]
        FindTwins $key
        if {![info exists Lines($key)]} {
            return
        }
        Pulse $key
        if {![dict get $Lines($key) told]} {
            dict set Lines($key) told 1
            $peer subscribe -event {[ots][bri][jab]*} -queue 100000 -command [list ::sorma::world::Happened $key $serial] sorm
            if {[WantsObjects $key]} {
                AskObjects $key
            }
            hint line.made $key
        }
        return
    }
    # A daemon that closes each connection at once is tried again with the next beat.
    set age [expr {[clock milliseconds] - [dict get $Lines($key) opened]}]
    Close $key
    if {$age > 900} {
        Open $key
    }
}

proc ::sorma::world::Greeted {key serial status value} {
    variable Lines
    if {$status eq "ok" || ![Current $key $serial]} {
        return
    }
    if {[string match "SORMA COMM TIMEOUT*" [lindex $value 1]] && [dict get [[dict get $Lines($key) peer] facts] connected]} {
        return                              ;# it works on something: HEALTH says how it is
    }
    Failed $key {*}$value
}

# An answer that is an error says how the daemon is.
proc ::sorma::world::Failed {key message code} {
    variable Daemons
    regsub {^sorm@\S+: } $message {} message
    switch -glob -- $code {
        "SORMA COMM DENIED*" - "SORMA ACCESS*" {
            State $key denied $message
            return
        }
        "SORMA COMM TIMEOUT*" { State $key silent $message }
        "SORMA ADDRESS*" { State $key unresolved $message }
        default {
            if {[dict get $Daemons $key how] eq "folder" && [string match "SORMA COMM REFUSED*" $code]} {
                State $key dead "its socket is all that is left"
            } else {
                State $key refused $message
            }
        }
    }
    Lost $key
}

# There is no line to it any more. Of one that is not there nothing is left; one that is silent may come back with all it has.
proc ::sorma::world::Lost key {
    variable Daemons
    variable Names
    Close $key
    if {[dict get $Daemons $key state] in {dead refused unresolved}} {
        foreach name [dict keys $Names($key)] {
            Removed $key $name
        }
    }
    Counts $key
}

proc ::sorma::world::Healthy {key serial health} {
    variable Daemons
    variable Lines
    if {![Current $key $serial]} {
        return
    }
    dict set Lines($key) asked 0
    dict set Lines($key) heard [clock milliseconds]
    if {[dict get $Daemons $key state] eq "denied"} {
        return [hint heard $key]
    }
    State $key [dict get $health state] {} [dict get $health what] [dict get $health since]
    hint heard $key
    if {[dict get $health state] eq "alive"} {
        CountUnknown
    }
}

# A daemon that was named from elsewhere may be known already, by another address: then it is enough to know it once.
proc ::sorma::world::FindTwins key {
    variable Daemons
    variable Twins
    set boot [dict get $Daemons $key boot]
    dict for {other daemon} $Daemons {
        if {$other ne $key && $boot ne {} && [dict get $daemon boot] eq $boot} {
            foreach one [list $key $other] {
                if {[dict exists $Daemons $one] && [dict get $Daemons $one how] in {sibling rpcbind}} {
                    dict set Twins $one $boot
                    Gone $one
                    break
                }
            }
        }
    }
}

# ---- objects ----

# Does anybody want to know its objects? Who only asks for something now and then does not.
proc ::sorma::world::WantsObjects key {
    variable Wanted
    return [expr {[dict exists $Wanted $key] || [InUse]}]
}

# Is anybody told of what happens to objects?
proc ::sorma::world::InUse {} {
    return [expr {[::sorma::value inUse] || [::sorma::events inUse]
        || [lsearch -not -exact [::sorma::news::patterns] {}] >= 0}]
}

# Ask for the objects of daemons that are wanted and not known yet.
proc ::sorma::world::CountUnknown {} {
    variable Lines
    foreach key [array names Lines] {
        if {[dict get $Lines($key) told] && ![dict get $Lines($key) known] && ![dict exists $Lines($key) asking] && [WantsObjects $key]} {
            AskObjects $key
        }
    }
}

proc ::sorma::world::AskObjects key {
    variable Lines
    dict set Lines($key) log {}
    dict set Lines($key) asking [clock milliseconds]
    [dict get $Lines($key) peer] ask -timeout 10000 -command [list ::sorma::world::Counted $key [dict get $Lines($key) serial]] \
        sorm DBX -inventory objects
}

proc ::sorma::world::Counted {key serial status value} {
    variable Lines
    if {![Current $key $serial]} {
        return
    }
    if {$status eq "error"} {
        dict unset Lines($key) asking
        if {![string match "SORMA COMM TIMEOUT*" [lindex $value 1]]} {      ;# then HEALTH says how it is
            Failed $key {*}$value
        }
        return
    }
    set text [dict get $value text]
    if {[dict get $Lines($key) known] && ![dict get $Lines($key) touched] && $text eq [dict get $Lines($key) text]} {
        return [TookAll $key {} 1]          ;# nothing has happened there since
    }
    dict set Lines($key) text $text
    dict set Lines($key) touched 0
    TakeObjects $key $serial $text
}

# All objects of a daemon, a dict of objects, {name class calls underway} each: tell the differences, when it is their turn.
proc ::sorma::world::TakeObjects {key serial inventory} {
    variable Work
    lappend Work [list $key $serial $inventory]
    ::sorma::timer::once world.work 0 ::sorma::world::DoWork
}

# Take in what daemons have answered, for a while: many answers at once must not hold up the event loop.
proc ::sorma::world::DoWork {} {
    variable Work
    variable Wanted
    variable Slice
    set end [expr {[clock milliseconds] + $Slice}]
    while {[llength $Work] > 0} {
        set first 0
        foreach key [dict keys $Wanted] {
            set first [expr {max($first, [lsearch -exact -index 0 $Work $key])}]
        }
        lassign [lindex $Work $first] key serial items at seen
        set Work [lreplace $Work $first $first]
        if {$key ne "self" && ![Current $key $serial]} continue
        if {$at eq {}} {
            set at 0
            if {[catch {dict get $items objects} items] || [catch {llength $items}]} {
                dict unset ::sorma::world::Lines($key) asking
                State $key refused "its answer makes no sense"
                continue
            }
        }
        set at [TakeSome $key $items $at seen $end]
        if {$at < [llength $items]} {
            set Work [linsert $Work 0 [list $key $serial $items $at $seen]]
        } else {
            TookAll $key $seen
        }
        if {[clock milliseconds] >= $end && [llength $Work] > 0} {
            ::sorma::timer::once world.work 1 ::sorma::world::DoWork
            return
        }
    }
}

# From one of them on, until a time. Returns how far it came. Most are as they were: those are passed by quickly.
proc ::sorma::world::TakeSome {key items at seenVar end} {
    upvar 1 $seenVar seen
    variable Objects
    variable Names
    variable MostObjects
    set log [LogOf $key]
    set n [llength $items]
    set told [InUse]
    for {} {$at < $n} {incr at} {
        if {$at % 20 == 0 && [clock milliseconds] >= $end} break
        if {[catch {lassign [lindex $items $at] name class calls underway}]} continue
        set full $name@$key
        if {[info exists Objects($full)]} {
            dict set seen $name 1
            set known $Objects($full)
            if {[dict get $known calls] eq $calls && [dict get $known underway] eq $underway && [dict get $known class] eq $class} continue
        } elseif {![IsName $name $class] || [dict size $Names($key)] >= $MostObjects} {
            continue
        }
        if {![string is wideinteger -strict $calls] || ![string is wideinteger -strict $underway]} continue
        dict set seen $name 1
        if {!$told} {
            dict set Names($key) $name 1
            set Objects($full) [dict create name $name class $class calls $calls underway $underway]
        } elseif {![dict exists $log $name] || [dict get $log $name] eq "made"} {
            Made $key $name $class $calls $underway
        }
    }
    return $at
}

# Most names have nothing but letters, digits and the like; to see that is quicker.
proc ::sorma::world::IsName {name class} {
    return [expr {[string is alpha -strict [string index $name 0]] && [string is alnum -strict [string map {. {} _ {} - {}} $name$class]]
        || [regexp {^[[:alpha:]][^\s@\[\]{}$"\\;[:cntrl:]]*$} $name] && [regexp {^\w+$} $class]}]
}

proc ::sorma::world::TookAll {key seen {same 0}} {
    variable Lines
    variable Names
    set log [LogOf $key]
    foreach name [if {!$same} {dict keys $Names($key)}] {
        if {![dict exists $seen $name] && !([dict exists $log $name] && [dict get $log $name] eq "made")} {
            Removed $key $name
        }
    }
    if {$key ne "self"} {
        dict set Lines($key) known 1
        if {[dict exists $Lines($key) asking]} {        ;# else two answers have come at once
            dict set Lines($key) counted [dict get $Lines($key) asking]
        }
        dict unset ::sorma::world::Wanted $key
        dict set Lines($key) log {}
        dict unset Lines($key) asking
    }
    Counts $key
    hint counted $key
    CheckReady
    if {$key ne "self" && [dict exists $Lines($key) again]} {
        dict unset Lines($key) again
        recount $key
    }
}

# Objects that were made and removed since the daemon was asked for its objects: newer than the answer.
proc ::sorma::world::LogOf key {
    variable Lines
    return [if {$key ne "self"} {dict get $Lines($key) log}]
}

proc ::sorma::world::Made {key name class calls underway} {
    variable Objects
    variable Names
    variable MostObjects
    set full $name@$key
    if {![info exists Objects($full)]} {
        if {[dict size $Names($key)] >= $MostObjects} return
        dict set Names($key) $name 1
        set Objects($full) [dict create name $name class $class calls $calls underway $underway]
        ::sorma::news::emit object.made $full $Objects($full)
    } elseif {[dict get $Objects($full) calls] != $calls || [dict get $Objects($full) underway] != $underway
            || [dict get $Objects($full) class] ne $class} {
        set Objects($full) [dict create name $name class $class calls $calls underway $underway]
        ::sorma::news::emit object.changed $full $Objects($full)
    }
}

proc ::sorma::world::Removed {key name} {
    variable Objects
    variable Names
    dict unset Names($key) $name
    if {[info exists Objects($name@$key)]} {
        set object $Objects($name@$key)
        unset Objects($name@$key)
        ::sorma::news::emit object.removed $name@$key $object
    }
}

proc ::sorma::world::Counts key {
    Set $key [dict create objects [dict size $::sorma::world::Names($key)]]
}

# An event of the object sorm of a daemon.
proc ::sorma::world::Happened {key serial event} {
    variable Lines
    if {![Current $key $serial]} {
        return
    }
    switch -- [dict get $event event] {
        sorma.reconnected - sorma.gone { return [AskObjects $key] }
        sorma.refused { return [State $key denied [dict get $event text]] }
    }
    if {[dict get $event lost] != 0} {
        AskObjects $key
    }
    if {[dict get $event event] eq "siblings.changed"} {
        return [hint siblings.changed $key]
    }
    if {[dict exists $Lines($key) asking] && [dict get $event event] in {object.made object.removed}} {
        dict set Lines($key) log [dict get $event text] [string range [dict get $event event] 7 end]
    }
    Take $key $event
}

# Events of this process.
proc ::sorma::world::HappenedHere event {
    if {[dict get $event event] eq "dictionary.changed"} {
        return [Soon]
    }
    if {[dict get $event lost] != 0} {
        TakeObjects self {} [dict create objects [HereObjects]]
    }
    Take self $event
}

proc ::sorma::world::Take {key event} {
    variable Objects
    variable Names
    variable Lines
    set name [dict get $event text]
    if {$key ne "self" && [dict get $event event] in {object.made object.removed}} {
        dict set Lines($key) touched 1
    }
    switch -glob -- [dict get $event event] {
        object.made {
            Made $key $name [lindex [dict get $event words] 0] 0 0
            Counts $key
        }
        object.removed {
            Removed $key $name
            Counts $key
        }
        object.changed {
            if {[info exists Objects($name@$key)]} {
                set words [lrange [dict get $event words] 1 end-1]
                if {[llength $words] % 2 == 0} {
                    ::sorma::news::emit object.changed $name@$key [dict merge $Objects($name@$key) \
                        [dict create changes $words by [lindex [dict get $event words] end]]]
                }
            }
        }
        trail.* {
            lassign [dict get $event words] so code request
            ::sorma::news::emit trail [if {$so ne {}} {string cat $so@$key} else {set key}] [dict create severity [string range [dict get $event event] 6 end] \
                text $name so $so code $code request $request time [dict get $event time]]
        }
    }
}

proc ::sorma::world::HereFacts what {
    return [dict get [lindex [::sorma::KeepTrail [list ::sorma::so::sorm DBX -inventory $what]] 3] $what]
}

proc ::sorma::world::HereObjects {} {
    return [lsearch -all -inline -not -index 0 [HereFacts objects] *@*]
}

package require sorma::value
package require sorma::events
package require sorma::elsewhere
