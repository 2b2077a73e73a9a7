# hops.tcl -- services for traces: each does what its text says. They write a journal, which judges the trace.
#
# hops::script              a file for sormad -script: class hop
# hops::begin DAEMONS       from now on each daemon listens to hop.top of all daemons, and they write a journal
# hops::random              the text of a random tree
# hops::judge TREE ?times?  what is wrong with the tree of a trace, a list of sentences. The journal begins anew.
#                           times: also compare times with it
# hops::end
#
# A text is a list of: work MS {} | call OBJECT TEXT | ask OBJECT TEXT (the daemon works meanwhile) | begin OBJECT TEXT (awaited at the end) | leave OBJECT TEXT (not awaited) |
# oneway OBJECT TEXT | publish EVENT TEXT (subscribers do that) | listen OBJECT {} | deaf {} {} | tag WORD {} (for the journal) | fail.

namespace eval hops {
    variable Daemons {}
    variable Journal {}     ;# file
    variable Tags 0
}

proc hops::script {} {
    return [makeFile {
        # Do it; journal: what it was, when it began and ended, and from when to when it has called others [us].
        proc hops {my text kind} {
            set tag {}
            set from [clock microseconds]
            set futures {}
            set calls {}
            set begun {}
            try {
                foreach {what first second} $text {
                    set now [clock microseconds]
                    switch -- $what {
                        tag { set tag $first }
                        work { after $first }
                        call { $first EXEC TMSG $second; lappend calls $now [clock microseconds] }
                        ask { [sorma::async $first EXEC TMSG $second] take; lappend calls $now [clock microseconds] }
                        begin { lappend futures [sorma::async $first EXEC TMSG $second]; lappend begun $now }
                        leave { sorma::async $first EXEC TMSG $second }
                        oneway { sorma::async -oneway $first EXEC TMSG $second; lappend calls $now [clock microseconds] }
                        publish { $my publish $first -text $second; lappend calls $now [clock microseconds] }
                        listen { lappend ::ears [sorma::subscribe $first -event {t*} -command heard] }
                        deaf { foreach s $::ears {sorma::unsubscribe $s}; set ::ears {} }
                        many { for {set i 0} {$i < $first} {incr i} { echo EXEC } }
                        parent { return [dict create text [sorma::trace]] }
                        journal { set ::journal $first }
                        fail { error "broken on purpose" }
                    }
                }
                foreach f $futures since $begun { $f take; lappend calls $since [clock microseconds] }
                return {}
            } finally {
                if {$tag ne {} && $::journal ne {}} {
                    set f [open $::journal a]
                    puts $f [list $kind $tag $from [clock microseconds] $calls]
                    close $f
                }
            }
        }
        proc heard event { hops {} [dict get $event text] listener }
        set ears {}
        set journal {}
        oo::class create ::hop {
            superclass sorma::Service
            method exec message { hops [namespace current]::my [dict get $message text] run }
        }
    } hop.tcl]
}

proc hops::begin daemons {
    variable Daemons $daemons
    variable Journal [makeFile {} hops.journal]
    foreach d $daemons {
        hop.ear@$d EXEC TMSG [list journal $Journal {}]
        foreach other $daemons {
            hop.ear@$d EXEC TMSG [list listen hop.board[expr {$other eq $d ? {} : "@$other"}] {}]
        }
    }
}

proc hops::end {} {
    variable Daemons
    foreach d $Daemons { hop.ear@$d EXEC TMSG {journal {} {} deaf {} {}} }
    set Daemons {}
}

# A random tree. Each piece of work has a tag, and stands in an object of that name: t5 in hop.t5. A daemon that blocks only calls
# daemons behind it, so that they never wait for each other.
proc hops::random {{depth 0} {here 0}} {
    variable Daemons
    variable Tags
    if {$depth == 0} { set Tags 0 }
    set text [list tag [expr {$depth == 0 ? "top" : "t$Tags"}] {}]
    set n [expr {$depth >= 4 ? 0 : int(rand() * (4 - ($depth > 1)))}]
    for {set i 0} {$i < $n} {incr i} {
        if {rand() < 0.3} { lappend text work 1 {} }
        set there [expr {int(rand() * [llength $Daemons])}]
        set where [lindex $Daemons $there]
        set tag t[incr Tags]
        set below [random [expr {$depth + 1}] $there]
        set ask [expr {$there > $here ? "call" : "ask"}]
        set dice [expr {rand()}]
        # Only a board has listeners, in each daemon: what it publishes is done once by each of them.
        if {$dice < 0.1 && $depth < 3} {
            set board t[incr Tags]
            lappend text $ask hop.board@$where [list tag board$board {} publish $tag [list tag $tag {} work 1 {}]]
        } else {
            lappend text [expr {$dice < 0.5 ? $ask : $dice < 0.8 ? {begin} : {oneway}}] hop.$tag@$where $below
        }
    }
    return $text
}

