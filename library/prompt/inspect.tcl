# inspect.tcl -- look around in a system of service objects: their names, state and purpose.
#
# Each command returns text for people, or with -data lists and dicts for programs. They ask all daemons at once and come
# back within half a second or so; daemons that do not answer have a line of their own. Nothing is made by looking.

package require sorma::announced
package require sorma::await
package require sorma::candidates
package require sorma::complete
package require sorma::listing
package require sorma::options
package require sorma::requestWords
package require sorma::usage
package provide sorma::inspect 1.0
namespace eval ::sorma::inspect {
    namespace export {[a-z]*}
    namespace ensemble create

    variable Wait 400           ;# ms for daemons to answer
    variable Before {}          ;# of top: {where name} -> {calls time [ms]}, when it looked last
    variable Looked 0           ;# ms, when that was
    # Its commands, and what help says of each. A command of a file of its own, such as doctor.tcl, enters itself; its file has the command's name.
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
    foreach {where key error} [Counted $wheres] {
        if {$error ne {}} {
            lappend items [dict create where $where error $error]
            continue
        }
        foreach object [::sorma::world objects $key] {
            if {[string match $pattern [dict get $object name]]} {
                lappend items [dict create where $where {*}$object {*}[Called $where]]
            }
        }
        foreach object [if {$where eq {}} ::sorma::anonymous] {
            lassign $object name class calls underway
            if {[string match $pattern $name] || [string match $pattern [string range $name 2 end]]} {
                lappend items [dict create where {} name $name class $class calls $calls underway $underway]
            }
        }
    }
    if {$data} {
        return $items
    }
    NeedPlaces $wheres $items
    if {[llength $items] == 0} {
        set known [concat {*}[lmap {where key error} [Counted $wheres] {Names $key}]]
        return "no object is called [::sorma::text::clean $pattern][::sorma::DidYouMean $pattern $known]"
    }
    return [::sorma::listing objects $items]
}

# ::sorma::inspect::tree ?pattern? ?@daemon? ?-data? --
#       Objects with the sub-services that their options name.
# Results:
#       With -data a list of dicts: where, name, class and uses (dict: option -> name of an object); or where and error.
proc ::sorma::inspect::tree args {
    lassign [Parse $args {pattern *} 1] pattern wheres data
    set items {}
    foreach {where key error} [Counted $wheres] {
        if {$error ne {}} {
            lappend items [dict create where $where error $error]
            continue
        }
        set objects [::sorma::world objects $key]
        # Most classes use no others: only objects of those that do are asked for.
        set classes [lsort -unique [lmap object $objects {dict get $object class}]]
        set using [lmap class $classes table [Tables $where $classes] {
            if {$table eq {} || [lsearch -index 1 [dict get $table options] service] < 0} continue
            set class
        }]
        set asking [lmap object $objects {if {[dict get $object class] ni $using} continue; dict get $object name}]
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
        foreach object $objects {
            set name [dict get $object name]
            lappend items [dict create where $where name $name class [dict get $object class] \
                uses [if {[dict exists $uses $name]} {dict get $uses $name}]]
        }
    }
    if {$data} {
        return [lmap item $items {if {[dict exists $item name] && ![string match $pattern [dict get $item name]]} continue; set item}]
    }
    NeedPlaces $wheres $items
    return [::sorma::listing tree $items $pattern]
}

