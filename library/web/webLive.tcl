# webLive.tcl -- what the pages of sorma-web show, as it changes: streams of server-sent events.
#
#     GET /live/overview              daemons, and the objects of each
#     GET /live/object?name=NAME      one object: its table, its values; &page=ID: see webGuard.tcl
#     GET /live/log                   trails, as they come
#     GET /live/dashboard?name=FILE   see webDashboard.tcl
#
# A view has items: a key and its JSON; null: it has gone. Streams of one login that show the same share one view. It asks the
# daemons in the name of that login, once a second, and at once after a change. A client that is slow gets the newest of each item when it
# has taken what came before, and nothing in between.
#
# Events    items {KEY: JSON, ...}; the first has all.   tick: nothing was new for 2 s. A page that hears nothing marks its values as old.

package require sorma::json
package require sorma::text
package require sorma::timer
package require sorma::web
package require sorma::webGuard
package require sorma::webRest
package require sorma::world
package provide sorma::webLive 1.0

namespace eval ::sorma::webLive {
    variable Views {}           ;# dict: {login kind name} -> object
    variable Gather 20          ;# ms for which changes are gathered
    variable Pulse 1000         ;# ms between two questions
    variable Quiet 2000         ;# ms after which a tick is sent
    variable patience 3000      ;# ms until what was refused is asked for again
    variable Most 32            ;# streams of one login
    variable Largest 1000000    ;# characters of a table that is shown
    variable Pause 30000        ;# ms until a larger one is asked for again
}

# ::sorma::webLive::begin -- serve its routes.   kind NAME -- a view more: a class ::sorma::webLive::NAME, with a method of its own `of REQUEST`. It
# returns what is seen, and the objects that a page of it may move.
proc ::sorma::webLive::begin {} {
    foreach name {overview object log} {
        kind $name
    }
}
proc ::sorma::webLive::kind name {
    ::sorma::web::route GET ^/live/($name)\$ ::sorma::webLive::Open
}

proc ::sorma::webLive::Open {number request kind args} {
    variable Views
    variable Most
    set login [dict get $request login]
    try {
        lassign [::sorma::webLive::$kind of $request] what objects
        set pages [concat {*}[lmap object $objects {
            set page [::sorma::webGuard::page $request $object]
            if {$page eq {}} continue
            list $object $page
        }]]
    } on error {message how} {
        return [::sorma::webRest::failed $number [dict get $how -errorcode] $message]
    }
    set streams 0
    dict for {key view} $Views {
        if {[lindex $key 0] eq $login} {
            incr streams [$view streams]
        }
    }
    if {$streams >= $Most} {
        return [::sorma::web::fail $number 429 "$login has $Most streams already: close a page" {SORMA WEB LIMIT}]
    }
    set key [list $login $kind $what]
    if {![dict exists $Views $key]} {
        dict set Views $key [::sorma::webLive::$kind new $login $what]
    }
    set view [dict get $Views $key]
    ::sorma::web::stream $number $request [list ::sorma::webLive::call $view drained $number] [list ::sorma::webLive::Left $key [dict values $pages] $number]
    dict for {object page} $pages {
        ::sorma::webGuard::opened $page $number [list $view dangers $object]
    }
    $view take $number
}

proc ::sorma::webLive::Left {key pages number} {
    variable Views
    foreach page $pages {
        ::sorma::webGuard::closed $page $number
    }
    if {[dict exists $Views $key]} {
        set view [dict get $Views $key]
        $view leave $number
        if {[$view streams] == 0} {
            dict unset Views $key
            $view destroy
        }
    }
}

# ::sorma::webLive::call VIEW METHOD ?ARG ...? -- unless nobody looks any more.
proc ::sorma::webLive::call {view args} {
    if {[info object isa object $view]} {
        $view {*}$args
    }
}

