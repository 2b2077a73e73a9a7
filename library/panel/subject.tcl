# subject.tcl -- one service object as an operator handles it: its options with their facts, typed values that are not applied
# yet, and the results of requests. It knows no window: panels and widgets show what it says, and tell it what was done.
#
# Nothing here waits; everything comes from the model, sorma::world, and all is shared by who names the same object.
#
# state of an option
#   asking   nothing is known yet              stale    no answer: the value may be old, and age says how old
#   live     as it is                          refused  it may not be seen, or could not be set: why says it
#   mine     typed, not applied                gone     there is no such object
#   theirs   typed, and meanwhile somebody     locked   it cannot be set: only a recipe sets it, or the right is missing
#            else has changed it (by, at)
#   sending  applied, no answer yet

package require sorma::options
package require sorma::table
package provide sorma::subject 1.0

namespace eval ::sorma::subject {
    namespace export of
    namespace ensemble create
    variable Subjects           ;# dict: NAME -> object
    if {![info exists Subjects]} {
        set Subjects {}
    }
}

# ::sorma::subject of NAME ?-live ms? --
#       The subject of that name, made when it is first asked for: a command. Each call must be paid back by its release.
# Arguments:
#       ms      how often what changes by itself is asked for; 0: only what CTRL sets is told
proc ::sorma::subject::of {name args} {
    variable Subjects
    set live [dict get [::sorma::options::parse {-live {{whole 0 {}} 0}} $args] -live]
    if {![dict exists $Subjects $name]} {
        dict set Subjects $name [Subject new $name]
    }
    set subject [dict get $Subjects $name]
    $subject take $live
    return $subject
}

# An answer for a subject, unless the subject was destroyed meanwhile.
proc ::sorma::subject::answered {subject id prefix status value} {
    if {[info object isa object $subject]} {
        $subject Answered $id
        ::sorma::news::deliver $prefix [list $status $value]
    }
}

# It may be made by now.
proc ::sorma::subject::again subject {
    if {[info object isa object $subject]} {
        $subject Keep
    }
}

