# table.tcl -- what daemons say of themselves when they are asked: classes, words of the dictionary, tables of classes and objects.
#
# Nothing here waits, and nothing is ever made for a question: daemons are asked by the lines of the model, through their object
# sorm, DBX -inventory and -describe. A known table is given at once. It is asked for again, behind the scenes, when it is
# needed and has grown old.
#
# WHERE is what stands after @; empty or self is this process. Answers come from strangers: they are data, checked before they are
# believed, and never evaluated.

package require sorma::text
package require sorma::world
package provide sorma::table 1.0

namespace eval ::sorma::table {
    namespace export locate text answer renew open inventory objects classes words describe parse guess common hasPackage
    namespace ensemble create

    variable Fresh 1000         ;# ms for which an answer is not asked for again
    variable Patience 3000      ;# ms for which a daemon may take its time
    variable Overdue 2000       ;# ms without an answer, then the last one may be old
    variable Many 1000          ;# answers that are kept before old ones are looked for
    variable Most 200000        ;# words that are believed to be at one daemon
    # array: {daemon request} -> dict, request being the words of a request to an object there
    #   asked   ms, when it was asked for last     open    is that under way
    #   came    ms, when the last answer came; 0: never     text    that answer     parsed  what it says, or empty
    #   error, code  of the last attempt when it failed, else empty
    variable Answers
    variable inventoryRequest {sorm DBX -inventory classes words}
    if {![array exists Answers]} {
        array set Answers {}
    }
}

# ---- what there is ----

# ::sorma::table::locate NAME -- {SERVICE WHERE}: the name as its process knows it, and what stands after @ (empty: here).
proc ::sorma::table::locate name {
    if {[catch {::sorma::resolve $name} place]} {
        return [list $name {}]
    }
    return [list [dict get $place service] [if {[dict get $place state] ne "here"} {dict get $place where}]]
}

# ::sorma::table::inventory WHERE -- a dict of classes (dict: name -> {version purpose}), installed (names of those that are not loaded yet) and words (of
# the dictionary). Empty as long as nothing is known.
proc ::sorma::table::inventory where {
    variable inventoryRequest
    return [Known $where $inventoryRequest ::sorma::table::ParseInventory]
}

# ::sorma::table::objects WHERE -- names of objects, sorted; elsewhere those that the model knows.
proc ::sorma::table::objects where {
    set key [::sorma::world use $where]
    if {[::sorma::worldDaemon::fact $key counted 0] == 0} {
        ::sorma::worldDaemon::fact $key recount
    }
    return [if {$key eq "self"} {::sorma::names} else {lmap object [::sorma::world objects $key] {dict get $object name}}]
}

# ::sorma::table::classes WHERE -- names of classes; here also of those that are loaded when somebody names an object.
proc ::sorma::table::classes where {
    if {[IsHere $where]} {
        set known [ParseClasses [HereText {sorm DBX -inventory classes}]]
        return [lsort [lsearch -all -inline -not -exact [concat [dict keys [dict get $known classes]] [dict get $known installed]] proxy]]
    }
    set known [inventory $where]
    return [if {$known ne {}} {dict keys [dict get $known classes]}]
}

# ::sorma::table::words WHERE -- words of the dictionary.
proc ::sorma::table::words where {
    if {[IsHere $where]} {
        return [dict get [HereText {sorm DBX -inventory words}] words]
    }
    set known [inventory $where]
    return [if {$known ne {}} {dict get $known words}]
}

