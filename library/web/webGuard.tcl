# webGuard.tcl -- motion that a page of sorma-web has begun ends with the page.
#
# A page has an id. It opens its stream with ?page=ID, and sends each CTRL with it. A CTRL that moves or fires something leaves a mark. When the
# stream ends, for whatever reason, the actions that stop the object (-danger stop) are sent, in the name of the login that has moved it.
#
# 1. The mark is made before the request is sent: the page may go while it is under way.
# 2. A request that was refused leaves none. One whose answer was lost may have run: its mark stays.
# 3. When another page has moved the object since, the mark is its own.
# 4. A CTRL of a page whose stream is not open is refused: nothing would end what it moves. So is one before the table is known.

package require sorma::line
package require sorma::timer
package require sorma::world
package provide sorma::webGuard 1.0

namespace eval ::sorma::webGuard {
    variable Pages {}           ;# dict: {login session id name} -> {number of its stream, command that returns a dict: word -> danger}
    variable Marks {}           ;# dict: number -> {name page stops}
    variable Last 0             ;# number that was given last
    variable Stops {}           ;# dict: number -> how often it was sent; those that have no answer yet
    variable Patience 2000      ;# ms for each question
    variable Again 1000         ;# ms until a daemon that cannot be reached is asked again
    variable Most 30            ;# how often
    variable End                ;# set when the last one of Stops is answered
}

# ::sorma::webGuard::page REQUEST NAME -- the page that a request is from; empty: none. An error when its id is none.
proc ::sorma::webGuard::page {request name} {
    if {![dict exists $request query page]} {
        return
    }
    set id [dict get $request query page]
    if {![regexp {^[0-9A-Za-z-]{1,64}$} $id]} {
        return -code error -errorcode {SORMA WEB PAGE} "page is 1 to 64 letters, digits and -; got \"[string range $id 0 100]\""
    }
    return [list [dict get $request login] [dict get $request session] $id $name]
}

# ::sorma::webGuard::opened PAGE NUMBER COMMAND -- its stream; COMMAND returns the dangers of its object.   closed PAGE NUMBER -- it has ended.
# A browser that connects again opens a new stream, perhaps before the end of the old one is known.
proc ::sorma::webGuard::opened {page number command} {
    variable Pages
    dict set Pages $page [list $number $command]
}
proc ::sorma::webGuard::closed {page number} {
    variable Pages
    variable Marks
    variable Last
    if {![dict exists $Pages $page] || [lindex [dict get $Pages $page] 0] ne $number} return
    dict unset Pages $page
    dict for {mark facts} $Marks {
        lassign $facts name its stops
        if {$its ne $page} continue
        dict unset Marks $mark
        foreach word $stops {
            Stop [incr Last] $name [lindex $page 0] $word 1
        }
    }
}

# ::sorma::webGuard::begin PAGE NAME WORDS -- a CTRL will be sent. Returns what heard takes. An error when the page is not open.
proc ::sorma::webGuard::begin {page name words} {
    variable Pages
    variable Marks
    variable Last
    if {![dict exists $Pages $page]} {
        return -code error -errorcode {SORMA WEB PAGE} "$name: the page [lindex $page 2] is not open: open its stream first, /live/object?name=$name&page=[lindex $page 2]"
    }
    set dangers [{*}[lindex [dict get $Pages $page] 1]]
    set kinds [lmap word $words {if {[dict exists $dangers $word]} {dict get $dangers $word} else continue}]
    set stops [dict keys [dict filter $dangers script {word danger} {expr {$danger eq "stop" && [string match -* $word]}}]]
    incr Last
    if {("move" in $kinds || "fire" in $kinds) && $stops ne {}} {
        dict set Marks $Last [list $name $page $stops]
    }
    return [list $Last $name $page [expr {"stop" in $kinds}]]
}

# ::sorma::webGuard::heard BEGUN STATUS VALUE -- its answer, as of sorma::world ask.
proc ::sorma::webGuard::heard {begun status value} {
    variable Marks
    lassign $begun mark name page stops
    if {$status ne "ok"} {
        if {![Lost [lindex $value 1]]} {
            dict unset Marks $mark
        }
        return
    }
    set moves [dict exists $Marks $mark]
    dict for {other facts} $Marks {
        if {[lindex $facts 0] eq $name && $other < $mark && ($stops || $moves && [lindex $facts 1] ne $page)} {
            dict unset Marks $other
        }
    }
}

# Nobody knows whether a request with this error has run.
proc ::sorma::webGuard::Lost code {
    return [expr {[string match "SORMA COMM*" $code] && ![string match "SORMA COMM DENIED*" $code]}]
}

# ::sorma::webGuard::finish -- all pages have gone: wait until what they have moved is stopped, at most Patience.
proc ::sorma::webGuard::finish {} {
    variable Pages
    variable Stops
    variable Patience
    variable End
    dict for {page facts} $Pages {
        closed $page [lindex $facts 0]
    }
    if {[dict size $Stops] > 0} {
        ::sorma::timer::once webGuard.end $Patience set ::sorma::webGuard::End late
        vwait ::sorma::webGuard::End
    }
    ::sorma::timer::cancel webGuard.*
}

proc ::sorma::webGuard::Stop {number name login word times} {
    variable Stops
    variable Patience
    dict set Stops $number $times
    lassign [::sorma::line::place $name] object daemon
    ::sorma::world ask $daemon [list $object CTRL $word] -as "web $login" -timeout $Patience -command \
        [list ::sorma::webGuard::Stopped $number $name $login $word]
}
proc ::sorma::webGuard::Stopped {number name login word status value} {
    variable Stops
    variable Again
    variable Most
    variable End
    if {$status ne "ok" && [Lost [lindex $value 1]]} {
        set times [dict get $Stops $number]
        if {$times < $Most} {
            return [::sorma::timer::once webGuard.again.$number $Again ::sorma::webGuard::Stop $number $name $login $word [incr times]]
        }
    }
    dict unset Stops $number
    if {[dict size $Stops] == 0} {
        set End done
    }
}