# ::sorma::inspect::daemons ?-data? --
#       Daemons that can be reached by a name alone, and how they are.
# Results:
#       With -data a list of dicts: name, address, state (as sorma::world gives it, or self), error, objects.
proc ::sorma::inspect::daemons args {
    lassign [Parse $args {}] - data
    set items {}
    foreach {name key error} [CountedOf {::sorma::world names}] {
        set known [::sorma::world get $key]
        if {$known eq {}} {             ;# its name leads nowhere
            set known {address {} state unresolved objects {}}
        }
        set state [dict get $known state]
        if {$key eq "self"} {
            set state self
        } elseif {$error ne {} && $state in {alive asking}} {
            set state silent
        }
        lappend items [dict create name $name address [if {$key eq "self"} {string cat self} else {dict get $known address}] \
            state $state error $error objects [dict get $known objects] {*}[Called $name]]
    }
    # Those by another address than the ones above. Nobody asks them.
    set known [lmap item $items {dict get $item address}]
    set others [lmap other [::sorma::announced::find] {
        if {[lindex $other 1] in $known} continue
        set other
    }]
    if {$data} {
        return [concat $items [lmap other $others {
            dict create name [lindex $other 0] address [lindex $other 1] state announced error {} objects {} user {}
        }]]
    }
    set announced [lmap other $others {
        string cat "announced in the network, and not asked: [::sorma::text::clean [join $other { at }]]"
    }]
    if {[llength $items] > 0} {
        set announced [linsert $announced 0 [::sorma::listing daemons $items]]
    }
    if {$announced eq {}} {
        return "no daemons: none listens in the runtime folder, and the dictionary has no address"
    }
    return [join $announced \n]
}

# ---- one object ----

# ::sorma::inspect::help ?name? ?-data? --
#       The text of CTRL -help of an object or class, which is not made for it; or what a command is for. Without a name
#       what commands there are.
# Results:
#       With -data the class's table, as sorma::table::describe gives it.
proc ::sorma::inspect::help args {
    variable Topics
    lassign [Parse $args {name {}}] name wheres data
    if {$name eq {}} {
        set rows [lmap {command purpose} $Topics {list [::sorma::complete::usage sorma::inspect::$command] $purpose}]
        set rows [lmap row $rows {lreplace $row 0 0 [string map {sorma::inspect:: {}} [lindex $row 0]]}]
        lappend rows [list "NAME CTRL -help" "what an object can do; help NAME makes none, and takes a class, or NAME@DAEMON, too"]
        return [::sorma::listing table {} $rows {} 1]
    }
    set command [string trimleft $name :]
    if {!$data && ![::sorma::candidates::isName $command]} {
        foreach known [list sorma::inspect::$command $name] {
            try {
                return [::sorma::manual $known -width [dict get [::sorma::showDefaults] -width]]
            } trap {SORMA MANUAL UNKNOWN} {} {
                # then it must be an object or a class
            }
        }
    }
    try {
        set table [Describe $name]
    } trap {SORMA NAME UNKNOWN_CLASS} {- how} {
        set near [::sorma::DidYouMean $name [dict keys $Topics]]
        return -options $how [if {$near ne {}} {string cat "\"$name\"$near is neither a command nor a class"} else {set -}]
    }
    if {$data} {
        return $table
    }
    return [::sorma::text::paragraphs [dict get $table help] [::sorma::showDefaults]]
}

# ::sorma::inspect::dump NAME ?-data? --
#       State of an object that is there: its options, as CTRL would read them again, and what its class adds.
# Results:
#       With -data a dict: option -> value.
proc ::sorma::inspect::dump args {
    lassign [Parse $args {name {}}] name wheres data
    set table [Existing $name "; help $name shows what its class has"]
    if {$data} {
        set values {}
        foreach option [dict get $table options] {
            dict set values [lindex $option 0] [lindex $option 5]
        }
        return $values
    }
    return [::sorma::text::paragraphs [dict get $table dump] [::sorma::showDefaults]]
}

# ::sorma::inspect::Describe NAME -- table of an object's class, as it is now. Fails as a request to the object would.
proc ::sorma::inspect::Describe name {
    if {$name eq {}} {
        return -code error -errorcode {SORMA REQUEST SYNTAX} "a name is missing"
    }
    if {[::sorma::AnonymousObject $name] ne {}} {
        return [::sorma::table describe $name]
    }
    lassign [::sorma::table locate $name] service where
    set text [::sorma::await answer $where [list sorm DBX -describe $service] 2000]
    if {[catch {::sorma::table parse $text} table]} {
        return -code error -errorcode [list SORMA COMM PROTOCOL $name] "$name: the daemon's answer makes no sense: $table"
    }
    return $table
}