# ::sorma::table::describe NAME --
#       The table of an object's class, as a dict:
#           name exists class purpose version options fixed hints      actions inspections
#           reads writes words signature example help                  dump, when the object exists
#       No object is made; a class of this
#       interpreter is loaded. An object elsewhere also has an age, as of answer. Empty when nothing is known, or not yet.
proc ::sorma::table::describe name {
    set own [::sorma::AnonymousObject $name]
    if {$own ne {}} {
        return [OfCommand {*}$own]
    }
    lassign [locate $name] service where
    if {$where ne {}} {
        set request [list sorm DBX -describe $service]
        set table [Known $where $request ::sorma::table::parse]
        return [if {$table ne {}} {dict replace $table age [dict get [answer $where $request] age]}]
    }
    if {![::sorma::exists $service]} {
        set class [lindex [split $service .] 0]
        if {$class ni [::sorma::classes] && ![hasPackage sorma::service::$class]} {
            return {}
        }
    }
    if {[catch {HereText [list sorm DBX -describe $service]} text]} {
        return {}
    }
    return $text
}

# The same of an object without a name, by its command.
proc ::sorma::table::OfCommand {command class} {
    set table [HereText [list sorm DBX -describe $class.?]]
    return [dict replace $table name $command exists 1 help [$command info help] dump [$command info dump] \
        options [lmap option [dict get $table options] {lreplace $option 5 5 [$command cget [lindex $option 0]]}]]
}

# ::sorma::table::guess NAME -- the same as far as anything is known now. For an object elsewhere it is its own table, else that
# of the class of that name here.
proc ::sorma::table::guess name {
    set table [describe $name]
    lassign [locate $name] service where
    if {$table eq {} && $where ne {}} {
        set table [describe [lindex [split $service .] 0].?]
    }
    return $table
}

# ::sorma::table::hasPackage NAME -- is there such a package?
proc ::sorma::table::hasPackage package {
    return [expr {[llength [package versions $package]] > 0 || [package provide $package] ne {}}]
}

# ::sorma::table::common -- actions and inspections that every class has: {actions inspections}, elements as in describe.
proc ::sorma::table::common {} {
    variable CommonRequests
    if {![info exists CommonRequests]} {
        set own [HereText {sorm DBX -describe sorm}]
        set CommonRequests [lmap {what key} {actions actions inspections inspections} {
            lmap action [lrange [HereText [list sorm DBX -info $what]] [llength [dict get $own $key]] end] {
                lassign $action name usage help
                set least [llength [lsearch -all -not -glob $usage {[?]*}]]
                list $name $usage $help $least [llength $usage]
            }
        }]
    }
    return $CommonRequests
}

# ---- answers ----

# ::sorma::table::text WHERE REQUEST -- the text of the last answer, empty when there is none; asks when it is old.
proc ::sorma::table::text {where request} {
    return [dict get [answer $where $request] text]
}

# ::sorma::table::answer WHERE REQUEST --
#       What is known of an answer, as a dict. Asks when it is old.
#       text          the answer
#       came          ms, its time; 0: never
#       open          is it being asked for?
#       error, code   of the last attempt, when that failed
#       age           such as "12 s old", when the daemon has not answered since; else empty
proc ::sorma::table::answer {where request} {
    variable Answers
    if {[IsHere $where]} {
        return [dict create text [HereText $request] came [clock milliseconds] open 0 error {} code {} age {}]
    }
    set entry $Answers([Ask $where $request])
    return [dict replace $entry age [Age $entry]]
}

# How old an answer is that has been asked for again in vain.
proc ::sorma::table::Age entry {
    variable Overdue
    set late [expr {[dict get $entry error] ne {} || [dict get $entry open] && [clock milliseconds] - [dict get $entry asked] > $Overdue}]
    return [if {$late && [dict get $entry came] > 0} {::sorma::text::age [dict get $entry came]}]
}

# ::sorma::table::renew WHERE REQUEST -- what was answered counts as old.
proc ::sorma::table::renew {where request} {
    variable Answers
    set key [list [::sorma::world find $where] $request]
    if {[info exists Answers($key)]} {
        dict set Answers($key) asked 0
    }
}

# ::sorma::table::open -- how many questions were put for the first time and have no answer yet; one that takes long is not counted.
proc ::sorma::table::open {} {
    variable Answers
    set since [expr {[clock milliseconds] - 300}]
    set n 0
    foreach {key entry} [array get Answers] {
        incr n [expr {[dict get $entry open] && [dict get $entry came] == 0 && [dict get $entry asked] >= $since}]
    }
    return $n
}