if {![info object isa object ::sorma::subject::Subject]} {oo::class create ::sorma::subject::Subject}
oo::define ::sorma::subject::Subject {
    variable name service where key         ;# NAME, and its parts; key: of the daemon, empty as long as that is not known
    variable held                           ;# token: the model knows its daemon for it
    variable users live token               ;# who has taken it; ms; of the model, empty: none
    variable table                          ;# of its class, as sorma::table gives it; empty: not known yet
    variable facts                          ;# dict: -option -> as option gives it
    variable values                         ;# dict: -option -> as sorma::world value tells it
    variable drafts                         ;# dict: -option -> {value since}: since: the live value when typing began
    variable waiting                        ;# dict: -option -> value that is on its way
    variable following                      ;# dict: -option -> 1: sent again meanwhile, to be applied when that has been answered
    variable faults                         ;# dict: -option -> {state why}, of what could not be set
    variable renewed                        ;# is the table of a process that has gone
    variable had                            ;# was the object there, since the subject was made
    variable keepers                        ;# how many want it to be made by itself
    variable made                           ;# boot of the process that was asked to make it last; empty: none was
    variable making                         ;# is that under way; failure: why it could not be made
    variable failure
    variable denied                         ;# why we may not set anything; empty: nothing is known of that
    variable listeners                      ;# dict: option -> dict: token -> command prefix
    variable underway                       ;# dict: token -> {number prefix}, of requests that are under way; prefix: for progress
    variable progress                       ;# token of what listens to progress; empty: nobody wanted to hear of it
    variable last

    constructor given {
        set name $given
        lassign [::sorma::table locate $name] service where
        set users [set live [set last 0]]
        set key [set token [set table [set facts [set denied [set underway [set progress {}]]]]]]
        set renewed [set had [set keepers [set making 0]]]
        set made [set failure {}]
        set held [::sorma::world hold $where]
        set values [set drafts [set waiting [set following [set faults [set listeners {}]]]]]
        ::sorma::news::hook answer [list [self] Heard]
    }

    # take MS -- one more who looks.
    method take ms {
        incr users
        if {$token eq {} || ($ms > 0 && ($live == 0 || $ms < $live))} {
            set live $ms
            my Watch
        }
    }
    # release -- one less; with the last it goes, and what was typed with it.
    method release {} {
        if {[incr users -1] <= 0} {
            after 0 [list if "\[info object isa object [self]\]" [list [self] End]]
        }
    }
    method End {} {
        if {$users <= 0} {
            my destroy
        }
    }
    destructor {
        ::sorma::world unwatch $token
        ::sorma::world unwatch $progress
        ::sorma::news::unhook [list [self] Heard]
        my Deaf
        ::sorma::world release $held
        dict unset ::sorma::subject::Subjects $name
    }

    # ---- what there is ----

    method name {} {
        return $name
    }
    # The table of its class, empty as long as that is not known.
    method table {} {
        return $table
    }
    # The facts of an option: a dict of type unit range default help fixed hints (as in the table). It also has low and high of
    # its range, empty where it is open.
    method option option {
        if {![dict exists $facts $option]} {
            return -code error -errorcode [list SORMA OPTION UNKNOWN $option] \
                "$name: there is no option $option; there are [join [dict keys $facts] {, }]"
        }
        return [dict get $facts $option]
    }
    method Facts {} {
        set facts {}
        foreach item [dict get $table options] {
            lassign $item option type unit range default value help
            lassign [::sorma::table::limits $type $range] low high
            dict set facts $option [dict create type $type unit $unit range $range low $low high $high default $default help $help \
                fixed [expr {$option in [dict get $table fixed]}] \
                hints [if {[dict exists $table hints $option]} {dict get $table hints $option}]]
        }
    }
    # place SERVICE -- the name under which we reach an object that this one names.
    method place service {
        return [if {$where eq {} || [string first @ $service] >= 0} {set service} else {string cat $service@$where}]
    }
    # How it is: a dict of state (of its daemon, as sorma::world gives it), why, and busy (in what).
    method state {} {
        set daemon [::sorma::world get $key]
        return [if {$key eq {}} {dict create state unresolved why "$where leads nowhere" busy {}} elseif {$daemon eq {}} {
            dict create state asking why {} busy {}
        } else {
            dict filter $daemon key state why busy
        }]
    }
    # trouble -- {STATE TEXT}, for all options together. STATE: stale, gone, locked, or live, which has no text.
    method trouble {} {
        set state [my state]
        set whole [my Whole]
        if {[dict get $whole state] eq "gone"} {
            return [list gone [my GoneText]]
        } elseif {[dict get $whole state] eq "stale"} {
            return [list stale [dict get $whole why]]
        } elseif {[dict get $state state] ni {alive busy asking}} {
            return [list stale "[dict get $state state][if {[dict get $state why] ne {}} {string cat {: } [dict get $state why]}]"]
        } elseif {$denied ne {}} {
            return [list locked $denied]
        }
        return {live {}}
    }
    # The first value that says something about all of them.
    method Whole {} {
        dict for {option value} $values {
            if {[dict get $value state] in {stale gone}} {
                return $value
            }
        }
        return {state live why {}}
    }
    method GoneText {} {
        if {$making} {
            return "there is no such object: it is being made \u2026"
        } elseif {$failure ne {}} {
            return "it cannot be made: $failure"
        } elseif {$had} {
            return "the object is not there any more: a request makes it again, from its recipe"
        }
        return "there is no such object yet: a request makes it"
    }
    # Is it known that there is no such object?
    method gone {} {
        return [expr {[dict get [my Whole] state] eq "gone"}]
    }
    # Can it be made now?
    method makes {} {
        return [expr {[my gone] && !$making}]
    }
    # make -- have the object made, by a request without other effects. keep N -- 1: do so for each process of its daemon; -1: stop that.
    method make {} {
        if {!$making} {
            set making 1
            set failure {}
            set made [my Boot]
            my ask {DBX -class} [list [self] Made]
            my Tell {} state
        }
    }
    method keep n {
        incr keepers $n
        my Keep
    }
    method Keep {} {
        if {$keepers > 0 && !$making && [my gone] && $made ne [my Boot]} {
            my make
        }
    }
    method Boot {} {
        set daemon [::sorma::world get $key]
        return [if {$daemon ne {}} {list [dict get $daemon boot]}]
    }
    method Made {status value} {
        set making 0
        set failure [if {$status ne "ok"} {lindex $value 0}]
        if {$status ne "ok" && [string match "SORMA COMM*" [lindex $value 1]]} {
            set made {}                 ;# perhaps it has not got there
            after 1000 [list ::sorma::subject::again [self]]
        }
        my Tell {} state
    }
    # Why we may not set anything; empty: nothing is known of that. It is why of each option that is locked for it, too.
    method denied {} {
        return $denied
    }
    # get OPTION -- a dict for views: value, state, why, live (the value there), by and at (its author; ms). A stale value has its age, and seen,
    # the last time of an answer [ms].
    method get option {
        set told [dict create value {} state asking by {} at 0 why {} age {} seen 0]
        if {[dict exists $values $option]} {
            set told [dict get $values $option]
        } elseif {[dict exists $values *]} {
            set told [dict get $values *]
        } else {
            set daemon [my state]
            switch -- [dict get $daemon state] {
                denied { dict set told state refused }
                silent - dead - refused - unresolved - gone { dict set told state stale }
            }
            dict set told why [dict get $daemon why]
        }
        dict set told live [dict get $told value]
        if {[dict get $told state] eq "live" && [dict exists $facts $option] && [dict get $facts $option fixed]} {
            dict set told state locked
            dict set told why [if {[dict exists $facts $option hints measured]} {
                string cat "measured: nobody sets it"
            } else {
                string cat "only a recipe sets it, before the object is made"
            }]
        } elseif {[dict get $told state] eq "live" && $denied ne {}} {
            dict set told state locked
            dict set told why $denied
        }
        if {[dict exists $drafts $option]} {
            lassign [dict get $drafts $option] value since
            dict set told value $value
            if {[dict get $told state] in {live stale}} {
                dict set told state [expr {[dict get $told live] eq $since ? "mine" : "theirs"}]
            }
        }
        if {[dict exists $waiting $option]} {
            dict set told value [dict get $waiting $option]
            dict set told state sending
        } elseif {[dict exists $faults $option]} {
            lassign [dict get $faults $option] state why
            dict set told state $state
            dict set told why $why
        }
        return $told
    }
    # The mark of an option, as sorma::style has it, and what is to be told beside it.
    method mark option {
        # Most are as ever, and this is asked for each of them whenever it changes.
        if {$denied eq {} && [dict exists $values $option state] && [dict get $values $option state] eq "live" && ![dict exists $drafts $option]
                && ![dict exists $waiting $option] && ![dict exists $faults $option] && [dict exists $facts $option]
                && ![dict get $facts $option fixed] && [dict get $facts $option hints] eq {}} {
            return {live {}}
        }
        set told [my get $option]
        set hints [dict get [my option $option] hints]
        set state [dict get $told state]
        set zone [::sorma::table::zone $hints [dict get $told live]]
        if {$state eq "theirs"} {
            set by [expr {[dict get $told by] ne {} ? [dict get $told by] : "somebody"}]
            set at [clock format [expr {[dict get $told at] / 1000}] -format %H:%M:%S]
            return [list theirs "$by has set it to [dict get $told live] at $at"]
        } elseif {$state eq "live" && $zone ne "live"} {
            lassign [dict get $hints $zone] low high
            set outside [expr {$low eq {} ? "above $high" : $high eq {} ? "below $low" : "outside $low .. $high"}]
            return [list $zone "[dict get {warn warning alarm alarm} $zone]: $outside"]
        }
        return [list $state [dict get $told why]]
    }
    # Options that were typed and not applied.
    method edited {} {
        return [dict keys $drafts]
    }

    # ---- what is done ----

    # edit OPTION VALUE -- typed, for later. An unchanged value is no draft.
    method edit {option value} {
        set told [my get $option]
        dict unset faults $option
        if {$value eq [dict get $told live]} {
            dict unset drafts $option
        } else {
            dict set drafts $option [list $value [if {[dict exists $drafts $option]} {lindex [dict get $drafts $option] 1} else {dict get $told live}]]
        }
        my Tell [list $option]
    }
    # revert ?OPTION ...? -- forget what was typed, of these or of all.
    method revert args {
        if {[llength $args] == 0} {
            set args [dict keys [if {$denied ne {}} {set facts} else {dict merge $drafts $faults}]]
        }
        set denied {}
        foreach option $args {
            dict unset drafts $option
            dict unset faults $option
        }
        my Tell $args
    }
    # apply ?OPTION ...? -- set what was typed, of these or of all, in one request. A refused value stays as it was typed.
    method apply args {
        my applyIf {} {*}$args
    }
    # applyIf CONDITIONS ?OPTION ...? -- the same, unless one of them has another value by then. CONDITIONS: dict of options and values.
    method applyIf {conditions args} {
        if {[llength $args] == 0} {
            set args [dict keys $drafts]
        }
        set words {}
        foreach option $args {
            if {[dict exists $drafts $option] && ![dict exists $waiting $option]} {
                set value [lindex [dict get $drafts $option] 0]
                lappend words $option $value
                dict set waiting $option $value
                dict unset faults $option
            }
        }
        if {[llength $words] > 0} {
            my Tell [dict keys $words]
            set known [concat {*}[lmap {option value} $conditions {if {![dict exists $words $option]} continue; list -if $option $value}]]
            my ask [list CTRL {*}$known {*}$words] [list [self] Applied $words]
        }
    }
    # send OPTION VALUE -- type and apply. While an answer is awaited only the last value is kept, and sent then.
    method send {option value} {
        my edit $option $value
        if {[dict exists $waiting $option]} {
            dict set following $option 1
        } else {
            my apply $option
        }
    }
    # ask WORDS PREFIX ?PROGRESS? -- a request: {EXEC ...}, {CTRL ...} or {DBX ...}. PREFIX is called with ok and the reply, or with error and a
    # list of message and code, unless the subject has gone; PROGRESS with each event progress that the object publishes meanwhile for this
    # request. EXEC may take as long as it wants. Returns a token, for cancel.
    method ask {words prefix {told {}}} {
        if {$key eq {}} {
            my Watch
        }
        if {$told ne {} && $progress eq {} && $key ne {}} {
            set progress [::sorma::world listen $service@$key -event progress -command [list [self] Progressed]]
        }
        set id request[incr last]
        set ms [expr {[lindex $words 0] eq "EXEC" ? 0 : 60000}]
        # Words that are no request are an answer too.
        if {[catch {::sorma::world ask $key [list $service {*}$words] -timeout $ms -command [list ::sorma::subject::answered [self] $id $prefix]} number failure]} {
            after 0 [list ::sorma::news::deliver $prefix [list error [list $number [dict get $failure -errorcode]]]]
        } else {
            dict set underway $id [list $number $told]
        }
        return $id
    }
    # value REQUEST MS PREFIX -- {EXEC ...} is asked again every MS; as sorma::world value, whose token it returns.
    method value {request ms prefix} {
        return [::sorma::world value $service@[::sorma::world use $where] $request -every $ms -command $prefix]
    }
    # cancel TOKEN -- give that request up: its prefix is called with error, and the object is told. Was it under way?
    method cancel id {
        lassign [if {[dict exists $underway $id]} {dict get $underway $id}] number
        return [expr {$number ne {} && [::sorma::world cancel $key $number]}]
    }
    method Answered id {
        dict unset underway $id
    }
    method Progressed event {
        dict for {id request} $underway {
            lassign $request number told
            if {$told ne {} && $number eq [dict get $event request]} {
                ::sorma::news::deliver $told [list $event]
            }
        }
    }
    method Applied {words status value} {
        lassign $value message code
        # The one that is to blame is named in the message; else nobody knows.
        set blamed [lsearch -all -inline -glob [dict keys $words] {-*}]
        set named [lmap option $blamed {if {![regexp "(^|\[^-\\w\])$option\\M" $message]} continue; set option}]
        foreach {option sent} $words {
            dict unset waiting $option
            if {$status eq "ok"} {
                if {[dict exists $drafts $option] && [lindex [dict get $drafts $option] 0] eq $sent} {
                    dict unset drafts $option
                    dict set values $option [dict merge {by {} at 0} [my Known $option] [dict create value $sent state live why {}]]
                    ::sorma::value taken $service@$key [dict create $option $sent]
                }
            } elseif {[llength $named] == 0 || $option in $named} {
                set locked [expr {[string match "SORMA COMM DENIED*" $code] || [string match "SORMA ACCESS*" $code]}]
                dict set faults $option [list [expr {$locked ? "locked" : "refused"}] $message]
                if {$locked} {
                    set denied $message
                }
            }
        }
        my Tell [dict keys [if {$denied ne {}} {set facts} else {set words}]]
        foreach {option sent} $words {
            if {[dict exists $following $option]} {
                dict unset following $option
                my apply $option
            }
        }
    }
    method Known option {
        return [if {[dict exists $values $option]} {dict get $values $option}]
    }

    # ---- who looks ----

    # listen PREFIX ?OPTION? -- PREFIX is called with table (the table has come, or another one), with state, or with values and a list of
    # options. OPTION: values are told of this one alone; empty: of none. Returns a token for unlisten.
    method listen {prefix {option *}} {
        set id [list $option [incr last]]
        dict set listeners {*}$id $prefix
        return $id
    }
    method unlisten id {
        if {$id ne {} && [dict exists $listeners {*}$id]} {
            dict unset listeners {*}$id
        }
    }
    method Tell {options {what values}} {
        foreach option [if {$what eq "values"} {list * {*}$options} else {dict keys $listeners}] {
            if {![dict exists $listeners $option]} continue
            dict for {n prefix} [dict get $listeners $option] {
                if {[dict exists $listeners $option $n]} {
                    ::sorma::news::deliver $prefix [list $what $options]
                }
            }
        }
    }

    # ---- the model ----

    method Deaf {} {
        if {$key ne {}} {
            ::sorma::worldDaemon::detach $service@$key [self]
        }
    }
    method Watch {} {
        if {$token ne {}} {
            ::sorma::world unwatch $token
        }
        my Deaf
        set key [::sorma::world use $where]
        if {$key eq {}} {
            set token {}
            return
        }
        ::sorma::worldDaemon::attach $service@$key [self]
        set token [::sorma::world value $service@$key * -every $live -command [list [self] Valued]]
        my Describe
    }
    method Describe {} {
        set found [::sorma::table describe $name]
        if {$found ne {}} {
            set renewed 0
        }
        if {$found ne {} && ($table eq {} || [my Shape $found] ne [my Shape $table])} {
            set table $found
            my Facts
            my Tell {} table
        }
    }
    # The part of a table that panels are made of: all but the values.
    method Shape table {
        return [list [lmap option [dict get $table options] {lreplace $option 5 5}] [dict filter $table key class fixed hints actions writes reads]]
    }
    method Heard {event about args} {
        if {[lindex $about 0] eq $key && ($table eq {} || $renewed)} {
            my Describe
        }
    }
    # Its daemon calls these, see worldDaemon.tcl.
    method objectMade {} {
        my Describe
    }
    method objectRemoved {} {}
    method lineMade {} {}
    method daemonChanged {} {
        set denied {}                       ;# perhaps another one, with another policy
        my Tell {} state
    }
    method daemonProcess {} {
        set renewed 1
        set failure {}
        my Keep
        my Describe                         ;# perhaps of another version
    }
    method Valued {what object told} {
        if {[dict exists $told *]} {
            set values [dict map {option value} $values {dict merge $value [dict filter [dict get $told *] key state why age seen]}]
        }
        dict unset values *
        dict for {option value} $told {
            dict set values $option $value
            # The typed value was set, by this user or another: it is no draft any more.
            if {[dict exists $drafts $option] && [lindex [dict get $drafts $option] 0] eq [dict get $value value] && [dict get $value state] eq "live"} {
                dict unset drafts $option
            }
        }
        if {$table eq {}} {
            my Describe
        }
        if {"live" in [lmap value [dict values $told] {dict get $value state}]} {
            set had 1
            set failure {}
        } else {
            my Keep
        }
        my Tell [dict keys [if {[dict exists $told *]} {dict merge $facts $values} else {set told}]]
    }

    export Heard Valued Applied Answered Progressed Made Keep End
}
