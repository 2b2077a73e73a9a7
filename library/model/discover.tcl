# discover.tcl -- what there is: here, and at each daemon that can be reached. Shared by completion, inspector and panels.
#
# Nothing here waits for a daemon unless its caller says for how long. What is asked of a daemon is asked by a second
# interpreter: its proxies, its connections, its deadlines and its trail are not the user's. Answers are kept, and asked
# for again in the background when they are needed and have grown old. Nothing is ever made for a question: daemons are
# asked through their object `sorm`, DBX -inventory and -describe.
#
# Answers come from strangers: they are data, checked before they are believed, and never evaluated.

package require sorma
package provide sorma::discover 1.0
namespace eval ::sorma::discover {
    namespace export settle daemons names objects classes words inventory census describe guess locate ask fetch await renew address state trouble consult
    namespace ensemble create

    variable Fresh 1000         ;# ms for which an answer is not asked for again
    variable Patience 3000      ;# ms for which a daemon may take its time, in the background
    variable Many 1000          ;# answers that are kept before old ones are looked for
    variable Most 200000        ;# names that are believed to be at one daemon
    variable Peer               ;# the interpreter that asks, empty before it is needed
    # array: {address request} -> dict, request being the words of a request to an object there
    #   future   name in Peer, empty when nothing is under way      asked   ms, when that was begun
    #   text     last answer                                        came    ms, when that came; 0: never
    #   error, code   of the last attempt when that failed          failed  ms, when; 0: it did not
    variable Asked
    variable Parsed             ;# array: {address request} -> {came, dict}: an answer, checked and taken apart
    variable inventoryRequest {sorm DBX -inventory names classes words}
    variable Waits              ;# array: token -> coroutine that waits for answers, empty: somebody who blocks
    variable LastWait
    variable Own                ;# {ms, addresses of the dictionary}
    if {![info exists Peer]} {  ;# when this file is read again, what is known stays
        set Peer {}
        set LastWait 0
        set Own {0 {}}
        foreach name {Asked Parsed Waits} {
            array set $name {}
        }
    }
}

# ---- here and elsewhere ----

# ::sorma::discover::locate NAME --
#       {SERVICE WHERE}: the name as its process knows it, and what stands after @ (empty: here).
proc ::sorma::discover::locate name {
    if {[catch {::sorma::resolve $name} place]} {
        return [list $name {}]
    }
    return [list [dict get $place service] [if {[dict get $place state] ne "here"} {dict get $place where}]]
}

# ::sorma::discover::address WHERE --
#       What an address means now: a path, host:number, or `self` for this process. What leads nowhere is what it was.
proc ::sorma::discover::address where {
    if {[catch {::sorma::resolve @$where} place]} {
        return $where
    }
    if {[dict get $place state] eq "here"} {
        return self
    }
    return [expr {[dict get $place socket] ne {} ? [dict get $place socket] : [dict get $place address]}]
}

# Words of the dictionary that are addresses, and what they mean: a dict, at most Fresh ms old.
proc ::sorma::discover::addresses {} {
    variable Own
    variable Fresh
    set now [clock milliseconds]
    if {$now - [lindex $Own 0] >= $Fresh} {
        set Own [list $now [concat {*}[dict get [localText {sorm DBX -inventory addresses}] addresses]]]
    }
    return [lindex $Own 1]
}

# Forget what is known of here: the next question sees what the dictionary says now.
proc ::sorma::discover::lookAgain {} {
    variable Own {0 {}}
}

# The text of a reply of an object of this interpreter. The user's trail stays what it was.
proc ::sorma::discover::localText request {
    set words [lassign $request so]
    set reply [::sorma::Aside [list ::sorma::so::$so {*}$words]]
    return [lindex $reply 3]
}

# ---- daemons ----

