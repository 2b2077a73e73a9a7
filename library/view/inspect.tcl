# inspect.tcl -- look around in a system of service objects: what there is, what it does, what it is for.
#
# Each command returns text for people, or with -data lists and dicts for programs. They ask all daemons at once and come
# back within half a second or so; daemons that do not answer have a line of their own. Nothing is made by looking.

package require sorma::complete
package require sorma::show
package provide sorma::inspect 1.0
namespace eval ::sorma::inspect {
    namespace export ls tree daemons help dump watch unwatch top find monitor rate doctor
    namespace ensemble create

    variable Wait 400           ;# ms for daemons to answer
    variable MostRows 200       ;# of one table
    variable Watches            ;# dict: id -> {name service where every command event known error timer future subscription}
    variable LastWatch
    variable Sampler            ;# of top, empty before it is needed
    if {![info exists Watches]} {
        set Watches {}
        set LastWatch 0
        set Sampler {}
    }
    variable Topics {
        ls {objects here and at each daemon: a pattern chooses names, @daemon one place, @ here}
        tree {objects with the sub-services that they use}
        daemons {the daemons that can be reached, and how they are}
        help {what an object, a class or a command is for, and its words}
        dump {state of an object, as CTRL would read it again}
        watch {tells what changes in an object, and what it publishes}
        unwatch {ends a watch, or all}
        top {the busiest objects: requests per second and their times}
        find {a word in names, purposes, options and help, of all that there is}
        monitor {shows requests, replies and events of a daemon as they pass, until unwatch}
        rate {how often an object publishes: mean, shortest, longest time between two events, jitter}
        doctor {what is wrong on this machine, and how to mend it}
    }
}

# ---- lists ----

# ::sorma::inspect::ls ?pattern? ?@daemon? ?-data? --
#       Objects: here and at each daemon; at one with @daemon, which may be a pattern; here only with @. pattern@daemon is both.
# Results:
#       With -data a list of dicts: where (empty: here), name, class, calls, underway; or where and error.
proc ::sorma::inspect::ls args {
    lassign [Parse $args {pattern *} 1] pattern wheres data
    set items {}
    foreach {where census error} [Censuses $wheres] {
        if {$error ne {}} {
            lappend items [dict create where $where error $error]
            continue
        }
        foreach name [lsort [dict keys $census $pattern]] {
            lassign [dict get $census $name] class calls underway
            lappend items [dict create where $where name $name class $class calls $calls underway $underway]
        }
    }
    if {$data} {
        return $items
    }
    set out [Sections $items {object class calls} {2} {item {
        list [dict get $item name] [dict get $item class] [dict get $item calls]
    }}]
    if {[llength $out] == 0} {
        return "no object is called [::sorma::text::clean $pattern]"
    }
    return [join $out \n]
}

# ::sorma::inspect::tree ?pattern? ?@daemon? ?-data? --
#       Objects with the sub-services that their options name.
# Results:
#       With -data a list of dicts: where, name, class and uses (dict: option -> name of an object); or where and error.
proc ::sorma::inspect::tree args {
    variable Wait
    lassign [Parse $args {pattern *} 1] pattern wheres data
    set items {}
    foreach {where census error} [Censuses $wheres] {
        if {$error ne {}} {
            lappend items [dict create where $where error $error]
            continue
        }
        # Most classes use no others: only objects of those that do are asked for.
        set classes [lsort -unique [lmap facts [dict values $census] {lindex $facts 0}]]
        set using [lmap class $classes {
            if {$class eq "proxy"} continue
            set class
        }]
        set using [lmap class $using table [Tables $where $using] {
            if {$table eq {} || [lsearch -index 1 [dict get $table options] service] < 0} continue
            set class
        }]
        set names [lsort [dict keys $census]]
        set asking [lmap name $names {if {[lindex [dict get $census $name] 0] ni $using} continue; set name}]
        set uses {}
        foreach name $asking table [Tables $where $asking] {
            set found {}
            if {$table ne {} && [dict get $table exists]} {
                foreach option [lsearch -all -inline -index 1 [dict get $table options] service] {
                    if {[lindex $option 5] ne {}} {
                        dict set found [lindex $option 0] [lindex $option 5]
                    }
                }
            }
            dict set uses $name $found
        }
        foreach name $names {
            set mine {}
            if {[dict exists $uses $name]} {
                set mine [dict get $uses $name]
            }
            lappend items [dict create where $where name $name class [lindex [dict get $census $name] 0] uses $mine]
        }
    }
    if {$data} {
        return [lmap item $items {if {[dict exists $item name] && ![string match $pattern [dict get $item name]]} continue; set item}]
    }
    set out {}
    foreach {where group} [ByPlace $items] {
        lappend out [Heading $where]
        set used {}
        set byName {}
        foreach item $group {
            if {[dict exists $item error]} {
                lappend out [Trouble [dict get $item error]]
                continue
            }
            dict set byName [dict get $item name] $item
            foreach name [dict values [dict get $item uses]] {
                dict set used $name 1
            }
        }
        set rows 0
        foreach name [dict keys $byName] {
            if {$pattern eq "*" ? ![dict exists $used $name] : [string match $pattern $name]} {
                if {[incr rows] > $::sorma::inspect::MostRows} {
                    lappend out "  ... and more; give a pattern"
                    break
                }
                lappend out {*}[Branch $byName $name {} 1 {}]
            }
        }
    }
    return [join $out \n]
}