# The same of an object that must be there. MORE: what else to say when it is not.
proc ::sorma::inspect::Existing {name more} {
    set table [Describe $name]
    if {![dict get $table exists]} {
        lassign [::sorma::table locate $name] service where
        set near [::sorma::DidYouMean $service [concat {*}[lmap {- key -} [Counted [list $where]] {Names $key}]]]
        return -code error -level 2 -errorcode [list SORMA SERVICE GONE $name] "$name$near: there is no such object$more"
    }
    return $table
}
# Names of the objects of a daemon.
proc ::sorma::inspect::Names key {
    return [lmap object [::sorma::world objects $key] {dict get $object name}]
}

# ---- the whole system ----

# ::sorma::inspect::top ?@daemon? ?-count n? ?-data? --
#       The busiest objects: EXEC per second since the last look, and the times that EXEC takes. The first look takes
#       two, 300 ms apart.
# Results:
#       With -data a list of dicts: where, name, class, calls, rate [1/s], underway, p50, p99 [s]; or where and error.
proc ::sorma::inspect::top args {
    variable Before
    variable Looked
    variable Wait
    lassign [Parse $args {} 0 {-count {{whole 1 {}} 10}}] wheres data count
    if {[clock milliseconds] - $Looked > 60000} {
        set Before [Calls [Counted $wheres]]
        ::sorma::await sleep 300
    }
    set places [Counted $wheres]
    set items [lrange [Busiest $places] 0 $count-1]
    set Before [Calls $places]
    set Looked [clock milliseconds]
    foreach item $items {
        if {[dict get $item where] ne {}} {
            ::sorma::table renew [dict get $item where] [list sorm DBX -look [dict get $item name] -stats]
        }
    }
    ::sorma::await until $Wait {[Untimed $items] == 0}
    set items [lmap item $items {
        lassign [Times [dict get $item where] [dict get $item name]] p50 p99
        if {$data} {
            set p50 [Seconds $p50]
            set p99 [Seconds $p99]
        }
        dict merge $item [dict create p50 $p50 p99 $p99]
    }]
    foreach {where key error} $places {
        if {$error ne {}} {
            lappend items [dict create where $where error $error]
        }
    }
    if {$data} {
        return $items
    }
    NeedPlaces $wheres $items
    return [::sorma::listing busiest $items]
}

# A dict: {where name} -> {calls time}, of places as Counted gives them.
proc ::sorma::inspect::Calls places {
    set calls {}
    foreach {where key error} $places {
        if {$error eq {}} {
            set time [Time $key]
            dict set calls [list $where {}] [list 0 $time]          ;# of what was not there
            foreach object [::sorma::world objects $key] {
                dict set calls [list $where [dict get $object name]] [list [dict get $object calls] $time]
            }
        }
    }
    return $calls
}

# When the objects of a daemon were counted [ms].
proc ::sorma::inspect::Time key {
    return [if {$key eq "self"} {clock milliseconds} else {::sorma::worldDaemon::fact $key counted 0}]
}

# Objects that were called, the busiest first.
proc ::sorma::inspect::Busiest places {
    variable Before
    set rows {}
    foreach {where key error} $places {
        if {$error ne {}} continue
        set now [Time $key]
        foreach object [::sorma::world objects $key] {
            set name [dict get $object name]
            set calls [dict get $object calls]
            set rate 0.0
            foreach known [list $name {}] {
                if {[dict exists $Before [list $where $known]]} {
                    lassign [dict get $Before [list $where $known]] old then
                    if {$calls >= $old} {
                        set rate [expr {1000.0 * ($calls - $old) / max(1, $now - $then)}]
                    }
                    break
                }
            }
            if {$calls > 0 || [dict get $object underway] > 0} {
                lappend rows [list $rate $calls [dict create where $where {*}$object rate $rate]]
            }
        }
    }
    return [lmap row [lsort -real -decreasing -index 0 [lsort -integer -decreasing -index 1 $rows]] {lindex $row 2}]
}

# How many have not said yet how long their EXEC takes?
proc ::sorma::inspect::Untimed items {
    set n 0
    foreach item $items {
        set where [dict get $item where]
        incr n [expr {$where ne {} && [dict get [::sorma::table answer $where [list sorm DBX -look [dict get $item name] -stats]] open]}]
    }
    return $n
}