# ::sorma::webLive::short TEXT -- its beginning: a daemon's text may have megabytes.   texts MEMBERS -- a dict of keys and texts as an object.
proc ::sorma::webLive::texts members {
    return [::sorma::json::object [dict map {key text} $members {::sorma::json::text [short $text]}]]
}
proc ::sorma::webLive::short text {
    set n [string length $text]
    return [if {$n <= 2000} {set text} else {string cat [string range $text 0 1999] " \u2026 ($n characters)"}]
}

# ---- all views ----

oo::class create ::sorma::webLive::view {
    variable login name
    variable items              ;# dict: key -> JSON
    variable newest             ;# number of the last change
    variable changes            ;# dict: key -> number of its last change; also of those that have gone, until all streams know it
    variable got                ;# dict: number of a stream -> number of the last change that it has got; 0: nothing yet
    variable told               ;# dict: number of a stream -> ms, when something was sent last

    constructor {who what} {
        set login $who
        set name $what
        set items [set changes [set got [set told {}]]]
        set newest 1
        my Begin
        my Pulse
    }
    destructor {
        ::sorma::timer::cancel [self].*
        my End
    }
    method Begin {} {}
    method End {} {}
    method Look {} {}

    method streams {} {
        return [dict size $got]
    }
    method take number {
        dict set got $number 0
        dict set told $number 0
        my Soon
    }
    method leave number {
        dict unset got $number
        dict unset told $number
    }
    method drained number {
        if {[dict exists $got $number] && [dict get $got $number] < $newest} {
            my Soon
        }
    }

    # An item is so from now on.
    method Put {key json} {
        if {[dict exists $items $key] && [dict get $items $key] eq $json} return
        dict set items $key $json
        dict set changes $key [incr newest]
        my Soon
    }
    method Drop key {
        if {[dict exists $items $key]} {
            my Put $key null
            dict unset items $key
        }
    }
    method Soon {} {
        ::sorma::timer::once [self].tell $::sorma::webLive::Gather [self] Tell
    }
    method Tell {} {
        set texts {}                                    ;# by last change: most streams have got the same
        set now [clock milliseconds]
        dict for {number last} $got {
            if {$last == $newest || [::sorma::web::waiting $number] > 0} continue
            if {![dict exists $texts $last]} {
                dict set texts $last [my News $last]
            }
            dict set got $number $newest
            dict set told $number $now
            if {[dict get $texts $last] ne "{}"} {
                ::sorma::web::send $number items [dict get $texts $last]
            }
        }
        my Forget
    }
    # The changes after that one. At first, nothing that has gone.
    method News last {
        set members {}
        dict for {key when} $changes {
            if {$when <= $last} continue
            if {[dict exists $items $key]} {
                lappend members $key [dict get $items $key]
            } elseif {$last > 0} {
                lappend members $key null
            }
        }
        return [::sorma::json::object $members]
    }
    method Forget {} {
        if {[dict size $changes] == [dict size $items]} return
        set least [::tcl::mathfunc::min $newest {*}[dict values $got]]
        foreach key [dict keys $changes] {
            if {![dict exists $items $key] && [dict get $changes $key] <= $least} {
                dict unset changes $key
            }
        }
    }
    method Pulse {} {
        ::sorma::timer::once [self].pulse $::sorma::webLive::Pulse [self] Pulse
        my Look
        set now [clock milliseconds]
        dict for {number ms} $told {
            if {$now - $ms >= $::sorma::webLive::Quiet && [::sorma::web::waiting $number] == 0} {
                dict set told $number $now
                ::sorma::web::send $number tick {{}}
            }
        }
    }
    method Ask {daemon request method args} {
        ::sorma::world ask $daemon $request -as "web $login" -command [list ::sorma::webLive::call [self] $method {*}$args]
    }
    export Tell Pulse
}

# ---- one object ----

