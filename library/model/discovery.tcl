# discovery.tcl -- where daemons may be, for sorma::world: the runtime folder, the dictionary, addresses of proxies, what programs have
# added, and what daemons of other hosts say. It makes no connection.
#
# Other hosts: one hop, and no broadcast. Nobody is called who has not been named. A daemon that is reached by TCP names those beside
# it (lead), and the rpcbind of its host is asked once (host).
#
# WHERE is what stands after @.

package require sorma
package require sorma::timer
package provide sorma::discovery 1.0

namespace eval ::sorma::discovery {
    variable Patience 60000     ;# ms for which a place is known where somebody has looked in passing
    # The data stays when this file is sourced again.
    variable Held               ;# dict: token of an add or a hold that has not been taken back -> WHERE
    variable Passing            ;# dict: WHERE -> ms, when somebody last looked there
    variable Led                ;# dict: who says so -> {how wheres names}
    variable Twins              ;# dict: WHERE -> boot of a daemon that is known by another address
    variable Hosts              ;# dict: host -> 1: its rpcbind has been asked
    variable Moved              ;# ms, when a socket was last added or removed
    variable Changed            ;# command prefix: there may be others; empty: nobody wants to know
    variable Last
    if {![info exists Last]} {
        foreach name {Held Passing Led Twins Hosts Changed} {
            set $name {}
        }
        set Moved [set Last 0]
    }
}

# ::sorma::discovery::begin PREFIX -- call it whenever there may be other places. end -- stop that, and keep only held places.
proc ::sorma::discovery::begin prefix {
    set ::sorma::discovery::Changed $prefix
}
proc ::sorma::discovery::end {} {
    catch {::sorma::peer names -command {}}
    ::sorma::timer::cancel discovery.*
    foreach name {Led Twins Hosts Changed} {
        set ::sorma::discovery::$name {}
    }
}

# ::sorma::discovery::changed -- there may be other places: say so when the present events were handled.
proc ::sorma::discovery::changed {} {
    variable Changed
    if {$Changed ne {}} {
        ::sorma::timer::once discovery.changed 0 {*}$Changed
    }
}

# ::sorma::discovery::unseen -- has something changed that nobody has been told yet?
proc ::sorma::discovery::unseen {} {
    return [::sorma::timer::waits discovery.changed]
}

# ::sorma::discovery::places -- a dict: WHERE -> what sorma::resolve says of it, and how it came to be known. One address, one place.
proc ::sorma::discovery::places {} {
    variable Held
    variable Passing
    variable Patience
    variable Led
    variable Twins
    set how [Ways]
    set old [expr {[clock milliseconds] - $Patience}]
    set Passing [dict filter $Passing script {where ms} {expr {$ms > $old}}]
    foreach where [concat [dict values $Held] [dict keys $Passing]] {
        if {![dict exists $how $where]} {
            dict set how $where added
        }
    }
    set names {}
    foreach found [dict values $Led] {
        lassign $found reason wheres called
        set names [dict merge $called $names]
        foreach where $wheres {
            if {![dict exists $how $where] && ![dict exists $Twins $where]} {
                dict set how $where $reason
            }
        }
    }
    set places [set seen {}]
    dict for {where reason} $how {
        if {[catch {::sorma::resolve @$where} place] || [dict get $place state] eq "here" || [dict exists $seen [dict get $place address]]} continue
        dict set seen [dict get $place address] 1
        # The name that a peer gives is only shown. It never means a place.
        set called [if {$reason eq "sibling" && [dict exists $names $where]} {dict get $names $where}]
        dict set places $where [dict replace $place how $reason called $called]
    }
    return $places
}