proc ::sorma::inspect::Branch {byName name option depth above} {
    set label [if {$option ne {}} {string cat "[string range $option 1 end]: "}]
    set class [if {[dict exists $byName $name]} {dict get $byName $name class}]
    set line [string repeat "  " $depth]$label$name[if {$class ne {} && ![string match $class* $name]} {string cat "  ($class)"}]
    set out [list [::sorma::text::cut [::sorma::text::clean $line] [Width]]]
    if {$name in $above} {
        return [list "[lindex $out 0] ..."]
    }
    if {[dict exists $byName $name]} {
        dict for {option used} [dict get $byName $name uses] {
            lappend out {*}[Branch $byName $used $option [expr {$depth + 1}] [concat $above [list $name]]]
        }
    }
    return $out
}

# ::sorma::inspect::daemons ?-data? --
#       Daemons that can be reached by a name alone, and how they are.
# Results:
#       With -data a list of dicts: name, address, state (self, alive, busy, no answer, dead, refused, failed), error, objects.
proc ::sorma::inspect::daemons args {
    variable Wait
    lassign [Parse $args {}] - data
    ::sorma::discover::lookAgain
    set found [::sorma::discover::daemons $Wait]
    ::sorma::discover::consult [lmap daemon $found {dict get $daemon name}]
    set items [lmap daemon $found {
        set trouble [::sorma::discover::trouble [dict get $daemon name]]
        switch -glob -- "[dict get $daemon state] $trouble" {
            "asking busy*" - "away busy*" { dict set daemon state busy }
            asking* - away* { dict set daemon state "no answer" }
            "refused dead*" { dict set daemon state dead }
        }
        dict set daemon error $trouble
    }]
    if {$data} {
        return $items
    }
    if {[llength $items] == 0} {
        return "no daemons: none listens in the runtime folder, and the dictionary has no address"
    }
    set rows [lmap item $items {
        list [dict get $item name] [dict get $item state] [dict get $item objects] [dict get $item address]
    }]
    set out [list [Table {daemon state objects address} $rows {2}]]
    foreach item $items {
        if {[dict get $item error] ne {}} {
            lappend out [Trouble "[dict get $item name]: [dict get $item error]"]
        }
    }
    return [join $out \n]
}

# ---- one object ----

# ::sorma::inspect::help ?name? ?-data? --
#       The text of CTRL -help of an object or class, which is not made for it; or what a command is for. Without a name
#       what commands there are.
# Results:
#       With -data the class's table, as sorma::discover::describe gives it.
proc ::sorma::inspect::help args {
    variable Topics
    lassign [Parse $args {name {}}] name wheres data
    if {$name eq {}} {
        set rows [lmap {command purpose} $Topics {list [::sorma::complete::usage sorma::inspect::$command] $purpose}]
        set rows [lmap row $rows {lreplace $row 0 0 [string map {sorma::inspect:: {}} [lindex $row 0]]}]
        lappend rows [list "NAME CTRL -help" "what an object can do; help NAME makes none, and takes a class, or NAME@DAEMON, too"]
        return [Table {} $rows {} 1]
    }
    set command [string trimleft $name :]
    if {!$data && ![::sorma::complete::isName $command]} {
        foreach known [list sorma::inspect::$command $name] {
            try {
                return [::sorma::manual $known -width [Width]]
            } trap {SORMA MANUAL UNKNOWN} {} {
                # then it must be an object or a class
            }
        }
    }
    set table [Describe $name]
    if {$data} {
        return $table
    }
    return [::sorma::text::paragraphs [dict get $table help] [Style]]
}