# ::sorma::discover::names --
#       What can stand after @, as far as it is known at once: daemons of this user on this host, aliases of the
#       dictionary, and the addresses of proxies.
proc ::sorma::discover::names {} {
    set found {}
    catch {                             ;# a folder that others may write to is as good as none
        foreach name [::sorma::peer names] {
            dict set found $name 1
        }
    }
    foreach word [dict keys [addresses] @*] {
        dict set found [string range $word 1 end] 1
    }
    foreach name [::sorma::names *@*] {
        dict set found [string range $name [string first @ $name]+1 end] 1
    }
    return [lsort [lsearch -all -inline -regexp [dict keys $found] {^[^\s@\[\]{}$"\\;[:cntrl:]]+$}]]
}

# ::sorma::discover::state WHERE ?REQUEST? --
#       How a daemon is, from what became of a request, as a dict of state and error. state: self, alive, asking (no
#       answer yet), away (no answer within Patience), refused, or failed; error says what is wrong.
proc ::sorma::discover::state {where {request {}}} {
    variable Asked
    variable inventoryRequest
    set address [address $where]
    if {$address eq "self"} {
        return {state self error {}}
    }
    if {$request eq {}} {
        set request $inventoryRequest
    }
    set key [list $address $request]
    if {![info exists Asked($key)]} {
        return {state asking error {}}
    }
    set entry $Asked($key)
    if {[dict get $entry failed]} {
        set state failed
        switch -glob -- [dict get $entry code] {
            "SORMA COMM TIMEOUT*" { set state away }
            "SORMA COMM REFUSED*" - "SORMA ADDRESS*" { set state refused }
        }
        return [dict create state $state error [dict get $entry error]]
    }
    if {[dict get $entry came] > 0 && ([dict get $entry future] eq {} || [clock milliseconds] - [dict get $entry asked] < 300)} {
        return {state alive error {}}
    }
    set waited [expr {[clock milliseconds] - [dict get $entry asked]}]
    return [dict create state asking error "no answer for $waited ms"]
}

# ::sorma::discover::trouble WHERE ?REQUEST? --
#       Why a daemon gives no answer, in one line for people; empty when it does. Whether it is busy or does not live is
#       asked as consult does.
proc ::sorma::discover::trouble {where {request {}}} {
    variable Health
    set found [state $where $request]
    set address [address $where]
    switch -- [dict get $found state] {
        self - alive { return {} }
        asking - away {}
        refused {
            if {[string match /* $address]} {
                if {![file exists $address]} {
                    return "no daemon listens on $address"
                }
                # Whoever sees it removes it, so that it is said once.
                if {![catch {::sorma::RuntimeSocket [file rootname [file tail $address]]} own] && $own eq $address
                        && ![catch {::sorma::SweepSocket [file rootname [file tail $address]]} swept] && $swept} {
                    return "dead: its socket was all that was left, and has been removed"
                }
                return "dead: its socket is all that is left"
            }
            return [dict get $found error]
        }
        default { return [dict get $found error] }
    }
    if {[numeric $address] eq {}} {
        return [whyNot $address]
    }
    consult [list $where] $request
    set text [lindex $Health($address) 1]
    return [if {$text eq {}} {string cat "no answer yet"} else {set text}]
}

# ::sorma::discover::consult WHERES ?REQUEST? --
#       Find out whether those that do not answer a request are busy or do not live: all at once, in at most 300 ms, and not again
#       for 3 s. Waits as await does; trouble says what came of it.
proc ::sorma::discover::consult {wheres {request {}}} {
    variable Health
    variable Consulted
    set now [clock milliseconds]
    set peers {}
    foreach where $wheres {
        set address [address $where]
        if {[dict get [state $where $request] state] ni {asking away} || [numeric $address] eq {} || [dict exists $peers $address]
                || ([info exists Health($address)] && $now - [lindex $Health($address) 0] <= 3000)} continue
        set Health($address) [list $now "no answer: it may be stopped"]
        # A client of its own: Peer may be making a connection, and a busy daemon greets each client just once.
        if {[catch {::sorma::peer open $where -command [list ::sorma::discover::Greeted $address]} peer]} continue
        dict set peers $address $peer
        set Consulted($address) $peer
        $peer ask -timeout 1000 sorm DBX -info class
    }
    set token [NewWait]
    try {
        while {[llength [lsearch -all -inline -exact [lmap address [dict keys $peers] {info exists Consulted($address)}] 1]] > 0
            && [Suspended $token [expr {$now + 300 - [clock milliseconds]}]]} {}
    } finally {
        EndWait $token
        dict for {address peer} $peers {
            unset -nocomplain Consulted($address)
            $peer destroy
        }
    }
}

proc ::sorma::discover::Greeted address {
    variable Consulted
    if {[info exists Consulted($address)]} {
        $Consulted($address) health [list ::sorma::discover::Healthy $address]
    }
}

proc ::sorma::discover::Healthy {address health} {
    variable Health
    variable Consulted
    set text {}
    if {[dict get $health state] eq "busy"} {
        set text "busy with [dict get $health what], for [dict get $health since] ms"
    }
    set Health($address) [list [clock milliseconds] $text]
    unset -nocomplain Consulted($address)
    WakeAll
}

# ::sorma::discover::daemons --
#       A list of dicts: name, address, state and error (as state gives them), objects (how many, empty: not known).
# Arguments:
#       wait    ms to wait for those that have not answered yet
proc ::sorma::discover::daemons {{wait 0}} {
    variable inventoryRequest
    set names [names]
    if {$wait > 0} {
        await $wait $names $inventoryRequest
    }
    return [lmap name $names {
        set known [inventory $name]
        set state [state $name]
        dict create name $name address [address $name] state [dict get $state state] error [dict get $state error] \
            objects [expr {[dict exists $known names] ? [llength [dict get $known names]] : {}}]
    }]
}

# ::sorma::discover::inventory WHERE --
#       What there is at a daemon (empty: here): a dict of names (of its objects, sorted), classes (dict: name ->
#       {version purpose}), words (of the dictionary). Empty as long as nothing is known.
proc ::sorma::discover::inventory {where {now 0}} {
    variable inventoryRequest
    return [Known $where $inventoryRequest ParseInventory $now]
}

# ::sorma::discover::census WHERE --
#       Objects and what they have done: a dict: name -> {class calls underway}. Empty as long as nothing is known.
proc ::sorma::discover::census where {
    return [Known $where {sorm DBX -inventory objects} ParseCensus 1]
}

# Names of objects at a daemon, sorted.
proc ::sorma::discover::objects where {
    if {$where eq {} || [address $where] eq "self"} {
        return [::sorma::names]
    }
    set known [inventory $where]
    return [if {$known ne {}} {dict get $known names}]
}

# ::sorma::discover::classes WHERE --
#       Classes known at a daemon; here also those whose package could be loaded.
proc ::sorma::discover::classes where {
    if {$where ne {} && [address $where] ne "self"} {
        set known [inventory $where]
        return [if {$known ne {}} {dict keys [dict get $known classes]}]
    }
    set found {}
    foreach name [::sorma::classes] {
        dict set found $name 1
    }
    foreach package [lsearch -all -inline -glob [package names] sorma::service::*] {
        dict set found [namespace tail $package] 1
    }
    dict unset found proxy
    return [lsort [dict keys $found]]
}

# Words of the dictionary of a daemon.
proc ::sorma::discover::words where {
    if {$where eq {} || [address $where] eq "self"} {
        return [dict get [localText {sorm DBX -inventory words}] words]
    }
    set known [inventory $where]
    return [if {$known ne {}} {dict get $known words}]
}

# ::sorma::discover::describe NAME --
#       The table of an object's class, as a dict: name exists class purpose version options fixed actions inspections
#       reads writes words signature example help, and dump when the object exists. No object is made; a class of this
#       interpreter is loaded. Empty when nothing is known, or not yet.
proc ::sorma::discover::describe name {
    lassign [locate $name] service where
    if {$where ne {}} {
        return [Known $where [list sorm DBX -describe $service] parseDescription 1]
    }
    if {![::sorma::exists $service]} {
        set class [lindex [split $service .] 0]
        if {$class ni [::sorma::classes] && ![hasPackage sorma::service::$class]} {
            return {}
        }
    } elseif {[catch {localText [list sorm DBX -describe $service]} text]} {
        return {}
    } else {
        return $text
    }
    if {[catch {localText [list sorm DBX -describe $service]} text]} {
        return {}
    }
    return $text
}

# The same as far as anything is known now: of an object elsewhere its own table, else that of the class of that name here.
proc ::sorma::discover::guess name {
    set table [describe $name]
    lassign [locate $name] service where
    if {$table eq {} && $where ne {}} {
        set table [describe [lindex [split $service .] 0].?]
    }
    return $table
}

proc ::sorma::discover::hasPackage package {
    return [expr {[llength [package versions $package]] > 0 || [package provide $package] ne {}}]
}

# Actions and inspections that every class has: {actions inspections}, elements as in describe.
proc ::sorma::discover::common {} {
    variable CommonRequests
    if {![info exists CommonRequests]} {
        set own [localText {sorm DBX -describe sorm}]
        set CommonRequests [lmap {what key} {actions actions inspections inspections} {
            lmap action [lrange [localText [list sorm DBX -info $what]] [llength [dict get $own $key]] end] {
                lassign $action name usage help
                set least [llength [lsearch -all -not -glob $usage {[?]*}]]
                list $name $usage $help $least [llength $usage]
            }
        }]
    }
    return $CommonRequests
}

# ---- asking ----

# ::sorma::discover::ask WHERE REQUEST --
#       The text of a daemon's answer as far as it is known, empty when it is not; asks in the background when it is
#       older than Fresh. Errors are in state.
proc ::sorma::discover::ask {where request} {
    variable Asked
    set address [address $where]
    if {$address eq "self"} {
        return [localText $request]
    }
    set key [list $address $request]
    Ask $key
    return [dict get $Asked($key) text]
}

# The same, checked and taken apart by a proc, once for each answer. Empty for an answer that makes no sense. A long
# answer is taken apart by the event loop, and until then the one before stands, unless it has to be now.
proc ::sorma::discover::Known {where request parseCmd {now 0}} {
    variable Asked
    variable Parsed
    set address [if {$where eq {}} {string cat self} else {address $where}]
    if {$address eq "self"} {
        return [$parseCmd [localText $request]]
    }
    set key [list $address $request]
    Ask $key
    set came [dict get $Asked($key) came]
    if {$came == 0} {
        return {}
    }
    if {![info exists Parsed($key)] || [lindex $Parsed($key) 0] != $came} {
        if {!$now && [string length [dict get $Asked($key) text]] > 50000} {
            after cancel [list ::sorma::discover::Known $where $request $parseCmd 1]
            after 0 [list ::sorma::discover::Known $where $request $parseCmd 1]
            return [if {[info exists Parsed($key)]} {lindex $Parsed($key) 1}]
        }
        if {[catch {$parseCmd [dict get $Asked($key) text]} parsed]} {
            dict set Asked($key) failed $came
            dict set Asked($key) error "its answer makes no sense: $parsed"
            dict set Asked($key) code {SORMA COMM PROTOCOL}
            set parsed {}
        }
        set Parsed($key) [list $came $parsed]
    }
    return [lindex $Parsed($key) 1]
}

# ::sorma::discover::fetch WHERE REQUEST MS --
#       The text of a daemon's answer to a request that is sent now. Fails as the request does. Waits as await does.
proc ::sorma::discover::fetch {where request ms} {
    set address [address $where]
    if {$address eq "self"} {
        return [localText $request]
    }
    set words [lassign $request so]
    set token [NewWait]
    set future [interp eval [asker] [list ::sorma::async -timeout $ms -command [list ::sorma::discover::Wake $token] $so@$address {*}$words]]
    try {
        set end [expr {[clock milliseconds] + $ms + 1000}]
        while {![interp eval [asker] [list $future done]] && [Suspended $token [expr {$end - [clock milliseconds]}]]} {}
        return [lindex [interp eval [asker] [list $future result]] 3]
    } on error {message options} {
        dict unset options -errorinfo
        return -options $options "daemon $where: [regsub {^sorm@\S+: } $message {}]"
    } finally {
        EndWait $token
        interp eval [asker] [list $future destroy]
    }
}

# What daemons have answered counts as old: await asks again.
proc ::sorma::discover::renew {wheres request} {
    variable Asked
    foreach where $wheres {
        set key [list [address $where] $request]
        if {[info exists Asked($key)]} {
            dict set Asked($key) asked 0
        }
    }
}

# When an answer came [ms]; 0: never.
proc ::sorma::discover::came {where request} {
    variable Asked
    set key [list [address $where] $request]
    return [if {[info exists Asked($key)]} {dict get $Asked($key) came} else {string cat 0}]
}

# Begin what has to be asked anew.
proc ::sorma::discover::Ask key {
    variable Asked
    variable Fresh
    variable Patience
    set now [clock milliseconds]
    if {![info exists Asked($key)]} {
        Prune
        set Asked($key) {future {} asked 0 text {} came 0 error {} code {} failed 0}
    }
    set entry $Asked($key)
    if {[dict get $entry future] ne {} || $now - [dict get $entry asked] < $Fresh} {
        return
    }
    lassign $key address request
    dict set Asked($key) asked $now
    set target [numeric $address]
    if {$target eq {}} {
        dict set Asked($key) asked 0
        return
    }
    set words [lassign $request so]
    set begin [list ::sorma::async -timeout $Patience -command [list ::sorma::discover::Answered $key] $so@$target {*}$words]
    if {[catch {interp eval [asker] $begin} future options]} {
        Failed $key $future [dict get $options -errorcode]
    } else {
        dict set Asked($key) future $future
    }
}

# Forget answers that nobody has wanted for a minute, when there are many.
proc ::sorma::discover::Prune {} {
    variable Asked
    variable Parsed
    variable Many
    if {[array size Asked] < $Many} {
        return
    }
    set old [expr {[clock milliseconds] - 60000}]
    foreach {key entry} [array get Asked] {
        if {[dict get $entry future] eq {} && [dict get $entry asked] < $old} {
            unset -nocomplain Asked($key) Parsed($key)
        }
    }
    set Many [expr {max(1000, 2 * [array size Asked])}]
}

proc ::sorma::discover::Failed {key message code} {
    variable Asked
    dict set Asked($key) future {}
    dict set Asked($key) failed [clock milliseconds]
    dict set Asked($key) error [regsub {^sorm@\S+: } $message {}]
    dict set Asked($key) code $code
}

# Peer: a request is done. Called by the event loop, or by await before that has a chance.
proc ::sorma::discover::Answered {key future} {
    variable Asked
    variable Peer
    variable Waits
    if {![info exists Asked($key)] || [dict get $Asked($key) future] ne $future} {
        return
    }
    set failed [catch {interp eval $Peer [list $future result]} reply options]
    interp eval $Peer [list $future destroy]
    if {[array size Waits] > 0} {
        after 0 ::sorma::discover::WakeAll
    }
    if {$failed} {
        Failed $key $reply [dict get $options -errorcode]
        return
    }
    dict set Asked($key) future {}
    dict set Asked($key) failed 0
    dict set Asked($key) error {}
    dict set Asked($key) text [lindex $reply 3]
    dict set Asked($key) came [expr {max([clock milliseconds], [dict get $Asked($key) came] + 1)}]
}

# ::sorma::discover::await MS WHERES REQUEST ?REQUEST ...? --
#       Ask daemons, and wait until all have answered, but no longer than MS. A daemon that has let us wait before is
#       not waited for again. In a coroutine only that is suspended; elsewhere the event loop runs meanwhile.
proc ::sorma::discover::await {ms wheres args} {
    set keys {}
    foreach where $wheres {
        foreach request $args {
            lappend keys [list [address $where] $request]
        }
    }
    awaitKeys $ms $keys
}

# ::sorma::discover::settle MS --
#       Wait for what has just been asked for the first time, in the way of await. Returns whether there was anything.
proc ::sorma::discover::settle ms {
    variable Asked
    set keys {}
    foreach {key entry} [array get Asked] {
        if {[dict get $entry future] ne {} && [dict get $entry came] == 0} {
            lappend keys $key
        }
    }
    awaitKeys $ms $keys
    return [expr {[llength $keys] > 0}]
}

proc ::sorma::discover::awaitKeys {ms keys} {
    variable Asked
    set end [expr {[clock milliseconds] + $ms}]
    set open {}
    foreach key $keys {
        if {[lindex $key 0] eq "self"} continue
        Ask $key
        set entry $Asked($key)
        if {[dict get $entry future] ne {} && [clock milliseconds] - [dict get $entry asked] < 100} {
            dict set open $key [dict get $entry future]
        }
    }
    set token [NewWait]
    try {
        while {[StillOpen open] && [Suspended $token [expr {$end - [clock milliseconds]}]]} {}
    } finally {
        EndWait $token
    }
}

# Is anything of a dict: key -> future still under way? What is done is taken out.
proc ::sorma::discover::StillOpen openVar {
    variable Asked
    upvar 1 $openVar open
    dict for {key future} $open {
        if {[dict get $Asked($key) future] ne $future} {
            dict unset open $key
        }
    }
    return [expr {[dict size $open] > 0}]
}

# ---- waiting ----
#
# Futures have a wait that blocks; it is not used here. It gives up a connection that the event loop has just begun to make
# and makes another one, and a daemon that is busy greets each client just once.

proc ::sorma::discover::NewWait {} {
    variable LastWait
    variable Waits
    set token [incr LastWait]
    set Waits($token) [info coroutine]
    return $token
}

proc ::sorma::discover::EndWait token {
    variable Waits
    unset Waits($token)
}

# Suspend the coroutine, or run the event loop, for some time, or until anything is answered. 0: the time is over.
proc ::sorma::discover::Suspended {token ms} {
    variable Waits
    if {$ms <= 0} {
        return 0
    }
    set timer [after $ms [list ::sorma::discover::Wake $token]]
    set coroutine $Waits($token)
    if {$coroutine ne {}} {
        # It may be deleted, and another one be called as it was: that must not be woken.
        set gone [list unset -nocomplain ::sorma::discover::Waits($token)]
        trace add command $coroutine delete "$gone ;#"
        set blocked [catch yield]
        trace remove command $coroutine delete "$gone ;#"
        if {$blocked} {                 ;# there is C code in between
            set coroutine {}
            set Waits($token) {}
        }
    }
    if {$coroutine eq {}} {
        vwait ::sorma::discover::Waits($token)
    }
    after cancel $timer
    return 1
}

# Let time pass.
proc ::sorma::discover::sleep ms {
    set token [NewWait]
    set end [expr {[clock milliseconds] + $ms}]
    try {
        while {[Suspended $token [expr {$end - [clock milliseconds]}]]} {}
    } finally {
        EndWait $token
    }
}

proc ::sorma::discover::Wake {token args} {
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

proc ::sorma::discover::WakeAll {} {
    variable Waits
    foreach token [array names Waits] {
        Wake $token
    }
}

# An interpreter with nothing but the bus. The module is there already, so this takes about a millisecond.
proc ::sorma::discover::newInterpreter {} {
    set interpreter [interp create]
    load [lindex [lsearch -inline -index 1 -exact [info loaded {}] Sorma] 0] Sorma $interpreter
    return $interpreter
}

# The interpreter that asks, made at first use.
proc ::sorma::discover::asker {} {
    variable Peer
    if {$Peer eq {} || ![interp exists $Peer]} {
        set Peer [newInterpreter]
        interp eval $Peer {sorma::configure -timeout 1000}
        interp alias $Peer ::sorma::discover::Answered {} ::sorma::discover::Answered
        interp alias $Peer ::sorma::discover::Wake {} ::sorma::discover::Wake
    }
    return $Peer
}

# An address that can be asked without looking up a host's name, which may take seconds. Empty: not known, or not yet.
proc ::sorma::discover::numeric address {
    if {[catch {::sorma::resolve @$address} place] || [dict get $place state] ni {known here}} {
        return {}
    }
    return [dict get $place address]
}

# Why there is no such address.
proc ::sorma::discover::whyNot address {
    return [if {[catch {::sorma::resolve @$address} place]} {set place} else {dict get $place why}]
}

# ---- answers of strangers ----

namespace eval ::sorma::discover {
    variable NamePattern {^[[:alpha:]][^\s@\[\]{}$"\\;[:cntrl:]]*$}
}

proc ::sorma::discover::ParseInventory text {
    variable Most
    variable NamePattern
    set names [lsearch -all -inline -regexp [lrange [dict get $text names] 0 $Most] $NamePattern]
    set classes {}
    foreach item [dict get $text classes] {
        lassign $item name version purpose
        if {[regexp {^[a-z]\w*$} $name]} {
            dict set classes $name [list $version $purpose]
        }
    }
    set words [lsearch -all -inline -regexp [lrange [dict get $text words] 0 $Most] {^[^\s[:cntrl:]]+$}]
    return [dict create names $names classes $classes words $words]
}

proc ::sorma::discover::ParseCensus text {
    variable Most
    variable NamePattern
    set out {}
    foreach item [lrange [dict get $text objects] 0 $Most] {
        lassign $item name class calls underway
        if {[regexp $NamePattern $name] && [regexp {^\w+$} $class]} {
            dict set out $name [list $class [expr {int($calls)}] [expr {int($underway)}]]
        }
    }
    return $out
}

proc ::sorma::discover::parseDescription text {
    foreach key {name exists class purpose version words signature example help} {
        dict set out $key [dict get $text $key]
    }
    dict set out exists [expr {[dict get $out exists] eq "1"}]
    foreach {key fields} {options 7 actions 5 inspections 5 reads 5 writes 5} {
        foreach item [dict get $text $key] {
            if {[llength $item] != $fields} {
                return -code error "$key of [llength $item] fields instead of $fields"
            }
            if {[regexp {[[:cntrl:]]} $item]} {
                return -code error "control characters in $key"
            }
        }
        dict set out $key [dict get $text $key]
    }
    dict set out fixed [lrange [dict get $text fixed] 0 end]
    if {[dict exists $text dump]} {
        dict set out dump [dict get $text dump]
    }
    return $out
}