# ::sorma::discovery::names -- what can stand after @, sorted, as far as somebody here has said it.
proc ::sorma::discovery::names {} {
    variable Held
    return [lsort -unique [lsearch -all -inline -regexp [concat [dict keys [Ways]] [dict values $Held]] {^[^\s@\[\]{}$"\\;[:cntrl:]]+$}]]
}

# ::sorma::discovery::moved -- ms, when a socket was last added or removed: a daemon that could not be reached before may be there now.
proc ::sorma::discovery::moved {} {
    return $::sorma::discovery::Moved
}

# ::sorma::discovery::hold WHERE ?KIND? -- know this place until release of the token. added WHERE -- such a token, of KIND add.
proc ::sorma::discovery::hold {where {kind hold}} {
    variable Held
    variable Last
    ::sorma::resolve @$where
    set token $kind[incr Last]
    dict set Held $token $where
    changed
    return $token
}
proc ::sorma::discovery::release token {
    variable Held
    dict unset Held $token
    changed
}
proc ::sorma::discovery::added where {
    variable Held
    return [lindex [dict filter $Held script {token held} {expr {$held eq $where && [string match add* $token]}}] end-1]
}

# ::sorma::discovery::held -- does anybody hold a place? leads WHERE -- do the runtime folder or the dictionary lead there?
proc ::sorma::discovery::held {} {
    return [expr {[dict size $::sorma::discovery::Held] > 0}]
}
proc ::sorma::discovery::leads where {
    set how [Ways]
    return [expr {[dict exists $how $where] && [dict get $how $where] ne "proxy"}]
}

# ::sorma::discovery::pass WHERE ?ONLY? -- somebody looks there now: the place is known for a while. ONLY 1: if it was so before.
proc ::sorma::discovery::pass {where {only 0}} {
    variable Passing
    if {!$only || [dict exists $Passing $where]} {
        dict set Passing $where [clock milliseconds]
    }
}

# ::sorma::discovery::lead WHO HOW WHERES ?NAMES? -- as long as WHO says so, there are daemons at these. NAMES: dict, WHERE -> what it is
# called there.
proc ::sorma::discovery::lead {who how wheres {names {}}} {
    variable Led
    if {[llength $wheres] > 0} {
        dict set Led $who [list $how $wheres $names]
    } elseif {[dict exists $Led $who]} {
        dict unset Led $who
    } else {
        return
    }
    changed
}

# ::sorma::discovery::host HOST -- a daemon there was reached: ask its rpcbind for others, once.
proc ::sorma::discovery::host host {
    variable Hosts
    if {![dict exists $Hosts $host]} {
        dict set Hosts $host 1
        catch {::sorma::peer programs $host -command [list ::sorma::discovery::Programs $host]}
    }
}
proc ::sorma::discovery::Programs {host programs} {
    lead rpcbind@$host rpcbind [lmap program $programs {string cat $host : $program}]
}

# ::sorma::discovery::twin WHERE BOOT -- that daemon is known by another address. untwin BOOT -- forget that.
proc ::sorma::discovery::twin {where boot} {
    dict set ::sorma::discovery::Twins $where $boot
}
proc ::sorma::discovery::untwin boot {
    variable Twins
    set Twins [dict filter $Twins script {where twin} {expr {$twin ne $boot}}]
}

# ::sorma::discovery::here WHAT -- an inventory of this process.
proc ::sorma::discovery::here what {
    return [dict get [lindex [::sorma::KeepTrail [list ::sorma::so::sorm DBX -inventory $what]] 3] $what]
}

# Places that nobody has to hold or name, a dict: WHERE -> folder, dictionary, directory or proxy.
proc ::sorma::discovery::Ways {} {
    set how {}
    catch {                             ;# a folder that others may write to is as good as none
        foreach name [::sorma::peer names -command ::sorma::discovery::FolderChanged] {
            dict set how $name folder
        }
    }
    foreach item [here addresses] {
        lassign $item word address
        set where [if {[string match @* $word]} {string range $word 1 end} else {string trimleft $address @}]
        if {![dict exists $how $where]} {
            dict set how $where dictionary
        }
    }
    foreach name [here directory] {
        if {![dict exists $how $name]} {
            dict set how $name directory
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

proc ::sorma::discovery::FolderChanged {} {
    set ::sorma::discovery::Moved [clock milliseconds]
    changed
}