# ::sorma::inspect::dump NAME ?-data? --
#       State of an object that is there: its options, as CTRL would read them again, and what its class adds.
# Results:
#       With -data a dict: option -> value.
proc ::sorma::inspect::dump args {
    lassign [Parse $args {name {}}] name wheres data
    set table [Describe $name]
    if {![dict get $table exists]} {
        return -code error -errorcode [list SORMA SERVICE GONE $name] \
            "$name: there is no such object; help $name shows what its class has"
    }
    if {$data} {
        set values {}
        foreach option [dict get $table options] {
            dict set values [lindex $option 0] [lindex $option 5]
        }
        return $values
    }
    return [::sorma::text::paragraphs [dict get $table dump] [Style]]
}

# Table of an object's class, as it is now. Fails as a request to the object would.
proc ::sorma::inspect::Describe name {
    if {$name eq {}} {
        return -code error -errorcode {SORMA REQUEST SYNTAX} "a name is missing"
    }
    ::sorma::discover::lookAgain
    lassign [::sorma::discover::locate $name] service where
    if {$where eq {}} {
        return [::sorma::discover::localText [list sorm DBX -describe $service]]
    }
    set text [::sorma::discover::fetch $where [list sorm DBX -describe $service] 2000]
    if {[catch {::sorma::discover::parseDescription $text} table]} {
        return -code error -errorcode [list SORMA COMM PROTOCOL $name] "$name: the daemon's answer makes no sense: $table"
    }
    return $table
}

# ::sorma::inspect::watch NAME ?-event pattern? ?-every ms? ?-command prefix? --
#       Tell what changes in an object, by looking at it from time to time, and what it publishes. Without a name: the
#       watches that there are, a list of {id name}.
# Arguments:
#       pattern tell only of events whose name fits, and nothing of changes
#       every   ms between two looks, default 1000
#       prefix  is called with a dict: name, time [ms], and changes (list of {what old new}), or event (a dict as for
#               sorma::subscribe), or error (the object cannot be seen; told once). Default: a line on standard output
# Results:
#       Its id, for unwatch. An object that is not there is waited for.
proc ::sorma::inspect::watch args {
    variable Watches
    variable LastWatch
    if {[llength $args] == 0} {
        return [lmap {id watch} $Watches {list $id [dict get $watch name]}]
    }
    set options [lassign $args name]
    set settings {-every 1000 -event {} -command ::sorma::inspect::PrintWatch}
    foreach {option value} $options {
        if {![dict exists $settings $option] || [llength $options] % 2 == 1} {
            return -code error -errorcode {SORMA REQUEST SYNTAX} "wrong # args: should be \"watch ?name? ?-event pattern? ?-every ms? ?-command prefix?\""
        }
        dict set settings $option $value
    }
    set every [dict get $settings -every]
    if {![string is integer -strict $every] || $every < 1} {
        return -code error -errorcode {SORMA REQUEST SYNTAX} "-every expects a number of ms, got \"$every\""
    }
    ::sorma::discover::lookAgain
    lassign [::sorma::discover::locate $name] service where
    set id watch[incr LastWatch]
    dict set Watches $id [dict create name $name service $service where $where every $every \
        command [dict get $settings -command] event [dict get $settings -event] known {} error {} timer {} future {} subscription {}]
    Look $id
    return $id
}