# ---- the judge ----

# The pieces of work of a tree, {tag kind of each, with the tag of the one below whose work it stands}: from the spans.
proc hops::Works {span above worksVar} {
    upvar 1 $worksVar works
    set name [lindex [split [dict get $span name] @] 0]
    set kind [dict get $span kind]
    set own $above
    if {$kind eq "listener" || ($kind eq "call" && [string match hop.* $name])} {
        set own [expr {$kind eq "listener" ? [dict get $span event] : [string range $name 4 end]}]
        lappend works [list $own $above $span]
    }
    foreach c [dict get $span calls] { Works $c $own works }
}

# The same from the text of a tree, as the services were told.
proc hops::judge {tree {times 0}} {
    variable Journal
    set f [open $Journal]
    set lines [lsearch -all -inline -not -exact [split [read $f] \n] {}]
    close $f
    close [open $Journal w]
    set wrong {}
    Works $tree {} works
    foreach w $works {
        lassign $w tag above span
        lappend told($tag) $span
        if {[dict get $span state] ne "done"} { lappend wrong "$tag is [dict get $span state]" }
    }
    foreach line $lines {
        lassign $line kind tag from to calls
        regsub {^boardt\d+$} $tag board tag
        lappend done($tag) $line
    }
    foreach tag [lsort -unique [concat [array names told] [array names done]]] {
        set in [expr {[info exists told($tag)] ? [llength $told($tag)] : 0}]
        set was [expr {[info exists done($tag)] ? [llength $done($tag)] : 0}]
        if {$in != $was} { lappend wrong "$tag was done $was times and is there $in times" }
        if {$times && $in == 1 && $was == 1} { lappend wrong {*}[Compare $tag [lindex $told($tag) 0] [lindex $done($tag) 0] [dict get $tree whole]] }
    }
    lappend wrong {*}[AddUp $tree [dict get $tree whole]]
    return $wrong
}

# [us] that intervals cover together: {from to} ...
proc hops::Cover {intervals low high} {
    set sum 0
    set seen $low
    foreach i [lsort -real -index 0 $intervals] {
        lassign $i from to
        set from [expr {max($from, $seen)}]
        set to [expr {min($to, $high)}]
        if {$to > $from} {
            set sum [expr {$sum + $to - $from}]
            set seen $to
        }
    }
    return $sum
}

# Each span's own time, and what its calls cover of it, are its length, within 2 % of the whole; so along the longest path they are the
# whole. Nobody waits for what a one-way request or an event has caused: that has a length of its own.
proc hops::AddUp {span whole} {
    set wrong {}
    set parts [lmap c [dict get $span calls] {list [dict get $c offset] [expr {[dict get $c offset] + [dict get $c whole]}]}]
    set late [expr {[dict get $span kind] in {oneway event}}]
    if {!$late} {
        set sum [expr {[dict get $span waiting] + [dict get $span running] + [dict get $span wire] + [Cover $parts 0 [dict get $span whole]]}]
        if {abs($sum - [dict get $span whole]) > 0.02 * $whole} { lappend wrong "[dict get $span name]: $sum of [dict get $span whole] us" }
    }
    foreach c [dict get $span calls] {
        lappend wrong {*}[AddUp $c [expr {$late ? max([dict get $c whole], 1000) : $whole}]]
    }
    return $wrong
}

# The time of a piece of work, and its own time without calls, by its journal and by its span. They may differ by 2 % of the whole,
# and by the time to open a file.
proc hops::Compare {tag span line whole} {
    lassign $line kind - from to calls
    set wrong {}
    set most [expr {0.02 * $whole + 1500}]
    set mine [expr {[dict get $span whole] - [dict get $span waiting] - [dict get $span wire]}]
    if {abs($mine - ($to - $from)) > $most} { lappend wrong "$tag took [expr {$to - $from}] us and is there with $mine us" }
    set parts {}
    foreach {a b} $calls { lappend parts [list $a $b] }
    set own [expr {$to - $from - [Cover $parts $from $to]}]
    if {abs([dict get $span running] - $own) > $most} { lappend wrong "$tag ran $own us and is there with [dict get $span running] us" }
    return $wrong
}