proc ::sorma::table::IsHere where {
    return [expr {$where in {{} self} || [::sorma::world find $where] eq "self"}]
}

# The text of a reply of an object of this interpreter. The user's trail stays what it was.
proc ::sorma::table::HereText request {
    set words [lassign $request so]
    return [lindex [::sorma::KeepTrail [list ::sorma::so::$so {*}$words]] 3]
}

# The content of an answer, parsed by a command once for each answer.
proc ::sorma::table::Known {where request parseCmd} {
    variable Answers
    if {[IsHere $where]} {
        return [{*}$parseCmd [HereText $request]]
    }
    set key [Ask $where $request]
    set entry $Answers($key)
    if {[dict get $entry came] == 0} {
        return {}
    }
    if {![dict exists $entry parsed]} {
        if {[catch {{*}$parseCmd [dict get $entry text]} parsed]} {
            dict set Answers($key) error "its answer makes no sense: $parsed"
            dict set Answers($key) code {SORMA COMM PROTOCOL}
            set parsed {}
        }
        dict set Answers($key) parsed $parsed
        return $parsed
    }
    return [dict get $entry parsed]
}

# Ask, unless that is under way, or has been done lately. Returns the key of the answer.
proc ::sorma::table::Ask {where request} {
    variable Answers
    variable Fresh
    variable Patience
    set daemon [::sorma::world use $where]
    set key [list $daemon $request]
    set now [clock milliseconds]
    if {![info exists Answers($key)]} {
        Prune
        set Answers($key) {asked 0 open 0 came 0 text {} error {} code {}}
    }
    if {[dict get $Answers($key) open] || $now - [dict get $Answers($key) asked] < $Fresh} {
        return $key
    }
    dict set Answers($key) asked $now
    if {$daemon eq {}} {
        Failed $key "\"$where\" leads nowhere" [list SORMA ADDRESS UNRESOLVED $where]
    } elseif {[::sorma::worldDaemon::fact $daemon line] eq {} && [dict get [::sorma::world get $daemon] state] ne "asking"} {
        Failed $key [dict get [::sorma::world get $daemon] why] [list SORMA COMM REFUSED $where]
    } else {
        dict set Answers($key) open 1
        ::sorma::world ask $daemon $request -timeout $Patience -command [list ::sorma::table::Answered $key]
    }
    return $key
}

proc ::sorma::table::Answered {key status value} {
    variable Answers
    if {![info exists Answers($key)]} {
        return
    }
    dict set Answers($key) open 0
    if {$status eq "error"} {
        Failed $key {*}$value
    } else {
        set came [expr {max([clock milliseconds], [dict get $Answers($key) came] + 1)}]
        set text [if {[dict exists $value text]} {dict get $value text}]        ;# an answer may be empty
        set Answers($key) [dict create asked [dict get $Answers($key) asked] open 0 came $came text $text error {} code {}]
    }
    ::sorma::news::hint answer $key
}

proc ::sorma::table::Failed {key message code} {
    variable Answers
    dict set Answers($key) open 0
    set name "[lindex $key 0]: "
    set message [regsub {^sorm@\S+: } $message {}]
    dict set Answers($key) error [if {[string first $name $message] == 0} {string range $message [string length $name] end} else {set message}]
    dict set Answers($key) code $code
}

# Another process has that name: what the one before has said does not count.
proc ::sorma::table::Process {event daemon dict} {
    variable Answers
    foreach {key entry} [array get Answers] {
        if {[lindex $key 0] eq $daemon} {
            set open [dict get $entry open]
            set Answers($key) [dict create asked [expr {$open ? [dict get $entry asked] : 0}] open $open came 0 text {} error {} code {}]
        }
    }
}