# ::sorma::inspect::unwatch ?id? --
#       End a watch; without its id all of them.
proc ::sorma::inspect::unwatch {{only {}}} {
    variable Watches
    if {$only ne {} && ![dict exists $Watches $only]} {
        return -code error -errorcode {SORMA REQUEST SYNTAX} "\"$only\" is no watch: there are [if {[dict size $Watches] > 0} {join [dict keys $Watches] {, }} else {string cat none}]"
    }
    foreach id [if {$only eq {}} {dict keys $Watches} else {list $only}] {
        set watch [dict get $Watches $id]
        dict unset Watches $id
        after cancel [dict get $watch timer]
        set subscription [dict get $watch subscription]
        if {$subscription ne {}} {
            if {[dict get $watch where] eq {}} {
                catch {::sorma::unsubscribe $subscription}
            } else {
                catch {interp eval [::sorma::discover::asker] [list ::sorma::unsubscribe $subscription]}
            }
        }
        if {[dict get $watch future] ne {}} {
            catch {interp eval [::sorma::discover::asker] [list [dict get $watch future] destroy]}
        }
    }
}

proc ::sorma::inspect::Look id {
    variable Watches
    if {![dict exists $Watches $id]} {
        return
    }
    dict with Watches $id {}
    if {$where eq {}} {
        if {[::sorma::exists $service]} {
            Seen $id [::sorma::discover::localText [list sorm DBX -describe $service]]
        } else {
            Unseen $id "there is no such object"
        }
        return
    }
    set peer [::sorma::discover::asker]
    set target [::sorma::discover::numeric [::sorma::discover::address $where]]
    if {$target eq {}} {
        return [Unseen $id [::sorma::discover::whyNot [::sorma::discover::address $where]]]
    }
    interp alias $peer ::sorma::inspect::Answered {} ::sorma::inspect::Answered
    set patience [expr {max(2000, 2 * $every)}]
    if {[catch {interp eval $peer [list ::sorma::async -timeout $patience -command [list ::sorma::inspect::Answered $id] \
            sorm@$target DBX -describe $service]} future]} {
        return [Unseen $id $future]
    }
    dict set Watches $id future $future
}

proc ::sorma::inspect::Answered {id future} {
    variable Watches
    set peer [::sorma::discover::asker]
    set failed [catch {interp eval $peer [list $future result]} reply]
    interp eval $peer [list $future destroy]
    if {![dict exists $Watches $id]} {
        return
    }
    dict set Watches $id future {}
    if {$failed} {
        return [Unseen $id $reply]
    }
    Seen $id [lindex $reply 3]
}

proc ::sorma::inspect::Again id {
    variable Watches
    if {[dict exists $Watches $id]} {
        dict set Watches $id timer [after [dict get $Watches $id every] [list ::sorma::inspect::Look $id]]
    }
}

proc ::sorma::inspect::Unseen {id message} {
    variable Watches
    Again $id
    regsub {^sorm@\S+: } $message {} message
    if {[dict get $Watches $id error] ne $message} {
        dict set Watches $id error $message
        Tell $id error $message
    }
}