# An object as one login may see it. It is asked for at each `look`, and at once after a change. PREFIX is called with STATE WHY TABLE. STATE is live,
# gone, stale, refused or denied; only for live and gone is there a table, as DBX -describe gives it.
oo::class create ::sorma::webLive::watch {
    variable login name prefix object daemon token asking since again refused

    constructor {who what then} {
        set login $who
        set name $what
        set prefix $then
        lassign [::sorma::webRest::place $name] object daemon
        set asking [set again [set refused 0]]
        set since [clock milliseconds]
        set token [::sorma::world watch [::sorma::text::escape $name] -events {object.*} -command [list ::sorma::webLive::call [self] Changed]]
    }
    destructor {
        ::sorma::timer::cancel [self].*
        ::sorma::world unwatch $token
    }
    method Changed args {
        ::sorma::timer::once [self].look $::sorma::webLive::Gather [self] look
    }
    # A change while a question is under way is asked for again.
    method look {} {
        if {$refused && [clock milliseconds] - $since < $::sorma::webLive::patience} return
        if {$asking} {
            set again 1
            if {[clock milliseconds] - $since > 2000} {
                my Tell stale [my Why] {}
            }
            return
        }
        set asking 1
        set again 0
        set since [clock milliseconds]
        ::sorma::world ask $daemon [list sorm DBX -describe $object] -as "web $login" -command [list ::sorma::webLive::call [self] Answered]
    }
    method Why {} {
        set facts [::sorma::world get $daemon]
        if {$facts eq {}} {
            return "daemon $daemon is gone"
        }
        return [if {[dict get $facts why] ne {}} {dict get $facts why} else {string cat "daemon $daemon is [dict get $facts state]"}]
    }
    method Tell {state why table} {
        {*}$prefix $state $why $table
    }
    method Answered {status value} {
        set asking 0
        set refused [expr {$status ne "ok"}]
        if {$refused} {
            lassign $value message code
            return [my Tell [expr {[string match "SORMA COMM DENIED*" $code] ? "denied" : [string match "SORMA COMM*" $code] ? "stale" : "refused"}] $message {}]
        }
        set table [dict get $value text]
        set size [string length $table]
        if {$size > $::sorma::webLive::Largest} {
            set refused 1
            set since [expr {[clock milliseconds] + $::sorma::webLive::Pause - $::sorma::webLive::patience}]
            return [my Tell refused "its table has $size characters; a page shows at most $::sorma::webLive::Largest" {}]
        }
        if {[dict get $table exists]} {
            my Tell live {} $table
        } else {
            my Tell gone "there is no such object; the first EXEC or CTRL makes it" $table
        }
        if {$again} {
            my Changed
        }
    }
    export Changed Answered
}

oo::class create ::sorma::webLive::object {
    superclass ::sorma::webLive::view
    variable login name items
    variable watch help
    variable dangers            ;# dict: word -> danger

    self method of request {
        set name [if {[dict exists $request query name]} {dict get $request query name}]
        ::sorma::webRest::place $name
        return [list $name [list $name]]
    }
    method Begin {} {
        set help [set dangers {}]
        set watch [::sorma::webLive::watch new $login $name [list ::sorma::webLive::call [self] Seen]]
    }
    method End {} {
        $watch destroy
    }
    method Look {} {
        $watch look
    }
    # An error while the table is not known, or may not be known.
    method dangers object {
        if {![dict exists $items about]} {
            return -code error -errorcode [list SORMA WEB PAGE $name] "$name: its table is not known yet: wait until the stream has the item \"about\""
        }
        return $dangers
    }
    method Seen {state why table} {
        my Put state [::sorma::webLive::texts [list state [expr {$state eq "denied" ? "refused" : $state}] why $why]]
        # Without the right nothing is shown any more.
        if {$state eq "denied"} {
            foreach key [lsearch -all -inline -not -exact [dict keys $items] state] {
                my Drop $key
            }
        }
        if {$table eq {}} return
        set dangers [dict get $table danger]
        if {[dict get $table help] ne $help || ![dict exists $items about]} {           ;# the help names all options, with their defaults
            set help [dict get $table help]
            my Put about [::sorma::webRest::tableOf $name [dict replace $table exists 0]]
        }
        if {$state eq "live"} {
            foreach option [dict get $table options] {
                my Put [lindex $option 0] [::sorma::json::typed [lindex $option 1] [lindex $option 5]]
            }
        }
    }
    export Seen
}