# Forget answers that nobody has wanted for a minute, when there are many.
proc ::sorma::table::Prune {} {
    variable Answers
    variable Many
    if {[array size Answers] < $Many} {
        return
    }
    set old [expr {[clock milliseconds] - 60000}]
    foreach {key entry} [array get Answers] {
        if {![dict get $entry open] && [dict get $entry asked] < $old} {
            unset Answers($key)
        }
    }
    set Many [expr {max(1000, 2 * [array size Answers])}]
}

# ---- parts of a table ----

# ::sorma::table::limits TYPE RANGE -- {LOW HIGH} of the range of a number, as a table has it; an end that is open is empty.
proc ::sorma::table::limits {type range} {
    set low [set high {}]
    if {$type in {int double vector}} {
        regexp {^(\S+) \.\. ([^\s,]+)} $range -> low high
        regexp {^(?:>= ([^\s,]+)|<= ([^\s,]+))} $range -> low high
    }
    return [list $low $high]
}

# ::sorma::table::zone HINTS VALUE -- where a value is: live, warn or alarm. HINTS: a dict that may have warn and alarm, {LOW HIGH}; an empty
# end is open. The worst element of a vector counts; NaN lies nowhere.
proc ::sorma::table::zone {hints value} {
    foreach zone {alarm warn} {
        if {![dict exists $hints $zone]} continue
        lassign [dict get $hints $zone] low high
        foreach number [regexp -all -inline {\S+} $value] {
            if {[string is double -strict $number] && ($low ne {} && $number < $low || $high ne {} && $number > $high)} {
                return $zone
            }
        }
    }
    return live
}

# ---- answers of strangers ----

# A dict of classes and installed.
proc ::sorma::table::ParseClasses text {
    set classes {}
    set installed {}
    foreach item [dict get $text classes] {
        lassign $item name version purpose
        if {![regexp {^[a-z]\w*$} $name]} continue
        if {$version eq {}} {
            lappend installed $name
        } else {
            dict set classes $name [list $version $purpose]
        }
    }
    return [dict create classes $classes installed $installed]
}
proc ::sorma::table::ParseInventory text {
    variable Most
    return [dict replace [ParseClasses $text] words [lsearch -all -inline -regexp [lrange [dict get $text words] 0 $Most] {^[^\s[:cntrl:]]+$}]]
}

# ::sorma::table::parse TEXT -- a table as describe gives it, from what DBX -describe has answered. Fails when that makes no sense.
proc ::sorma::table::parse text {
    foreach key {name exists class purpose version words signature example help} {
        dict set out $key [dict get $text $key]
    }
    dict set out exists [expr {[dict get $out exists] eq "1"}]
    foreach {key fields} {options 7 actions 5 inspections 5 reads 5 writes 5} {
        foreach item [dict get $text $key] {
            if {[llength $item] != $fields} {
                return -code error "$key of [llength $item] fields instead of $fields"
            }
            # A string may be any text; who shows it on a terminal cleans it.
            if {[regexp {[[:cntrl:]]} [expr {$key eq "options" && [lindex $item 1] eq "string" ? [lreplace $item 4 5] : $item}]]} {
                return -code error "control characters in $key"
            }
        }
        dict set out $key [dict get $text $key]
    }
    dict set out fixed [lrange [dict get $text fixed] 0 end]
    # Daemons of before hints have none.
    dict set out hints [dict map {option facts} [expr {[dict exists $text hints] ? [dict get $text hints] : {}}] {
        dict filter $facts key warn alarm kind names group expert danger secret
    }]
    # word danger ... of EXEC, options, actions and inspections that declare one.
    dict set out danger [dict filter [expr {[dict exists $text danger] ? [dict get $text danger] : {}}] script {word danger} {
        expr {$danger in {move power fire stop}}
    }]
    if {[dict exists $text dump]} {
        dict set out dump [dict get $text dump]
    }
    return $out
}

::sorma::news::hook daemon.process ::sorma::table::Process