# Half of the EXECs of an object are quicker than p50: {p50 p99}, as DBX -stats says it; empty when it does not.
proc ::sorma::inspect::Times {where name} {
    if {$where eq {} && ![::sorma::exists $name]} {
        return {}
    }
    set text [::sorma::table text $where [if {$where eq {}} {list $name DBX -stats} else {list sorm DBX -look $name -stats}]]
    if {[regexp {p50 <= ([^,\n]+), p99 <= ([^\n]+)} $text -> p50 p99]} {
        return [list $p50 $p99]
    }
    return {}
}

# A time such as "190 us" in seconds; what is none stays empty.
proc ::sorma::inspect::Seconds text {
    if {[scan $text {%g %s} number unit] != 2 || ![dict exists {ns 1e-9 us 1e-6 ms 1e-3 s 1} $unit]} {
        return {}
    }
    return [format %.4g [expr {$number * [dict get {ns 1e-9 us 1e-6 ms 1e-3 s 1} $unit]}]]
}

# ::sorma::inspect::find WORD ?@daemon? ?-data? --
#       Look for a word, in any case of letters, in names, purposes, options, actions and help. It looks here, in classes that could be
#       loaded, and at all daemons.
# Results:
#       With -data a list of dicts: where, kind (object, class, option, action, inspection, EXEC, entry), name, item
#       and text; or where and error.
proc ::sorma::inspect::find args {
    variable Wait
    lassign [Parse $args {word {}}] word wheres data
    if {$word eq {}} {
        ::sorma::usage::wrong sorma::inspect::find
    }
    set pattern *[::sorma::text::escape $word]*
    set items {}
    set places [Places $wheres]
    foreach where $places {
        ::sorma::table inventory $where
    }
    foreach {where key error} [::sorma::await daemons $Wait $places counted] {
        if {$error eq {} && $where ne {}} {
            ::sorma::await answers $Wait [list $where] $::sorma::table::inventoryRequest
            ::sorma::table inventory $where             ;# is it understood?
            set error [dict get [::sorma::table answer $where $::sorma::table::inventoryRequest] error]
        }
        if {$error ne {}} {
            lappend items [dict create where $where error $error]
            continue
        }
        foreach name [lsearch -all -inline -nocase -glob [::sorma::table objects $where] $pattern] {
            lappend items [dict create where $where kind object name $name item {} text {}]
        }
        foreach name [lsearch -all -inline -nocase -glob [::sorma::table words $where] $pattern] {
            lappend items [dict create where $where kind entry name $name item {} text "in the dictionary"]
        }
        set classes [::sorma::table classes $where]
        foreach class $classes table [Tables $where $classes] {
            if {$table ne {}} {
                lappend items {*}[lmap found [InTable $table $pattern] {dict merge [dict create where $where] $found}]
            }
        }
    }
    if {$data} {
        return $items
    }
    if {[llength $items] == 0} {
        return "\"[::sorma::text::clean $word]\" is nowhere"
    }
    return [::sorma::listing found $items]
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
            apply $add option $name [string trim [::sorma::requestWords::optionHint [dict replace $table exists 0] [lreplace $option 0 0 {}]]]
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

# ::sorma::inspect::Parse WORDS NAMES ?located? ?TABLE? --
#       Words of a command.
# Arguments:
#       names    dict of words that may be given, in order, and their defaults
#       located  the first of them may have its place with it, kin*@robot
#       table    options beside -data
# Results:
#       VALUE-of-each-name ... WHERES DATA VALUE-of-each-option. wheres: patterns after @; a lone @ is here.
proc ::sorma::inspect::Parse {words names {located 0} {table {}}} {
    set settings [::sorma::options::parse [dict merge {-data flag} $table] $words rest]
    set values [dict values $names]
    set wheres {}
    set at 0
    foreach word $rest {
        if {[string match @* $word]} {
            lappend wheres [string range $word 1 end]
        } elseif {$at < [llength $values]} {
            if {$located && $at == 0 && [regexp {^([^@]+)@(.*)$} $word -> word where]} {
                lappend wheres $where
            }
            lset values $at $word
            incr at
        } else {
            set command [string trimleft [uplevel 1 {namespace which -command [lindex [info level 0] 0]}] :]
            tailcall ::sorma::usage::wrong $command "too many words: \"$word\""
        }
    }
    return [list {*}$values $wheres {*}[dict values $settings]]
}

# ::sorma::inspect::Places PATTERNS -- what stands after @ in the places that are meant; empty: here. Without patterns: here, and all
# daemons but ourselves, each once.
proc ::sorma::inspect::Places patterns {
    set seen {}
    set places {}
    if {[llength $patterns] == 0} {
        lappend places {}
        dict set seen self 1
        set patterns *
    }
    set names [::sorma::world names]
    foreach pattern $patterns {
        if {$pattern in {{} self}} {
            lappend places {}
            continue
        }
        set found [lsearch -all -inline -glob $names $pattern]
        # A name of ours comes before that of a daemon elsewhere.
        if {[llength $found] == 0 || [regexp {[*?\[]} $pattern]} {
            lappend found {*}[dict keys [dict filter [::sorma::world others] value $pattern]]
        }
        if {[llength $found] == 0 && ![regexp {[*?\[]} $pattern]} {
            set found [list $pattern]           ;# it cannot be found, but perhaps reached
        }
        foreach name $found {
            set key [::sorma::world use $name]
            if {[dict exists $seen $key]} continue
            if {$key ne {}} {
                dict set seen $key 1
            }
            lappend places [if {$key ne "self"} {set name}]
        }
    }
    return $places
}

# Places that were asked for by name, and none of them has answered: that is an error, not a list.
proc ::sorma::inspect::NeedPlaces {wheres items} {
    if {[llength $wheres] == 0 || [llength $items] == 0 || [lsearch -regexp $wheres {^$|[*?\[]}] >= 0} {
        return
    }
    set why {}
    foreach item $items {
        if {![dict exists $item error]} {
            return
        }
        set where [dict get $item where]
        lappend why "@$where: [dict get $item error]"
    }
    return -code error -level 2 -errorcode [list SORMA ADDRESS UNRESOLVED @[lindex $wheres 0]] [join $why \n]
}

# WHERE KEY TROUBLE ... of the places, when all objects there were counted again.
proc ::sorma::inspect::Counted patterns {
    return [CountedOf [list Places $patterns]]
}
# The same of places that a command gives. Daemons of other hosts become known only when one of them has answered.
proc ::sorma::inspect::CountedOf command {
    variable Wait
    set places [{*}$command]
    set found [::sorma::await daemons $Wait $places counted]
    if {[::sorma::world open]} {
        ::sorma::await until $Wait {![::sorma::world open]}
    }
    set now [{*}$command]
    set more [lmap place $now {if {$place in $places} continue; set place}]
    if {[llength $more] == 0} {
        return $found
    }
    foreach {place key error} [concat $found [::sorma::await daemons $Wait $more counted]] {
        dict set told $place [list $place $key $error]
    }
    return [concat {*}[lmap place $now {dict get $told $place}]]
}
# For an item: what a daemon that nobody here has named is called on its host.
proc ::sorma::inspect::Called where {
    set others [::sorma::world others]
    return [if {[dict exists $others $where] && [dict get $others $where] ne {}} {list called [dict get $others $where]}]
}

# Tables of classes or objects at a place, as far as they come in time.
proc ::sorma::inspect::Tables {where names} {
    variable Wait
    if {$where ne {}} {
        ::sorma::await answers $Wait [list $where] {*}[lmap name $names {list sorm DBX -describe $name}]
    }
    return [lmap name $names {
        ::sorma::table describe [if {$where eq {}} {set name} else {string cat $name@$where}]
    }]
}

package require sorma::observe
apply {{} {
    foreach command [::sorma::usage::commands sorma::inspect::*] {
        if {![dict exists $::sorma::inspect::Topics [namespace tail $command]]} {
            package require sorma::[namespace tail $command]
        }
    }
}}