proc ::sorma::inspect::Seen {id text} {
    variable Watches
    if {[catch {::sorma::discover::parseDescription $text} table]} {
        return [Unseen $id "its daemon's answer makes no sense"]
    }
    if {![dict get $table exists]} {
        return [Unseen $id "there is no such object"]
    }
    set now {}
    foreach option [dict get $table options] {
        dict set now [lindex $option 0] [lindex $option 5]
    }
    foreach line [split [dict get $table dump] \n] {
        if {[regexp {^# *(\S+) *(.*)$} $line -> key value]} {
            dict set now "# $key" $value
        }
    }
    set before [dict get $Watches $id known]
    set changes {}
    dict for {key value} $now {
        if {![dict exists $before $key]} {
            lappend changes [list $key {} $value]
        } elseif {[dict get $before $key] ne $value} {
            lappend changes [list $key [dict get $before $key] $value]
        }
    }
    dict for {key value} $before {
        if {![dict exists $now $key]} {
            lappend changes [list $key $value {}]
        }
    }
    dict set Watches $id known $now
    dict set Watches $id error {}
    Again $id
    if {[dict get $Watches $id subscription] eq {}} {
        Subscribe $id
    }
    if {[llength $changes] > 0 && [dict get $Watches $id event] eq {}} {
        Tell $id changes $changes
    }
}

# It has just answered, so that asking for its events does not block for long; Peer's -timeout bounds that.
proc ::sorma::inspect::Subscribe id {
    variable Watches
    dict with Watches $id {}
    set command [list ::sorma::inspect::Happened $id]
    if {$where eq {}} {
        set failed [catch {::sorma::subscribe $service -command $command} token]
    } else {
        set peer [::sorma::discover::asker]
        interp alias $peer ::sorma::inspect::Happened {} ::sorma::inspect::Happened
        set target [::sorma::discover::numeric [::sorma::discover::address $where]]
        set failed [catch {interp eval $peer [list ::sorma::subscribe $service@$target -command $command]} token]
    }
    if {!$failed} {
        dict set Watches $id subscription $token
    }
}

proc ::sorma::inspect::Happened {id event} {
    variable Watches
    if {[dict exists $Watches $id]} {
        if {[dict get $event event] eq "sorma.gone"} {
            dict set Watches $id subscription {}
        }
        set pattern [dict get $Watches $id event]
        if {$pattern eq {} || [string match $pattern [dict get $event event]]} {
            Tell $id event $event
        }
    }
}

proc ::sorma::inspect::Tell {id what content} {
    variable Watches
    set news [dict create name [dict get $Watches $id name] time [clock milliseconds] $what $content]
    uplevel #0 [list {*}[dict get $Watches $id command] $news]
}

proc ::sorma::inspect::PrintWatch news {
    try {
        puts [WatchText $news]
        flush stdout
    } trap {POSIX EPIPE} {} - trap {POSIX EIO} {} {
        unwatch                                 ;# nobody reads it any more, as after "| head"
    }
}

# ::sorma::inspect::WatchText --
#       What a watch tells, as text: 10:31:02.123 foo.a  -tempo presto (was largo)
proc ::sorma::inspect::WatchText news {
    set time [dict get $news time]
    set head "[clock format [expr {$time / 1000}] -format %H:%M:%S].[format %03d [expr {$time % 1000}]] [dict get $news name]"
    if {[dict exists $news error]} {
        return [::sorma::text::paint "$head  [::sorma::text::clean [dict get $news error]]" error [Style]]
    }
    if {[dict exists $news event]} {
        set event [dict get $news event]
        set text "[dict get $event event] "
        foreach key {text words floats ints} {
            if {[dict exists $event $key] && [dict get $event $key] ne {}} {
                append text " " [if {$key in {floats ints}} {::sorma::show::numbers [dict get $event $key] [Style]} else {dict get $event $key}]
            }
        }
        if {[dict exists $event lost] && [dict get $event lost] != 0} {
            append text "  (some were lost before)"
        }
        return [::sorma::text::cut [::sorma::text::clean "$head  [string map {\n { }} $text]"] [Width]]
    }
    set lines {}
    foreach change [dict get $news changes] {
        lassign $change key old new
        set was [if {$old ne {}} {string cat "  (was $old)"}]
        lappend lines [::sorma::text::cut [::sorma::text::clean [string map {\n { }} "$head  $key $new$was"]] [Width]]
    }
    return [join $lines \n]
}

# ---- the whole system ----

# ::sorma::inspect::top ?@daemon? ?-count n? ?-data? --
#       The busiest objects: EXEC per second since the last look, and the times that EXEC takes. The first look takes
#       two, 300 ms apart.
# Results:
#       With -data a list of dicts: where, name, class, calls, rate [1/s], underway, p50, p99 (texts); or where and error.
proc ::sorma::inspect::top args {
    variable Sampler
    set count 10
    set at [lsearch -exact $args -count]
    if {$at >= 0} {
        set count [lindex $args $at+1]
        set args [lreplace $args $at $at+1]
        if {![string is integer -strict $count] || $count < 1} {
            return -code error -errorcode {SORMA REQUEST SYNTAX} "-count expects a whole number from 1, got \"$count\""
        }
    }
    lassign [Parse $args {}] wheres data
    if {$Sampler eq {}} {
        set Sampler [Samples new]
    }
    if {[$Sampler age] > 60000} {
        $Sampler take $wheres
        ::sorma::discover::sleep 300
    }
    $Sampler take $wheres
    set items [lrange [$Sampler busiest] 0 $count-1]
    ::sorma::discover::awaitKeys $::sorma::inspect::Wait [lmap item $items {
        if {[dict get $item where] eq {}} continue
        list [::sorma::discover::address [dict get $item where]] [list sorm DBX -look [dict get $item name] -stats]
    }]
    set items [lmap item $items {
        lassign [Times [dict get $item where] [dict get $item name]] p50 p99
        dict set item p50 $p50
        dict set item p99 $p99
    }]
    set errors [$Sampler errors]
    if {$data} {
        return [concat $items $errors]
    }
    set rows [lmap item $items {
        set name [dict get $item name]
        if {[dict get $item where] ne {}} {
            append name @[dict get $item where]
        }
        list $name [Short [dict get $item rate]] [dict get $item p50] [dict get $item p99] [dict get $item calls] [dict get $item underway]
    }]
    set out [list [Table {object EXEC/s p50 p99 calls waiting} $rows {1 2 3 4 5}]]
    foreach error $errors {
        lappend out [Trouble "[dict get $error where]: [dict get $error error]"]
    }
    return [join $out \n]
}

proc ::sorma::inspect::Short rate {
    return [if {$rate < 10} {format %.1f $rate} else {format %.0f $rate}]
}

# Half of the EXECs of an object are quicker than p50: {p50 p99}, as DBX -stats says it; empty when it does not.
proc ::sorma::inspect::Times {where name} {
    if {$where eq {}} {
        if {![::sorma::exists $name]} {
            return {}
        }
        set text [::sorma::discover::localText [list $name DBX -stats]]
    } else {
        set text [::sorma::discover::ask $where [list sorm DBX -look $name -stats]]
    }
    if {[regexp {p50 <= ([^,\n]+), p99 <= ([^\n]+)} $text -> p50 p99]} {
        return [list $p50 $p99]
    }
    return {}
}

# Two looks at all objects: what one knows of the other is how often they were called in between.
if {![info object isa object ::sorma::inspect::Samples]} {oo::class create ::sorma::inspect::Samples}
oo::define ::sorma::inspect::Samples {
    variable before now             ;# dicts: {where name} -> {class calls underway}
    variable then times             ;# dicts: where -> ms of the look
    variable errors                 ;# list of dicts: where and error
    constructor {} {
        set before [set now [set then [set times {}]]]
        set errors {}
    }
    # ms since the last look; a great many before the first.
    method age {} {
        if {[dict size $times] == 0} {
            return 1000000000
        }
        return [expr {[clock milliseconds] - [tcl::mathfunc::max {*}[dict values $times]]}]
    }
    method take wheres {
        set before $now
        set then $times
        set now [set times {}]
        set errors {}
        foreach {where census error} [::sorma::inspect::Censuses $wheres] {
            if {$error ne {}} {
                lappend errors [dict create where $where error $error]
                continue
            }
            set time [clock milliseconds]
            if {$where ne {}} {
                set time [::sorma::discover::came $where {sorm DBX -inventory objects}]
            }
            dict set times $where $time
            dict for {name facts} $census {
                if {[lindex $facts 0] ne "proxy"} {
                    dict set now [list $where $name] $facts
                }
            }
        }
    }
    method errors {} {
        return $errors
    }
    # Objects that were called, the busiest first.
    method busiest {} {
        set rows {}
        dict for {key facts} $now {
            lassign $facts class calls underway
            lassign $key where
            set rate 0.0
            set old 0
            if {[dict exists $before $key]} {
                set old [lindex [dict get $before $key] 1]
            }
            if {[dict exists $then $where] && $calls >= $old} {
                set passed [expr {max(1, [dict get $times $where] - [dict get $then $where])}]
                set rate [expr {1000.0 * ($calls - $old) / $passed}]
            }
            if {$calls > 0 || $underway > 0} {
                lappend rows [list $rate $calls $key $class $underway]
            }
        }
        return [lmap row [lsort -real -decreasing -index 0 [lsort -integer -decreasing -index 1 $rows]] {
            lassign $row rate calls key class underway
            dict create where [lindex $key 0] name [lindex $key 1] class $class calls $calls rate $rate underway $underway
        }]
    }
}

# ::sorma::inspect::find WORD ?@daemon? ?-data? --
#       Look for a word, in any case of letters, in names, purposes, options, actions and help: of what is here, of
#       classes that could be loaded, and of all daemons.
# Results:
#       With -data a list of dicts: where, kind (object, class, option, action, inspection, EXEC, entry), name, item
#       and text; or where and error.
proc ::sorma::inspect::find args {
    variable Wait
    lassign [Parse $args {word {}}] word wheres data
    if {$word eq {}} {
        return -code error -errorcode {SORMA REQUEST SYNTAX} {wrong # args: should be "find word ?@daemon? ?-data?"}
    }
    set pattern *[::sorma::text::escape $word]*
    set items {}
    set places [Places $wheres]
    ::sorma::discover::await $Wait [lsearch -all -inline -not -exact $places {}] $::sorma::discover::inventoryRequest
    foreach where $places {
        if {$where ne {} && [::sorma::discover::inventory $where 1] eq {}} {
            lappend items [dict create where $where error [::sorma::discover::trouble $where]]
            continue
        }
        foreach name [lsearch -all -inline -nocase -glob [::sorma::discover::objects $where] $pattern] {
            lappend items [dict create where $where kind object name $name item {} text {}]
        }
        foreach name [lsearch -all -inline -nocase -glob [::sorma::discover::words $where] $pattern] {
            lappend items [dict create where $where kind entry name $name item {} text "in the dictionary"]
        }
        set classes [::sorma::discover::classes $where]
        foreach class $classes table [Tables $where $classes] {
            if {$table ne {} && $class ne "proxy"} {
                lappend items {*}[lmap found [InTable $table $pattern] {dict merge [dict create where $where] $found}]
            }
        }
    }
    if {$data} {
        return $items
    }
    set out [Sections $items {} {} {item {
        list [dict get $item kind] [string trim "[dict get $item name] [dict get $item item]"] [dict get $item text]
    }}]
    if {[llength $out] == 0} {
        return "\"[::sorma::text::clean $word]\" is nowhere"
    }
    return [join $out \n]
}

# Where in a class's table something matches: list of dicts of kind, name, item, text.
proc ::sorma::inspect::InTable {table pattern} {
    set found {}
    set class [dict get $table class]
    set add {{kind item text} {
        upvar 1 found found class class
        lappend found [dict create kind $kind name $class item $item text $text]
    }}
    if {[string match -nocase $pattern "$class [dict get $table purpose]"]} {
        apply $add class {} [dict get $table purpose]
    }
    foreach option [dict get $table options] {
        lassign $option name type unit range default value help
        if {[string match -nocase $pattern "$name $help $range"]} {
            apply $add option $name [string trim [::sorma::complete::optionHint [dict replace $table exists 0] [lreplace $option 0 0 {}]]]
        }
    }
    foreach {key kind} {actions action inspections inspection} {
        foreach action [dict get $table $key] {
            lassign $action name usage help
            if {[string match -nocase $pattern "$name $usage $help"]} {
                apply $add $kind $name $help
            }
        }
    }
    if {[string match -nocase $pattern [dict get $table signature]]} {
        apply $add EXEC {} [string map {\n "; "} [dict get $table signature]]
    }
    return $found
}

# ---- what these have in common ----

# Words of a command: {VALUE-of-each-name ... WHERES DATA}. wheres: patterns after @; a lone @ is here.
# located: the first of them may have its place with it, kin*@robot.
proc ::sorma::inspect::Parse {words names {located 0}} {
    set values [dict values $names]
    set wheres {}
    set data 0
    set at 0
    foreach word $words {
        if {$word eq "-data"} {
            set data 1
        } elseif {[string match @* $word]} {
            lappend wheres [string range $word 1 end]
        } elseif {$at < [llength $values]} {
            if {$located && $at == 0 && [regexp {^([^@]+)@(.*)$} $word -> word where]} {
                lappend wheres $where
            }
            lset values $at $word
            incr at
        } else {
            set usage [::sorma::complete::usage [lindex [info level -1] 0]]
            return -code error -level 2 -errorcode {SORMA REQUEST SYNTAX} "too many words: \"$word\"[if {$usage ne {}} {string cat "; should be $usage"}]"
        }
    }
    return [list {*}$values $wheres $data]
}

# Places that are meant; empty: here. Without patterns: here, and all daemons but ourselves, each once.
proc ::sorma::inspect::Places patterns {
    ::sorma::discover::lookAgain
    set seen {}
    set places {}
    if {[llength $patterns] == 0} {
        lappend places {}
        dict set seen self 1
        set patterns *
    }
    foreach pattern $patterns {
        if {$pattern in {{} self}} {
            lappend places {}
            continue
        }
        set names [lsearch -all -inline -glob [::sorma::discover::names] $pattern]
        if {[llength $names] == 0 && ![regexp {[*?\[]} $pattern]} {
            set names [list $pattern]           ;# it cannot be found, but perhaps reached
        }
        foreach name $names {
            set address [::sorma::discover::address $name]
            if {[dict exists $seen $address]} continue
            dict set seen $address 1
            lappend places [if {$address ne "self"} {set name}]
        }
    }
    return $places
}

# Objects of places: where census error ... census: dict: name -> {class calls underway}.
proc ::sorma::inspect::Censuses patterns {
    variable Wait
    set request {sorm DBX -inventory objects}
    set places [Places $patterns]
    set elsewhere [lsearch -all -inline -not -exact $places {}]
    ::sorma::discover::renew $elsewhere $request
    ::sorma::discover::await $Wait $elsewhere $request
    ::sorma::discover::consult $elsewhere $request
    set out {}
    foreach where $places {
        set census [::sorma::discover::census $where]
        set error {}
        if {$where ne {}} {
            set error [::sorma::discover::trouble $where $request]
            if {$census eq {} && $error eq {}} {
                set error "no answer yet"
            }
        }
        lappend out $where $census $error
    }
    return $out
}

# Tables of classes or objects at a place, as far as they come in time.
proc ::sorma::inspect::Tables {where names} {
    variable Wait
    if {$where ne {}} {
        ::sorma::discover::await $Wait [list $where] {*}[lmap name $names {list sorm DBX -describe $name}]
    }
    return [lmap name $names {
        ::sorma::discover::describe [if {$where eq {}} {set name} else {string cat $name@$where}]
    }]
}

# where {items} ...
proc ::sorma::inspect::ByPlace items {
    set groups {}
    foreach item $items {
        dict lappend groups [dict get $item where] $item
    }
    return $groups
}

proc ::sorma::inspect::Style {} {
    return [::sorma::showDefaults]
}

proc ::sorma::inspect::Width {} {
    return [dict get [::sorma::showDefaults] -width]
}

proc ::sorma::inspect::Heading where {
    return [::sorma::text::paint [if {$where eq {}} {string cat here} else {string cat @$where}] strong [Style]]
}

proc ::sorma::inspect::Trouble text {
    return [::sorma::text::block "  " $text warning [Style]]
}

proc ::sorma::inspect::Table {heads rows right {wrap 0}} {
    set style [dict filter [Style] key -colour -width]
    return [::sorma::text::table $heads $rows {*}$style -right $right -wrap $wrap]
}

# The items of each place: a table whose rows a lambda makes of them, and the errors among them. Returns lines.
proc ::sorma::inspect::Sections {items heads right row} {
    set out {}
    foreach {where group} [ByPlace $items] {
        set rows {}
        set errors {}
        foreach item $group {
            if {[dict exists $item error]} {
                lappend errors [dict get $item error]
            } else {
                lappend rows [apply $row $item]
            }
        }
        lappend out {*}[Section $where $heads $rows $right $errors]
    }
    return $out
}

# A place with its table, and what is wrong there.
proc ::sorma::inspect::Section {where heads rows right errors} {
    variable MostRows
    set out [list [Heading $where]]
    set more [expr {[llength $rows] - $MostRows}]
    if {[llength $rows] > 0} {
        set style [Style]
        set width [dict get $style -width]
        set text [::sorma::text::table $heads [lrange $rows 0 $MostRows-1] -colour [dict get $style -colour] \
            -width [expr {$width > 0 ? max(10, $width - 2) : 0}] -right $right -wrap [expr {$heads eq {}}]]
        lappend out {*}[lmap line [split $text \n] {string cat "  " $line}]
    }
    if {$more > 0} {
        lappend out "  ... and $more more; give a pattern"
    }
    foreach error $errors {
        lappend out [Trouble $error]
    }
    return $out
}

# Its larger parts.
apply {{} {
    foreach file {observe doctor} {
        uplevel #0 [list source -encoding utf-8 [file join $::sorma::library $file.tcl]]
    }
}}