# ---- all daemons ----

oo::class create ::sorma::webLive::overview {
    superclass ::sorma::webLive::view
    variable login name items
    variable asking before

    self method of request {
        return {{} {}}
    }
    method Begin {} {
        set asking [set before {}]
    }
    method Look {} {
        set there {}
        foreach key [::sorma::world keys] {
            if {$key eq "self"} continue
            set facts [::sorma::world get $key]
            dict set there $key 1
            my Put "daemon $key" [::sorma::webLive::texts [dict filter $facts script {k v} {expr {$k in {name state why}}}]]
            if {[dict get $facts state] in {alive busy} && ![dict exists $asking $key]} {
                dict set asking $key 1
                my Ask $key {sorm DBX -inventory objects} Answered $key
            }
        }
        foreach item [dict keys $items] {
            if {![dict exists $there [lindex [split $item] 1]]} {
                my Drop $item
                dict unset before [lindex [split $item] 1]
            }
        }
    }
    method Answered {key status value} {
        dict unset asking $key
        if {$status ne "ok"} {
            return [my Put "objects $key" [::sorma::webLive::texts [list error [lindex $value 0]]]]
        }
        if {[catch {dict get [dict get $value text] objects} rows]} return
        set now [clock milliseconds]
        set after {}
        set list [lmap row [lsort -index 0 [lrange $rows 0 999]] {
            lassign $row object class calls underway
            set rate 0
            if {[dict exists $before $key $object]} {
                lassign [dict get $before $key $object] old then
                set rate [expr {$calls >= $old && $now > $then ? round(1000.0 * ($calls - $old) / ($now - $then)) : 0}]
            }
            dict set after $object [list $calls $now]
            ::sorma::json::object [list name [::sorma::json::text $object] class [::sorma::json::text $class] calls [::sorma::json::number $calls] rate $rate \
                underway [::sorma::json::number $underway]]
        }]
        dict set before $key $after
        my Put "objects $key" [::sorma::json::object [list objects [::sorma::json::array $list]]]
    }
    export Look Answered
}

# ---- trails ----

# Each daemon sends this login what it may see, and nothing else.
oo::class create ::sorma::webLive::log {
    superclass ::sorma::webLive::view
    variable login name items
    variable listens last           ;# listens: dict: daemon -> token

    self method of request {
        return {{} {}}
    }
    method Begin {} {
        set listens {}
        set last 0
    }
    method End {} {
        foreach token [dict values $listens] {
            ::sorma::world unwatch $token
        }
    }
    method Look {} {
        foreach key [::sorma::world keys] {
            if {$key ne "self" && ![dict exists $listens $key]} {
                dict set listens $key [::sorma::world listen sorm@$key -event trail.* -queue 200 -as "web $login" -command [list ::sorma::webLive::call [self] Heard $key]]
            }
        }
        foreach key [dict keys $listens] {
            if {[::sorma::world get $key] eq {}} {
                ::sorma::world unwatch [dict get $listens $key]
                dict unset listens $key
            }
        }
    }
    method Heard {key event} {
        set severity [string range [dict get $event event] 6 end]
        if {![string match trail.* [dict get $event event]] || [dict get $event text] eq {}} return
        set so [lindex [dict get $event words] 0]
        my Put [incr last] [::sorma::webLive::texts [list name [expr {$so eq {} ? "sorm@$key" : "$so@$key"}] severity $severity text [dict get $event text] \
            time [dict get $event time]]]
        my Drop [expr {$last - 200}]
    }
    export Look Heard
}
